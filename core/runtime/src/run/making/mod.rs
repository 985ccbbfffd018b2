//! Making scenes: several in flight, each composed on a thread of its own, rendered when a session is free, and annotated and
//! written from a bounded queue while the next view is rendered.

pub(crate) mod anomalies;
pub(crate) mod attempt;
pub(crate) mod first_scene;
pub(crate) mod losses;
pub(crate) mod queue;
pub(crate) mod recovery;
pub(crate) mod scene;
pub(crate) mod scenes;
pub(crate) mod sessions;
pub(crate) mod stages;
pub mod times;
pub(crate) mod walk;
pub(crate) mod writers;
