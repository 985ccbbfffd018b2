//! `syntable merge`.

use super::run::end_of;
use crate::console::Console;
use crate::exit::Exit;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use std::collections::BTreeSet;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_model::store::StoreFolder;
use syntable_runtime::run::MergeOptions;
use syntable_runtime::run::dataset::journal::Journal;
use syntable_runtime::run::progress::count;
use syntable_runtime::{run, workers};

#[derive(Args)]
pub(crate) struct MergeArgs {
    /// Folder or URL of the merged dataset, new or from an earlier call.
    out: PathBuf,
    /// Folders or URLs of the parts, made from one recipe with `--shard` or different `--scenes`, or folders of such folders.
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// Add the parts to a dataset that already has other scenes.
    #[arg(long)]
    extend: bool,
    /// Merge the shards that exist, although others are missing.
    #[arg(long)]
    partial: bool,
    /// Merge parts that different devices rendered.
    #[arg(long)]
    mixed_devices: bool,
    /// Run programs that write files at the end of a run.
    #[arg(long)]
    allow_code: bool,
}

pub(crate) fn merge(console: &Console, registry: &Registry, args: &MergeArgs) -> Result<(), Exit> {
    let out = StoreFolder::at(&args.out).map_err(Exit::stopped)?;
    let parts = args.parts.iter().map(StoreFolder::at).collect::<Result<Vec<_>, _>>().map_err(Exit::stopped)?;
    if !args.extend {
        is_no_part(&out, &parts)?;
    }
    let stop = on_signals(console, Ends::Work("merged scenes are kept, and the same command continues"))?;
    let options = MergeOptions {
        allow_code: args.allow_code,
        partial: args.partial,
        mixed_devices: args.mixed_devices,
        stop: stop.clone(),
        ..MergeOptions::new(workers::available())
    };
    let merged = run::merge(registry, &out, &parts, &options, console.reporter());
    end_of(console, &merged.map_err(|error| ended(&stop, error))?, &args.out)
}

/// Refuses an output folder with scenes that no part has: the output was probably forgotten, and the folder is the first
/// part. After an interrupted merge, all its scenes come from the parts.
fn is_no_part(out: &StoreFolder, parts: &[StoreFolder]) -> Result<(), Exit> {
    // Unreadable journals are errors of the merge.
    let scenes = |dataset: &StoreFolder| -> BTreeSet<u32> {
        Journal::entries_of(dataset).map(|entries| entries.scenes().collect()).unwrap_or_default()
    };
    let datasets = parts.iter().flat_map(|part| run::datasets_in(part).unwrap_or_default());
    let of_parts: BTreeSet<u32> = datasets.flat_map(|dataset| scenes(&dataset)).collect();
    let own = scenes(out).difference(&of_parts).count();
    if own == 0 {
        return Ok(());
    }
    let error = Error::new(format!("the output folder has {} that no part has", count(own as u32, "scene")));
    let help = "name the folder of the merged dataset first, then all parts; --extend adds the parts to this dataset";
    Err(Exit::wrong(error.in_file(out.name()).help(help)))
}
