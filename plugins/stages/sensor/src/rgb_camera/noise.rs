//! Noise of an image sensor.

use crate::image_filter::rows;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::context::Workers;
use syntable_model::dist::Dist;
use syntable_model::error::ConfigError;
use syntable_model::product::{Plane, Value};
use syntable_model::random::Stream;

/// Poisson–Gaussian noise of photons and read-out, before white balance and tone curve.
///
/// With `x` the linear signal, 1 at white, a pixel collects `Poisson(W x)` electrons, `W = full_well_e · 100 / iso`,
/// and read-out adds a Gaussian of `read_noise_e` electrons. The noise of `x` has the variance `a x + b` with `a = 1 /
/// W` and `b = (read_noise_e / W)²` (Foi et al., IEEE Trans. Image Processing 17, 2008; EMVA 1288 states the same in
/// electrons). Channels and pixels are independent: the sensor has no color filter array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// ISO sensitivity, from 1 to 1,000,000. It does not change the brightness: a higher value means fewer electrons.
    #[schemars(extend("minimum" = ISO[0], "maximum" = ISO[1]))]
    pub iso: Dist,
    /// Electrons at white at ISO 100. Pixels of 1.4 µm hold about 5,000, pixels of 3 µm about 15,000.
    #[schemars(range(min = 10.0, max = 1e7))]
    pub full_well_e: f64,
    /// Standard deviation of the read noise, electrons.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub read_noise_e: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self { iso: Dist::Constant(400.0), full_well_e: 10_000.0, read_noise_e: 3.0 }
    }
}

/// Mean from which Poisson numbers are approximated by a Gaussian: their skewness is then below 0.15.
const MANY: f64 = 50.0;
/// Limits of `iso`.
const ISO: [f64; 2] = [1.0, 1e6];

impl Noise {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.iso.within("noise.iso", ISO[0], ISO[1])
    }

    /// Adds noise to an image in which `white` nits are white. Returns the parameters.
    pub(super) fn apply(
        &self,
        image: &mut Plane<[f32; 3]>,
        white: f64,
        workers: &dyn Workers,
        stream: &Stream,
    ) -> Value {
        let iso = self.iso.draw(&mut stream.child("iso"));
        let electrons_at_white = self.full_well_e * 100.0 / iso;
        let (to_electrons, to_nits) = (electrons_at_white / white, white / electrons_at_white);
        let pixels = stream.child("pixels");
        rows(workers, image.width(), image.data_mut(), |y, row| {
            let mut stream = pixels.at(y.into());
            for pixel in row {
                *pixel = pixel.map(|nits| {
                    let mean = f64::from(nits).max(0.0) * to_electrons;
                    (counted(mean, self.read_noise_e, &mut stream) * to_nits) as f32
                });
            }
        });
        Value::record([
            ("iso", iso.into()),
            ("full_well_e", self.full_well_e.into()),
            ("read_noise_e", self.read_noise_e.into()),
            ("electrons_at_white", electrons_at_white.into()),
        ])
    }
}

/// A random number of electrons, read noise included, where `mean` are expected.
fn counted(mean: f64, read_noise: f64, stream: &mut Stream) -> f64 {
    if mean >= MANY {
        return mean + (mean + read_noise * read_noise).sqrt() * stream.normal();
    }
    // Inversion: subtract the terms of the distribution from a uniform number, one after the other.
    let (mut left, mut term, mut count) = (stream.unit(), libm::exp(-mean), 0.0);
    while left >= term && count < 10.0 * MANY {
        left -= term;
        count += 1.0;
        term *= mean / count;
    }
    if read_noise > 0.0 { count + read_noise * stream.normal() } else { count }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_testing::stats::{chi_square_p, sidak};

    #[test]
    fn few_electrons_are_poisson() {
        for (i, mean) in [0.3_f64, 4.0, 30.0].into_iter().enumerate() {
            let mut stream = Stream::root(7).at(i as u64);
            let (draws, bins) = (20_000, (mean + 3.0 * mean.sqrt()) as usize + 1);
            let mut observed = vec![0; bins + 1];
            for _ in 0..draws {
                observed[(counted(mean, 0.0, &mut stream) as usize).min(bins)] += 1;
            }
            let mut expected = vec![(-mean).exp() * f64::from(draws)];
            (1..bins).for_each(|k| expected.push(expected[k - 1] * mean / k as f64));
            expected.push(f64::from(draws) - expected.iter().sum::<f64>());
            // Bins with few counts are merged.
            let (mut o, mut e) = (Vec::new(), Vec::new());
            let mut open = (0, 0.0);
            for (count, want) in observed.into_iter().zip(expected) {
                open = (open.0 + count, open.1 + want);
                if open.1 >= 10.0 {
                    o.push(open.0);
                    e.push(open.1);
                    open = (0, 0.0);
                }
            }
            if let (Some(o), Some(e)) = (o.last_mut(), e.last_mut()) {
                (*o, *e) = (*o + open.0, *e + open.1);
            }
            assert!(chi_square_p(&o, &e) > sidak(0.001, 3), "mean {mean}");
        }
    }
}
