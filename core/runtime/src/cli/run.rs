//! `syntable run` and `syntable plan`.

use super::{Console, Exit, LeftOutReport, Message, RecipeArgs};
use crate::cache::DiskCache;
use crate::memory;
use crate::recipe::Recipe;
use crate::run::progress::count;
use crate::run::stop::Stop;
use crate::run::{Outcome, RunOptions, run as run_recipe};
use crate::workers;
use clap::Args;
use std::ops::Range;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_model::some::SHOWN;

#[derive(Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Folder of the dataset; `data/<dataset.name>` if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Make only these scenes: `A..B` without B, `A..`, `..B`, or one number.
    #[arg(long, value_name = "A..B", value_parser = parse_scenes)]
    scenes: Option<Scenes>,
    /// Worker threads; all cores if left out. The dataset does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Delete the dataset that is in the folder, and start anew.
    #[arg(long)]
    overwrite: bool,
    /// Load native libraries that the recipe names by a path beside itself.
    #[arg(long)]
    allow_libraries: bool,
    /// Try scenes again that failed in an earlier run.
    #[arg(long)]
    retry_failed: bool,
    /// Compare all files with the journal first, and make scenes again whose files are missing or damaged.
    #[arg(long, conflicts_with = "overwrite")]
    repair: bool,
    /// Write the files of writers anew that have other options than then, or annotators with other options, and take away
    /// those of writers that the recipe has no more.
    #[arg(long, conflicts_with = "overwrite")]
    rewrite: bool,
}

/// Scenes asked for; open ends are closed by the recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scenes(Option<u32>, Option<u32>);

/// Reads scenes from an argument: `A..B` without B, `A..`, `..B`, or one number.
pub fn parse_scenes(text: &str) -> Result<Scenes, String> {
    let number = |text: &str| text.parse::<u32>().map_err(|_| format!("`{text}` is not a scene number"));
    let optional = |text: &str| if text.is_empty() { Ok(None) } else { number(text).map(Some) };
    let scenes = match text.split_once("..") {
        Some((low, high)) => Scenes(optional(low)?, optional(high)?),
        None => Scenes(Some(number(text)?), Some(number(text)?.saturating_add(1))),
    };
    match scenes {
        Scenes(Some(low), Some(high)) if low >= high => Err(format!("`{text}` is empty; write the smaller first")),
        scenes => Ok(scenes),
    }
}

impl Scenes {
    /// The scenes of a recipe that has so many.
    pub fn within(self, count: u32) -> Result<Range<u32>, Error> {
        let (low, high) = (self.0.unwrap_or(0), self.1.unwrap_or(count));
        if low < high && high <= count {
            Ok(low..high)
        } else {
            Err(Error::new(format!("--scenes {low}..{high}: the recipe has scenes 0..{count}")))
        }
    }
}

pub(super) fn run(console: &Console, registry: &Registry, args: &RunArgs) -> Result<(), Exit> {
    let recipe = console.load_for_run(registry, &args.recipe)?;
    recipe.trusted(args.allow_libraries).map_err(Exit::wrong)?;
    recipe.ready().map_err(Exit::wrong)?;
    let scenes = args.scenes.map(|scenes| scenes.within(recipe.dataset.scenes)).transpose().map_err(Exit::wrong)?;
    let stop = on_signals()?;
    let options = RunOptions {
        scenes,
        overwrite: args.overwrite,
        retry_failed: args.retry_failed,
        repair: args.repair,
        rewrite: args.rewrite,
        stop: stop.clone(),
        ..RunOptions::new(
            args.out.clone().unwrap_or_else(|| PathBuf::from("data").join(&recipe.dataset.name)),
            args.threads.map_or_else(workers::available, usize::from),
            DiskCache::of_user(),
        )
    };
    let outcome = run_recipe(&recipe, &options, console.reporter()).map_err(|error| ended(&stop, error))?;
    end_of(&outcome, &options.out)
}

/// Ends a verb that made a dataset: with exit code 3 and the reasons, if the dataset lacks something.
pub(super) fn end_of(outcome: &Outcome, out: &Path) -> Result<(), Exit> {
    let failed = (outcome.failed > 0).then(|| {
        Error::new(format!("{} failed", count(outcome.failed, "scene")))
            .in_file(out.join(".syntable/journal.jsonl"))
            .help("the journal says why; --retry-failed tries them again")
    });
    let lacking = (outcome.lacking > 0).then(|| {
        Error::new(format!(
            "{} could not be made with what the recipe adds, or again, and stay as they were",
            count(outcome.lacking, "scene")
        ))
        .in_file(out)
        .help("the warnings above say why; the same command tries them again")
    });
    let mut left_out = LeftOutReport::default();
    if !outcome.bad_assets.is_empty() {
        let bad =
            outcome.bad_assets.iter().take(SHOWN).map(|asset| Error::new(format!("asset {asset} cannot be used")));
        left_out.add(format!("{} passed over", count(outcome.bad_assets.len() as u32, "bad asset")), bad);
    }
    left_out.losses(&outcome.left_out);
    let mut messages: Vec<Message> = [failed, lacking].into_iter().flatten().map(Message::Error).collect();
    messages.extend(
        left_out.messages(out, "the warnings above name it; of bad assets, `syntable check --assets` says what is wrong, and `exclude` leaves them out"),
    );
    if messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
}

/// Lets signals stop what a verb does.
pub(super) fn on_signals() -> Result<Stop, Exit> {
    Stop::on_signals().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))
}

/// The exit of a verb that ended early: by a signal, by a mistake of the user, or by what the same command may overcome.
pub(super) fn ended(stop: &Stop, error: Error) -> Exit {
    match stop.requested() {
        Some(signal) => Exit { code: 128_u8.saturating_add(signal), ..Exit::stopped(error) },
        None => Exit::stopped(error),
    }
}

pub(super) fn plan(console: &Console, registry: &Registry, args: &RecipeArgs) -> Result<(), Exit> {
    let recipe = console.load(registry, args)?;
    let dataset = &recipe.dataset;
    let images = u64::from(dataset.scenes) * u64::from(dataset.views_per_scene);
    console.print(&format!(
        "{}: {} × {} = {images} images\n\n{}{}",
        dataset.name,
        count(dataset.scenes, "scene"),
        count(dataset.views_per_scene, "view"),
        recipe.plan.table(&*recipe.render),
        disk(&recipe, images)
    ))
}

/// The largest size of the images that are written, which is known before anything is rendered: that of their numbers.
fn disk(recipe: &Recipe, images: u64) -> String {
    let Some([width, height]) = memory::resolution(recipe) else { return String::new() };
    let pixels = u64::from(width) * u64::from(height);
    let bytes: u64 = (recipe.plan.entries.iter())
        .map(|entry| {
            let writers = entry.wanted_by.iter().filter(|stage| stage.starts_with("write.")).count() as u64;
            writers * pixels * memory::bytes_per_pixel(&entry.key)
        })
        .sum();
    let size = |bytes: u64| match bytes as f64 / f64::from(1 << 20) {
        mebibytes if mebibytes < 1024.0 => format!("{mebibytes:.1} MiB"),
        mebibytes => format!("{:.1} GiB", mebibytes / 1024.0),
    };
    format!(
        "disk: images take at most {} per view, {} in all, and less where files are compressed; masks and records, which follow \
         the number of objects, come on top\ntime: unknown before a scene is made: run one (--scenes 0) and multiply\n",
        size(bytes),
        size(bytes * images)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_scenes() {
        assert_eq!(parse_scenes("2..5"), Ok(Scenes(Some(2), Some(5))));
        assert_eq!(parse_scenes("..5"), Ok(Scenes(None, Some(5))));
        assert_eq!(parse_scenes("7"), Ok(Scenes(Some(7), Some(8))));
        assert!(parse_scenes("5..5").is_err() && parse_scenes("a").is_err() && parse_scenes("-1..2").is_err());
        assert!(Scenes(Some(1), None).within(3).is_ok_and(|range| range == (1..3)));
        assert!(Scenes(Some(3), None).within(3).is_err() && Scenes(None, Some(4)).within(3).is_err());
    }
}
