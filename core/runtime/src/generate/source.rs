//! The scenes to make, in order.

use parking_lot::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

/// The scenes to make, in the order of their samples.
pub trait SceneSource: Sync {
    /// The next scene, after at most `patience`.
    fn next(&self, patience: Duration) -> NextScene;

    /// The scenes, if they are known.
    fn all(&self) -> Option<Box<dyn Iterator<Item = u32> + '_>> {
        None
    }
}

/// The next scene of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NextScene {
    /// Its number.
    Scene(u32),
    /// The source has no scene yet.
    NotYet,
    /// The source has no further scene.
    End,
}

/// Scenes of a list.
pub struct SceneList<I>(I, Mutex<I>);

impl<I: Clone> SceneList<I> {
    pub fn new(scenes: I) -> Self {
        Self(scenes.clone(), Mutex::new(scenes))
    }
}

/// Number of scenes of a list up to which the list is read in advance.
const SHORT: usize = 1 << 20;

impl<I: Iterator<Item = u32> + Clone + Send + Sync> SceneSource for SceneList<I> {
    fn next(&self, _: Duration) -> NextScene {
        self.1.lock().next().map_or(NextScene::End, NextScene::Scene)
    }

    fn all(&self) -> Option<Box<dyn Iterator<Item = u32> + '_>> {
        let is_short = self.0.clone().nth(SHORT).is_none();
        is_short.then(|| Box::new(self.0.clone()) as _)
    }
}

/// Scenes that are requested one after the other.
pub struct Requests(Mutex<Receiver<u32>>);

impl Requests {
    pub fn new(requests: Receiver<u32>) -> Self {
        Self(Mutex::new(requests))
    }
}

impl SceneSource for Requests {
    fn next(&self, patience: Duration) -> NextScene {
        match self.0.lock().recv_timeout(patience) {
            Ok(scene) => NextScene::Scene(scene),
            Err(RecvTimeoutError::Timeout) => NextScene::NotYet,
            Err(RecvTimeoutError::Disconnected) => NextScene::End,
        }
    }
}
