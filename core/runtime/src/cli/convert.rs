//! `syntable convert`.

use super::run::{ended, on_signals};
use super::{Console, Exit, Message};
use crate::run::convert as convert_dataset;
use crate::run::progress::count;
use crate::workers;
use clap::Args;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::reader;
use syntable_model::registry::{ConstructError, Registry, Slot, Stage};
use syntable_model::stage::Writer;

/// Number of images that cannot be read and are named.
const SHOWN: usize = 10;

#[derive(Args)]
pub(super) struct ConvertArgs {
    /// Folder of the dataset, or its annotation file where there are several.
    dataset: PathBuf,
    /// Kinds of writers (see `syntable list write`), separated by commas.
    #[arg(long, required = true, value_delimiter = ',')]
    to: Vec<String>,
    /// Folder to write to: new, or empty.
    #[arg(long)]
    out: PathBuf,
    /// Format of the dataset (see `syntable list formats`); the one that it looks like if left out.
    #[arg(long)]
    format: Option<String>,
    /// Set an option of a writer: `coco.masks="visible"`. The value is TOML.
    #[arg(long, value_name = "KIND.KEY=VALUE")]
    set: Vec<String>,
}

/// The folder of a dataset that is named by it or by a file in it.
fn folder_of(mut path: PathBuf) -> PathBuf {
    if path.is_file() {
        path.pop();
    }
    path
}

pub(super) fn convert(console: &Console, registry: &Registry, args: &ConvertArgs) -> Result<(), Exit> {
    let writers = args.to.iter().map(|kind| writer(registry, kind, &args.set)).collect::<Result<Vec<_>, _>>();
    let writers = writers.map_err(Exit::wrong)?;
    let unused = args.set.iter().find(|set| !args.to.iter().any(|kind| option_of(set, kind).is_some()));
    if let Some(set) = unused {
        let error = Error::new(format!("--set {set}: it names no writer of --to"));
        return Err(Exit::wrong(error.help("write it as `KIND.KEY=VALUE`")));
    }
    let kinds: BTreeSet<&String> = args.to.iter().collect();
    if kinds.len() < args.to.len() {
        return Err(Exit::wrong(Error::new("--to names a kind twice").help("name each once")));
    }
    if let (Ok(source), Some(Ok(above))) = (
        args.dataset.canonicalize().map(folder_of),
        args.out
            .parent()
            .map(|above| (if above.as_os_str().is_empty() { Path::new(".") } else { above }).canonicalize()),
    ) && above.starts_with(&source)
    {
        let error = Error::new("it lies in the dataset that is read").in_file(&args.out);
        return Err(Exit::wrong(error.help("choose a folder beside it")));
    }
    let (format, dataset) = reader::open(&args.dataset, args.format.as_deref()).map_err(Exit::stopped)?;
    let stop = on_signals()?;
    let how = (workers::available(), &stop);
    let converted = convert_dataset(registry, &*dataset, &writers, &args.out, how, console.reporter())
        .map_err(|error| ended(&stop, error))?;
    let mut out = format!("{}, read as {}, to {}\n", converted.text(), format.name, args.out.display());
    if !converted.lost.is_empty() {
        out += &format!("not carried over: {}\n", converted.lost.join(", "));
    }
    if !converted.lacking.is_empty() {
        out += &format!("not in the dataset, and left out: {}\n", converted.lacking.join(", "));
    }
    if converted.faults > 0 {
        let faults = count(converted.faults, "fault");
        let warning = Error::new(format!("{faults} in what was read: what was written may have them, too"))
            .in_file(&args.dataset)
            .help("`syntable validate` lists what is wrong");
        console.say(&Message::Warning(warning));
    }
    converted.caveats.iter().for_each(|caveat| out += &format!("note: {caveat}\n"));
    console.print(&out)?;
    let left_out = [(&converted.left_out, "image"), (&converted.parts_left_out, "file")];
    let left_out = left_out.into_iter().filter(|(reasons, _)| !reasons.is_empty());
    let what: Vec<String> = left_out.clone().map(|(reasons, one)| count(reasons.len() as u32, one)).collect();
    if what.is_empty() {
        return Ok(());
    }
    let some = left_out.flat_map(|(reasons, _)| reasons.iter().take(SHOWN));
    let some = some.map(|reason| Message::Warning(Error::new(reason.clone())));
    let error = Error::new(format!("{} left out: they cannot be read", what.join(" and "))).in_file(&args.dataset);
    let error = Message::Error(error.help("`syntable validate` lists all that is wrong"));
    Err(Exit { code: 3, messages: some.chain([error]).collect() })
}

/// The text after `KIND.` in an option of a kind.
fn option_of<'a>(set: &'a str, kind: &str) -> Option<&'a str> {
    set.strip_prefix(kind)?.strip_prefix('.')
}

fn writer(registry: &Registry, kind: &str, set: &[String]) -> Result<(String, Box<dyn Writer>), Error> {
    let Some(entry) = registry.find(Slot::Write, kind) else {
        let kinds: Vec<&str> = registry.of_slot(Slot::Write).map(|entry| entry.kind).collect();
        return Err(Error::new(format!("--to {kind}: there is no such kind of writer"))
            .help(format!("these are: {}", kinds.join(", "))));
    };
    let options: String =
        set.iter().filter_map(|set| option_of(set, kind)).map(|option| format!("{option}\n")).collect();
    let refuse = |message: String| Error::new(message).help(format!("`syntable list {kind}` shows the options"));
    let constructed = entry.construct_str(&options).map_err(|error| match error {
        ConstructError::Form(error) => refuse(format!("--set {kind}: {}", error.message())),
        ConstructError::Invalid(invalid) => {
            // As it was written, with the value.
            let key = invalid.key.split(['.', '[']).next().unwrap_or_default();
            let is_it = |option: &&str| option.split(['=', '.']).next().is_some_and(|it| it.trim() == key);
            let given = set.iter().filter_map(|set| option_of(set, kind)).find(is_it).unwrap_or(&invalid.key);
            refuse(format!("--set {kind}.{given}: {}", invalid.message))
        }
    })?;
    match constructed.stage {
        Stage::Write(writer) => Ok((kind.to_owned(), writer)),
        _ => unreachable!("the registry keeps slots apart"),
    }
}
