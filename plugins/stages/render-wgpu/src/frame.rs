//! Frames that are rendered without decisions of the host: labels, light and the denoised image, read back once.

use crate::device::Kernel;
use crate::guided::{GuidedFilter, PIXELS_OF_A_PATH, Sections, guided_of};
use crate::layout::{COUNTERS, GROUP, NONE, View, first_counters, groups, rays_of};
use crate::passes::{self, Passes, Paths, Pixels};
use crate::planes::{
    AT_ALBEDO, AT_DEMODULATED, AT_DEMODULATED_VARIANCE, AT_DEPTH, AT_INSTANCE, AT_NORMAL, AT_OPACITY, AT_RADIANCE,
    AT_SPECULAR, AT_SPECULAR_VARIANCE, COLORS, LabelSections, NUMBERS, color, make_all, number, sums,
};
use crate::session::{Buffers, Gathered, GpuSession, World};
use std::ops::Range;
use syntable_guided::Guided;
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::{
    DENOISER, DEPTH, INSTANCE, OPACITY, RADIANCE, RADIANCE_NOISY, RADIANCE_VARIANCE, RENDER_REPORT,
};
use syntable_model::product::{Key, KeyId, Plane, Products};
use syntable_model::stage::{RenderRequest, Tile, Window};
use syntable_transport::film::{self, Film, GUIDE_SAMPLES, Statistics};

/// Parts of a frame, and where they are on the device.
struct Layout<'a> {
    wants: &'a [KeyId],
    size: [u32; 2],
    /// Pixels of the image, and of all tiles.
    pixels: u64,
    traced: u64,
    samples: u32,
    /// The denoiser, if it runs on the device.
    guided: Option<&'a Guided>,
    /// Whether light is wanted, and whether guides are gathered with it.
    light: bool,
    gathered: Gathered,
    labels: LabelSections,
    /// First word of the sums in the output, after the labels and the denoised image, and the number of words.
    sums_at: u64,
    sums: u64,
}

impl<'a> Layout<'a> {
    /// The frame of a request; `set` is the number of words of a pixel's set of objects.
    fn new(request: &RenderRequest<'a>, samples: u32, [set, objects]: [usize; 2]) -> Self {
        let (size, traced, wants) = (request.size, request.pixels(), request.wants);
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let guided = guided_of(request.denoiser);
        let light = guided.is_some() || Film::offers().into_iter().any(|key| wants.contains(&key));
        let guides = guided.is_some() || Film::wants_guides(wants);
        let mut of_labels = wants.to_vec();
        if guided.is_some() {
            of_labels.extend([DEPTH.id(), INSTANCE.id()]);
        }
        let labels = LabelSections::new(&of_labels, pixels, set, objects);
        let sums_at = labels.end + if guided.is_some() { 3 * pixels } else { 0 };
        let gathered = Gathered::wanted(request, guides);
        let sums = if light { sums(guides, gathered.opacity) * pixels } else { 0 };
        Self { wants, size, pixels, traced, samples, guided, light, gathered, labels, sums_at, sums }
    }

    fn is_empty(&self) -> bool {
        self.labels.is_empty() && !self.light
    }

    fn wants(&self, key: KeyId) -> bool {
        self.wants.contains(&key)
    }

    /// Whether a plane of light is read back: a report needs the radiance and its variance.
    fn reads(&self, key: KeyId) -> bool {
        let for_report = key == self.rendered().id() || key == RADIANCE_VARIANCE.id();
        self.wants(key) || (for_report && self.wants(RENDER_REPORT.id()))
    }

    /// Key of the rendered radiance.
    fn rendered(&self) -> Key<Plane<[f32; 3]>> {
        if self.guided.is_some() { RADIANCE_NOISY } else { RADIANCE }
    }
}

/// A plane of light, and its range in the words that are read back; `None` if it is not read back.
type Place<T> = (Key<Plane<T>>, Option<Range<usize>>);

/// Where the parts of a frame are in the words that are read back.
struct Places {
    /// Labels and the denoised image.
    output: Range<usize>,
    colors: [Place<[f32; 3]>; COLORS.len()],
    numbers: [Place<f32>; NUMBERS.len()],
    opacity: Option<Range<usize>>,
    counters: Range<usize>,
    /// Copies to the readable buffer, in order.
    copies: Vec<Copied>,
    /// Words of all copies.
    words: u64,
}

/// A range of words to copy from a buffer of the device.
struct Copied {
    from: fn(&Buffers) -> &wgpu::Buffer,
    first: u64,
    words: u64,
}

impl Places {
    fn of(layout: &Layout) -> Self {
        let (mut copies, mut read) = (Vec::new(), 0);
        let mut copy = |from: fn(&Buffers) -> &wgpu::Buffer, first: u64, words: u64| {
            let at = read;
            if words > 0 {
                copies.push(Copied { from, first, words });
            }
            read += words;
            at as usize..read as usize
        };
        let output = copy(|buffers| &buffers.output, 0, layout.sums_at);
        let mut plane = |key: KeyId, at: u32, words: u64| {
            let first = u64::from(at) * layout.pixels;
            layout.reads(key).then(|| copy(|buffers| &buffers.paths, first, words * layout.pixels))
        };
        let colors = COLORS.map(|(key, at)| {
            let key = match at {
                AT_RADIANCE => layout.rendered(),
                _ => key,
            };
            (key, plane(key.id(), at, 3))
        });
        let numbers = NUMBERS.map(|(key, at)| (key, plane(key.id(), at, 1)));
        let at_opacity = AT_OPACITY[usize::from(layout.gathered.guides)];
        let opacity = plane(OPACITY.id(), at_opacity, 1);
        let counters = copy(|buffers| &buffers.counters, 0, if layout.light { COUNTERS } else { 0 });
        Self { output, colors, numbers, opacity, counters, copies, words: read }
    }

    /// Records the copies to the readable buffer.
    fn copy(&self, buffers: &Buffers, encoder: &mut wgpu::CommandEncoder) {
        let mut at = 0;
        for Copied { from, first, words } in &self.copies {
            encoder.copy_buffer_to_buffer(from(buffers), 4 * first, &buffers.readable, 4 * at, 4 * words);
            at += words;
        }
    }

    /// Makes products from the words that were read back.
    fn put(self, layout: &Layout, words: &[u32], workers: &dyn Workers, frame: &mut Products) -> Result<Statistics> {
        let size = layout.size;
        let output = &words[self.output];
        let mut makers = layout.labels.makers(layout.wants, size, output);
        if layout.guided.is_some() && layout.wants(RADIANCE.id()) {
            let denoised = &output[layout.labels.end as usize..];
            makers.push(Box::new(move |frame| frame.put(RADIANCE, color(size, denoised))));
        }
        for (key, words) in self.colors.iter().filter_map(|(key, part)| Some((*key, &words[part.clone()?]))) {
            makers.push(Box::new(move |frame| frame.put(key, color(size, words))));
        }
        for (key, words) in self.numbers.iter().filter_map(|(key, part)| Some((*key, &words[part.clone()?]))) {
            makers.push(Box::new(move |frame| frame.put(key, number(size, words))));
        }
        if let Some(words) = self.opacity.map(|part| &words[part]) {
            makers.push(Box::new(move |frame| frame.put(OPACITY, number(size, words))));
        }
        let mut made = Products::new();
        make_all(&makers, workers, &mut made)?;
        let mut statistics = Statistics::default();
        if layout.light {
            let [rays, shadow_rays] = rays_of(&words[self.counters]);
            statistics = Statistics { paths: layout.traced * u64::from(layout.samples), rays, shadow_rays };
        }
        if layout.wants(RENDER_REPORT.id()) {
            let (radiance, variance) = (made.get(layout.rendered())?, made.get(RADIANCE_VARIANCE)?);
            frame.put(RENDER_REPORT, film::report(radiance, variance, [layout.samples; 2], statistics))?;
        }
        let wanted: Vec<_> = layout.wants.iter().map(|key| key.product_id()).collect();
        frame.extend(made.only(&wanted))?;
        Ok(statistics)
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
        let layout =
            Layout::new(request, self.options.samples_per_pixel, [views[0].words as usize, world.scene.objects]);
        if layout.is_empty() {
            return Ok(Statistics::default());
        }
        // Without sets and lists of objects: their size depends on the scene.
        let of_objects = layout.pixels * layout.labels.words_of_objects();
        self.device.check_image("an image of that size", 4 * (layout.sums_at - of_objects + layout.sums))?;
        self.make_output(4 * (layout.sums_at + layout.sums))?;
        let guides = layout.gathered.guides;
        let capacity = if layout.light { self.make_room(layout.pixels, layout.samples, guides)? } else { 0 };
        if layout.gathered.tiles {
            self.make_queues(capacity.into(), layout.pixels)?;
        }
        let places = Places::of(&layout);
        self.make_readable(4 * places.words.max(COUNTERS))?;
        let (all, tile_map) = self.list(request, capacity)?;
        let sums_at = layout.sums_at as u32;
        let views = views.map(|view| View { capacity, sums_at, tile_map, ..layout.labels.placed_in(view) });
        self.compile(world, &layout, request);
        let mut filter = match layout.guided {
            Some(_) => Some(self.guided.take().map_or_else(|| GuidedFilter::new(self.device.clone()), Ok)?),
            None => None,
        };

        let mut passes = Passes::new(self, world, layout.gathered, request.workers);
        self.trace_frame(&mut passes, world, &layout, views, all)?;
        if let (Some(filter), Some(options)) = (&mut filter, layout.guided) {
            self.denoise_frame(&mut passes.encoder, &layout, filter, options)?;
        }
        places.copy(&self.buffers, &mut passes.encoder);
        let (encoder, words) = (passes.into_encoder(), places.words);
        let statistics = self.device.read(encoder, &self.buffers.readable, words, |words: &[u32]| {
            places.put(&layout, words, request.workers, frame)
        })??;
        if let Some(options) = layout.guided.filter(|_| layout.wants(DENOISER.id())) {
            frame.put(DENOISER, options.report())?;
        }
        self.guided = filter.or(self.guided.take());
        Ok(statistics)
    }

    /// Compiles the kernels of a frame that are not compiled yet.
    fn compile(&self, world: &World, layout: &Layout, request: &RenderRequest) {
        let variant = self.variant(world, layout.gathered);
        let mut kernels = Vec::new();
        if layout.light {
            kernels.extend(passes::kernels(variant));
            kernels.push((Kernel::Resolve, variant));
        }
        if layout.gathered.guides {
            kernels.push((Kernel::Choose, variant));
        }
        if !layout.labels.is_empty() {
            kernels.push((Kernel::Labels, variant.of_labels()));
        }
        self.device.compile(&kernels, layout.guided.is_some(), request.cache, request.workers);
    }

    /// Records labels, paths, more samples of the guides for pixels that differ from their neighbors, and the resulting
    /// planes.
    fn trace_frame(
        &self,
        passes: &mut Passes,
        world: &World,
        layout: &Layout,
        [view, guide_view]: [View; 2],
        all: Pixels,
    ) -> Result<()> {
        let (device, buffers, [width, height]) = (&self.device, &self.buffers, layout.size);
        device.write(&buffers.view, 0, bytemuck::bytes_of(&view));
        let variant = self.variant(world, layout.gathered);
        if !layout.labels.is_empty() {
            if layout.gathered.tiles {
                // No kernel writes the pixels outside of all tiles.
                passes.encoder.clear_buffer(&buffers.output, 0, Some(4 * layout.labels.end));
            }
            let squares = width.div_ceil(8) * height.div_ceil(8);
            passes.squares(&device.kernel(Kernel::Labels, variant.of_labels()), squares);
        }
        if !layout.light {
            return Ok(());
        }
        let each = groups(layout.pixels, GROUP);
        passes.encoder.clear_buffer(&buffers.output, 4 * layout.sums_at, Some(4 * layout.sums));
        device.write(&buffers.counters, 0, bytemuck::cast_slice(&first_counters()));
        passes.trace(Paths::Light, &view, all, 0..layout.samples)?;
        if layout.gathered.guides {
            passes.once(&device.kernel(Kernel::Choose, variant), each);
            passes.submit();
            device.write(&buffers.view, 0, bytemuck::bytes_of(&guide_view));
            let chosen = Pixels { list: all.list + layout.pixels as u32, is_chosen: true, ..all };
            passes.trace(Paths::Guides, &guide_view, chosen, 0..GUIDE_SAMPLES)?;
            passes.submit();
            device.write(&buffers.view, 0, bytemuck::bytes_of(&view));
        }
        passes.once(&device.kernel(Kernel::Resolve, variant), each);
        Ok(())
    }

    /// Records the filter. The denoised image comes after the labels.
    fn denoise_frame(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        layout: &Layout,
        filter: &mut GuidedFilter,
        options: &Guided,
    ) -> Result<()> {
        let Layout { size, pixels, labels, .. } = layout;
        let planes = sections(*pixels as u32, layout.samples);
        for (from, to) in [(labels.depth, planes.depth), (labels.instance, planes.instance)] {
            let [from, to] = [from, to].map(|first| 4 * u64::from(first));
            encoder.copy_buffer_to_buffer(&self.buffers.output, from, &self.buffers.paths, to, 4 * pixels);
        }
        let output = (&self.buffers.output, labels.end as u32);
        filter.at_once = PIXELS_OF_A_PATH * self.most_paths;
        filter.record(encoder, *size, &self.buffers.paths, planes, options, output)
    }

    /// Lists all pixels of all tiles, in squares of 8 × 8, so that neighbors are traced together. Also returns where
    /// the queues hold the tile index of each pixel, if the request has several tiles.
    pub fn list(&mut self, request: &RenderRequest, capacity: u32) -> Result<(Pixels, u32)> {
        let [width, height] = request.size;
        let pixels = Pixels { list: 3 * capacity, count: request.pixels() as u32, is_chosen: false };
        let tile_map = 3 * capacity + 2 * width * height;
        let is_only = request.only_tile().is_some();
        if is_only && (capacity == 0 || self.listed == Some([width, height, capacity])) {
            return Ok((pixels, NONE));
        }
        const MOST: u32 = 1 << 16;
        if width.max(height) > MOST {
            let name = self.device.name();
            return Err(Error::new(format!("{width} × {height} pixels are more than {name} lists"))
                .help("lower the resolution, place fewer objects, or render with `cpu_path`"));
        }
        let mut list = Vec::with_capacity(pixels.count as usize);
        for Tile { window, at: [x, y], .. } in &request.tiles {
            let Window { width, height, .. } = *window;
            let squares = (0..height).step_by(8).flat_map(|y| (0..width).step_by(8).map(move |x| (x, y)));
            list.extend(squares.flat_map(|(left, top)| {
                let rows = top..(top + 8).min(height);
                rows.flat_map(move |row| {
                    (left..(left + 8).min(width)).map(move |column| (x + column) | (y + row) << 16)
                })
            }));
        }
        self.device.write(&self.buffers.queues, 4 * u64::from(pixels.list), bytemuck::cast_slice(&list));
        self.listed = is_only.then_some([width, height, capacity]);
        if is_only {
            return Ok((pixels, NONE));
        }
        let mut map = Plane::from_fn(width, height, |_, _| NONE);
        for (number, tile) in (0..).zip(&request.tiles) {
            map.paste(tile.at, &Plane::from_fn(tile.window.width, tile.window.height, |_, _| number));
        }
        self.device.write(&self.buffers.queues, 4 * u64::from(tile_map), bytemuck::cast_slice(map.data()));
        Ok((pixels, tile_map))
    }
}

/// Where the filter finds its planes.
fn sections(pixels: u32, samples: u32) -> Sections {
    // A single sample has no variance.
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
