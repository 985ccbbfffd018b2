//! `syntable validate`.

use super::{Console, Exit, Message};
use crate::run::progress::count;
use crate::validate::{FaultAt, Validated, validate as validate_dataset};
use crate::workers;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::reader;

/// Number of faults that a report for people lists.
const ROWS: usize = 30;

#[derive(Args)]
pub(super) struct ValidateArgs {
    /// Folders of datasets, or their annotation files where a folder has several. Of two and more, numbers of categories and
    /// objects are compared, too.
    #[arg(required = true, value_name = "DATASET")]
    datasets: Vec<PathBuf>,
    /// Format of all of them (see `syntable list formats`); the one that each looks like if left out.
    #[arg(long)]
    format: Option<String>,
    #[arg(long, help = super::TRUST_PATHS)]
    trust_paths: bool,
    /// Print all that was found as one JSON object; of several datasets with an entry each in `datasets`.
    #[arg(long)]
    json: bool,
}

/// What was found of several datasets.
#[derive(Serialize)]
struct ValidatedAll<'a> {
    datasets: Vec<ValidatedAt<'a>>,
    /// Where their numbers differ.
    differences: &'a [FaultAt],
}

#[derive(Serialize)]
struct ValidatedAt<'a> {
    dataset: String,
    #[serde(flatten)]
    found: &'a Validated,
}

pub(super) fn validate(console: &Console, args: &ValidateArgs) -> Result<(), Exit> {
    let mut all: Vec<(String, &'static str, Validated)> = Vec::new();
    for path in &args.datasets {
        let (format, found) = one(path, args)?;
        all.push((path.display().to_string(), format, found));
    }
    let mut differences = Vec::new();
    // The first dataset that states a number speaks for it: each other one is compared with all before it.
    for (at, (two, _, other)) in all.iter().enumerate() {
        for (one, _, found) in &all[..at] {
            differences.extend(found.numbers.differences(&other.numbers, [one, two]));
        }
    }
    if args.json {
        let text = match all.as_slice() {
            [(_, _, found)] => serde_json::to_string_pretty(found),
            all => {
                let datasets =
                    all.iter().map(|(dataset, _, found)| ValidatedAt { dataset: dataset.clone(), found }).collect();
                serde_json::to_string_pretty(&ValidatedAll { datasets, differences: &differences })
            }
        };
        console.print(&(text.expect("plain data") + "\n"))?;
    } else {
        for (dataset, format, found) in &all {
            let heading = if all.len() > 1 { format!("{dataset}\n") } else { String::new() };
            console.print(&(heading + &table(found, format)))?;
        }
        if all.len() > 1 {
            let silent: Vec<&str> = all
                .iter()
                .filter(|(.., found)| found.numbers.is_empty())
                .map(|(dataset, ..)| dataset.as_str())
                .collect();
            console.print(&comparison(all.len(), &silent, &differences))?;
        }
    }
    let faulty = all.iter().filter(|(_, _, found)| !found.is_sound());
    let mut errors: Vec<Message> = faulty
        .map(|(dataset, _, found)| {
            Message::Error(Error::new(format!("{} found", count(found.faults.len() as u32, "fault"))).in_file(dataset))
        })
        .collect();
    if !differences.is_empty() {
        let message = format!("numbers of the datasets differ in {}", count(differences.len() as u32, "place"));
        let help = "state numbers with `ids` or `first_id` of the pools, and give all recipes the same `classes`";
        errors.push(Message::Error(Error::new(message).help(help)));
    }
    match errors.is_empty() {
        true => Ok(()),
        false => Err(Exit { code: 3, messages: errors }),
    }
}

/// Validates a dataset, and names its format.
fn one(path: &Path, args: &ValidateArgs) -> Result<(&'static str, Validated), Exit> {
    let named = reader::Source::new(path).trusting(args.trust_paths);
    let (format, found_at) = reader::find(&named, args.format.as_deref()).map_err(Exit::stopped)?;
    let found = match format.open(&found_at) {
        Ok(dataset) => validate_dataset(&*dataset, workers::available()).map_err(Exit::stopped)?,
        Err(error) if error.is_transient() => return Err(Exit::stopped(error)),
        // A dataset that cannot be opened is one with a fault.
        Err(error) => Validated::unreadable(found_at.path.display().to_string(), &error),
    };
    Ok((format.name, found))
}

/// What was found of a dataset, for people.
fn table(found: &Validated, format: &str) -> String {
    let width = found.checks.iter().map(|it| it.check.len()).max().unwrap_or(0);
    let mut out = format!("{:width$}  images  faults\n", "check");
    for it in &found.checks {
        let images = it.images.map_or_else(|| "-".to_owned(), |images| images.to_string());
        out += &format!("{:width$}  {images:>6}  {:>6}\n", it.check, it.faults);
    }
    for fault in found.some_of_each(ROWS) {
        out += &format!("\n{}: {}\n  {}\n", fault.check, fault.place, fault.message);
    }
    if found.faults.len() > ROWS {
        out += &format!("\nand {} more; --json lists all\n", found.faults.len() - ROWS);
    }
    let faults = match found.faults.len() {
        0 => "no fault".to_owned(),
        faults => count(faults as u32, "fault"),
    };
    out + &format!("\n{}, read as {format}: {faults}\n", count(found.images, "image"))
}

/// Where datasets differ, for people. `silent` are those without numbers.
fn comparison(datasets: usize, silent: &[&str], differences: &[FaultAt]) -> String {
    let mut out = String::new();
    for difference in differences.iter().take(ROWS) {
        out += &format!("\n{}: {}\n", difference.check, difference.message);
    }
    if differences.len() > ROWS {
        out += &format!("\nand {} more; --json lists all\n", differences.len() - ROWS);
    }
    for dataset in silent {
        out += &format!("\n{dataset} states no numbers of categories or objects: nothing of it is compared\n");
    }
    let compared = datasets - silent.len();
    if differences.is_empty() && compared > 1 {
        out += &format!("\n{compared} datasets: categories and objects have the same numbers\n");
    }
    out
}
