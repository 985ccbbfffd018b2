//! Scores predictions against a dataset: from paths and options to scores, tables and the worst images.

use crate::categories::ByCategory;
use crate::image::ImagePair;
use crate::masked_object::{MaskedObject, Occluded};
use crate::measure::{Measurement, Measures, MetricKind, Tally};
use crate::memory::{Detection, Detections};
use crate::predictions::{self, Predictions, check_masks, instances};
use crate::table::{EvaluatedImage, EvaluationTable, Score};
use crate::{Convention, bootstrap, worst};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_formats::scores::{MetricScores, ScoredImage};
use syntable_model::error::{Error, Result};
use syntable_model::reader::{OpenDataset, Source};
use syntable_model::registry::Registry;
use syntable_runtime::images::{ImageWork, each};
use syntable_runtime::left_out::LeftOutReport;

/// Inputs and options of an evaluation.
#[derive(Clone)]
pub struct EvaluateOptions {
    /// Ground truth: a dataset of any format that can be read, or a folder of label maps.
    pub truth: Source,
    /// Format of the ground truth; `None` detects it.
    pub truth_format: Option<String>,
    /// Predictions: a dataset or label maps of the same images, or a result file.
    pub predictions: Source,
    /// Format of the predictions if they are a dataset; `None` detects it.
    pub predictions_format: Option<String>,
    /// Minimum confidence of predictions. Ignored for COCO's scores, and for predictions from a dataset, which have
    /// none.
    pub min_score: f64,
    /// Minimum occlusion rate of a prediction that counts as occluded.
    pub occluded: Occluded,
    /// How images are combined.
    pub convention: Convention,
    /// Names of metrics; all if empty.
    pub metrics: Vec<String>,
    /// Metrics in addition to the metrics of linked crates.
    pub more_metrics: Vec<Arc<dyn MetricKind>>,
    /// Whether COCO's scores with categories are added.
    pub by_category: bool,
    /// Number of samples of the images for 95 % confidence intervals; `None` computes no intervals.
    pub bootstrap: Option<u32>,
    /// Seed of these samples.
    pub seed: u64,
    /// Score that ranks the worst images; `None` uses [`worst::RANKED_BY`], or else the first score.
    pub rank_by: Option<String>,
}

impl EvaluateOptions {
    /// All metrics, with the conventions of SynTable's release.
    pub fn new(truth: Source, predictions: Source) -> Self {
        Self {
            truth,
            truth_format: None,
            predictions,
            predictions_format: None,
            min_score: 0.5,
            occluded: Occluded::AsSaid,
            convention: Convention::Release,
            metrics: Vec::new(),
            more_metrics: Vec::new(),
            by_category: false,
            bootstrap: None,
            seed: 0,
            rank_by: None,
        }
    }
}

/// Evaluated predictions. Holds the metrics' tally of each image, and reads masks again for the worst images.
pub struct Evaluation {
    pair: Paired,
    /// The detected or given formats of ground truth and predictions.
    pub formats: [&'static str; 2],
    convention: Convention,
    images: Vec<EvaluatedImage>,
    scores: Vec<Score>,
    has_intervals: bool,
    categories: Vec<String>,
    rank: (usize, String),
}

/// Scores predictions.
///
/// # Errors
/// If a name is unknown, masks that the metrics need are missing, a file cannot be read, or the work was stopped.
pub fn evaluate(registry: &Registry, options: &EvaluateOptions, work: &ImageWork) -> Result<Evaluation> {
    evaluate_with(registry, options, work, |truth| {
        let (pred, format) = (&options.predictions, options.predictions_format.as_deref());
        Predictions::open(registry, pred, format, options.min_score, (&options.truth.path, truth))
    })
}

/// Scores predictions in memory. The options' predictions name them in messages.
///
/// # Errors
/// As [`evaluate`], and if a prediction belongs to no image.
pub fn evaluate_detections(
    registry: &Registry,
    options: &EvaluateOptions,
    detections: Vec<Detection>,
    work: &ImageWork,
) -> Result<Evaluation> {
    evaluate_with(registry, options, work, |truth| {
        let detections = Detections::new(detections, options.min_score, truth)?;
        Ok(("memory", Predictions::Memory(detections)))
    })
}

fn evaluate_with(
    registry: &Registry,
    options: &EvaluateOptions,
    work: &ImageWork,
    predicted: impl FnOnce(&OpenDataset) -> Result<(&'static str, Predictions)>,
) -> Result<Evaluation> {
    let EvaluateOptions { truth: gt, predictions: pred, .. } = options;
    let mut measures = Measures::named(&options.metrics, &options.more_metrics, options.convention)?;
    if options.by_category && !options.metrics.is_empty() && !options.metrics.iter().any(|name| name == "coco") {
        let error = Error::new("`options.by_category` adds to the metric `coco`, which `options.metrics` omits");
        return Err(error.help("add `coco` to `options.metrics`, or leave `options.by_category` out").of_request());
    }
    let (format, truth) = predictions::open(registry, gt, options.truth_format.as_deref())?;
    check_masks(&truth, &gt.path)?;
    if truth.images.is_empty() {
        return Err(Error::new("the dataset has no image").in_file(&gt.path));
    }
    let (predictions_format, predictions) = predicted(&truth)?;
    let by_category = options.by_category.then(|| ByCategory::new(truth.info.categories()));
    let categories = by_category.iter().flat_map(ByCategory::words).map(str::to_owned).collect();
    if let Some(by_category) = by_category {
        measures = measures.with(Measurement::of(by_category));
    }
    let rank = worst::ranked_by(&measures, options.rank_by.as_deref())?;
    let (occluded, needs_category) = (options.occluded, options.by_category);
    let pair = Paired { truth, predictions, predictions_at: pred.path.clone(), measures, occluded, needs_category };
    let mut images = Vec::with_capacity(pair.truth.images.len());
    each(work, "scored", pair.truth.images.len(), &|image| pair.scored(image), &mut |_, it| images.push(it))?;
    let tallies = ranked(&pair.truth, &images);
    let intervals = options
        .bootstrap
        .map(|samples| bootstrap::intervals(&pair.measures, &tallies, samples as usize, options.seed, work.workers));
    let values = pair.measures.names().into_iter().zip(pair.measures.values(&tallies)).enumerate();
    let scores = values.map(|(index, (name, value))| {
        let interval = intervals.as_ref().and_then(|it| it.get(index).copied().flatten());
        Score { name, value, interval }
    });
    let scores = scores.collect();
    Ok(Evaluation {
        pair,
        formats: [format, predictions_format],
        convention: options.convention,
        images,
        scores,
        has_intervals: options.bootstrap.is_some(),
        categories,
        rank,
    })
}

impl Evaluation {
    /// All scores of the dataset.
    pub fn scores(&self) -> &[Score] {
        &self.scores
    }

    /// A score of the dataset by name, as a fraction; `None` if it is undefined, or unknown to the metrics.
    pub fn score(&self, name: &str) -> Option<f64> {
        self.scores.iter().find(|it| it.name == name)?.value
    }

    /// The scores as text and JSON.
    pub fn table(&self) -> EvaluationTable<'_> {
        EvaluationTable {
            images: &self.images,
            convention: self.convention,
            measures: &self.pair.measures,
            scores: self.scores.clone(),
            has_intervals: self.has_intervals,
            categories: self.categories.clone(),
        }
    }

    /// A line of scores for each image, as CSV.
    pub fn csv(&self) -> String {
        self.table().csv(|image| &self.pair.truth.images[image].name)
    }

    /// Name of the score that ranks the worst images.
    pub fn ranked_by(&self) -> &str {
        &self.rank.1
    }

    /// All scores, and at most `most` worst images with their predictions, for `syntable report --scores`.
    ///
    /// # Errors
    /// If a file cannot be read, or the work was stopped.
    pub fn with_worst(&self, most: usize, work: &ImageWork) -> Result<MetricScores> {
        let lowest = worst::lowest(&self.pair.measures, &self.images, self.rank.0, most);
        let mut found: Vec<ScoredImage> = Vec::with_capacity(lowest.len());
        let image = |place: usize| self.pair.scored_image(lowest[place]);
        each(work, "saved", lowest.len(), &image, &mut |_, it| found.push(it))?;
        Ok(MetricScores { ranked_by: self.rank.1.clone(), worst: found, ..self.table().saved() })
    }

    /// Unreadable images, which were not scored.
    pub fn left_out(&self) -> LeftOutReport {
        let mut report = LeftOutReport::default();
        report.unlisted(&self.pair.truth);
        if let Predictions::Dataset(dataset, ..) = &self.pair.predictions {
            report.unlisted(dataset);
        }
        report
    }
}

/// Tallies of the images in the order of their ids in the annotation file, if they have ids. COCO's tools rank equal
/// scores in this order.
fn ranked<'a>(truth: &OpenDataset, images: &'a [EvaluatedImage]) -> Vec<&'a Tally> {
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by_key(|image| truth.images[*image].id);
    order.into_iter().map(|image| &images[image].tally).collect()
}

/// Ground truth with the predictions of its images.
struct Paired {
    truth: OpenDataset,
    predictions: Predictions,
    predictions_at: PathBuf,
    measures: Measures,
    occluded: Occluded,
    /// Whether predictions must have categories.
    needs_category: bool,
}

impl Paired {
    fn scored(&self, image: usize) -> Result<EvaluatedImage> {
        let (pair, _) = self.pair(image)?;
        let (objects, predictions) = (pair.labels.len(), pair.predictions.len());
        Ok(EvaluatedImage { objects, predictions, tally: self.measures.tally(&pair) })
    }

    fn scored_image(&self, image: usize) -> Result<ScoredImage> {
        let (pair, size) = self.pair(image)?;
        Ok(worst::scored(&self.measures, &self.truth.images[image].name, size, &pair))
    }

    /// Labels and predictions of an image, and its size.
    fn pair(&self, image: usize) -> Result<(ImagePair, [u32; 2])> {
        let name = || format!("image \"{}\"", self.truth.images[image].name);
        let (labels, size) =
            instances(&self.truth, image, MaskedObject::labeled_with).map_err(|error| error.context(name()))?;
        let predictions = self.predictions.instances(image, size, self.occluded);
        let [likely, unlikely] = predictions.map_err(|error| error.in_file(&self.predictions_at).context(name()))?;
        if self.needs_category && likely.iter().chain(&unlikely).any(|it| it.category.is_none()) {
            return Err(Error::new("a prediction has no category of the ground truth")
                .in_file(&self.predictions_at)
                .help(
                    "predict a `category_id` of the ground truth's annotation file, or leave `options.by_category` out",
                )
                .context(name()));
        }
        let crowds = self.truth.crowds(image).map_err(|error| error.context(name()))?;
        let pair = ImagePair::new(labels, likely).and_then(|pair| pair.with(unlikely, crowds));
        Ok((pair.map_err(|error| error.in_file(&self.predictions_at).context(name()))?, size))
    }
}
