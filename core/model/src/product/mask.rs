//! Binary masks as runs, in COCO's order: down the first column, then the second.

use super::{BBox, Plane};
use crate::error::{Error, Result};

/// A binary mask as alternating run lengths of 0 and 1, column by column, the first run being 0s (maybe none).
///
/// Runs are canonical: only the first may be empty. Two masks are equal exactly when their pixels are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    width: u32,
    height: u32,
    counts: Vec<u32>,
}

/// Collects the runs of a mask from the positions, in column-major order, at which it changes value.
struct Runs {
    counts: Vec<u32>,
    value: bool,
    start: u32,
}

impl Runs {
    fn new() -> Self {
        Self { counts: Vec::new(), value: false, start: 0 }
    }

    /// The mask has `value` from `position` on.
    fn set(&mut self, position: u32, value: bool) {
        if value != self.value {
            self.counts.push(position - self.start);
            (self.start, self.value) = (position, value);
        }
    }

    fn finish(mut self, width: u32, height: u32) -> Mask {
        let end = width * height;
        if end > self.start || self.counts.is_empty() {
            self.counts.push(end - self.start);
        }
        Mask { width, height, counts: self.counts }
    }
}

impl Mask {
    /// The mask of no pixel.
    pub fn empty(width: u32, height: u32) -> Self {
        Runs::new().finish(width, height)
    }

    /// The mask of the pixels (x, y) for which `f` is true.
    pub fn from_fn(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> bool) -> Self {
        let mut runs = Runs::new();
        for x in 0..width {
            for y in 0..height {
                runs.set(x * height + y, f(x, y));
            }
        }
        runs.finish(width, height)
    }

    /// The mask whose value flips at each of the given positions `x · height + y`, ascending, starting from 0.
    pub fn from_flips(width: u32, height: u32, flips: &[u32]) -> Self {
        let mut runs = Runs::new();
        for &position in flips {
            let value = !runs.value;
            runs.set(position, value);
        }
        runs.finish(width, height)
    }

    /// A mask from run lengths, which must add up to width × height.
    pub fn from_counts(width: u32, height: u32, counts: &[u32]) -> Result<Self> {
        let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        if total != u64::from(width) * u64::from(height) {
            return Err(Error::new(format!("runs add up to {total}, not to {width} × {height} pixels")));
        }
        let mut runs = Runs::new();
        let mut position = 0;
        for (i, &count) in counts.iter().enumerate() {
            if count > 0 {
                runs.set(position, i % 2 == 1);
            }
            position += count;
        }
        Ok(runs.finish(width, height))
    }

    /// Width of the image, px.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the image, px.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The run lengths: COCO's uncompressed `counts`.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Number of pixels.
    pub fn area(&self) -> u32 {
        self.counts.iter().skip(1).step_by(2).sum()
    }

    /// Whether no pixel is set.
    pub fn is_empty(&self) -> bool {
        self.counts.len() < 2
    }

    /// The runs of set pixels as half-open ranges of positions `x · height + y`.
    pub fn runs(&self) -> impl Iterator<Item = std::ops::Range<u32>> {
        let mut position = 0;
        self.counts.iter().enumerate().filter_map(move |(i, &count)| {
            let start = position;
            position += count;
            (i % 2 == 1).then_some(start..position)
        })
    }

    /// The runs cut at the ends of columns: the column, and the half-open range of its rows.
    pub fn segments(&self) -> impl Iterator<Item = (u32, std::ops::Range<u32>)> {
        let height = self.height;
        self.runs().flat_map(move |run| {
            let (first, last) = (run.start / height, (run.end - 1) / height);
            (first..=last).map(move |x| {
                let column = x * height;
                (x, run.start.max(column) - column..run.end.min(column + height) - column)
            })
        })
    }

    /// Tight box around the set pixels; all zeros if there are none.
    pub fn bbox(&self) -> BBox {
        let mut segments = self.segments();
        let Some((left, rows)) = segments.next() else { return BBox::default() };
        let around = |(_, top, bottom): (u32, u32, u32), (x, rows): (u32, std::ops::Range<u32>)| {
            (x, top.min(rows.start), bottom.max(rows.end))
        };
        let (right, top, bottom) = segments.fold((left, rows.start, rows.end), around);
        let [x, y, width, height] = [left, top, right + 1 - left, bottom - top].map(|edge| edge as i32);
        BBox { x, y, width, height }
    }

    /// The part of the mask within its [box](Self::bbox), with an edge of so many pixels around it that are not set.
    pub fn within_box(&self, edge: u32) -> Plane<bool> {
        let [left, top, width, height] = <[i32; 4]>::from(self.bbox()).map(|at| at as u32);
        let (width, height) = (width + 2 * edge, height + 2 * edge);
        let mut inside = vec![false; width as usize * height as usize];
        for (x, rows) in self.segments() {
            let first = (rows.start - top + edge) * width + x - left + edge;
            let column = inside[first as usize..].iter_mut().step_by(width as usize);
            column.take(rows.len()).for_each(|pixel| *pixel = true);
        }
        Plane::from_vec(width, height, inside)
    }

    /// Pixels in this mask and the other.
    pub fn and(&self, other: &Self) -> Self {
        self.merge(other, |a, b| a && b)
    }

    /// Pixels in this mask or the other.
    pub fn or(&self, other: &Self) -> Self {
        self.merge(other, |a, b| a || b)
    }

    /// Pixels in this mask but not in the other.
    pub fn minus(&self, other: &Self) -> Self {
        self.merge(other, |a, b| a && !b)
    }

    /// Pixel-wise combination; `f(false, false)` must be false. Panics if the images differ in size.
    fn merge(&self, other: &Self, f: impl Fn(bool, bool) -> bool) -> Self {
        assert_eq!((self.width, self.height), (other.width, other.height), "masks of one image");
        let mut runs = Runs::new();
        let (mut a, mut b) = (Cursor::new(&self.counts), Cursor::new(&other.counts));
        let mut position = 0;
        while let (Some(x), Some(y)) = (a.end(), b.end()) {
            runs.set(position, f(a.value(), b.value()));
            position = x.min(y);
            a.skip_to(position);
            b.skip_to(position);
        }
        runs.finish(self.width, self.height)
    }

    /// The mask as an image.
    pub fn to_plane(&self) -> Plane<bool> {
        let mut plane = Plane::from_vec(self.width, self.height, vec![false; (self.width * self.height) as usize]);
        self.pixels().for_each(|pixel| plane.data_mut()[pixel] = true);
        plane
    }

    /// Indices of the mask's pixels in a [`Plane`], down the columns.
    pub fn pixels(&self) -> impl Iterator<Item = usize> {
        let width = self.width as usize;
        self.segments().flat_map(move |(x, rows)| rows.map(move |y| y as usize * width + x as usize))
    }

    /// COCO's compressed `counts`: differences to the run before last, five bits a letter, low bits first.
    pub fn to_coco(&self) -> String {
        let mut out = String::new();
        for (i, &count) in self.counts.iter().enumerate() {
            let mut rest = i64::from(count) - if i > 2 { i64::from(self.counts[i - 2]) } else { 0 };
            loop {
                let group = (rest & 0x1f) as u8;
                rest >>= 5;
                let last = rest == if group & 0x10 == 0 { 0 } else { -1 };
                out.push(char::from(48 + (group | if last { 0 } else { 0x20 })));
                if last {
                    break;
                }
            }
        }
        out
    }

    /// Reads COCO's compressed `counts`.
    pub fn from_coco(width: u32, height: u32, text: &str) -> Result<Self> {
        let mut counts: Vec<u32> = Vec::new();
        let mut letters = text.bytes();
        let wrong = |what: &str| Error::new(format!("run lengths {text:?}: {what}"));
        while let Some(mut letter) = letters.next() {
            let (mut value, mut shift) = (0_i64, 0);
            loop {
                if !(48..112).contains(&letter) || shift > 35 {
                    return Err(wrong("not COCO's alphabet"));
                }
                let group = i64::from(letter - 48);
                value |= (group & 0x1f) << shift;
                shift += 5;
                if group & 0x20 == 0 {
                    if group & 0x10 != 0 {
                        value |= -1 << shift;
                    }
                    break;
                }
                letter = letters.next().ok_or_else(|| wrong("cut short"))?;
            }
            let before = if counts.len() > 2 { i64::from(counts[counts.len() - 2]) } else { 0 };
            counts.push(u32::try_from(value + before).map_err(|_| wrong("a negative run"))?);
        }
        Self::from_counts(width, height, &counts)
    }
}

/// Walks over the runs of a mask.
struct Cursor<'a> {
    counts: &'a [u32],
    run: usize,
    end: u32,
}

impl<'a> Cursor<'a> {
    fn new(counts: &'a [u32]) -> Self {
        let mut cursor = Self { counts, run: 0, end: counts.first().copied().unwrap_or(0) };
        cursor.skip_to(0);
        cursor
    }

    fn end(&self) -> Option<u32> {
        (self.run < self.counts.len()).then_some(self.end)
    }

    fn value(&self) -> bool {
        self.run % 2 == 1
    }

    fn skip_to(&mut self, position: u32) {
        while self.run < self.counts.len() && self.end <= position {
            self.run += 1;
            self.end += self.counts.get(self.run).copied().unwrap_or(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask(rows: &[&str]) -> Mask {
        Mask::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| rows[y as usize].as_bytes()[x as usize] == b'#')
    }

    fn check(rows: &[&str], counts: &[u32], coco: &str, area: u32, bbox: [i32; 4]) {
        let got = mask(rows);
        assert_eq!(got.counts(), counts);
        assert_eq!(got.to_coco(), coco);
        assert_eq!(got.area(), area);
        assert_eq!(got.bbox(), BBox::from(bbox));
        assert_eq!(Mask::from_coco(got.width(), got.height(), coco).expect("reads back"), got);
    }

    #[test]
    fn pycocotools_vectors() {
        check(&["....", ".##.", ".##."], &[4, 2, 1, 2, 3], "42102", 4, [1, 1, 2, 2]);
        check(&["#..#", "....", "#..#"], &[0, 1, 1, 1, 6, 1, 1, 1], "011050K0", 4, [0, 0, 4, 3]);
        check(&["...."; 3], &[12], "<", 0, [0, 0, 0, 0]);
        check(&["####"; 3], &[0, 12], "0<", 12, [0, 0, 4, 3]);
        check(
            &["..........", "..######..", "..######..", ".....##...", ".........."],
            &[11, 2, 3, 2, 3, 2, 3, 3, 2, 3, 2, 2, 12],
            ";2300001O00O:",
            14,
            [2, 1, 6, 3],
        );
        let big = Mask::from_fn(640, 480, |x, y| (100..200).contains(&x) && (50..150).contains(&y));
        assert!(big.to_coco().starts_with("bm^1T3l;000") && big.to_coco().len() == 209);
    }

    #[test]
    fn wrong_runs_are_refused() {
        for text in ["!", "P", "12", "O"] {
            assert!(Mask::from_coco(4, 3, text).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn algebra_is_that_of_pixels(
            (w, h, a, b) in (1_u32..9, 1_u32..9).prop_flat_map(|(w, h)| {
                let bits = || proptest::collection::vec(any::<bool>(), (w * h) as usize);
                (Just(w), Just(h), bits(), bits())
            })
        ) {
            let make = |bits: &[bool]| Mask::from_fn(w, h, |x, y| bits[(y * w + x) as usize]);
            let zip = |f: fn(bool, bool) -> bool| {
                make(&a.iter().zip(&b).map(|(&a, &b)| f(a, b)).collect::<Vec<_>>())
            };
            let (ma, mb) = (make(&a), make(&b));
            prop_assert_eq!(ma.and(&mb), zip(|a, b| a && b));
            prop_assert_eq!(ma.or(&mb), zip(|a, b| a || b));
            prop_assert_eq!(ma.minus(&mb), zip(|a, b| a && !b));
            prop_assert_eq!(ma.to_plane().data().to_vec(), a.clone());
            let inside = ma.within_box(1);
            let BBox { x, y, width, height } = ma.bbox();
            prop_assert_eq!([inside.width(), inside.height()], [width, height].map(|edge| edge as u32 + 2));
            let set = |column: u32, row: u32| {
                let (column, row) = (column as i32 + x - 1, row as i32 + y - 1);
                (0..w as i32).contains(&column) && (0..h as i32).contains(&row) && a[(row * w as i32 + column) as usize]
            };
            prop_assert_eq!(&inside, &Plane::from_fn(inside.width(), inside.height(), set));
            prop_assert_eq!(ma.area() as usize, a.iter().filter(|&&bit| bit).count());
            prop_assert_eq!(Mask::from_coco(w, h, &ma.to_coco()).expect("reads back"), ma.clone());
            let set: Vec<(u32, u32)> = (0..w).flat_map(|x| (0..h).map(move |y| (x, y)))
                .filter(|&(x, y)| a[(y * w + x) as usize]).collect();
            let bbox = ma.bbox();
            if let (Some(x0), Some(x1)) = (set.iter().map(|p| p.0).min(), set.iter().map(|p| p.0).max()) {
                let y0 = set.iter().map(|p| p.1).min().unwrap();
                let y1 = set.iter().map(|p| p.1).max().unwrap();
                prop_assert_eq!(bbox, BBox::from([x0, y0, x1 - x0 + 1, y1 - y0 + 1].map(|v| v as i32)));
            } else {
                prop_assert_eq!(bbox, BBox::default());
            }
        }
    }
}
