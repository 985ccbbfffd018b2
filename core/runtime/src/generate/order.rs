//! Scenes that are made in any order and taken in the order of their source.

use super::source::{NextScene, SceneSource};
use crate::run::stop::Stop;
use parking_lot::{Condvar, Mutex};
use std::collections::BTreeMap;
use std::time::Duration;
use syntable_model::error::Result;

/// Interval at which a thread that waits for a scene of the source looks whether the work has ended.
const LOOK: Duration = Duration::from_millis(20);

/// Scenes that are made in any order and taken in the order of their source. No scene begins too far ahead of the next one to
/// take. A scene that fails is `None`.
pub struct SceneOrder<'a, T> {
    source: &'a dyn SceneSource,
    /// Held while a thread waits for the next scene, so that scenes get places in their order.
    turn: Mutex<()>,
    state: Mutex<SceneOrderState<T>>,
    moved: Condvar,
    ahead: u64,
}

struct SceneOrderState<T> {
    /// Place of the next scene to begin.
    next: u64,
    /// Place of the next scene to take.
    taken: u64,
    done: BTreeMap<u64, (u32, Result<Option<T>>)>,
    /// Whether the source has ended.
    is_over: bool,
    is_closed: bool,
}

impl<'a, T> SceneOrder<'a, T> {
    pub fn new(source: &'a dyn SceneSource, ahead: u64) -> Self {
        let state = SceneOrderState { next: 0, taken: 0, done: BTreeMap::new(), is_over: false, is_closed: false };
        Self { source, turn: Mutex::new(()), state: Mutex::new(state), moved: Condvar::new(), ahead }
    }

    /// The next scene to make, and its place. `None` after the last one.
    pub fn begin(&self) -> Option<(u64, u32)> {
        let _turn = self.turn.lock();
        {
            let mut state = self.state.lock();
            while !state.is_closed && !state.is_over && state.next >= state.taken.saturating_add(self.ahead) {
                self.moved.wait(&mut state);
            }
        }
        loop {
            {
                let state = self.state.lock();
                if state.is_closed || state.is_over {
                    return None;
                }
            }
            let found = self.source.next(LOOK);
            let mut state = self.state.lock();
            match found {
                NextScene::Scene(scene) => {
                    let place = state.next;
                    state.next += 1;
                    return Some((place, scene));
                }
                NextScene::NotYet => {}
                NextScene::End => {
                    state.is_over = true;
                    self.moved.notify_all();
                }
            }
        }
    }

    /// Stores a scene at its place.
    pub fn put(&self, place: u64, scene: u32, made: Result<Option<T>>) {
        self.state.lock().done.insert(place, (scene, made));
        self.moved.notify_all();
    }

    /// Waits for the next scene. `None` after the last one.
    pub fn take(&self) -> Option<(u32, Result<Option<T>>)> {
        let mut state = self.state.lock();
        let place = state.taken;
        let made = loop {
            if let Some(made) = state.done.remove(&place) {
                break made;
            }
            if state.is_over && state.next == place {
                return None;
            }
            self.moved.wait(&mut state);
        };
        state.taken += 1;
        self.moved.notify_all();
        Some(made)
    }
}

/// When dropped, prevents further scenes from starting, and stops the scenes in progress.
pub struct Closing<'a, 's, T>(pub &'a SceneOrder<'s, T>, pub &'a Stop);

impl<T> Drop for Closing<'_, '_, T> {
    fn drop(&mut self) {
        self.0.state.lock().is_closed = true;
        self.1.cancel();
        self.0.moved.notify_all();
    }
}
