//! Cameras that are fixed to each other.

use crate::geometry::Pose;

/// The camera of a rig that takes a view.
#[derive(Debug, Clone, PartialEq)]
pub struct RigView {
    /// Name of the camera.
    pub camera: String,
    /// Number of the rig's pose in the scene, from 0. The cameras of the rig take all views of a pose at once.
    pub pose: u32,
    /// Pose of the camera in the frame of the rig.
    pub rig_from_camera: Pose,
}
