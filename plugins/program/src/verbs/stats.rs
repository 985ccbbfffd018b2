//! `syntable stats`.

use super::arguments;
use std::path::{Path, PathBuf};
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_cli::{Console, Exit, Verb, check_outputs, ended, on_signals};
use syntable_model::reader::Source;
use syntable_model::registry::Registry;
use syntable_report::stats::distribution::Binning;
use syntable_report::stats::duplicates::LEVELS;
use syntable_report::stats::{Edges, Options, compare, table};
use syntable_runtime::durable::write_file;
use syntable_runtime::images::Work;
use syntable_runtime::paths::dataset_folder;
use syntable_runtime::workers::Pool;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("stats")
        .about("Count what datasets have: instances, occlusion, sizes, near-duplicate views")
        .arg(
            Arg::new("dataset")
                .value_name("DATASET")
                .required(true)
                .num_args(1..)
                .value_parser(value_parser!(PathBuf))
                .help("Folders of datasets of any format that can be read, or annotation files; several stand side by side"),
        )
        .arg(
            flag("format")
                .value_name("FORMAT")
                .help("Their format (see `syntable list formats`); the one that each looks like if left out"),
        )
        .arg(arguments::trust_paths())
        .arg(flag("labels-only").action(ArgAction::SetTrue).help(
            "Read no images, which takes most of the time: leaves out brightness, depth and near-duplicate views",
        ))
        .arg(flag("edges").value_parser(["pixels", "iou", "stored"]).default_value("pixels").help(
            "What makes object i occlude j: a hidden pixel of j that shows i; an IoU of i's visible and j's occlusion mask \
             above 0.1, as in some of SynTable's notebooks; or the order that the dataset has",
        ))
        .arg(flag("bins").value_parser(["fixed", "equal"]).default_value("fixed").help(
            "Bins of histograms: fixed ones, or ten equal ones from the least to the greatest value, as in SynTable's figures",
        ))
        .arg(flag("prefixes").action(ArgAction::SetTrue).help(
            "Count components of the first object of each view, of the first two and so on, as SynTable's figure does",
        ))
        .arg(
            flag("duplicate-levels")
                .value_name("N")
                .value_parser(value_parser!(u8))
                .default_value("5")
                .help("Largest difference of the luma of a cell, of 255, in near-duplicate views"),
        )
        .arg(flag("json").action(ArgAction::SetTrue).help("Print all of it as one JSON object"))
        .arg(
            flag("csv")
                .value_name("FILE")
                .value_parser(value_parser!(PathBuf))
                .help("Write a line for each image to a file"),
        )
        .arg(arguments::threads("Worker threads; all cores if left out. The numbers do not depend on it"))
        .after_help(
            "Examples:
  syntable stats data                              tables and histograms
  syntable stats data --csv each.csv --json        for programs; a line for each image
  syntable stats ours theirs --labels-only         side by side, with distances between them",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let text = |name: &str| arguments.get_one::<String>(name).map(String::as_str);
    let options = Options {
        images: !arguments.get_flag("labels-only"),
        edges: match text("edges") {
            Some("iou") => Edges::Iou,
            Some("stored") => Edges::Stored,
            _ => Edges::Pixels,
        },
        prefixes: arguments.get_flag("prefixes"),
        levels: arguments.get_one("duplicate-levels").copied().unwrap_or(LEVELS),
        binning: if text("bins") == Some("equal") { Binning::Equal } else { Binning::Fixed },
    };
    let datasets: Vec<&PathBuf> = arguments.get_many("dataset").into_iter().flatten().collect();
    let folders: Vec<PathBuf> = datasets.iter().map(|path| dataset_folder(registry, path)).collect();
    let read: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
    check_outputs(&[("--csv", arguments.get_one("csv"))], &read)?;
    let sources: Vec<Source> = datasets.iter().map(|path| arguments::source(path, arguments)).collect();
    let (pool, stop) = (Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?, on_signals()?);
    let work = Work { workers: &pool, reporter: console.reporter(), stop: &stop };
    let found = compare(registry, &sources, text("format"), &options, &work).map_err(|error| ended(&stop, error))?;
    if let Some(file) = arguments.get_one::<PathBuf>("csv") {
        write_file(file, table::csv(&found.datasets).as_bytes()).map_err(Exit::stopped)?;
    }
    let is_json = arguments.get_flag("json");
    console.print(&if is_json { table::json(&found.datasets) } else { table::text(&found.datasets) })?;
    Exit::if_left_out(found.left_out, read[0], "`syntable validate` lists all that is wrong")
}
