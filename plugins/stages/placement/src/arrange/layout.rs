//! The option `layout`.
use super::limits::GAP_M;
use syntable_model::prelude::*;

/// Limits of the number of objects in a row, and of rows and columns.
const PER_ROW: [i64; 2] = [1, 1000];

/// Where the objects are.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// At random positions.
    #[default]
    Scatter,
    /// In rows from front to back, side by side, as on a shelf. The front is the side of the support at the negative end of its
    /// second edge (−y, if the support is not turned), and the first row is at the negative end of its first edge (−x).
    Rows(Rows),
    /// On a grid of equal cells, one place in the middle of each.
    Grid(Grid),
}

/// Objects in rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rows {
    /// Maximum number of places in a row, drawn per row; 1 to 1000. By default as many as fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = PER_ROW[0], "maximum" = PER_ROW[1]))]
    pub per_row: Option<IntDist>,
    /// Distance between two rows, meters, 0 to 10. By default the distance of the objects in a row.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = GAP_M[0], "maximum" = GAP_M[1]))]
    pub row_gap_m: Option<Dist>,
    /// Probability that a place has an object.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub occupied: f64,
}

/// Objects on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Grid {
    /// Number of cells along the first edge of the support, drawn per support; 1 to 1000.
    #[schemars(extend("minimum" = PER_ROW[0], "maximum" = PER_ROW[1]))]
    pub columns: IntDist,
    /// Number of cells along the second edge of the support, drawn per support; 1 to 1000.
    #[schemars(extend("minimum" = PER_ROW[0], "maximum" = PER_ROW[1]))]
    pub rows: IntDist,
    /// Maximum distance of an object from the middle of its cell along each edge, meters.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub jitter_m: f64,
    /// Probability that a cell has an object.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub occupied: f64,
}

impl Default for Rows {
    fn default() -> Self {
        Self { per_row: None, row_gap_m: None, occupied: 1.0 }
    }
}

impl Default for Grid {
    fn default() -> Self {
        Self { columns: IntDist::Constant(4), rows: IntDist::Constant(3), jitter_m: 0.0, occupied: 1.0 }
    }
}

impl Layout {
    pub fn check(&self) -> Result<(), ConfigError> {
        match self {
            Self::Scatter => Ok(()),
            Self::Rows(Rows { per_row, row_gap_m, .. }) => {
                row_gap_m.as_ref().map_or(Ok(()), |gap| gap.within("layout.rows.row_gap_m", GAP_M[0], GAP_M[1]))?;
                per_row.as_ref().map_or(Ok(()), |per_row| per_row.within("layout.rows.per_row", PER_ROW[0], PER_ROW[1]))
            }
            Self::Grid(Grid { columns, rows, .. }) => {
                columns.within("layout.grid.columns", PER_ROW[0], PER_ROW[1])?;
                rows.within("layout.grid.rows", PER_ROW[0], PER_ROW[1])
            }
        }
    }

    /// Whether objects are in rows.
    pub fn has_rows(&self) -> bool {
        matches!(self, Self::Rows(_))
    }
}
