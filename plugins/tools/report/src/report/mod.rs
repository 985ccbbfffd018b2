//! Pages that show a dataset: its card, its statistics, its images with labels, its scenes in 3-D.
//!
//! A report is a function from paths to files ([`DatasetReport::file`]). `syntable report` writes all files into a
//! folder, `syntable view` serves the ones that a browser requests. Pages work without a server: instead of fetching
//! data, a page loads scripts that call `put` with a value, and only the few that it shows.
//!
//! | path | is |
//! | --- | --- |
//! | `index.html` | the overview: card, statistics, views to look at, failed scenes, times |
//! | `gallery.html`, `view.html`, `scene.html` | shells; the part after `#` in the address selects their content |
//! | `page/…` | style sheet and scripts |
//! | `data/rows/3.js` | the gallery's data of images 3 · 60 to 4 · 60 |
//! | `data/index/3.js` | the objects of images 3000 to 4000, by which the gallery selects and sorts |
//! | `data/view/000/000012.js` | an image's objects, masks and graph |
//! | `data/scene/000003.js` | a scene's glTF file |
//! | `image/000/000012.jpg`, `depth/000/000012.jpg` | color and depth of an image |

#[cfg(test)]
mod colors;
pub mod image;
pub mod make;
mod overview;
pub mod pixels;
mod plot;
pub mod record;
pub mod scored;

use crate::stats::DatasetStatistics;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{GalleryRow, ImageIndex, ImageView};
use parking_lot::Mutex;
use record::{DatasetRecord, Licenses};
use scored::ReportScores;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::OnceLock;
use syntable_formats::scores::ScoredImage;
use syntable_model::check::LabelCheck;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::product::standard::{DEPTH, RGB};
use syntable_model::reader::{OpenDataset, Source};
use syntable_model::registry::Registry;
use tera::{Context, Tera};

/// Images on a page of the gallery.
const PER_PAGE: usize = 60;
/// Files in a folder.
const PER_FOLDER: usize = 1000;

/// Permitted resources of pages, at any location: files next to them, and images that their scripts create. For a page
/// from a file, browsers do not treat other files as the same origin, so the policy names the scheme.
const POLICY: &str = "default-src 'none'; script-src 'self' file:; style-src 'self' file:; img-src 'self' file: data: blob:; \
                      base-uri 'none'; form-action 'none'";

/// Style sheet and scripts.
const ASSETS: [(&str, &str); 11] = [
    ("page/style.css", include_str!("page/style.css")),
    ("page/theme.js", include_str!("page/theme.js")),
    ("page/data.js", include_str!("page/data.js")),
    ("page/overlay.js", include_str!("page/overlay.js")),
    ("page/filter.js", include_str!("page/filter.js")),
    ("page/zoom.js", include_str!("page/zoom.js")),
    ("page/download.js", include_str!("page/download.js")),
    ("page/graph.js", include_str!("page/graph.js")),
    ("page/gallery.js", include_str!("page/gallery.js")),
    ("page/view.js", include_str!("page/view.js")),
    ("page/scene.js", include_str!("page/scene.js")),
];

/// Shared templates of pages.
const SHARED: [(&str, &str); 2] =
    [("base.html", include_str!("page/base.html")), ("parts.html", include_str!("page/parts.html"))];

/// Templates of pages.
const PAGES: [(&str, &str); 4] = [
    ("index.html", include_str!("page/index.html")),
    ("gallery.html", include_str!("page/gallery.html")),
    ("view.html", include_str!("page/view.html")),
    ("scene.html", include_str!("page/scene.html")),
];

/// The pages of a dataset.
pub struct DatasetReport {
    dataset: OpenDataset,
    /// Format of the dataset.
    format: &'static str,
    /// Path that the user named.
    path: String,
    /// Checks of every image.
    checks: Vec<Arc<dyn LabelCheck>>,
    record: DatasetRecord,
    /// Images on the pages, ascending.
    shown: Vec<usize>,
    /// Scenes with a model on the pages.
    scenes: Vec<u32>,
    /// Scenes with an unreadable model, with reasons.
    lost_scenes: Mutex<BTreeMap<u32, String>>,
    /// Licenses, collected from labels on first request, which takes a while.
    licenses: OnceLock<(Licenses, Vec<String>)>,
    /// Scores of predictions, if given.
    scored: Option<ReportScores>,
    /// Digest that distinguishes a written report from other reports at the same path.
    edition: OnceLock<String>,
    pages: Tera,
    /// Gallery rows of the images shown so far.
    rows: Vec<Mutex<Option<GalleryRow>>>,
    /// Names of objects and classes in these rows, which share them.
    texts: Mutex<BTreeSet<Arc<str>>>,
    /// Faults of the images checked so far, by index among the shown images.
    faults: Mutex<BTreeMap<usize, Vec<[String; 2]>>>,
    /// The statistics, once they are complete.
    statistics: Mutex<StatisticsProgress>,
}

/// Progress of the statistics.
pub enum StatisticsProgress {
    /// Counting; the text states the progress.
    Working(String),
    /// Failed; the text states the reason.
    Failed(String),
    /// Complete.
    Done(Box<DatasetStatistics>),
}

/// Content of the pages.
pub struct ReportSelection {
    /// Images, ascending.
    pub images: Vec<usize>,
    /// Maximum number of scenes in 3-D; `None` for all.
    pub scenes: Option<usize>,
}

impl DatasetReport {
    /// Opens a dataset. `choose` selects the images and scenes to show.
    pub fn open(
        registry: &Registry,
        source: &Source,
        format: Option<&str>,
        choose: impl FnOnce(&OpenDataset) -> ReportSelection,
    ) -> Result<Self> {
        let (format, dataset) = registry.open_dataset(source, format)?;
        Self::of(registry, dataset, format.name(), source, choose)
    }

    /// The pages of an open dataset. `source` is its location, with the permitted reach of its links.
    pub fn of(
        registry: &Registry,
        dataset: OpenDataset,
        format: &'static str,
        source: &Source,
        choose: impl FnOnce(&OpenDataset) -> ReportSelection,
    ) -> Result<Self> {
        let path = source.path.as_path();
        if dataset.images.is_empty() {
            return Err(Error::new("the dataset has no image").in_file(path));
        }
        let record = DatasetRecord::of(registry, source);
        let ReportSelection { images: shown, scenes: most } = choose(&dataset);
        let scenes: Vec<u32> = record.models.keys().copied().take(most.unwrap_or(usize::MAX)).collect();
        let mut pages = Tera::default();
        pages.add_raw_templates(SHARED.into_iter().chain(PAGES)).map_err(|error| wrong_page(&error))?;
        let rows = shown.iter().map(|_| Mutex::new(None)).collect();
        let statistics = Mutex::new(StatisticsProgress::Working("nothing is counted yet".to_owned()));
        let path = source.name().display().to_string();
        Ok(Self {
            dataset,
            format,
            path,
            checks: registry.checks().to_vec(),
            record,
            shown,
            scenes,
            lost_scenes: Mutex::default(),
            licenses: OnceLock::new(),
            scored: None,
            edition: OnceLock::new(),
            pages,
            rows,
            texts: Mutex::default(),
            faults: Mutex::default(),
            statistics,
        })
    }

    /// The path that the user named.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Adds predictions to the pages.
    pub fn with_scores(self, scored: ReportScores) -> Self {
        Self { scored: Some(scored), ..self }
    }

    /// Reads the licenses of assets from the labels of each scene's first image, and from glTF files. From then on, the
    /// overview lists them.
    pub fn gather_licenses(&self) {
        let mut first: BTreeSet<u32> = BTreeSet::new();
        let images = self.dataset.images.iter().enumerate();
        let firsts: Vec<usize> =
            images.filter(|(_, image)| first.insert(image.scene.0)).map(|(index, _)| index).collect();
        self.licenses.get_or_init(|| self.record.licenses(&self.dataset, firsts.into_iter()));
    }

    /// Sets the digest of the report's files.
    fn put_edition(&self, digest: &Digest) {
        let text = digest.to_string();
        self.edition.get_or_init(|| text.chars().filter(char::is_ascii_hexdigit).take(12).collect());
    }

    /// The dataset.
    pub fn dataset(&self) -> &OpenDataset {
        &self.dataset
    }

    /// Sets the statistics, or their progress.
    pub fn put_statistics(&self, counted: StatisticsProgress) {
        *self.statistics.lock() = counted;
    }

    /// Whether the statistics are complete or failed.
    pub fn is_counted(&self) -> bool {
        !matches!(&*self.statistics.lock(), StatisticsProgress::Working(_))
    }

    /// Number of images that are shown.
    pub fn images(&self) -> usize {
        self.shown.len()
    }

    /// Images with unreadable parts, in order, each with its reasons as a sentence. Includes only images that were
    /// requested.
    pub fn unread(&self) -> Vec<String> {
        self.unread_by_place()
            .into_iter()
            .map(|(place, reasons)| {
                let name = &self.dataset.images[self.shown[place]].name;
                format!("image \"{name}\": {}", reasons.join("; "))
            })
            .collect()
    }

    /// Reasons for unreadable parts of images, by index among the shown images.
    fn unread_by_place(&self) -> BTreeMap<usize, Vec<String>> {
        let mut unread: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        for (place, faults) in &*self.faults.lock() {
            for [_, reason] in faults.iter().filter(|[check, _]| check == image::READABLE) {
                unread.entry(*place).or_default().push(reason.clone());
            }
        }
        unread
    }

    /// Other unreadable data that the pages omit, as sentences: records of the run, licenses, scenes in 3-D, and files
    /// that hide images from the list of the dataset.
    pub fn lost(&self) -> Vec<String> {
        let hidden = self.dataset.faults.iter().filter(|fault| fault.is_lost);
        let hidden = hidden.map(ToString::to_string);
        let licenses = self.licenses.get().map(|(_, unread)| unread.clone()).unwrap_or_default();
        let scenes = self.lost_scenes.lock().values().cloned().collect::<Vec<_>>();
        hidden.chain(self.record.damaged.iter().cloned()).chain(licenses).chain(scenes).collect()
    }

    /// Scenes that the pages show in 3-D.
    pub fn scenes(&self) -> Vec<u32> {
        let lost = self.lost_scenes.lock();
        self.scenes.iter().copied().filter(|scene| !lost.contains_key(scene)).collect()
    }

    /// Omits a scene with an unreadable model.
    fn lose_scene(&self, scene: u32, why: &Error) {
        self.lost_scenes.lock().insert(scene, format!("scene {scene} in space: {why}"));
    }

    /// Paths of scenes in 3-D.
    fn scene_paths(&self) -> Vec<(u32, String)> {
        self.scenes.iter().map(|scene| (*scene, format!("data/scene/{scene:06}.js"))).collect()
    }

    /// The files of a single image, by its index among the shown images.
    pub fn files_of_image(&self, place: usize) -> Result<Vec<(String, Vec<u8>)>> {
        let (view, products) = self.read_whole(place)?;
        let mut files = vec![(view_path(place), self.put(&view_key(place), &self.whole_view(place, &view)))];
        files.extend(color(&products)?.map(|bytes| (image_path("image", place), bytes)));
        files.extend(depth(&products)?.map(|bytes| (image_path("depth", place), bytes)));
        Ok(files)
    }

    /// Reads an image with all inputs of the checks, and stores the faults.
    fn read_whole(&self, place: usize) -> Result<(ImageView, Products)> {
        let read = image::read(&self.dataset, &self.checks, self.shown[place], true)?;
        *self.rows[place].lock() = Some(read.0.row(&|text| self.shared(text)));
        self.faults.lock().insert(place, read.0.faults.clone());
        Ok(read)
    }

    /// Paths of all files except files of single images and scenes.
    pub fn other_paths(&self) -> Vec<String> {
        let pages = PAGES.iter().map(|(name, _)| (*name).to_owned());
        let assets = ASSETS.iter().map(|(path, _)| (*path).to_owned());
        let rows = (0..self.shown.len().div_ceil(PER_PAGE)).map(|page| format!("data/rows/{page}.js"));
        let index = (0..self.shown.len().div_ceil(PER_FOLDER)).map(|part| format!("data/index/{part}.js"));
        pages.chain(assets).chain(rows).chain(index).collect()
    }

    /// A file by its path; `None` if the report has no such file.
    pub fn file(&self, path: &str) -> Result<Option<Vec<u8>>> {
        if let Some((_, text)) = ASSETS.iter().find(|(name, _)| *name == path) {
            return Ok(Some(text.as_bytes().to_vec()));
        }
        if let Some((name, _)) = PAGES.iter().find(|(name, _)| *name == path) {
            return self.page(name).map(|text| Some(text.into_bytes()));
        }
        let number = |prefix: &str, suffix: &str| -> Option<usize> {
            let inside = path.strip_prefix(prefix)?.strip_suffix(suffix)?;
            inside.rsplit('/').next()?.parse().ok()
        };
        if let Some(page) = number("data/rows/", ".js").filter(|page| format!("data/rows/{page}.js") == path) {
            return self.rows_of(page);
        }
        if let Some(part) = number("data/index/", ".js").filter(|part| format!("data/index/{part}.js") == path) {
            return self.index_of(part);
        }
        if let Some(scene) = number("data/scene/", ".js").filter(|scene| format!("data/scene/{scene:06}.js") == path) {
            return self.scene(scene);
        }
        let is_shown = |place: &usize| *place < self.shown.len();
        if let Some(place) = number("data/view/", ".js").filter(|place| is_shown(place) && view_path(*place) == path) {
            let (view, _) = self.read_whole(place)?;
            return Ok(Some(self.put(&view_key(place), &self.whole_view(place, &view))));
        }
        for (folder, key) in [("image", RGB.id()), ("depth", DEPTH.id())] {
            let place = number(&format!("{folder}/"), ".jpg").filter(|place| is_shown(place));
            let has = |place: &usize| image_path(folder, *place) == path && self.dataset.offers.contains(&key);
            if let Some(place) = place.filter(has) {
                let products = self.dataset.read(self.shown[place], &[key])?.products;
                return if folder == "image" { color(&products) } else { depth(&products) };
            }
        }
        Ok(None)
    }

    /// The address of a file on a page.
    fn addressed(&self, path: String) -> String {
        self.edition.get().map_or_else(|| path.clone(), |edition| format!("{path}?{edition}"))
    }

    /// A script that hands a value to the page.
    fn put(&self, key: &str, value: &impl Serialize) -> Vec<u8> {
        let [key, value] = [serde_json::to_string(key), serde_json::to_string(value)].map(Result::unwrap_or_default);
        format!("syntable.put({key}, {value});\n").into_bytes()
    }

    fn whole_view<'a>(&'a self, place: usize, view: &'a ImageView) -> WholeView<'a> {
        let predicted = self.scored.as_ref().and_then(|scored| scored.image(self.shown[place]));
        WholeView { image: view, has_scene: self.scenes().contains(&view.scene), predicted }
    }

    /// The one copy of a text that the rows share.
    fn shared(&self, text: &str) -> Arc<str> {
        let mut texts = self.texts.lock();
        texts.get(text).cloned().unwrap_or_else(|| {
            let new: Arc<str> = text.into();
            texts.insert(Arc::clone(&new));
            new
        })
    }

    fn row(&self, place: usize) -> Result<GalleryRow> {
        let mut row = self.rows[place].lock();
        if let Some(row) = &*row {
            return Ok(row.clone());
        }
        let of = |whole: bool| image::read(&self.dataset, &self.checks, self.shown[place], whole);
        // With the checks, unreadable data is a fault of the image.
        let read = of(false).or_else(|_| of(true))?.0.row(&|text| self.shared(text));
        *row = Some(read.clone());
        Ok(read)
    }

    fn rows_of(&self, page: usize) -> Result<Option<Vec<u8>>> {
        let first = page.saturating_mul(PER_PAGE);
        if first >= self.shown.len() {
            return Ok(None);
        }
        let rows: Vec<GalleryRow> =
            (first..self.shown.len().min(first + PER_PAGE)).map(|place| self.row(place)).collect::<Result<_>>()?;
        Ok(Some(self.put(&format!("rows/{page}"), &rows)))
    }

    fn index_of(&self, part: usize) -> Result<Option<Vec<u8>>> {
        let first = part.saturating_mul(PER_FOLDER);
        if first >= self.shown.len() {
            return Ok(None);
        }
        let places = first..self.shown.len().min(first + PER_FOLDER);
        let rows: Vec<GalleryRow> = places.map(|place| self.row(place)).collect::<Result<_>>()?;
        Ok(Some(self.put(&format!("index/{part}"), &ImageIndex::of(&rows))))
    }

    fn scene(&self, scene: usize) -> Result<Option<Vec<u8>>> {
        let scene = u32::try_from(scene).ok().filter(|scene| self.scenes.contains(scene));
        let Some((scene, path)) = scene.and_then(|scene| Some((scene, self.record.models.get(&scene)?))) else {
            return Ok(None);
        };
        let bytes = self.record.read(path)?;
        let key = serde_json::Value::from(format!("scene/{scene:06}"));
        Ok(Some(format!("syntable.put({key}, \"{}\");\n", STANDARD.encode(bytes)).into_bytes()))
    }

    fn page(&self, name: &str) -> Result<String> {
        let mut context = Context::new();
        context.insert("name", &self.name());
        context.insert("page", name);
        context.insert("policy", POLICY);
        let facts = PageFacts {
            images: self.shown.len(),
            all_images: self.dataset.images.len(),
            per_page: PER_PAGE,
            per_folder: PER_FOLDER,
            has_image: self.dataset.offers.contains(&RGB.id()),
            has_depth: self.dataset.offers.contains(&DEPTH.id()),
            edition: self.edition.get().map(String::as_str).unwrap_or_default(),
        };
        context.insert("facts", &facts);
        context.insert("query", &self.addressed(String::new()));
        context.insert("has_scores", &self.scored.is_some());
        let classes: BTreeSet<&str> = self.dataset.info.categories().map(|(_, name)| name).collect();
        context.insert("classes", &classes);
        context.insert("scenes", &self.scenes());
        context.insert("models", &self.record.models.len());
        if name == "index.html" {
            context.insert("overview", &overview::of(self)?);
        }
        self.pages.render(name, &context).map_err(|error| wrong_page(&error))
    }

    /// Name of the dataset.
    fn name(&self) -> String {
        let named = Some(self.dataset.info.name.clone()).filter(|name| !name.is_empty());
        named.unwrap_or_else(|| Path::new(&self.path).file_name().unwrap_or_default().to_string_lossy().into_owned())
    }
}

/// Data for the scripts of all pages.
#[derive(Serialize)]
struct PageFacts<'a> {
    images: usize,
    all_images: usize,
    per_page: usize,
    per_folder: usize,
    has_image: bool,
    has_depth: bool,
    /// Text after `?` in the addresses of files; may be empty.
    edition: &'a str,
}

#[derive(Serialize)]
struct WholeView<'a> {
    #[serde(flatten)]
    image: &'a ImageView,
    has_scene: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    predicted: Option<&'a ScoredImage>,
}

fn wrong_page(error: &tera::Error) -> Error {
    let mut text = error.to_string();
    let mut source = std::error::Error::source(error);
    while let Some(inner) = source {
        text = format!("{text}: {inner}");
        source = inner.source();
    }
    Error::new(format!("a page cannot be made: {text}"))
}

fn color(products: &Products) -> Result<Option<Vec<u8>>> {
    products.optional(RGB)?.map(pixels::jpeg).transpose()
}

fn depth(products: &Products) -> Result<Option<Vec<u8>>> {
    products.optional(DEPTH)?.map(|depth| pixels::jpeg(&pixels::colored(depth))).transpose()
}

fn view_key(place: usize) -> String {
    format!("view/{:03}/{place:06}", place / PER_FOLDER)
}

fn view_path(place: usize) -> String {
    format!("data/{}.js", view_key(place))
}

fn image_path(folder: &str, place: usize) -> String {
    format!("{folder}/{:03}/{place:06}.jpg", place / PER_FOLDER)
}
