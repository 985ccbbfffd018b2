//! Frames that need no decision on this side: labels, light and the denoised image in one go, read once.

use crate::device::Kernel;
use crate::guided::{GuidedFilter, Sections};
use crate::passes::{COUNTERS, GROUP, Passes, Pixels, first_counters, groups, rays_of};
use crate::planes::{
    AT_ALBEDO, AT_DEMODULATED, AT_DEMODULATED_VARIANCE, AT_DEPTH, AT_INSTANCE, AT_NORMAL, AT_RADIANCE, AT_SPECULAR,
    AT_SPECULAR_VARIANCE, COLORS, LabelSections, NUMBERS, PLANE_WORDS, color, number,
};
use crate::session::{GpuSession, World};
use crate::view::View;
use std::ops::Range;
use syntable_denoise::guided::Guided;
use syntable_model::error::Result;
use syntable_model::product::standard::{
    DENOISER, DEPTH, INSTANCE, RADIANCE, RADIANCE_NOISY, RADIANCE_VARIANCE, RENDER_REPORT,
};
use syntable_model::product::{KeyId, Products};
use syntable_model::stage::{Denoiser, RenderRequest, Window};
use syntable_transport::film::{self, Film, GUIDE_SAMPLES, Statistics};

/// Numbers of a pixel's sums in `path.wgsl`, without guides and with them.
pub const SUMS: [u64; 2] = [9, 24];

/// Words of the device's buffers that are read on this side, one after the other.
#[derive(Default)]
struct Reading {
    words: u64,
}

impl Reading {
    /// Copies words of a buffer; gives where they will be.
    fn copy(
        &mut self,
        passes: &mut Passes,
        from: &wgpu::Buffer,
        to: &wgpu::Buffer,
        first: u64,
        words: u64,
    ) -> Range<usize> {
        let at = self.words;
        if words > 0 {
            passes.encoder.copy_buffer_to_buffer(from, 4 * first, to, 4 * at, 4 * words);
        }
        self.words += words;
        at as usize..self.words as usize
    }
}

impl GpuSession {
    /// Renders the wanted products of a view: labels, and light with a fixed number of samples.
    pub fn frame(
        &mut self,
        world: &World,
        request: &RenderRequest,
        views: [View; 2],
        frame: &mut Products,
    ) -> Result<Statistics> {
        let (window, pixels) = (request.window, request.window.pixels());
        let guided = guided_of(request.denoiser);
        let wants = |key: KeyId| request.wants.contains(&key);
        let light = guided.is_some() || Film::offers().into_iter().any(wants);
        let guides = guided.is_some() || Film::wants_guides(request.wants);
        let samples = self.options.settings().samples;

        // What lies where.
        let mut of_labels = request.wants.to_vec();
        if guided.is_some() {
            of_labels.extend([DEPTH.id(), INSTANCE.id()]);
        }
        let labels = LabelSections::new(&of_labels, pixels, views[0].words as usize);
        if labels.is_empty() && !light {
            return Ok(Statistics::default());
        }
        let sums_at = labels.end + if guided.is_some() { 3 * pixels } else { 0 };
        let sums = if light { SUMS[usize::from(guides)] * pixels } else { 0 };
        self.make_output(4 * (sums_at + sums))?;
        let capacity = if light { self.make_room(pixels, samples, guides)? } else { 0 };
        self.make_readable(4 * (sums_at + PLANE_WORDS[1] * pixels + COUNTERS))?;
        let all = self.list_all(window, capacity);
        let [view, guide_view] = views.map(|view| View { capacity, sums_at: sums_at as u32, ..labels.placed_in(view) });
        let mut filter = match guided {
            Some(_) => Some(self.guided.take().map_or_else(|| GuidedFilter::new(self.device.clone()), Ok)?),
            None => None,
        };

        // What is done.
        let (device, buffers) = (&self.device, &self.buffers);
        device.write(&buffers.view, 0, bytemuck::bytes_of(&view));
        let mut passes = Passes::new(self, world, guides);
        let variant = self.variant(world, guides);
        if !labels.is_empty() {
            let squares = u64::from(window.width.div_ceil(8)) * u64::from(window.height.div_ceil(8));
            passes.once(&device.kernel(Kernel::Labels, variant.of_labels()), groups(squares * GROUP, GROUP));
        }
        if light {
            let each = groups(pixels, GROUP);
            passes.encoder.clear_buffer(&buffers.output, 4 * sums_at, Some(4 * sums));
            device.write(&buffers.counters, 0, bytemuck::cast_slice(&first_counters()));
            passes.trace(&view, all, 0..samples)?;
            if guides {
                passes.once(&device.kernel(Kernel::Choose, variant), each);
                passes.submit();
                device.write(&buffers.view, 0, bytemuck::bytes_of(&guide_view));
                let chosen = Pixels { list: all.list + all.count, count: all.count, is_chosen: true };
                passes.trace(&guide_view, chosen, 0..GUIDE_SAMPLES)?;
                passes.submit();
                device.write(&buffers.view, 0, bytemuck::bytes_of(&view));
            }
            passes.once(&device.kernel(Kernel::Resolve, variant), each);
        }
        if let (Some(filter), Some(options)) = (&mut filter, guided) {
            let size = [window.width, window.height];
            let planes = sections(pixels as u32, samples);
            for (from, to) in [(labels.depth, planes.depth), (labels.instance, planes.instance)] {
                let [from, to] = [from, to].map(|first| 4 * u64::from(first));
                passes.encoder.copy_buffer_to_buffer(&buffers.output, from, &buffers.paths, to, 4 * pixels);
            }
            let output = (&buffers.output, labels.end as u32);
            filter.record(&mut passes.encoder, size, &buffers.paths, planes, options, output)?;
        }

        // What is read.
        let mut reading = Reading::default();
        let mut copy =
            |passes: &mut Passes, from, first, words| reading.copy(passes, from, &buffers.readable, first, words);
        let of_output = copy(&mut passes, &buffers.output, 0, sums_at);
        let reports = wants(RENDER_REPORT.id());
        let noisy = if guided.is_some() { RADIANCE_NOISY } else { RADIANCE };
        let mut plane = |key: KeyId, at: u32, words: u64, also: bool| {
            let is_read = wants(key) || also;
            is_read.then(|| copy(&mut passes, &buffers.paths, u64::from(at) * pixels, words * pixels))
        };
        let colors = COLORS.map(|(key, at)| {
            let key = if at == AT_RADIANCE { noisy } else { key };
            (key, plane(key.id(), at, 3, reports && at == AT_RADIANCE))
        });
        let numbers =
            NUMBERS.map(|(key, at)| (key, plane(key.id(), at, 1, reports && key.id() == RADIANCE_VARIANCE.id())));
        let counters = copy(&mut passes, &buffers.counters, 0, if light { COUNTERS } else { 0 });
        let (encoder, objects) = (passes.into_encoder(), world.scene.objects);
        let statistics = device.read(encoder, &buffers.readable, reading.words, |words: &[u32]| {
            labels.put(request.wants, objects, window, &words[of_output.clone()], frame)?;
            let mut statistics = Statistics::default();
            if light {
                let [rays, shadow_rays] = rays_of(&words[counters]);
                statistics = Statistics { paths: pixels * u64::from(samples), rays, shadow_rays };
            }
            if guided.is_some() && wants(RADIANCE.id()) {
                frame.put(RADIANCE, color(window, &words[of_output][labels.end as usize..]))?;
            }
            let colors = colors.map(|(key, part)| (key, part.map(|part| color(window, &words[part]))));
            let numbers = numbers.map(|(key, part)| (key, part.map(|part| number(window, &words[part]))));
            if reports && let ((_, Some(radiance)), (_, Some(variance))) = (&colors[0], &numbers[0]) {
                frame.put(RENDER_REPORT, film::report(radiance, variance, [samples; 2], statistics))?;
            }
            for (key, plane) in colors {
                if let Some(plane) = plane.filter(|_| wants(key.id())) {
                    frame.put(key, plane)?;
                }
            }
            for (key, plane) in numbers {
                if let Some(plane) = plane.filter(|_| wants(key.id())) {
                    frame.put(key, plane)?;
                }
            }
            Ok::<_, syntable_model::error::Error>(statistics)
        })??;
        if let Some(options) = guided
            && wants(DENOISER.id())
        {
            frame.put(DENOISER, options.report())?;
        }
        self.guided = filter.or(self.guided.take());
        Ok(statistics)
    }

    /// Lists all pixels of an image, squares of 8 × 8 one after the other, so that neighbors are traced together.
    fn list_all(&mut self, Window { width, height, .. }: Window, capacity: u32) -> Pixels {
        let pixels = Pixels { list: 3 * capacity, count: width * height, is_chosen: false };
        if capacity == 0 || self.listed == Some([width, height, capacity]) {
            return pixels;
        }
        let squares = (0..height).step_by(8).flat_map(|y| (0..width).step_by(8).map(move |x| (x, y)));
        let list: Vec<u32> = squares
            .flat_map(|(left, top)| {
                let rows = top..(top + 8).min(height);
                rows.flat_map(move |y| (left..(left + 8).min(width)).map(move |x| x | y << 16))
            })
            .collect();
        self.device.write(&self.buffers.queues, 12 * u64::from(capacity), bytemuck::cast_slice(&list));
        self.listed = Some([width, height, capacity]);
        pixels
    }
}

/// The denoiser, if it is the one that runs on devices.
pub fn guided_of(denoiser: Option<&dyn Denoiser>) -> Option<&Guided> {
    denoiser.and_then(|denoiser| denoiser.as_any()?.downcast_ref())
}

/// Where the filter finds its planes.
fn sections(pixels: u32, samples: u32) -> Sections {
    // A single sample says nothing of its noise.
    let variance = |at: u32| (samples > 1).then_some(at * pixels);
    Sections {
        radiance: AT_RADIANCE * pixels,
        specular: AT_SPECULAR * pixels,
        specular_variance: variance(AT_SPECULAR_VARIANCE),
        demodulated: AT_DEMODULATED * pixels,
        demodulated_variance: variance(AT_DEMODULATED_VARIANCE),
        albedo: AT_ALBEDO * pixels,
        normal: AT_NORMAL * pixels,
        depth: AT_DEPTH * pixels,
        instance: AT_INSTANCE * pixels,
    }
}
