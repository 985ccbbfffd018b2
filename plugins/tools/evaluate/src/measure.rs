//! Metrics, and how crates add them.

use crate::Convention;
use crate::image::ImagePair;
use std::any::Any;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::inventory;

/// Scores of predictions: the tally of an image, and the scores of all images.
///
/// ```
/// use syntable_evaluate::image::ImagePair;
/// use syntable_evaluate::measure::{Measure, Measurement, Metric};
///
/// /// How many predictions an object has.
/// struct Surplus;
///
/// impl Measure for Surplus {
///     type Tally = [usize; 2];
///
///     fn names(&self) -> Vec<String> {
///         vec!["surplus".into()]
///     }
///
///     fn tally(&self, pair: &ImagePair) -> [usize; 2] {
///         [pair.predictions.len(), pair.labels.len()]
///     }
///
///     fn values(&self, images: &[&[usize; 2]]) -> Vec<Option<f64>> {
///         let [predictions, labels] = [0, 1].map(|of| images.iter().map(|tally| tally[of]).sum::<usize>());
///         vec![(labels > 0).then(|| predictions as f64 / labels as f64)]
///     }
/// }
///
/// syntable_evaluate::register_metric!(Metric {
///     name: "surplus",
///     doc: "Predictions by labels.",
///     build: |_| Measurement::of(Surplus),
///     crate_name: env!("CARGO_PKG_NAME"),
/// });
/// # fn main() {}
/// ```
pub trait Measure: Send + Sync + 'static {
    /// Tally of an image.
    type Tally: Send + Sync;
    /// Names of the scores, in snake case.
    fn names(&self) -> Vec<String>;
    /// Tallies an image.
    fn tally(&self, pair: &ImagePair) -> Self::Tally;
    /// Scores of these images, in the order of their names, as fractions; `None` where a score is undefined. An image
    /// may occur more than once, because confidence intervals use samples with replacement.
    fn values(&self, images: &[&Self::Tally]) -> Vec<Option<f64>>;
}

/// A metric by name. Crates register a [`Metric`]; a program can add one with state
/// ([`EvaluateOptions::more_metrics`](crate::EvaluateOptions::more_metrics)).
pub trait MetricKind: Send + Sync {
    /// Its name, as users write it, in snake case.
    fn name(&self) -> &str;
    /// Description in one sentence.
    fn doc(&self) -> &str;
    /// Builds it for a convention of combining images.
    fn build(&self, convention: Convention) -> Measurement;
    /// The crate or program that provides it, for messages.
    fn owner(&self) -> &str;
}

/// A metric of a crate, without state. Registered with [`register_metric!`](crate::register_metric).
#[derive(Clone, Copy)]
pub struct Metric {
    /// Its name, as users write it, in snake case.
    pub name: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Builds it.
    pub build: fn(Convention) -> Measurement,
    /// Crate that registers it.
    pub crate_name: &'static str,
}

impl MetricKind for Metric {
    fn name(&self) -> &str {
        self.name
    }

    fn doc(&self) -> &str {
        self.doc
    }

    fn build(&self, convention: Convention) -> Measurement {
        (self.build)(convention)
    }

    fn owner(&self) -> &str {
        self.crate_name
    }
}

inventory::collect!(Metric);

/// Registers metrics.
#[macro_export]
macro_rules! register_metric {
    ($($metric:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $metric }
    )+};
}

/// The metrics of all linked crates and `more`, by name.
///
/// # Errors
/// If two metrics have the same name.
pub fn linked(more: &[Arc<dyn MetricKind>]) -> Result<Vec<Arc<dyn MetricKind>>> {
    let of_crates = inventory::iter::<Metric>.into_iter().map(|metric| Arc::new(*metric) as Arc<dyn MetricKind>);
    let mut metrics: Vec<Arc<dyn MetricKind>> = of_crates.chain(more.iter().cloned()).collect();
    metrics.sort_by(|a, b| a.name().cmp(b.name()));
    match metrics.windows(2).find(|pair| pair[0].name() == pair[1].name()) {
        None => Ok(metrics),
        Some(pair) => Err(Error::new(format!(
            "two crates register the metric `{}`: {} and {}",
            pair[0].name(),
            pair[0].owner(),
            pair[1].owner()
        ))
        .help("link only one of them")),
    }
}

/// A metric whose type is erased.
pub struct Measurement(Box<dyn Erased>);

impl Measurement {
    /// Erases the type of a metric.
    pub fn of(measure: impl Measure) -> Self {
        Self(Box::new(measure))
    }
}

type Kept = Box<dyn Any + Send + Sync>;

trait Erased: Send + Sync {
    fn names(&self) -> Vec<String>;
    fn tally(&self, pair: &ImagePair) -> Kept;
    fn values(&self, images: &mut dyn Iterator<Item = &Kept>) -> Vec<Option<f64>>;
}

impl<M: Measure> Erased for M {
    fn names(&self) -> Vec<String> {
        Measure::names(self)
    }

    fn tally(&self, pair: &ImagePair) -> Kept {
        Box::new(Measure::tally(self, pair))
    }

    fn values(&self, images: &mut dyn Iterator<Item = &Kept>) -> Vec<Option<f64>> {
        let tallies: Vec<&M::Tally> = images.filter_map(|tally| tally.downcast_ref()).collect();
        Measure::values(self, &tallies)
    }
}

/// The requested metrics.
pub struct Measures(Vec<Measurement>);

/// Tallies of these metrics for an image.
pub struct Tally(Vec<Kept>);

impl Measures {
    /// The metrics with these names, among the metrics of crates and `more`; all of them if `names` is empty.
    ///
    /// # Errors
    /// If a name is unknown.
    pub fn named(names: &[String], more: &[Arc<dyn MetricKind>], convention: Convention) -> Result<Self> {
        let all = linked(more)?;
        if let Some(name) = names.iter().find(|name| all.iter().all(|it| it.name() != name.as_str())) {
            let known: Vec<&str> = all.iter().map(|it| it.name()).collect();
            return Err(
                Error::new(format!("unknown metric `{name}`")).help(format!("available metrics: {}", known.join(", ")))
            );
        }
        let wanted = all.iter().filter(|it| names.is_empty() || names.iter().any(|name| it.name() == name));
        Ok(Self(wanted.map(|it| it.build(convention)).collect()))
    }

    /// Adds a metric.
    pub fn with(mut self, measurement: Measurement) -> Self {
        self.0.push(measurement);
        self
    }

    /// Names of all scores.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().flat_map(|it| it.0.names()).collect()
    }

    /// Tallies an image.
    pub fn tally(&self, pair: &ImagePair) -> Tally {
        Tally(self.0.iter().map(|it| it.0.tally(pair)).collect())
    }

    /// The scores of these images, in the order of their names.
    pub fn values(&self, images: &[&Tally]) -> Vec<Option<f64>> {
        let of = |(index, it): (usize, &Measurement)| it.0.values(&mut images.iter().map(|image| &image.0[index]));
        self.0.iter().enumerate().flat_map(of).collect()
    }
}

/// Contribution of an image to a score that is the sum of `part` over the sum of `whole`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ratio {
    /// Numerator.
    pub part: f64,
    /// Denominator: 1 in scores that are means over images, 0 for an image without a value.
    pub whole: f64,
}

impl Ratio {
    /// The value of an image in a mean over images.
    pub fn mean(value: f64) -> Self {
        Self { part: value, whole: 1.0 }
    }

    /// A ratio of counts, which are summed over all images first.
    pub fn micro(part: usize, whole: usize) -> Self {
        Self { part: part as f64, whole: whole as f64 }
    }
}

/// A metric of ratios.
pub struct Ratios<const N: usize> {
    /// Names of its scores.
    pub names: [&'static str; N],
    /// Contribution of an image to each score.
    pub of: fn(&ImagePair) -> [Ratio; N],
}

impl<const N: usize> Measure for Ratios<N> {
    type Tally = [Ratio; N];

    fn names(&self) -> Vec<String> {
        self.names.map(str::to_owned).to_vec()
    }

    fn tally(&self, pair: &ImagePair) -> [Ratio; N] {
        (self.of)(pair)
    }

    fn values(&self, images: &[&[Ratio; N]]) -> Vec<Option<f64>> {
        quotients(images).to_vec()
    }
}

/// Sums of parts divided by sums of wholes.
pub fn quotients<const N: usize>(images: &[&[Ratio; N]]) -> [Option<f64>; N] {
    let mut sums = [Ratio::default(); N];
    for image in images {
        for (sum, ratio) in sums.iter_mut().zip(*image) {
            sum.part += ratio.part;
            sum.whole += ratio.whole;
        }
    }
    sums.map(|sum| (sum.whole > 0.0).then(|| sum.part / sum.whole))
}
