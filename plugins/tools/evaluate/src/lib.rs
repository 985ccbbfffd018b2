//! Scores of predicted masks against the labels of a dataset, with the conventions of SynTable's released evaluation.
//!
//! [`evaluate`] scores predictions from paths and options.
//!
//! | module | holds |
//! | --- | --- |
//! | [`image`] | the labeled and the predicted objects of an image |
//! | [`matching`] | the matching of predictions and objects |
//! | [`measure`] | metrics, and the registry to which crates add theirs |
//! | [`boundary`] | boundary maps, and the numbers of their pixels that are near another map |
//! | [`occlusion`] | ACC_O and F_O |
//! | [`order`] | ACC_OO by the paper and by the release, scores of edges; InstaOrder's and De-occlusion's scores |
//! | [`coco`], [`categories`] | COCO's AP and AR of masks and boxes, over all categories and by category |
//! | [`strata`] | scores of objects by occlusion rate and by size |
//! | [`bootstrap`] | confidence intervals |
//! | [`predictions`], [`results`], [`label_maps`], [`memory`] | sources of predictions: datasets, result files, label maps, memory |
//! | [`names`] | the image for a name |
//! | [`worst`] | the images with the lowest scores, with their predictions, for reports |
//!
//! The evaluation keeps only the metrics' tally of each image ([`measure::Measure`]).

pub mod bootstrap;
pub mod boundary;
pub mod categories;
pub mod coco;
mod evaluation;
pub mod image;
pub mod label_maps;
pub mod masked_object;
pub mod masks;
pub mod matching;
pub mod measure;
pub mod memory;
pub mod names;
pub mod occlusion;
pub mod order;
pub mod predictions;
pub mod regions;
pub mod results;
pub mod strata;
pub mod table;
pub mod worst;

pub use evaluation::{EvaluateOptions, Evaluation, evaluate, evaluate_detections};
pub use syntable_model::inventory;

/// Aggregation convention, where the paper's text and the released code differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convention {
    /// As the code does: F and F@.75 are means over images.
    Release,
    /// As in the paper's text: F is the harmonic mean of mean precision and recall, F@.75 a fraction of all objects.
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
