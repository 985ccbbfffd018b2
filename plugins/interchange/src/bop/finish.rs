//! The files that need the numbers of the assets, which the whole dataset gives.

use super::Bop;
use super::record::{Camera, ObjectRecord, Shown, ViewRecord};
use super::scene::Entries;
use crate::annotation_file;
use serde_json::json;
use std::collections::BTreeMap;
use syntable_formats::coco::{Annotation, Category, Image};
use syntable_formats::dataset::{DatasetWriter, Layout};
use syntable_formats::encode::json_shard::for_each_value_of;
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::scene::{SceneId, ViewId};

/// Names of the files of the dataset.
pub const FILES: [&str; 3] = ["camera.json", "dataset_info.json", "objects.json"];

/// Names of the files of a scene that are written at the end.
pub const OF_SCENE: [&str; 3] = ["scene_gt.json", "scene_gt_coco.json", "scene_gt_coco_modal.json"];

/// Objects of which less than this fraction is visible are ignored in evaluations.
const IGNORED_BELOW: f64 = 0.1;

/// Writes the files of the dataset, and those of each scene that have `obj_id`. One scene is in memory at a time.
pub fn write(config: &Bop, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    let summary = Summary::of(finish)?;
    let info = json!({
        "name": dataset.name,
        "program": dataset.program,
        "split": config.split,
        "scenes": finish.scenes().len(),
        "images": summary.images,
        "objects": summary.obj_ids.len(),
        "models": "not included: obj_id is a number of objects.json",
    });
    let mut objects = Entries::default();
    summary.obj_ids.iter().try_for_each(|(asset, obj_id)| objects.push(obj_id, asset))?;
    let [camera_file, info_file, objects_file] = FILES.map(|name| format!("{}/{name}", finish.id()));
    if let Some(camera) = &summary.camera {
        write_bytes(finish, &camera_file, &text(camera)?)?;
    }
    write_bytes(finish, &info_file, &text(&info)?)?;
    write_bytes(finish, &objects_file, &objects.finish())?;
    finish.scenes().iter().try_for_each(|&scene| write_scene(config, dataset, finish, scene, &summary.obj_ids))
}

/// What the shards say of the whole dataset.
#[derive(Default)]
struct Summary {
    images: usize,
    /// That of the first image.
    camera: Option<Camera>,
    /// Numbers of the assets by name.
    obj_ids: BTreeMap<String, u64>,
}

impl Summary {
    fn of(finish: &Finish) -> Result<Self> {
        let mut summary = Self::default();
        for &scene in finish.scenes() {
            for_each_value_of(finish, scene, |view: ViewRecord| {
                summary.images += 1;
                summary.camera.get_or_insert(view.camera);
                summary.obj_ids.extend(view.objects.into_iter().map(|object| (object.asset, 0)));
                Ok(())
            })?;
        }
        (1..).zip(summary.obj_ids.values_mut()).for_each(|(number, obj_id)| *obj_id = number);
        Ok(summary)
    }
}

fn write_scene(
    config: &Bop,
    dataset: &DatasetInfo,
    finish: &Finish,
    scene: SceneId,
    obj_ids: &BTreeMap<String, u64>,
) -> Result<()> {
    let mut views: Vec<ViewRecord> = Vec::new();
    for_each_value_of(finish, scene, |view| {
        views.push(view);
        Ok(())
    })?;
    let mut truth = Entries::default();
    for view in &views {
        let objects: Vec<_> = view.objects.iter().map(|object| object.ground_truth(obj_ids[&object.asset])).collect();
        truth.push(view.view, &objects)?;
    }
    let folder = config.folder(finish.id(), scene);
    let [truth_file, coco_file, modal_file] = OF_SCENE;
    write_bytes(finish, &format!("{folder}/{truth_file}"), &truth.finish())?;
    for (name, bbox) in [(coco_file, BoxOf::Amodal), (modal_file, BoxOf::Visible)] {
        let path = format!("{folder}/{name}");
        finish.write(&path, |out| {
            let mut file = DatasetWriter::new(out, &path, Layout::Lines)?;
            let category = |(asset, &id): (&String, &u64)| Category {
                id,
                name: asset.clone(),
                supercategory: dataset.name.clone(),
                ..Category::default()
            };
            let categories: Vec<_> = obj_ids.iter().map(category).collect();
            file.header(&annotation_file::info(dataset), &[annotation_file::license()], &categories)?;
            file.images(|images| views.iter().try_for_each(|view| images.record(&image(view))))?;
            file.annotations(|annotations| {
                let shown = views.iter().flat_map(|view| view.objects.iter().map(move |object| (view, object)));
                let shown = shown.filter_map(|(view, object)| Some((view, object, object.shown.as_ref()?)));
                (1..).zip(shown).try_for_each(|(id, (view, object, shown))| {
                    annotations.record(&annotation(id, view, object, shown, obj_ids[&object.asset], bbox))
                })
            })?;
            file.finish()
        })?;
    }
    Ok(())
}

/// The object that the box of an annotation is around.
#[derive(Debug, Clone, Copy)]
enum BoxOf {
    /// The part in the image, seen or not.
    Amodal,
    /// The visible part.
    Visible,
}

fn image(view: &ViewRecord) -> Image {
    Image {
        id: view.view.into(),
        file_name: super::Image::Rgb.path(ViewId(view.view)),
        width: view.camera.width,
        height: view.camera.height,
        license: Some(1),
        ..Image::default()
    }
}

fn annotation(
    id: u64,
    view: &ViewRecord,
    object: &ObjectRecord,
    shown: &Shown,
    obj_id: u64,
    bbox: BoxOf,
) -> Annotation {
    let bbox = match bbox {
        BoxOf::Amodal => shown.amodal_box,
        BoxOf::Visible => shown.visible_box,
    };
    let extra = json!({
        "ignore": object.visib_fract < IGNORED_BELOW,
        "width": view.camera.width,
        "height": view.camera.height,
    });
    Annotation {
        id,
        image_id: view.view.into(),
        category_id: obj_id,
        segmentation: Some(Segmentation::Uncompressed(shown.mask.clone())),
        area: shown.area.into(),
        bbox: bbox.map(f64::from),
        iscrowd: 0,
        extra: extra.as_object().cloned().unwrap_or_default(),
    }
}

fn text(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?;
    text.push(b'\n');
    Ok(text)
}

fn write_bytes(finish: &Finish, path: &str, bytes: &[u8]) -> Result<()> {
    finish.write(path, |out| out.write_all(bytes).map_err(|error| Error::io(path, &error)))
}
