//! Near-duplicate views.
//!
//! An image is reduced to the mean luma of 16 × 16 cells. Two views are near-duplicates if no cell differs by more than
//! a few levels of 255. Noise, compression and shifts below a pixel stay within this limit; a moved object exceeds it.
//! Linked views form groups, in which each view has a near-duplicate. The search is exact. It visits the images in the
//! order of their mean luma, which differs by at most as much as the cells, and compares means of 4 × 4 blocks of cells
//! before cells. Its time grows with the number of pairs of similar mean luma. Its memory is 256 bytes per image, and a
//! number per image and thread.

use serde::Serialize;
use std::sync::Mutex;
use syntable_model::context::Workers;
use syntable_model::product::Plane;

/// Default maximum difference between cells of near-duplicates, of 255 levels.
pub const LEVELS: u8 = 5;

/// Number of cells along each edge.
const EDGE: usize = 16;
/// Number of blocks along each edge.
const BLOCKS: usize = 4;
/// Number of parts into which the search is split.
const JOBS: usize = 16;

/// An image in 16 × 16 cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thumbnail {
    cells: [u8; EDGE * EDGE],
}

/// Weights of red, green and blue in luma (Rec. 709), of 10000.
const LUMA: [u64; 3] = [2126, 7152, 722];

/// The mean luma of an image in [0, 1], and its thumbnail.
pub fn luma(image: &Plane<[u8; 3]>) -> (f64, Thumbnail) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let (mut sums, mut counts) = ([0_u64; EDGE * EDGE], [0_u64; EDGE * EDGE]);
    // The first column of each cell, and the end of the last one.
    let starts: [usize; EDGE + 1] = std::array::from_fn(|column| (column * width).div_ceil(EDGE));
    for (y, row) in image.data().chunks_exact(width.max(1)).enumerate() {
        let first = y * EDGE / height * EDGE;
        for column in 0..EDGE {
            let pixels = &row[starts[column]..starts[column + 1]];
            // Sums of levels, which a sixteenth of the longest row cannot overflow.
            let [mut red, mut green, mut blue] = [0_u32; 3];
            for [r, g, b] in pixels {
                red += u32::from(*r);
                green += u32::from(*g);
                blue += u32::from(*b);
            }
            let levels = [red, green, blue].map(u64::from);
            sums[first + column] += levels[0] * LUMA[0] + levels[1] * LUMA[1] + levels[2] * LUMA[2];
            counts[first + column] += pixels.len() as u64;
        }
    }
    let whole: u64 = LUMA.iter().sum();
    let mean = sums.iter().sum::<u64>() as f64 / (255 * whole * (width * height).max(1) as u64) as f64;
    let cell = |cell: usize| {
        let pixels = whole * counts[cell].max(1);
        ((sums[cell] + pixels / 2) / pixels) as u8
    };
    (mean, Thumbnail { cells: std::array::from_fn(cell) })
}

impl Thumbnail {
    /// Whether no cell differs from the corresponding cell by more than some levels.
    fn is_near(&self, other: &Self, levels: u8) -> bool {
        // Parts of the image, since most pairs differ in their first part.
        let (own, others) = (self.cells.as_chunks::<32>().0, other.cells.as_chunks::<32>().0);
        own.iter().zip(others).all(|(own, other)| {
            let differences = std::array::from_fn::<u8, 32, _>(|cell| own[cell].abs_diff(other[cell]));
            differences.into_iter().fold(0, u8::max) <= levels
        })
    }

    /// Sums of blocks of cells.
    fn blocks(&self) -> [u16; BLOCKS * BLOCKS] {
        let mut sums = [0; BLOCKS * BLOCKS];
        for (cell, level) in self.cells.iter().enumerate() {
            let (x, y) = (cell % EDGE * BLOCKS / EDGE, cell / EDGE * BLOCKS / EDGE);
            sums[y * BLOCKS + x] += u16::from(*level);
        }
        sums
    }
}

/// Views that look almost the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Duplicates {
    /// Largest difference of cells, of 255 levels.
    pub levels: u8,
    /// Views in groups.
    pub views: u64,
    /// Number of redundant views: all views in groups except one per group.
    pub redundant: u64,
    /// Number of groups within a single scene.
    pub groups_in_scene: u64,
    /// Groups by their first views.
    pub groups: Vec<Vec<String>>,
}

/// Groups of at least two images that are linked by near-duplicates, each group ascending, ordered by their first
/// images.
pub fn groups(thumbnails: &[Thumbnail], levels: u8, workers: &dyn Workers) -> Vec<Vec<usize>> {
    let sum = |it: &Thumbnail| it.cells.iter().map(|cell| u32::from(*cell)).sum::<u32>();
    let mut order: Vec<(u32, usize)> = thumbnails.iter().enumerate().map(|(image, it)| (sum(it), image)).collect();
    order.sort_unstable();
    let ordered: Vec<(u32, [u16; BLOCKS * BLOCKS], &Thumbnail)> =
        order.iter().map(|&(sum, image)| (sum, thumbnails[image].blocks(), &thumbnails[image])).collect();
    let most = u32::from(levels) * (EDGE * EDGE) as u32;
    let most_of_block = u16::from(levels) * (EDGE * EDGE / BLOCKS / BLOCKS) as u16;
    let whole = Mutex::new(Links::new(ordered.len()));
    workers.run(JOBS, &|job| {
        let mut links = Links::new(ordered.len());
        for (first, (sum, blocks, cells)) in ordered.iter().enumerate().skip(job).step_by(JOBS) {
            for (ahead, other) in ordered[first + 1..].iter().take_while(|it| it.0 - sum <= most).enumerate() {
                let are_close = blocks.iter().zip(&other.1).all(|(a, b)| a.abs_diff(*b) <= most_of_block)
                    && cells.is_near(other.2, levels);
                if are_close {
                    links.join(first, first + 1 + ahead);
                }
            }
        }
        if let Ok(mut whole) = whole.lock() {
            (0..ordered.len()).for_each(|place| {
                let root = links.root(place);
                whole.join(place, root);
            });
        }
    });
    let mut links = whole.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); ordered.len()];
    order.iter().enumerate().for_each(|(place, (_, image))| groups[links.root(place)].push(*image));
    groups.retain(|group| group.len() > 1);
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups.sort_unstable();
    groups
}

/// Disjoint sets of indices.
struct Links(Vec<u32>);

impl Links {
    fn new(places: usize) -> Self {
        Self((0..places as u32).collect())
    }

    fn root(&mut self, mut place: usize) -> usize {
        while self.0[place] as usize != place {
            self.0[place] = self.0[self.0[place] as usize];
            place = self.0[place] as usize;
        }
        place
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;
    use syntable_runtime::workers::Pool;

    #[test]
    fn luma_of_known_images() {
        let (mean, thumbnail) = luma(&Plane::from_fn(64, 32, |x, _| if x < 32 { [255, 0, 0] } else { [0, 0, 255] }));
        assert!((mean - (0.2126 + 0.0722) / 2.0).abs() < 1e-12, "{mean}");
        assert_eq!((thumbnail.cells[0], thumbnail.cells[255]), (54, 18));
        // Sizes that 16 does not divide, and images with fewer pixels than cells.
        for (width, height) in [(1, 1), (17, 31), (5, 40)] {
            let (mean, _) = luma(&Plane::from_fn(width, height, |_, _| [255; 3]));
            assert!((mean - 1.0).abs() < 1e-12, "{width} × {height}: {mean}");
        }
    }

    /// The largest difference between corresponding cells.
    fn difference(one: &Thumbnail, other: &Thumbnail) -> u8 {
        one.cells.iter().zip(&other.cells).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
    }

    /// Compares with a search over all pairs and a walk along the links.
    #[test]
    fn groups_match_all_pairs() {
        let mut stream = Stream::root(5);
        let mut level = |low: f64, high: f64| stream.uniform(low, high) as u8;
        let mut all: Vec<Thumbnail> = Vec::new();
        for image in 0..160 {
            let copied = (image % 3 != 0).then(|| all[usize::from(level(0.0, image as f64))].cells);
            let base = level(0.0, 200.0);
            let cells = copied.unwrap_or_else(|| std::array::from_fn(|_| base + level(0.0, 30.0)));
            all.push(Thumbnail { cells: cells.map(|cell| cell.saturating_add(level(0.0, 9.0))) });
        }
        for levels in [0, LEVELS, 8] {
            let mut expected: Vec<Vec<usize>> = Vec::new();
            let mut seen = vec![false; all.len()];
            for first in 0..all.len() {
                let (mut open, mut group) = (vec![first], Vec::new());
                while let Some(image) = open.pop() {
                    if !std::mem::replace(&mut seen[image], true) {
                        group.push(image);
                        open.extend((0..all.len()).filter(|other| difference(&all[image], &all[*other]) <= levels));
                    }
                }
                group.sort_unstable();
                expected.extend(Some(group).filter(|group| group.len() > 1));
            }
            for threads in [1, 3] {
                let found = groups(&all, levels, &Pool::new(threads).expect("threads"));
                assert_eq!(found, expected, "{levels} levels");
            }
            assert!(levels != 8 || !expected.is_empty());
        }
    }
}
