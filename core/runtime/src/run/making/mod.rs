//! Making scenes, several at a time. A thread composes each scene, and renders it when a session is free. A bounded
//! queue annotates and writes each view while the next one is rendered.

pub(crate) mod anomalies;
pub(crate) mod attempt;
pub(crate) mod first_scene;
pub(crate) mod frames;
pub(crate) mod losses;
pub(crate) mod queue;
pub(crate) mod recovery;
pub(crate) mod scene;
pub(crate) mod scenes;
pub(crate) mod sessions;
pub(crate) mod stages;
pub mod times;
pub(crate) mod view_conditions;
pub(crate) mod walk;
pub(crate) mod writers;
