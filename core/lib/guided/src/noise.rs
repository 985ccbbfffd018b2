//! Noise estimation per pixel, and clamping of fireflies.

use crate::Signal;
use crate::guides::{Guides, falloff};
use crate::planes::{CHUNK, Chunk, Padded, Size, fill};
use crate::tuning::{FEWEST, PRIOR, SURE, Tuning};
use syntable_model::context::Workers;
use syntable_simd::{Processor, Simd, Task};

/// Radius of the window, px.
const REACH: isize = crate::tuning::REACH as isize;

/// Estimates from the window around each pixel.
pub(super) struct Noise {
    /// The signal without fireflies and with a smoothed variance.
    pub signal: Signal,
    /// Mean luminance of the window, and the variance of that mean.
    pub pilot: [Padded; 2],
}

/// Estimates noise from the neighbors of every pixel. The variance is the mean of the renderer's estimates, if it has
/// any (`known`), since a single estimate from few samples is unreliable; otherwise it is the variance among the
/// neighbors.
pub(super) fn estimate(
    size: Size,
    workers: &dyn Workers,
    guides: &Guides,
    from: &Signal,
    known: bool,
    tuning: &Tuning,
) -> Noise {
    let mut signal = Signal::new(size);
    let mut pilot = [Padded::new(size, 0.0), Padded::new(size, 0.0)];
    let Signal { color: [r, g, b], luminance, variance } = &mut signal;
    let [mean, of_mean] = &mut pilot;
    let (stride, processor) = (size.stride() as isize, Processor::detect());
    fill(size, workers, [r, g, b, luminance, variance, mean, of_mean], |position| {
        processor.run(Window { guides, from, known, tuning, at: position.at, stride })
    });
    Noise { signal, pilot }
}

/// The window around a chunk, as a task.
struct Window<'a> {
    guides: &'a Guides,
    from: &'a Signal,
    known: bool,
    tuning: &'a Tuning,
    /// Index of the chunk's first pixel.
    at: usize,
    stride: isize,
}

impl Task for Window<'_> {
    type Output = [Chunk; 7];

    // The compiler vectorizes the loops over a chunk, for any width of the instruction set.
    #[inline(always)]
    fn run<S: Simd>(self) -> [Chunk; 7] {
        let Self { guides, from, known, tuning, at, stride } = self;
        look(guides, from, known, tuning, at, stride)
    }
}

#[inline(always)]
fn look(guides: &Guides, from: &Signal, known: bool, tuning: &Tuning, at: usize, stride: isize) -> [Chunk; 7] {
    let zero = [0.0; CHUNK];
    let per_normal = [tuning.per_normal; CHUNK];
    // Sums over similar taps: weights, squared weights, luminance, squared luminance, variance. Then sums over all
    // surfaces.
    let (mut w1, mut w2, mut m1, mut m2, mut mv) = (zero, zero, zero, zero, zero);
    let (mut all, mut all_l, mut all_v) = (zero, zero, zero);
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            if (dx, dy) == (0, 0) {
                continue;
            }
            let there = (at as isize + dy * stride + dx) as usize;
            let cost = guides.cost(at, there, dx as f32, dy as f32, &per_normal);
            let (l, v, id) = (from.luminance.chunk(there), from.variance.chunk(there), guides.id.chunk(there));
            for i in 0..CHUNK {
                let w = falloff(cost[i]);
                w1[i] += w;
                w2[i] += w * w;
                m1[i] += w * l[i];
                m2[i] += w * (l[i] * l[i]);
                mv[i] += w * v[i];
                let any = if id[i] >= 0.0 { 1.0 } else { 0.0 };
                all[i] += any;
                all_l[i] += any * l[i];
                all_v[i] += any * v[i];
            }
        }
    }
    let color = [0, 1, 2].map(|c| from.color[c].chunk(at));
    let (l, v) = (from.luminance.chunk(at), from.variance.chunk(at));
    let mut out = [zero; 7];
    for i in 0..CHUNK {
        let mean = m1[i] / (w1[i] + 1e-6);
        let spread = m2[i] / (w1[i] + 1e-6) - mean * mean;
        let spread = if spread > 0.0 { spread } else { 0.0 };
        let usual = mean + tuning.firefly * spread.sqrt();
        // Light that the pixel's own samples confirm is not clamped.
        let sure = if known { l[i] - SURE * v[i].sqrt() } else { 0.0 };
        let limit = if usual > sure { usual } else { sure };
        let kept = if w1[i] > FEWEST && l[i] > limit { limit } else { l[i] };
        let factor = kept / (l[i] + 1e-30);
        let factor = if kept < l[i] { factor } else { 1.0 };
        let loose = all_l[i] / (all[i] + 1e-6);
        let variance = if known {
            (mv[i] + v[i] + PRIOR * all_v[i] / (all[i] + 1e-6)) / (w1[i] + 1.0 + PRIOR)
        } else {
            (w1[i] * spread + PRIOR * loose * loose) / (w1[i] + PRIOR)
        };
        let total = w1[i] + 1.0;
        for c in 0..3 {
            out[c][i] = color[c][i] * factor;
        }
        out[3][i] = kept;
        out[4][i] = variance;
        out[5][i] = (m1[i] + kept) / total;
        out[6][i] = variance * (w2[i] + 1.0) / (total * total);
    }
    out
}
