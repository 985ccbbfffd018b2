//! The files that need the numbers of the assets, which are known only once the whole dataset is written.

use super::record::{
    BopCamera, BopImage, BopPixelCenters, CAMERA_FILE, DATASET_INFO, FINISHED_SCENE_FILES, GroundTruth, KEY_TO_SHARD,
    MODELS_INFO, OBJECTS, ObjectRecord, PIXEL_CENTERS, SAMPLE_GT, ShownMask, TARGETS, ViewRecord, key, model_file,
    shard_file,
};
use super::scene::{Entries, json as line};
use super::shard;
use super::surface::ModelSurface;
use super::{Bop, BopLayout, BopMeshes};
use crate::family::write as family;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::ops::RangeInclusive;
use syntable_formats::coco::{Category, CocoAnnotation, CocoImage, License};
use syntable_formats::dataset::{DatasetWriter, JsonLayout as FileLayout};
use syntable_formats::encode::tar::TarWriter;
use syntable_formats::include::write_file;
use syntable_formats::json::pretty;
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::scene::{SceneId, ViewId};

/// Names of the files of the dataset.
const FILES: [&str; 3] = [CAMERA_FILE, DATASET_INFO, OBJECTS];

/// Evaluations ignore objects with a smaller visible fraction.
const IGNORED_BELOW: f64 = 0.1;

/// Most images of a tar file.
const IMAGES_PER_SHARD: usize = 1000;

/// Path of a tar file.
fn web_shard(config: &Bop, id: &str, number: usize) -> String {
    format!("{}/{}", config.web_folder(id), shard_file(number))
}

/// Name of a texture file, in the folder of the mesh.
fn texture_file(obj_id: u64) -> String {
    format!("obj_{obj_id:06}.png")
}

/// Path of a mesh.
fn model_path(id: &str, folder: &str, obj_id: u64) -> String {
    format!("{id}/{folder}/{}", model_file(obj_id))
}

/// Paths of the files of the dataset that are known before a run.
pub fn paths(config: &Bop, dataset: &DatasetInfo, id: &str) -> Vec<String> {
    let own = FILES.into_iter().chain(config.is_test().then_some(TARGETS)).map(|name| format!("{id}/{name}"));
    let mut paths: Vec<String> = own.collect();
    if config.layout == BopLayout::Webdataset {
        let images = dataset.scenes as usize * dataset.views_per_scene as usize;
        paths.extend((0..images.div_ceil(IMAGES_PER_SHARD)).map(|number| web_shard(config, id, number)));
        paths.push(format!("{}/{KEY_TO_SHARD}", config.web_folder(id)));
    }
    let folders = config.models.folders().iter();
    let of_folder = |folder| [format!("{id}/{folder}/{MODELS_INFO}"), model_path(id, folder, 1)];
    paths.extend(folders.flat_map(|folder| of_folder(folder)));
    paths
}

/// Writes the files of the dataset, and the files of each scene that contain `obj_id`. One scene is in memory at a
/// time.
pub fn write(config: &Bop, cx: &DatasetContext, finish: &Finish) -> Result<()> {
    let dataset = cx.dataset;
    let summary = Summary::of(finish, cx.log)?;
    let mut info = json!({
        "name": dataset.name,
        "program": dataset.program,
        "split": config.split,
        "scenes": finish.scenes().len(),
        "images": summary.images.iter().map(|(_, views)| views.len()).sum::<usize>(),
        "objects": summary.obj_ids.len(),
        "models": match config.models {
            BopMeshes::None => "not included: obj_id is a number of objects.json",
            BopMeshes::Models | BopMeshes::ModelsAndEval => "models/obj_{obj_id:06}.ply; objects.json has the names",
        },
    });
    if config.pixel_centers != BopPixelCenters::default() {
        info[PIXEL_CENTERS] = json!(config.pixel_centers);
    }
    let mut objects = Entries::default();
    by_number(&summary.obj_ids).iter().try_for_each(|(obj_id, asset)| objects.push(obj_id, asset))?;
    let [camera_file, info_file, objects_file] = FILES.map(|name| format!("{}/{name}", finish.id()));
    // `scene_camera.json` has the cameras of all images; the dataset has one only if they agree.
    if let [camera] = &summary.cameras[..] {
        write_file(finish, &camera_file, &pretty(camera)?)?;
    }
    write_file(finish, &info_file, &pretty(&info)?)?;
    write_file(finish, &objects_file, &objects.finish())?;
    if config.is_test() {
        write_targets(finish, &summary.obj_ids)?;
    }
    if config.models != BopMeshes::None {
        write_models(config, finish, &summary.obj_ids)?;
    }
    match config.layout {
        BopLayout::Scenewise => {
            let mut scenes = finish.scenes().iter();
            scenes.try_for_each(|&scene| write_scene(config, dataset, finish, scene, &summary.obj_ids))
        }
        BopLayout::Webdataset => write_web_shards(config, finish, &summary),
    }
}

/// Content of all shards for the files of the dataset.
#[derive(Default)]
struct Summary {
    /// The views of each scene.
    images: Vec<(SceneId, Vec<ViewId>)>,
    /// The first two cameras that differ, or fewer.
    cameras: Vec<BopCamera>,
    /// Numbers of the assets by name, as objects state them.
    obj_ids: BTreeMap<String, u64>,
}

impl Summary {
    fn of(finish: &Finish, log: &dyn Log) -> Result<Self> {
        let mut summary = Self::default();
        let mut stated: BTreeMap<String, BTreeSet<Option<u64>>> = BTreeMap::new();
        for &scene in finish.scenes() {
            let mut numbers = Vec::new();
            for view in shard::views(finish, scene)? {
                numbers.push(ViewId(view.view));
                if summary.cameras.len() < 2 && !summary.cameras.contains(&view.camera) {
                    summary.cameras.push(view.camera);
                }
                for object in view.objects {
                    stated.entry(object.asset).or_default().insert(object.obj_id);
                }
            }
            summary.images.push((scene, numbers));
        }
        summary.obj_ids = numbers_of(stated, log)?;
        Ok(summary)
    }
}

/// The number of each asset, which all its objects must state. If no object states a number, the position of the asset
/// in the list of names is used.
fn numbers_of(stated: BTreeMap<String, BTreeSet<Option<u64>>>, log: &dyn Log) -> Result<BTreeMap<String, u64>> {
    if stated.values().all(|ids| ids.iter().all(Option::is_none)) {
        if !stated.is_empty() {
            log.warn(
                &Error::new("`object_info` has no `obj_id`, so objects are numbered in the order of their names")
                    .help("other parts of the dataset may number them otherwise; objects.json lists the numbers"),
            );
        }
        return Ok(stated.into_keys().zip(1..).collect());
    }
    let refuse = |message: String, help: &str| Err(Error::new(message).help(help));
    let mut obj_ids = BTreeMap::new();
    let mut owners: BTreeMap<u64, String> = BTreeMap::new();
    for (asset, ids) in stated {
        let mut ids = ids.into_iter();
        let (first, second) = (ids.next().flatten(), ids.next());
        let Some(id) = first else {
            let help = "scenes of an earlier version of the program have none: a run with `options.rewrite` writes them again in the \
                        folder of their run, and `syntable convert` can then convert them";
            return refuse(format!("`{asset}` has no `obj_id`, and other objects have one"), help);
        };
        if id == 0 {
            return refuse(format!("`{asset}` has the `obj_id` 0"), "numbers of BOP are from 1");
        }
        if let Some(other) = second {
            let other = other.map_or_else(|| "none".to_owned(), |other| other.to_string());
            let help =
                "an asset has one number in a dataset: state it with the pool's `ids`, and make the dataset again";
            return refuse(format!("`{asset}` has the `obj_id` {id} in some scenes, and {other} in others"), help);
        }
        if let Some(other) = owners.insert(id, asset.clone()) {
            let help = "give the pools `ids` or `first_id` so that numbers differ";
            return refuse(format!("`{other}` and `{asset}` have the same `obj_id` {id}"), help);
        }
        obj_ids.insert(asset, id);
    }
    Ok(obj_ids)
}

/// Assets by their numbers.
fn by_number(obj_ids: &BTreeMap<String, u64>) -> BTreeMap<u64, &String> {
    obj_ids.iter().map(|(asset, &id)| (id, asset)).collect()
}

/// An entry of the targets of BOP Challenge 2019.
#[derive(Serialize)]
struct BopTarget {
    im_id: u32,
    inst_count: u64,
    obj_id: u64,
    scene_id: u32,
}

/// Writes the targets, which are the objects that methods must find: those with a sufficient visible fraction.
fn write_targets(finish: &Finish, obj_ids: &BTreeMap<String, u64>) -> Result<()> {
    let mut lines: Vec<u8> = Vec::new();
    for &scene in finish.scenes() {
        for view in shard::views(finish, scene)? {
            let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
            for object in view.objects.iter().filter(|object| object.visib_fract >= IGNORED_BELOW) {
                *counts.entry(obj_ids[&object.asset]).or_default() += 1;
            }
            for (obj_id, inst_count) in counts {
                let target = BopTarget { im_id: view.view, inst_count, obj_id, scene_id: scene.0 };
                lines.extend(if lines.is_empty() { &b"[\n  "[..] } else { b",\n  " });
                lines.extend(line(&target)?.trim_ascii_end());
            }
        }
    }
    lines.extend(if lines.is_empty() { &b"[]\n"[..] } else { b"\n]\n" });
    write_file(finish, &format!("{}/{TARGETS}", finish.id()), &lines)
}

/// Writes the mesh of each asset, from the first scene that has it.
fn write_models(config: &Bop, finish: &Finish, obj_ids: &BTreeMap<String, u64>) -> Result<()> {
    let mut infos = BTreeMap::new();
    for &scene in finish.scenes() {
        let wanted = |asset: &str| obj_ids.get(asset).is_some_and(|obj_id| !infos.contains_key(obj_id));
        for (asset, model) in shard::models(finish, scene, wanted)? {
            let obj_id = obj_ids[&asset];
            for folder in config.models.folders() {
                let path = model_path(finish.id(), folder, obj_id);
                let texture = texture_file(obj_id);
                finish.write(&path, |out| model.write(&texture, out).map_err(|error| Error::io(&path, &error)))?;
                if let ModelSurface::Texture { png, .. } = &model.surface {
                    write_file(finish, &format!("{}/{folder}/{texture}", finish.id()), png)?;
                }
            }
            infos.insert(obj_id, model.info());
        }
    }
    let mut entries = Entries::default();
    infos.iter().try_for_each(|(obj_id, info)| entries.push(obj_id, info))?;
    let entries = entries.finish();
    let mut folders = config.models.folders().iter();
    folders.try_for_each(|folder| write_file(finish, &format!("{}/{folder}/{MODELS_INFO}", finish.id()), &entries))
}

/// Writes all images as tar files.
fn write_web_shards(config: &Bop, finish: &Finish, summary: &Summary) -> Result<()> {
    let mut numbers = Entries::default();
    let images = summary.images.iter().flat_map(|(scene, views)| views.iter().map(move |view| (*scene, *view)));
    let images: Vec<(SceneId, ViewId)> = images.collect();
    for (number, images) in images.chunks(IMAGES_PER_SHARD).enumerate() {
        let path = web_shard(config, finish.id(), number);
        finish.write(&path, |out| {
            let mut archive = TarWriter::new(out, &path);
            for images in images.chunk_by(|a, b| a.0 == b.0) {
                let (Some(&(scene, first)), Some((_, last))) = (images.first(), images.last()) else { continue };
                add_samples(&mut archive, finish, scene, first.0..=last.0, &summary.obj_ids)?;
            }
            archive.finish()
        })?;
        images.iter().try_for_each(|&(scene, view)| numbers.push(key(scene, view), &number))?;
    }
    write_file(finish, &format!("{}/{KEY_TO_SHARD}", config.web_folder(finish.id())), &numbers.finish())
}

/// Adds the samples of some views of a scene, with poses that contain `obj_id`.
fn add_samples(
    archive: &mut TarWriter<&mut dyn Write>,
    finish: &Finish,
    scene: SceneId,
    views: RangeInclusive<u32>,
    obj_ids: &BTreeMap<String, u64>,
) -> Result<()> {
    let truths = shard::views(finish, scene)?.into_iter().filter(|view| views.contains(&view.view));
    let mut truths: BTreeMap<String, Vec<u8>> =
        truths.map(|view| Ok((key(scene, ViewId(view.view)), line(&truth(&view, obj_ids))?))).collect::<Result<_>>()?;
    let mut current = None;
    shard::for_each_sample(finish, scene, |key, field, bytes| {
        if let Some(truth) = truths.remove(key) {
            archive.add(&format!("{key}.{SAMPLE_GT}"), &truth)?;
            current = Some(key.to_owned());
        }
        if current.as_deref() == Some(key) { archive.add(&format!("{key}.{field}"), bytes) } else { Ok(()) }
    })
}

/// The entries of an image in `scene_gt.json`.
fn truth(view: &ViewRecord, obj_ids: &BTreeMap<String, u64>) -> Vec<GroundTruth> {
    view.objects.iter().map(|object| object.ground_truth(obj_ids[&object.asset])).collect()
}

fn write_scene(
    config: &Bop,
    dataset: &DatasetInfo,
    finish: &Finish,
    scene: SceneId,
    obj_ids: &BTreeMap<String, u64>,
) -> Result<()> {
    let views = shard::views(finish, scene)?;
    let mut truths = Entries::default();
    views.iter().try_for_each(|view| truths.push(view.view, &truth(view, obj_ids)))?;
    let folder = config.folder(finish.id(), scene);
    let [truth_file, coco_file, modal_file] = FINISHED_SCENE_FILES;
    write_file(finish, &format!("{folder}/{truth_file}"), &truths.finish())?;
    for (name, bbox) in [(coco_file, BoxOf::Amodal), (modal_file, BoxOf::Visible)] {
        let path = format!("{folder}/{name}");
        finish.write(&path, |out| {
            let mut file = DatasetWriter::new(out, &path, FileLayout::Lines)?;
            let category = |(id, asset): (u64, &String)| Category {
                id,
                name: asset.clone(),
                supercategory: dataset.name.clone(),
                ..Category::default()
            };
            let categories: Vec<_> = by_number(obj_ids).into_iter().map(category).collect();
            file.header(&family::info(dataset), &[License::of_assets()], &categories)?;
            file.images(|images| views.iter().try_for_each(|view| images.record(&image(config, view))))?;
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

/// The part of an object that the box of an annotation encloses.
#[derive(Debug, Clone, Copy)]
enum BoxOf {
    /// The part in the image, seen or not.
    Amodal,
    /// The visible part.
    Visible,
}

fn image(config: &Bop, view: &ViewRecord) -> CocoImage {
    CocoImage {
        id: view.view.into(),
        file_name: BopImage::Rgb.path_as(ViewId(view.view), config.rgb.extension()),
        width: view.camera.width,
        height: view.camera.height,
        license: Some(1.into()),
        ..CocoImage::default()
    }
}

fn annotation(
    id: u64,
    view: &ViewRecord,
    object: &ObjectRecord,
    shown: &ShownMask,
    obj_id: u64,
    bbox: BoxOf,
) -> CocoAnnotation {
    let bbox = match bbox {
        BoxOf::Amodal => shown.amodal_box,
        BoxOf::Visible => shown.visible_box,
    };
    let extra = json!({
        "ignore": object.visib_fract < IGNORED_BELOW,
        "width": view.camera.width,
        "height": view.camera.height,
    });
    CocoAnnotation {
        id,
        image_id: view.view.into(),
        category_id: obj_id,
        segmentation: Some(Segmentation::Uncompressed(shown.mask.clone())),
        area: Some(shown.area.into()),
        bbox: Some(bbox.map(f64::from)),
        iscrowd: 0,
        extra: extra.as_object().cloned().unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    #[test]
    fn numbers_are_those_that_objects_state() {
        let numbers = |stated: &[(&str, &[Option<u64>])]| {
            let log = Collected::default();
            let stated = stated.iter().map(|(asset, ids)| ((*asset).to_owned(), ids.iter().copied().collect()));
            let found = numbers_of(stated.collect(), &log).map_err(|error| error.to_string());
            (found.map(|ids| ids.into_values().collect::<Vec<_>>()), log.warnings().len())
        };
        assert_eq!(numbers(&[("a", &[Some(5)]), ("b", &[Some(2)])]), (Ok(vec![5, 2]), 0));
        // Numbers from the order of the names come with a warning.
        assert_eq!(numbers(&[("a", &[None]), ("b", &[None])]), (Ok(vec![1, 2]), 1));
        assert_eq!(numbers(&[]), (Ok(vec![]), 0));
        for (stated, wanted) in [
            (&[("a", &[Some(5)][..]), ("b", &[Some(5)])][..], "`a` and `b` have the same `obj_id` 5"),
            (&[("a", &[Some(5)]), ("b", &[None])], "`b` has no `obj_id`, and other objects have one"),
            (&[("a", &[Some(5), Some(6)])], "`a` has the `obj_id` 5 in some scenes, and 6 in others"),
            (&[("a", &[Some(0)])], "`a` has the `obj_id` 0"),
        ] {
            let error = numbers(stated).0.expect_err(wanted);
            assert!(error.starts_with(wanted), "{error}");
        }
    }
}
