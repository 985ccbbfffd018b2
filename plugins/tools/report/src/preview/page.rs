//! The sheet in the browser: a page that follows the progress of rendering.

use super::choice::Choice;
use super::sheet::{self, SheetCell};
use super::shot::{Shot, ShotDetails};
use super::studio::{News, StudioOutput};
use super::watch::Watch;
use crate::serve::{Changes, Request, Response, content_type};
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_runtime::run::progress::count;
use tera::{Context, Tera};

const PAGE: &str = include_str!("page.html");
/// Style sheets and scripts, some of them from reports.
const ASSETS: [(&str, &str); 7] = [
    ("/style.css", include_str!("../report/page/style.css")),
    ("/theme.js", include_str!("../report/page/theme.js")),
    ("/data.js", include_str!("../report/page/data.js")),
    ("/overlay.js", include_str!("../report/page/overlay.js")),
    ("/zoom.js", include_str!("../report/page/zoom.js")),
    ("/page.css", include_str!("page.css")),
    ("/page.js", include_str!("page.js")),
];

/// Content of the page.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct PreviewState {
    /// Number of the content's version.
    version: u64,
    title: String,
    status: String,
    /// Errors of the recipe, as `check` prints them; empty without errors.
    mistakes: String,
    warnings: Vec<String>,
    is_busy: bool,
    /// Seed of the recipe, as text: scripts round numbers of 64 bits.
    seed: String,
    /// Numbers of scenes and of views per scene in the recipe.
    size: [u32; 2],
    /// Numbers of the shown scenes and views.
    scenes: Vec<u32>,
    views: Vec<u32>,
    /// The views, row by row. With errors, the last ones.
    cells: Vec<CellState>,
    /// The view that is open, at final quality.
    large: Option<CellState>,
    choice: Choice,
}

/// A view on the page.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct CellState {
    scene: u32,
    view: u32,
    /// `waiting`, `before` (rendered before the last change), `current` or `failed`.
    state: &'static str,
    /// Reason of a failure.
    reason: String,
    /// The image and its numbers.
    shot: Option<ShotState>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ShotState {
    key: String,
    size: [u32; 2],
    /// Names of its images.
    images: Vec<&'static str>,
    /// Kinds of labels that its objects have.
    has_masks: bool,
    has_boxes: bool,
    has_order: bool,
    /// Objects with a visible pixel; `None` without masks.
    objects: Option<usize>,
    /// Mean and maximum occlusion rate of its objects.
    rates: Option<[f64; 2]>,
    /// Time that rendering took, s.
    seconds: f64,
}

impl CellState {
    fn of([scene, view]: [u32; 2], cell: &SheetCell) -> Self {
        let (state, reason, image) = match cell {
            SheetCell::Waiting => ("waiting", "", None),
            SheetCell::Image { image, is_current: true } => ("current", "", Some(image)),
            SheetCell::Image { image, is_current: false } => ("before", "", Some(image)),
            SheetCell::Failed(reason) => ("failed", reason.as_str(), None),
        };
        let shot = image.and_then(|image| image.details.as_ref()).map(ShotState::of);
        Self { scene, view, state, reason: reason.to_owned(), shot }
    }
}

impl ShotState {
    fn of(details: &ShotDetails) -> Self {
        let objects = &details.labels.objects;
        let rates: Vec<f64> = objects.iter().filter_map(|object| object.rate).collect();
        let has_masks = objects.iter().any(|object| object.visible.is_some());
        Self {
            key: details.key.clone(),
            size: details.labels.size,
            images: details.images(),
            has_masks,
            has_boxes: objects.iter().any(|object| object.visible_box.is_some()),
            has_order: details.labels.graph.is_some(),
            objects: has_masks.then(|| objects.iter().filter(|object| !object.is_hidden).count()),
            rates: (!rates.is_empty())
                .then(|| [rates.iter().sum::<f64>() / rates.len() as f64, rates.iter().copied().fold(0.0, f64::max)]),
            seconds: details.seconds,
        }
    }
}

/// Content of the page, and the images in it.
#[derive(Default)]
struct Shown {
    state: PreviewState,
    sheet: Vec<u8>,
    shots: BTreeMap<String, Arc<Shot>>,
}

/// The page, and the choice of its user.
#[derive(Default)]
pub struct PreviewPage {
    shown: Mutex<Shown>,
    choice: Mutex<Choice>,
    /// Notifies browsers of changes.
    pub changes: Changes,
}

impl PreviewPage {
    /// Shows new content; `png` is the sheet. With errors of the recipe, the last images stay.
    pub fn show(&self, news: &News, png: &[u8]) {
        let mut shown = self.shown.lock();
        // The lock makes browsers see the new version only together with the new content.
        let version = self.changes.version() + 1;
        shown.state = match news.shown {
            StudioOutput::Sheet(_) => PreviewState { version, ..state(news) },
            StudioOutput::Mistakes(_) => {
                let before = &shown.state;
                let (scenes, views, cells) = (before.scenes.clone(), before.views.clone(), before.cells.clone());
                PreviewState { version, scenes, views, cells, large: before.large.clone(), ..state(news) }
            }
        };
        if let StudioOutput::Sheet(sheet) = news.shown {
            let cells = sheet.cells.iter().chain(news.large.map(|large| &large.cell));
            let images = cells.filter_map(|cell| match cell {
                SheetCell::Image { image, .. } => Some((image.details.as_ref()?.key.clone(), Arc::clone(image))),
                _ => None,
            });
            shown.shots = images.collect();
        }
        shown.sheet = png.to_vec();
        self.changes.publish();
    }

    /// The choice of the user.
    pub fn choice(&self) -> Choice {
        self.choice.lock().clone()
    }

    /// Answers a browser. A new choice ends the work on the old one.
    pub fn answer(&self, request: &Request, watch: &Watch) -> Response {
        if let Some((_, text)) = ASSETS.iter().find(|(path, _)| *path == request.path) {
            return Response::bytes(content_type(request.path.rsplit('.').next().unwrap_or_default()), *text);
        }
        match request.path.as_str() {
            "/" => match self.html() {
                Ok(text) => Response::html(text),
                Err(error) => Response::failed(500, format!("{error}\n")),
            },
            "/state.json" => json(&PreviewState { choice: self.choice(), ..self.shown.lock().state.clone() }),
            "/choose" => {
                let choice = Choice::of(request);
                let before = std::mem::replace(&mut *self.choice.lock(), choice.clone());
                if before != choice {
                    watch.interrupt();
                }
                json(&choice)
            }
            "/sheet.png" => match &self.shown.lock().sheet {
                png if png.is_empty() => Response::missing(),
                png => Response::bytes("image/png", png.clone()),
            },
            path => self.shot(path).unwrap_or_else(Response::missing),
        }
    }

    /// An image or the labels of a view: `/shot/1f…/color.png`, `/shot/1f…/labels.json`.
    fn shot(&self, path: &str) -> Option<Response> {
        let (key, file) = path.strip_prefix("/shot/")?.split_once('/')?;
        // Encoding takes a while, which must not block other requests.
        let shot = Arc::clone(self.shown.lock().shots.get(key)?);
        let details = shot.details.as_ref()?;
        if file == "labels.json" {
            return Some(json(&details.labels));
        }
        Some(match details.png(file.strip_suffix(".png")?)? {
            Ok(png) => Response::bytes("image/png", png),
            Err(error) => Response::failed(500, format!("{error}\n")),
        })
    }

    fn html(&self) -> Result<String> {
        let mut state = self.shown.lock().state.clone();
        if state.version == 0 {
            state = PreviewState { title: "preview".to_owned(), status: "loading the recipe".to_owned(), ..state };
        }
        let context = Context::from_serialize(&state).map_err(|error| Error::new(format!("the page: {error}")))?;
        let mut pages = Tera::default();
        let templates = [("parts.html", include_str!("../report/page/parts.html")), ("page.html", PAGE)];
        let page = pages.add_raw_templates(templates).and_then(|()| pages.render("page.html", &context));
        page.map_err(|error| Error::new(format!("the page: {error}")))
    }
}

fn json(value: &impl Serialize) -> Response {
    serde_json::to_value(value)
        .map_or_else(|error| Response::failed(500, format!("{error}\n")), |value| Response::json(&value))
}

fn state(news: &News) -> PreviewState {
    let title = if news.name.is_empty() { "preview" } else { news.name }.to_owned();
    let (warnings, seed) = (news.warnings.to_vec(), news.seed.to_string());
    let state =
        PreviewState { title, warnings, is_busy: news.is_busy, seed, size: news.size, ..PreviewState::default() };
    match news.shown {
        StudioOutput::Mistakes(text) => PreviewState {
            mistakes: text.clone(),
            status: "the recipe has errors: fix and save it".to_owned(),
            ..state
        },
        StudioOutput::Sheet(sheet) => {
            let of = |wanted: fn(&SheetCell) -> bool| sheet.cells.iter().filter(|cell| wanted(cell)).count() as u32;
            let made = of(|cell| matches!(cell, SheetCell::Image { is_current: true, .. }));
            let failed = of(|cell| matches!(cell, SheetCell::Failed(_)));
            let all = count(sheet.cells.len() as u32, "image");
            let status = match (news.is_busy, failed) {
                (true, _) => format!("rendering: {made} of {all}"),
                (false, 0) => all,
                (false, _) => format!("{made} of {all}, {failed} failed"),
            };
            let places = sheet.scenes.iter().flat_map(|&scene| sheet.views.iter().map(move |&view| [scene, view]));
            PreviewState {
                status,
                scenes: sheet.scenes.clone(),
                views: sheet.views.clone(),
                cells: places.zip(&sheet.cells).map(|(place, cell)| CellState::of(place, cell)).collect(),
                large: news.large.map(|large| CellState::of(large.place, &large.cell)),
                ..state
            }
        }
    }
}

/// The current sheet as PNG.
pub fn png_of(shown: &StudioOutput) -> Result<Vec<u8>> {
    match shown {
        StudioOutput::Sheet(sheet) => sheet::png(&sheet.draw()),
        StudioOutput::Mistakes(text) => sheet::png(&sheet::mistakes(text)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::sheet::Sheet;

    fn news(shown: &StudioOutput, is_busy: bool) -> News<'_> {
        News { shown, name: "a<b", warnings: &[], is_busy, seed: 7, size: [2, 2], large: None }
    }

    fn sheet(cells: Vec<SheetCell>) -> StudioOutput {
        let views = (0..cells.len() as u32).collect();
        StudioOutput::Sheet(Sheet { scenes: vec![0], views, cells, expected: [4, 3], labels: false })
    }

    #[test]
    fn mistakes_are_escaped_and_leave_the_images() {
        let page = PreviewPage::default();
        let html = page.html().expect("a page");
        assert!(html.contains("loading the recipe") && html.contains("data-version=\"0\""), "{html}");
        page.show(&news(&sheet(vec![SheetCell::Waiting, SheetCell::Failed("no".to_owned())]), false), b"png");
        let before = page.shown.lock().state.cells.clone();
        assert_eq!(before.iter().map(|cell| cell.state).collect::<Vec<_>>(), ["waiting", "failed"]);
        let shown = StudioOutput::Mistakes("error[D0008]: unknown key `<b>&\"x\"</b>`".to_owned());
        page.show(&news(&shown, false), b"png");
        let html = page.html().expect("a page");
        assert!(html.contains("unknown key `&lt;b&gt;&amp;&quot;x&quot;&lt;&#x2F;b&gt;`"), "{html}");
        assert!(html.contains("<title>a&lt;b</title>") && !html.contains("<b>"), "{html}");
        assert_eq!((page.changes.version(), page.shown.lock().state.cells.clone()), (2, before));
    }

    #[test]
    fn the_status_counts_images() {
        let shown = sheet(vec![SheetCell::Waiting, SheetCell::Failed("no".to_owned())]);
        let of = |is_busy: bool| state(&news(&shown, is_busy)).status;
        assert_eq!([of(true), of(false)], ["rendering: 0 of 2 images", "0 of 2 images, 1 failed"]);
    }

    #[test]
    fn a_new_choice_ends_the_work_on_the_old_one() {
        let (page, watch) = (PreviewPage::default(), Watch::default());
        let ask = |query: &[(&str, &str)]| {
            let query = query.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
            page.answer(&Request { path: "/choose".to_owned(), query }, &watch).status()
        };
        let work = watch.begin();
        assert_eq!((ask(&[]), work.is_requested()), (200, false));
        assert_eq!((ask(&[("seed", "9"), ("large", "0.1")]), work.is_requested()), (200, true));
        assert_eq!((page.choice().seed, page.choice().large), (Some(9), Some([0, 1])));
        let work = watch.begin();
        assert_eq!((ask(&[("seed", "9"), ("large", "0.1")]), work.is_requested()), (200, false));
    }
}
