//! Distances of cameras: multiples of the support's size, or meters.

use crate::common::bounds::check_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::error::ConfigError;
use syntable_model::scene::Support;

/// Smallest and largest distance of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ViewRadius {
    /// Multiples of half the support's longer edge, max(w/2, l/2), from 0.001 to 1000.
    OfTable(#[schemars(inner(range(min = 0.001, max = 1000.0)))] [f64; 2]),
    /// Meters, from 0.001 to 1000.
    Meters(#[schemars(inner(range(min = 0.001, max = 1000.0)))] [f64; 2]),
}

impl ViewRadius {
    /// The bounds for a support, meters.
    pub fn in_meters(self, support: &Support) -> [f64; 2] {
        match self {
            Self::OfTable(factors) => factors.map(|factor| factor * support.surface.half_extent()),
            Self::Meters(meters) => meters,
        }
    }

    /// Rejects bounds in the wrong order.
    pub fn check(self, key: &str) -> Result<(), ConfigError> {
        match self {
            Self::OfTable(bounds) => check_order(&format!("{key}.of_table"), bounds),
            Self::Meters(bounds) => check_order(&format!("{key}.meters"), bounds),
        }
    }
}

/// Distance of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ViewDistance {
    /// Multiple of half the support's longer edge, max(w/2, l/2), from 0.001 to 1000.
    OfTable(#[schemars(range(min = 0.001, max = 1000.0))] f64),
    /// Meters, from 0.001 to 1000.
    Meters(#[schemars(range(min = 0.001, max = 1000.0))] f64),
}

impl ViewDistance {
    /// The distance for a support, meters.
    pub fn in_meters(self, support: &Support) -> f64 {
        match self {
            Self::OfTable(factor) => factor * support.surface.half_extent(),
            Self::Meters(meters) => meters,
        }
    }
}
