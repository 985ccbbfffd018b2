//! Writes HDF5 files of views.

use crate::file::Hdf5File;
use crate::hdf5::{BlenderProcDataset, Hdf5};
use crate::record::{BodyAttributes, EXTENSION, IDS_END, OBJECT_ROLE};
use std::collections::BTreeSet;
use syntable_formats::depth::DepthSource;
use syntable_formats::encode::npy::{self, Array, NpyArrays};
use syntable_formats::encode::view_name;
use syntable_formats::writer::ImageWriter;
use syntable_formats::{include, json};
use syntable_model::prelude::*;
use syntable_model::product::standard::{BODIES, CAMERA, INSTANCE, NORMAL, RGB};
use syntable_model::product::{Plane, Product, Scope, StatedCamera};

impl ImageWriter for Hdf5 {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let of_view = |key: &KeyId| match key.scope.comes_with_view() {
            true => Ok(()),
            false => Err("a file of this writer has one view; write it with jsonl or npz".to_owned()),
        };
        let datasets = self.datasets.iter().enumerate().flat_map(|(place, dataset)| {
            let of_entry = move |input: Input| Input { option: Some(format!("datasets[{place}]")), ..input };
            dataset.reads(self.depth).into_iter().map(of_entry)
        });
        datasets.chain(self.include.inputs(Accepts::when(of_view))).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let mut file = Hdf5File::new();
        for &dataset in &self.datasets {
            dataset.add(&mut file, self.depth, cx, products)?;
        }
        for (product, key) in self.include.of_scope(products, Scope::View) {
            add_product(&mut file, product, &key, &products.value(product)?, cx)?;
        }
        output.write(&path(output.id(), &view_name(cx.scene_id, cx.view_id)), &file.finish()?)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![path(of.id, &view_name(scene, view))],
            _ => include::list_paths(of, self.has_category_ids()),
        }
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        include::write_lists(cx.dataset, finish, self.has_category_ids())
    }
}

impl Hdf5 {
    /// Whether the files of views contain category ids.
    fn has_category_ids(&self) -> bool {
        let of_bodies = [BlenderProcDataset::CategoryIdSegmaps, BlenderProcDataset::InstanceAttributeMaps];
        of_bodies.iter().any(|it| self.datasets.contains(it)) || self.include.has_category_ids()
    }
}

fn path(id: &str, name: &str) -> String {
    format!("{id}/{name}.{EXTENSION}")
}

/// Adds a product: as arrays if it is numeric, otherwise as JSON text.
fn add_product(file: &mut Hdf5File, name: &str, key: &KeyId, value: &Value, cx: &ImageContext) -> Result<()> {
    match npy::arrays_of_numbers(name, key, value, include::shape(cx)) {
        Some(NpyArrays::One(array)) => file.array(name, &array),
        Some(NpyArrays::PerInstance { values, ids }) => {
            file.array(name, &values)?;
            file.array(&format!("{name}{IDS_END}"), &ids)
        }
        None => file.text(name, &json::text(value)?),
    }
}

impl BlenderProcDataset {
    fn reads(self, depth: DepthSource) -> Vec<Input> {
        match self {
            Self::Colors => vec![Input::of(RGB)],
            Self::Depth => vec![depth.input()],
            // In a converted dataset, this product is the only source of the camera.
            Self::Distance => vec![depth.input(), Input::of(CAMERA)],
            Self::Normals => vec![Input::of(NORMAL)],
            Self::InstanceSegmaps => vec![Input::of(INSTANCE)],
            Self::CategoryIdSegmaps | Self::InstanceAttributeMaps => vec![Input::of(INSTANCE), Input::of(BODIES)],
        }
    }

    fn add(self, file: &mut Hdf5File, depth: DepthSource, cx: &ImageContext, products: &Products) -> Result<()> {
        let name = self.name();
        let plane = |value: Value| Array::of(&value);
        match self {
            Self::Colors => file.array(name, &plane(products.get(RGB)?.encode())?),
            Self::Depth => file.array(name, &plane(products.get(depth.key())?.encode())?),
            Self::Distance => file.array(
                name,
                &plane(distance(products.get(depth.key())?, &StatedCamera::of(products.get(CAMERA)?)?).encode())?,
            ),
            Self::Normals => {
                let coded = products.get(NORMAL)?.map(|&[x, y, z]| [x, -y, -z].map(|v| 0.5 * v + 0.5));
                file.array(name, &plane(coded.encode())?)
            }
            Self::InstanceSegmaps => file.array(name, &narrow(&products.get(INSTANCE)?.map(|id| id.0.into()))?),
            Self::CategoryIdSegmaps => {
                let bodies = bodies(cx, products)?;
                let category =
                    |id: &InstanceId| bodies.iter().find(|body| body.idx == id.0).map_or(0, |body| body.category_id);
                file.array(name, &narrow(&products.get(INSTANCE)?.map(category))?)
            }
            Self::InstanceAttributeMaps => {
                let shown: BTreeSet<u16> = products.get(INSTANCE)?.data().iter().map(|id| id.0).collect();
                let mut bodies = bodies(cx, products)?;
                bodies.retain(|body| shown.contains(&body.idx));
                file.text(name, &json::text(&bodies)?)
            }
        }
    }
}

/// Distances from the camera's center, m, computed from depths along the optical axis.
fn distance(depth: &Plane<f32>, camera: &StatedCamera) -> Plane<f32> {
    Plane::from_fn(depth.width(), depth.height(), |x, y| {
        let ray = camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5);
        ray.map_or(f32::INFINITY, |ray| (f64::from(*depth.at(x, y)) * ray.norm()) as f32)
    })
}

/// An array with the fewest bits that its values need.
fn narrow(plane: &Plane<u32>) -> Result<Array> {
    let largest = plane.data().iter().copied().max().unwrap_or(0);
    Array::of(&if largest <= u8::MAX.into() {
        plane.map(|&value| value as u8).encode()
    } else if largest <= u16::MAX.into() {
        plane.map(|&value| value as u16).encode()
    } else {
        plane.encode()
    })
}

/// The fields of an entry of the product `bodies` that the writer reads.
#[derive(Deserialize)]
struct BodyView {
    id: u16,
    role: String,
    pool: String,
    name: String,
    category: String,
}

/// All bodies of the scene.
fn bodies(cx: &ImageContext, products: &Products) -> Result<Vec<BodyAttributes>> {
    let bodies: Vec<BodyView> = json::typed(products.get(BODIES)?).map_err(|error| {
        Error::new(format!("product `{}` is not a list of bodies: {error}", BODIES.name()))
            .help("let the annotator `bodies` provide it")
    })?;
    let attributes = |body: BodyView| {
        Ok(BodyAttributes {
            idx: body.id,
            category_id: if body.role == OBJECT_ROLE { cx.dataset.category_id(&body.category)? } else { 0 },
            name: format!("{}/{}", body.pool, body.name),
            category: Some(body.category),
            role: Some(body.role),
        })
    };
    bodies.into_iter().map(attributes).collect()
}
