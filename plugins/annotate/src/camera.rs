//! The camera of a view.

use crate::matrix::{matrix, pose};
use crate::object_info::view;
use syntable_model::prelude::*;
use syntable_model::product::standard::CAMERA;

/// Intrinsics and pose of the view: `K` (3 × 3) for pixel centres at half-integers, image size, `world_from_camera`
/// and `camera_from_world` (4 × 4, metres), and the conventions in words.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {}

impl Config for Camera {
    type Stage = dyn Annotator;
    const KIND: &'static str = "camera";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for Camera {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CAMERA]
    }

    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()> {
        let camera = &view(site)?.camera;
        let k = &camera.intrinsics;
        let mut record = vec![
            ("width", k.width.into()),
            ("height", k.height.into()),
            ("K", matrix(k.matrix())),
            ("world_from_camera", pose(&camera.world_from_camera)),
            ("camera_from_world", pose(&camera.world_from_camera.inverse())),
            ("camera_axes", "x right, y down, z forward".into()),
            ("world_axes", "right-handed, z up".into()),
            ("length_unit", "m".into()),
            ("pixel_centres", "half-integers: the image's top-left corner is (0, 0)".into()),
        ];
        if let Some(distortion) = &camera.distortion {
            let ([k1, k2, k3], [p1, p2]) = (distortion.radial, distortion.tangential);
            record.push(("distortion_k1_k2_p1_p2_k3", Value::from([k1, k2, p1, p2, k3])));
        }
        if let Some(lens) = &camera.lens {
            record.push(("aperture_radius_m", lens.aperture_radius_m.into()));
            record.push(("focus_distance_m", lens.focus_distance_m.into()));
        }
        frame.put(CAMERA, Value::record(record))
    }
}

register!(Camera);
