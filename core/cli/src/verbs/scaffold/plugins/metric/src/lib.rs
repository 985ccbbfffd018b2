//! Metric `count_error`: the error in the number of predicted objects.

use syntable_evaluate::image::ImagePair;
use syntable_evaluate::measure::{Measure, Measurement, Metric};

/// Mean over the images of the absolute difference between the numbers of predictions and of labels.
pub struct CountError;

impl Measure for CountError {
    /// The difference in one image.
    type Tally = usize;

    fn names(&self) -> Vec<String> {
        vec!["count_error".into()]
    }

    fn tally(&self, pair: &ImagePair) -> usize {
        pair.predictions.len().abs_diff(pair.labels.len())
    }

    fn values(&self, images: &[&usize]) -> Vec<Option<f64>> {
        let sum: usize = images.iter().copied().sum();
        // Without images, the metric has no value.
        vec![(!images.is_empty()).then(|| sum as f64 / images.len() as f64)]
    }
}

syntable_evaluate::register_metric!(Metric {
    name: "count_error",
    doc: "Mean difference between the numbers of predicted and of labeled objects.",
    build: |_| Measurement::of(CountError),
    crate_name: env!("CARGO_PKG_NAME"),
});
