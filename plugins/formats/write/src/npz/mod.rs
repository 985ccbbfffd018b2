//! NumPy archives: all arrays of a view in one file.

mod read;
mod write;

use syntable_formats::include::Included;
use syntable_formats::npz_archive::IDS;
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;

/// Writes one NumPy archive per view, for training loops.
///
/// # Behavior
///
/// Each included product of numbers is an array of the archive under its own name, as the writer `npy` stores it: images
/// as `[height, width]` or `[height, width, channels]`, a value per instance as one array with the N instances along the
/// first axis. `ids`, u16 `[N]`, are the ids of these instances. The default has what a training loop of amodal instance
/// segmentation reads, without run lengths or JSON:
///
/// | array | type and shape | holds |
/// | --- | --- | --- |
/// | `rgb` | uint8 `[H, W, 3]` | the image |
/// | `depth` | float32 `[H, W]` | meters along the optical axis, infinite without a surface |
/// | `visible_ids` | uint16 `[H, W]` | id of the object that a pixel shows, 0 where it shows none |
/// | `amodal_bits` | uint8 `[N, H, ⌈W/8⌉]` | amodal masks; `np.unpackbits(bits, axis=2, count=W)` is `[N, H, W]` |
/// | `visible_box`, `amodal_box` | int64 `[N, 4]` | x, y, width, height, px |
/// | `category_id` | int64 `[N]` | category: 1 is `object`, then the classes of pools by name |
/// | `occlusion_order` | bool `[N, N]` | the row's object occludes the column's |
/// | `ids` | uint16 `[N]` | ids of the objects, in the order of all axes of N |
///
/// Records and texts are arrays, too. A record, such as `camera`, has an array `{product}_{field}` for each of its fields.
/// Records of instances, such as `object_info`, and lists of records, such as `lights`, have their records along the first
/// axis: a field that a record lacks is NaN or an empty text there. A list without records has no arrays. A field that is
/// neither a text nor numbers of one shape is JSON text, in an array whose name ends with `_json`. Further useful products:
///
/// | product | some of its arrays | hold |
/// | --- | --- | --- |
/// | `camera` | `camera_K` `[3, 3]` | intrinsics; the top left corner of the image is (0, 0) |
/// | | `camera_world_from_camera`, `camera_camera_from_world` `[4, 4]` | pose in OpenCV's axes (x right, y down, z forward), meters |
/// | | `camera_distortion_k1_k2_p1_p2_k3` `[5]` | OpenCV's distortion, if the camera has one |
/// | `object_name` | `object_name` `[N]` | names of the assets |
/// | `object_info` | `object_info_category`, `object_info_asset` `[N]` | names of the class, and of pool and asset |
/// | | `object_info_camera_from_object`, `object_info_world_from_object` `[N, 4, 4]` | poses, meters |
/// | `lights` | `lights_shape` `[L]`, `lights_center_world_m`, `lights_radiance_nits` `[L, 3]` | the lights of the view |
/// | `depth_sensed` | `depth_sensed` `[H, W]` | depth of the depth camera, meters; **0** without a measurement, where `depth` is infinite |
///
/// The archive has no pickled objects: `np.load(path)` reads it.
///
/// # Output
///
/// `{id}/{scene:06}_{view:04}.npz`. Products of the scene are in `{id}/{scene:06}.npz`. If category ids are included,
/// `{id}/categories.json` has their names in COCO's form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npz {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Whether to compress the arrays. Labels shrink to a few percent; images and depth hardly shrink, and load more
    /// slowly.
    pub compress: bool,
}

impl Default for Npz {
    fn default() -> Self {
        let include = [
            "rgb",
            "depth",
            "visible_ids",
            "amodal_bits",
            "visible_box",
            "amodal_box",
            "category_id",
            "occlusion_order",
        ];
        Self { include: include.into(), compress: true }
    }
}

impl Config for Npz {
    type Stage = dyn Writer;
    const KIND: &'static str = "npz";
    const EXAMPLE: &'static str =
        "include = [\"rgb\", \"visible_ids\", \"amodal_bits\", \"category_id\", \"object_name\", \"camera\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&[IDS])?;
        Ok(self.writer())
    }
}

register!(Npz);
