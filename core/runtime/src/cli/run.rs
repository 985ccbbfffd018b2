//! `syntable run` and `syntable plan`.

use super::{Console, Exit, LogFormat, RecipeArgs};
use crate::cache::DiskCache;
use crate::plan::Plan;
use crate::recipe::Recipe;
use crate::run::progress::{Human, JsonLines, Reporter};
use crate::run::{RunOptions, run as run_recipe};
use crate::workers;
use clap::Args;
use std::io::IsTerminal;
use std::ops::Range;
use std::path::PathBuf;
use syntable_model::registry::Registry;

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
    /// Try scenes again that failed in an earlier run.
    #[arg(long)]
    retry_failed: bool,
}

/// Scenes asked for; open ends are closed by the recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Scenes(Option<u32>, Option<u32>);

fn parse_scenes(text: &str) -> Result<Scenes, String> {
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
    fn within(self, count: u32) -> Result<Range<u32>, Exit> {
        let (low, high) = (self.0.unwrap_or(0), self.1.unwrap_or(count));
        if low < high && high <= count {
            Ok(low..high)
        } else {
            Err(Exit::wrong(format!("--scenes {low}..{high}: the recipe has scenes 0..{count}")))
        }
    }
}

pub(super) fn planned(console: &Console, registry: &Registry, recipe: &mut Recipe) -> Result<Plan, Exit> {
    let plan =
        Plan::new(registry, recipe).map_err(|errors| Exit(2, errors.iter().map(ToString::to_string).collect()))?;
    for note in &plan.notes {
        console.warn(note);
    }
    Ok(plan)
}

/// Asks the stages of a plan whether what they need from outside the program is there.
pub(super) fn ready(recipe: &Recipe, plan: &Plan) -> Result<(), Exit> {
    match &recipe.denoise {
        Some(denoiser) if plan.denoised => denoiser.ready().map_err(|error| Exit::wrong(error.context("denoise"))),
        _ => Ok(()),
    }
}

pub(super) fn run(console: &Console, registry: &Registry, args: &RunArgs) -> Result<(), Exit> {
    let mut recipe = console.load(registry, &args.recipe)?;
    let plan = planned(console, registry, &mut recipe)?;
    ready(&recipe, &plan)?;
    let scenes = args.scenes.map(|scenes| scenes.within(recipe.dataset.scenes)).transpose()?;
    let options = RunOptions {
        out: args.out.clone().unwrap_or_else(|| PathBuf::from("data").join(&recipe.dataset.name)),
        scenes,
        threads: args.threads.map_or_else(workers::available, usize::from),
        overwrite: args.overwrite,
        retry_failed: args.retry_failed,
        cache: DiskCache::of_user(),
    };
    let reporter: Box<dyn Reporter> = match console.format {
        LogFormat::Json => Box::<JsonLines>::default(),
        LogFormat::Human => Box::new(Human::new(std::io::stderr().is_terminal())),
    };
    match run_recipe(&recipe, &plan, &options, &*reporter) {
        Err(error) => Err(Exit::stopped(&error)),
        Ok(outcome) if outcome.failed > 0 => Err(Exit(
            3,
            vec![format!(
                "{} scenes failed; {} says why; --retry-failed tries them again",
                outcome.failed,
                options.out.join(".syntable/journal.jsonl").display()
            )],
        )),
        Ok(_) => Ok(()),
    }
}

pub(super) fn plan(console: &Console, registry: &Registry, args: &RecipeArgs) -> Result<(), Exit> {
    let mut recipe = console.load(registry, args)?;
    let plan = planned(console, registry, &mut recipe)?;
    let dataset = &recipe.dataset;
    let images = u64::from(dataset.scenes) * u64::from(dataset.views_per_scene);
    console.print(&format!(
        "{}: {} scenes × {} views = {images} images\n\n{}",
        dataset.name,
        dataset.scenes,
        dataset.views_per_scene,
        plan.table(&*recipe.render)
    ))
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
