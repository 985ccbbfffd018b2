//! Planes of numbers with a margin, so that inner loops need no special case at the border.

use parking_lot::Mutex;
use syntable_model::context::Workers;

/// Numbers that inner loops take at a time, px.
pub(super) const CHUNK: usize = 32;

/// Margin around the image: maximum distance of a tap, px.
pub(super) const MARGIN: usize = 32;

/// One chunk of a row.
pub(super) type Chunk = [f32; CHUNK];

/// Rows in a job.
const BAND: usize = 16;

/// Size of an image, and of the planes that hold it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Size {
    pub width: usize,
    pub height: usize,
}

impl Size {
    /// Numbers from one row to the next: the margins, and whole chunks.
    pub fn stride(self) -> usize {
        self.chunks() * CHUNK + 2 * MARGIN
    }

    /// Where a pixel is in a plane.
    pub fn index(self, x: usize, y: usize) -> usize {
        (y + MARGIN) * self.stride() + MARGIN + x
    }

    fn chunks(self) -> usize {
        self.width.div_ceil(CHUNK)
    }

    fn numbers(self) -> usize {
        (self.height + 2 * MARGIN) * self.stride()
    }
}

/// An image of one number per pixel, with margins.
#[derive(Debug, Clone)]
pub(super) struct Padded(Vec<f32>);

impl Padded {
    /// A plane of one value.
    pub fn new(size: Size, value: f32) -> Self {
        Self(vec![value; size.numbers()])
    }

    /// The chunk that starts at an index.
    #[inline(always)]
    pub fn chunk(&self, at: usize) -> &Chunk {
        self.0[at..at + CHUNK].try_into().expect("a chunk long")
    }

    /// One number.
    pub fn at(&self, index: usize) -> f32 {
        self.0[index]
    }
}

/// Where a chunk is.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkPosition {
    /// Column and row of its first pixel, px.
    pub x: usize,
    pub y: usize,
    /// Index of its first pixel in a plane.
    pub at: usize,
}

/// Fills `N` planes chunk by chunk. Margins stay as they are; what is right of the image is filled too.
pub(super) fn fill<const N: usize>(
    size: Size,
    workers: &dyn Workers,
    planes: [&mut Padded; N],
    job: impl Fn(ChunkPosition) -> [Chunk; N] + Sync,
) {
    let stride = size.stride();
    let mut bands: Vec<Vec<&mut [f32]>> = (0..size.height.div_ceil(BAND)).map(|_| Vec::with_capacity(N)).collect();
    for plane in planes {
        let rows = &mut plane.0[MARGIN * stride..(MARGIN + size.height) * stride];
        bands.iter_mut().zip(rows.chunks_mut(BAND * stride)).for_each(|(band, rows)| band.push(rows));
    }
    let bands: Vec<_> = bands.into_iter().map(Mutex::new).collect();
    workers.run(bands.len(), &|number| {
        let mut band = bands[number].lock();
        let first = number * BAND;
        for y in first..(first + BAND).min(size.height) {
            for x in (0..size.width).step_by(CHUNK) {
                let values = job(ChunkPosition { x, y, at: size.index(x, y) });
                let start = (y - first) * stride + MARGIN + x;
                for (plane, values) in band.iter_mut().zip(&values) {
                    plane[start..start + CHUNK].copy_from_slice(values);
                }
            }
        }
    });
}
