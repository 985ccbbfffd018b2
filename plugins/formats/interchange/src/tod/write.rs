//! Writes TOD's scenes.

use super::Tod;
use super::record::{
    DESCRIPTION, ENDS, IMAGES, ObjectDescription, ROOM, SCENE, SceneDescription, TABLE, TodCamera, VIEWS, WITH_OBJECTS,
    WITH_TABLE, WITHOUT_OBJECTS,
};
use crate::depth;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::encode::png::PngImage;
use syntable_formats::encode::rgb::{RgbFiles, RgbFormat};
use syntable_formats::image_file::{self, RgbFile};
use syntable_formats::json::{typed, unwritable};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CAMERA, CUBOID, OBJECT_NAME, RGB, TABLETOP_MASK, VISIBLE_MASK};
use syntable_model::product::{Painted, StatedCamera};
use syntable_model::scene::SceneId;

/// Cameras and objects from the views of a scene.
#[derive(Debug, Default)]
pub struct TodScene {
    cameras: BTreeMap<u32, TodCamera>,
    objects: BTreeMap<u16, ObjectDescription>,
    /// Corners of the boxes around the surfaces that the views show, m.
    shown: BTreeMap<u16, [[f64; 3]; 2]>,
}

/// The part of the product `camera` that TOD stores.
#[derive(Debug, Deserialize)]
struct CameraProduct {
    world_from_camera: Option<[[f64; 4]; 4]>,
}

/// The part of the product `cuboid` that TOD stores.
#[derive(Debug, Deserialize)]
struct CuboidProduct {
    corners_world_m: [[f64; 3]; 8],
}

/// Center of the first pixel in an image whose corner is (0, 0).
const PIXEL_CENTER: f64 = 0.5;

impl TodScene {
    /// Adds the camera of a view, and the surfaces of `objects` in it.
    fn add(
        &mut self,
        view: u32,
        (camera, pose): (&StatedCamera, &[[f64; 4]; 4]),
        objects: &BTreeSet<InstanceId>,
        depth: &Plane<f32>,
        ids: &Plane<InstanceId>,
    ) {
        self.cameras.insert(view, TodCamera::of(pose));
        for (pixel, (id, z)) in ids.data().iter().zip(depth.data()).enumerate() {
            if !z.is_finite() || !objects.contains(id) {
                continue;
            }
            let at = [pixel as u32 % depth.width(), pixel as u32 / depth.width()];
            let [u, v] = at.map(|at| f64::from(at) + PIXEL_CENTER);
            let Some(direction) = camera.unproject(u, v) else { continue };
            let z = f64::from(*z);
            let in_camera = [direction.x * z, direction.y * z, z, 1.0];
            let point: [f64; 3] = std::array::from_fn(|row| (0..4).map(|axis| pose[row][axis] * in_camera[axis]).sum());
            let [low, high] = self.shown.entry(id.0).or_insert([point; 2]);
            *low = std::array::from_fn(|axis| low[axis].min(point[axis]));
            *high = std::array::from_fn(|axis| high[axis].max(point[axis]));
        }
    }

    /// The description. Objects are in the order of their labels; an object that no view shows has an empty entry.
    fn description(self) -> SceneDescription<ObjectDescription, serde_json::Value> {
        let Self { cameras, mut objects, shown } = self;
        for (id, [low, high]) in shown {
            let center = std::array::from_fn(|axis| f64::midpoint(low[axis], high[axis]));
            objects.entry(id).or_default().center_m.get_or_insert(center);
        }
        let last = objects.keys().last().copied().unwrap_or_default();
        let camera = |view: u32| json!(cameras.get(&view));
        let end = cameras.keys().last().map_or(0, |last| last + 1);
        let with_objects: Vec<_> = (WITHOUT_OBJECTS..end).map(camera).collect();
        let named = [(ROOM, camera(0)), (WITH_TABLE, camera(1)), (WITH_OBJECTS, with_objects.into())];
        let views = named.into_iter().filter(|_| !cameras.is_empty()).map(|(key, view)| (key.to_owned(), view));
        SceneDescription {
            object_descriptions: (1..=last).map(|id| objects.remove(&id).unwrap_or_default()).collect(),
            views: views.collect(),
        }
    }
}

impl Tod {
    fn folder(&self, id: &str, scene: SceneId) -> String {
        format!("{id}/{}/{SCENE}{:05}", self.split.folder(), scene.0)
    }

    /// Paths of the images of a view.
    fn images(&self, id: &str, scene: SceneId, view: u32) -> [String; 3] {
        let folder = self.folder(id, scene);
        std::array::from_fn(|image| format!("{folder}/{}{view:05}.{}", IMAGES[image], ENDS[image]))
    }
}

/// The label of each pixel: 0 without an object or the table.
fn label_image(ids: &Plane<InstanceId>, table: Option<&Mask>) -> Result<PngImage> {
    let last = ids.data().iter().map(|id| id.0).max().unwrap_or_default();
    let most = u16::from(u8::MAX) - TABLE;
    if last > most {
        return Err(Error::new(format!("an image shows object {last}; TOD has labels for {most}"))
            .help("place fewer objects, or write another format"));
    }
    let table = table.map(Mask::to_plane);
    let label = |x, y| match ids.at(x, y).0 {
        0 => u8::from(table.as_ref().is_some_and(|table| *table.at(x, y))) * TABLE as u8,
        id => (id + TABLE) as u8,
    };
    Ok(PngImage::gray8(&Plane::from_fn(ids.width(), ids.height(), label)))
}

/// Center of a cuboid in the world, m.
fn center(cuboid: &Value) -> Result<[f64; 3]> {
    let corners = typed::<CuboidProduct>(cuboid).map_err(|error| wrong(CUBOID.name(), &error))?.corners_world_m;
    let mean = |axis: usize| corners.iter().map(|corner| corner[axis]).sum::<f64>() / corners.len() as f64;
    Ok(std::array::from_fn(mean))
}

fn wrong(product: &str, error: &serde_json::Error) -> Error {
    Error::new(format!("product `{product}` does not have what TOD needs: {error}"))
}

impl ImageWriter for Tod {
    type Scene = TodScene;

    fn reads(&self) -> Vec<Input> {
        let more = [Input::of(CAMERA), Input::of(CUBOID), Input::of(OBJECT_NAME), Input::of(TABLETOP_MASK)];
        let needed = [Input::of(RGB), image_file::input(), Input::of(VISIBLE_MASK), self.depth.input()];
        needed.into_iter().chain(more.map(Input::optional)).collect()
    }

    fn view(&self, scene: &mut TodScene, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (rgb, visible) = (products.get(RGB)?, products.get(VISIBLE_MASK)?);
        let painted = Painted::new([rgb.width(), rgb.height()], visible.iter());
        painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
        let empty = visible.iter().filter(|(_, mask)| mask.is_empty()).count();
        cx.log.left_out(&LeftOut::without_pixels(empty, visible.iter().count()));
        let [color, depth, labels] = self.images(output.id(), cx.scene_id, cx.view_id.0);
        let jpeg = RgbFiles { format: RgbFormat::Jpeg, quality: Some(self.quality) };
        output.write(&color, &RgbFile::of(products, &[RgbFormat::Jpeg], jpeg)?.bytes)?;
        depth::image(self.depth, products, cx.log)?.write(output, &depth)?;
        label_image(&painted.ids, products.optional(TABLETOP_MASK)?)?.write(output, &labels)?;
        let (names, cuboids) = (products.optional(OBJECT_NAME)?, products.optional(CUBOID)?);
        let mut others = BTreeSet::new();
        for id in painted.shown() {
            let of = scene.objects.entry(id.0).or_default();
            of.mesh_filename = names.and_then(|names| names.get(id)).cloned();
            match cuboids.and_then(|cuboids| cuboids.get(id)) {
                Some(cuboid) => of.center_m = Some(center(cuboid)?),
                None => drop(others.insert(id)),
            }
        }
        if let Some(camera) = products.optional(CAMERA)? {
            let stated = StatedCamera::of(camera)?;
            let camera: CameraProduct = typed(camera).map_err(|error| wrong(CAMERA.name(), &error))?;
            if let Some(pose) = &camera.world_from_camera {
                scene.add(cx.view_id.0, (&stated, pose), &others, products.get(self.depth.key())?, &painted.ids);
            }
        }
        Ok(())
    }

    fn close(&self, scene: TodScene, cx: &ImagesContext, _: &Products, output: &Output) -> Result<()> {
        let text = serde_json::to_vec(&scene.description()).map_err(unwritable)?;
        output.write(&format!("{}/{DESCRIPTION}", self.folder(output.id(), cx.scene_id)), &text)
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, _: &Finish) -> Result<()> {
        let views = cx.dataset.views_per_scene;
        if views != VIEWS {
            let what = format!("scenes have {views} views, and the loaders of TOD read {VIEWS} views of each scene");
            let help =
                format!("set `dataset.views_per_scene = {VIEWS}`, or change `NUM_VIEWS_PER_SCENE` in the loader");
            cx.log.warn(&Error::new(what).help(help));
        }
        Ok(())
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) => self.images(of.id, scene, view.0).into(),
            (Some(scene), None) => vec![format!("{}/{DESCRIPTION}", self.folder(of.id, scene))],
            _ => Vec::new(),
        }
    }
}
