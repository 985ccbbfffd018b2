//! Environment maps: radiance from all directions.

use crate::digest::{Digest, Hasher};
use crate::error::{Error, Result};
use crate::geometry::Vector3;
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// Radiance by direction, equirectangular: row 0 looks up the world's z, the last row down; the middle column looks
/// along +x, and columns go round clockwise seen from above, so that the map is not mirrored seen from inside.
#[derive(Debug, Clone)]
pub struct EnvironmentMap {
    /// Name within its source.
    pub name: String,
    /// Width, texels.
    width: u32,
    /// Height, texels.
    height: u32,
    texels: Vec<[f32; 3]>,
    /// License as an SPDX expression or name; empty if unknown.
    pub license: String,
    /// Digest of size and texels.
    pub digest: Digest,
}

impl PartialEq for EnvironmentMap {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl EnvironmentMap {
    /// A map of linear radiance, Rec. 709, row-major `[height, width]`. Negative texels, which resampling leaves behind,
    /// become zero; one that is not finite is an error that names its place.
    pub fn new(name: impl Into<String>, width: u32, height: u32, mut texels: Vec<[f32; 3]>) -> Result<Self> {
        if width == 0 || height == 0 || texels.len() != width as usize * height as usize {
            return Err(Error::new(format!("{} texels for {width} x {height}", texels.len())));
        }
        let mut hasher = Hasher::new("environment map").number(f64::from(width)).number(f64::from(height));
        for (i, texel) in texels.iter_mut().enumerate() {
            if !texel.iter().all(|x| x.is_finite()) {
                let (column, row) = (i % width as usize, i / width as usize);
                return Err(Error::new(format!("non-finite radiance {texel:?} at column {column}, row {row}")));
            }
            *texel = texel.map(|x| x.max(0.0));
        }
        for row in texels.chunks(width as usize) {
            let bytes: Vec<u8> = row.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
            hasher = hasher.bytes(&bytes);
        }
        Ok(Self { name: name.into(), width, height, texels, license: String::new(), digest: hasher.finish() })
    }

    /// The same radiance from everywhere.
    pub fn constant(radiance: [f32; 3]) -> Self {
        let radiance = radiance.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        let digest = Hasher::new("constant environment").floats(radiance.into_iter()).finish();
        Self { name: "constant".into(), width: 1, height: 1, texels: vec![radiance], license: String::new(), digest }
    }

    /// Width, texels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, texels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Radiance, row-major `[height, width]`.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Mean over all directions, each weighted by its solid angle.
    pub fn mean(&self) -> [f64; 3] {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (row, texels) in self.texels.chunks(self.width as usize).enumerate() {
            let edge = |row: usize| libm::cos(PI * row as f64 / f64::from(self.height));
            let weight = (edge(row) - edge(row + 1)) / f64::from(self.width);
            for texel in texels {
                for (sum, &value) in sum.iter_mut().zip(texel) {
                    *sum += weight * f64::from(value);
                }
                weights += weight;
            }
        }
        sum.map(|sum| sum / weights)
    }

    /// Radiance from a unit direction in the map's frame, interpolated between texels.
    pub fn radiance(&self, direction: &Vector3<f64>) -> [f64; 3] {
        let [u, v] = Self::coordinates(direction);
        let (x, y) = (u * f64::from(self.width) - 0.5, v * f64::from(self.height) - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let texel = |column: i64, row: i64| {
            let column = column.rem_euclid(i64::from(self.width));
            let row = row.clamp(0, i64::from(self.height) - 1);
            self.texels[(row * i64::from(self.width) + column) as usize].map(f64::from)
        };
        let mut sum = [0.0; 3];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = |at: f64, step: i64| if step == 0 { 1.0 - at } else { at };
            let weight = weight(x - left, dx) * weight(y - top, dy);
            for (sum, value) in sum.iter_mut().zip(texel(left as i64 + dx, top as i64 + dy)) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// Irradiance on a plane with a unit normal in the map's frame, in units of its texels: a sum over parts of the
    /// texels. [`level_irradiance`](crate::photometry::level_irradiance) is exact for a level plane.
    pub fn irradiance(&self, normal: &Vector3<f64>) -> [f64; 3] {
        // Parts of a texel along each side, so that a map of few texels has directions enough.
        let [across, down] = [self.width, self.height].map(|texels| 128_u32.div_ceil(texels));
        let (columns, rows) = (self.width * across, self.height * down);
        let toward: Vec<[f64; 2]> = (0..columns)
            .map(|column| {
                let level = Self::direction([(f64::from(column) + 0.5) / f64::from(columns), 0.5]);
                [level.x, level.y]
            })
            .collect();
        let mut sum = [0.0; 3];
        for row in 0..rows {
            let edge = |row: u32| libm::cos(PI * f64::from(row) / f64::from(rows));
            let solid_angle = (edge(row) - edge(row + 1)) * TAU / f64::from(columns);
            let texels = &self.texels[(row / down * self.width) as usize..];
            let (sin, cos) = libm::sincos(PI * (f64::from(row) + 0.5) / f64::from(rows));
            for (column, [x, y]) in (0..columns).zip(&toward) {
                let cosine = sin * (x * normal.x + y * normal.y) + cos * normal.z;
                let weight = solid_angle * cosine.max(0.0);
                for (sum, &value) in sum.iter_mut().zip(&texels[(column / across) as usize]) {
                    *sum += weight * f64::from(value);
                }
            }
        }
        sum
    }

    /// Coordinates in [0, 1)² of a unit direction in the map's frame: `u` to the right, `v` downwards.
    pub fn coordinates(direction: &Vector3<f64>) -> [f64; 2] {
        let u = 0.5 - libm::atan2(direction.y, direction.x) / TAU;
        [u - u.floor(), libm::acos(direction.z.clamp(-1.0, 1.0)) * FRAC_1_PI]
    }

    /// The unit direction in the map's frame at coordinates in [0, 1]².
    pub fn direction([u, v]: [f64; 2]) -> Vector3<f64> {
        let (phi, theta) = (TAU * (0.5 - u), PI * v);
        Vector3::new(libm::sin(theta) * libm::cos(phi), libm::sin(theta) * libm::sin(phi), libm::cos(theta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_coordinates_agree() {
        for uv in [[0.5, 0.5], [0.1, 0.2], [0.9, 0.7], [0.25, 0.5]] {
            let back = EnvironmentMap::coordinates(&EnvironmentMap::direction(uv));
            assert!((back[0] - uv[0]).abs() < 1e-12 && (back[1] - uv[1]).abs() < 1e-12, "{uv:?} {back:?}");
        }
        assert!((EnvironmentMap::direction([0.5, 0.5]) - Vector3::x()).norm() < 1e-12);
        assert!((EnvironmentMap::direction([0.3, 0.0]) - Vector3::z()).norm() < 1e-12);
        // To the right of +x, seen from inside with z up, is -y.
        assert!((EnvironmentMap::direction([0.75, 0.5]) + Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn radiance_is_interpolated_and_irradiance_is_its_integral() {
        let texels = (0..8 * 4).map(|i| [i as f32, 1.0, 0.0]).collect();
        let map = EnvironmentMap::new("steps", 8, 4, texels).expect("sound");
        let at = |u: f64, v: f64| map.radiance(&EnvironmentMap::direction([u, v]))[0];
        assert!((at(2.5 / 8.0, 1.5 / 4.0) - 10.0).abs() < 1e-9, "the center of a texel");
        assert!((at(3.0 / 8.0, 1.5 / 4.0) - 10.5).abs() < 1e-9 && (at(2.5 / 8.0, 0.5) - 14.0).abs() < 1e-9);
        assert!((at(0.0, 1.5 / 4.0) - 11.5).abs() < 1e-9, "around the circle");
        // E = π L of an even map, on any plane; and of one that is even above the horizon.
        let tilted = Vector3::new(0.6, 0.0, 0.8);
        for normal in [Vector3::z(), -Vector3::y(), tilted] {
            let even = EnvironmentMap::constant([3.0; 3]).irradiance(&normal);
            assert!((even[1] / (3.0 * PI) - 1.0).abs() < 1e-3, "{even:?}");
        }
        let level = crate::photometry::level_irradiance(&map);
        let sum = map.irradiance(&Vector3::z());
        assert!((sum[0] / level[0] - 1.0).abs() < 1e-3, "{sum:?} {level:?}");
    }

    #[test]
    fn the_mean_is_by_solid_angle() {
        let mut texels = vec![[0.0; 3]; 8 * 4];
        texels[..16].fill([1.0, 2.0, 4.0]);
        let map = EnvironmentMap::new("half", 8, 4, texels).expect("sound");
        let mean = map.mean();
        assert!((mean[0] - 0.5).abs() < 1e-12 && (mean[2] - 2.0).abs() < 1e-12, "{mean:?}");
        assert!(EnvironmentMap::new("bad", 2, 1, vec![[0.0; 3], [f32::NAN; 3]]).is_err());
    }
}
