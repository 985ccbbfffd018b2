//! The images of a split: in folders of scenes, or in tar files of samples.

use super::BopLayout;
use super::record::{
    BopImage, GroundTruth, GroundTruthInfo, KEY_TO_SHARD, SAMPLE_CAMERA, SAMPLE_DEPTH, SAMPLE_GT, SAMPLE_GT_INFO,
    SAMPLE_MASK, SAMPLE_MASK_VISIB, SCENE_CAMERA, SCENE_GT, SCENE_GT_INFO, SceneCamera, shard_number,
};
use serde::de::DeserializeOwned;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_formats::decode::{self, FileContent};
use syntable_formats::json as formats_json;
use syntable_formats::members::{self, TarMember, TarSample};
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::segmentation::Segmentation;
use syntable_model::files::DatasetFolder;
use syntable_model::limits::{ANNOTATIONS, TEXT_BYTES};
use syntable_model::mirror::DatasetFile;
use syntable_model::prelude::*;
use syntable_model::reader::{ImageRef, Source};
use syntable_model::rule;
use syntable_model::scene::ViewId;
use syntable_model::shown::shown;

/// Fields of a sample with the content of [`SCENE_CAMERA`], [`SCENE_GT`] and [`SCENE_GT_INFO`] for its image.
const RECORDS: [&str; 3] = [SAMPLE_CAMERA, SAMPLE_GT, SAMPLE_GT_INFO];
/// Possible names of the field with the color image of a sample.
const COLORS: [&str; 3] = ["rgb.png", "rgb.jpg", "rgb.jpeg"];
/// Possible names of the fields with the masks of whole objects and of visible parts.
const MASKS: [&str; 2] = [SAMPLE_MASK, SAMPLE_MASK_VISIB];

/// A split of a dataset.
pub struct BopSplit {
    pub folder: PathBuf,
    layout: BopLayout,
}

/// The images of a split, in order.
pub struct BopImages {
    pub refs: Vec<ImageRef>,
    pub records: Vec<BopImageRecord>,
    /// Folders of scenes.
    pub folders: Vec<PathBuf>,
}

/// An image.
pub struct BopImageRecord {
    pub number: u32,
    pub camera: SceneCamera,
    pub objects: Vec<GroundTruth>,
    pub infos: Vec<GroundTruthInfo>,
    place: ImageFiles,
}

/// Where the files of an image are.
enum ImageFiles {
    /// In the folder of its scene.
    Folder(DatasetFolder),
    /// In a tar file, by field.
    TarSample { archive: PathBuf, fields: BTreeMap<String, TarMember> },
}

/// The records of an image in the files of its scene.
struct StatedImage {
    number: u32,
    camera: Option<SceneCamera>,
    objects: Vec<GroundTruth>,
    infos: Vec<GroundTruthInfo>,
}

/// The folders named by a number, sorted.
fn scenes_of(folder: &Path) -> Vec<(u32, PathBuf)> {
    let number = |path: &Path| path.file_name()?.to_str()?.parse().ok();
    let scenes = read::entries(folder).into_iter().filter(|path| path.is_dir());
    scenes.filter_map(|path| Some((number(&path)?, path))).collect()
}

/// Whether a folder has tar files with BOP samples. Tar files of other formats may have the same names.
fn has_shards(folder: &Path) -> bool {
    let shards = shards_of(folder);
    let says_poses = |path: &PathBuf| {
        let mut first = members::first(path, FIRST_MEMBERS).into_iter();
        first.any(|member| member.name.ends_with(&format!(".{SAMPLE_GT}")))
    };
    !shards.is_empty()
        && (folder.join(KEY_TO_SHARD).is_file() || shards.iter().take(1).any(|(_, path)| says_poses(path)))
}

/// Number of members to search for poses, which identify a tar file of BOP.
const FIRST_MEMBERS: usize = 32;

/// The tar files of a folder with their numbers, sorted.
fn shards_of(folder: &Path) -> Vec<(u64, PathBuf)> {
    let number = |path: &Path| shard_number(path.file_name()?.to_str()?);
    read::entries(folder).into_iter().filter_map(|path| Some((number(&path)?, path))).collect()
}

/// The splits of a dataset, sorted. The folder of a split counts as its own split. A split has scenes with poses;
/// without any such scene in the dataset, scenes with cameras; without scenes, tar files.
pub fn splits_of(root: &Path) -> Vec<BopSplit> {
    let of = |layout: BopLayout, is_one: &dyn Fn(&Path) -> bool| -> Vec<BopSplit> {
        let folders = if is_one(root) { vec![root.to_owned()] } else { read::entries(root) };
        let splits = folders.into_iter().filter(|path| path.is_dir() && is_one(path));
        splits.map(|folder| BopSplit { folder, layout }).collect()
    };
    let has = |folder: &Path, file: &str| scenes_of(folder).iter().any(|(_, scene)| scene.join(file).is_file());
    let scenewise = [SCENE_GT, SCENE_CAMERA].map(|file| of(BopLayout::Scenewise, &|folder| has(folder, file)));
    let web = || of(BopLayout::Webdataset, &has_shards);
    scenewise.into_iter().find(|splits| !splits.is_empty()).unwrap_or_else(web)
}

/// The only split of a dataset.
pub fn split_of(root: &Path) -> Result<BopSplit> {
    let mut splits = splits_of(root);
    // The user may name the format of a damaged dataset explicitly.
    if splits.is_empty() && !shards_of(root).is_empty() {
        splits.push(BopSplit { folder: root.to_owned(), layout: BopLayout::Webdataset });
    }
    let (found, help) = match splits.first() {
        Some(first) => {
            (splits.len(), format!("name the folder of one split, such as {}", shown(&first.folder).display()))
        }
        None => {
            (0, "a split has folders of scenes, each with a scene_gt.json, or tar files shard-000000.tar".to_owned())
        }
    };
    <[BopSplit; 1]>::try_from(splits)
        .map(|[split]| split)
        .map_err(|_| Error::new(format!("expected one split, found {found}")).in_file(root).help(help))
}

/// A file as JSON.
pub fn json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let file = DatasetFile::open(path).map_err(|error| Error::io(path, &error).of_request())?;
    parsed(&decode::read_at_most(file, &TEXT_BYTES, path)?, path)
}

/// A member as JSON.
fn json_of<T: DeserializeOwned>(member: &TarMember) -> Result<T> {
    parsed(member.content()?.bytes(), &member.path())
}

fn parsed<T: DeserializeOwned>(text: &[u8], path: &Path) -> Result<T> {
    TEXT_BYTES.check(text.len() as u64).map_err(|error| error.in_file(path))?;
    serde_json::from_slice(text).map_err(|error| {
        // Parses the text again to report the position of the error.
        let located = serde_path_to_error::deserialize::<_, T>(&mut serde_json::Deserializer::from_slice(text));
        let key = located.err().map(|error| error.path().to_string()).filter(|key| key != ".");
        let line = text.split(|byte| *byte == b'\n').nth(error.line().saturating_sub(1)).unwrap_or_default();
        let from = line.get(formats_json::before(error.column() as u64) as usize..).unwrap_or_default();
        formats_json::located(&error, key.as_deref(), from).in_file(path).of_request()
    })
}

/// The images of a split. An unreadable image is reported as a fault and omitted.
///
/// # Errors
/// If a tar file is a link that leads out of the dataset.
pub fn images(source: &Source, split: &BopSplit, faults: &mut Faults) -> Result<BopImages> {
    let root = source.folder(&source.path)?;
    let folder = match split.folder == source.path {
        true => root,
        false => root.inner(split.folder.file_name().unwrap_or_default()),
    };
    let mut images = BopImages { refs: Vec::new(), records: Vec::new(), folders: Vec::new() };
    match split.layout {
        BopLayout::Scenewise => images.add_scenes(&folder, faults),
        BopLayout::Webdataset => images.add_shards(&folder, faults)?,
    }
    Ok(images)
}

impl BopImages {
    /// Adds an image if its records agree. `files` are the names of the files with cameras, poses and pixel counts.
    fn add(&mut self, scene: u32, said: StatedImage, place: ImageFiles, files: [&str; 3], faults: &mut Faults) {
        let StatedImage { number, camera, objects, infos } = said;
        let name = format!("{scene:06}/{number:06}");
        let [cameras, truth, counts] = files;
        if infos.len() != objects.len() {
            let message = format!("it has {} objects in {truth}, {} in {counts}", objects.len(), infos.len());
            return faults.lost(rule::RECORDS_AGREE, name, message);
        }
        if let Err(error) = ANNOTATIONS.check(objects.len() as u64) {
            return faults.lost(rule::READABLE, name, format!("{truth}: {error}"));
        }
        let Some(camera) = camera else {
            return faults.lost(rule::RECORDS_AGREE, name, format!("it is in {truth} and not in {cameras}"));
        };
        self.refs.push(read::image((scene, number), name));
        self.records.push(BopImageRecord { number, camera, objects, infos, place });
    }

    fn add_scenes(&mut self, split: &DatasetFolder, faults: &mut Faults) {
        for (scene, folder) in scenes_of(&split.path()) {
            let place = format!("{scene:06}");
            let inside = split.inner(folder.file_name().unwrap_or_default());
            if let Some(missing) =
                [SCENE_GT, SCENE_CAMERA, SCENE_GT_INFO].iter().find(|name| !folder.join(name).is_file())
            {
                let message = format!("the scene has no {missing}: nothing of it is read");
                faults.lost(rule::FILES_EXIST, place, message);
                continue;
            }
            let (mut cameras, mut infos, all) = match files_of(&inside) {
                Ok(files) => files,
                Err(error) => {
                    faults.lost(rule::READABLE, place, format!("{error}: nothing of the scene is read"));
                    continue;
                }
            };
            for (number, objects) in all {
                let (camera, infos) = (cameras.remove(&number), infos.remove(&number).unwrap_or_default());
                let said = StatedImage { number, camera, objects, infos };
                self.add(
                    scene,
                    said,
                    ImageFiles::Folder(inside.clone()),
                    [SCENE_CAMERA, SCENE_GT, SCENE_GT_INFO],
                    faults,
                );
            }
            for number in cameras.into_keys() {
                let message = format!("it is in {SCENE_CAMERA} and not in {SCENE_GT}");
                faults.lost(rule::RECORDS_AGREE, format!("{scene:06}/{number:06}"), message);
            }
            self.folders.push(folder);
        }
    }

    fn add_shards(&mut self, split: &DatasetFolder, faults: &mut Faults) -> Result<()> {
        let shards = shards_of(&split.path());
        let paths: Vec<PathBuf> = shards.iter().map(|(_, path)| path.clone()).collect();
        read::check_inside(split, &paths)?;
        let samples = members::samples(&paths, faults);
        let numbers = samples.iter().map(|(key, sample)| (*key, shards[sample.archive].0)).collect();
        faults_of_numbers(&split.file(KEY_TO_SHARD)?, &numbers, faults);
        for ((scene, number), TarSample { archive, mut fields }) in samples {
            let place = format!("{scene:06}/{number:06}");
            if let Some(missing) = RECORDS.iter().find(|field| !fields.contains_key(**field)) {
                let message = format!("the image has no {missing}: nothing of it is read");
                faults.lost(rule::FILES_EXIST, place, message);
                continue;
            }
            match said_by(number, &mut fields) {
                Ok(said) => {
                    let place = ImageFiles::TarSample { archive: paths[archive].clone(), fields };
                    self.add(scene, said, place, RECORDS, faults);
                }
                Err(error) => faults.lost(rule::READABLE, place, format!("{error}: nothing of the image is read")),
            }
        }
        Ok(())
    }
}

/// Takes the records of a sample out of its members.
fn said_by(number: u32, sample: &mut BTreeMap<String, TarMember>) -> Result<StatedImage> {
    fn take<T: DeserializeOwned + Default>(sample: &mut BTreeMap<String, TarMember>, field: &str) -> Result<T> {
        sample.remove(field).map_or_else(|| Ok(T::default()), |member| json_of(&member))
    }
    let [camera, truth, infos] = RECORDS;
    Ok(StatedImage {
        number,
        camera: take(sample, camera)?,
        objects: take(sample, truth)?,
        infos: take(sample, infos)?,
    })
}

/// Compares the list of the images' tar files with the actual numbers, by scene and image. A dataset may lack this
/// list.
fn faults_of_numbers(path: &Path, numbers: &BTreeMap<(u32, u32), u64>, faults: &mut Faults) {
    if !path.is_file() {
        return;
    }
    let said: BTreeMap<String, u64> = match json(path) {
        Ok(said) => said,
        Err(error) => return faults.add(rule::READABLE, KEY_TO_SHARD.to_owned(), error.to_string()),
    };
    for (key, shard) in &said {
        let found = match place_in_name(key).and_then(|place| numbers.get(&place)) {
            Some(own) if own == shard => continue,
            Some(own) => format!("it is in shard {own}"),
            None => "no tar file has it".to_owned(),
        };
        faults.add(
            rule::RECORDS_AGREE,
            key.clone(),
            format!("{KEY_TO_SHARD} has it in the tar file {shard}, and {found}"),
        );
    }
    let listed: BTreeSet<(u32, u32)> = said.keys().filter_map(|key| place_in_name(key)).collect();
    for (scene, number) in numbers.keys().filter(|key| !listed.contains(*key)) {
        faults.add(rule::RECORDS_AGREE, format!("{scene:06}_{number:06}"), format!("{KEY_TO_SHARD} does not have it"));
    }
}

/// Content of the files of a scene: cameras, counts and poses of each image.
type SceneRecords = (BTreeMap<u32, SceneCamera>, BTreeMap<u32, Vec<GroundTruthInfo>>, BTreeMap<u32, Vec<GroundTruth>>);

fn files_of(folder: &DatasetFolder) -> Result<SceneRecords> {
    Ok((json(&folder.file(SCENE_CAMERA)?)?, json(&folder.file(SCENE_GT_INFO)?)?, json(&folder.file(SCENE_GT)?)?))
}

impl BopImageRecord {
    /// The folder of its scene; none for an image in a tar file.
    pub fn folder(&self) -> Option<&DatasetFolder> {
        match &self.place {
            ImageFiles::Folder(folder) => Some(folder),
            ImageFiles::TarSample { .. } => None,
        }
    }

    /// The file of the color image.
    pub fn color_file(&self) -> Result<FileContent> {
        match &self.place {
            ImageFiles::Folder(folder) => {
                let name = |extension: &str| BopImage::Rgb.path_as(ViewId(self.number), extension);
                let found = ["png", "jpg"].map(name).into_iter().find(|name| folder.path().join(name).is_file());
                FileContent::read(&folder.file(found.unwrap_or_else(|| name("png")))?)
            }
            ImageFiles::TarSample { fields, .. } => {
                let found = COLORS.iter().find(|field| fields.contains_key(**field)).unwrap_or(&COLORS[0]);
                self.member(found)?.content()
            }
        }
    }

    /// Depth along the optical axis, m.
    pub fn depth(&self) -> Result<Plane<f32>> {
        let content = match &self.place {
            ImageFiles::Folder(folder) => FileContent::read(&folder.file(BopImage::Depth.path(ViewId(self.number)))?),
            ImageFiles::TarSample { .. } => self.member(SAMPLE_DEPTH)?.content(),
        };
        content?.depth(self.camera.depth_scale)
    }

    /// Amodal and visible masks of the objects, by entry of the poses.
    pub fn masks(&self, size: [u32; 2]) -> Result<Vec<[Mask; 2]>> {
        match &self.place {
            ImageFiles::Folder(folder) => {
                let mask = |image: BopImage| mask_of(&folder.file(image.path(ViewId(self.number)))?, size);
                let pair = |entry: usize| Ok([mask(BopImage::Mask(entry))?, mask(BopImage::MaskVisib(entry))?]);
                (0..self.objects.len()).map(pair).collect()
            }
            ImageFiles::TarSample { .. } => {
                let [amodal, visible] = MASKS.map(|field| self.runs(self.member(field)?, size));
                Ok(amodal?.into_iter().zip(visible?).map(<[Mask; 2]>::from).collect())
            }
        }
    }

    /// The masks of a member, by entry of the poses.
    fn runs(&self, member: &TarMember, [width, height]: [u32; 2]) -> Result<Vec<Mask>> {
        let mut masks: BTreeMap<usize, Segmentation> = json_of(member)?;
        let refuse = |message: String| Error::new(message).in_file(member.path());
        let mut mask = |entry: usize| {
            let missing = || refuse(format!("it has no mask of the object {entry} of {SAMPLE_GT}"));
            let mask = masks.remove(&entry).ok_or_else(missing)?;
            mask.decode(width, height).map_err(|error| refuse(format!("object {entry}: {error}")))
        };
        let found = (0..self.objects.len()).map(&mut mask).collect::<Result<Vec<Mask>>>()?;
        match masks.into_keys().next() {
            Some(other) => Err(refuse(format!("it has a mask of the object {other}, and {SAMPLE_GT} has no such"))),
            None => Ok(found),
        }
    }

    /// A member of the image's sample.
    fn member(&self, field: &str) -> Result<&TarMember> {
        let (found, place) = match &self.place {
            ImageFiles::TarSample { archive, fields } => (fields.get(field), archive.clone()),
            ImageFiles::Folder(folder) => (None, folder.path()),
        };
        found.ok_or_else(|| Error::new(format!("the image {:06} has no {field}", self.number)).in_file(place))
    }
}

fn mask_of(path: &Path, [width, height]: [u32; 2]) -> Result<Mask> {
    let image = decode::gray_of_size(path, [width, height])?;
    Ok(Mask::from_fn(width, height, |x, y| *image.at(x, y) > 0))
}
