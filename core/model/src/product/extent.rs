//! Area and bounds of each object in a plane.

use super::BitPlane;

/// The pixels of a plane that an object covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Extent {
    /// Number of pixels.
    pub area: u64,
    /// Columns, from the first to past the last.
    columns: [u32; 2],
    /// Rows, from the first to past the last.
    rows: [u32; 2],
}

impl Extent {
    fn add(&mut self, row: u32, columns: [u32; 2]) {
        if self.area == 0 {
            (self.columns, self.rows) = (columns, [row, row]);
        }
        self.area += u64::from(columns[1] - columns[0]);
        self.columns = [self.columns[0].min(columns[0]), self.columns[1].max(columns[1])];
        self.rows[1] = row + 1;
    }

    /// First column, first row, width and height; zeros if nothing is covered.
    pub fn bounds(&self) -> [u32; 4] {
        let ([x, right], [y, bottom]) = (self.columns, self.rows);
        [x, y, right - x, bottom - y]
    }
}

/// The extent of each object in a plane, computed from runs of equal sets.
pub fn extents(plane: &BitPlane) -> Vec<Extent> {
    let words = plane.words();
    let mut extents = vec![Extent::default(); plane.objects()];
    for (row, mut sets) in (0..).zip(plane.data().chunks_exact(plane.row_words().max(1))) {
        let mut start = 0;
        while !sets.is_empty() {
            // A run continues as long as all words are equal to the words of the set before.
            let length = 1 + equal_words(sets, &sets[words..]) / words;
            let columns = [start, start + length as u32];
            for (word, &bits) in sets[..words].iter().enumerate() {
                let mut bits = bits;
                while bits != 0 {
                    extents[word * 64 + bits.trailing_zeros() as usize].add(row, columns);
                    bits &= bits - 1;
                }
            }
            (start, sets) = (columns[1], &sets[length * words..]);
        }
    }
    extents
}

/// The number of words up to the first in which two lists differ, or to the end of the shorter one.
fn equal_words(a: &[u64], b: &[u64]) -> usize {
    /// Words that are compared at once.
    const BLOCK: usize = 64;
    let blocks = a.chunks_exact(BLOCK).zip(b.chunks_exact(BLOCK)).take_while(|(a, b)| a == b).count();
    let rest = a.iter().zip(b).skip(blocks * BLOCK).take_while(|(a, b)| a == b).count();
    blocks * BLOCK + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::scene::InstanceId;

    #[test]
    fn areas_and_bounds_match_all_pixels() {
        let mut stream = Stream::root(3);
        let (width, height, objects) = (37, 21, 70);
        let mut plane = BitPlane::new(width, height, objects);
        let mut all = vec![Vec::new(); objects];
        // The last object covers nothing.
        for (object, pixels) in all.iter_mut().enumerate().take(objects - 1) {
            for _ in 0..5 {
                let [x, y] = [width, height].map(|edge| stream.uniform(0.0, f64::from(edge)) as u32);
                plane.insert(x, y, InstanceId(object as u16 + 1));
                if !pixels.contains(&(x, y)) {
                    pixels.push((x, y));
                }
            }
        }
        for (extent, pixels) in extents(&plane).into_iter().zip(all) {
            let range = |of: fn(&(u32, u32)) -> u32| {
                let (low, high) = (pixels.iter().map(of).min(), pixels.iter().map(of).max());
                low.map_or((0, 0), |low| (low, high.unwrap_or(low) + 1 - low))
            };
            let ((x, width), (y, height)) = (range(|p| p.0), range(|p| p.1));
            assert_eq!((extent.area, extent.bounds()), (pixels.len() as u64, [x, y, width, height]));
        }
    }
}
