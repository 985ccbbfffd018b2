//! Light in photometric units, converted in one place.
//!
//! Colours of light are linear Rec. 709 triples scaled so that their luminance
//! `Y = 0.2126 R + 0.7152 G + 0.0722 B` is in photometric units: a radiance triple has Y in cd/m² (nits), an
//! irradiance triple has Y in lux. A rendered picture is therefore in nits, and camera exposure follows from it.

use crate::geometry::{Point3, Vector3};
use std::f64::consts::PI;

/// Luminance of a linear Rec. 709 colour.
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Colour of a black body at `kelvin`, linear Rec. 709 with luminance one.
///
/// Planck's law integrated over 380–780 nm with the CIE 1931 observer in the analytic fit of Wyman, Sloan and
/// Shirley (JCGT 2013); colours outside the gamut (below about 1900 K) are clipped.
pub fn blackbody(kelvin: f64) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for nm in (380..=780).step_by(5).map(f64::from) {
        let power = planck(nm * 1e-9, kelvin);
        for (sum, weight) in xyz.iter_mut().zip(cie_1931(nm)) {
            *sum += power * weight;
        }
    }
    let [x, y, z] = xyz.map(|v| v / xyz[1]);
    let rgb = [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 * y + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ]
    .map(|v: f64| v.max(0.0));
    let scale = 1.0 / luminance(rgb);
    rgb.map(|v| v * scale)
}

/// Spectral radiance of a black body, up to a constant factor.
fn planck(metres: f64, kelvin: f64) -> f64 {
    const SECOND_RADIATION_CONSTANT: f64 = 1.438_776_877e-2;
    1e-30 / (metres.powi(5) * ((SECOND_RADIATION_CONSTANT / (metres * kelvin)).exp() - 1.0))
}

fn cie_1931(nm: f64) -> [f64; 3] {
    let lobe = |height: f64, mean: f64, below: f64, above: f64| {
        let t = (nm - mean) * if nm < mean { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// Luminance (nits) of a sphere of `radius` that gives `illuminance` lux at `distance` from its centre, on a plane
/// facing it: `E = π L (r/d)²`, exact while the whole sphere is above the plane.
pub fn sphere_luminance(illuminance_lx: f64, distance_m: f64, radius_m: f64) -> f64 {
    illuminance_lx * distance_m * distance_m / (PI * radius_m * radius_m)
}

/// Illuminance (lux) per nit of a one-sided convex polygon, at a point on a plane with unit `normal`.
///
/// Lambert's closed form: half the sum over the edges of the angle that the edge subtends times the cosine between
/// `normal` and the edge's plane normal. What lies below the plane does not count.
pub fn polygon_illuminance(corners: &[Point3<f64>], point: Point3<f64>, normal: Vector3<f64>) -> f64 {
    let corners: Vec<Vector3<f64>> = corners.iter().map(|corner| corner - point).collect();
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (height_a, height_b) = (a.dot(&normal), b.dot(&normal));
        if height_a >= 0.0 {
            above.push(a);
        }
        if (height_a > 0.0) != (height_b > 0.0) && height_a != height_b {
            above.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    let directions: Vec<_> = above.iter().filter_map(|corner| corner.try_normalize(1e-15)).collect();
    let sum: f64 = (0..directions.len())
        .map(|i| {
            let (a, b) = (directions[i], directions[(i + 1) % directions.len()]);
            let angle = a.dot(&b).clamp(-1.0, 1.0).acos();
            a.cross(&b).try_normalize(1e-15).map_or(0.0, |edge| angle * normal.dot(&edge))
        })
        .sum();
    (0.5 * sum).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_bodies_have_their_tabulated_chromaticity() {
        // CIE 1931 (x, y) of the Planckian locus: 2000 K (0.5267, 0.4133), 4000 K (0.3805, 0.3768),
        // 6500 K (0.3135, 0.3237).
        for (kelvin, x, y) in [(2000.0, 0.5267, 0.4133), (4000.0, 0.3805, 0.3768), (6500.0, 0.3135, 0.3237)] {
            let [r, g, b] = blackbody(kelvin);
            let xyz = [
                0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b,
                0.212_672_9 * r + 0.715_152_2 * g + 0.072_175_0 * b,
                0.019_333_9 * r + 0.119_192_0 * g + 0.950_304_1 * b,
            ];
            let sum: f64 = xyz.iter().sum();
            let (got_x, got_y) = (xyz[0] / sum, xyz[1] / sum);
            assert!((got_x - x).abs() < 4e-3 && (got_y - y).abs() < 4e-3, "{kelvin} K: {got_x:.4} {got_y:.4}");
            assert!((luminance([r, g, b]) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_polygon_lights_as_a_small_source_and_as_half_space() {
        let square = |half: f64, z: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Point3::new(x * half, y * half, z))
        };
        // Far away: E = L A cos / d².
        let far = polygon_illuminance(&square(0.01, 5.0), Point3::origin(), Vector3::z());
        assert!((far / (0.0004 / 25.0) - 1.0).abs() < 1e-4, "{far}");
        // Filling the hemisphere: E = π L.
        let near = polygon_illuminance(&square(1e6, 1.0), Point3::origin(), Vector3::z());
        assert!((near / PI - 1.0).abs() < 1e-4, "{near}");
        // A square upright on the plane's horizon: its lower half does not count.
        let upright =
            |low: f64| [(-1.0, low), (1.0, low), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| Point3::new(1.0, y, z));
        let cut = polygon_illuminance(&upright(-1.0), Point3::origin(), Vector3::z());
        let half = polygon_illuminance(&upright(0.0), Point3::origin(), Vector3::z());
        assert!((cut / half - 1.0).abs() < 1e-12, "{cut} {half}");
    }

    #[test]
    fn a_sphere_has_the_closed_form() {
        // A sphere seen under half-angle a gives E = π L sin² a.
        let (d, r) = (2.0, 0.5);
        let l = sphere_luminance(800.0, d, r);
        assert!((PI * l * (r / d).powi(2) - 800.0).abs() < 1e-9);
    }
}
