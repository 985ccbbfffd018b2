//! Options of statistics.

use super::distribution::Binning;
use super::duplicates::LEVELS;

/// Options of statistics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StatisticsOptions {
    /// Whether to read labels only. Color images and depth take most of the time.
    pub labels_only: bool,
    /// Rule for an edge of the occlusion graph.
    pub edges: Edges,
    /// Whether to count components for every prefix of a view's objects, as in the authors' figure, instead of for all
    /// objects.
    pub prefixes: bool,
    /// Maximum difference of near-duplicate views, see [`duplicates`](super::duplicates).
    pub levels: u8,
    /// Bins of histograms.
    pub binning: Binning,
}

impl Default for StatisticsOptions {
    fn default() -> Self {
        Self { labels_only: false, edges: Edges::Pixels, prefixes: false, levels: LEVELS, binning: Binning::Fixed }
    }
}

/// Rule for an edge "i occludes j" of the occlusion graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edges {
    /// A pixel of j's occlusion mask that shows i (SynTable, Algorithm 1).
    Pixels,
    /// An IoU of i's visible and j's occlusion mask above 0.1, as in some of the authors' notebooks.
    Iou,
    /// The order that the dataset stores.
    Stored,
}
