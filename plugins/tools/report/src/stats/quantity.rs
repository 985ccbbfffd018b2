//! The counted quantities of a dataset, with their units and bins.

/// A quantity with many values in a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Hidden part of the amodal area of an object in a view.
    OcclusionRate,
    /// Objects that a view shows.
    ObjectsPerView,
    /// Objects of a weakly connected component of a view's occlusion graph.
    ComponentSize,
    /// Components of a view's occlusion graph.
    ComponentsPerView,
    /// Layers of a view's occlusion graph from front to back.
    DepthLayers,
    /// Amodal area of an object in a view; visible area without amodal masks.
    ObjectArea,
    /// Longest edge of an object's box in space.
    ObjectSize,
    /// Distance from the camera to the center of an object's box, or to the object's origin if the box is unknown.
    ObjectDistance,
    /// Depth of a pixel.
    Depth,
    /// Mean luma of an image.
    Brightness,
    /// Standard deviation of an image's luma.
    Contrast,
    /// Mean difference of the largest and the smallest channel.
    Saturation,
    /// Mean red over mean red and blue.
    Warmth,
    /// Mean gradient of an image's luma.
    Edges,
    /// Mean difference of luma from its neighborhood.
    Detail,
}

/// How the bins of a quantity depend on its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bins {
    /// Ten bins from 0 to 1.
    Tenths,
    /// One bin for each integer, or for a few if the range is large.
    Integers,
    /// From each power of two to the next.
    Octaves,
    /// At most twenty bins with a width of 1, 2 or 5 times a power of ten.
    Round,
}

/// Properties of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct About {
    /// Its name in JSON.
    pub name: &'static str,
    /// Its name for users.
    pub title: &'static str,
    /// Its unit; empty for numbers.
    pub unit: &'static str,
    /// The counted item.
    pub per: &'static str,
    /// Values are stored in whole steps of this size, rounded down; mean and range are exact.
    pub step: f64,
    /// Its bins.
    pub bins: Bins,
}

/// Maximum number of bins of [`Bins::Integers`].
const MOST_INTEGERS: f64 = 50.0;
/// Maximum number of bins of [`Bins::Round`].
const MOST_ROUND: f64 = 20.0;

impl Quantity {
    /// All quantities, in the order of output.
    pub const ALL: [Self; 15] = [
        Self::OcclusionRate,
        Self::ObjectsPerView,
        Self::ComponentSize,
        Self::ComponentsPerView,
        Self::DepthLayers,
        Self::ObjectArea,
        Self::ObjectSize,
        Self::ObjectDistance,
        Self::Depth,
        Self::Brightness,
        Self::Contrast,
        Self::Saturation,
        Self::Warmth,
        Self::Edges,
        Self::Detail,
    ];

    /// Properties of the quantity.
    pub fn about(self) -> About {
        let about = |name, title, unit, per, step, bins| About { name, title, unit, per, step, bins };
        match self {
            Self::OcclusionRate => {
                about("occlusion_rate", "occlusion rate", "", "object in a view", 1e-6, Bins::Tenths)
            }
            Self::ObjectsPerView => about("objects_per_view", "objects per view", "", "view", 1.0, Bins::Integers),
            Self::ComponentSize => about("component_size", "component size", "", "component", 1.0, Bins::Integers),
            Self::ComponentsPerView => {
                about("components_per_view", "components per view", "", "view", 1.0, Bins::Integers)
            }
            Self::DepthLayers => about("depth_layers", "depth layers", "", "view", 1.0, Bins::Integers),
            Self::ObjectArea => about("object_area", "object area", "px", "object in a view", 1.0, Bins::Octaves),
            Self::ObjectSize => about("object_size", "object size", "m", "object in a view", 1e-3, Bins::Round),
            Self::ObjectDistance => {
                about("object_distance", "object distance", "m", "object in a view", 1e-3, Bins::Round)
            }
            Self::Depth => about("depth", "depth", "m", "pixel", 1e-2, Bins::Round),
            Self::Brightness => about("brightness", "brightness", "", "view", 1e-4, Bins::Tenths),
            Self::Contrast => about("contrast", "contrast", "", "view", 1e-4, Bins::Round),
            Self::Saturation => about("saturation", "saturation", "", "view", 1e-4, Bins::Round),
            Self::Warmth => about("warmth", "warmth", "", "view", 1e-4, Bins::Round),
            Self::Edges => about("edges", "edges", "", "view", 1e-5, Bins::Round),
            Self::Detail => about("detail", "fine detail", "", "view", 1e-5, Bins::Round),
        }
    }

    /// Edges of its bins for values in a range.
    pub fn edges(self, [low, high]: [f64; 2]) -> Vec<f64> {
        let about = self.about();
        match about.bins {
            Bins::Tenths => (0..=10).map(|edge| f64::from(edge) / 10.0).collect(),
            Bins::Integers => multiples(round_width(high + 1.0 - low, MOST_INTEGERS, 1.0), low, high),
            Bins::Octaves => octaves(low, high),
            Bins::Round => multiples(round_width(high - low, MOST_ROUND, about.step), low, high),
        }
    }
}

/// Edges of equal bins over a range, as in the figures of the SynTable paper.
pub fn equal_edges(bins: u32, [low, high]: [f64; 2]) -> Vec<f64> {
    let edge = |edge: u32| low + (high - low) * f64::from(edge) / f64::from(bins);
    (0..bins).map(edge).chain([high]).collect()
}

/// The smallest width of 1, 2 or 5 times a power of ten with which at most `most` bins cover a length; at least
/// `least`.
fn round_width(length: f64, most: f64, least: f64) -> f64 {
    let mut exponent = -9;
    loop {
        for factor in [1.0, 2.0, 5.0] {
            // Division by a power of ten yields the closest number to the decimal fraction; multiplication by a
            // negative power does not.
            let power = 10_f64.powi(i32::abs(exponent));
            let width = if exponent < 0 { factor / power } else { factor * power };
            if width >= least && (length <= width * (most - 1.0) || exponent > 30) {
                return width;
            }
        }
        exponent += 1;
    }
}

/// Multiples of a width, from the last one at or below `low` to the first one above `high`.
fn multiples(width: f64, low: f64, high: f64) -> Vec<f64> {
    let per_unit = (1.0 / width).round();
    let at = |number: f64| if width < 1.0 { number / per_unit } else { number * width };
    let first = (low / width + 1e-9).floor();
    let last = (high / width + 1e-9).floor() + 1.0;
    (0..=(last - first) as u32).map(|edge| at(first + f64::from(edge))).collect()
}

/// Powers of two around a range, and 0 if the range starts below 1.
fn octaves(low: f64, high: f64) -> Vec<f64> {
    let mut edges = Vec::new();
    if low < 1.0 {
        edges.push(0.0);
    }
    let mut edge = 1.0;
    while edge <= high {
        if 2.0 * edge > low {
            edges.push(edge);
        }
        edge *= 2.0;
    }
    edges.push(edge);
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_on_paper() {
        let of = |quantity: Quantity, range| quantity.edges(range);
        assert_eq!(of(Quantity::OcclusionRate, [0.2, 0.3])[..4], [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(of(Quantity::ObjectsPerView, [2.0, 4.0]), [2.0, 3.0, 4.0, 5.0]);
        assert_eq!(of(Quantity::ObjectsPerView, [0.0, 99.0])[..3], [0.0, 5.0, 10.0]);
        assert_eq!(of(Quantity::ObjectArea, [3.0, 8.0]), [2.0, 4.0, 8.0, 16.0]);
        assert_eq!(of(Quantity::ObjectArea, [0.0, 1.0]), [0.0, 1.0, 2.0]);
        assert_eq!(of(Quantity::Depth, [0.55, 0.92])[..3], [0.54, 0.56, 0.58]);
        let deep = of(Quantity::Depth, [0.5, 7.145]);
        assert_eq!((deep[0], deep[deep.len() - 1], deep.len()), (0.5, 7.5, 15));
        assert_eq!(of(Quantity::ObjectSize, [0.25, 0.25]), [0.25, 0.251]);
        assert_eq!(equal_edges(4, [1.0, 3.0]), [1.0, 1.5, 2.0, 2.5, 3.0]);
    }

    #[test]
    fn every_value_of_a_range_has_a_bin() {
        for quantity in Quantity::ALL.into_iter().filter(|it| it.about().bins != Bins::Tenths) {
            for range in [[0.0, 0.0], [0.0, 1.0], [1.0, 300.0], [0.123, 65.535], [17.0, 17.4]] {
                let edges = quantity.edges(range);
                assert!(edges.is_sorted() && edges[0] <= range[0] && edges[edges.len() - 1] > range[1], "{edges:?}");
                assert!((2..=52).contains(&edges.len()), "{quantity:?} {range:?} {edges:?}");
            }
        }
    }
}
