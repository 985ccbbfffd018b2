//! Likely sizes of tabletop objects, to detect files in another unit than the meter.

use std::ops::RangeInclusive;
use syntable_model::error::Error;

/// Length of the longest side of likely objects, tables included, meters.
pub const LIKELY_M: RangeInclusive<f64> = 0.005..=2.0;
/// Target length for suggested units and scales, meters: a mug or a box of tea.
const TYPICAL_M: f64 = 0.15;
/// Common units other than meters, with their length in meters.
const UNITS: [(&str, f64); 2] = [("cm", 0.01), ("mm", 0.001)];
/// Scales for objects that are too small.
const SCALES: [f64; 3] = [10.0, 100.0, 1000.0];

/// A warning about an object with an unlikely longest side, with a unit or scale that would fit; `None` if the side is
/// likely.
pub fn doubt(longest_m: f64) -> Option<Error> {
    if LIKELY_M.contains(&longest_m) {
        return None;
    }
    let apart = |factor: f64| libm::log(longest_m * factor / TYPICAL_M).abs();
    let nearest = |factors: &[f64]| factors.iter().copied().min_by(|&a, &b| apart(a).total_cmp(&apart(b)));
    let stated = "`units = \"m\"` confirms the size";
    Some(if longest_m > *LIKELY_M.end() {
        let factor = nearest(&UNITS.map(|(_, factor)| factor)).unwrap_or(1.0);
        let unit = UNITS.iter().find(|(_, known)| *known == factor).map_or("m", |(unit, _)| unit);
        Error::new(format!("the object is {longest_m:.2} m long"))
            .help(format!("`units = \"{unit}\"` in the pool makes it {}; {stated}", length(longest_m * factor)))
    } else {
        let scale = nearest(&SCALES).unwrap_or(1.0);
        Error::new(format!("the object is {} long", length(longest_m)))
            .help(format!("`scale = {scale}` in the pool makes it {}; {stated}", length(longest_m * scale)))
    })
}

fn length(meters: f64) -> String {
    format!("{:.1} cm", meters * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unlikely_sizes_suggest_what_would_fit() {
        for (size, says) in [
            (8.4, "8.40 m long (`units = \"cm\"` in the pool makes it 8.4 cm"),
            (200.0, "`units = \"mm\"` in the pool makes it 20.0 cm"),
            (2.01, "2.01 m long"),
            (0.001, "0.1 cm long (`scale = 100` in the pool makes it 10.0 cm"),
            (0.0002, "`scale = 1000` in the pool makes it 20.0 cm"),
        ] {
            let error = doubt(size).expect("unlikely").to_string();
            assert!(error.contains(says), "{size}: {error}");
        }
        for size in [0.005, 0.15, 2.0] {
            assert!(doubt(size).is_none(), "{size}");
        }
    }
}
