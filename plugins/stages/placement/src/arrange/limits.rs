//! Limits that options of the kind `arrange` share.

/// Limits of `gap_m`, meters.
pub const GAP_M: [f64; 2] = [0.0, 10.0];
