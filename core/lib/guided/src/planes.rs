//! Planes of numbers with a margin, so that inner loops need no special cases at the border.

use parking_lot::Mutex;
use syntable_model::context::Workers;

/// Number of pixels that inner loops process at a time.
pub(super) const CHUNK: usize = 32;

/// Margin around the image: maximum distance of a tap, px.
pub(super) const MARGIN: usize = 32;

/// One chunk of a row.
pub(super) type Chunk = [f32; CHUNK];

/// Number of rows in a job.
const BAND: usize = 16;

/// Size of an image, and of the planes that store it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Size {
    pub width: usize,
    pub height: usize,
}

impl Size {
    /// Distance from one row to the next, in numbers: the margins, and whole chunks.
    pub fn stride(self) -> usize {
        self.chunks() * CHUNK + 2 * MARGIN
    }

    /// Index of a pixel in a plane.
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

    /// The number at an index.
    pub fn at(&self, index: usize) -> f32 {
        self.0[index]
    }
}

/// Position of a chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkPosition {
    /// Column and row of its first pixel, px.
    pub x: usize,
    pub y: usize,
    /// Index of its first pixel in a plane.
    pub at: usize,
}

/// Fills `N` planes chunk by chunk. Margins stay unchanged, except that the last chunk of a row may extend beyond the
/// image.
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
