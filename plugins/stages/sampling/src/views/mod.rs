//! View samplers.

mod fixed_poses;
mod hemisphere_shell;
mod look_at;
mod orbit;
mod radius;
mod recorded;

pub use fixed_poses::FixedPoses;
pub use hemisphere_shell::HemisphereShell;
pub use orbit::Orbit;
pub use recorded::RecordedViews;
