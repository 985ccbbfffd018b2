//! Position of a tracer in the samples of its pixels.

use syntable_transport::film::Task;

/// Cursor over the (pixel, sample) pairs of a task.
#[derive(Clone, Copy)]
pub(super) struct Cursor {
    pub number: usize,
    pub sample: u32,
}

impl Cursor {
    pub(super) fn first(task: &Task) -> Self {
        Self { number: 0, sample: task.samples.start }
    }

    pub(super) fn is_over(self, task: &Task) -> bool {
        self.number >= task.pixels.len() || task.samples.is_empty()
    }

    /// Index of the pixel in the tile.
    pub(super) fn pixel(self, task: &Task) -> usize {
        usize::from(task.pixels[self.number])
    }

    /// The next sample.
    pub(super) fn after(self, task: &Task) -> Self {
        match self.sample + 1 {
            next if next == task.samples.end => Self { number: self.number + 1, sample: task.samples.start },
            sample => Self { sample, ..self },
        }
    }
}
