//! The radius options of views and lights: one tagged pair of bounds.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::error::Invalid;
use syntable_model::scene::Tabletop;
use syntable_model::stage::Shell;

/// Distances of cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ViewRadius {
    /// Multiples of half the tabletop's longer edge, max(w/2, l/2).
    OfTable([f64; 2]),
    /// Metres.
    Metres([f64; 2]),
}

impl ViewRadius {
    /// The bounds in metres for a table.
    pub fn metres(self, tabletop: &Tabletop) -> [f64; 2] {
        match self {
            Self::OfTable(factors) => factors.map(|factor| factor * tabletop.half_extent()),
            Self::Metres(metres) => metres,
        }
    }

    /// Refuses bounds that are no positive range.
    pub fn check(self, key: &str) -> Result<(), Invalid> {
        match self {
            Self::OfTable(bounds) => check_bounds(key, "of_table", bounds, 1e-3),
            Self::Metres(bounds) => check_bounds(key, "metres", bounds, 1e-3),
        }
    }
}

/// One distance of cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ViewDistance {
    /// Multiples of half the tabletop's longer edge, max(w/2, l/2).
    OfTable(f64),
    /// Metres.
    Metres(f64),
}

impl From<ViewDistance> for ViewRadius {
    fn from(distance: ViewDistance) -> Self {
        match distance {
            ViewDistance::OfTable(factor) => Self::OfTable([factor; 2]),
            ViewDistance::Metres(metres) => Self::Metres([metres; 2]),
        }
    }
}

/// Distances of lights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightRadius {
    /// Metres beyond the largest distance that a camera can have.
    BeyondViewsM([f64; 2]),
    /// Metres.
    Metres([f64; 2]),
}

impl LightRadius {
    /// The bounds in metres for the shell of the cameras.
    pub fn metres(self, views: &Shell) -> [f64; 2] {
        match self {
            Self::BeyondViewsM(beyond) => beyond.map(|metres| views.radius[1] + metres),
            Self::Metres(metres) => metres,
        }
    }

    /// Refuses bounds that are no range, or leave no room for a light.
    pub fn check(self, key: &str) -> Result<(), Invalid> {
        match self {
            Self::BeyondViewsM(bounds) => check_bounds(key, "beyond_views_m", bounds, 0.0),
            Self::Metres(bounds) => check_bounds(key, "metres", bounds, 1e-3),
        }
    }
}

/// Refuses `[low, high]` unless `least` ≤ low ≤ high and both are finite.
pub fn check_bounds(key: &str, name: &str, [low, high]: [f64; 2], least: f64) -> Result<(), Invalid> {
    if !(low.is_finite() && high.is_finite() && low >= least) {
        return Err(Invalid::new(key, format!("`{name} = [{low}, {high}]` must be finite and at least {least}")));
    }
    if low > high {
        return Err(Invalid::new(key, format!("`{name} = [{low}, {high}]` is empty; write the smaller bound first")));
    }
    Ok(())
}
