//! HDF5 files in the layout of BlenderProc.

use crate::file::File;
use std::collections::BTreeSet;
use syntable_formats::encode::npy::{self, Array, Arrays};
use syntable_formats::encode::view_name;
use syntable_formats::include::{self, Included};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::{BODIES, CAMERA, DEPTH, INSTANCE, NORMAL, RGB};
use syntable_model::product::{Plane, Product, Scope, StatedCamera};

/// Writes one HDF5 file per view, as BlenderProc does.
///
/// # What it does
///
/// A file has the chosen datasets of BlenderProc, and each included product under its own name:
///
/// | dataset | type and shape | holds |
/// | --- | --- | --- |
/// | `colors` | uint8 `[H, W, 3]` | the image |
/// | `depth` | float32 `[H, W]` | meters along the optical axis; infinite where there is nothing |
/// | `distance` | float32 `[H, W]` | meters from the camera's center; infinite where there is nothing |
/// | `normals` | float32 `[H, W, 3]` | normals `n` of the camera frame as `0.5 n + 0.5`: x right, y up, z toward the viewer |
/// | `instance_segmaps` | unsigned `[H, W]` | id of the body that a pixel shows, table and room included; 0 where there is none |
/// | `category_id_segmaps` | unsigned `[H, W]` | category of that body: 1 is `object`, then the classes of pools by name; 0 for all that is no object |
/// | `instance_attribute_maps` | text | JSON: `idx`, `category_id`, `name` (pool and asset), `category` and `role` of each body in `instance_segmaps` |
///
/// Unsigned arrays have 8, 16 or 32 bits, whatever the largest value needs. Included products are arrays as the writer
/// `npy` stores them, with the ids of a product per instance in `{product}_ids`; what is no array, such as `camera`, is JSON
/// text. Arrays are compressed with gzip. `h5py.File(path)[name][()]` reads a dataset.
///
/// # Output
///
/// `{id}/{scene:06}_{view:04}.hdf5`, and `{id}/categories.json` with ids and names of all categories of the recipe if there
/// are ids of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Hdf5 {
    /// Datasets of BlenderProc to write.
    #[schemars(extend("uniqueItems" = true))]
    pub datasets: Vec<Dataset>,
    /// Products of the view to write as well.
    pub include: Included,
}

/// A dataset of BlenderProc.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dataset {
    /// The image.
    Colors,
    /// Depth along the optical axis.
    Depth,
    /// Distance from the camera's center.
    Distance,
    /// Normals in the camera frame.
    Normals,
    /// Ids of bodies.
    InstanceSegmaps,
    /// Categories of bodies.
    CategoryIdSegmaps,
    /// What the ids of bodies stand for.
    InstanceAttributeMaps,
}

impl Dataset {
    pub(crate) const ALL: [Self; 7] = [
        Self::Colors,
        Self::Depth,
        Self::Distance,
        Self::Normals,
        Self::InstanceSegmaps,
        Self::CategoryIdSegmaps,
        Self::InstanceAttributeMaps,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Colors => "colors",
            Self::Depth => "depth",
            Self::Distance => "distance",
            Self::Normals => "normals",
            Self::InstanceSegmaps => "instance_segmaps",
            Self::CategoryIdSegmaps => "category_id_segmaps",
            Self::InstanceAttributeMaps => "instance_attribute_maps",
        }
    }

    fn reads(self) -> Vec<Input> {
        match self {
            Self::Colors => vec![Input::of(RGB)],
            Self::Depth => vec![Input::of(DEPTH)],
            // Of a dataset that is converted, the camera is known from this product alone.
            Self::Distance => vec![Input::of(DEPTH), Input::of(CAMERA)],
            Self::Normals => vec![Input::of(NORMAL)],
            Self::InstanceSegmaps => vec![Input::of(INSTANCE)],
            Self::CategoryIdSegmaps | Self::InstanceAttributeMaps => vec![Input::of(INSTANCE), Input::of(BODIES)],
        }
    }
}

impl Default for Hdf5 {
    fn default() -> Self {
        Self { datasets: Dataset::ALL.to_vec(), include: Included::default() }
    }
}

impl Config for Hdf5 {
    type Stage = dyn Writer;
    const KIND: &'static str = "hdf5";
    const EXAMPLE: &'static str =
        "datasets = [\"colors\", \"depth\", \"instance_segmaps\"]\ninclude = [\"camera\", \"amodal_mask\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        if self.datasets.is_empty() && self.include.is_empty() {
            let help = "name datasets, or products in `include`";
            return Err(ConfigError::new("datasets", "there is nothing to write").help(help));
        }
        self.include.check_free(&Dataset::ALL.map(Dataset::name))?;
        Ok(self.boxed())
    }
}

impl ImageWriter for Hdf5 {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let of_view = |key: &KeyId| match key.scope.comes_with_view() {
            true => Ok(()),
            false => Err("a file of this writer has one view; write it with jsonl or npz".to_owned()),
        };
        let datasets = self.datasets.iter().enumerate().flat_map(|(place, dataset)| {
            let of_entry = move |input: Input| Input { option: Some(format!("datasets[{place}]")), ..input };
            dataset.reads().into_iter().map(of_entry)
        });
        datasets.chain(self.include.inputs(Accepts::If(of_view))).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let mut file = File::new();
        for &dataset in &self.datasets {
            dataset.add(&mut file, cx, products)?;
        }
        for (product, key) in self.include.of_scope(products, Scope::View) {
            add_product(&mut file, product, &key, &products.value(product)?, cx)?;
        }
        output.write(&path(output.id(), &view_name(cx.scene_id, cx.view_id)), &file.finish()?)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![path(of.id, &view_name(scene, view))],
            (None, None) if self.has_category_ids() => vec![include::categories_path(of.id)],
            _ => Vec::new(),
        }
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        if self.has_category_ids() { include::write_categories(cx.dataset, finish) } else { Ok(()) }
    }
}

impl Hdf5 {
    /// Whether files of views have ids of categories.
    fn has_category_ids(&self) -> bool {
        let of_bodies = [Dataset::CategoryIdSegmaps, Dataset::InstanceAttributeMaps];
        of_bodies.iter().any(|it| self.datasets.contains(it)) || self.include.has_category_ids()
    }
}

fn path(id: &str, name: &str) -> String {
    format!("{id}/{name}.hdf5")
}

/// Adds a product: as arrays if it is made of numbers, else as JSON text.
fn add_product(file: &mut File, name: &str, key: &KeyId, value: &Value, cx: &ImageContext) -> Result<()> {
    match npy::arrays_of_numbers(name, key, value, include::shape(cx)) {
        Some(Arrays::One(array)) => file.array(name, &array),
        Some(Arrays::PerInstance { values, ids }) => {
            file.array(name, &values)?;
            file.array(&format!("{name}_ids"), &ids)
        }
        None => file.text(name, &json(value)?),
    }
}

fn json(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))
}

impl Dataset {
    fn add(self, file: &mut File, cx: &ImageContext, products: &Products) -> Result<()> {
        let name = self.name();
        let plane = |value: Value| Array::of(&value);
        match self {
            Self::Colors => file.array(name, &plane(products.get(RGB)?.encode())?),
            Self::Depth => file.array(name, &plane(products.get(DEPTH)?.encode())?),
            Self::Distance => file.array(
                name,
                &plane(distance(products.get(DEPTH)?, &StatedCamera::of(products.get(CAMERA)?)?).encode())?,
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
                file.text(name, &json(&bodies)?)
            }
        }
    }
}

/// Distances from the camera's center, m, of depths along the optical axis.
fn distance(depth: &Plane<f32>, camera: &StatedCamera) -> Plane<f32> {
    Plane::from_fn(depth.width(), depth.height(), |x, y| {
        let ray = camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5);
        ray.map_or(f32::INFINITY, |ray| (f64::from(*depth.at(x, y)) * ray.norm()) as f32)
    })
}

/// An array of the fewest bits that its values need.
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

/// An entry of `instance_attribute_maps`.
#[derive(Serialize)]
struct Attributes {
    idx: u16,
    category_id: u32,
    name: String,
    category: String,
    role: String,
}

/// What the writer reads of an entry of the product `bodies`.
#[derive(Deserialize)]
struct BodyView {
    id: u16,
    role: String,
    pool: String,
    name: String,
    category: String,
}

/// All bodies of the scene.
fn bodies(cx: &ImageContext, products: &Products) -> Result<Vec<Attributes>> {
    let bodies: Vec<BodyView> =
        serde_json::to_value(products.get(BODIES)?).and_then(serde_json::from_value).map_err(|error| {
            Error::new(format!("product `{}` is not a list of bodies: {error}", BODIES.name()))
                .help("let the annotator `bodies` provide it")
        })?;
    let attributes = |body: BodyView| {
        Ok(Attributes {
            idx: body.id,
            category_id: if body.role == "object" { cx.dataset.category_id(&body.category)? } else { 0 },
            name: format!("{}/{}", body.pool, body.name),
            category: body.category,
            role: body.role,
        })
    };
    bodies.into_iter().map(attributes).collect()
}

register!(Hdf5);
