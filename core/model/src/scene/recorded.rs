//! Cameras of a recorded scene.

use super::Camera;

/// A camera that took an image of the scene which a placer rebuilds.
#[derive(Debug, Clone)]
pub struct RecordedCamera {
    /// Intrinsics, distortion and pose in the rebuilt scene.
    pub camera: Camera,
    /// Name of the image in its dataset.
    pub image: String,
}
