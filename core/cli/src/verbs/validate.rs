//! `syntable validate`.

use crate::console::Console;
use crate::exit::Exit;
use crate::flags::with_flags;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::reader::Source;
use syntable_model::registry::Registry;
use syntable_model::rule::READABLE;
use syntable_recipe::message::Message;
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::count;
use syntable_runtime::validate::{CheckResult, FaultAt, Validated, ValidatedDataset, differences, validate_path};
use syntable_runtime::workers::{self, Pool};

/// Number of faults that a report for people lists.
const ROWS: usize = 30;

#[derive(Args)]
pub(crate) struct ValidateArgs {
    /// Folders of datasets, or their annotation files if a folder has several. For two or more datasets, the ids of
    /// categories and objects are compared, too.
    #[arg(required = true, value_name = "DATASET")]
    datasets: Vec<PathBuf>,
    /// Format of all datasets (see `syntable list formats`). Default: detected for each.
    #[arg(long)]
    format: Option<String>,
    #[arg(long, help = crate::arguments::TRUST_PATHS)]
    trust_paths: bool,
    #[arg(long, value_name = "DIR", help = crate::arguments::IMAGE_FOLDER)]
    image_folder: Option<PathBuf>,
    /// Print all results as one JSON object. Several datasets have one entry each in `datasets`.
    #[arg(long)]
    json: bool,
}

/// Results for several datasets.
#[derive(Serialize)]
struct ValidatedAll<'a> {
    datasets: Vec<ValidatedAt<'a>>,
    /// Contradictory ids of categories and objects.
    differences: &'a [FaultAt],
}

#[derive(Serialize)]
struct ValidatedAt<'a> {
    dataset: &'a str,
    #[serde(flatten)]
    found: &'a Validated,
}

pub(crate) fn validate(console: &Console, registry: &Registry, args: &ValidateArgs) -> Result<(), Exit> {
    let (stop, pool) = (
        on_signals(console, Ends::Work("nothing is written"))?,
        Pool::new(workers::available()).map_err(Exit::stopped)?,
    );
    let work = ImageWork { workers: &pool, reporter: console.reporter(), stop: &stop };
    let one = |path: &PathBuf| {
        let source = Source::at_name(path, args.image_folder.as_deref()).map_err(|error| ended(&stop, error))?;
        let source = source.trusting(args.trust_paths);
        validate_path(registry, &source, args.format.as_deref(), &work).map_err(|error| ended(&stop, error))
    };
    let all = args.datasets.iter().map(one).collect::<Result<Vec<ValidatedDataset>, Exit>>()?;
    let differences = differences(&all);
    if args.json {
        let text = match all.as_slice() {
            [one] => serde_json::to_string_pretty(&one.found),
            all => {
                let datasets = all.iter().map(|it| ValidatedAt { dataset: &it.dataset, found: &it.found }).collect();
                serde_json::to_string_pretty(&ValidatedAll { datasets, differences: &differences })
            }
        };
        console.print(&with_flags(&(text.expect("plain data") + "\n")))?;
    } else {
        for it in &all {
            let heading = if all.len() > 1 { format!("{}\n", it.dataset) } else { String::new() };
            console.print(&with_flags(&(heading + &table(&it.found, it.format))))?;
        }
        if all.len() > 1 {
            let silent = all.iter().filter(|it| it.found.numbers.is_empty());
            let silent: Vec<&str> = silent.map(|it| it.dataset.as_str()).collect();
            console.print(&comparison(all.len(), &silent, &differences))?;
        }
    }
    let faulty = all.iter().filter(|it| !it.found.is_sound());
    let mut errors: Vec<Message> = faulty
        .map(|it| {
            let faults = count(it.found.faults.len() as u32, "fault");
            Message::Error(Error::new(format!("{faults} found")).in_file(&it.dataset))
        })
        .collect();
    if !differences.is_empty() {
        let message = format!("ids of the datasets differ in {}", count(differences.len() as u32, "place"));
        let help = "set ids with `ids` or `first_id` of the pools, and give all recipes the same `classes`";
        errors.push(Message::Error(Error::new(message).help(help)));
    }
    match errors.is_empty() {
        true => Ok(()),
        false => Err(Exit { code: 3, messages: errors }),
    }
}

/// Results for a dataset as a table.
fn table(found: &Validated, format: &str) -> String {
    // A check without an image found none of its labels, or is no rule of the format.
    let (idle, made): (Vec<&CheckResult>, Vec<&CheckResult>) =
        found.checks.iter().partition(|it| it.images == Some(0) && it.faults == 0 && it.check != READABLE);
    let width = made.iter().map(|it| it.check.len()).max().unwrap_or(0);
    let mut out = format!("{:width$}  images  faults\n", "check");
    for it in made {
        let images = it.images.map_or_else(|| "-".to_owned(), |images| images.to_string());
        out += &format!("{:width$}  {images:>6}  {:>6}\n", it.check, it.faults);
    }
    if !idle.is_empty() {
        out += &format!("checks that do not apply to the dataset: {}; --json lists all\n", idle.len());
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

/// Differences between datasets as a table. `silent` are datasets without ids.
fn comparison(datasets: usize, silent: &[&str], differences: &[FaultAt]) -> String {
    let mut out = String::new();
    for difference in differences.iter().take(ROWS) {
        out += &format!("\n{}: {}\n", difference.check, difference.message);
    }
    if differences.len() > ROWS {
        out += &format!("\nand {} more; --json lists all\n", differences.len() - ROWS);
    }
    for dataset in silent {
        out += &format!("\n{dataset} has no ids of categories or objects, and is not compared\n");
    }
    let compared = datasets - silent.len();
    if differences.is_empty() && compared > 1 {
        out += &format!("\n{compared} datasets: categories and objects have the same ids\n");
    }
    out
}
