//! Views from the cameras of a recorded scene.

use nalgebra::Point3;
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// The camera poses of the recorded scene that a step of the kind `recorded` of `[[place]]` rebuilds.
///
/// View `i` is taken from the camera of image `i` of the recorded scene. A scene can have fewer views than the recorded
/// scene has images. The kind `recorded` of `[camera]` gives the views their lenses and sizes, too.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordedViews {}

impl Config for RecordedViews {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "recorded";
    const EXAMPLE: &'static str = "";

    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        Ok(Box::new(self))
    }
}
register!(RecordedViews);

impl ViewSampler for RecordedViews {
    fn pose(&self, scene: &Scene, view: ViewId, _: &Context) -> Result<Pose> {
        let cameras = scene.recorded_cameras()?;
        let camera = cameras.get(view.0 as usize).ok_or_else(|| {
            let images = if cameras.len() == 1 { "1 image".to_owned() } else { format!("{} images", cameras.len()) };
            Error::new(format!("view {} has no camera: the recorded scene has {images}, from 0", view.0))
                .help("lower `views_per_scene` of [dataset], or take more images of each scene in the step `recorded`")
        })?;
        Ok(camera.camera.world_from_camera)
    }

    fn needs(&self) -> Option<Part> {
        Some(Part::RecordedCameras)
    }

    /// The shell around the objects that contains all cameras.
    fn shell(&self, scene: &Scene) -> Result<Shell> {
        let bounds = scene.objects().iter().map(|body| body.world_bounds().center());
        let (sum, count) = bounds.fold((Point3::origin(), 0.0), |(sum, count), p| (sum + p.coords, count + 1.0));
        let center = sum / f64::max(count, 1.0);
        let distances = scene.recorded_cameras()?.iter();
        let distances = distances.map(|it| (it.camera.world_from_camera.translation.vector - center.coords).norm());
        let radius = distances.fold([f64::INFINITY, 0.0], |[low, high], r| [r.min(low), r.max(high)]);
        Ok(Shell { center, radius })
    }
}
