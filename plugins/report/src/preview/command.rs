//! The verb `preview`: its arguments, and who runs beside whom.

use super::load::Wishes;
use super::page::{Page, png_of};
use super::sheet;
use super::studio::{Ended, News, Shown, Studio};
use super::watch::Watch;
use crate::serve::Server;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;
use syntable_model::error::{Error, Result};
use syntable_model::registry::Registry;
use syntable_runtime::clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};
use syntable_runtime::cli::{Console, Exit, Message, RecipeArgs, Scenes, Verb, check_outputs, parse_scenes};
use syntable_runtime::durable::write_file;
use syntable_runtime::run::progress::count;
use syntable_runtime::run::stop::{self, Stop};
use syntable_runtime::workers;

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

/// What is appended to the recipe's name in the name of a sheet.
const ENDING: &str = "preview.png";
/// How often a recipe with mistakes is looked at anew: files and assets that it misses may come.
const AGAIN: Duration = Duration::from_secs(1);

fn command() -> Command {
    let flag = |name: &'static str, help: &'static str| Arg::new(name).long(name).action(ArgAction::SetTrue).help(help);
    let number = |name: &'static str| Arg::new(name).long(name).value_name("N");
    RecipeArgs::augment_args(Command::new("preview"))
        .about("Render a few views of a few scenes fast, on one contact sheet; again after every save")
        .arg(
            Arg::new("scenes")
                .long("scenes")
                .value_name("A..B")
                .value_parser(parse_scenes)
                .help("Scenes to show: `A..B` without B, `A..`, `..B`, or one number; the first two if left out"),
        )
        .arg(
            number("samples")
                .default_value("4")
                .value_parser(value_parser!(u32).range(1..=1_048_576))
                .help("Maximum number of samples per pixel; images are denoised"),
        )
        .arg(
            number("width")
                .default_value("320")
                .value_parser(value_parser!(u32).range(16..=4096))
                .help("Maximum width of an image, px: larger images are rendered with fewer pixels"),
        )
        .arg(flag("labels", "Show labels beside the images: visible masks, and amodal outlines with what is occluded"))
        .arg(Arg::new("out").long("out").value_name("FILE").value_parser(value_parser!(PathBuf)).help(
            "PNG file of the sheet; `<recipe>.preview.png` in the current folder if left out, and none with --serve",
        ))
        .arg(flag("watch", "Go on: render what changes whenever the recipe, or a file that it names, is saved"))
        .arg(flag("serve", "Show the sheet in the browser, for you alone, and follow every save"))
        .arg(
            number("port")
                .default_value("0")
                .value_parser(value_parser!(u16))
                .requires("serve")
                .help("Port of --serve; 0 for any free one"),
        )
        .arg(
            number("threads")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Worker threads; all cores if left out. The images do not depend on it"),
        )
        .arg(flag("allow-libraries", "Load native libraries that the recipe names by a path beside itself"))
        .after_help(
            "Examples:
  syntable preview recipe.toml                     recipe.preview.png
  syntable preview recipe.toml --watch --labels    the same with labels, again after every save
  syntable preview recipe.toml --serve             in the browser
  syntable preview recipe.toml --scenes 3..6 --views 4 --width 160",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let recipe =
        RecipeArgs::from_arg_matches(arguments).map_err(|error| Exit::wrong(Error::new(error.to_string().trim())))?;
    let number = |name: &str| arguments.get_one::<u32>(name).copied().unwrap_or(1);
    let serves = arguments.get_flag("serve");
    let out = arguments.get_one::<PathBuf>("out").cloned();
    let out = out.or_else(|| (!serves).then(|| default_out(recipe.recipe.as_deref())));
    check_outputs(&[("--out", out.as_ref())], recipe.recipe.as_deref().as_slice())?;
    if let Some(out) = &out
        && std::fs::read(out).is_ok_and(|there| !there.is_empty() && !sheet::is_png(&there))
    {
        let error = Error::new("--out would overwrite a file that is no sheet of a preview").in_file(out);
        return Err(Exit::wrong(error.help("name another file with --out, or remove this one")));
    }
    let wishes = Wishes {
        recipe,
        samples: number("samples"),
        labels: arguments.get_flag("labels"),
        allow_libraries: arguments.get_flag("allow-libraries"),
    };
    let scenes = arguments.get_one::<Scenes>("scenes").copied();
    let threads = arguments.get_one::<u16>("threads").map_or_else(workers::available, |&threads| usize::from(threads));
    let studio = Studio::new(console, registry, (wishes, scenes, number("width")), threads);
    let stop =
        Stop::on_signals().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))?;
    let mut preview = Preview { studio: studio.map_err(Exit::stopped)?, out, page: serves.then(Page::default), stop };
    if serves || arguments.get_flag("watch") {
        let port = arguments.get_one::<u16>("port").copied().unwrap_or_default();
        let server = serves.then(|| Server::bind(port)).transpose().map_err(Exit::stopped)?;
        return preview.watch(console, server.as_ref());
    }
    preview.once(console)
}

/// The sheet's file, if no other is asked for: named after the recipe, in the current folder.
fn default_out(recipe: Option<&Path>) -> PathBuf {
    let name = recipe.and_then(Path::file_stem).and_then(|stem| stem.to_str()).unwrap_or("quickstart");
    PathBuf::from(format!("{}.{ENDING}", name.rsplit(':').next().unwrap_or(name)))
}

/// A preview with the places where it is shown.
struct Preview<'a> {
    studio: Studio<'a>,
    out: Option<PathBuf>,
    page: Option<Page>,
    stop: Stop,
}

impl Preview<'_> {
    /// Makes one sheet.
    fn once(&mut self, console: &Console) -> Result<(), Exit> {
        let (out, stop) = (self.out.as_deref(), self.stop.clone());
        // Until all of its images are made, the sheet of before stays; so it does beside mistakes, which are printed.
        let mut show = |news: &News| match news.shown {
            Shown::Sheet(_) if !news.is_busy => store(out, &png_of(news.shown)?),
            Shown::Sheet(_) | Shown::Mistakes(_) => Ok(()),
        };
        match self.studio.pass(&Watch::default(), &stop, &mut show).map_err(Exit::stopped)? {
            Ended::Done { failed, is_lossy } => {
                console.print(&out.map_or_else(String::new, |out| format!("{}\n", out.display())))?;
                let failed = (failed > 0).then(|| format!("{} failed", count(failed, "scene")));
                let lossy = is_lossy.then(|| "stages left labels out: the warnings above name them".to_owned());
                let messages: Vec<Message> =
                    failed.into_iter().chain(lossy).map(|what| Message::Error(Error::new(what))).collect();
                if messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
            }
            Ended::Mistaken => Err(Exit { code: 2, messages: Vec::new() }),
            Ended::Stopped => {
                let signal = stop.requested().unwrap_or_default();
                let error = Error::new(format!("stopped by {}", stop::name_of(signal)));
                Err(Exit { code: 128_u8.saturating_add(signal), ..Exit::stopped(error) })
            }
        }
    }

    /// Makes sheets until a signal ends it, which is no failure.
    fn watch(&mut self, console: &Console, server: Option<&Server>) -> Result<(), Exit> {
        let places = server.map(Server::url).into_iter().chain(self.out.as_ref().map(|out| out.display().to_string()));
        console.print(&places.map(|place| format!("{place}\n")).collect::<String>())?;
        let Self { studio, out, page, stop } = self;
        let (watch, page, stop) = (Watch::default(), page.as_ref(), &*stop);
        let mut show = |news: &News| {
            let png = png_of(news.shown)?;
            store(out.as_deref(), &png)?;
            page.into_iter().for_each(|page| page.show(news, &png));
            Ok(())
        };
        thread::scope(|scope| {
            // However this ends, the other threads end, too.
            let _end = End(stop);
            scope.spawn(|| watch.run(stop));
            if let (Some(server), Some(page)) = (server, page) {
                scope.spawn(|| server.run(stop, &page.changes, &|request| page.answer(request)));
            }
            while stop.requested().is_none() {
                let work = watch.begin();
                let ended = studio.pass(&watch, &work, &mut show).map_err(Exit::stopped)?;
                watch.wait((ended == Ended::Mistaken).then_some(AGAIN), stop);
            }
            Ok(())
        })
    }
}

/// Asks for the end when it is dropped.
struct End<'a>(&'a Stop);

impl Drop for End<'_> {
    fn drop(&mut self) {
        if self.0.requested().is_none() {
            self.0.request(15);
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
    fn the_command_is_sound() {
        command().debug_assert();
    }

    #[test]
    fn the_sheet_is_named_after_the_recipe() {
        for (recipe, wanted) in [
            (None, "quickstart.preview.png"),
            (Some("builtin:window-room"), "window-room.preview.png"),
            (Some("../recipes/my.toml"), "my.preview.png"),
        ] {
            assert_eq!(default_out(recipe.map(Path::new)), Path::new(wanted));
        }
    }
}
