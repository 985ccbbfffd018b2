//! Images computed row by row on several threads, Gaussian filters, and fields of normal random numbers.

use std::sync::Mutex;
use syntable_model::context::Workers;
use syntable_model::product::Plane;
use syntable_model::random::Stream;

/// Rows per job.
const BAND: usize = 16;

/// Calls `job(y, row)` for every row of an image, in any order, on several threads.
pub fn rows<T: Send>(workers: &dyn Workers, width: u32, data: &mut [T], job: impl Fn(u32, &mut [T]) + Sync) {
    let width = width as usize;
    if width == 0 {
        return;
    }
    let bands: Vec<Mutex<&mut [T]>> = data.chunks_mut(width * BAND).map(Mutex::new).collect();
    workers.run(bands.len(), &|index| {
        let mut band = bands[index].lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        for (i, row) in band.chunks_mut(width).enumerate() {
            job((index * BAND + i) as u32, row);
        }
    });
}

/// An image from a function that fills its rows.
pub fn filled<T: Copy + Send + Default>(
    workers: &dyn Workers,
    [width, height]: [u32; 2],
    job: impl Fn(u32, &mut [T]) + Sync,
) -> Plane<T> {
    let mut data = vec![T::default(); width as usize * height as usize];
    rows(workers, width, &mut data, job);
    Plane::from_vec(width, height, data)
}

/// One half of a symmetric Gaussian kernel: weights at 0, 1, … up to four standard deviations. The whole kernel sums to
/// one.
pub fn gaussian(sigma: f64) -> Vec<f32> {
    let radius = (4.0 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=radius).map(|k| libm::exp(-0.5 * (k as f64 / sigma).powi(2))).collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.into_iter().map(|weight| (weight / sum) as f32).collect()
}

/// A pixel that can be filtered.
pub trait Filtered: Copy + Default + Send + Sync {
    /// `self + weight · other`.
    fn plus(self, weight: f32, other: Self) -> Self;
}

impl Filtered for f32 {
    fn plus(self, weight: f32, other: Self) -> Self {
        self + weight * other
    }
}

impl<const N: usize> Filtered for [f32; N]
where
    [f32; N]: Default,
{
    fn plus(self, weight: f32, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + weight * other[i])
    }
}

/// An image convolved with a symmetric kernel along both axes. It is continued by reflection at its edges, so a kernel
/// that sums to one preserves the mean.
pub fn convolved<T: Filtered>(workers: &dyn Workers, image: &Plane<T>, half: &[f32]) -> Plane<T> {
    let size = [image.width(), image.height()];
    let along = |length: u32, at: u32, get: &dyn Fn(u32) -> T| {
        let mut sum = T::default().plus(half[0], get(at));
        for (k, &weight) in half.iter().enumerate().skip(1) {
            let (before, after) = (i64::from(at) - k as i64, i64::from(at) + k as i64);
            sum = sum.plus(weight, get(reflected(before, length))).plus(weight, get(reflected(after, length)));
        }
        sum
    };
    let across = filled(workers, size, |y, row: &mut [T]| {
        for (x, out) in row.iter_mut().enumerate() {
            *out = along(size[0], x as u32, &|x| *image.at(x, y));
        }
    });
    filled(workers, size, |y, row: &mut [T]| {
        for (x, out) in row.iter_mut().enumerate() {
            *out = along(size[1], y, &|y| *across.at(x as u32, y));
        }
    })
}

/// A coordinate reflected at the edges of 0..length until it is inside.
fn reflected(at: i64, length: u32) -> u32 {
    let length = i64::from(length);
    let folded = at.rem_euclid(2 * length);
    folded.min(2 * length - 1 - folded) as u32
}

/// Two independent standard normal numbers (Box and Muller).
pub fn normal_pair(stream: &mut Stream) -> [f64; 2] {
    let radius = (-2.0 * libm::log(1.0 - stream.unit())).sqrt();
    let (sine, cosine) = libm::sincos(std::f64::consts::TAU * stream.unit());
    [radius * cosine, radius * sine]
}

/// Standard normal numbers, one per pixel: white noise filtered by a Gaussian of `sigma` pixels, or independent for
/// `sigma` = 0. Mean 0 and variance 1 everywhere, also at the edges.
pub fn normal_field(workers: &dyn Workers, [width, height]: [u32; 2], sigma: f64, stream: &Stream) -> Plane<f32> {
    let half = if sigma > 0.0 { gaussian(sigma) } else { vec![1.0] };
    let margin = half.len() as u32 - 1;
    let size = [width + 2 * margin, height + 2 * margin];
    let white = filled(workers, size, |y, row: &mut [f32]| {
        let mut stream = stream.at(y.into());
        for pair in row.chunks_mut(2) {
            let normals = normal_pair(&mut stream).map(|normal| normal as f32);
            pair.copy_from_slice(&normals[..pair.len()]);
        }
    });
    if margin == 0 {
        return white;
    }
    let smooth = convolved(workers, &white, &half);
    // The variance of a sum of independent numbers, along one axis and then the other.
    let power = half[0] * half[0] + 2.0 * half[1..].iter().map(|weight| weight * weight).sum::<f32>();
    Plane::from_fn(width, height, |x, y| smooth.at(x + margin, y + margin) / power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Serial;
    use syntable_testing::workers::Threads;

    #[test]
    fn reflection_repeats_the_edge_pixel() {
        let at = |x| reflected(x, 3);
        assert_eq!([-4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6].map(at), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(reflected(-7, 1), 0);
    }

    #[test]
    fn threads_do_not_matter() {
        let field = |workers: &dyn Workers| normal_field(workers, [37, 53], 1.5, &Stream::root(4));
        assert_eq!(field(&Serial), field(&Threads(3)));
    }

    #[test]
    fn a_kernel_is_a_gaussian_of_sum_one() {
        for sigma in [0.8, 1.5, 4.0] {
            let half = gaussian(sigma);
            let both = |f: &dyn Fn(f64) -> f64| -> f64 {
                half.iter().enumerate().map(|(k, &w)| f64::from(w) * f(k as f64) * if k == 0 { 1.0 } else { 2.0 }).sum()
            };
            assert!((both(&|_| 1.0) - 1.0).abs() < 1e-6);
            assert!((both(&|k| k * k) / (sigma * sigma) - 1.0).abs() < 2e-3, "{sigma}");
        }
    }
}
