//! One level of the filter: 5 × 5 taps at a distance of some pixels.

use crate::guides::{Guides, falloff};
use crate::planes::{CHUNK, Chunk, Padded, Size, fill};
use crate::signal::{Signal, luminance};
use crate::tuning::Tuning;
use syntable_model::context::Workers;
use syntable_simd::{Processor, Simd, Task};

/// Inputs of a level.
pub(super) struct Level<'a> {
    pub guides: &'a Guides,
    pub tuning: &'a Tuning,
    pub from: &'a Signal,
    /// Means over a window, and their variance. They show which pixels are similar even if the light itself is too
    /// noisy.
    pub pilot: Option<&'a [Padded; 2]>,
    /// Distance of the taps, px.
    pub step: usize,
    /// Difference of light that costs one e-fold, in standard deviations.
    pub sigmas: f32,
    /// Difference of the window means that costs one e-fold, in standard deviations.
    pub pilot_sigmas: f32,
}

/// Applies a level.
pub(super) fn smooth(size: Size, workers: &dyn Workers, level: &Level, to: &mut Signal) {
    let (stride, processor) = (size.stride() as isize, Processor::detect());
    let Signal { color: [r, g, b], luminance, variance } = to;
    fill(size, workers, [r, g, b, luminance, variance], |position| {
        processor.run(Taps { level, at: position.at, stride })
    });
}

/// The taps of a chunk, as a task.
struct Taps<'a> {
    level: &'a Level<'a>,
    /// Index of the chunk's first pixel.
    at: usize,
    stride: isize,
}

impl Task for Taps<'_> {
    type Output = [Chunk; 5];

    // The compiler vectorizes the loops over a chunk, for any width of the instruction set.
    #[inline(always)]
    fn run<S: Simd>(self) -> [Chunk; 5] {
        self.level.chunk(self.at, self.stride)
    }
}

impl Level<'_> {
    #[inline(always)]
    fn chunk(&self, at: usize, stride: isize) -> [Chunk; 5] {
        let Self { guides, from, .. } = self;
        let (scale, least, most) = self.tuning.normal;
        let [per_light, per_pilot] = [self.sigmas, self.pilot_sigmas].map(|sigmas| 1.0 / (sigmas * sigmas));
        let [pr, pg, pb] = [0, 1, 2].map(|c| from.color[c].chunk(at));
        let own = from.variance.chunk(at);
        let level = self.pilot.map_or(&from.luminance, |[mean, _]| mean).chunk(at);
        let mut per_normal = [0.0; CHUNK];
        for i in 0..CHUNK {
            // The noisier the light, the more the normal of a tap may differ.
            let spread = scale * (own[i] / (level[i] * level[i] + 1e-12)).sqrt();
            let spread = if spread > least { spread } else { least };
            per_normal[i] = 1.0 / if spread < most { spread } else { most };
        }
        let mut sum = [[0.0; CHUNK]; 5];
        for dy in -2..=2_isize {
            for dx in -2..=2_isize {
                let (ox, oy) = (dx * self.step as isize, dy * self.step as isize);
                let there = (at as isize + oy * stride + ox) as usize;
                let mut cost = guides.cost(at, there, ox as f32, oy as f32, &per_normal);
                if let Some([mean, variance]) = self.pilot {
                    let (pu, pv) = (mean.chunk(at), variance.chunk(at));
                    let (qu, qv) = (mean.chunk(there), variance.chunk(there));
                    for i in 0..CHUNK {
                        let d = pu[i] - qu[i];
                        cost[i] += d * d * per_pilot / (pv[i] + qv[i] + 1e-8 * pu[i] * pu[i] + 1e-20);
                    }
                }
                let kernel = self.tuning.kernel[dx.unsigned_abs()] * self.tuning.kernel[dy.unsigned_abs()];
                let [qr, qg, qb] = [0, 1, 2].map(|c| from.color[c].chunk(there));
                let v = from.variance.chunk(there);
                for i in 0..CHUNK {
                    let (r, g, b) = (pr[i] - qr[i], pg[i] - qg[i], pb[i] - qb[i]);
                    let unlike = luminance([r * r, g * g, b * b]) * per_light;
                    let unlike = unlike / (own[i] + v[i] + 1e-8 * level[i] * level[i] + 1e-20);
                    let w = falloff(cost[i] + unlike) * kernel;
                    sum[0][i] += w * qr[i];
                    sum[1][i] += w * qg[i];
                    sum[2][i] += w * qb[i];
                    sum[3][i] += w * w * v[i];
                    sum[4][i] += w;
                }
            }
        }
        let mut out = [[0.0; CHUNK]; 5];
        for i in 0..CHUNK {
            // The pixel itself has weight 1, unless it has no surface.
            let per = 1.0 / (sum[4][i] + 1e-30);
            let color = [sum[0][i] * per, sum[1][i] * per, sum[2][i] * per];
            (out[0][i], out[1][i], out[2][i]) = (color[0], color[1], color[2]);
            out[3][i] = luminance(color);
            out[4][i] = sum[3][i] * per * per;
        }
        out
    }
}
