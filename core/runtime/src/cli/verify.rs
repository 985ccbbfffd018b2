//! `syntable verify`.

use super::{Console, Exit, Message};
use crate::run::progress::count;
use crate::{run, workers};
use clap::Args;
use std::path::PathBuf;
use syntable_model::error::Error;

#[derive(Args)]
pub(super) struct VerifyArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
}

pub(super) fn verify(console: &Console, args: &VerifyArgs) -> Result<(), Exit> {
    let found = run::verify(&args.dataset, workers::available()).map_err(Exit::stopped)?;
    let mut out = String::new();
    for (what, paths) in [("missing", &found.missing), ("damaged", &found.damaged), ("foreign", &found.foreign)] {
        paths.iter().for_each(|path| out += &format!("{what}  {path}\n"));
    }
    for (scene, paths) in &found.unlisted {
        paths.iter().for_each(|path| out += &format!("unlisted  {path}  (of scene {scene}, whose manifest is lost)\n"));
    }
    let (scenes, files) = (count(found.scenes, "scene"), count(found.files as u32, "file"));
    let unlisted = match found.unlisted.values().map(Vec::len).sum::<usize>() {
        0 => String::new(),
        unlisted => format!(", {unlisted} unlisted"),
    };
    out += &format!(
        "{scenes}, {files} compared: {} missing, {} damaged, {} foreign{unlisted}\n",
        found.missing.len(),
        found.damaged.len(),
        found.foreign.len()
    );
    console.print(&out)?;
    if found.whole() {
        return Ok(());
    }
    let error = if found.missing.is_empty() && found.damaged.is_empty() {
        Error::new("the last run did not end").help("run the same command once more")
    } else {
        Error::new("the dataset is not what was written").help("`syntable run` with --repair makes the scenes again")
    };
    Err(Exit { code: 3, messages: vec![Message::Error(error.in_file(&args.dataset))] })
}
