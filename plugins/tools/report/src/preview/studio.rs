//! Renders the changes of a recipe, image by image, and keeps unchanged images.

use super::load::{self, LoadedRecipe, Wishes};
use super::sheet::{self, Sheet, SheetCell};
use super::watch::{Watch, WatchedFiles};
use parking_lot::Mutex;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;
use syntable_formats::draw::DrawColor;
use syntable_model::context::{Collected, Log};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;
use syntable_model::registry::Registry;
use syntable_recipe::Recipe;
use syntable_recipe::message::{Level, Message};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::SceneRange;
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Event, Reporter, Warnings, count};
use syntable_runtime::run::stop::Stop;

/// Default number of scenes, and of views.
const OF_EACH: u32 = 2;
/// Maximum number of cells of a sheet.
const MAX_CELLS: usize = 400;
/// Number of cached images in addition to the sheet, for recipes that return to an earlier state.
const KEPT: usize = 200;
/// Maximum number of pixels of the images that are kept.
const KEPT_PIXELS: usize = 1 << 26;
/// Maximum number of pixels of a sheet.
const MAX_PIXELS: u64 = 1 << 27;

/// Output of the preview.
#[derive(Debug, Clone, PartialEq)]
pub enum StudioOutput {
    /// Images, and cells that wait for theirs.
    Sheet(Sheet),
    /// The errors of the recipe.
    Mistakes(String),
}

/// New output, with its warnings.
pub struct News<'a> {
    /// The output.
    pub shown: &'a StudioOutput,
    /// Name of the dataset; empty before a recipe was loaded.
    pub name: &'a str,
    /// Warnings, one per line as they are printed.
    pub warnings: &'a [String],
    /// Whether more output follows.
    pub is_busy: bool,
}

/// How a pass ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassEnd {
    /// All possible images are finished.
    Done {
        /// Scenes that failed.
        failed: u32,
        /// Whether stages left something out of the images.
        is_lossy: bool,
    },
    /// The recipe has mistakes.
    Mistaken,
    /// The caller stopped it.
    Stopped,
}

/// Renders sheets of a recipe, with a cache for the next sheets.
pub struct PreviewStudio<'a> {
    reporter: &'a dyn Reporter,
    registry: &'a Registry,
    wishes: Wishes,
    scenes: Option<SceneRange>,
    width: u32,
    previewer: Previewer,
    images: ImageCache,
    /// The last sheet, shown until a newer one exists.
    sheet: Option<Sheet>,
    files: WatchedFiles,
    /// The last errors that were shown.
    told: Option<String>,
    name: String,
}

/// Images by the digest of their inputs, the oldest first.
#[derive(Default)]
struct ImageCache {
    all: BTreeMap<Digest, Arc<Plane<DrawColor>>>,
    order: VecDeque<Digest>,
}

impl ImageCache {
    fn add(&mut self, key: Digest, image: Arc<Plane<DrawColor>>, most: usize) {
        if self.all.insert(key, image).is_none() {
            self.order.push_back(key);
        }
        let mut pixels: usize = self.all.values().map(|image| image.data().len()).sum();
        // The sheet has its images without these.
        while self.order.len() > 1 && (self.order.len() > most || pixels > KEPT_PIXELS) {
            let oldest = self.order.pop_front().and_then(|oldest| self.all.remove(&oldest));
            pixels -= oldest.map_or(0, |image| image.data().len());
        }
    }

    /// Removes an image of a failed attempt.
    fn remove(&mut self, key: &Digest) {
        self.all.remove(key);
        self.order.retain(|other| other != key);
    }
}

impl<'a> PreviewStudio<'a> {
    /// A studio without images.
    pub fn new(
        reporter: &'a dyn Reporter,
        registry: &'a Registry,
        (wishes, scenes, width): (Wishes, Option<SceneRange>, u32),
        threads: usize,
    ) -> Result<Self> {
        Ok(Self {
            reporter,
            registry,
            wishes,
            scenes,
            width,
            previewer: Previewer::new(threads, DiskCache::of_user())?,
            images: ImageCache::default(),
            sheet: None,
            files: WatchedFiles::default(),
            told: None,
            name: String::new(),
        })
    }

    /// Loads the recipe and renders its changes. Calls `show` for every new output; an error of `show` ends the pass.
    pub fn pass(&mut self, watch: &Watch, stop: &Stop, show: &mut dyn FnMut(&News) -> Result<()>) -> Result<PassEnd> {
        let start = Instant::now();
        let doubts = Collected::default();
        let LoadedRecipe { recipe, mut files } = self.wishes.load(self.registry, &doubts);
        let doubts: Vec<Message> = doubts.merged().into_iter().map(Message::Warning).collect();
        if recipe.is_err() {
            files.add_all(&self.files);
        }
        self.files = files.clone();
        watch.set(files);
        let (recipe, warnings) = match recipe {
            Ok(loaded) => loaded,
            Err(messages) => return self.mistaken(&[doubts, messages].concat(), show),
        };
        let (scenes, views) = match shown_of(&recipe, self.scenes, self.wishes.recipe.views) {
            Ok(shown) => shown,
            Err(error) => return self.mistaken(&load::of_error(error), show),
        };
        let panels = if self.wishes.labels { 3 } else { 1 };
        let expected = [self.width * panels, self.width * 3 / 4];
        let cells = scenes.len() as u64 * views.len() as u64;
        if cells * expected.map(u64::from).iter().product::<u64>() > MAX_PIXELS {
            let error = Error::new(format!("a sheet of {cells} images of {} pixels across is too large", expected[0]));
            return self.mistaken(
                &load::of_error(error.help("lower the width of images, or show fewer scenes or views")),
                show,
            );
        }
        let said = WarningRecorder { reporter: self.reporter, warnings: Mutex::default() };
        let log = Warnings(&said);
        self.name.clone_from(&recipe.dataset.name);
        for warning in doubts.into_iter().chain(warnings.into_iter().map(Message::Diagnostic)) {
            self.reporter.message(&warning);
            said.warnings.lock().push(warning.render(false).trim_end().to_owned());
        }
        // A file of the recipe may be gone for a moment while it is saved.
        if let Err(error) = self.previewer.set(recipe) {
            return self.mistaken(&load::of_error(error), show);
        }
        let products = sheet::inputs(self.wishes.labels).into_iter().map(|input| input.product).collect();
        let wanted = Wanted { products, width: self.width };
        let mut pass = match self.previewer.pass(&wanted, &said, &log, stop) {
            Ok(pass) => pass,
            Err(error) => return self.mistaken(&load::of_error(error), show),
        };
        self.told = None;
        let columns = views.len();
        let keys: Vec<Digest> = scenes
            .iter()
            .flat_map(|&scene| views.iter().map(move |&view| (scene, view)))
            .map(|(s, v)| pass.key(s, v))
            .collect();
        let before = self.sheet.take();
        let cells = keys.iter().enumerate().map(|(index, key)| match self.images.all.get(key) {
            Some(image) => SheetCell::Image { image: Arc::clone(image), is_current: true },
            None => outdated(before.as_ref(), (scenes[index / columns], views[index % columns])),
        });
        let sheet = Sheet { cells: cells.collect(), scenes: scenes.clone(), views: views.clone(), expected };
        let missing = |cell: &SheetCell| !matches!(cell, SheetCell::Image { is_current: true, .. });
        let todo: Vec<Vec<u32>> = (sheet.cells.chunks(columns))
            .map(|row| row.iter().zip(&views).filter(|(cell, _)| missing(cell)).map(|(_, &view)| view).collect())
            .collect();
        let is_busy = todo.iter().any(|views| !views.is_empty());
        let mut shown = StudioOutput::Sheet(sheet);
        let (images, name) = (&mut self.images, self.name.as_str());
        let mut tell = |shown: &StudioOutput, is_busy: bool| {
            let warnings = said.warnings.lock().clone();
            show(&News { shown, name, warnings: &warnings, is_busy })
        };
        // Cached images are shown at once, and missing ones as waiting.
        let mut result = tell(&shown, is_busy);
        let (mut failed, mut made) = (0, 0);
        for (row, missing) in todo.iter().enumerate().filter(|(_, views)| !views.is_empty()) {
            if result.is_err() || stop.is_requested() {
                break;
            }
            let of = |view: u32| row * columns + views.iter().position(|&other| other == view).unwrap_or(0);
            let mut drawing: Result<()> = Ok(());
            let done = pass.scene(scenes[row], missing, &mut |view, products| {
                let drawn = sheet::cell(products, panels > 1).and_then(|image| {
                    let (index, image) = (of(view), Arc::new(image));
                    images.add(keys[index], Arc::clone(&image), KEPT + keys.len());
                    put(&mut shown, index, SheetCell::Image { image, is_current: true });
                    made += 1;
                    tell(&shown, true)
                });
                if let (Err(error), Ok(())) = (drawn, &drawing) {
                    drawing = Err(error);
                }
            });
            result = drawing;
            if let (Err(error), false) = (done, stop.is_requested()) {
                failed += 1;
                for &view in missing {
                    images.remove(&keys[of(view)]);
                    put(&mut shown, of(view), SheetCell::Failed(error.to_string()));
                }
            }
        }
        let losses = pass.end();
        losses.iter().for_each(|loss| log.warn(&loss.warning()));
        if result.is_ok() && !stop.is_requested() && is_busy {
            result = tell(&shown, false);
        }
        if let StudioOutput::Sheet(sheet) = shown {
            self.sheet = Some(sheet);
        }
        result?;
        if stop.is_requested() {
            return Ok(PassEnd::Stopped);
        }
        let message =
            format!("{} of {} made in {:.1} s", made, count(keys.len() as u32, "image"), start.elapsed().as_secs_f64());
        self.reporter.event(&Event::Note { message });
        Ok(PassEnd::Done { failed, is_lossy: !losses.is_empty() })
    }

    /// Shows the errors of a recipe, unless they were shown last.
    fn mistaken(&mut self, messages: &[Message], show: &mut dyn FnMut(&News) -> Result<()>) -> Result<PassEnd> {
        let text = load::said(messages);
        if self.told.as_ref() != Some(&text) {
            messages.iter().for_each(|message| self.reporter.message(message));
            let shown = StudioOutput::Mistakes(text.clone());
            show(&News { shown: &shown, name: &self.name, warnings: &[], is_busy: false })?;
            self.told = Some(text);
        }
        Ok(PassEnd::Mistaken)
    }
}

/// The numbers of the scenes and views that are shown.
fn shown_of(recipe: &Recipe, scenes: Option<SceneRange>, views: Option<u32>) -> Result<(Vec<u32>, Vec<u32>)> {
    let dataset = &recipe.dataset;
    let scenes = match scenes {
        Some(scenes) => scenes.within(dataset.scenes)?,
        None => 0..dataset.scenes.min(OF_EACH),
    };
    let views = 0..views.unwrap_or_else(|| dataset.views_per_scene.min(OF_EACH));
    let cells = scenes.len() * views.len();
    if cells > MAX_CELLS {
        return Err(Error::new(format!("a sheet of {cells} images exceeds the limit of {MAX_CELLS}"))
            .help("show fewer scenes or views"));
    }
    Ok((scenes.collect(), views.collect()))
}

/// The earlier cell of a view, marked as outdated.
fn outdated(before: Option<&Sheet>, (scene, view): (u32, u32)) -> SheetCell {
    let found = before.and_then(|sheet| {
        let row = sheet.scenes.iter().position(|&other| other == scene)?;
        let column = sheet.views.iter().position(|&other| other == view)?;
        sheet.cells.get(row * sheet.views.len() + column)
    });
    match found {
        Some(SheetCell::Image { image, .. }) => SheetCell::Image { image: Arc::clone(image), is_current: false },
        _ => SheetCell::Waiting,
    }
}

fn put(shown: &mut StudioOutput, index: usize, cell: SheetCell) {
    if let StudioOutput::Sheet(sheet) = shown {
        sheet.cells[index] = cell;
    }
}

/// A reporter that remembers warnings, for the page.
struct WarningRecorder<'a> {
    reporter: &'a dyn Reporter,
    warnings: Mutex<Vec<String>>,
}

impl Reporter for WarningRecorder<'_> {
    fn event(&self, event: &Event) {
        if let Event::Message(record) = event
            && record.level == Level::Warning
        {
            self.warnings.lock().push(record.line());
        }
        self.reporter.event(event);
    }

    fn message(&self, message: &Message) {
        if matches!(message, Message::Warning(_)) {
            self.warnings.lock().push(message.render(false).trim_end().to_owned());
        }
        self.reporter.message(message);
    }
}
