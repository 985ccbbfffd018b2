//! Render sessions. One scene at a time borrows a session, only to load and render.

use crate::run::making::recovery::Recovery;
use crate::run::panics::caught;
use parking_lot::{Condvar, Mutex};
use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::stage::{RenderSession, Renderer};
use syntable_recipe::{Component, Recipe};

/// The sessions of a renderer: one per scene in flight, but at most one per device. Another renderer of the mixture has
/// sessions of its own, also on the same devices.
pub struct Sessions<'a> {
    renderer: &'a dyn Renderer,
    free: Mutex<Vec<SessionSlot>>,
    returned: Condvar,
}

/// A device of the renderer, with its session if that is open.
struct SessionSlot {
    index: usize,
    session: Option<Box<dyn RenderSession>>,
}

/// Number of scenes in flight: one per thread. If the number of sessions is limited, at least one scene more than
/// sessions, so that a scene is composed while another is rendered.
pub fn scenes_in_flight(recipe: &Recipe, threads: usize, scenes: usize) -> usize {
    let limits = recipe.components.all().filter_map(|component| component.render.max_sessions());
    let least = limits.map(|sessions| sessions.max(1) + 1).max().unwrap_or(1);
    threads.max(least).min(scenes).max(1)
}

/// The sessions of the renderers that make some scenes.
pub struct AllSessions<'a>(Vec<(&'a Arc<dyn Renderer>, Sessions<'a>)>);

impl<'a> AllSessions<'a> {
    /// The sessions of each renderer that makes one of the scenes, for a number of scenes in flight. An only renderer opens its
    /// sessions at once, so that a device that fails ends the run before the first scene. Several renderers open theirs when
    /// scenes need them. If the scenes are not known, any renderer may make one.
    pub fn open<S: Iterator<Item = u32>>(recipe: &'a Recipe, scenes: Option<S>, in_flight: usize) -> Result<Self> {
        let count = recipe.components.all().count();
        let used: BTreeSet<usize> = match scenes {
            Some(scenes) if count > 1 => scenes.map(|scene| recipe.component_of(scene).0).collect(),
            _ => (0..count).collect(),
        };
        let mut renderers: Vec<&Arc<dyn Renderer>> = Vec::new();
        for (_, Component { render, .. }) in recipe.components.all().enumerate().filter(|(at, _)| used.contains(at)) {
            if !renderers.iter().any(|other| Arc::ptr_eq(other, render)) {
                renderers.push(render);
            }
        }
        if let [only] = renderers[..] {
            return Ok(Self(vec![(only, Sessions::open(&**only, in_flight)?)]));
        }
        Ok(Self(renderers.into_iter().map(|render| (render, Sessions::closed(&**render, in_flight))).collect()))
    }

    /// The sessions of the renderer of a component.
    pub fn of(&self, component: &Component) -> &Sessions<'a> {
        let own = self.0.iter().find(|(renderer, _)| Arc::ptr_eq(renderer, &component.render));
        &own.expect("every renderer that makes a scene has sessions").1
    }
}

impl<'a> Sessions<'a> {
    /// Opens the sessions for a number of scenes in flight.
    pub fn open(renderer: &'a dyn Renderer, in_flight: usize) -> Result<Self> {
        let mut sessions = Self::closed(renderer, in_flight);
        for SessionSlot { index, session } in sessions.free.get_mut() {
            *session = Some(open(renderer, *index)?);
        }
        Ok(sessions)
    }

    /// Sessions for a number of scenes in flight. Each is opened for its first scene.
    pub fn closed(renderer: &'a dyn Renderer, in_flight: usize) -> Self {
        let count = renderer.max_sessions().map_or(in_flight, |max| in_flight.min(max.max(1)));
        let free = (0..count).map(|index| SessionSlot { index, session: None }).collect();
        Self { renderer, free: Mutex::new(free), returned: Condvar::new() }
    }

    /// Waits for a session and lends it to `work`. A session that fails is closed, and opened again for the next scene.
    /// If its device failed, the unused sessions are closed as well, because they may share the device.
    pub fn with<T>(&self, work: impl FnOnce(&mut dyn RenderSession) -> Result<T>) -> Result<T> {
        let SessionSlot { index, session } = {
            let mut free = self.free.lock();
            loop {
                match free.pop() {
                    Some(device) => break device,
                    None => self.returned.wait(&mut free),
                }
            }
        };
        let (session, result) = match session.map_or_else(|| open(self.renderer, index), Ok) {
            Ok(mut session) => {
                let result = work(&mut *session);
                (result.is_ok().then_some(session), result)
            }
            Err(error) => (None, Err(error)),
        };
        let mut free = self.free.lock();
        if result.as_ref().is_err_and(|error| Recovery::of(error) == Recovery::Repeat) {
            free.iter_mut().for_each(|device| device.session = None);
        }
        free.push(SessionSlot { index, session });
        drop(free);
        self.returned.notify_one();
        result
    }
}

fn open(renderer: &dyn Renderer, index: usize) -> Result<Box<dyn RenderSession>> {
    caught("render", || renderer.open(index))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use syntable_model::context::Workers;
    use syntable_model::error::Error;
    use syntable_model::product::{KeyId, Products};
    use syntable_model::scene::Scene;
    use syntable_model::stage::RenderRequest;

    /// Two devices; `opened` counts the sessions of each.
    #[derive(Default)]
    struct CountingRenderer {
        opened: [AtomicUsize; 2],
    }

    impl Renderer for CountingRenderer {
        fn offers(&self) -> Vec<KeyId> {
            Vec::new()
        }
        fn max_sessions(&self) -> Option<usize> {
            Some(2)
        }
        fn open(&self, index: usize) -> Result<Box<dyn RenderSession>> {
            let before = self.opened[index].fetch_add(1, Ordering::SeqCst);
            if before == 1 { Err(Error::new("the device is not back yet")) } else { Ok(Box::new(IdleSession)) }
        }
        fn cost(&self) -> String {
            String::new()
        }
    }

    struct IdleSession;

    impl RenderSession for IdleSession {
        fn load(&mut self, _: &Arc<Scene>, _: &dyn Workers) -> Result<()> {
            Ok(())
        }
        fn render(&mut self, _: &RenderRequest, _: &mut Products) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_session_that_failed_is_opened_anew() {
        let renderer = CountingRenderer::default();
        let opened = || renderer.opened.each_ref().map(|count| count.load(Ordering::SeqCst));
        let sessions = Sessions::open(&renderer, 5).expect("opens");
        assert_eq!(opened(), [1, 1]);
        sessions.with(|_| Ok(())).expect("works");
        assert_eq!(opened(), [1, 1]);
        let lost = sessions.with(|_| -> Result<()> { Err(Error::new("device lost")) }).expect_err("lost");
        assert_eq!(lost.to_string(), "device lost");
        // The next scene gets the lost device, which comes back at the second try.
        let still_lost = sessions.with(|_| Ok(())).expect_err("lost").to_string();
        assert_eq!(still_lost, "render: the device is not back yet");
        sessions.with(|_| Ok(())).expect("works again");
        assert_eq!(opened(), [1, 3]);
        // The other session may use the same failed device.
        let hung = sessions.with(|_| -> Result<()> { Err(Error::device("hung")) }).expect_err("hung");
        assert!(hung.is_passing());
        let both = || sessions.with(|_| sessions.with(|_| Ok(())));
        both().expect_err("the device of the other is not back yet");
        both().expect("works again");
        assert_eq!(opened(), [3, 5]);
    }

    #[test]
    fn closed_sessions_are_opened_when_scenes_need_them() {
        let renderer = CountingRenderer::default();
        let opened = || renderer.opened.iter().map(|count| count.load(Ordering::SeqCst)).sum::<usize>();
        let sessions = Sessions::closed(&renderer, 5);
        assert_eq!(opened(), 0);
        for _ in 0..3 {
            sessions.with(|_| Ok(())).expect("works");
            assert_eq!(opened(), 1);
        }
        sessions.with(|_| sessions.with(|_| Ok(()))).expect("works");
        assert_eq!(opened(), 2);
    }
}
