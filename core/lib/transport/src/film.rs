//! Renders images in rounds: distributes samples over squares, and reports the result.

use crate::camera::RayCamera;
use crate::sums::PixelSums;
use parking_lot::Mutex;
use std::ops::Range;
use std::time::Instant;
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_model::photometry::luminance;
use syntable_model::product::standard::{
    DENOISE_ALBEDO, DENOISE_NORMAL, OPACITY, RADIANCE, RADIANCE_DEMODULATED, RADIANCE_DEMODULATED_VARIANCE,
    RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE, RADIANCE_VARIANCE, RENDER_REPORT,
};
use syntable_model::product::{KeyId, Plane, Products, Value};
use syntable_model::stage::{Tile, Window};

/// Edge of the squares of pixels. A square is one job, and stops as a whole.
const SQUARE: i32 = 16;

/// Samples of the first round if squares may stop early: enough to estimate their noise.
const FIRST_ROUND: u32 = 16;

/// Additional samples of the guides of pixels that differ from their neighbors. With this many path samples, guides are
/// clean without additional ones.
pub const GUIDE_SAMPLES: u32 = 8;

/// Neighbors count as different from this difference of base color or normal.
pub const DIFFERENT: f32 = 0.1;

/// Minimum ratio of a firefly to the median of the 5 × 5 pixels around it. Viewers notice such a pixel.
const FIREFLY: f64 = 3.0;

/// Minimum standard error of a firefly, as a fraction of its luminance: one or two samples cause it. Truly bright
/// pixels, such as highlights and lights, have a smaller error.
const FIREFLY_ERROR: f64 = 0.5;

/// Limits on samples and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleBudget {
    /// Maximum samples per pixel.
    pub samples: u32,
    /// Relative error below which squares stop early.
    pub noise: Option<f64>,
    /// Time limit, seconds after the start. No round starts that would end later if it takes as long as the last round.
    pub seconds: Option<f64>,
}

impl SampleBudget {
    /// Whether all pixels get the same number of samples.
    pub fn is_fixed(&self) -> bool {
        self.noise.is_none() && self.seconds.is_none()
    }
}

/// Samples to add to pixels of a square.
pub struct Task<'a> {
    /// Number of its tile.
    pub tile: usize,
    /// Left, top, right, bottom of the square, px from the corner of the image.
    pub area: [i32; 4],
    /// Numbers of the pixels in the square, row by row.
    pub pixels: &'a [u16],
    /// Samples to trace per pixel.
    pub samples: Range<u32>,
    /// Sums of all pixels of the square, row by row.
    pub sums: &'a mut [PixelSums],
}

/// Column and row in the image of a pixel of a square [left, top, right, bottom].
pub fn place([left, top, right, _]: [i32; 4], pixel: u16) -> (i32, i32) {
    let pixel = i32::from(pixel);
    (left + pixel % (right - left), top + pixel / (right - left))
}

/// Numbers of paths and rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Paths started.
    pub paths: u64,
    /// Rays that searched for the first surface, camera rays included.
    pub rays: u64,
    /// Rays that tested whether a light is occluded.
    pub shadow_rays: u64,
}

impl Statistics {
    /// Adds the numbers of other work.
    pub fn add(&mut self, other: &Self) {
        self.paths += other.paths;
        self.rays += other.rays;
        self.shadow_rays += other.shadow_rays;
    }
}

/// Traces the samples of an image.
pub trait Tracer {
    /// Whether guides are gathered with the light.
    fn has_guides(&self) -> bool;
    /// Adds samples to the sums of squares. All tasks have different squares and the same number of samples.
    fn trace(&self, tasks: Vec<Task>, workers: &dyn Workers) -> Result<Statistics>;
    /// Adds samples of the guides alone; `samples` of them are planned per pixel.
    fn trace_guides(&self, samples: u32, tasks: Vec<Task>, workers: &dyn Workers) -> Result<()>;
}

/// An image in progress: sums per pixel, by square.
pub struct Film {
    size: [u32; 2],
    tiles: Vec<TileFilm>,
    /// Numbers so far.
    pub statistics: Statistics,
}

/// Film of a tile.
struct TileFilm {
    window: Window,
    /// Column and row of the window in the image.
    at: [u32; 2],
    squares: Vec<Mutex<Square>>,
}

struct Square {
    /// Left, top, right, bottom, px from the corner of the image.
    area: [i32; 4],
    /// 0, 1, 2, …
    pixels: Vec<u16>,
    sums: Vec<PixelSums>,
    done: bool,
}

/// Changes the seed of paths that are traced for guides alone.
const GUIDES: u64 = 0x5851_f42d_4c95_7f2d;

/// Seed of the paths of an image that are traced for guides alone.
pub fn guide_seed(seed: u64) -> u64 {
    seed ^ GUIDES
}

/// Products for denoisers that are gathered along with the light.
const OF_GUIDES: [KeyId; 6] = [
    DENOISE_ALBEDO.id(),
    DENOISE_NORMAL.id(),
    RADIANCE_SPECULAR.id(),
    RADIANCE_SPECULAR_VARIANCE.id(),
    RADIANCE_DEMODULATED.id(),
    RADIANCE_DEMODULATED_VARIANCE.id(),
];

impl Film {
    /// Products that a film has.
    pub fn offers() -> Vec<KeyId> {
        [RADIANCE.id(), RADIANCE_VARIANCE.id(), RENDER_REPORT.id(), OPACITY.id()].into_iter().chain(OF_GUIDES).collect()
    }

    /// Whether any of the products needs guides.
    pub fn wants_guides(wants: &[KeyId]) -> bool {
        wants.iter().any(|want| OF_GUIDES.contains(want))
    }

    /// Stores the wanted products of this film.
    ///
    /// # Errors
    /// If a product exists already.
    pub fn put(&self, wants: &[KeyId], camera: &RayCamera, workers: &dyn Workers, frame: &mut Products) -> Result<()> {
        for &want in wants {
            if want == RADIANCE.id() {
                frame.put(RADIANCE, self.radiance(workers))?;
            } else if want == RADIANCE_VARIANCE.id() {
                frame.put(RADIANCE_VARIANCE, self.plane(workers, 0.0, |sums| sums.variance() as f32))?;
            } else if want == OPACITY.id() {
                frame.put(OPACITY, self.plane(workers, 0.0, PixelSums::opacity))?;
            } else if want == DENOISE_ALBEDO.id() {
                frame.put(DENOISE_ALBEDO, self.plane(workers, [0.0; 3], PixelSums::mean_albedo))?;
            } else if want == DENOISE_NORMAL.id() {
                let mean = |sums: &PixelSums| camera.rotate_to_camera(sums.mean_normal().into()).array();
                frame.put(DENOISE_NORMAL, self.plane(workers, [0.0; 3], mean))?;
            } else if want == RADIANCE_SPECULAR.id() {
                frame.put(RADIANCE_SPECULAR, self.plane(workers, [0.0; 3], |sums| sums.specular.mean(sums.samples)))?;
            } else if want == RADIANCE_SPECULAR_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.specular.variance(sums.samples);
                frame.put(RADIANCE_SPECULAR_VARIANCE, self.plane(workers, 0.0, variance))?;
            } else if want == RADIANCE_DEMODULATED.id() {
                frame.put(
                    RADIANCE_DEMODULATED,
                    self.plane(workers, [0.0; 3], |sums| sums.demodulated.mean(sums.samples)),
                )?;
            } else if want == RADIANCE_DEMODULATED_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.demodulated.variance(sums.samples);
                frame.put(RADIANCE_DEMODULATED_VARIANCE, self.plane(workers, 0.0, variance))?;
            } else if want == RENDER_REPORT.id() {
                frame.put(RENDER_REPORT, self.report(workers))?;
            }
        }
        Ok(())
    }

    /// Renders the tiles of an image of a width and height.
    ///
    /// # Errors
    /// Errors of the tracer.
    pub fn trace(
        tracer: &impl Tracer,
        size: [u32; 2],
        tiles: &[Tile],
        budget: &SampleBudget,
        workers: &dyn Workers,
    ) -> Result<Self> {
        let tiles = tiles.iter().map(TileFilm::new).collect();
        let mut film = Self { size, tiles, statistics: Statistics::default() };
        let whole = budget.is_fixed();
        let (started, mut from) = (Instant::now(), 0);
        while from < budget.samples {
            let to = match (whole, from) {
                (true, _) => budget.samples,
                (_, 0) if budget.seconds.is_some() => 1,
                (_, 0) => FIRST_ROUND.min(budget.samples),
                _ => (2 * from).min(budget.samples),
            };
            // The clock is read only to compare the time with the budget.
            let elapsed = started.elapsed().as_secs_f64();
            let predicted = if from == 0 { 0.0 } else { elapsed * f64::from(to) / f64::from(from) };
            let to = match budget.seconds {
                Some(limit) if from > 0 && predicted > limit => {
                    let fitting = f64::from(from) * limit / elapsed.max(1e-9);
                    if fitting < f64::from(from) + 1.0 {
                        break;
                    }
                    (fitting as u32).min(to)
                }
                _ => to,
            };
            film.round(tracer, from..to, workers)?;
            if let Some(noise) = budget.noise
                && film.stop_quiet_squares(noise)
            {
                break;
            }
            from = to;
        }
        if tracer.has_guides() {
            film.clean_guides(tracer, workers)?;
        }
        Ok(film)
    }

    fn round(&mut self, tracer: &impl Tracer, samples: Range<u32>, workers: &dyn Workers) -> Result<()> {
        let mut tasks = Vec::new();
        for (tile, film) in self.tiles.iter_mut().enumerate() {
            let open = film.squares.iter_mut().map(Mutex::get_mut).filter(|square| !square.done);
            tasks.extend(open.map(|Square { area, pixels, sums, .. }| Task {
                tile,
                area: *area,
                pixels,
                samples: samples.clone(),
                sums,
            }));
        }
        self.statistics.add(&tracer.trace(tasks, workers)?);
        Ok(())
    }

    /// Adds samples of the guides to pixels that have few and differ from a neighbor. Denoisers would see mostly noise
    /// there, and a ray for guides alone costs a small part of a path.
    fn clean_guides(&mut self, tracer: &impl Tracer, workers: &dyn Workers) -> Result<()> {
        let chosen: Vec<Vec<Vec<u16>>> = self.tiles.iter().map(|film| film.unclean(workers)).collect();
        let mut tasks = Vec::new();
        for ((tile, film), chosen) in self.tiles.iter_mut().enumerate().zip(&chosen) {
            let squares = film.squares.iter_mut().map(Mutex::get_mut).zip(chosen);
            tasks.extend(squares.filter(|(_, chosen)| !chosen.is_empty()).map(|(square, pixels)| Task {
                tile,
                area: square.area,
                pixels,
                samples: 0..GUIDE_SAMPLES,
                sums: &mut square.sums,
            }));
        }
        tracer.trace_guides(GUIDE_SAMPLES, tasks, workers)
    }

    /// Marks squares with small error as finished. Returns whether all are.
    ///
    /// The error of a square is the mean over its pixels of standard error over luminance. A tenth of the image's mean
    /// is added to the luminance, because noise in dark areas is hard to see.
    fn stop_quiet_squares(&mut self, noise: f64) -> bool {
        let mean_of = |sums: &PixelSums| luminance(sums.radiance) / f64::from(sums.samples.max(1));
        let mut squares: Vec<&mut Square> =
            self.tiles.iter_mut().flat_map(|film| &mut film.squares).map(Mutex::get_mut).collect();
        let (mut total, mut pixels) = (0.0, 0.0);
        for square in &squares {
            total += square.sums.iter().map(mean_of).sum::<f64>();
            pixels += square.sums.len() as f64;
        }
        let floor = (0.1 * total / pixels).max(1e-9);
        let mut all = true;
        for square in &mut squares {
            let error: f64 = square.sums.iter().map(|sums| sums.variance().sqrt() / (mean_of(sums) + floor)).sum();
            square.done = square.done || error < noise * square.sums.len() as f64;
            all &= square.done;
        }
        all
    }

    /// A plane of one value per pixel; `zero` outside the tiles.
    pub fn plane<T: Copy + Send>(
        &self,
        workers: &dyn Workers,
        zero: T,
        value: impl Fn(&PixelSums) -> T + Sync,
    ) -> Plane<T> {
        let [width, height] = self.size;
        if let [film] = &self.tiles[..]
            && [film.window.width, film.window.height] == self.size
        {
            return film.plane(workers, zero, value);
        }
        let mut plane = Plane::from_vec(width, height, vec![zero; width as usize * height as usize]);
        for film in &self.tiles {
            plane.paste(film.at, &film.plane(workers, zero, &value));
        }
        plane
    }

    /// Mean radiance over the area of every pixel, nits.
    pub fn radiance(&self, workers: &dyn Workers) -> Plane<[f32; 3]> {
        self.plane(workers, [0.0; 3], |sums| sums.radiance.map(|x| (x / f64::from(sums.samples.max(1))) as f32))
    }

    /// Numbers of rays, samples and fireflies, and the relative error.
    pub fn report(&self, workers: &dyn Workers) -> Value {
        let samples = self.plane(workers, 0_u32, |sums| sums.samples);
        let count = |least: bool| {
            let all = samples.data().iter().copied();
            if least { all.min() } else { all.max() }.unwrap_or(0)
        };
        let variance = self.plane(workers, 0.0, |sums| sums.variance() as f32);
        report(&self.radiance(workers), &variance, [count(true), count(false)], self.statistics)
    }
}

impl TileFilm {
    fn new(&Tile { window, at, .. }: &Tile) -> Self {
        let square = |(left, top): (i32, i32)| {
            let area = [left, top, (left + SQUARE).min(window.right()), (top + SQUARE).min(window.bottom())];
            let pixels = (area[2] - left) * (area[3] - top);
            let pixels = 0..pixels as u16;
            let sums = vec![PixelSums::default(); pixels.len()];
            Mutex::new(Square { area, sums, pixels: pixels.collect(), done: false })
        };
        let columns = || (window.x..window.right()).step_by(SQUARE as usize);
        let rows = (window.y..window.bottom()).step_by(SQUARE as usize);
        let squares = rows.flat_map(|top| columns().map(move |left| (left, top)));
        Self { window, at, squares: squares.map(square).collect() }
    }

    /// For each square, the pixels with too few guide samples that differ from a neighbor.
    fn unclean(&self, workers: &dyn Workers) -> Vec<Vec<u16>> {
        let albedo = self.plane(workers, [0.0; 3], PixelSums::mean_albedo);
        let normal = self.plane(workers, [0.0; 3], PixelSums::mean_normal);
        let window = self.window;
        let chosen: Vec<Mutex<Vec<u16>>> = self.squares.iter().map(|_| Mutex::default()).collect();
        workers.run(self.squares.len(), &|number| {
            let square = self.squares[number].lock();
            let differs = |pixel: &u16| {
                let (x, y) = place(square.area, *pixel);
                let (x, y) = ((x - window.x) as usize, (y - window.y) as usize);
                let sums = &square.sums[usize::from(*pixel)];
                // Paths that glass reflected carry no information.
                let reflected = sums.guide_samples < sums.samples;
                sums.guide_samples < GUIDE_SAMPLES
                    && (reflected || [&albedo, &normal].iter().any(|guide| differs_from_neighbors(guide, x, y)))
            };
            *chosen[number].lock() = square.pixels.iter().copied().filter(differs).collect();
        });
        chosen.into_iter().map(Mutex::into_inner).collect()
    }

    fn plane<T: Copy + Send>(
        &self,
        workers: &dyn Workers,
        zero: T,
        value: impl Fn(&PixelSums) -> T + Sync,
    ) -> Plane<T> {
        let Window { width, height, .. } = self.window;
        let mut data = vec![zero; width as usize * height as usize];
        let rows = SQUARE as usize * width as usize;
        let bands: Vec<_> =
            data.chunks_mut(rows).zip(self.squares.chunks(width.div_ceil(SQUARE as u32) as usize)).collect();
        let bands: Vec<_> = bands.into_iter().map(Mutex::new).collect();
        workers.run(bands.len(), &|number| {
            let (pixels, squares) = &mut *bands[number].lock();
            for square in *squares {
                let square = square.lock();
                let [left, right] = [square.area[0], square.area[2]].map(|x| (x - self.window.x) as usize);
                for (row, sums) in pixels.chunks_mut(width as usize).zip(square.sums.chunks(right - left)) {
                    for (pixel, sums) in row[left..right].iter_mut().zip(sums) {
                        *pixel = value(sums);
                    }
                }
            }
        });
        Plane::from_vec(width, height, data)
    }
}

/// The product [`RENDER_REPORT`] of an image: numbers of rays, minimum and maximum number of samples of a pixel, number
/// of fireflies, and relative error.
pub fn report(
    radiance: &Plane<[f32; 3]>,
    variance: &Plane<f32>,
    [samples_min, samples_max]: [u32; 2],
    statistics: Statistics,
) -> Value {
    let Statistics { paths, rays, shadow_rays } = statistics;
    let error = variance.map(|&variance| f64::from(variance).sqrt());
    let total: f64 = radiance.data().iter().map(|pixel| luminance(pixel.map(f64::from))).sum();
    let relative = if total > 0.0 { error.data().iter().sum::<f64>() / total } else { 0.0 };
    let mut record = vec![
        ("paths", (paths as i64).into()),
        ("rays", (rays as i64).into()),
        ("shadow_rays", (shadow_rays as i64).into()),
        ("samples_min", samples_min.into()),
        ("samples_max", samples_max.into()),
        ("fireflies", fireflies(radiance, &error).into()),
    ];
    // A single sample has no error estimate.
    if relative.is_finite() {
        record.push(("relative_error", relative.into()));
    }
    Value::record(record)
}

/// Whether a pixel's guide differs from one of the eight around it.
fn differs_from_neighbors(guide: &Plane<[f32; 3]>, x: usize, y: usize) -> bool {
    let (width, height) = (guide.width() as usize, guide.height() as usize);
    let here = guide.data()[y * width + x];
    let rows = guide.data().chunks(width).take((y + 2).min(height)).skip(y.saturating_sub(1));
    let mut around = rows.flat_map(|row| &row[x.saturating_sub(1)..(x + 2).min(width)]);
    around.any(|there| (0..3).any(|c| (here[c] - there[c]).abs() > DIFFERENT))
}

/// Number of pixels that are far brighter than their surroundings by chance. `error` is the standard error of the
/// luminance. An image with one sample per pixel has no fireflies, because it has no error estimate.
fn fireflies(radiance: &Plane<[f32; 3]>, error: &Plane<f64>) -> u32 {
    let (width, height) = (radiance.width() as usize, radiance.height() as usize);
    let y: Vec<f64> = radiance.data().iter().map(|pixel| luminance(pixel.map(f64::from))).collect();
    let by_chance = |&at: &usize| error.data()[at] > FIREFLY_ERROR * y[at];
    let is_far_brighter = |&at: &usize| {
        let (row, column) = (at / width, at % width);
        let rows = row.saturating_sub(2)..(row + 3).min(height);
        let mut around: Vec<f64> =
            rows.flat_map(|r| &y[r * width..][column.saturating_sub(2)..(column + 3).min(width)]).copied().collect();
        let middle = around.len() / 2;
        y[at] > FIREFLY * *around.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    (0..y.len()).filter(by_chance).filter(is_far_brighter).count() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fireflies_are_bright_by_chance() {
        let at = |bright: &[(u32, u32)], error: f64| {
            let is_bright = |x, y| bright.contains(&(x, y));
            let radiance = Plane::from_fn(9, 7, |x, y| if is_bright(x, y) { [9.0; 3] } else { [1.0; 3] });
            let error = Plane::from_fn(9, 7, |x, y| if is_bright(x, y) { 9.0 * error } else { 0.1 });
            fireflies(&radiance, &error)
        };
        assert_eq!(at(&[(0, 0), (4, 3)], 0.9), 2);
        assert_eq!(at(&[(4, 3), (5, 3)], 0.9), 2, "side by side");
        assert_eq!(at(&[(4, 3), (5, 3)], 0.1), 0, "a light of two pixels is not a firefly");
        assert_eq!(at(&[(4, 3)], f64::NAN), 0, "one sample");
        assert_eq!(at(&[], 0.9), 0);
    }
}
