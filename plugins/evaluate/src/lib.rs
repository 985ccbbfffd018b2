//! Scores of predicted masks against the labels of a dataset, with the conventions of SynTable's released evaluation.
//!
//! | module | holds |
//! | --- | --- |
//! | [`image`] | the objects of an image, labeled and predicted |
//! | [`matching`] | which prediction stands for which object |
//! | [`boundary`] | boundary maps and how many pixels of them lie near another |
//! | [`masks`] | Overlap and Boundary P, R, F and F@.75 of amodal, visible and invisible masks |
//! | [`predictions`], [`results`] | what is compared: datasets, and result files of detectors |
//! | [`table`] | scores as text, JSON and CSV |
//! | [`occlusion`] | ACC_O and F_O, ACC_OO by the paper and by the release, scores of edges |
//!
//! Every score is a ratio of two sums over images ([`Ratio`]), so that only those are kept of an image.

pub mod boundary;
mod eval;
pub mod image;
pub mod masks;
pub mod matching;
pub mod occlusion;
pub mod predictions;
pub mod results;
pub mod table;

use image::Pair;

/// What an image adds to a score: the score of a dataset is the sum of `part` over the sum of `whole`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// Name of the score, in snake case.
    pub name: &'static str,
    /// What counts.
    pub part: f64,
    /// Out of what. 1 in scores that are means over images.
    pub whole: f64,
}

impl Ratio {
    /// The value of one image in a mean over images.
    pub fn mean(name: &'static str, value: f64) -> Self {
        Self { name, part: value, whole: 1.0 }
    }

    /// Counts that are summed over all images first.
    pub fn micro(name: &'static str, part: usize, whole: usize) -> Self {
        Self { name, part: part as f64, whole: whole as f64 }
    }
}

/// Whose way it is to combine images, where the paper's text and the released code differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convention {
    /// As the code does: F and F@.75 are means over images.
    Release,
    /// As the text says: F is the harmonic mean of mean precision and recall, F@.75 a share of all objects.
    Paper,
}

impl Convention {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Release => "release",
            Self::Paper => "paper",
        }
    }
}

/// All scores of an image, in the same order for every image.
pub fn score(pair: &Pair, convention: Convention) -> Vec<Ratio> {
    let matched = matching::by_masks(&pair.labels, &pair.predictions, |it| &it.amodal);
    let mut ratios = masks::score(pair, &matched, convention);
    ratios.extend(occlusion::score(pair, &matched));
    ratios
}

/// Scores of a dataset by name, from those of its images in order. None where nothing was to be counted.
pub fn dataset(images: &[Vec<Ratio>], convention: Convention) -> Vec<(&'static str, Option<f64>)> {
    let mut scores = means(images);
    if convention == Convention::Paper {
        let of = |scores: &[(&str, Option<f64>)], name: &str| scores.iter().find(|it| it.0 == name).and_then(|it| it.1);
        for [p, r, f] in masks::triples() {
            let harmonic = of(&scores, p).zip(of(&scores, r)).map(|(p, r)| masks::harmonic(p, r));
            scores.iter_mut().filter(|it| it.0 == f).for_each(|it| it.1 = harmonic);
        }
    }
    scores
}

fn means(images: &[Vec<Ratio>]) -> Vec<(&'static str, Option<f64>)> {
    let Some(first) = images.first() else { return Vec::new() };
    let sum = |index: usize, of: fn(&Ratio) -> f64| images.iter().map(|image| of(&image[index])).sum::<f64>();
    let value = |(index, ratio): (usize, &Ratio)| {
        let whole = sum(index, |it| it.whole);
        (ratio.name, (whole > 0.0).then(|| sum(index, |it| it.part) / whole))
    };
    first.iter().enumerate().map(value).collect()
}
