//! The lenses of the cameras of a recorded scene.

use crate::camera::exposure::ExposureOption;
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::Optics;

/// Image size, intrinsics and lens distortion of the recorded scene that a step of the kind `recorded` of `[[place]]` rebuilds.
///
/// A view gets the lens of the recorded camera that is nearest to its own camera. With the kind `recorded` of `[views]`, that is the
/// camera of its image.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordedLenses {
    /// Exposure: `"auto"`, `{ auto = { compensation_ev = 0.5 } }` or `{ ev100 = 9 }`.
    exposure: ExposureOption,
}

impl Config for RecordedLenses {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "recorded";
    const EXAMPLE: &'static str = "exposure = \"auto\"";

    fn build(self) -> Result<Box<dyn CameraModel>, ConfigError> {
        Ok(Box::new(self))
    }
}
register!(RecordedLenses);

impl CameraModel for RecordedLenses {
    fn optics(&self, scene: &Scene, world_from_camera: &Pose, _: &Context) -> Result<Optics> {
        let cameras = scene.recorded_cameras()?;
        let position = world_from_camera.translation.vector;
        // Cameras at one position differ in their directions.
        let distance = |pose: &Pose| {
            [(pose.translation.vector - position).norm(), pose.rotation.angle_to(&world_from_camera.rotation)]
        };
        let nearest = cameras.iter().map(|it| &it.camera).fold(&cameras[0].camera, |best, other| {
            let [near, far] = [distance(&other.world_from_camera), distance(&best.world_from_camera)];
            if near < far { other } else { best }
        });
        let (intrinsics, distortion) = (nearest.intrinsics, nearest.distortion);
        Ok(Optics { intrinsics, distortion, lens: None, exposure: self.exposure.0 })
    }
    fn needs(&self) -> Option<Part> {
        Some(Part::RecordedCameras)
    }
}
