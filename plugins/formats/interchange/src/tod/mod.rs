//! TOD, the Tabletop Object Dataset.

mod check;
mod read;
mod record;
mod write;

use syntable_formats::depth::DepthSource;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes the layout of TOD, the Tabletop Object Dataset, from which UOIS-Net and UCN are trained.
///
/// # Behavior
///
/// The unchanged loaders of UOIS-Net, UOIS-Net-3D and UCN read the folder `{id}` instead of TOD. They expect seven views of each
/// scene, so let a recipe have `dataset.views_per_scene = 7`; with another number, the end of the run warns. In TOD, view 0 shows
/// the room and view 1 the empty table. Here, all views show objects, which the loaders accept.
///
/// Labels are 0 for the background, 1 for the table, and one more than the id of an object. A scene has at most 254 objects. Where
/// visible masks overlap, a pixel belongs to the object with the smallest mask, and the number of objects that lose pixels is
/// reported. Amodal masks are left out.
///
/// The loaders know the camera from their own settings. Set `fov` there, or give the camera of the recipe their vertical field of
/// view of 45° and their resolution of 640 × 480 pixels. `scene_description.txt` has the poses of cameras, and for each object the
/// center of its box in the world: of its cuboid or, in a dataset without cuboids, of the surface that the views show.
///
/// # Output
///
/// `SCENE` is `{id}/{split}_set/scene_{scene:05}`; the split is `training` or `test`.
///
/// - `SCENE/rgb_{view:05}.jpeg`: 8-bit RGB, compressed as JPEG.
/// - `SCENE/depth_{view:05}.png`: 16-bit depth along the optical axis, whole millimeters; 0 without a surface.
/// - `SCENE/segmentation_{view:05}.png`: 8-bit labels.
/// - `SCENE/scene_description.txt`: JSON about objects and cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Tod {
    /// The part of the dataset, which names its folder.
    pub split: TodSplit,
    /// Depth that is written.
    pub depth: DepthSource,
    /// Quality of JPEG files, 1 to 100.
    #[schemars(range(min = 1, max = 100))]
    pub quality: u8,
}

/// A part of TOD.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TodSplit {
    /// `training_set`.
    #[default]
    Train,
    /// `test_set`.
    Test,
}

impl Default for Tod {
    fn default() -> Self {
        Self { split: TodSplit::default(), depth: DepthSource::default(), quality: 95 }
    }
}

impl Config for Tod {
    type Stage = dyn Writer;
    const KIND: &'static str = "tod";
    const EXAMPLE: &'static str = "split = \"train\"\nquality = 95";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        if !(1..=100).contains(&self.quality) {
            return Err(ConfigError::new("quality", format!("{} is not from 1 to 100", self.quality)));
        }
        Ok(self.boxed())
    }
}

register!(Tod);
