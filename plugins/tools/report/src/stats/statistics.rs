//! Statistics of a dataset, as data.

use super::distribution::Distribution;
use super::duplicates::Duplicates;
use super::image::{ImageRow, LayerCounts};
use serde::Serialize;
use std::collections::BTreeMap;
use syntable_model::left_out::LeftOut;

/// Statistics of a dataset. A number is `None` if the format does not have it or it was not requested; `unknown` lists
/// the reasons.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DatasetStatistics {
    /// Its name.
    pub name: String,
    /// The row of Table 1, and related numbers.
    pub totals: Totals,
    /// Objects by their layers in the occlusion graph.
    pub layers: Option<LayerCounts>,
    /// Its distributions, in the order of [`Quantity::ALL`](super::quantity::Quantity::ALL), without empty
    /// distributions.
    pub distributions: Vec<Distribution>,
    /// Number of appearances of each asset, in descending order.
    pub assets: Option<Vec<AssetCount>>,
    /// Number of objects that views show, by class; empty in datasets with one class.
    pub classes: BTreeMap<String, u64>,
    /// Views that look almost the same.
    pub near_duplicates: Option<Duplicates>,
    /// Unknown numbers with reasons, as sentences.
    pub unknown: Vec<String>,
    /// Differences in meaning between the dataset's labels and a run's labels, as text for users.
    pub caveats: Vec<String>,
    /// Annotations that are not objects.
    #[serde(skip)]
    pub left_out: Vec<LeftOut>,
    /// Its images, in order.
    #[serde(skip)]
    pub images: Vec<ImageRow>,
}

/// A dataset's row of Table 1 of the SynTable paper, and related numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Totals {
    /// Images, including images without visible objects.
    pub images: u64,
    /// Images without visible objects; `None` without labels.
    pub empty_images: Option<u64>,
    /// Distinct assets of objects that views show.
    pub objects: Option<u64>,
    /// Scenes. In formats without scenes, each image is one.
    pub scenes: u64,
    /// Pairs of an object and a view in which it has a visible pixel: #VI. `None` without labels.
    pub visible_instances: Option<u64>,
    /// Instances with at least one hidden pixel: #OI.
    pub occluded_instances: Option<u64>,
    /// Annotated objects without a visible pixel. No other number includes them.
    pub hidden_instances: u64,
    /// Sum of the areas of amodal masks, px.
    pub amodal_px: Option<u64>,
    /// Sum of the areas of occlusion masks, px.
    pub occluded_px: Option<u64>,
    /// `occluded_px` / `amodal_px`: "Avg. OR", weighted by pixels and therefore not a mean of rates.
    pub average_occlusion_rate: Option<f64>,
    /// Mean of the occlusion rates of all visible instances.
    pub mean_occlusion_rate: Option<f64>,
    /// Mean of the occlusion rates of the occluded instances.
    pub mean_occlusion_rate_of_occluded: Option<f64>,
    /// Edges of occlusion graphs.
    pub edges: Option<u64>,
    /// Pairs of objects that occlude each other.
    pub mutual_pairs: Option<u64>,
    /// Views whose occlusion graph has a cycle.
    pub cyclic_views: Option<u64>,
}

/// Number of appearances of an asset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AssetCount {
    /// Name of the asset, with its pool if known.
    pub name: String,
    /// Visible objects with this asset, counted separately for each view.
    pub instances: u64,
    /// Views in which it is visible.
    pub views: u64,
    /// Scenes with such views.
    pub scenes: u64,
}
