//! Renders the changes of a recipe, image by image, and keeps unchanged images.

use super::choice::Choice;
use super::load::{self, LoadedRecipe, Quality, Wishes, Wording};
use super::sheet::{Sheet, SheetCell};
use super::shot::Shot;
use super::watch::{Watch, WatchedFiles};
use parking_lot::Mutex;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;
use syntable_model::context::{Collected, Log};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::registry::Registry;
use syntable_model::stage::DatasetInfo;
use syntable_recipe::Recipe;
use syntable_recipe::message::{Level, Message};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::SceneRange;
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Event, Reporter, Warnings, count};
use syntable_runtime::run::stop::Stop;

/// Default number of scenes and of views.
const OF_EACH: u32 = 2;
/// Maximum number of cells of a sheet.
const MAX_CELLS: usize = 400;
/// Number of cached images in addition to the sheet, for recipes that return to an earlier state.
const KEPT: usize = 200;
/// Maximum number of pixels of the cached images.
const KEPT_PIXELS: usize = 1 << 26;
/// Maximum number of pixels of a sheet.
const MAX_PIXELS: u64 = 1 << 27;

/// Output of the preview.
#[derive(Debug, Clone, PartialEq)]
pub enum StudioOutput {
    /// Images, and cells that wait for their images.
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
    /// Seed of the recipe.
    pub seed: u64,
    /// Numbers of scenes and of views per scene in the recipe.
    pub size: [u32; 2],
    /// The view that is open, at final quality.
    pub large: Option<&'a LargeView>,
}

/// A view at final quality.
#[derive(Debug, Clone, PartialEq)]
pub struct LargeView {
    /// Its scene and view.
    pub place: [u32; 2],
    /// Its progress.
    pub cell: SheetCell,
}

/// How a pass ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassEnd {
    /// All possible images are finished.
    Done {
        /// Scenes that failed.
        failed: u32,
        /// Whether stages omitted something from the images.
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
    seed: u64,
    size: [u32; 2],
    choice: Choice,
    large: Option<LargeView>,
}

/// Images by the digest of their inputs, the oldest first.
#[derive(Default)]
struct ImageCache {
    all: BTreeMap<Digest, Arc<Shot>>,
    order: VecDeque<Digest>,
}

impl ImageCache {
    fn add(&mut self, key: Digest, image: Arc<Shot>, most: usize) {
        if self.all.insert(key, image).is_none() {
            self.order.push_back(key);
        }
        let mut pixels: usize = self.all.values().map(|image| image.pixels()).sum();
        // The sheet holds its images independently of this cache.
        while self.order.len() > 1 && (self.order.len() > most || pixels > KEPT_PIXELS) {
            let oldest = self.order.pop_front().and_then(|oldest| self.all.remove(&oldest));
            pixels -= oldest.map_or(0, |image| image.pixels());
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
            seed: 0,
            size: [0; 2],
            choice: Choice::default(),
            large: None,
        })
    }

    /// Sets what the next pass shows.
    pub fn choose(&mut self, choice: Choice) {
        self.choice = choice;
    }

    /// Loads the recipe and renders its changes. Calls `show` for every new output; an error of `show` ends the pass.
    pub fn pass(&mut self, watch: &Watch, stop: &Stop, show: &mut dyn FnMut(&News) -> Result<()>) -> Result<PassEnd> {
        let start = Instant::now();
        let (reporter, wording) = (self.reporter, self.wishes.wording);
        let said = WarningRecorder { reporter, wording, warnings: Mutex::default() };
        let views = match self.prepare(watch, &said) {
            Ok(views) => views,
            Err(messages) => return self.mistaken(&messages, show),
        };
        let made = match self.draw_all(&views, &said, stop, show) {
            Ok(made) => made,
            Err(PassError::Recipe(error)) => return self.mistaken(&load::of_error(error), show),
            Err(PassError::Output(error)) => return Err(error),
        };
        if stop.is_requested() {
            return Ok(PassEnd::Stopped);
        }
        let (images, seconds) = (count(views.len() as u32, "image"), start.elapsed().as_secs_f64());
        let message = format!("{} of {images} made in {seconds:.1} s", made.images);
        self.reporter.event(&Event::Note { message });
        Ok(PassEnd::Done { failed: made.failed_scenes, is_lossy: made.is_lossy })
    }

    /// Loads the recipe and passes it to the previewer. Errors are the recipe's errors, after its warnings.
    fn prepare(&mut self, watch: &Watch, said: &WarningRecorder) -> std::result::Result<ShownViews, Vec<Message>> {
        let doubts = Collected::default();
        let LoadedRecipe { recipe, mut files, products } =
            self.wishes.load(self.registry, &self.choice, Quality::Quick, &doubts);
        let doubts: Vec<Message> = doubts.merged().into_iter().map(Message::Warning).collect();
        if recipe.is_err() {
            files.add_all(&self.files);
        }
        self.files = files.clone();
        watch.set(files);
        let (recipe, warnings) = recipe.map_err(|messages| [doubts.clone(), messages].concat())?;
        let views = ShownViews::of(&recipe, self, products).map_err(load::of_error)?;
        self.name.clone_from(&recipe.dataset.name);
        self.seed = recipe.dataset.seed;
        self.size = [recipe.dataset.scenes, recipe.dataset.views_per_scene];
        for warning in doubts.into_iter().chain(warnings.into_iter().map(Message::Diagnostic)) {
            self.reporter.message(&warning);
            said.remember(&warning);
        }
        // A file of the recipe may be missing for a moment while it is saved.
        self.previewer.set(recipe).map_err(load::of_error)?;
        Ok(views)
    }

    /// Renders the missing images of a sheet. The view that is open comes first, and then at final quality.
    fn draw_all(
        &mut self,
        views: &ShownViews,
        said: &WarningRecorder,
        stop: &Stop,
        show: &mut dyn FnMut(&News) -> Result<()>,
    ) -> std::result::Result<DrawnImages, PassError> {
        let place = self.choice.large.filter(|[scene, view]| views.all().any(|place| place == (*scene, *view)));
        let before = self.large.take();
        let Some(place) = place else { return self.draw(views, None, said, stop, show) };
        let outdated = |cell: SheetCell| match cell {
            SheetCell::Image { image, .. } => SheetCell::Image { image, is_current: false },
            _ => SheetCell::Waiting,
        };
        let cell = before.filter(|before| before.place == place).map_or(SheetCell::Waiting, |it| outdated(it.cell));
        self.large = Some(LargeView { place, cell });
        let mut made = self.draw(views, Some(place), said, stop, show)?;
        if !stop.is_requested() {
            made.is_lossy |= self.enlarge(place, said, stop)?;
        }
        if stop.is_requested() {
            return Ok(made);
        }
        let quick = self.wishes.load(self.registry, &self.choice, Quality::Quick, &Collected::default());
        let recipe = quick.recipe.map_err(|_| PassError::Recipe(Error::new("the recipe changed while it was read")))?;
        self.previewer.set(recipe.0).map_err(PassError::Recipe)?;
        let others = self.draw(views, None, said, stop, show)?;
        Ok(DrawnImages {
            images: made.images + others.images,
            failed_scenes: made.failed_scenes + others.failed_scenes,
            is_lossy: made.is_lossy || others.is_lossy,
        })
    }

    /// Renders the view that is open at final quality. Returns whether stages omitted something from it.
    fn enlarge(
        &mut self,
        [scene, view]: [u32; 2],
        said: &WarningRecorder,
        stop: &Stop,
    ) -> std::result::Result<bool, PassError> {
        let log = Warnings(said);
        let LoadedRecipe { recipe, products, .. } =
            self.wishes.load(self.registry, &self.choice, Quality::Final, &Collected::default());
        // The quick recipe has no errors, so a save has just changed it; the next pass shows the new errors.
        let Ok((recipe, _)) = recipe else { return Ok(false) };
        let info = recipe.dataset_info();
        self.previewer.set(recipe).map_err(PassError::Recipe)?;
        let wanted = Wanted { products, width: u32::MAX, allow_code: self.wishes.allow_code };
        let mut pass = self.previewer.pass(&wanted, said, &log, stop).map_err(PassError::Recipe)?;
        let key = pass.key(scene, view);
        let mut cell = self.images.all.get(&key).map(|image| Ok(Arc::clone(image)));
        if cell.is_none() {
            let made = pass.scene(scene, &[view], &mut |_, products, time| {
                cell = Some(Shot::of(products, false, &info, Some((&key, time))).map(Arc::new));
            });
            if let Err(error) = made {
                cell = Some(Err(error));
            }
        }
        let is_lossy = !pass.end().is_empty();
        let cell = match cell {
            Some(Ok(image)) => {
                self.images.add(key, Arc::clone(&image), KEPT);
                SheetCell::Image { image, is_current: true }
            }
            Some(Err(error)) => SheetCell::Failed((self.wishes.wording)(&error.to_string()).into_owned()),
            None => SheetCell::Waiting,
        };
        if let Some(large) = self.large.as_mut().filter(|_| !stop.is_requested()) {
            large.cell = cell;
        }
        Ok(is_lossy)
    }

    /// Renders the missing images of a sheet; with `only`, the image of one view.
    fn draw(
        &mut self,
        views: &ShownViews,
        only: Option<[u32; 2]>,
        said: &WarningRecorder,
        stop: &Stop,
        show: &mut dyn FnMut(&News) -> Result<()>,
    ) -> std::result::Result<DrawnImages, PassError> {
        let log = Warnings(said);
        let wanted = Wanted { products: views.products.clone(), width: self.width, allow_code: self.wishes.allow_code };
        let mut pass = self.previewer.pass(&wanted, said, &log, stop).map_err(PassError::Recipe)?;
        self.told = None;
        let keys: Vec<Digest> = views.all().map(|(scene, view)| pass.key(scene, view)).collect();
        let before = self.sheet.take();
        let cells = keys.iter().zip(views.all()).map(|(key, place)| match self.images.all.get(key) {
            Some(image) => SheetCell::Image { image: Arc::clone(image), is_current: true },
            None => outdated(before.as_ref(), place),
        });
        let (scenes, columns, expected) = (views.scenes.clone(), views.views.clone(), views.expected);
        let sheet = Sheet { cells: cells.collect(), scenes, views: columns, expected, labels: self.wishes.labels };
        let mut todo = views.missing(&sheet);
        if let Some([scene, view]) = only {
            todo.retain(|(other, _)| *other == scene);
            todo.iter_mut().for_each(|(_, views)| views.retain(|other| *other == view));
        }
        let is_busy = todo.iter().any(|(_, views)| !views.is_empty());
        let mut shown = StudioOutput::Sheet(sheet);
        let (images, name, large) = (&mut self.images, self.name.as_str(), self.large.as_ref());
        let (seed, size) = (self.seed, self.size);
        let mut tell = |shown: &StudioOutput, is_busy: bool| {
            let warnings = said.warnings.lock().clone();
            show(&News { shown, name, warnings: &warnings, is_busy, seed, size, large })
        };
        // Cached images are shown at once, and missing ones as waiting.
        let mut result = tell(&shown, is_busy || only.is_some());
        let mut made = DrawnImages::default();
        for (scene, missing) in todo.iter().filter(|(_, views)| !views.is_empty()) {
            if result.is_err() || stop.is_requested() {
                break;
            }
            let done = pass.scene(*scene, missing, &mut |view, products, time| {
                let index = views.index(*scene, view);
                let details = self.wishes.page.then_some((&keys[index], time));
                let drawn = Shot::of(products, self.wishes.labels, &views.info, details).and_then(|image| {
                    let image = Arc::new(image);
                    images.add(keys[index], Arc::clone(&image), KEPT + keys.len());
                    put(&mut shown, index, SheetCell::Image { image, is_current: true });
                    tell(&shown, true)
                });
                if result.is_ok() {
                    result = drawn;
                }
            });
            if let (Err(error), false) = (done, stop.is_requested()) {
                made.failed_scenes += 1;
                for index in missing.iter().map(|&view| views.index(*scene, view)) {
                    images.remove(&keys[index]);
                    put(&mut shown, index, SheetCell::Failed((self.wishes.wording)(&error.to_string()).into_owned()));
                }
            }
        }
        if let StudioOutput::Sheet(sheet) = &shown {
            let left = |(scene, views_of): &(u32, Vec<u32>)| {
                let is_left = |view: &&u32| !sheet.cells[views.index(*scene, **view)].is_current();
                views_of.iter().filter(is_left).count()
            };
            made.images = todo.iter().map(|of_scene| of_scene.1.len() - left(of_scene)).sum();
        }
        let losses = pass.end();
        losses.iter().for_each(|loss| log.warn(&loss.warning()));
        made.is_lossy = !losses.is_empty();
        if result.is_ok() && !stop.is_requested() && is_busy {
            result = tell(&shown, only.is_some());
        }
        if let StudioOutput::Sheet(sheet) = shown {
            self.sheet = Some(sheet);
        }
        result.map(|()| made).map_err(PassError::Output)
    }

    /// Shows the errors of a recipe, unless they were shown last.
    fn mistaken(&mut self, messages: &[Message], show: &mut dyn FnMut(&News) -> Result<()>) -> Result<PassEnd> {
        let text = load::said(messages, self.wishes.wording);
        if self.told.as_ref() != Some(&text) {
            messages.iter().for_each(|message| self.reporter.message(message));
            let shown = StudioOutput::Mistakes(text.clone());
            show(&News {
                shown: &shown,
                name: &self.name,
                warnings: &[],
                is_busy: false,
                seed: self.seed,
                size: self.size,
                large: self.large.as_ref(),
            })?;
            self.told = Some(text);
        }
        Ok(PassEnd::Mistaken)
    }
}

/// Reason why a pass drew no sheet.
enum PassError {
    /// The recipe or its assets.
    Recipe(Error),
    /// The output.
    Output(Error),
}

/// The images that a pass rendered.
#[derive(Default)]
struct DrawnImages {
    images: usize,
    failed_scenes: u32,
    /// Whether stages omitted something from the images.
    is_lossy: bool,
}

/// The views on a sheet, one row per scene.
struct ShownViews {
    scenes: Vec<u32>,
    views: Vec<u32>,
    /// Width and height of a cell, px, until an image determines them.
    expected: [u32; 2],
    /// Names of the displayed products.
    products: Vec<String>,
    info: DatasetInfo,
}

impl ShownViews {
    /// The views of a recipe that a studio shows.
    ///
    /// # Errors
    /// If the sheet would be too large.
    fn of(recipe: &Recipe, studio: &PreviewStudio, products: Vec<String>) -> Result<Self> {
        let dataset = &recipe.dataset;
        let scenes = match studio.scenes {
            Some(scenes) => scenes.within(dataset.scenes)?,
            None => 0..dataset.scenes.min(OF_EACH),
        };
        let scenes = studio.choice.scenes(&scenes).unwrap_or(scenes);
        let chosen = studio.choice.views.or(studio.wishes.recipe.views);
        let views = 0..chosen.unwrap_or_else(|| dataset.views_per_scene.min(OF_EACH));
        let cells = scenes.len() * views.len();
        if cells > MAX_CELLS {
            return Err(Error::new(format!("a sheet of {cells} images exceeds the limit of {MAX_CELLS}"))
                .help("show fewer scenes or views with `options.scenes` and `options.views`"));
        }
        let panels = if studio.wishes.labels { 3 } else { 1 };
        let expected = [studio.width * panels, studio.width * 3 / 4];
        if cells as u64 * expected.map(u64::from).iter().product::<u64>() > MAX_PIXELS {
            let message = format!("a sheet of {cells} images of {} pixels across is too large", expected[0]);
            return Err(Error::new(message).help(
                "lower `options.width`, or show fewer scenes or views with `options.scenes` and `options.views`",
            ));
        }
        let info = recipe.dataset_info();
        Ok(Self { scenes: scenes.collect(), views: views.collect(), expected, products, info })
    }

    fn len(&self) -> usize {
        self.scenes.len() * self.views.len()
    }

    /// Scene and view of every cell, row by row.
    fn all(&self) -> impl Iterator<Item = (u32, u32)> {
        self.scenes.iter().flat_map(|&scene| self.views.iter().map(move |&view| (scene, view)))
    }

    /// Index of a cell.
    fn index(&self, scene: u32, view: u32) -> usize {
        self.all().position(|place| place == (scene, view)).unwrap_or(0)
    }

    /// The views of each scene without a current image.
    fn missing(&self, sheet: &Sheet) -> Vec<(u32, Vec<u32>)> {
        let is_missing = |cell: &SheetCell| !cell.is_current();
        let rows = self.scenes.iter().zip(sheet.cells.chunks(self.views.len().max(1)));
        let views = |row: &[SheetCell]| {
            row.iter().zip(&self.views).filter(|(cell, _)| is_missing(cell)).map(|(_, &view)| view).collect()
        };
        rows.map(|(&scene, row)| (scene, views(row))).collect()
    }
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

/// A reporter that records warnings, for the page.
struct WarningRecorder<'a> {
    reporter: &'a dyn Reporter,
    wording: Wording,
    warnings: Mutex<Vec<String>>,
}

impl WarningRecorder<'_> {
    fn remember(&self, warning: &Message) {
        self.add(warning.render(false).trim_end());
    }

    /// Records a warning once: the passes of a large view open the same pools again.
    fn add(&self, warning: &str) {
        let text = (self.wording)(warning).into_owned();
        let mut warnings = self.warnings.lock();
        if !warnings.contains(&text) {
            warnings.push(text);
        }
    }
}

impl Reporter for WarningRecorder<'_> {
    fn event(&self, event: &Event) {
        if let Event::Message(record) = event
            && record.level == Level::Warning
        {
            self.add(&record.line());
        }
        self.reporter.event(event);
    }

    fn message(&self, message: &Message) {
        if matches!(message, Message::Warning(_)) {
            self.remember(message);
        }
        self.reporter.message(message);
    }
}
