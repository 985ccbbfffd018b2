//! `syntable merge`.

use super::run::{end_of, ended, on_signals};
use super::{Console, Exit};
use crate::{run, workers};
use clap::Args;
use std::path::PathBuf;
use syntable_model::registry::Registry;

#[derive(Args)]
pub(super) struct MergeArgs {
    /// Folder of the dataset: new, or one that an earlier call began.
    out: PathBuf,
    /// Folders of the parts, made with one recipe and different `--scenes`.
    #[arg(required = true)]
    parts: Vec<PathBuf>,
}

pub(super) fn merge(console: &Console, registry: &Registry, args: &MergeArgs) -> Result<(), Exit> {
    let stop = on_signals()?;
    let merged = run::merge(registry, &args.out, &args.parts, workers::available(), &stop, console.reporter());
    end_of(&merged.map_err(|error| ended(&stop, error))?, &args.out)
}
