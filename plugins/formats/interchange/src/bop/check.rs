//! Faults of BOP's datasets: `scene_gt_info.json` and `scene_gt_coco.json` that contradict the masks and the depth, and
//! files of the dataset that contradict each other.

use super::meshes::Meshes;
use super::record::{
    BopCamera, BopModelInfo, CAMERA_FILE, GroundTruthInfo, MODELS_INFO, NO_BOX, SCENE_GT_COCO, between_centers,
    model_file,
};
use crate::read::edge_px2;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::read::Faults;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::reader::DatasetFault;
use syntable_model::rule;

/// Id of the rule that the sizes of a model agree with each other and with its mesh.
const SIZES_OF_MODELS: &str = "sizes_of_models";

/// Tolerance of a fraction: some files round fractions to three decimals.
const FRACTION: f64 = 1e-3;
/// Share of the pixels on an outline that may differ between two renderings. BOP's tools render once for the masks and
/// once for the pixel counts.
const OTHER_RENDERING: f64 = 0.1;
/// Relative tolerance of a model's size.
const SIZE: f64 = 1e-3;
/// Tolerance between a number of a model and its mesh, relative to the diameter: some datasets simplified their meshes
/// later.
const MESH: f64 = 0.01;
/// Tolerance of a box in `scene_gt_coco.json`, px: BlenderProc omits the + 1 of width and height.
const COCO_BOX_PX: f64 = 1.0;

/// A rigid motion, m.
type RigidMotion = [[f64; 4]; 4];

/// Tolerance within which two motions of objects between two views count as the same: of the entries of the rotation,
/// and in meters.
const SAME_MOTION: [f64; 2] = [2e-3, 2e-3];
/// Smallest motion that is not noise: of the entries of the rotation, and in meters.
const MOVED: [f64; 2] = [2e-2, 1e-2];

/// Finds a wrong camera pose: one that moves all objects of the image, as one rigid body, away from their place in
/// other images of the scene. `here` and `others` hold the numbers of the objects and their poses in the world. Objects
/// that move independently are not a fault. At least `least` other images must agree, and they must be more than half
/// of the images whose shared objects moved as one. A wrong camera in another image is therefore not blamed on this
/// image.
pub fn fault_of_camera_pose(
    here: &[(u64, RigidMotion)],
    others: &[Vec<(u64, RigidMotion)>],
    least: usize,
) -> Option<DatasetFault> {
    let moves: Vec<RigidMotion> = others.iter().filter_map(|there| common_motion(here, there)).collect();
    let agreeing = |first: &RigidMotion| moves.iter().filter(|it| is_near(it, first, SAME_MOTION)).count();
    let first = moves.iter().max_by_key(|it| agreeing(it)).filter(|it| !is_near(it, &IDENTITY, MOVED))?;
    let agreeing = Some(agreeing(first)).filter(|count| *count >= least && 2 * count > moves.len())?;
    let apart = (0..3).map(|axis| first[axis][3] * first[axis][3]).sum::<f64>().sqrt();
    let trace = first[0][0] + first[1][1] + first[2][2];
    let degrees = libm::acos(((trace - 1.0) / 2.0).clamp(-1.0, 1.0)).to_degrees();
    let message = format!(
        "`cam_R_w2c` and `cam_t_w2c` place all objects rotated by {degrees:.1}° and moved by {apart:.3} m, compared with {} of {} \
         other images of the scene; the camera's pose is wrong in this image or in the others",
        agreeing,
        moves.len()
    );
    Some(DatasetFault::new("poses_agree_between_views", message))
}

const IDENTITY: RigidMotion = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// The motion of the objects from one image of a scene to another, if all shared objects have the same motion. Only
/// objects whose number is unique in both images count, and at least two of them are needed.
fn common_motion(here: &[(u64, RigidMotion)], there: &[(u64, RigidMotion)]) -> Option<RigidMotion> {
    fn only(all: &[(u64, RigidMotion)], id: u64) -> Option<&RigidMotion> {
        let mut of_id = all.iter().filter(|it| it.0 == id).map(|it| &it.1);
        of_id.next().filter(|_| of_id.next().is_none())
    }
    let both = here.iter().filter_map(|(id, _)| Some((only(here, *id)?, only(there, *id)?)));
    let moves: Vec<RigidMotion> = both.map(|(here, there)| between(there, here)).collect();
    let (first, rest) = moves.split_first()?;
    (!rest.is_empty() && rest.iter().all(|it| is_near(it, first, SAME_MOTION))).then_some(*first)
}

/// The motion from one pose to another.
fn between(from: &RigidMotion, to: &RigidMotion) -> RigidMotion {
    let turn: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| to[i][k] * from[j][k]).sum()));
    let shift = |i: usize| to[i][3] - (0..3).map(|k| turn[i][k] * from[k][3]).sum::<f64>();
    let row = |i: usize| [turn[i][0], turn[i][1], turn[i][2], shift(i)];
    [row(0), row(1), row(2), IDENTITY[3]]
}

fn is_near(a: &RigidMotion, b: &RigidMotion, [turn, shift]: [f64; 2]) -> bool {
    (0..3).all(|i| (0..4).all(|j| (a[i][j] - b[i][j]).abs() <= if j < 3 { turn } else { shift }))
}

/// The sides of a box: its leftmost, topmost, rightmost and bottommost pixel.
fn sides([x, y, width, height]: [i64; 4]) -> [i64; 4] {
    [x, y, x + width, y + height]
}

impl GroundTruthInfo {
    /// The rules that the entry breaks, given the masks of its object, and the depth of the image if it is known.
    pub fn faults(&self, [amodal, visible]: [&Mask; 2], depth: Option<&Plane<f32>>) -> Vec<DatasetFault> {
        let mut faults = self.faults_of_counts(amodal, depth);
        let seen = self.px_count_visib > 0;
        let said = |name: &str, bbox: [i64; 4], own: &str| {
            let message = format!("`{name}` is {bbox:?}, {own} (BOP's sizes have no + 1)");
            DatasetFault::new(rule::BOX_MATCHES_MASK, message)
        };
        let own = |mask: &Mask| if seen { between_centers(mask.bbox().into()) } else { NO_BOX };
        if self.bbox_visib != own(visible) {
            faults.push(said("bbox_visib", self.bbox_visib, &format!("its mask has {:?}", own(visible))));
        }
        if !seen {
            if self.bbox_obj != NO_BOX {
                faults.push(said("bbox_obj", self.bbox_obj, &format!("a hidden object has {NO_BOX:?}")));
            }
            return faults;
        }
        // Parts beyond the frame count as pixels, but no mask contains them.
        let reaches_out = self.px_count_all > u64::from(amodal.area());
        let last = [amodal.width(), amodal.height()].map(i64::from);
        let (bbox, inside) = (sides(self.bbox_obj), sides(own(amodal)));
        let is_beyond = |side: usize| if side < 2 { bbox[side] < 0 } else { bbox[side] >= last[side - 2] };
        // A part beyond one side of the frame may reach further along the other sides than the part inside.
        let is_wider = reaches_out && (0..4).any(is_beyond);
        let holds = |side: usize| if side < 2 { bbox[side] <= inside[side] } else { bbox[side] >= inside[side] };
        if (0..4).any(|side| bbox[side] != inside[side] && !(is_wider && holds(side))) {
            faults.push(said("bbox_obj", self.bbox_obj, &format!("its mask in the frame has {:?}", own(amodal))));
        }
        let [_, _, width, height] = self.bbox_obj;
        let most = (width + 1).max(0).saturating_mul((height + 1).max(0)) as u64;
        if self.px_count_all > most {
            let message =
                format!("`px_count_all` is {}, `bbox_obj` {:?} has {most} pixels", self.px_count_all, self.bbox_obj);
            faults.push(DatasetFault::new(rule::COUNTS_MATCH_MASKS, message));
        }
        if reaches_out && !(0..4).any(is_beyond) && self.px_count_all as f64 > f64::from(amodal.area()) + slack(amodal)
        {
            let message = format!(
                "`px_count_all` is {}, its mask has {} pixels, and `bbox_obj` {:?} does not reach beyond the frame",
                self.px_count_all,
                amodal.area(),
                self.bbox_obj
            );
            faults.push(DatasetFault::new(rule::COUNTS_MATCH_MASKS, message));
        }
        faults
    }

    fn faults_of_counts(&self, amodal: &Mask, depth: Option<&Plane<f32>>) -> Vec<DatasetFault> {
        let mut faults = Vec::new();
        let mut fault = |message: String| faults.push(DatasetFault::new(rule::COUNTS_MATCH_MASKS, message));
        let (all, valid) = (self.px_count_all, self.px_count_valid);
        if (all as f64) < f64::from(amodal.area()) - slack(amodal) {
            fault(format!("`px_count_all` is {all}, its mask has {} pixels", amodal.area()));
        }
        match depth.filter(|depth| [depth.width(), depth.height()] == [amodal.width(), amodal.height()]) {
            Some(depth) => {
                let has_depth = |pixel: &usize| depth.data()[*pixel] > 0.0;
                let own = amodal.pixels().filter(has_depth).count();
                if (valid as f64 - own as f64).abs() > slack(amodal) {
                    fault(format!("`px_count_valid` is {valid}, {own} pixels of its mask have depth"));
                }
            }
            None if valid as f64 > f64::from(amodal.area()) + slack(amodal) => {
                fault(format!("`px_count_valid` is {valid}, its mask has {} pixels", amodal.area()));
            }
            None => {}
        }
        let share = if all == 0 { 0.0 } else { self.px_count_visib as f64 / all as f64 };
        if (self.visib_fract - share).abs() > FRACTION {
            let said = self.visib_fract;
            fault(format!("`visib_fract` is {said}, {} of {all} pixels are {share:.6}", self.px_count_visib));
        }
        faults
    }
}

/// Number of pixels that may differ between two renderings.
fn slack(mask: &Mask) -> f64 {
    (OTHER_RENDERING * edge_px2(mask)).floor()
}

/// The boxes and areas of a scene's annotations by image.
#[derive(Debug, Default)]
pub struct CocoScene {
    sizes: BTreeMap<u32, [u32; 2]>,
    annotations: BTreeMap<u32, Vec<BopCocoAnnotation>>,
}

/// The sections of `scene_gt_coco.json` that the reader uses.
#[derive(Deserialize)]
struct BopCocoFile {
    images: Vec<BopCocoImage>,
    annotations: Vec<BopCocoAnnotation>,
}

#[derive(Deserialize)]
struct BopCocoImage {
    id: u32,
    width: u32,
    height: u32,
}

#[derive(Debug, Deserialize)]
struct BopCocoAnnotation {
    id: u64,
    image_id: u32,
    bbox: [f64; 4],
    #[serde(default)]
    area: Option<f64>,
}

impl CocoScene {
    /// Reads the annotations of the scene in a folder, if the folder has the file.
    pub fn read(folder: &DatasetFolder) -> Result<Option<Self>> {
        let path = folder.file(SCENE_GT_COCO)?;
        if !path.is_file() {
            return Ok(None);
        }
        let file: BopCocoFile = super::files::json(&path)?;
        let mut scene = Self::default();
        scene.sizes.extend(file.images.iter().map(|image| (image.id, [image.width, image.height])));
        for it in file.annotations {
            scene.annotations.entry(it.image_id).or_default().push(it);
        }
        Ok(Some(scene))
    }

    /// The rules that the annotations of an image break, given the amodal and visible masks of its objects: a wrong
    /// image size, a box that fits no object, or an area that fits no object with this box.
    pub fn faults(&self, image: u32, infos: &[GroundTruthInfo], masks: &[[&Mask; 2]]) -> Vec<DatasetFault> {
        let Some([first, _]) = masks.first() else { return Vec::new() };
        let mut faults = Vec::new();
        let size = [first.width(), first.height()];
        if let Some(said) = self.sizes.get(&image).filter(|said| **said != size) {
            let message = format!("{SCENE_GT_COCO}: the image has {said:?} pixels, its masks {size:?}");
            faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
        }
        let inside = |[x, y, width, height]: [f64; 4]| {
            let clip = |at: f64, axis: usize| at.clamp(0.0, f64::from(size[axis]));
            [clip(x, 0), clip(y, 1), clip(x + width, 0), clip(y + height, 1)]
        };
        // Objects without visible pixels have no annotation.
        let seen: Vec<_> = infos.iter().zip(masks).filter(|(info, _)| info.px_count_visib > 0).collect();
        let near = |a: [f64; 4], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= COCO_BOX_PX);
        for &BopCocoAnnotation { id, bbox, area, .. } in self.annotations.get(&image).into_iter().flatten() {
            let is_near = |own: [f64; 4]| near(inside(bbox), inside(own));
            let has_box = |(info, masks): &(&GroundTruthInfo, &[&Mask; 2])| {
                let of_masks = masks.iter().map(|mask| <[i32; 4]>::from(mask.bbox()).map(f64::from));
                of_masks.chain([info.bbox_obj.map(|edge| edge as f64)]).any(is_near)
            };
            let of_box: Vec<_> = seen.iter().copied().filter(has_box).collect();
            if of_box.is_empty() {
                let message =
                    format!("{SCENE_GT_COCO}: annotation {id}: no object of the image has the `bbox` {bbox:?}");
                faults.push(DatasetFault::new(rule::BOX_MATCHES_MASK, message));
                continue;
            }
            let has_area = |area: f64| {
                of_box.iter().any(|(info, [amodal, visible])| {
                    let own = [amodal.area().into(), visible.area().into(), info.px_count_all as f64];
                    own.iter().any(|own: &f64| (own - area).abs() <= slack(amodal) + 0.5)
                })
            };
            if let Some(area) = area.filter(|area| !has_area(*area)) {
                let message =
                    format!("{SCENE_GT_COCO}: annotation {id}: no object with its `bbox` has the `area` {area}");
                faults.push(DatasetFault::new(rule::AREAS_MATCH_MASKS, message));
            }
        }
        faults
    }
}

/// The fault of a `camera.json` that states another image size.
pub fn faults_of_camera(camera: &BopCamera, [width, height]: [u32; 2]) -> Option<DatasetFault> {
    let said = [camera.width, camera.height];
    let message = format!("{CAMERA_FILE}: its images have {said:?} pixels, this one {:?}", [width, height]);
    (said != [width, height]).then(|| DatasetFault::new(rule::CAMERA_HAS_IMAGE_SIZE, message))
}

/// Checks that a `camera.json` has a focal length.
pub fn camera_is_valid(camera: &BopCamera, faults: &mut Faults) {
    let sound = camera.fx > 0.0 && camera.fy > 0.0 && camera.depth_scale > 0.0;
    if !sound {
        let message = format!(
            "`fx` is {}, `fy` {} and `depth_scale` {}; all must be above 0",
            camera.fx, camera.fy, camera.depth_scale
        );
        faults.add(rule::CAMERA_IS_VALID, CAMERA_FILE.to_owned(), message);
    }
}

/// The faults of a `models_info.json` that contradicts the meshes in its folder.
pub fn faults_of_meshes(meshes: &Meshes, models: &BTreeMap<u64, BopModelInfo>, faults: &mut Faults) {
    for id in meshes.numbers() {
        let info = match meshes.info(id) {
            Ok(info) => info,
            Err(error) => {
                faults.add(rule::READABLE, model_file(id), error.to_string());
                continue;
            }
        };
        let slack_mm = MESH * info.diameter;
        let stated = models.get(&id).into_iter().flat_map(BopModelInfo::numbers);
        let off = info.numbers().into_iter().zip(stated).find_map(|((key, own), (_, said))| {
            Some((key, own, said.value().filter(|said| (*said - own).abs() > slack_mm)?))
        });
        if let Some((key, own, said)) = off {
            let message = format!("`{key}` is {said} mm, but {own:.3} mm in {}", model_file(id));
            faults.add(SIZES_OF_MODELS, format!("{MODELS_INFO}: {id}"), message);
        }
    }
}

/// The faults of `models_info.json` in a folder: models without a mesh, and sizes that contradict each other.
pub fn faults_of_models(folder: &Path, models: &BTreeMap<u64, BopModelInfo>, faults: &mut Faults) {
    for (&id, model) in models {
        let place = format!("{MODELS_INFO}: {id}");
        let mesh = model_file(id);
        if !folder.join(&mesh).is_file() {
            faults.add(rule::FILES_EXIST, place.clone(), format!("{mesh} is missing"));
        }
        if let Err(problem) = model.symmetries() {
            faults.add("symmetries_are_motions", place.clone(), problem);
        }
        let (Some(&diameter), Some([_, size])) = (model.diameter.value(), model.box_mm()) else {
            let message = "it has no numbers `diameter`, `min_x` to `min_z` and `size_x` to `size_z`";
            faults.add(SIZES_OF_MODELS, place, message);
            continue;
        };
        let longest = size.iter().copied().fold(0.0, f64::max);
        let diagonal = size.iter().map(|side| side * side).sum::<f64>().sqrt();
        if size.iter().any(|side| *side < 0.0) || longest == 0.0 {
            faults.add(SIZES_OF_MODELS, place, format!("its sizes are {size:?} mm"));
        } else if diameter < longest * (1.0 - SIZE) || diameter > diagonal * (1.0 + SIZE) {
            let message = format!(
                "`diameter` is {diameter} mm, its box {size:?} mm: it must be from {longest:.3} to the diagonal, {diagonal:.3}"
            );
            faults.add(SIZES_OF_MODELS, place, message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two objects, moved along x, m.
    fn at(x: f64) -> Vec<(u64, RigidMotion)> {
        let pose = |y: f64| {
            let mut pose = IDENTITY;
            (pose[0][3], pose[1][3]) = (x, y);
            pose
        };
        vec![(1, pose(0.0)), (2, pose(0.5))]
    }

    #[test]
    fn a_camera_is_blamed_if_most_others_agree() {
        let is_blamed = |others: &[f64], least| {
            let others: Vec<_> = others.iter().map(|x| at(*x)).collect();
            fault_of_camera_pose(&at(0.0), &others, least).is_some()
        };
        assert!(is_blamed(&[0.3, 0.3], 2) && is_blamed(&[0.3, 0.3, 0.0], 2) && is_blamed(&[0.3], 1));
        // A single other image may itself be wrong. The same holds for two images that disagree, and for fewer than
        // half.
        assert!(!is_blamed(&[0.3], 2) && !is_blamed(&[0.3, 0.6], 2) && !is_blamed(&[0.3, 0.0], 1));
        assert!(!is_blamed(&[0.3, 0.3, 0.0, 0.0], 2) && !is_blamed(&[0.005, 0.005, 0.005], 2) && !is_blamed(&[], 0));
    }
}
