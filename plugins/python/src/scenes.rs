//! Scenes in memory on request, in any order.

use crate::errors::exception;
use crate::recipe::Recipe;
use crate::sample::Sample;
use crate::work::{EventSender, Events, SIGNALS, check_process, end, events, is_forked, show};
use parking_lot::Mutex;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use syntable::{GenerateOptions, SceneService, Stop};
use syntable_model::error::Error;
use syntable_recipe::message::Message;
use syntable_runtime::run::progress::{Event, Reporter};

/// The samples of a scene. None if the scene failed.
type Made = Option<Arc<Vec<syntable::Sample>>>;

/// Makes scenes when they are asked for, and keeps the last few.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Scenes {
    recipe: Recipe,
    options: GenerateOptions,
    progress: Option<Py<PyAny>>,
    kept: usize,
    state: Mutex<State>,
}

/// The threads and what they have made.
#[derive(Default)]
struct State {
    service: Option<(SceneService, Events, Stop)>,
    /// Scenes that were requested and are not made yet.
    pending: BTreeSet<u32>,
    /// The last scenes, the oldest first.
    made: VecDeque<(u32, Made)>,
    /// Reasons of scenes that failed.
    failures: BTreeMap<u32, String>,
}

impl State {
    fn find(&self, scene: u32) -> Option<Made> {
        self.made.iter().find(|(number, _)| *number == scene).map(|(_, made)| made.clone())
    }

    fn keep(&mut self, scene: u32, made: Made, most: usize) {
        self.made.retain(|(number, _)| *number != scene);
        self.made.push_back((scene, made));
        while self.made.len() > most {
            self.made.pop_front();
        }
    }
}

#[pymethods]
impl Scenes {
    /// Nothing is made yet. `kept` is the number of scenes to keep.
    #[new]
    #[pyo3(signature = (recipe, products, kept, threads, allow_code, progress))]
    fn new(
        recipe: &Recipe,
        products: Vec<String>,
        kept: usize,
        threads: Option<usize>,
        allow_code: bool,
        progress: Option<Py<PyAny>>,
    ) -> Self {
        let mut options = GenerateOptions { products, allow_code, ..GenerateOptions::default() };
        options.threads = threads.unwrap_or(options.threads);
        Self { recipe: recipe.clone(), options, progress, kept: kept.max(1), state: Mutex::default() }
    }

    /// Views by their scene and their number in it. Scenes are made in parallel.
    fn views(&self, py: Python<'_>, places: Vec<(u32, u32)>) -> PyResult<Vec<Sample>> {
        check_process(py)?;
        let wanted: BTreeSet<u32> = places.iter().map(|(scene, _)| *scene).collect();
        let scenes = self.scenes(py, wanted)?;
        let view = |(scene, view): &(u32, u32)| {
            let Some(Some(samples)) = scenes.get(scene) else {
                let reason = self.state.lock().failures.get(scene).cloned().unwrap_or_else(|| "it failed".to_owned());
                let error = Error::new(format!("scene {scene} has no views: {reason}"));
                return Err(exception(py, &error.help("leave the views of this scene out")));
            };
            let sample = samples.get(*view as usize);
            let sample = sample.ok_or_else(|| PyIndexError::new_err(format!("scene {scene} has no view {view}")))?;
            Ok(Sample::made(sample.clone()))
        };
        places.iter().map(view).collect()
    }

    /// Ends the threads, and forgets all scenes. A later request starts them again.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let ended = if is_forked() { State::default() } else { py.detach(|| std::mem::take(&mut *self.state.lock())) };
        end(ended, false).map_or(Ok(()), Err)
    }
}

/// Ends the threads. They may need Python's lock to end.
impl Drop for Scenes {
    fn drop(&mut self) {
        let ended = std::mem::take(self.state.get_mut());
        if let State { service: Some((.., stop)), .. } = &ended {
            stop.cancel();
        }
        end(ended, false);
    }
}

impl Scenes {
    /// Scenes, made if necessary.
    fn scenes(&self, py: Python<'_>, mut wanted: BTreeSet<u32>) -> PyResult<BTreeMap<u32, Made>> {
        let mut found = BTreeMap::new();
        self.start(py)?;
        loop {
            let waited = py.detach(|| self.wait(&mut wanted, &mut found));
            self.show(py)?;
            py.check_signals()?;
            waited.map_err(|error| exception(py, &error))?;
            if wanted.is_empty() {
                return Ok(found);
            }
        }
    }

    /// Starts the threads, unless they work already.
    fn start(&self, py: Python<'_>) -> PyResult<()> {
        if py.detach(|| self.state.lock().service.is_some()) {
            return Ok(());
        }
        let (recipe, warnings) = self.recipe.load(py, &self.options.products)?;
        let (sender, events): (EventSender, _) = events();
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let stop = Stop::default();
        let options = GenerateOptions { stop: stop.clone(), ..self.options.clone() };
        py.detach(|| {
            let mut state = self.state.lock();
            if state.service.is_none() {
                let service = SceneService::start(recipe, options, Arc::new(sender));
                state.pending.clear();
                state.service = Some((service, events, stop));
            }
        });
        Ok(())
    }

    /// Moves scenes that are made from `wanted` to `found`, requests the others, and waits a moment for the next one.
    fn wait(&self, wanted: &mut BTreeSet<u32>, found: &mut BTreeMap<u32, Made>) -> Result<(), Error> {
        let Some(mut state) = self.state.try_lock_for(SIGNALS) else { return Ok(()) };
        let mut collect = |state: &State| {
            wanted.retain(|scene| match state.find(*scene) {
                Some(made) => found.insert(*scene, made).is_some(),
                None => true,
            });
        };
        collect(&state);
        let new: Vec<u32> = wanted.difference(&state.pending).copied().collect();
        let State { service, pending, .. } = &mut *state;
        let Some((service, ..)) = service else { return Err(Error::new("the views were closed meanwhile")) };
        for scene in new {
            service.request(scene);
            pending.insert(scene);
        }
        if wanted.is_empty() {
            return Ok(());
        }
        match service.next_within(SIGNALS) {
            Ok(None) => Ok(()),
            Ok(Some((scene, samples))) => {
                pending.remove(&scene);
                let most = self.kept.max(wanted.len());
                state.keep(scene, samples.map(Arc::new), most);
                Ok(())
            }
            Err(error) => {
                state.service = None;
                Err(error)
            }
        }
    }

    /// Passes the events that are here to Python.
    fn show(&self, py: Python<'_>) -> PyResult<()> {
        let Some(mut state) = self.state.try_lock() else { return Ok(()) };
        let mut all = Vec::new();
        while let Some(event) = state.service.as_ref().and_then(|(_, events, _)| events.here()) {
            if let Event::Attempt { scene, error, last: true, .. } = &event {
                state.failures.insert(*scene, error.clone());
            }
            all.push(event);
        }
        drop(state);
        all.iter().try_for_each(|event| show(py, self.progress.as_ref(), event))
    }
}
