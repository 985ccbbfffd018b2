//! Scores of predictions that pages show next to the labels, from a file written by `syntable eval --save`.

use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::scores::{MetricScores, ScoreTable, ScoredImage};
use syntable_model::error::{Error, Result};
use syntable_model::reader::OpenDataset;

/// Scores of a dataset's predictions.
#[derive(Debug)]
pub struct ReportScores {
    scores: MetricScores,
    /// Images with predictions by their index in the dataset, worst first.
    images: Vec<usize>,
    /// Position in `images` by index.
    places: BTreeMap<usize, usize>,
}

impl ReportScores {
    /// Reads a file of scores of this dataset.
    ///
    /// # Errors
    /// If it cannot be read, or an image in it is not in the dataset.
    pub fn open(path: &Path, dataset: &OpenDataset) -> Result<Self> {
        Self::of(MetricScores::read(path)?, dataset).map_err(|error| error.in_file(path))
    }

    /// Scores of this dataset.
    ///
    /// # Errors
    /// If the dataset lacks a scored image or has additional images.
    pub fn of(scores: MetricScores, dataset: &OpenDataset) -> Result<Self> {
        let named: BTreeMap<&str, usize> =
            dataset.images.iter().enumerate().map(|(index, image)| (image.name.as_str(), index)).collect();
        let index = |image: &ScoredImage| {
            named.get(image.name.as_str()).copied().ok_or_else(|| {
                let example = dataset.images.first().map_or(String::new(), |it| format!(", such as \"{}\"", it.name));
                Error::new(format!("image \"{}\" is not in the dataset", image.name))
                    .help(format!("use scores of this dataset, with its image names{example}"))
            })
        };
        let (scored, there) = (scores.images, dataset.images.len());
        if scored != there {
            let error = Error::new(format!("the file has scores of {scored} images, but the dataset has {there}"));
            return Err(error.help("use scores of this dataset").of_request());
        }
        let images: Vec<usize> = scores.worst.iter().map(index).collect::<Result<_>>()?;
        let places = images.iter().enumerate().map(|(place, image)| (*image, place)).collect();
        Ok(Self { scores, images, places })
    }

    /// The images with predictions, worst first.
    pub fn images(&self) -> &[usize] {
        &self.images
    }

    /// Predictions for an image; `None` if the file has no predictions for it.
    pub fn image(&self, image: usize) -> Option<&ScoredImage> {
        self.scores.worst.get(*self.places.get(&image)?)
    }

    /// Name of the score by which images are ranked.
    pub fn ranked_by(&self) -> &str {
        &self.scores.ranked_by
    }

    /// The score by which an image is ranked.
    pub fn rank(&self, image: usize) -> Option<f64> {
        self.image(image)?.scores.get(&self.scores.ranked_by).copied()
    }

    /// The evaluation as a sentence.
    pub fn says(&self) -> String {
        let of = &self.scores;
        format!(
            "{} predictions of {} objects in {} images, in percent; convention: {}",
            of.predictions, of.objects, of.images, of.convention
        )
    }

    /// The scores as tables.
    pub fn tables(&self) -> Vec<TableView> {
        self.scores.tables.iter().map(TableView::of).collect()
    }
}

/// A table of scores for a page.
#[derive(Debug, Serialize)]
pub struct TableView {
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl TableView {
    fn of(table: &ScoreTable) -> Self {
        let cell = |value: &Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.1}"));
        let row = |(label, values): &(String, Vec<Option<f64>>)| {
            std::iter::once(label.clone()).chain(values.iter().map(cell)).collect()
        };
        Self { headings: table.headings.clone(), rows: table.rows.iter().map(row).collect() }
    }
}
