//! `syntable convert`.

use crate::console::Console;
use crate::exit::Exit;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_model::store::StoreFolder;
use syntable_recipe::message::Message;
use syntable_runtime::conversion::{self, ConvertOptions};
use syntable_runtime::run::progress::count;
use syntable_runtime::workers;

#[derive(Args)]
pub(crate) struct ConvertArgs {
    /// Folder of the dataset, or its annotation file if the folder has several.
    dataset: PathBuf,
    /// Kinds of writers (see `syntable list write`), separated by commas.
    #[arg(long, required = true, value_delimiter = ',')]
    to: Vec<String>,
    /// Output folder, new or empty.
    #[arg(short, long)]
    out: PathBuf,
    /// Format of the dataset (see `syntable list formats`). Default: detected.
    #[arg(long)]
    format: Option<String>,
    #[arg(long, help = crate::arguments::TRUST_PATHS)]
    trust_paths: bool,
    #[arg(long, value_name = "DIR", help = crate::arguments::IMAGE_FOLDER)]
    image_folder: Option<PathBuf>,
    /// Set an option of a writer: `coco.masks="visible"`. The value is TOML.
    #[arg(long, value_name = "KIND.KEY=VALUE")]
    set: Vec<String>,
}

pub(crate) fn convert(console: &Console, registry: &Registry, args: ConvertArgs) -> Result<(), Exit> {
    let ConvertArgs { dataset, to, out, format, trust_paths, image_folder, set } = args;
    let stop = on_signals(console, Ends::Work("the output stays as it was"))?;
    let threads = workers::available();
    let out = StoreFolder::at(out).map_err(Exit::stopped)?;
    let options = ConvertOptions { dataset, format, trust_paths, image_folder, to, set, out, threads, stop };
    let done =
        conversion::convert(registry, &options, console.reporter()).map_err(|error| ended(&options.stop, error))?;
    let converted = &done.converted;
    let mut out = format!("{}, read as {}, to {}\n", converted.text(), done.format, options.out.name().display());
    if !converted.lost.is_empty() {
        out += &format!("not carried over: {}\n", converted.lost.join(", "));
    }
    let lacking = Vec::from_iter(done.lacking());
    if !lacking.is_empty() {
        out += &format!("missing in the dataset, and therefore omitted: {}\n", lacking.join(", "));
    }
    if converted.faults > 0 {
        let faults = count(converted.faults, "fault");
        let it = if converted.faults == 1 { "it" } else { "them" };
        let warning = Error::new(format!("{faults} in the labels that were converted; the result may repeat {it}"))
            .in_file(&options.dataset)
            .help("`syntable validate` lists all faults");
        console.say(&Message::Warning(warning));
    }
    converted.caveats.iter().for_each(|caveat| out += &format!("note: {caveat}\n"));
    console.print(&out)?;
    let help = "see the warnings above; the rest is written, and `syntable validate` checks it";
    Exit::if_left_out(done.left_out(), &options.out.name(), help)
}
