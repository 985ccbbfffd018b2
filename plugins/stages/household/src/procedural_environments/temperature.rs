//! Colors of light by their temperature, fast enough for every texel. Linear Rec. 709 with luminance one.

use std::sync::LazyLock;
use syntable_model::photometry::{blackbody, luminance};

/// Steps of a table are even in reciprocal temperature, in which colors differ about evenly to the eye (CIE mired).
const STEPS: usize = 128;
const MIRED: [f64; 2] = [33.0, 650.0];

struct TemperatureTable(Vec<[f64; 3]>);

impl TemperatureTable {
    fn of(color: impl Fn(f64) -> [f64; 3]) -> Self {
        let mired = |i: usize| MIRED[0] + (MIRED[1] - MIRED[0]) * i as f64 / (STEPS - 1) as f64;
        Self((0..STEPS).map(|i| color(1e6 / mired(i))).collect())
    }

    fn look_up(&self, kelvin: f64) -> [f64; 3] {
        let at = (1e6 / kelvin - MIRED[0]) / (MIRED[1] - MIRED[0]) * (STEPS - 1) as f64;
        let at = if at > 0.0 { at.min((STEPS - 1) as f64) } else { 0.0 };
        let left = (at as usize).min(STEPS - 2);
        mix(self.0[left], self.0[left + 1], at - left as f64)
    }
}

fn mix(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    let color: [f64; 3] = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t);
    let scale = 1.0 / luminance(color);
    color.map(|c| c * scale)
}

/// Color of a black body from 1540 K to 30,000 K, clamped beyond.
pub fn blackbody_color(kelvin: f64) -> [f64; 3] {
    static TABLE: LazyLock<TemperatureTable> = LazyLock::new(|| TemperatureTable::of(blackbody));
    TABLE.look_up(kelvin)
}

/// Color of daylight, a little greener than a black body: the CIE's daylight locus (CIE 15:2004, section 3.1) from
/// 5000 K to 25,000 K, clamped beyond, black bodies below 4000 K and a blend of both between.
pub fn daylight_color(kelvin: f64) -> [f64; 3] {
    static TABLE: LazyLock<TemperatureTable> = LazyLock::new(|| {
        TemperatureTable::of(|kelvin| match kelvin {
            k if k < 4000.0 => blackbody(k),
            k => mix(blackbody(k.min(25_000.0)), daylight(k.min(25_000.0)), ((k - 4000.0) / 1000.0).min(1.0)),
        })
    });
    TABLE.look_up(kelvin)
}

/// The daylight locus: chromaticity x by temperature, y by x.
fn daylight(kelvin: f64) -> [f64; 3] {
    let t = 1e3 / kelvin;
    let x = if kelvin <= 7000.0 {
        ((-4.6070 * t + 2.9678) * t + 0.099_11) * t + 0.244_063
    } else {
        ((-2.0064 * t + 1.9018) * t + 0.247_48) * t + 0.237_040
    };
    let y = (-3.0 * x + 2.870) * x - 0.275;
    let [x, z] = [x / y, (1.0 - x - y) / y];
    let rgb = [
        3.240_454_2 * x - 1.537_138_5 - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 + 1.057_225_2 * z,
    ]
    .map(|c: f64| c.max(0.0));
    mix(rgb, rgb, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_bodies_agree_with_planck() {
        for kelvin in [1800.0, 2700.0, 4100.0, 6500.0, 12_000.0, 25_000.0] {
            let (got, want) = (blackbody_color(kelvin), blackbody(kelvin));
            for i in 0..3 {
                assert!((got[i] - want[i]).abs() < 2e-3, "{kelvin} K: {got:?} {want:?}");
            }
            assert!((luminance(got) - 1.0).abs() < 1e-12);
        }
        assert_eq!(blackbody_color(1e9), blackbody_color(40_000.0));
    }

    #[test]
    fn daylight_of_6504_kelvin_is_white() {
        // Rec. 709's white is D65.
        let white = daylight_color(6504.0);
        assert!(white.iter().all(|c| (c - 1.0).abs() < 3e-3), "{white:?}");
        // D50 has the chromaticity (0.3457, 0.3585).
        let [r, g, b] = daylight_color(5003.0);
        let x = 0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b;
        let z = 0.019_333_9 * r + 0.119_192_0 * g + 0.950_304_1 * b;
        let sum = x + 1.0 + z;
        assert!((x / sum - 0.3457).abs() < 1e-3 && (1.0 / sum - 0.3585).abs() < 1e-3, "{} {}", x / sum, 1.0 / sum);
        assert_eq!(daylight_color(3000.0), blackbody_color(3000.0));
    }
}
