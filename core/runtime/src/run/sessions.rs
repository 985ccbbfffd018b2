//! Render sessions, lent to one scene at a time, for loading and rendering only.

use crate::recipe::Recipe;
use parking_lot::{Condvar, Mutex};
use syntable_model::error::Result;
use syntable_model::stage::RenderSession;

/// As many sessions as there are scenes in flight, or fewer if there are fewer devices.
pub struct Sessions {
    free: Mutex<Vec<Box<dyn RenderSession>>>,
    returned: Condvar,
}

/// How many scenes are in flight: one per thread. With a limited number of sessions there is at least one more, so that
/// a scene is composed while another is rendered.
pub fn scenes_in_flight(recipe: &Recipe, threads: usize, scenes: usize) -> usize {
    let least = recipe.render.max_sessions().map_or(1, |sessions| sessions.max(1) + 1);
    threads.max(least).min(scenes).max(1)
}

impl Sessions {
    /// Opens the sessions for a number of scenes in flight.
    pub fn open(recipe: &Recipe, in_flight: usize) -> Result<Self> {
        let count = recipe.render.max_sessions().map_or(in_flight, |max| in_flight.min(max.max(1)));
        let open = |index| recipe.render.open(index).map_err(|error| error.context("render"));
        Ok(Self { free: Mutex::new((0..count).map(open).collect::<Result<_>>()?), returned: Condvar::new() })
    }

    /// Waits for a session and lends it.
    pub fn with<T>(&self, work: impl FnOnce(&mut dyn RenderSession) -> T) -> T {
        let mut session = {
            let mut free = self.free.lock();
            loop {
                match free.pop() {
                    Some(session) => break session,
                    None => self.returned.wait(&mut free),
                }
            }
        };
        let result = work(&mut *session);
        self.free.lock().push(session);
        self.returned.notify_one();
        result
    }
}
