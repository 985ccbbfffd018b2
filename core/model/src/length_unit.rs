//! Units of length in recipes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Meters.
    M,
    /// Centimeters.
    Cm,
    /// Millimeters.
    Mm,
    /// Inches of 2.54 cm.
    In,
    /// Feet of 30.48 cm.
    Ft,
}

impl LengthUnit {
    /// The unit in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::In => "in",
            Self::Ft => "ft",
        }
    }

    /// Meters per unit.
    pub fn meters(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}
