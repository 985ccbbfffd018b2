//! Frames in rounds, where noise or time decides the number of samples: the host reads the sums after every round.

use crate::layout::{COUNTERS, View, first_counters, rays_of};
use crate::passes::{self, Passes, Paths, Pixels};
use crate::planes::{SUM_DEMODULATED, SUM_GUIDES, SUM_SAMPLES, SUM_SPECULAR, SUMS, sums};
use crate::session::{Gathered, GpuSession, World};
use parking_lot::Mutex;
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_model::product::{KeyId, Products};
use syntable_model::stage::{RenderRequest, Tile};
use syntable_transport::film::{Film, Statistics, Task, Tracer, place};
use syntable_transport::{PartSums, PixelSums, RayCamera};

impl GpuSession {
    /// Renders the wanted products of a view.
    pub fn rounds(
        &mut self,
        world: &World,
        request: &RenderRequest,
        views: [View; 2],
        camera: &RayCamera,
        frame: &mut Products,
    ) -> Result<Statistics> {
        let of_light = Film::offers();
        let (light, labels): (Vec<KeyId>, Vec<KeyId>) = request.wants.iter().partition(|want| of_light.contains(want));
        if !labels.is_empty() {
            self.frame(world, &RenderRequest { wants: &labels, ..request.clone() }, views, frame)?;
        }
        if light.is_empty() {
            return Ok(Statistics::default());
        }
        let [width, height] = request.size;
        let pixels = u64::from(width) * u64::from(height);
        let gathered = Gathered::wanted(request, Film::wants_guides(&light));
        let guides = gathered.guides;
        let capacity = self.make_room(pixels, self.options.samples_per_pixel, guides)?;
        let sums = 4 * sums(guides, gathered.opacity) * pixels;
        self.make_output(sums)?;
        self.make_readable(sums.max(4 * COUNTERS))?;
        let (_, tile_map) = self.list(request, capacity)?;
        self.listed = None;
        let [view, guide_view] = views.map(|view| View { capacity, tile_map, ..view });
        self.device.write(&self.buffers.counters, 0, bytemuck::cast_slice(&first_counters()));
        let kernels = passes::kernels(self.variant(world, gathered));
        self.device.compile(&kernels, false, request.cache, request.workers);
        let counted = Mutex::default();
        let (size, tiles) = (request.size, &request.tiles[..]);
        let tracer = GpuTracer { session: self, world, size, tiles, view, guide_view, gathered, counted };
        let film =
            Film::trace(&tracer, size, tiles, &tracer.session.options.budget(tracer.session.light), request.workers)?;
        film.put(&light, camera, request.workers, frame)?;
        Ok(film.statistics)
    }
}

/// Traces paths of a view.
struct GpuTracer<'a> {
    session: &'a GpuSession,
    world: &'a World,
    size: [u32; 2],
    tiles: &'a [Tile<'a>],
    view: View,
    guide_view: View,
    gathered: Gathered,
    /// Rays and shadow rays counted so far.
    counted: Mutex<[u64; 2]>,
}

impl Tracer for GpuTracer<'_> {
    fn has_guides(&self) -> bool {
        self.gathered.guides
    }

    fn trace(&self, tasks: Vec<Task>, workers: &dyn Workers) -> Result<Statistics> {
        let paths = tasks.iter().map(|task| (task.pixels.len() * task.samples.len()) as u64).sum();
        let before = *self.counted.lock();
        self.run(Paths::Light, tasks, workers)?;
        let now = *self.counted.lock();
        Ok(Statistics { paths, rays: now[0] - before[0], shadow_rays: now[1] - before[1] })
    }

    fn trace_guides(&self, _: u32, tasks: Vec<Task>, workers: &dyn Workers) -> Result<()> {
        self.run(Paths::Guides, tasks, workers)
    }
}

impl GpuTracer<'_> {
    /// Traces the samples of tasks, adds their sums, and counts their rays.
    fn run(&self, paths: Paths, tasks: Vec<Task>, workers: &dyn Workers) -> Result<()> {
        let Self { session, tiles, size: [width, height], .. } = *self;
        let Gathered { guides, opacity, .. } = self.gathered;
        let view = match paths {
            Paths::Light => &self.view,
            Paths::Guides => &self.guide_view,
        };
        let (device, buffers) = (&session.device, &session.buffers);
        let Some(samples) = tasks.first().map(|task| task.samples.clone()) else { return Ok(()) };
        let at = |task: &Task, pixel: u16| {
            let ((x, y), tile) = (place(task.area, pixel), &tiles[task.tile]);
            [(x - tile.window.x) as u32 + tile.at[0], (y - tile.window.y) as u32 + tile.at[1]]
        };
        let mut list = Vec::new();
        for task in &tasks {
            list.extend(task.pixels.iter().map(|&pixel| at(task, pixel)).map(|[x, y]| x | y << 16));
        }
        let all = Pixels { list: 3 * view.capacity, count: list.len() as u32, is_chosen: false };
        device.write(&buffers.queues, 4 * u64::from(all.list), bytemuck::cast_slice(&list));
        device.write(&buffers.view, 0, bytemuck::bytes_of(view));
        let pixels = width as usize * height as usize;
        let words = sums(guides, opacity) * pixels as u64;
        let mut passes = Passes::new(session, self.world, self.gathered, workers);
        passes.encoder.clear_buffer(&buffers.output, 0, Some(4 * words));
        passes.trace(paths, view, all, samples)?;
        *self.counted.lock() = rays_of(&passes.counters()?);
        passes.encoder.copy_buffer_to_buffer(&buffers.output, 0, &buffers.readable, 0, 4 * words);
        device.read(passes.into_encoder(), &buffers.readable, words, |sums: &[f32]| {
            let jobs: Vec<_> = tasks.into_iter().map(Mutex::new).collect();
            workers.run(jobs.len(), &|job| {
                let task = &mut *jobs[job].lock();
                for &pixel in task.pixels {
                    let [x, y] = at(task, pixel);
                    let entry = (y * width + x) as usize;
                    let number = |number: u32| sums[number as usize * pixels + entry];
                    task.sums[usize::from(pixel)].add_sums(&pixel_sums(number, self.gathered, paths));
                }
            });
        })
    }
}

/// Sums of a pixel from the numbers of `path.wgsl`.
fn pixel_sums(number: impl Fn(u32) -> f32, gathered: Gathered, paths: Paths) -> PixelSums {
    let Gathered { guides, opacity, .. } = gathered;
    let three = |first: u32| [0, 1, 2].map(|c| number(first + c));
    let mut sums = PixelSums::default();
    if paths == Paths::Light {
        // The other number is the rounding error that the next addition would have subtracted.
        let exact = |at: u32| f64::from(number(at)) - f64::from(number(at + 4));
        sums.samples = number(SUM_SAMPLES) as u32;
        sums.radiance = [0, 1, 2].map(exact);
        sums.square = exact(3);
        if opacity {
            sums.hits = number(SUMS[usize::from(guides)] as u32) as u32;
        }
        if guides {
            sums.specular = PartSums::new(three(SUM_SPECULAR), number(SUM_SPECULAR + 3));
            sums.demodulated = PartSums::new(three(SUM_DEMODULATED), number(SUM_DEMODULATED + 3));
        }
    }
    if guides {
        sums.guide_samples = number(SUM_GUIDES) as u32;
        (sums.albedo, sums.normal) = (three(SUM_GUIDES + 1), three(SUM_GUIDES + 4));
    }
    sums
}
