//! Camera poses.

use crate::context::Context;
use crate::error::Result;
use crate::geometry::{Point3, Pose};
use crate::scene::{Moment, Scene, ViewId};
use crate::stage::Part;

/// A range of distances around a point, meters: where cameras or lights can be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    /// The center, world.
    pub center: Point3<f64>,
    /// Smallest and largest distance.
    pub radius: [f64; 2],
}

/// Gives the camera poses of a scene.
pub trait ViewSampler: Send + Sync {
    /// `world_from_camera` of one view. A pure function of scene, view and stream.
    fn pose(&self, scene: &Scene, view: ViewId, context: &Context) -> Result<Pose>;
    /// The shell that contains all cameras of a scene. Lights can be placed relative to it.
    ///
    /// # Errors
    /// If the scene lacks the support that the cameras look at.
    fn shell(&self, scene: &Scene) -> Result<Shell>;
    /// The moment of a view. `pose` gets the scene at this moment, and the view shows it. By default, all views show the scene at its
    /// start.
    fn moment(&self, scene: &Scene, view: ViewId) -> Result<Moment> {
        let _ = (scene, view);
        Ok(Moment::START)
    }
    /// The point that the camera of a view looks at, world, for the condition `line_of_sight`. None if the view has no such
    /// point.
    fn target(&self, scene: &Scene, view: ViewId) -> Option<Point3<f64>> {
        let _ = (scene, view);
        None
    }
    /// The part of the scene that the poses need, which a step of `[[place]]` must set. Supports are named by options of the type
    /// [`SupportName`](crate::names::SupportName), and need not be stated here.
    fn needs(&self) -> Option<Part> {
        None
    }
    /// Number of views, if it is fixed.
    fn count(&self) -> Option<u32> {
        None
    }
}
