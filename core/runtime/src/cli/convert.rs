//! `syntable convert`.

use super::run::{ended, on_signals};
use super::{Console, Exit, LeftOutReport, Message};
use crate::run::progress::count;
use crate::run::{check_place, convert as convert_dataset, products_of};
use crate::workers;
use clap::Args;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::reader;
use syntable_model::registry::{ConstructError, Entry, Registry, Slot, Stage};
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
    #[arg(long, help = super::TRUST_PATHS)]
    trust_paths: bool,
    /// Set an option of a writer: `coco.masks="visible"`. The value is TOML.
    #[arg(long, value_name = "KIND.KEY=VALUE")]
    set: Vec<String>,
}

pub(super) fn convert(console: &Console, registry: &Registry, args: &ConvertArgs) -> Result<(), Exit> {
    let writers = args.to.iter().map(|kind| Asked::of(registry, kind, &args.set)).collect::<Result<Vec<_>, _>>();
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
    check_place(&args.out, &args.dataset).map_err(Exit::wrong)?;
    let named = reader::Source::new(&args.dataset).trusting(args.trust_paths);
    let (format, dataset) = reader::open_source(&named, args.format.as_deref()).map_err(Exit::stopped)?;
    let has = products_of(registry, &*dataset);
    let mut lacking = BTreeSet::new();
    let writers = writers.into_iter().map(|writer| writer.without_missing(&has, &mut lacking));
    let writers = writers.collect::<Result<Vec<_>, _>>().map_err(Exit::wrong)?;
    let stop = on_signals()?;
    let how = (workers::available(), &stop);
    let converted = convert_dataset(registry, &*dataset, &writers, &args.out, how, console.reporter())
        .map_err(|error| ended(&stop, error))?;
    let mut out = format!("{}, read as {}, to {}\n", converted.text(), format.name, args.out.display());
    if !converted.lost.is_empty() {
        out += &format!("not carried over: {}\n", converted.lost.join(", "));
    }
    lacking.extend(converted.lacking);
    if !lacking.is_empty() {
        let names: Vec<String> = lacking.into_iter().collect();
        out += &format!("not in the dataset, and left out: {}\n", names.join(", "));
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
    let mut left_out = LeftOutReport::default();
    let unreadable =
        [(&converted.left_out, "image"), (&converted.not_listed, "part"), (&converted.parts_left_out, "file")];
    let unreadable: Vec<(&Vec<String>, &str)> = unreadable.into_iter().filter(|it| !it.0.is_empty()).collect();
    if !unreadable.is_empty() {
        let what: Vec<String> = unreadable.iter().map(|(reasons, one)| count(reasons.len() as u32, one)).collect();
        let reasons = unreadable.iter().flat_map(|(reasons, _)| reasons.iter().take(SHOWN));
        let reasons = reasons.map(|reason| Error::new(reason.clone()));
        left_out.add(format!("{} left out: they cannot be read", what.join(" and ")), reasons);
    }
    left_out.annotations(&converted.passed_over);
    if !converted.not_kept.is_empty() {
        let summary = format!("{} with labels not kept", count(converted.not_kept.len() as u32, "field"));
        left_out.add(summary, converted.not_kept.iter().map(|it| Error::new(it.to_string())));
    }
    left_out.losses(&converted.losses);
    left_out.end(&args.dataset, "the warnings above name it; `syntable validate` lists what is wrong with the dataset")
}

/// The text after `KIND.` in an option of a kind.
fn option_of<'a>(set: &'a str, kind: &str) -> Option<&'a str> {
    set.strip_prefix(kind)?.strip_prefix('.')
}

/// A writer of `--to`.
struct Asked<'a> {
    entry: &'a Entry,
    options: toml::Table,
    /// Names of the options that `--set` gives.
    given: BTreeSet<String>,
    writer: Box<dyn Writer>,
}

impl<'a> Asked<'a> {
    fn of(registry: &'a Registry, kind: &str, set: &[String]) -> Result<Self, Error> {
        let Some(entry) = registry.find(Slot::Write, kind) else {
            let kinds: Vec<&str> = registry.of_slot(Slot::Write).map(|entry| entry.kind).collect();
            return Err(Error::new(format!("--to {kind}: there is no such kind of writer"))
                .help(format!("these are: {}", kinds.join(", "))));
        };
        let given: Vec<&str> = set.iter().filter_map(|set| option_of(set, kind)).collect();
        let key = |option: &str| option.split(['=', '.']).next().unwrap_or_default().trim().to_owned();
        let text: String = given.iter().map(|option| format!("{option}\n")).collect();
        let refuse = |message: String| Error::new(message).help(format!("`syntable list {kind}` shows the options"));
        let constructed = entry.construct_str(&text).map_err(|error| match error {
            ConstructError::Form(error) => refuse(format!("--set {kind}: {}", error.message())),
            ConstructError::Invalid(invalid) => {
                // As it was written, with the value.
                let name = invalid.key.split(['.', '[']).next().unwrap_or_default();
                let as_given = given.iter().find(|option| key(option) == name).copied().unwrap_or(&invalid.key);
                refuse(format!("--set {kind}.{as_given}: {}", invalid.message))
            }
        })?;
        let given = given.iter().map(|option| key(option)).collect();
        Ok(Self { entry, options: constructed.options, given, writer: writer_of(constructed.stage) })
    }

    /// The writer without those entries of its lists, such as `include`, that need what a dataset does not have, and
    /// their products. A list that `--set` gives stays as it is, and one of which nothing would be left.
    fn without_missing(
        mut self,
        has: &BTreeSet<String>,
        lacking: &mut BTreeSet<String>,
    ) -> Result<(String, Box<dyn Writer>), Error> {
        let mut missing: BTreeMap<String, BTreeSet<usize>> = BTreeMap::new();
        let mut products: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for input in self.writer.reads().into_iter().filter(|input| !has.contains(&input.product)) {
            let Some((list, place)) = input.option.as_deref().and_then(entry_of) else { continue };
            if !self.given.contains(list) {
                missing.entry(list.to_owned()).or_default().insert(place);
                products.entry(list.to_owned()).or_default().insert(input.product);
            }
        }
        let kind = self.entry.kind.to_owned();
        let mut is_changed = false;
        for (list, places) in missing {
            let Some(toml::Value::Array(entries)) = self.options.get_mut(&list) else { continue };
            if places.len() < entries.len() {
                let mut place = 0..;
                entries.retain(|_| place.next().is_none_or(|place| !places.contains(&place)));
                lacking.extend(products.remove(&list).unwrap_or_default());
                is_changed = true;
            }
        }
        if !is_changed {
            return Ok((kind, self.writer));
        }
        let error = |what: String| Error::new(format!("--to {kind}: {what}"));
        let text = toml::to_string(&self.options).map_err(|it| error(it.to_string()))?;
        let constructed = self.entry.construct_str(&text).map_err(|it| match it {
            ConstructError::Form(it) => error(it.message().to_owned()),
            ConstructError::Invalid(it) => error(it.message),
        })?;
        Ok((kind, writer_of(constructed.stage)))
    }
}

/// The name of a list and a place in it: `include[3]`.
fn entry_of(option: &str) -> Option<(&str, usize)> {
    let (list, place) = option.strip_suffix(']')?.split_once('[')?;
    Some((list, place.parse().ok()?))
}

fn writer_of(stage: Stage) -> Box<dyn Writer> {
    match stage {
        Stage::Write(writer) => writer,
        _ => unreachable!("the registry keeps slots apart"),
    }
}
