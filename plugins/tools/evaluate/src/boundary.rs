//! Boundary maps as the reference computes them: shifted by half a pixel to the top left, and without boundary pixels
//! where a mask touches the edge of the image.
//!
//! A map is kept as columns of bits, from the first to the last column that it can reach.

use syntable_model::product::Mask;

/// Tolerance as a share of the image's diagonal.
const TOLERANCE: f64 = 0.003;
/// Bits of a word.
const WORD: usize = 64;

/// Radius within which boundary pixels match, px.
pub fn radius(width: u32, height: u32) -> usize {
    let [width, height] = [width, height].map(f64::from);
    (TOLERANCE * (width * width + height * height).sqrt()).ceil() as usize
}

/// The boundary of a mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Boundary {
    columns: Columns,
    /// Number of columns of the image.
    width: usize,
    radius: usize,
    len: usize,
}

/// Neighboring columns of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Columns {
    /// Index of the first column.
    first: usize,
    /// Number of words per column.
    stride: usize,
    words: Vec<u64>,
}

impl Boundary {
    /// Pixels that differ from the neighbor to the right, below, or both. The last row and column have only one such
    /// neighbor.
    pub fn of(mask: &Mask) -> Self {
        let [width, height] = [mask.width(), mask.height()].map(|edge| edge as usize);
        let inside = Columns::of(mask);
        let below = below(height);
        let mut columns = inside.widened(1, 0, width);
        let empty = vec![0; inside.stride];
        for at in columns.range() {
            let own = inside.column(at).unwrap_or(&empty);
            let next = (at + 1 < width).then(|| inside.column(at + 1).unwrap_or(&empty));
            for (index, word) in columns.column_mut(at).iter_mut().enumerate() {
                *word = (own[index] ^ up(own, index)) & below[index];
                if let Some(next) = next {
                    *word |= (own[index] ^ next[index]) | (own[index] ^ up(next, index)) & below[index];
                }
            }
        }
        let len = columns.words.iter().map(|word| word.count_ones() as usize).sum();
        Self { columns, width, radius: radius(mask.width(), mask.height()), len }
    }

    /// Its pixels (x, y), row by row.
    pub fn pixels(&self) -> Vec<[usize; 2]> {
        let bits = |x: usize| {
            let column = self.columns.column(x).unwrap_or_default();
            (0..WORD * column.len()).filter(|y| column[y / WORD] >> (y % WORD) & 1 == 1).map(move |y| [x, y])
        };
        let mut pixels: Vec<[usize; 2]> = self.columns.range().flat_map(bits).collect();
        pixels.sort_unstable_by_key(|[x, y]| (*y, *x));
        pixels
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the map has no pixel.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of pixels within the radius of any pixel of the other map.
    pub fn near(&self, other: &Self) -> usize {
        let [own, others] = [self.columns.range(), other.columns.range()];
        if self.is_empty()
            || other.is_empty()
            || own.start >= others.end + self.radius
            || others.start >= own.end + self.radius
        {
            return 0;
        }
        let grown = other.grown();
        let both = |at: usize| {
            let (Some(own), Some(grown)) = (self.columns.column(at), grown.column(at)) else { return 0 };
            own.iter().zip(grown).map(|(a, b)| (a & b).count_ones() as usize).sum()
        };
        own.map(both).sum()
    }

    /// All pixels within the radius of the boundary.
    fn grown(&self) -> Columns {
        let radius = self.radius;
        let mut out = self.columns.widened(radius, radius, self.width);
        // Vertical reach of a pixel in a column at distance `away`.
        let reach = |away: usize| (0..=radius).rev().find(|dy| dy * dy + away * away <= radius * radius).unwrap_or(0);
        let reaches: Vec<usize> = (0..=radius).map(reach).collect();
        for at in self.columns.range() {
            let mut grown = self.columns.column(at).unwrap_or_default().to_vec();
            if grown.iter().all(|word| *word == 0) {
                continue;
            }
            for dy in 0..=radius {
                if dy > 0 {
                    grown =
                        (0..grown.len()).map(|index| grown[index] | up(&grown, index) | down(&grown, index)).collect();
                }
                for away in (0..=radius).filter(|away| reaches[*away] == dy) {
                    for to in [at.checked_sub(away), (away > 0).then_some(at + away)].into_iter().flatten() {
                        out.add(to, &grown);
                    }
                }
            }
        }
        out
    }
}

impl Columns {
    /// The columns of the box of a mask.
    fn of(mask: &Mask) -> Self {
        let (area, height) = (mask.bbox(), mask.height() as usize);
        let (first, stride) = (area.x as usize, height.div_ceil(WORD));
        let mut words = vec![0; area.width as usize * stride];
        for run in mask.runs() {
            let (mut from, end) = (run.start as usize, run.end as usize);
            while from < end {
                let (column, top) = (from / height, from % height);
                let bottom = height.min(top + end - from);
                fill(&mut words[(column - first) * stride..][..stride], top, bottom);
                from += bottom - top;
            }
        }
        Self { first, stride, words }
    }

    fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.words.len() / self.stride.max(1)
    }

    /// An empty map with the same columns and some more on either side, within an image of `width` columns.
    fn widened(&self, left: usize, right: usize, width: usize) -> Self {
        let range = self.range();
        if range.is_empty() {
            return self.clone();
        }
        let (first, end) = (range.start.saturating_sub(left), (range.end + right).min(width));
        Self { first, stride: self.stride, words: vec![0; (end - first) * self.stride] }
    }

    fn column(&self, at: usize) -> Option<&[u64]> {
        let index = at.checked_sub(self.first)? * self.stride;
        self.words.get(index..index + self.stride)
    }

    fn column_mut(&mut self, at: usize) -> &mut [u64] {
        let index = (at - self.first) * self.stride;
        &mut self.words[index..index + self.stride]
    }

    /// Adds bits to a column, if the column exists.
    fn add(&mut self, at: usize, bits: &[u64]) {
        if self.range().contains(&at) {
            self.column_mut(at).iter_mut().zip(bits).for_each(|(word, more)| *word |= more);
        }
    }
}

/// The rows that have a row below them.
fn below(height: usize) -> Vec<u64> {
    let mut words = vec![0; height.div_ceil(WORD)];
    fill(&mut words, 0, height.saturating_sub(1));
    words
}

fn fill(words: &mut [u64], top: usize, bottom: usize) {
    for (index, word) in words.iter_mut().enumerate() {
        let [from, to] = [top, bottom].map(|y| y.saturating_sub(index * WORD).min(WORD));
        if from < to {
            *word |= (u64::MAX >> (WORD - (to - from))) << from;
        }
    }
}

/// A word of a column, shifted up by one pixel.
fn up(column: &[u64], index: usize) -> u64 {
    column[index] >> 1 | column.get(index + 1).map_or(0, |next| next << (WORD - 1))
}

/// A word of a column, shifted down by one pixel.
fn down(column: &[u64], index: usize) -> u64 {
    column[index] << 1 | index.checked_sub(1).map_or(0, |before| column[before] >> (WORD - 1))
}
