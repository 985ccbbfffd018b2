//! `syntable merge`.

use super::run::end_of;
use crate::console::Console;
use crate::exit::Exit;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use std::path::PathBuf;
use syntable_model::registry::Registry;
use syntable_runtime::{run, workers};

#[derive(Args)]
pub(crate) struct MergeArgs {
    /// Folder of the merged dataset, new or from an earlier call.
    out: PathBuf,
    /// Folders of the parts, made from one recipe with different `--scenes`.
    #[arg(required = true)]
    parts: Vec<PathBuf>,
}

pub(crate) fn merge(console: &Console, registry: &Registry, args: &MergeArgs) -> Result<(), Exit> {
    let stop = on_signals(console, Ends::Work("merged scenes are kept, and the same command continues"))?;
    let merged = run::merge(registry, &args.out, &args.parts, workers::available(), &stop, console.reporter());
    end_of(&merged.map_err(|error| ended(&stop, error))?, &args.out)
}
