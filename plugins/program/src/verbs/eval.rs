//! `syntable eval`.

use std::path::PathBuf;
use std::sync::Arc;
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_cli::{
    Console, Ends, Exit, Message, OutputFile, TRUST_PATHS, Topic, Verb, amount, check_outputs, ended, on_signals,
    threads,
};
use syntable_evaluate::masked_object::Occluded;
use syntable_evaluate::measure::{MetricKind, linked};
use syntable_evaluate::results::ResultFile;
use syntable_evaluate::{Convention, EvaluateOptions, evaluate, worst};
use syntable_model::error::{Error, Result};
use syntable_model::reader::Source;
use syntable_model::registry::Registry;
use syntable_runtime::durable::write_file;
use syntable_runtime::images::ImageWork;
use syntable_runtime::paths::dataset_folder;
use syntable_runtime::workers::Pool;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });
syntable_cli::register_topic!(Topic { name: "metrics", rows });

/// The metrics, for `syntable list`.
fn rows() -> Result<Vec<[String; 3]>> {
    let headings = ["metric", "crate", "description"].map(str::to_owned);
    let row = |it: Arc<dyn MetricKind>| [it.name(), it.owner(), it.doc()].map(str::to_owned);
    Ok(std::iter::once(headings).chain(linked(&[])?.into_iter().map(row)).collect())
}

fn command() -> Command {
    let path = |name: &'static str, what: &'static str| {
        Arg::new(name).long(name).value_name(what).value_parser(value_parser!(PathBuf))
    };
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("eval")
        .about("Score predicted masks against a dataset: overlap, boundary, occlusion and its order")
        .arg(path("gt", "DATASET").required(true).help(
            "Ground truth: folder of a dataset with amodal and visible masks in any readable format, its annotation file, or \
             a folder of label maps",
        ))
        .arg(path("pred", "PREDICTIONS").required(true).help(
            "Predictions: a dataset or label maps of the same images, or a result file (a JSON list of objects with \
             `image_id`, `score`, `segmentation`)",
        ))
        .arg(flag("gt-format").value_name("FORMAT").help(
            "Format of the ground truth: `label_maps`, or a name from `syntable list formats`. Default: detected",
        ))
        .arg(flag("pred-format").value_name("FORMAT").help("Format of the predictions if they are a dataset"))
        .arg(flag("trust-paths").action(ArgAction::SetTrue).help(TRUST_PATHS))
        .arg(
            flag("min-score")
                .value_name("SCORE")
                .allow_negative_numbers(true)
                .value_parser(finite)
                .default_value("0.5")
                .help("Minimum score of a prediction in a result file. COCO's scores use all predictions"),
        )
        .arg(
            flag("occluded-from")
                .value_name("RATE")
                .allow_negative_numbers(true)
                .value_parser(rate)
                .help(
                    "Minimum occlusion rate of an occluded prediction; 0 for any hidden pixel, as in labels. Default: any \
                     hidden pixel if predictions have occlusion masks, else 0.05",
                ),
        )
        .arg(flag("convention").value_parser(["release", "paper"]).default_value("release").help(
            "Convention where SynTable's paper and code differ. `release`: F and F@.75 are means over images. `paper`: F \
             is computed from mean precision and recall, and F@.75 over all objects",
        ))
        .arg(
            flag("metrics")
                .value_name("NAMES")
                .value_delimiter(',')
                .help("Metrics, separated by commas (see `syntable list metrics`). Default: all"),
        )
        .arg(
            flag("by-category")
                .action(ArgAction::SetTrue)
                .help("Add COCO's scores with categories: the mean over categories, and the AP of each category"),
        )
        .arg(
            flag("bootstrap")
                .value_name("N")
                .value_parser(value_parser!(u32).range(1..=100_000))
                .help("Add 95 % confidence intervals from N samples of the images, drawn with replacement"),
        )
        .arg(
            flag("seed")
                .value_name("N")
                .value_parser(value_parser!(u64))
                .default_value("0")
                .help("Seed of the samples of --bootstrap"),
        )
        .arg(flag("json").action(ArgAction::SetTrue).help("Print the scores as one JSON object"))
        .arg(path("csv", "FILE").help("Write the scores of each image to a CSV file"))
        .arg(path("save", "FILE").help(
            "Write all scores, and the worst images with their predictions, to a file for `report --scores` and `view \
             --scores`",
        ))
        .arg(
            flag("worst")
                .value_name("N")
                .value_parser(amount)
                .default_value("24")
                .requires("save")
                .help("Number of worst images in the file of --save, or `all`"),
        )
        .arg(
            flag("worst-by")
                .value_name("SCORE")
                .requires("save")
                .help("Score by which images are the worst, as --json names it [default: amodal_overlap_f]"),
        )
        .arg(
            flag("overwrite")
                .action(ArgAction::SetTrue)
                .help("Replace the files of --csv and --save even if `eval` did not write them"),
        )
        .arg(
            flag("threads")
                .value_name("N")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Worker threads. Default: all cores. The scores do not depend on their number"),
        )
        .after_help(
            "Examples:
  syntable eval --gt data --pred results.json                 a table like the paper's
  syntable eval --gt data --pred results.json --csv each.csv  also one line per image
  syntable eval --gt data --pred predicted --json             predictions in a dataset; output for programs
  syntable eval --gt data --pred results.json --metrics coco --bootstrap 1000
  syntable eval --gt data --pred results.json --save scores.json
  syntable report data --scores scores.json                   the worst images with their predictions",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> std::result::Result<(), Exit> {
    let path = |name: &str| arguments.get_one::<PathBuf>(name);
    let text = |name: &str| arguments.get_one::<String>(name);
    let (Some(gt), Some(pred)) = (path("gt"), path("pred")) else { return Ok(()) };
    let read = [
        dataset_folder(registry, gt),
        if ResultFile::is_one(pred) { pred.clone() } else { dataset_folder(registry, pred) },
    ];
    let outputs = [
        OutputFile { option: "--csv", path: path("csv"), start: b"image,objects,predictions" },
        OutputFile { option: "--save", path: path("save"), start: b"{\"images\":" },
    ];
    check_outputs(&outputs, &read.each_ref().map(PathBuf::as_path), arguments.get_flag("overwrite"))?;
    let is_paper = text("convention").is_some_and(|name| name == Convention::Paper.name());
    let source = |path: &PathBuf| {
        let source = Source::at_name(path, None).map_err(Exit::stopped)?;
        Ok(source.trusting(arguments.get_flag("trust-paths")))
    };
    let defaults = EvaluateOptions::new(source(gt)?, source(pred)?);
    let options = EvaluateOptions {
        truth_format: text("gt-format").cloned(),
        predictions_format: text("pred-format").cloned(),
        min_score: arguments.get_one("min-score").copied().unwrap_or(defaults.min_score),
        occluded: arguments.get_one("occluded-from").copied().map_or(defaults.occluded, Occluded::From),
        convention: if is_paper { Convention::Paper } else { Convention::Release },
        metrics: arguments.get_many::<String>("metrics").into_iter().flatten().cloned().collect(),
        by_category: arguments.get_flag("by-category"),
        bootstrap: arguments.get_one::<u32>("bootstrap").copied(),
        seed: arguments.get_one("seed").copied().unwrap_or_default(),
        rank_by: text("worst-by").cloned(),
        ..defaults
    };
    let pool = Pool::new(threads(arguments.get_one("threads").copied())).map_err(Exit::stopped)?;
    let stop = on_signals(console, Ends::Work("nothing is written"))?;
    let work = ImageWork { workers: &pool, reporter: console.reporter(), stop: &stop };
    let found = evaluate(registry, &options, &work).map_err(|error| ended(&stop, error))?;
    if let Some(file) = path("csv") {
        write_file(file, found.csv().as_bytes()).map_err(Exit::stopped)?;
    }
    if let Some(file) = path("save") {
        let most = arguments.get_one::<usize>("worst").copied().unwrap_or(usize::MAX);
        let scores = found.with_worst(most, &work).map_err(|error| ended(&stop, error))?;
        if options.rank_by.is_none() && found.ranked_by() != worst::RANKED_BY {
            let error = Error::new(format!("the worst images have the lowest `{}`", found.ranked_by()));
            let help = format!("--metrics omits `{}`; --worst-by chooses another score", worst::RANKED_BY);
            console.say(&Message::Warning(error.help(help)));
        }
        write_file(file, scores.text().as_bytes()).map_err(Exit::stopped)?;
    }
    let (table, [format, pred_format]) = (found.table(), found.formats);
    console.print(&match arguments.get_flag("json") {
        true => format!("{:#}\n", table.json()),
        false => format!("{}read as: {format} and {pred_format}\n", table.text()),
    })?;
    Exit::if_left_out(found.left_out(), gt, "`syntable validate` lists all faults")
}

/// A score that can be compared with others.
fn finite(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|score: &f64| score.is_finite()).ok_or_else(|| "a number, such as 0.5".to_owned())
}

/// A share of an object.
fn rate(text: &str) -> std::result::Result<f64, String> {
    finite(text)
        .ok()
        .filter(|rate| (0.0..=1.0).contains(rate))
        .ok_or_else(|| "a rate from 0 to 1, such as 0.05".to_owned())
}
