//! `syntable eval`.

use crate::image::{Instance, OCCLUDED_FROM, Pair};
use crate::predictions::{Predictions, check_masks, instances};
use crate::table::{Scored, Table};
use crate::{Convention, dataset, score};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::reader::{self, DatasetReader};
use syntable_model::registry::Registry;
use syntable_runtime::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_runtime::cli::{Console, Exit, Verb};
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::workers::{self, Pool};

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

/// How often the number of scored images is told.
const PATIENCE: Duration = Duration::from_secs(1);

fn command() -> Command {
    let path = |name: &'static str, what: &'static str| {
        Arg::new(name).long(name).value_name(what).value_parser(value_parser!(PathBuf))
    };
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("eval")
        .about("Score predicted masks against a dataset: overlap, boundary, occlusion and its order")
        .arg(path("gt", "DATASET").required(true).help(
            "Ground truth: folder of a dataset with amodal and visible masks, of any format that can be read, or its \
             annotation file",
        ))
        .arg(path("pred", "PREDICTIONS").required(true).help(
            "Predictions: a dataset of the same images, or a result file: a JSON list of objects with `image_id`, `score`, \
             `segmentation`",
        ))
        .arg(flag("gt-format").value_name("FORMAT").help(
            "Format of the ground truth (see `syntable list formats`); the one that it looks like if left out",
        ))
        .arg(flag("pred-format").value_name("FORMAT").help("Format of predictions that are a dataset"))
        .arg(
            flag("min-score")
                .value_name("SCORE")
                .value_parser(value_parser!(f64))
                .default_value("0.5")
                .help("Least score of predictions that count; those of a dataset all do"),
        )
        .arg(
            flag("occluded-from")
                .value_name("RATE")
                .value_parser(value_parser!(f64))
                .default_value("0.05")
                .help("Least occlusion rate of predictions that count as occluded; 0 for any hidden pixel, as in labels"),
        )
        .arg(flag("convention").value_parser(["release", "paper"]).default_value("release").help(
            "Where SynTable's text and code differ: `release` takes F and F@.75 as means over images, `paper` F of mean \
             precision and recall, and F@.75 of all objects",
        ))
        .arg(flag("json").action(ArgAction::SetTrue).help("Print the scores as one JSON object"))
        .arg(path("csv", "FILE").help("Write the scores of each image to a file"))
        .arg(
            flag("threads")
                .value_name("N")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Worker threads; all cores if left out. The scores do not depend on it"),
        )
        .after_help(
            "Examples:
  syntable eval --gt data --pred results.json                 a table as in the paper
  syntable eval --gt data --pred results.json --csv each.csv  and a line for each image
  syntable eval --gt data --pred predicted --json             a dataset of predictions; for programs",
        )
}

fn run(console: &Console, _: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let path = |name: &str| arguments.get_one::<PathBuf>(name);
    let text = |name: &str| arguments.get_one::<String>(name).map(String::as_str);
    let (Some(gt), Some(pred)) = (path("gt"), path("pred")) else { return Ok(()) };
    let convention = if text("convention") == Some("paper") { Convention::Paper } else { Convention::Release };
    let least = arguments.get_one("min-score").copied().unwrap_or(0.5);
    let occluded_from = arguments.get_one("occluded-from").copied().unwrap_or(OCCLUDED_FROM);
    let threads = arguments.get_one::<u16>("threads").map_or_else(workers::available, |threads| usize::from(*threads));
    let (format, truth) = reader::open(gt, text("gt-format")).map_err(Exit::stopped)?;
    let opened = check_masks(&*truth, gt)
        .and_then(|()| check_images(&*truth, gt))
        .and_then(|()| Predictions::open(pred, text("pred-format"), least, (gt, truth.images())));
    let (pred_format, predictions) = opened.map_err(Exit::stopped)?;
    let evaluation = Evaluation { truth: &*truth, predictions: &predictions, pred, convention, occluded_from };
    let images = evaluation.images(threads, console.reporter()).map_err(Exit::stopped)?;
    let ratios: Vec<_> = images.iter().map(|image| image.ratios.clone()).collect();
    let table = Table { images: &images, convention, scores: dataset(&ratios, convention) };
    if let Some(file) = path("csv") {
        let csv = table.csv(|image| &truth.images()[image].name);
        std::fs::write(file, csv).map_err(|error| Exit::stopped(Error::io(file, &error)))?;
    }
    if arguments.get_flag("json") {
        return console.print(&format!("{:#}\n", table.json()));
    }
    console.print(&format!("{}read as: {} and {pred_format}\n", table.text(), format.name))
}

fn check_images(truth: &dyn DatasetReader, path: &Path) -> Result<()> {
    if truth.images().is_empty() {
        return Err(Error::new("the dataset has no image").in_file(path).permanent());
    }
    Ok(())
}

struct Evaluation<'a> {
    truth: &'a dyn DatasetReader,
    predictions: &'a Predictions,
    pred: &'a Path,
    convention: Convention,
    occluded_from: f64,
}

impl Evaluation<'_> {
    /// Scores all images, in order. Of errors comes that of the first image.
    fn images(&self, threads: usize, reporter: &dyn Reporter) -> Result<Vec<Scored>> {
        let images = self.truth.images().len();
        let state = Mutex::new(State { scored: vec![None; images], done: 0, said: Instant::now() });
        Pool::new(threads)?.run(images, &|image| {
            let scored = self.image(image);
            let Ok(mut state) = state.lock() else { return };
            state.scored[image] = Some(scored);
            state.done += 1;
            if state.said.elapsed() > PATIENCE {
                state.said = Instant::now();
                reporter.event(&Event::Working { step: format!("scored {} of {images} images", state.done) });
            }
        });
        let state = state.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        state.scored.into_iter().flatten().collect()
    }

    fn image(&self, image: usize) -> Result<Scored> {
        let name = || format!("image \"{}\"", self.truth.images()[image].name);
        let (labels, size) = instances(self.truth, image, Instance::labeled).map_err(|error| error.context(name()))?;
        let predictions = self.predictions.instances(image, size, self.occluded_from);
        let predictions = predictions.map_err(|error| error.in_file(self.pred).context(name()))?;
        let (objects, predicted) = (labels.len(), predictions.len());
        let pair = Pair::new(labels, predictions).map_err(|error| error.in_file(self.pred).context(name()))?;
        Ok(Scored { objects, predictions: predicted, ratios: score(&pair, self.convention) })
    }
}

struct State {
    scored: Vec<Option<Result<Scored>>>,
    done: usize,
    said: Instant,
}
