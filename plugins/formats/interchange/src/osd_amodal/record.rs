//! Folders of OSD-Amodal, and names of images.

use syntable_model::scene::{SceneId, ViewId};

/// Folder of color images.
pub const COLOR: &str = "image_color";
/// Folder of depth images.
pub const DEPTH: &str = "disparity";
/// Folder of images of labels.
pub const LABELS: &str = "annotation";
/// Folders of images.
pub const IMAGES: [&str; 3] = [COLOR, DEPTH, LABELS];
/// Folders of masks of single objects: amodal and occluded.
pub const MASKS: [&str; 2] = ["amodal_annotation", "occlusion_annotation"];

/// Name of a view. No name ends with another name, whatever the number of scenes and views.
pub fn view_name(scene: SceneId, view: ViewId) -> String {
    format!("s{:06}v{:04}", scene.0, view.0)
}

/// Scene and view of a [`view_name`].
pub fn place_of(name: &str) -> Option<(u32, u32)> {
    let (scene, view) = name.strip_prefix('s')?.split_once('v')?;
    Some((scene.parse().ok()?, view.parse().ok()?))
}

/// Name of the mask of the object with a label.
pub fn mask_name(view: &str, label: u16) -> String {
    format!("{view}_{label}")
}

/// Path of an image.
pub fn image_path(folder: &str, name: &str) -> String {
    format!("{folder}/{name}.png")
}
