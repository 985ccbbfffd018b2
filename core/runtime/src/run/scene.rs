//! One scene, from placing to writing, with its attempts.

use super::folder::Folder;
use super::journal::SceneRecord;
use super::progress::{Event, Reporter};
use crate::plan::{Maker as ProductMaker, Plan, Step};
use crate::pools::{Drawn, Library};
use crate::recipe::Recipe;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::{Cache, Context, Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::product::Frame;
use syntable_model::product::Value;
use syntable_model::product::standard::{DENOISER, RADIANCE, RADIANCE_NOISY};
use syntable_model::random::Stream;
use syntable_model::scene::{Camera, Optics, Scene, SceneBuilder, SceneId, View, ViewId};
use syntable_model::stage::{DatasetInfo, Output, RenderRequest, RenderSession, SceneWriter, Site};

/// Makes scenes.
pub struct Maker<'a> {
    pub recipe: &'a Recipe,
    pub plan: &'a Plan,
    pub dataset: &'a DatasetInfo,
    pub library: &'a Library<'a>,
    pub cache: &'a dyn Cache,
    pub workers: &'a dyn Workers,
    pub log: &'a dyn Log,
    pub reporter: &'a dyn Reporter,
    pub folder: &'a Folder,
}

/// Why an attempt ended early.
enum Failure {
    /// The scene is at fault: the next attempt may do better.
    Scene(Error),
    /// The run is at fault, such as a full disk: it must stop.
    Run(Error),
}

impl Maker<'_> {
    /// Makes a scene in its staging folder, trying again as often as the recipe allows. Gives the record to commit.
    pub fn make(&self, scene: SceneId, session: &mut dyn RenderSession) -> Result<SceneRecord> {
        let mut errors = Vec::new();
        for attempt in 0..self.recipe.dataset.max_attempts {
            let staged = self.folder.stage(scene.0)?;
            let outcome = caught(|| self.attempt(scene, attempt, &staged, session));
            let error = match outcome {
                Ok(record) => return Ok(SceneRecord { errors, ..record }),
                Err(Failure::Run(error)) => return Err(error),
                Err(Failure::Scene(error)) => error,
            };
            let last = attempt + 1 == self.recipe.dataset.max_attempts;
            self.reporter.event(&Event::Attempt { scene: scene.0, attempt, error: error.to_string(), last });
            errors.push(error.to_string());
        }
        let attempt = self.recipe.dataset.max_attempts.saturating_sub(1);
        Ok(SceneRecord { scene: scene.0, attempt, views: 0, objects: 0, errors, assets: Default::default() })
    }

    fn attempt(
        &self,
        id: SceneId,
        attempt: u32,
        staged: &Path,
        session: &mut dyn RenderSession,
    ) -> Result<SceneRecord, Failure> {
        let drawn = Drawn::new(self.library);
        let stream =
            |stage: &str| Stream::root(self.dataset.seed).child(stage).at(u64::from(id.0)).at(u64::from(attempt));
        let context = |stage: &str, stream: Stream| {
            running(stage);
            Context { stream, assets: &drawn, cache: self.cache, workers: self.workers, log: self.log }
        };
        let scene = self.compose(id, attempt, &stream, &context).map_err(Failure::Scene);
        self.library.refused().map_err(Failure::Run)?;
        let scene = Arc::new(scene?);
        running("render");
        session.load(&scene, self.workers).map_err(|error| Failure::Scene(error.context("render")))?;

        let mut scene_frame = Frame::new();
        let site = Site { dataset: self.dataset, scene: &scene, view: None };
        let nothing_sensed = |stage: &str| context(stage, stream(stage));
        self.fill(&self.plan.per_scene, &site, &mut scene_frame, &nothing_sensed).map_err(Failure::Scene)?;
        let scene_frame = Arc::new(scene_frame);
        let mut writers: Vec<(&str, Box<dyn SceneWriter>)> = Vec::new();
        for (writer_id, writer) in &self.recipe.write {
            running(writer_id);
            let output = Output::new(staged, writer_id, id);
            writers.push((writer_id, writer.scene(&site, output).map_err(|error| write_failure(writer_id, error))?));
        }
        for number in 0..self.dataset.views_per_scene {
            let view = self.view(&scene, ViewId(number), &stream, &context).map_err(Failure::Scene)?;
            let site = Site { view: Some(&view), ..site };
            let sensing = |stage: &str| context(stage, stream(stage).at(u64::from(number)));
            let mut frame = Frame::of_view(Arc::clone(&scene_frame));
            running("render");
            let request = RenderRequest {
                view: &view,
                wants: &self.plan.rendered,
                stream: stream("render").at(u64::from(number)),
                workers: self.workers,
            };
            session.render(&request, &mut frame).map_err(|error| Failure::Scene(error.context("render")))?;
            self.denoise(&mut frame).map_err(|error| Failure::Scene(error.context("denoise")))?;
            self.fill(&self.plan.per_view, &site, &mut frame, &sensing).map_err(Failure::Scene)?;
            for (writer_id, writer) in &mut writers {
                running(writer_id);
                writer.view(&site, &frame).map_err(|error| write_failure(writer_id, error))?;
            }
            self.reporter.event(&Event::Image { scene: id.0, view: number });
        }
        for (writer_id, writer) in writers {
            running(writer_id);
            writer.close().map_err(|error| write_failure(writer_id, error))?;
        }
        let removed = scene.settle.removed.len() as u32;
        let objects = scene.objects().len() as u32;
        self.reporter.event(&Event::Scene { scene: id.0, objects, removed });
        let views = self.dataset.views_per_scene;
        Ok(SceneRecord { scene: id.0, attempt, views, objects, errors: Vec::new(), assets: drawn.into_digests() })
    }

    /// Places the bodies and lets them come to rest.
    fn compose<'c>(
        &self,
        id: SceneId,
        attempt: u32,
        stream: &dyn Fn(&str) -> Stream,
        context: &dyn Fn(&str, Stream) -> Context<'c>,
    ) -> Result<Scene> {
        let mut builder = SceneBuilder::default();
        for (placer_id, placer) in &self.recipe.place {
            let stage = format!("place.{placer_id}");
            placer.place(&mut builder, &context(&stage, stream(&stage))).map_err(|error| error.context(stage))?;
        }
        let settle = self
            .recipe
            .settle
            .settle(&mut builder, &context("settle", stream("settle")))
            .map_err(|error| error.context("settle"))?;
        builder.freeze(id, attempt, settle)
    }

    /// Samples camera and lights of a view.
    fn view<'c>(
        &self,
        scene: &Scene,
        id: ViewId,
        stream: &dyn Fn(&str) -> Stream,
        context: &dyn Fn(&str, Stream) -> Context<'c>,
    ) -> Result<View> {
        let at = |stage: &str| context(stage, stream(stage).at(u64::from(id.0)));
        let world_from_camera =
            self.recipe.views.pose(scene, id, &at("views")).map_err(|error| error.context("views"))?;
        let Optics { intrinsics, distortion, lens, exposure } = self
            .recipe
            .camera
            .optics(scene, &world_from_camera, &at("camera"))
            .map_err(|error| error.context("camera"))?;
        let camera = Camera { intrinsics, distortion, lens, world_from_camera };
        let shell = self.recipe.views.shell(scene);
        let mut lights = scene.lights.clone();
        for (light_id, sampler) in &self.recipe.lights {
            let stage = format!("lights.{light_id}");
            let lent = if sampler.once_per_scene() { context(&stage, stream(&stage)) } else { at(&stage) };
            let sampled = sampler.lights(scene, &camera, &shell, &lent);
            lights.extend(sampled.map_err(|error| error.context(stage))?);
        }
        Ok(View { id, camera, exposure, lights })
    }

    /// Denoises what was rendered, if the plan says so, and tells what did it.
    fn denoise(&self, frame: &mut Frame) -> Result<()> {
        let mut report = Value::record([("name", "none".into())]);
        if self.plan.denoised
            && let Some(denoiser) = &self.recipe.denoise
        {
            running("denoise");
            let denoised = denoiser.denoise(frame, self.workers)?;
            frame.rename(RADIANCE, RADIANCE_NOISY)?;
            frame.put(RADIANCE, denoised.radiance)?;
            report = denoised.report;
        }
        if self.plan.denoiser_wanted { frame.put(DENOISER, report) } else { Ok(()) }
    }

    /// Runs sensors and annotators.
    fn fill<'c>(
        &self,
        steps: &[Step],
        site: &Site,
        frame: &mut Frame,
        context: &dyn Fn(&str) -> Context<'c>,
    ) -> Result<()> {
        for Step { stage, maker, .. } in steps {
            running(stage);
            frame.guard(&maker.reads());
            let done = match maker {
                ProductMaker::Sensor(sensor) => sensor.sense(site, &context(stage), frame),
                ProductMaker::Annotator(annotator) => annotator.annotate(site, frame),
            };
            frame.unguard();
            done.map_err(|error| error.context(stage))?;
            for key in maker.provides() {
                if !frame.contains(key.name) {
                    return Err(Error::new(format!("it declares to provide `{}` but did not", key.name)).context(stage));
                }
            }
        }
        Ok(())
    }
}

/// A file system that fails stops the run; anything else that a writer complains of is the scene's fault.
fn write_failure(id: &str, error: Error) -> Failure {
    let fail = if error.is_io() { Failure::Run } else { Failure::Scene };
    fail(error.context(format!("write.{id}")))
}

thread_local! {
    /// The stage that runs on this thread, and where it panicked.
    static STAGE: RefCell<(String, Option<String>)> = const { RefCell::new((String::new(), None)) };
}

fn running(stage: &str) {
    STAGE.with_borrow_mut(|current| {
        current.0.clear();
        current.0.push_str(stage);
    });
}

/// Turns a panic of a stage into an error of the scene.
fn caught<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result,
        Err(payload) => {
            let message = payload
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| payload.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no message".to_owned());
            let (stage, place) = STAGE.take();
            let place = place.map_or(String::new(), |place| format!(" at {place}"));
            Err(Failure::Scene(
                Error::new(format!("panicked{place}: {message}"))
                    .help("this is a bug of the stage; please report it with the recipe")
                    .context(stage),
            ))
        }
    }
}

/// While `work` runs, a panic prints nothing by itself: it is reported as an event.
pub fn with_quiet_panics<T>(work: impl FnOnce() -> T) -> T {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(|info| {
        if let Some(location) = info.location() {
            let place = format!("{}:{}", location.file(), location.line());
            STAGE.with_borrow_mut(|current| current.1 = Some(place));
        }
    }));
    let result = work();
    std::panic::set_hook(before);
    result
}
