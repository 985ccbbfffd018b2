//! `syntable stats`.

use super::arguments;
use std::path::{Path, PathBuf};
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_cli::{Console, Ends, Exit, OutputFile, Verb, check_outputs, ended, on_signals};
use syntable_model::reader::Source;
use syntable_model::registry::Registry;
use syntable_report::stats::distribution::Binning;
use syntable_report::stats::duplicates::LEVELS;
use syntable_report::stats::{Edges, StatisticsOptions, compare, table};
use syntable_runtime::durable::write_file;
use syntable_runtime::images::ImageWork;
use syntable_runtime::paths::dataset_folder;
use syntable_runtime::workers::Pool;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("stats")
        .about("Compute statistics of datasets: instances, occlusion, sizes, near-duplicate views")
        .arg(
            Arg::new("dataset")
                .value_name("DATASET")
                .required(true)
                .num_args(1..)
                .value_parser(value_parser!(PathBuf))
                .help("Folders of datasets in any readable format, or annotation files; several are shown side by side"),
        )
        .arg(
            flag("format")
                .value_name("FORMAT")
                .help("Format of all datasets (see `syntable list formats`). Default: detected for each"),
        )
        .arg(arguments::trust_paths())
        .arg(arguments::image_folder())
        .arg(flag("labels-only").action(ArgAction::SetTrue).help(
            "Read only labels, since images take most of the time. Omits brightness, depth and near-duplicate views",
        ))
        .arg(flag("edges").value_parser(["pixels", "iou", "stored"]).default_value("pixels").help(
            "Rule for \"object i occludes j\". `pixels`: a hidden pixel of j shows i. `iou`: the IoU of i's visible and \
             j's occlusion mask is above 0.1, as in some of SynTable's notebooks. `stored`: the dataset's own order",
        ))
        .arg(flag("bins").value_parser(["fixed", "equal"]).default_value("fixed").help(
            "Bins of histograms: fixed bins, or ten equal bins from the minimum to the maximum, as in SynTable's figures",
        ))
        .arg(flag("prefixes").action(ArgAction::SetTrue).help(
            "Count components of the first object of each view, of the first two, and so on, as in SynTable's figure",
        ))
        .arg(
            flag("duplicate-levels")
                .value_name("N")
                .value_parser(value_parser!(u8))
                .default_value("5")
                .help("Maximum difference of a cell's luma between near-duplicate views, of 255"),
        )
        .arg(flag("json").action(ArgAction::SetTrue).help("Print all statistics as one JSON object"))
        .arg(
            flag("csv")
                .value_name("FILE")
                .value_parser(value_parser!(PathBuf))
                .help("Write one line per image to a CSV file"),
        )
        .arg(
            flag("overwrite")
                .action(ArgAction::SetTrue)
                .help("Replace the file of --csv even if `stats` did not write it"),
        )
        .arg(arguments::threads("Worker threads. Default: all cores. The statistics do not depend on their number"))
        .after_help(
            "Examples:
  syntable stats data                              tables and histograms
  syntable stats data --csv each.csv --json        for programs; one line per image
  syntable stats ours theirs --labels-only         side by side, with distances between them",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let text = |name: &str| arguments.get_one::<String>(name).map(String::as_str);
    let options = StatisticsOptions {
        labels_only: arguments.get_flag("labels-only"),
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
    let csv = OutputFile { option: "--csv", path: arguments.get_one("csv"), start: b"dataset,image,id," };
    check_outputs(&[csv], &read, arguments.get_flag("overwrite"))?;
    let sources: Vec<Source> =
        datasets.iter().map(|path| arguments::source(path, arguments)).collect::<Result<_, Exit>>()?;
    let (pool, stop) = (
        Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?,
        on_signals(console, Ends::Work("nothing is written"))?,
    );
    let work = ImageWork { workers: &pool, reporter: console.reporter(), stop: &stop };
    let found = compare(registry, &sources, text("format"), &options, &work).map_err(|error| ended(&stop, error))?;
    if let Some(file) = arguments.get_one::<PathBuf>("csv") {
        write_file(file, table::csv(&found.datasets).as_bytes()).map_err(Exit::stopped)?;
    }
    let is_json = arguments.get_flag("json");
    console.print(&if is_json { table::json(&found.datasets) } else { table::text(&found.datasets) })?;
    Exit::if_left_out(found.left_out, read[0], "`syntable validate` lists all faults")
}
