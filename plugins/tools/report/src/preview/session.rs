//! A preview with its file and its page, rendered once or after every save.

use super::load::{Wishes, Wording};
use super::page::{PreviewPage, png_of};
use super::sheet;
use super::studio::{News, PassEnd, PreviewStudio, StudioOutput};
use super::watch::Watch;
use crate::serve::Server;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;
use syntable_formats::draw::DrawColor;
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;
use syntable_model::registry::Registry;
use syntable_recipe::RecipeRequest;
use syntable_runtime::durable::write_file;
use syntable_runtime::run::SceneRange;
use syntable_runtime::run::progress::Reporter;
use syntable_runtime::run::stop::Stop;

/// Suffix of a sheet's file name, after the recipe's name.
const ENDING: &str = "preview.png";
/// Interval at which a recipe with errors is loaded again, because missing files and assets may appear.
const AGAIN: Duration = Duration::from_secs(1);

/// Content of a preview, and options of rendering.
#[derive(Debug, Clone)]
pub struct PreviewOptions {
    /// The recipe, and changes to it.
    pub recipe: RecipeRequest,
    /// Scenes to show; `None` shows the first two.
    pub scenes: Option<SceneRange>,
    /// Maximum number of samples per pixel. Images are denoised.
    pub samples: u32,
    /// Maximum width of an image, px: larger images are rendered with fewer pixels.
    pub width: u32,
    /// Whether visible masks and amodal outlines are shown next to the images.
    pub labels: bool,
    /// Whether to run code that the recipe brings: native libraries and programs.
    pub allow_code: bool,
    /// Wording of messages on the sheet and the page. A command line prints flags for options.
    pub wording: Wording,
    /// PNG file of the sheet; `None` writes no file.
    pub out: Option<PathBuf>,
    /// Port of the page, 0 for any free port; `None` serves no page.
    pub serve: Option<u16>,
    /// Threads.
    pub threads: usize,
}

impl PreviewOptions {
    /// Two scenes of a recipe at 4 samples and 320 pixels across, in a file named after the recipe in the current
    /// folder.
    pub fn new(recipe: RecipeRequest) -> Self {
        let out = Some(Self::default_out(recipe.recipe.as_deref()));
        let (scenes, serve, threads) = (None, None, syntable_runtime::workers::available());
        let wording: Wording = |text| Cow::Borrowed(text);
        let (labels, allow_code) = (false, false);
        Self { recipe, scenes, samples: 4, width: 320, labels, allow_code, wording, out, serve, threads }
    }

    /// Default file of a recipe's sheet: named after the recipe, in the current folder.
    pub fn default_out(recipe: Option<&Path>) -> PathBuf {
        let name = recipe.and_then(Path::file_stem).and_then(|stem| stem.to_str()).unwrap_or("quickstart");
        PathBuf::from(format!("{}.{ENDING}", name.rsplit(':').next().unwrap_or(name)))
    }
}

/// A preview of a recipe, with a cache for its next sheets.
pub struct Preview<'a> {
    studio: PreviewStudio<'a>,
    out: Option<PathBuf>,
    page: Option<(Server, PreviewPage)>,
}

impl<'a> Preview<'a> {
    /// Nothing is rendered yet. Warnings and mistakes of the recipe go to the reporter.
    ///
    /// # Errors
    /// If the file of the sheet exists and is not a sheet, or threads or the port are unavailable.
    pub fn new(registry: &'a Registry, options: PreviewOptions, reporter: &'a dyn Reporter) -> Result<Self> {
        let PreviewOptions { recipe, scenes, samples, width, labels, allow_code, wording, out, serve, threads } =
            options;
        if let Some(out) = &out
            && std::fs::read(out).is_ok_and(|there| !there.is_empty() && !sheet::is_png(&there))
        {
            let error = Error::new("the output file exists and is not a preview sheet").in_file(out);
            return Err(error.help("choose another file with `options.out`, or remove this one").of_request());
        }
        let wishes = Wishes { recipe, samples, labels, page: serve.is_some(), allow_code, wording };
        let studio = PreviewStudio::new(reporter, registry, (wishes, scenes, width), threads)?;
        let page = serve.map(Server::bind).transpose()?.map(|server| (server, PreviewPage::default()));
        Ok(Self { studio, out, page })
    }

    /// Locations of the sheet: the address of the page, and the file.
    pub fn places(&self) -> Vec<String> {
        let page = self.page.as_ref().map(|(server, _)| server.url());
        page.into_iter().chain(self.out.as_ref().map(|out| out.display().to_string())).collect()
    }

    /// Renders one sheet, and replaces the file when the sheet is complete. A recipe with errors leaves the file
    /// unchanged.
    ///
    /// # Errors
    /// If the sheet cannot be drawn or written.
    pub fn once(&mut self, stop: &Stop) -> Result<PassEnd> {
        // The previous sheet stays until all images are finished.
        let (end, sheet) = self.sheet(stop)?;
        sheet.map_or(Ok(()), |sheet| store(self.out.as_deref(), &sheet::png(&sheet)?))?;
        Ok(end)
    }

    /// Renders one sheet in memory. `None` if the recipe has mistakes, or the work was stopped.
    ///
    /// # Errors
    /// If the sheet cannot be drawn.
    pub fn sheet(&mut self, stop: &Stop) -> Result<(PassEnd, Option<Plane<DrawColor>>)> {
        let mut drawn = None;
        let mut show = |news: &News| {
            if let StudioOutput::Sheet(sheet) = news.shown
                && !news.is_busy
            {
                drawn = Some(sheet.draw());
            }
            Ok(())
        };
        let end = self.studio.pass(&Watch::default(), stop, &mut show)?;
        Ok((end, drawn))
    }

    /// Renders a sheet after every save of the recipe or of a file that it names, until the caller stops it.
    ///
    /// # Errors
    /// If a sheet cannot be drawn or written.
    pub fn watch(&mut self, stop: &Stop) -> Result<()> {
        let Self { studio, out, page } = self;
        let (watch, page) = (Watch::default(), page.as_ref());
        let mut show = |news: &News| {
            let png = png_of(news.shown)?;
            store(out.as_deref(), &png)?;
            page.into_iter().for_each(|(_, page)| page.show(news, &png));
            Ok(())
        };
        thread::scope(|scope| {
            // Stops the other threads, however this function ends.
            let _end = End(stop);
            scope.spawn(|| watch.run(stop));
            if let Some((server, page)) = page {
                scope.spawn(|| server.run(stop, &page.changes, &|request| page.answer(request, &watch)));
            }
            while !stop.is_requested() {
                let work = watch.begin();
                page.into_iter().for_each(|(_, page)| studio.choose(page.choice()));
                let ended = studio.pass(&watch, &work, &mut show)?;
                watch.wait((ended == PassEnd::Mistaken).then_some(AGAIN), stop);
            }
            Ok(())
        })
    }
}

/// Requests the end of the work when dropped.
struct End<'a>(&'a Stop);

impl Drop for End<'_> {
    fn drop(&mut self) {
        if !self.0.is_requested() {
            self.0.cancel();
        }
    }
}

/// Writes the sheet.
fn store(out: Option<&Path>, bytes: &[u8]) -> Result<()> {
    out.map_or(Ok(()), |out| write_file(out, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_is_named_after_the_recipe() {
        for (recipe, wanted) in [
            (None, "quickstart.preview.png"),
            (Some("builtin:window-room"), "window-room.preview.png"),
            (Some("../recipes/my.toml"), "my.preview.png"),
        ] {
            assert_eq!(PreviewOptions::default_out(recipe.map(Path::new)), Path::new(wanted));
        }
    }
}
