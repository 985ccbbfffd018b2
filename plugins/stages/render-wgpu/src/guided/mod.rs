//! The filter `guided` of `syntable-guided` on a device: the same steps with the same numbers.
//!
//! Kernels, from first to last: `surfaces` and `borders` write guides and light, `noise` estimates noise and clamps
//! fireflies, `level` filters one part at one distance, `join` adds the parts up, and `average`, `brightness`,
//! `factors` and `restore` give the image its energy back. Sums are added in one order, so that the same device makes
//! the same bytes.

pub(crate) mod kernels;

use crate::device::Device;
use crate::guided::kernels::Kernels;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;
use syntable_guided::Guided;
use syntable_guided::tuning::{CELL, DIFFUSE, SPECULAR, Tuning};
use syntable_model::error::{Error, Result};
use syntable_model::stage::Denoiser;

/// Bytes between the uniforms of two dispatches.
const STRIDE: usize = 256;

/// Edge of the workgroups of most kernels, px.
const GROUP: u32 = 8;

/// A plane that does not exist.
const NONE: u32 = u32::MAX;

/// The denoiser as [`Guided`], the only one that runs on devices.
pub fn guided_of(denoiser: Option<&dyn Denoiser>) -> Option<&Guided> {
    denoiser.and_then(|denoiser| denoiser.as_any()?.downcast_ref())
}

/// Where the planes of an image are in a buffer of 32-bit words: the first word of each.
///
/// Planes are row-major, without gaps. They hold floats unless the field names another type. Colors and normals are
/// interleaved, three words per pixel. Infinite and larger numbers are written as 3.0e38; no number is NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sections {
    /// Radiance, linear Rec. 709, nits: three words per pixel.
    pub radiance: u32,
    /// Part of the radiance that the first surface reflected specularly: three words per pixel.
    pub specular: u32,
    /// Variance of the luminance of the specular radiance; 3.0e38 where it is unknown. `None` if it is unknown for all
    /// pixels, as in images with one sample per pixel.
    pub specular_variance: Option<u32>,
    /// The rest of the radiance, divided by base color + `DEMODULATION_EPSILON` for each sample: three words per pixel.
    pub demodulated: u32,
    /// Variance of the luminance of the demodulated radiance; 3.0e38 where it is unknown. `None` if it is unknown for
    /// all pixels.
    pub demodulated_variance: Option<u32>,
    /// Mean base color, 0 to 1: three words per pixel.
    pub albedo: u32,
    /// Mean normal, camera frame, shorter than 1 where samples differ or have none: three words per pixel.
    pub normal: u32,
    /// Depth along the ray through the center of the pixel, m; 3.0e38 where it meets nothing.
    pub depth: u32,
    /// Id of the body that this ray meets, an integer below 2²⁴; 0 for the background and lights.
    pub instance: u32,
}

impl Sections {
    /// First word of every plane that exists, and its words per pixel.
    fn planes(&self) -> impl Iterator<Item = (u32, u64)> {
        let colors = [self.radiance, self.specular, self.demodulated, self.albedo, self.normal];
        let numbers = [self.depth, self.instance];
        let variances = [self.specular_variance, self.demodulated_variance].into_iter().flatten();
        let numbers = numbers.into_iter().chain(variances).map(|first| (first, 1));
        colors.into_iter().map(|first| (first, 3)).chain(numbers)
    }
}

/// The filter on a device, and buffers that grow with its images.
pub struct GuidedFilter {
    device: Arc<Device>,
    kernels: Arc<Kernels>,
    shapes: wgpu::Buffer,
    bodies: wgpu::Buffer,
    places: wgpu::Buffer,
    /// Light of both parts, before a level and after it.
    lights: [wgpu::Buffer; 2],
    cells: wgpu::Buffer,
    /// Pixels times kernels of a submission. The limit prevents drivers from taking the filter for a hanging program.
    pub at_once: u64,
}

/// Pixels that a kernel filters in the time of one path.
pub(crate) const PIXELS_OF_A_PATH: u64 = 8;

/// Planes of four floats per pixel in the two buffers of light: both parts, and pilots in the second.
const LIGHT_PLANES: [u64; 2] = [2, 3];

/// `Work` in `bindings.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Work {
    size: [u32; 2],
    cells: [u32; 2],
    radiance: u32,
    specular: u32,
    specular_variance: u32,
    demodulated: u32,
    demodulated_variance: u32,
    albedo: u32,
    normal: u32,
    depth: u32,
    instance: u32,
    output: u32,
    ends_in: [u32; 2],
    part: u32,
    step: u32,
    per_light: f32,
    per_pilot: f32,
    kernel: [f32; 4],
    normal_scale: f32,
    normal_least: f32,
    normal_most: f32,
    unused: f32,
}

impl GuidedFilter {
    /// Compiles the kernels, unless the device has them.
    pub fn new(device: Arc<Device>) -> Result<Self> {
        let kernels = device.guided();
        let empty = |label| device.storage(label, 0);
        let (shapes, bodies, places) = (empty("shapes")?, empty("bodies")?, empty("places")?);
        let (lights, cells) = ([empty("lights")?, empty("lights and pilots")?], empty("cells")?);
        let at_once = PIXELS_OF_A_PATH * device.most_paths();
        Ok(Self { device, kernels, shapes, bodies, places, lights, cells, at_once })
    }

    /// Records the filtering of an image of `width × height`. For a large image, it submits the recorded work and
    /// continues with an empty encoder. After the work, `output` holds the radiance from the given word on, three words
    /// per pixel; its other words are unchanged.
    ///
    /// The two buffers are for kernels (`STORAGE`). Several images may be recorded in a row; the device keeps their
    /// order. A plane that reaches beyond its buffer is an error, and so is an image that is too large for the device.
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        size: [u32; 2],
        input: &wgpu::Buffer,
        sections: Sections,
        options: &Guided,
        output: (&wgpu::Buffer, u32),
    ) -> Result<()> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        if pixels == 0 {
            return Ok(());
        }
        let fits = |buffer: &wgpu::Buffer, (first, words): (u32, u64)| {
            let end = u64::from(first) + words * pixels;
            end <= u64::from(NONE).min(buffer.size() / 4)
        };
        if !sections.planes().all(|plane| fits(input, plane)) || !fits(output.0, (output.1, 3)) {
            let [width, height] = size;
            return Err(Error::new(format!("planes of {width} × {height} px reach beyond their buffers")));
        }
        let cells = size.map(|edge| edge.div_ceil(CELL));
        self.make_room(pixels, u64::from(cells[0]) * u64::from(cells[1]) + 1)?;

        let all = image(size, sections, output.1);
        let parts = [levels(options, &DIFFUSE, 0), levels(options, &SPECULAR, 1)];
        // The noise kernel writes the second buffer; levels alternate between the two.
        let ends_in = parts.each_ref().map(|levels| (levels.len() % 2) as u32);
        let levels: Vec<(usize, Level)> = parts.into_iter().flat_map(|levels| levels.into_iter().enumerate()).collect();
        let works = std::iter::once(Work { ends_in, ..all }).chain(levels.iter().map(|(_, level)| level.of(all)));
        let uniforms = self.uniforms(&works.collect::<Vec<_>>())?;
        let bind = |[from, to]: [usize; 2]| {
            let storage = [
                input,
                output.0,
                &self.shapes,
                &self.bodies,
                &self.places,
                &self.lights[from],
                &self.lights[to],
                &self.cells,
            ];
            self.kernels.bind(self.device.wgpu(), storage, &uniforms, size_of::<Work>() as u64)
        };
        let [forth, back] = [bind([0, 1]), bind([1, 0])];

        let kernels = &self.kernels;
        let groups = size.map(|edge| edge.div_ceil(GROUP));
        let mut steps = vec![
            (&kernels.surfaces, &back, 0, groups),
            (&kernels.borders, &back, 0, groups),
            (&kernels.noise, &forth, 0, groups),
        ];
        steps.extend(
            (1..).zip(&levels).map(|(work, (number, _))| {
                (&kernels.level, if number % 2 == 0 { &back } else { &forth }, work, groups)
            }),
        );
        steps.extend([
            (&kernels.join, &forth, 0, cells),
            (&kernels.average, &forth, 0, [1; 2]),
            (&kernels.brightness, &forth, 0, cells),
            (&kernels.factors, &forth, 0, cells.map(|count| count.div_ceil(GROUP))),
            (&kernels.restore, &forth, 0, groups),
        ]);
        let at_once = (self.at_once / pixels).max(1) as usize;
        for (number, steps) in steps.chunks(at_once).enumerate() {
            if number > 0 {
                self.device.submit(std::mem::replace(encoder, self.device.encoder()));
            }
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            for &(kernel, group, work, [x, y]) in steps {
                pass.set_pipeline(kernel);
                pass.set_bind_group(0, group, &[work * STRIDE as u32]);
                pass.dispatch_workgroups(x, y, 1);
            }
        }
        self.device.check()
    }

    /// Allocates buffers for an image.
    fn make_room(&mut self, pixels: u64, cells: u64) -> Result<()> {
        let Self { device, shapes, bodies, places, lights: [first, second], cells: of_cells, .. } = self;
        let sizes = [
            (shapes, "shapes", 16 * pixels),
            (bodies, "bodies", 8 * pixels),
            (places, "places", 16 * pixels),
            (first, "lights", 16 * LIGHT_PLANES[0] * pixels),
            (second, "lights and pilots", 16 * LIGHT_PLANES[1] * pixels),
            (of_cells, "cells", 16 * cells),
        ];
        for (buffer, label, bytes) in sizes {
            device.check_image("the filter", bytes)?;
            if buffer.size() < bytes {
                *buffer = device.storage(label, bytes)?;
            }
        }
        Ok(())
    }

    /// A buffer with the uniforms of dispatches; a new one per image, since earlier images may still be in progress.
    fn uniforms(&self, works: &[Work]) -> Result<wgpu::Buffer> {
        let mut bytes = vec![0; works.len() * STRIDE];
        for (bytes, work) in bytes.chunks_exact_mut(STRIDE).zip(works) {
            bytes[..size_of::<Work>()].copy_from_slice(bytemuck::bytes_of(work));
        }
        let uniforms = self.device.uniforms("guided", bytes.len() as u64)?;
        self.device.write(&uniforms, 0, &bytes);
        Ok(uniforms)
    }
}

/// A level of a part.
struct Level {
    part: u32,
    tuning: &'static Tuning,
    step: u32,
    /// Standard deviations of light (and of means where they count) by which the weight falls by a factor of e.
    sigmas: f32,
    pilot_sigmas: Option<f32>,
}

impl Level {
    /// The work of the level on an image.
    fn of(&self, image: Work) -> Work {
        let [one, two, three] = self.tuning.kernel;
        let (normal_scale, normal_least, normal_most) = self.tuning.normal;
        Work {
            part: self.part,
            step: self.step,
            per_light: 1.0 / (self.sigmas * self.sigmas),
            per_pilot: self.pilot_sigmas.map_or(0.0, |sigmas| 1.0 / (sigmas * sigmas)),
            kernel: [one, two, three, 0.0],
            normal_scale,
            normal_least,
            normal_most,
            ..image
        }
    }
}

/// The levels of a part. The first also compares means.
fn levels(options: &Guided, tuning: &'static Tuning, part: u32) -> Vec<Level> {
    let strength = options.strength as f32;
    let level = |(number, (step, sigmas))| Level {
        part,
        tuning,
        step,
        sigmas: sigmas * strength,
        pilot_sigmas: (number == 0).then_some(tuning.pilot_sigmas * strength),
    };
    tuning.levels(options.levels).enumerate().map(level).collect()
}

/// Parameters of all dispatches of an image.
fn image(size: [u32; 2], sections: Sections, output: u32) -> Work {
    Work {
        size,
        cells: size.map(|edge| edge.div_ceil(CELL)),
        radiance: sections.radiance,
        specular: sections.specular,
        specular_variance: sections.specular_variance.unwrap_or(NONE),
        demodulated: sections.demodulated,
        demodulated_variance: sections.demodulated_variance.unwrap_or(NONE),
        albedo: sections.albedo,
        normal: sections.normal,
        depth: sections.depth,
        instance: sections.instance,
        output,
        ..Work::default()
    }
}
