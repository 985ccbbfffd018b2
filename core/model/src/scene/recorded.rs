//! Cameras of a recorded scene.

use super::Camera;
use crate::error::Result;
use crate::product::Plane;
use std::fmt;
use std::sync::Arc;

/// A camera that took an image of the scene which a placer rebuilds.
#[derive(Debug, Clone)]
pub struct RecordedCamera {
    /// Intrinsics, distortion and pose in the rebuilt scene.
    pub camera: Camera,
    /// Name of the image in its dataset.
    pub image: String,
    /// The image, if the dataset has it in color.
    pub photograph: Option<RecordedImage>,
}

/// A color image of a recorded scene, read when a stage needs it.
#[derive(Clone)]
pub struct RecordedImage(Arc<dyn Fn() -> Result<Plane<[u8; 3]>> + Send + Sync>);

impl RecordedImage {
    /// An image that a function reads.
    pub fn new(read: impl Fn() -> Result<Plane<[u8; 3]>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(read))
    }

    /// Reads it.
    ///
    /// # Errors
    /// If the file is missing or damaged.
    pub fn read(&self) -> Result<Plane<[u8; 3]>> {
        (self.0)()
    }
}

impl fmt::Debug for RecordedImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RecordedImage")
    }
}
