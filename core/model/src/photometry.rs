//! Light in photometric units, converted in one place.
//!
//! Colors of light are linear Rec. 709 triples scaled so that their luminance
//! `Y = 0.2126 R + 0.7152 G + 0.0722 B` is in photometric units: a radiance triple has Y in cd/m² (nits), an
//! irradiance triple has Y in lux. A rendered image is therefore in nits, and camera exposure follows from it.

use crate::geometry::{Point3, Vector3};
use crate::scene::EnvironmentMap;
use std::f64::consts::{PI, TAU};

/// Luminance of a linear Rec. 709 color.
#[inline]
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Color of a black body at `kelvin`, linear Rec. 709 with luminance one.
///
/// Planck's law integrated over 380–780 nm with the CIE 1931 observer in the analytic fit of Wyman, Sloan and
/// Shirley (JCGT 2013); colors outside the gamut (below about 1900 K) are clipped.
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
fn planck(meters: f64, kelvin: f64) -> f64 {
    const SECOND_RADIATION_CONSTANT: f64 = 1.438_776_877e-2;
    1e-30 / (meters.powi(5) * (libm::exp(SECOND_RADIATION_CONSTANT / (meters * kelvin)) - 1.0))
}

fn cie_1931(nm: f64) -> [f64; 3] {
    let lobe = |height: f64, mean: f64, below: f64, above: f64| {
        let t = (nm - mean) * if nm < mean { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// Luminance (nits) of a sphere of `radius` that gives `illuminance` lux at `distance` from its center, on a plane
/// facing it: `E = π L (r/d)²`, exact while the whole sphere is above the plane.
pub fn sphere_luminance(illuminance_lx: f64, distance_m: f64, radius_m: f64) -> f64 {
    illuminance_lx * distance_m * distance_m / (PI * radius_m * radius_m)
}

/// Illuminance (lux) per nit of a one-sided convex polygon, at a point on a plane with unit `normal`.
///
/// Lambert's closed form: half the sum over the edges of the angle that the edge subtends times the cosine between
/// `normal` and the edge's plane normal. Parts below the plane do not count.
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
            let angle = libm::acos(a.dot(&b).clamp(-1.0, 1.0));
            a.cross(&b).try_normalize(1e-15).map_or(0.0, |edge| angle * normal.dot(&edge))
        })
        .sum();
    (0.5 * sum).abs()
}

/// Illuminance (lux) per nit of a one-sided disk, at a point on a plane with unit `normal`.
///
/// The light vector of a disk of radius a, seen from height h above its plane and from ρ beside its axis: with
/// `w = √((h² + ρ² + a²)² - 4 a² ρ²)` it has `π/2 (1 - (h² + ρ² - a²) / w)` towards the disk's plane, along its axis, and
/// `π h / 2ρ ((h² + ρ² + a²) / w - 1)` towards the axis (Howell's catalog of configuration factors, B-12 and its
/// perpendicular case). Exact while the whole disk is above the plane; one that the plane cuts is taken as a polygon
/// of 512 corners and equal area.
pub fn disk_illuminance(
    center: Point3<f64>,
    axis: Vector3<f64>,
    radius: f64,
    point: Point3<f64>,
    normal: Vector3<f64>,
) -> f64 {
    let to_center = center - point;
    let height = -to_center.dot(&axis);
    if height <= 0.0 {
        return 0.0;
    }
    let sideways = to_center + axis * height;
    let beside = sideways.norm();
    let along = axis.dot(&normal);
    // Extent of the disk above and below its center, as heights over the plane.
    let reach = radius * (1.0 - along * along).max(0.0).sqrt();
    let above = to_center.dot(&normal);
    if above <= -reach {
        return 0.0;
    }
    if above < reach {
        return cut_disk_illuminance(center, axis, radius, point, normal);
    }
    let (h2, p2, a2) = (height * height, beside * beside, radius * radius);
    let root = ((h2 + p2 + a2) * (h2 + p2 + a2) - 4.0 * a2 * p2).sqrt();
    let straight = PI / 2.0 * (1.0 - (h2 + p2 - a2) / root);
    // Near the axis the sideways part vanishes, in proportion to the distance from it.
    let tilted = if beside < 1e-6 * (height + radius) {
        Vector3::zeros()
    } else {
        sideways / beside * (PI * height / (2.0 * beside) * ((h2 + p2 + a2) / root - 1.0))
    };
    (tilted - axis * straight).dot(&normal).max(0.0)
}

fn cut_disk_illuminance(
    center: Point3<f64>,
    axis: Vector3<f64>,
    radius: f64,
    point: Point3<f64>,
    normal: Vector3<f64>,
) -> f64 {
    const CORNERS: u32 = 512;
    let other = if axis.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let u = axis.cross(&other).normalize();
    let v = axis.cross(&u);
    let step = TAU / f64::from(CORNERS);
    let radius = radius * (step / libm::sin(step)).sqrt();
    let corners: Vec<Point3<f64>> = (0..CORNERS)
        .map(|i| {
            let (sin, cos) = libm::sincos(step * f64::from(i));
            center + (u * cos + v * sin) * radius
        })
        .collect();
    polygon_illuminance(&corners, point, normal)
}

/// Irradiance that a map alone gives on a level plane without obstacles, in units of its texels; its luminance is an
/// illuminance. Exact for texels of even radiance: a row between polar angles a and b has the weight
/// `(sin² b - sin² a) / 2`.
pub fn level_irradiance(map: &EnvironmentMap) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (row, texels) in map.texels().chunks(map.width() as usize).enumerate() {
        let squared_sine = |row: usize| {
            let polar = (PI * row as f64 / f64::from(map.height())).min(PI / 2.0);
            libm::sin(polar) * libm::sin(polar)
        };
        let weight = (squared_sine(row + 1) - squared_sine(row)) / 2.0 * TAU / f64::from(map.width());
        if weight <= 0.0 {
            break;
        }
        for texel in texels {
            for (sum, &value) in sum.iter_mut().zip(texel) {
                *sum += weight * f64::from(value);
            }
        }
    }
    sum
}

/// Luminance (nits) of a surface of `area_m2` that gives off `flux_lm` lumens on one side, alike from everywhere and
/// after Lambert's law: `Φ = π L A`. For a sphere the area is `4π r²`.
pub fn flux_luminance(flux_lm: f64, area_m2: f64) -> f64 {
    flux_lm / (PI * area_m2)
}

/// Luminous flux (lumens) of a surface after Lambert's law: `Φ = π L A`.
pub fn lambertian_flux(luminance_nits: f64, area_m2: f64) -> f64 {
    PI * luminance_nits * area_m2
}

/// Luminous intensity (candela) of an emissive sphere, the same in all directions: `I = π r² L`.
pub fn sphere_intensity(luminance_nits: f64, radius_m: f64) -> f64 {
    PI * radius_m * radius_m * luminance_nits
}

/// Luminous flux (lumens) of a source that has `intensity_cd` candela in all directions: `Φ = 4π I`.
pub fn isotropic_flux(intensity_cd: f64) -> f64 {
    4.0 * PI * intensity_cd
}

/// Luminous intensity (candela) of a source that gives off `flux_lm` lumens alike in all directions: `I = Φ / 4π`.
pub fn isotropic_intensity(flux_lm: f64) -> f64 {
    flux_lm / (4.0 * PI)
}

/// Illuminance (lux) of a small source on a plane that faces it: `E = I / d²`.
pub fn point_illuminance(intensity_cd: f64, distance_m: f64) -> f64 {
    intensity_cd / (distance_m * distance_m)
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

    /// Illuminance of a disk by a sum over small pieces of it.
    fn summed(center: Point3<f64>, axis: Vector3<f64>, radius: f64, normal: Vector3<f64>) -> f64 {
        let u = axis.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
        let v = axis.cross(&u);
        let (rings, around) = (400, 400);
        let mut sum = 0.0;
        for i in 0..rings {
            let r = radius * (f64::from(i) + 0.5) / f64::from(rings);
            let area = TAU * r * radius / f64::from(rings * around);
            for j in 0..around {
                let (sin, cos) = (TAU * (f64::from(j) + 0.5) / f64::from(around)).sin_cos();
                let at = center.coords + (u * cos + v * sin) * r;
                let d2 = at.norm_squared();
                let (emitted, received) = (-at.dot(&axis), at.dot(&normal));
                sum += area * emitted.max(0.0) * received.max(0.0) / (d2 * d2);
            }
        }
        sum
    }

    #[test]
    fn a_disk_lights_as_the_sum_of_its_pieces() {
        // On the axis: E = π L a² / (a² + h²).
        let on_axis = disk_illuminance(Point3::new(0.0, 0.0, 2.0), -Vector3::z(), 0.5, Point3::origin(), Vector3::z());
        assert!((on_axis / (PI * 0.25 / 4.25) - 1.0).abs() < 1e-12, "{on_axis}");
        let tilted = Vector3::new(0.4, -0.2, -1.0).normalize();
        for (center, axis, radius, normal) in [
            ([0.0, 0.0, 2.0], -Vector3::z(), 0.5, Vector3::z()),
            ([1.5, -0.7, 2.0], -Vector3::z(), 1.2, Vector3::z()),
            ([1.5, 0.3, 1.0], -Vector3::z(), 0.6, Vector3::new(0.5, 0.1, 0.8).normalize()),
            ([-1.0, 0.5, 1.0], tilted, 0.4, Vector3::new(-0.5, 0.3, 0.7).normalize()),
            // Cut by the horizon, mostly above and mostly below.
            ([2.0, 0.0, 0.2], -Vector3::x(), 0.7, Vector3::z()),
            ([2.0, 0.0, -0.3], -Vector3::x(), 0.7, Vector3::z()),
        ] {
            let center = Point3::from(center);
            let got = disk_illuminance(center, axis, radius, Point3::origin(), normal);
            let want = summed(center, axis, radius, normal);
            assert!((got / want - 1.0).abs() < 1e-3, "{center} {axis} {radius}: {got} {want}");
        }
        let behind = disk_illuminance(Point3::new(0.0, 0.0, 2.0), Vector3::z(), 0.5, Point3::origin(), Vector3::z());
        assert_eq!(behind, 0.0);
    }

    #[test]
    fn photometric_units_agree_with_each_other() {
        // A sphere of 1 m² of surface and π nits: its flux by surface and by intensity, its illuminance by both ways.
        let radius = (1.0 / (4.0 * PI)).sqrt();
        let nits = 1000.0;
        let intensity = sphere_intensity(nits, radius);
        assert!((lambertian_flux(nits, 1.0) - isotropic_flux(intensity)).abs() < 1e-9);
        assert!((flux_luminance(lambertian_flux(nits, 1.0), 1.0) - nits).abs() < 1e-9);
        assert!((isotropic_intensity(isotropic_flux(intensity)) - intensity).abs() < 1e-9);
        let lux = point_illuminance(intensity, 3.0);
        assert!((sphere_luminance(lux, 3.0, radius) - nits).abs() < 1e-9);
        // A candela is a lumen per steradian: a light of 4π lm gives 1 lx at 1 m.
        assert!((point_illuminance(isotropic_intensity(4.0 * PI), 1.0) - 1.0).abs() < 1e-12);
        // A large panel of 3000 lm and 0.36 m² seen from 10 m: E = L A / d², within the panel's size.
        let panel = flux_luminance(3000.0, 0.36);
        let far = polygon_illuminance(
            &[[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]].map(|[x, y]| Point3::new(x, y, 10.0)),
            Point3::origin(),
            Vector3::z(),
        );
        assert!((panel * far / (3000.0 / (PI * 100.0)) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn a_map_gives_its_closed_form_on_a_level_plane() {
        // Even radiance from above: E = π L, whatever is below.
        let mut texels = vec![[2.0, 1.0, 0.5]; 16 * 8];
        texels[64..].fill([100.0; 3]);
        let even = level_irradiance(&EnvironmentMap::new("even", 16, 8, texels).expect("sound"));
        assert!((even[0] / TAU - 1.0).abs() < 1e-12 && (even[2] / (PI / 2.0) - 1.0).abs() < 1e-12, "{even:?}");
        // An odd number of rows: half of the middle one counts. L = cos θ gives 2π/3.
        let (width, height) = (4, 255);
        let texels = (0..height)
            .flat_map(|row| {
                let radiance = (PI * (f64::from(row) + 0.5) / f64::from(height)).cos() as f32;
                vec![[radiance.max(0.0); 3]; width as usize]
            })
            .collect();
        let cosine = level_irradiance(&EnvironmentMap::new("cosine", width, height as u32, texels).expect("sound"));
        assert!((cosine[1] / (TAU / 3.0) - 1.0).abs() < 1e-3, "{cosine:?}");
        // A constant map has a single row.
        let constant = level_irradiance(&EnvironmentMap::constant([1.0; 3]));
        assert!((constant[0] - PI).abs() < 1e-12, "{constant:?}");
    }
}
