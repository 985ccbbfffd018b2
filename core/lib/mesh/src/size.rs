//! Sizes of objects: the allowed and the likely range, and the unit of the file that would explain a size outside of it.
//!
//! Pools and `syntable check --asset` ask the same functions.

use std::ops::RangeInclusive;
use syntable_model::error::{Error, Result};
use syntable_model::length_unit::LengthUnit;

/// Length of the longest side of any object, meters: half a millimeter to ten meters.
const ALLOWED_M: RangeInclusive<f64> = 5e-4..=10.0;
/// Length of the longest side of likely objects, tables included, meters.
pub const LIKELY_M: RangeInclusive<f64> = 0.005..=2.0;
/// Target length for suggested units and scales, meters: a mug or a box of tea.
const TYPICAL_M: f64 = 0.15;
/// Common units.
const UNITS: [LengthUnit; 3] = [LengthUnit::M, LengthUnit::Cm, LengthUnit::Mm];
/// Scales for objects that are too small in every unit.
const SCALES: [f64; 3] = [10.0, 100.0, 1000.0];

/// How a pool, or the table of a placed mesh, converts the lengths of files to meters.
#[derive(Debug, Clone, Copy)]
pub struct StatedLengths {
    /// The option `units`; `None` if it is left out.
    pub units: Option<LengthUnit>,
    /// The option `scale`, as a factor.
    pub scale: f64,
}

impl Default for StatedLengths {
    fn default() -> Self {
        Self { units: None, scale: 1.0 }
    }
}

/// Refuses an object with a longest side that no object has. The remedy names the likely unit of the file.
pub fn check(longest_m: f64, stated: StatedLengths) -> Result<()> {
    outside(longest_m).map_or(Ok(()), |fault| Err(Error::new(fault).help(remedy(longest_m, stated))))
}

/// Refuses an object that a placer makes larger by a factor than any object is, or smaller. Another draw may fit.
pub fn check_resized(longest_m: f64, factor: f64) -> Result<()> {
    let refusal =
        |fault| Error::unlucky(format!("{fault} at the scale {factor:.4}")).help("narrow the placer's `scale`");
    outside(longest_m * factor).map_or(Ok(()), |fault| Err(refusal(fault)))
}

/// Describes a longest side that is outside of the allowed range.
fn outside(longest_m: f64) -> Option<String> {
    if ALLOWED_M.contains(&longest_m) {
        return None;
    }
    let shown = if (1e-3..1e4).contains(&longest_m) { format!("{longest_m:.3}") } else { format!("{longest_m:.3e}") };
    let (low, high) = (ALLOWED_M.start(), ALLOWED_M.end());
    Some(format!("object extent {shown} m is outside the allowed range of {low} m to {high} m"))
}

/// A warning about an object with an unlikely longest side in a pool that does not state `units`; `None` if the side is
/// likely.
pub fn doubt(longest_m: f64) -> Option<Error> {
    if LIKELY_M.contains(&longest_m) {
        return None;
    }
    let shown = if longest_m > *LIKELY_M.end() { format!("{longest_m:.2} m") } else { length(longest_m) };
    let remedy = remedy(longest_m, StatedLengths::default());
    Some(Error::new(format!("the object is {shown} long")).help(format!("{remedy}; `units = \"m\"` confirms the size")))
}

/// The unit that gives the object the most typical length, or else a scale.
fn remedy(longest_m: f64, stated: StatedLengths) -> String {
    let apart = |length: f64| libm::log(length / TYPICAL_M).abs();
    let current = stated.units.map_or(1.0, LengthUnit::meters);
    let nearest = UNITS
        .map(|unit| (unit.name(), unit.meters(), longest_m / current * unit.meters()))
        .into_iter()
        .min_by(|a, b| apart(a.2).total_cmp(&apart(b.2)));
    match nearest.filter(|(_, meters, length)| *meters != current && ALLOWED_M.contains(length)) {
        Some((unit, _, longest)) => match stated.units {
            None => format!("`units = \"{unit}\"` makes it {}", length(longest)),
            Some(other) => {
                let (other, length) = (other.name(), length(longest));
                format!("`units = \"{unit}\"` instead of `\"{other}\"` makes it {length}")
            }
        },
        None => {
            let nearest = SCALES.into_iter().min_by(|a, b| apart(longest_m * a).total_cmp(&apart(longest_m * b)));
            match nearest.filter(|scale| ALLOWED_M.contains(&(longest_m * scale))) {
                _ if stated.scale != 1.0 => format!("check `scale = {}`", stated.scale),
                Some(scale) if longest_m < TYPICAL_M => {
                    format!("`scale = {scale}` makes it {}", length(longest_m * scale))
                }
                _ => "no unit of length explains this: the file is broken".to_owned(),
            }
        }
    }
}

fn length(meters: f64) -> String {
    if meters < 2.0 { format!("{:.1} cm", meters * 100.0) } else { format!("{meters:.2} m") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unlikely_sizes_suggest_what_would_fit() {
        for (size, says) in [
            (8.4, "8.40 m long (`units = \"cm\"` makes it 8.4 cm"),
            (200.0, "`units = \"mm\"` makes it 20.0 cm"),
            (2.01, "2.01 m long"),
            (0.001, "0.1 cm long (`scale = 100` makes it 10.0 cm"),
            (0.0002, "`scale = 1000` makes it 20.0 cm"),
        ] {
            let error = doubt(size).expect("unlikely").to_string();
            assert!(error.contains(says), "{size}: {error}");
        }
        for size in [0.005, 0.15, 2.0] {
            assert!(doubt(size).is_none(), "{size}");
        }
    }

    #[test]
    fn sizes_that_no_object_has_name_the_likely_unit() {
        let (none, mm) = (StatedLengths::default(), StatedLengths { units: Some(LengthUnit::Mm), scale: 1.0 });
        let scaled = StatedLengths { units: None, scale: 1e-4 };
        for (size, stated, says) in [
            (
                120.0,
                none,
                "object extent 120.000 m is outside the allowed range of 0.0005 m to 10 m (`units = \"mm\"` makes it 12.0 cm)",
            ),
            (15.0, none, "`units = \"cm\"` makes it 15.0 cm"),
            // A scan in meters, read as millimeters.
            (
                1.2e-4,
                mm,
                "object extent 1.200e-4 m is outside the allowed range of 0.0005 m to 10 m (`units = \"m\"` instead of `\"mm\"` makes it 12.0 cm)",
            ),
            (1.2e-5, scaled, "(check `scale = 0.0001`)"),
            (1e-4, none, "(`scale = 1000` makes it 10.0 cm)"),
            (1e29, none, "the file is broken"),
        ] {
            let error = check(size, stated).expect_err("refused").to_string();
            assert!(error.contains(says), "{size}: {error}");
        }
        for size in [5e-4, 0.15, 10.0] {
            check(size, mm).expect("allowed");
        }
    }
}
