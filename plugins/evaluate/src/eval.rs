//! `syntable eval`.

use crate::categories::ByCategory;
use crate::image::{Instance, Occluded, Pair};
use crate::measure::{Measurement, Measures, Tally, linked};
use crate::predictions::{self, Predictions, check_masks, instances};
use crate::results::Results;
use crate::table::{Score, Scored, Table};
use crate::{Convention, bootstrap, worst};
use std::path::{Path, PathBuf};
use syntable_formats::scores::{ScoredImage, Scores};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::reader::{DatasetReader, Source};
use syntable_model::registry::Registry;
use syntable_runtime::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_runtime::cli::{
    Console, Exit, LeftOutReport, Message, TRUST_PATHS, Topic, Verb, amount, check_outputs, dataset_folder,
};
use syntable_runtime::durable::write_file;
use syntable_runtime::images::each;
use syntable_runtime::run::progress::Reporter;
use syntable_runtime::workers::{self, Pool};

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });
syntable_runtime::register_topic!(Topic { name: "metrics", rows });

/// The metrics, for `syntable list`.
fn rows() -> Result<Vec<[String; 3]>> {
    let headings = ["metric", "crate", "what it is"].map(str::to_owned);
    let row = |it: crate::measure::Metric| [it.name, it.crate_name, it.doc].map(str::to_owned);
    Ok(std::iter::once(headings).chain(linked()?.into_iter().map(row)).collect())
}

fn command() -> Command {
    let path = |name: &'static str, what: &'static str| {
        Arg::new(name).long(name).value_name(what).value_parser(value_parser!(PathBuf))
    };
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("eval")
        .about("Score predicted masks against a dataset: overlap, boundary, occlusion and its order")
        .arg(path("gt", "DATASET").required(true).help(
            "Ground truth: folder of a dataset with amodal and visible masks, of any format that can be read, its annotation \
             file, or a folder of label maps",
        ))
        .arg(path("pred", "PREDICTIONS").required(true).help(
            "Predictions: a dataset or label maps of the same images, or a result file: a JSON list of objects with \
             `image_id`, `score`, `segmentation`",
        ))
        .arg(flag("gt-format").value_name("FORMAT").help(
            "Format of the ground truth (see `syntable list formats`, or `label_maps`); the one that it looks like if left \
             out",
        ))
        .arg(flag("pred-format").value_name("FORMAT").help("Format of predictions that are a dataset"))
        .arg(flag("trust-paths").action(ArgAction::SetTrue).help(TRUST_PATHS))
        .arg(
            flag("min-score")
                .value_name("SCORE")
                .allow_negative_numbers(true)
                .value_parser(finite)
                .default_value("0.5")
                .help("Least score of predictions that count; those of a dataset all do, and so do all in COCO's scores"),
        )
        .arg(
            flag("occluded-from")
                .value_name("RATE")
                .allow_negative_numbers(true)
                .value_parser(rate)
                .help(
                    "Least occlusion rate of predictions that count as occluded, 0 for any hidden pixel, as in labels. If left \
                     out, any hidden pixel where predictions have occlusion masks, else 0.05",
                ),
        )
        .arg(flag("convention").value_parser(["release", "paper"]).default_value("release").help(
            "Where SynTable's text and code differ: `release` takes F and F@.75 as means over images, `paper` F of mean \
             precision and recall, and F@.75 of all objects",
        ))
        .arg(
            flag("metrics")
                .value_name("NAMES")
                .value_delimiter(',')
                .help("Metrics, separated by commas (see `syntable list metrics`); all if left out"),
        )
        .arg(
            flag("by-category")
                .action(ArgAction::SetTrue)
                .help("Add COCO's scores with categories: the mean over them, and the AP of each"),
        )
        .arg(
            flag("bootstrap")
                .value_name("N")
                .value_parser(value_parser!(u32).range(1..=100_000))
                .help("Add 95 % confidence intervals of N samples of the images, with replacement"),
        )
        .arg(
            flag("seed")
                .value_name("N")
                .value_parser(value_parser!(u64))
                .default_value("0")
                .help("Seed of the samples of --bootstrap"),
        )
        .arg(flag("json").action(ArgAction::SetTrue).help("Print the scores as one JSON object"))
        .arg(path("csv", "FILE").help("Write the scores of each image to a file"))
        .arg(path("save", "FILE").help(
            "Write all scores, and the worst images with their predictions, to a file that `report --scores` and `view \
             --scores` show",
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
            flag("threads")
                .value_name("N")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Worker threads; all cores if left out. The scores do not depend on it"),
        )
        .after_help(
            "Examples:
  syntable eval --gt data --pred results.json                 a table as in the paper
  syntable eval --gt data --pred results.json --csv each.csv  and a line for each image
  syntable eval --gt data --pred predicted --json             a dataset of predictions; for programs
  syntable eval --gt data --pred results.json --metrics coco --bootstrap 1000
  syntable eval --gt data --pred results.json --save scores.json
  syntable report data --scores scores.json                   the worst images with their predictions",
        )
}

fn run(console: &Console, _: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let path = |name: &str| arguments.get_one::<PathBuf>(name);
    let text = |name: &str| arguments.get_one::<String>(name).map(String::as_str);
    let (Some(gt), Some(pred)) = (path("gt"), path("pred")) else { return Ok(()) };
    let read = [dataset_folder(gt), if Results::is_one(pred) { pred.clone() } else { dataset_folder(pred) }];
    check_outputs(&[("--csv", path("csv")), ("--save", path("save"))], &read.each_ref().map(PathBuf::as_path))?;
    let convention = if text("convention") == Some("paper") { Convention::Paper } else { Convention::Release };
    let least = arguments.get_one("min-score").copied().unwrap_or(0.5);
    let occluded = arguments.get_one("occluded-from").copied().map_or(Occluded::AsSaid, Occluded::From);
    let threads = arguments.get_one::<u16>("threads").map_or_else(workers::available, |threads| usize::from(*threads));
    let names: Vec<String> = arguments.get_many::<String>("metrics").into_iter().flatten().cloned().collect();
    let mut measures = Measures::named(&names, convention).map_err(Exit::stopped)?;
    if arguments.get_flag("by-category") && !names.is_empty() && !names.iter().any(|name| name == "coco") {
        let error = Error::new("--by-category adds to the metric `coco`, which --metrics leaves out");
        return Err(Exit::wrong(error.help("name `coco` with --metrics, too, or leave --by-category out")));
    }
    let trusts = arguments.get_flag("trust-paths");
    let source = |path: &PathBuf| Source::new(path).trusting(trusts);
    let (format, truth) = predictions::open(&source(gt), text("gt-format")).map_err(Exit::stopped)?;
    let opened = check_masks(&*truth, gt)
        .and_then(|()| check_images(&*truth, gt))
        .and_then(|()| Predictions::open(&source(pred), text("pred-format"), least, (gt, &*truth)));
    let (pred_format, predictions) = opened.map_err(Exit::stopped)?;
    let by_category = arguments.get_flag("by-category").then(|| ByCategory::new(truth.info().categories()));
    let categories = by_category.iter().flat_map(ByCategory::words).map(str::to_owned).collect();
    if let Some(by_category) = by_category {
        measures = measures.with(Measurement::of(by_category));
    }
    let (rank, ranked_by) = worst::ranked_by(&measures, text("worst-by")).map_err(Exit::stopped)?;
    let pool = Pool::new(threads).map_err(Exit::stopped)?;
    let needs_category = arguments.get_flag("by-category");
    let evaluation =
        Evaluation { truth: &*truth, predictions: &predictions, pred, measures: &measures, occluded, needs_category };
    let images = evaluation.images(&pool, console.reporter()).map_err(Exit::stopped)?;
    let samples = arguments.get_one::<u32>("bootstrap").copied();
    let seed = arguments.get_one("seed").copied().unwrap_or_default();
    let tallies: Vec<&Tally> = ranked(&*truth, &images);
    let intervals = samples.map(|samples| bootstrap::intervals(&measures, &tallies, samples as usize, seed, &pool));
    let scores = measures.names().into_iter().zip(measures.values(&tallies)).enumerate();
    let scores = scores.map(|(index, (name, value))| {
        let interval = intervals.as_ref().and_then(|it| it.get(index).copied().flatten());
        Score { name, value, interval }
    });
    let scores = scores.collect();
    let has_intervals = samples.is_some();
    let table = Table { images: &images, convention, measures: &measures, scores, has_intervals, categories };
    if let Some(file) = path("csv") {
        let csv = table.csv(|image| &truth.images()[image].name);
        write_file(file, csv.as_bytes()).map_err(Exit::stopped)?;
    }
    if let Some(file) = path("save") {
        let most = arguments.get_one::<usize>("worst").copied().unwrap_or(usize::MAX);
        let lowest = worst::lowest(&measures, &images, rank, most);
        let found = evaluation.worst(&lowest, &pool, console.reporter()).map_err(Exit::stopped)?;
        if text("worst-by").is_none() && ranked_by != worst::RANKED_BY {
            let error = Error::new(format!("the worst images are those of the lowest `{ranked_by}`"));
            let help = format!("--metrics leaves `{}` out; --worst-by chooses another score", worst::RANKED_BY);
            console.say(&Message::Warning(error.help(help)));
        }
        let scores = Scores { ranked_by, worst: found, ..table.saved() };
        write_file(file, scores.text().as_bytes()).map_err(Exit::stopped)?;
    }
    console.print(&match arguments.get_flag("json") {
        true => format!("{:#}\n", table.json()),
        false => format!("{}read as: {format} and {pred_format}\n", table.text()),
    })?;
    let mut left_out = LeftOutReport::default();
    left_out.unlisted(&*truth);
    if let Predictions::Dataset(dataset, ..) = &predictions {
        left_out.unlisted(&**dataset);
    }
    left_out.end(gt, "`syntable validate` lists all that is wrong")
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

/// What is kept of the images, by their numbers in the annotation file as far as they have some: the order in which COCO's tools
/// rank equal scores.
fn ranked<'a>(truth: &dyn DatasetReader, images: &'a [Scored]) -> Vec<&'a Tally> {
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by_key(|image| truth.images()[*image].id);
    order.into_iter().map(|image| &images[image].tally).collect()
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
    measures: &'a Measures,
    occluded: Occluded,
    /// Whether predictions must have categories.
    needs_category: bool,
}

impl Evaluation<'_> {
    /// Scores all images, in order. Of errors comes that of the first image.
    fn images(&self, workers: &dyn Workers, reporter: &dyn Reporter) -> Result<Vec<Scored>> {
        let mut scored = Vec::with_capacity(self.truth.images().len());
        let images = self.truth.images().len();
        each((workers, reporter), "scored", images, &|image| self.image(image), &mut |_, it| scored.push(it))?;
        Ok(scored)
    }

    /// Images with their scores and predictions.
    fn worst(&self, images: &[usize], workers: &dyn Workers, reporter: &dyn Reporter) -> Result<Vec<ScoredImage>> {
        let mut found = Vec::with_capacity(images.len());
        let scored = |index: usize| {
            let image = images[index];
            let (pair, size) = self.pair(image)?;
            Ok(worst::scored(self.measures, &self.truth.images()[image].name, size, &pair))
        };
        each((workers, reporter), "saved", images.len(), &scored, &mut |_, it| found.push(it))?;
        Ok(found)
    }

    fn image(&self, image: usize) -> Result<Scored> {
        let (pair, _) = self.pair(image)?;
        let (objects, predictions) = (pair.labels.len(), pair.predictions.len());
        Ok(Scored { objects, predictions, tally: self.measures.tally(&pair) })
    }

    /// Labels and predictions of an image, and its size.
    fn pair(&self, image: usize) -> Result<(Pair, [u32; 2])> {
        let name = || format!("image \"{}\"", self.truth.images()[image].name);
        let (labels, size) =
            instances(self.truth, image, Instance::labeled_with).map_err(|error| error.context(name()))?;
        let predictions = self.predictions.instances(image, size, self.occluded);
        let [likely, unlikely] = predictions.map_err(|error| error.in_file(self.pred).context(name()))?;
        if self.needs_category && likely.iter().chain(&unlikely).any(|it| it.category.is_none()) {
            return Err(Error::new("a prediction has no category of the ground truth")
                .in_file(self.pred)
                .help("predict the `category_id` that the annotation file of the ground truth has, or leave --by-category out")
                .permanent()
                .context(name()));
        }
        let crowds = self.truth.crowds(image).map_err(|error| error.context(name()))?;
        let pair = Pair::new(labels, likely).and_then(|pair| pair.with(unlikely, crowds));
        Ok((pair.map_err(|error| error.in_file(self.pred).context(name()))?, size))
    }
}
