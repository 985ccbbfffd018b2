//! Passes of paths over the pixels of an image.

use crate::device::{Kernel, Variant};
use crate::layout::{COUNTERS, GROUP, GROUPS_COUNTED, PASS_STRIDE, Pass, View, groups};
use crate::session::{Gathered, GpuSession, World};
use std::ops::Range;
use syntable_model::context::Workers;
use syntable_model::error::Result;

/// Bounces that are submitted together, before the host asks whether any path is left.
const BOUNCES_AT_ONCE: u32 = 16;

/// Number of paths above which the first bounces are submitted one by one, and the number of these bounces.
const MANY_PATHS: u64 = 1 << 22;
const LONG_BOUNCES: u32 = 4;

/// A list of pixels to trace, in the queues.
#[derive(Clone, Copy, Debug)]
pub struct Pixels {
    /// The first word of the list.
    pub list: u32,
    /// Maximum number of pixels in the list.
    pub count: u32,
    /// Whether the kernel `choose` counted the pixels.
    pub is_chosen: bool,
}

/// Data that the paths of a pass gather.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paths {
    /// Light, and guides if the image needs them.
    Light,
    /// Guides alone.
    Guides,
}

/// The kernels of passes.
pub fn kernels(variant: Variant) -> Vec<(Kernel, Variant)> {
    let alone = Variant { only_guides: true, ..variant };
    let light = [Kernel::Trace, Kernel::Shade, Kernel::Accumulate].map(|kernel| (kernel, variant));
    let guides = [Kernel::Guide, Kernel::Accumulate].map(|kernel| (kernel, alone));
    light.into_iter().chain(guides.into_iter().filter(|_| variant.guides)).collect()
}

/// Indices among these.
const TRACE: usize = 0;
const SHADE: usize = 1;
const ACCUMULATE: usize = 2;
const GUIDE: usize = 3;
const ACCUMULATE_GUIDES: usize = 4;

/// Groups of a dispatch.
#[derive(Clone, Copy)]
enum Groups {
    /// Along x and y.
    Known([u32; 2]),
    /// Counted by the device, at an offset in the buffer of groups.
    Counted(u64),
}

/// Records and submits passes.
pub struct Passes<'a> {
    session: &'a GpuSession,
    /// Recorded work that is not submitted yet.
    pub encoder: wgpu::CommandEncoder,
    group: wgpu::BindGroup,
    /// As [`kernels`] lists them.
    kernels: Vec<wgpu::ComputePipeline>,
    /// The end of the pass before the last.
    before: Option<wgpu::SubmissionIndex>,
    /// Ends the work between passes on request.
    workers: &'a dyn Workers,
}

impl<'a> Passes<'a> {
    /// Records with the kernels that a scene needs.
    pub fn new(session: &'a GpuSession, world: &World, gathered: Gathered, workers: &'a dyn Workers) -> Self {
        let variant = session.variant(world, gathered);
        let kernels =
            kernels(variant).into_iter().map(|(kernel, variant)| session.device.kernel(kernel, variant)).collect();
        Self { session, encoder: session.device.encoder(), group: session.bind(), kernels, before: None, workers }
    }

    /// Traces samples of pixels, in as many passes as the state of paths needs.
    pub fn trace(&mut self, paths: Paths, view: &View, pixels: Pixels, samples: Range<u32>) -> Result<()> {
        // Passes of equal numbers of samples.
        let all = samples.len().max(1) as u32;
        let most = (view.capacity / pixels.count.max(1)).clamp(1, all);
        let per_pass = all.div_ceil(all.div_ceil(most));
        let pixels_per_pass = pixels.count.min(view.capacity / per_pass).max(1);
        for first_pixel in (0..pixels.count).step_by(pixels_per_pass as usize) {
            for first_sample in samples.clone().step_by(per_pass as usize) {
                let pass = Pass {
                    first_pixel,
                    pixels: pixels_per_pass.min(pixels.count - first_pixel),
                    first_sample,
                    samples: per_pass.min(samples.end - first_sample),
                    list: pixels.list,
                    is_chosen: pixels.is_chosen.into(),
                    ..Pass::default()
                };
                match paths {
                    Paths::Light => self.light(pass, view.max_bounces)?,
                    Paths::Guides => self.guides(pass)?,
                }
            }
        }
        Ok(())
    }

    /// Waits until few passes are in progress, and writes the uniforms of the bounces of the next one.
    fn begin(&mut self, pass: Pass, bounces: u32) -> Result<()> {
        self.workers.check_stop();
        let session = self.session;
        let passes: Vec<u8> = (0..bounces)
            .flat_map(|bounce| {
                let mut bytes = bytemuck::bytes_of(&Pass { bounce, ..pass }).to_vec();
                bytes.resize(PASS_STRIDE as usize, 0);
                bytes
            })
            .collect();
        // Recorded work reads the uniforms of earlier passes. At most two passes are in progress, so a wait takes no
        // longer than both, whatever the number of samples.
        let last = self.submit();
        if let Some(before) = self.before.replace(last) {
            session.device.wait(before)?;
        }
        session.device.write(&session.buffers.passes, 0, &passes);
        Ok(())
    }

    /// Traces the paths of a pass that gathers guides alone.
    fn guides(&mut self, pass: Pass) -> Result<()> {
        self.begin(pass, 1)?;
        self.dispatch(GUIDE, 0, Groups::Known(groups(pass.paths(), GROUP)));
        self.dispatch(ACCUMULATE_GUIDES, 0, Groups::Known(groups(pass.pixels.into(), GROUP)));
        Ok(())
    }

    /// Traces the paths of a pass that gathers light.
    fn light(&mut self, pass: Pass, max_bounces: u32) -> Result<()> {
        self.begin(pass, max_bounces + 1)?;
        let (session, paths) = (self.session, pass.paths());
        for bounce in 0..=max_bounces {
            let [rays, going] = match bounce {
                0 => [Groups::Known(groups(paths, GROUP)); 2],
                _ => [Groups::Counted(12), Groups::Counted(0)],
            };
            self.dispatch(TRACE, bounce, rays);
            self.dispatch(SHADE, bounce, going);
            let counted = 4 * u64::from(GROUPS_COUNTED + 6 * bounce);
            self.encoder.copy_buffer_to_buffer(&session.buffers.counters, counted, &session.buffers.groups, 0, 24);
            // The device starts while the rest is recorded. Also, watchdogs limit the time of a submission, and the
            // first bounces of many paths take the longest.
            if bounce == 0 || bounce < LONG_BOUNCES && paths > MANY_PATHS {
                self.submit();
            }
            if bounce % BOUNCES_AT_ONCE == BOUNCES_AT_ONCE - 1 && bounce < max_bounces {
                let counters = self.counters()?;
                if counters[bounce as usize + 1] == 0 {
                    // The last shadow rays.
                    self.dispatch(TRACE, bounce + 1, Groups::Counted(12));
                    break;
                }
            }
        }
        self.dispatch(ACCUMULATE, 0, Groups::Known(groups(pass.pixels.into(), GROUP)));
        Ok(())
    }

    /// Records a kernel of the view; its uniforms are the last ones written.
    pub fn once(&mut self, kernel: &wgpu::ComputePipeline, [x, y]: [u32; 2]) {
        let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(kernel);
        pass.set_bind_group(0, &self.group, &[0]);
        pass.dispatch_workgroups(x, y, 1);
    }

    /// Runs a kernel of the view on the squares of 8 × 8 pixels of an image. The maximum paths of a pass also limit the
    /// pixels of a dispatch, so that no driver takes it for a hanging program.
    pub fn squares(&mut self, kernel: &wgpu::ComputePipeline, squares: u32) {
        let session = self.session;
        let at_once = (session.most_paths / GROUP).clamp(1, u32::MAX.into()) as u32;
        for first in (0..squares).step_by(at_once as usize) {
            if first > 0 {
                // Recorded work reads the uniforms of the earlier squares.
                self.submit();
            }
            let pass = Pass { first_pixel: first, pixels: at_once.min(squares - first), ..Pass::default() };
            session.device.write(&session.buffers.passes, 0, bytemuck::bytes_of(&pass));
            self.once(kernel, groups(u64::from(pass.pixels) * GROUP, GROUP));
        }
    }

    fn dispatch(&mut self, kernel: usize, bounce: u32, groups: Groups) {
        let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.kernels[kernel]);
        pass.set_bind_group(0, &self.group, &[bounce * PASS_STRIDE as u32]);
        match groups {
            Groups::Known([x, y]) => pass.dispatch_workgroups(x, y, 1),
            Groups::Counted(offset) => pass.dispatch_workgroups_indirect(&self.session.buffers.groups, offset),
        }
    }

    /// Submits the recorded work.
    pub fn submit(&mut self) -> wgpu::SubmissionIndex {
        let device = &self.session.device;
        device.submit(std::mem::replace(&mut self.encoder, device.encoder()))
    }

    /// Recorded work that is not submitted yet.
    pub fn into_encoder(self) -> wgpu::CommandEncoder {
        self.encoder
    }

    /// Waits for the recorded work, and returns the counters.
    pub fn counters(&mut self) -> Result<Vec<u32>> {
        let (device, buffers) = (&self.session.device, &self.session.buffers);
        let mut encoder = std::mem::replace(&mut self.encoder, device.encoder());
        encoder.copy_buffer_to_buffer(&buffers.counters, 0, &buffers.readable, 0, 4 * COUNTERS);
        device.read(encoder, &buffers.readable, COUNTERS, <[u32]>::to_vec)
    }
}
