//! The sheet in the browser: a page that follows the progress of rendering.

use super::sheet::{self, SheetCell};
use super::studio::{News, StudioOutput};
use crate::serve::{Changes, Request, Response, content_type};
use parking_lot::Mutex;
use serde::Serialize;
use syntable_model::error::{Error, Result};
use syntable_runtime::run::progress::count;
use tera::{Context, Tera};

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Content of the page.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct PreviewState {
    /// Number of the content's version.
    version: u64,
    title: String,
    status: String,
    /// Errors of the recipe, as `check` prints them; empty without errors.
    mistakes: String,
    warnings: String,
    /// Description of the image, as text.
    alt: String,
}

/// Content of the page, and the image.
#[derive(Default)]
pub struct PreviewPage {
    shown: Mutex<(PreviewState, Vec<u8>)>,
    /// Notifies browsers of changes.
    pub changes: Changes,
}

impl PreviewPage {
    /// Shows new content; `png` is the sheet.
    pub fn show(&self, news: &News, png: &[u8]) {
        let mut shown = self.shown.lock();
        // The lock makes browsers see the new version only together with the new content.
        let state = PreviewState { version: self.changes.version() + 1, ..state(news) };
        *shown = (state, png.to_vec());
        self.changes.publish();
    }

    /// Answers a browser.
    pub fn answer(&self, request: &Request) -> Response {
        match request.path.as_str() {
            "/" => match self.html() {
                Ok(text) => Response::html(text),
                Err(error) => Response::failed(500, format!("{error}\n")),
            },
            "/page.css" => Response::bytes(content_type("css"), STYLE),
            "/page.js" => Response::bytes(content_type("js"), SCRIPT),
            "/state.json" => serde_json::to_value(&self.shown.lock().0)
                .map_or_else(|error| Response::failed(500, format!("{error}\n")), |state| Response::json(&state)),
            "/sheet.png" => match &self.shown.lock().1 {
                png if png.is_empty() => Response::missing(),
                png => Response::bytes("image/png", png.clone()),
            },
            _ => Response::missing(),
        }
    }

    fn html(&self) -> Result<String> {
        let mut state = self.shown.lock().0.clone();
        if state.version == 0 {
            state = PreviewState { title: "preview".to_owned(), status: "loading the recipe".to_owned(), ..state };
        }
        let context = Context::from_serialize(&state).map_err(|error| Error::new(format!("the page: {error}")))?;
        Tera::one_off(PAGE, &context, true).map_err(|error| Error::new(format!("the page: {error}")))
    }
}

fn state(news: &News) -> PreviewState {
    let title = if news.name.is_empty() { "preview" } else { news.name }.to_owned();
    let warnings = news.warnings.join("\n");
    let state = PreviewState { title, warnings, ..PreviewState::default() };
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
            let alt = format!(
                "{} of {} each; rows are scenes, columns are views",
                count(sheet.scenes.len() as u32, "scene"),
                count(sheet.views.len() as u32, "view")
            );
            PreviewState { status, alt, ..state }
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

    #[test]
    fn mistakes_are_escaped_and_take_the_place_of_the_image() {
        let page = PreviewPage::default();
        let html = page.html().expect("a page");
        assert!(html.contains("loading the recipe") && html.contains("data-version=\"0\""), "{html}");
        let shown = StudioOutput::Mistakes("error[D0008]: unknown key `<b>&\"x\"</b>`".to_owned());
        page.show(&News { shown: &shown, name: "a<b", warnings: &[], is_busy: false }, b"png");
        let html = page.html().expect("a page");
        assert!(html.contains("unknown key `&lt;b&gt;&amp;&quot;x&quot;&lt;&#x2F;b&gt;`"), "{html}");
        assert!(html.contains("<title>a&lt;b</title>") && !html.contains("<b>"), "{html}");
        assert_eq!(page.changes.version(), 1);
    }

    #[test]
    fn the_status_counts_images() {
        let cells = vec![SheetCell::Waiting, SheetCell::Failed("no".to_owned())];
        let shown = StudioOutput::Sheet(Sheet { scenes: vec![0], views: vec![0, 1], cells, expected: [4, 3] });
        let of = |is_busy: bool| state(&News { shown: &shown, name: "", warnings: &[], is_busy }).status;
        assert_eq!([of(true), of(false)], ["rendering: 0 of 2 images", "0 of 2 images, 1 failed"]);
    }
}
