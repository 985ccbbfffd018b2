//! `syntable run`.

use crate::arguments::RecipeArgs;
use crate::console::Console;
use crate::exit::Exit;
use crate::shell::quoted;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_model::store::StoreFolder;
use syntable_recipe::message::Message;
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::{Event, count};
use syntable_runtime::run::{ClaimOptions, RunOptions, RunOutcome, SceneRange, Shard, ShardChoice, run as run_recipe};
use syntable_runtime::workers;

#[derive(Args)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Folder of the dataset, or its URL in an object store, such as `s3://bucket/mine`. Default: `data/<dataset.name>`.
    /// Shard 3 of 10 goes to `<DIR>.shards/3-of-10`.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Make only these scenes: `A..B` (without B), `A..`, `..B`, or one number.
    #[arg(long, allow_hyphen_values = true, value_name = "A..B", value_parser = str::parse::<SceneRange>)]
    scenes: Option<SceneRange>,
    /// Make one of N shards, number I from 0, for `merge`. `auto` takes both numbers from the variables of a Slurm array, AWS
    /// Batch, Cloud Run or SkyPilot, and `auto/N` also from Kubernetes or PBS.
    #[arg(long, value_name = "I/N", value_parser = str::parse::<ShardChoice>)]
    shard: Option<ShardChoice>,
    /// Make the dataset together with other workers that run the same command, on any machines that reach the folder or the
    /// URL. Each claims blocks of BLOCK scenes; the same for all workers. The last one ends the run.
    #[arg(
        long,
        value_name = "BLOCK",
        num_args = 0..=1,
        default_missing_value = "1",
        value_parser = clap::value_parser!(u32).range(1..),
        conflicts_with_all = ["shard", "overwrite", "retry_failed", "repair", "rewrite"]
    )]
    claim: Option<u32>,
    /// Time without a sign of life after which other workers take over the scenes that a worker claims, in seconds.
    #[arg(long, value_name = "SECONDS", requires = "claim", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=86400))]
    lease: u32,
    /// Worker threads. Default: all cores. The dataset does not depend on their number.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Delete the dataset in the folder, and start again.
    #[arg(long)]
    overwrite: bool,
    /// Run code that the recipe brings: native libraries and programs.
    #[arg(long)]
    allow_code: bool,
    /// Retry scenes that failed in an earlier run.
    #[arg(long)]
    retry_failed: bool,
    /// First compare all files with the journal, and make scenes with missing or damaged files again.
    #[arg(long, conflicts_with = "overwrite")]
    repair: bool,
    /// Rewrite the files of writers if their options, or the options of their annotators, have changed. Delete the
    /// files of writers that are no longer in the recipe.
    #[arg(long, conflicts_with = "overwrite")]
    rewrite: bool,
}

/// Verbs that show a dataset, and what they do.
const NEXT: [(&str, &str); 2] = [("view", "images and labels in a browser"), ("report", "pages and numbers to keep")];

/// `program` is the command line, which may have verbs that show the dataset.
pub(crate) fn run(console: &Console, registry: &Registry, args: &RunArgs, program: &clap::Command) -> Result<(), Exit> {
    let recipe = console.load_for_run(registry, &args.recipe)?;
    recipe.ready(args.allow_code).map_err(Exit::wrong)?;
    let scenes = args.scenes.map(|scenes| scenes.within(recipe.dataset.scenes)).transpose().map_err(Exit::wrong)?;
    let stop = on_signals(console, Ends::Work("finished scenes are kept, and the same command continues"))?;
    let shard = args.shard.map(|choice| shard_of(console, choice)).transpose()?;
    let dataset = args.out.clone().unwrap_or_else(|| PathBuf::from("data").join(&recipe.dataset.name));
    let out = shard.map_or_else(|| dataset.clone(), |shard| shard.folder(&dataset));
    let options = RunOptions {
        scenes,
        shard,
        claim: args.claim.map(|block| ClaimOptions { block, lease: Duration::from_secs(args.lease.into()) }),
        allow_code: args.allow_code,
        overwrite: args.overwrite,
        retry_failed: args.retry_failed,
        repair: args.repair,
        rewrite: args.rewrite,
        stop: stop.clone(),
        ..RunOptions::new(
            StoreFolder::at(&out).map_err(Exit::stopped)?,
            args.threads.map_or_else(workers::available, usize::from),
            DiskCache::of_user(),
        )
    };
    let outcome = run_recipe(&recipe, &options, console.reporter()).map_err(|error| ended(&stop, error))?;
    let out = options.out.name();
    end_of(console, &outcome, &out)?;
    if shard.is_some() {
        let [all, dataset] = [Shard::folder_of_all(&dataset), dataset].map(|path| quoted(&path.display().to_string()));
        console.suggest(&[
            (format!("status {all}"), "how far all shards are"),
            (format!("merge {dataset} {all}"), "one dataset, once all shards are done"),
        ]);
        return Ok(());
    }
    if options.out.local().is_none() {
        return Ok(());
    }
    let linked = NEXT.iter().filter(|(verb, _)| program.find_subcommand(verb).is_some());
    let out = quoted(&out.display().to_string());
    let steps = linked.map(|(verb, what)| (format!("{verb} {out}"), *what));
    console.suggest(&steps.collect::<Vec<_>>());
    Ok(())
}

/// The shard that a choice means. Prints the variables of a job array that determined it.
fn shard_of(console: &Console, choice: ShardChoice) -> Result<Shard, Exit> {
    let (shard, variables) = choice.resolve(&|name| std::env::var(name).ok()).map_err(Exit::wrong)?;
    if !variables.is_empty() {
        let message = format!("shard {shard}, from {}", variables.join(" and "));
        console.reporter().event(&Event::Note { message });
    }
    Ok(shard)
}

/// Ends a verb that made a dataset: exit code 3 and the reasons if the dataset is incomplete.
pub(crate) fn end_of(console: &Console, outcome: &RunOutcome, out: &Path) -> Result<(), Exit> {
    console.print_place(out)?;
    let failed = (outcome.failed > 0).then(|| {
        Error::new(format!("{} failed", count(outcome.failed, "scene")))
            .in_file(out.join(".syntable/journal.jsonl"))
            .help("the journal has the reasons; --retry-failed tries them again")
    });
    let lacking = (outcome.lacking > 0).then(|| {
        Error::new(format!(
            "{} could not be repaired or extended, and stay as they were",
            count(outcome.lacking, "scene")
        ))
        .in_file(out)
        .help("the warnings above have the reasons; the same command tries again")
    });
    let missing = (outcome.missing > 0).then(|| {
        Error::new(format!("{} of the recipe missing", count(outcome.missing, "scene")))
            .in_file(out)
            .help("the warning above names them")
    });
    let useless = outcome.useless.iter().map(|(what, help)| {
        let images = count(outcome.images, "image");
        Error::new(format!("the dataset is of no use: {what}, in {images}")).in_file(out).help(*help)
    });
    let errors = [failed, lacking, missing].into_iter().flatten().chain(useless);
    let mut messages: Vec<Message> = errors.map(Message::Error).collect();
    let help = match outcome.bad_assets.as_slice() {
        [] => "see the warnings above",
        _ => {
            "see the warnings above; `syntable check --assets` lists the faults of bad assets, and `exclude` omits them"
        }
    };
    messages.extend(outcome.left_out().messages(out, help));
    if messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
}
