//! Area and bounds of what each object covers.

use super::BitPlane;

/// What an object covers of a plane.
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

/// What each object covers of a plane, run by run of equal sets.
pub fn extents(plane: &BitPlane) -> Vec<Extent> {
    let (sets, words, width) = (plane.data(), plane.words(), plane.width() as usize);
    let mut extents = vec![Extent::default(); plane.objects()];
    for word in 0..words {
        for row in 0..plane.height() as usize {
            let set_at = |x: usize| sets[(row * width + x) * words + word];
            let mut start = 0;
            while start < width {
                let mut set = set_at(start);
                let end = (start + 1..width).find(|&x| set_at(x) != set).unwrap_or(width);
                while set != 0 {
                    extents[word * 64 + set.trailing_zeros() as usize].add(row as u32, [start as u32, end as u32]);
                    set &= set - 1;
                }
                start = end;
            }
        }
    }
    extents
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::scene::InstanceId;

    #[test]
    fn areas_and_bounds_are_those_of_all_pixels() {
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
