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

    /// The mask of the pixels that are set in an image.
    pub fn from_plane(image: &Plane<bool>) -> Self {
        let (width, height) = (image.width(), image.height());
        let bits = Bits::of(image);
        // Flips in the order of columns: first their number in each, then each in its place.
        let mut places = vec![0_usize; width as usize + 1];
        bits.flips(|x, _| places[x + 1] += 1);
        for x in 1..places.len() {
            places[x] += places[x - 1];
        }
        let mut flips = vec![0; places[width as usize]];
        bits.flips(|x, y| {
            flips[places[x]] = x as u32 * height + y as u32;
            places[x] += 1;
        });
        Self::from_flips(width, height, &flips)
    }

    /// The mask whose value flips at each of the given positions `x · height + y`, ascending, starting from 0.
    pub fn from_flips(width: u32, height: u32, flips: &[u32]) -> Self {
        let (mut counts, mut start) = (Vec::with_capacity(flips.len() + 1), 0);
        for &position in flips {
            counts.push(position - start);
            start = position;
        }
        let end = width * height;
        if end > start || counts.is_empty() {
            counts.push(end - start);
        }
        Self { width, height, counts }
    }

    /// A mask from run lengths, which must add up to width × height.
    pub fn from_counts(width: u32, height: u32, counts: &[u32]) -> Result<Self> {
        Self::from_runs(width, height, counts.to_vec())
    }

    fn from_runs(width: u32, height: u32, counts: Vec<u32>) -> Result<Self> {
        let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        if total != u64::from(width) * u64::from(height) {
            return Err(Error::new(format!("runs add up to {total}, not to {width} × {height} pixels")));
        }
        if !counts.is_empty() && counts.iter().skip(1).all(|&count| count > 0) {
            return Ok(Self { width, height, counts });
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
        let (mut x, mut top) = (0, 0);
        self.runs().flat_map(move |run| {
            // Most runs are in the column of the previous run, or in the next column.
            if run.start - top >= 2 * height {
                x = run.start / height;
                top = x * height;
            } else if run.start - top >= height {
                (x, top) = (x + 1, top + height);
            }
            let (first, first_top) = (x, top);
            while run.end - top > height {
                (x, top) = (x + 1, top + height);
            }
            (first..=x).map(move |x| {
                let top = first_top + (x - first) * height;
                (x, run.start.max(top) - top..(run.end - top).min(height))
            })
        })
    }

    /// Tight box around the set pixels; all zeros if no pixel is set.
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

    /// The part of the mask within its [box](Self::bbox), with a margin of `edge` unset pixels on each side.
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

    /// Number of pixels in this mask and the other. Both are of one image.
    pub fn shared_area(&self, other: &Self) -> u32 {
        let (mut left, mut right) = (self.runs().peekable(), other.runs().peekable());
        let mut area = 0;
        while let (Some(x), Some(y)) = (left.peek(), right.peek()) {
            area += x.end.min(y.end).saturating_sub(x.start.max(y.start));
            if x.end < y.end {
                left.next()
            } else {
                right.next()
            };
        }
        area
    }

    /// Pixel-wise combination; `f(false, false)` must be false. Panics if the images differ in size.
    fn merge(&self, other: &Self, f: impl Fn(bool, bool) -> bool) -> Self {
        assert_eq!((self.width, self.height), (other.width, other.height), "masks of one image");
        let mut runs = Runs::new();
        let (mut a, mut b) = (RunCursor::new(&self.counts), RunCursor::new(&other.counts));
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
        Plane::from_vec(self.width, self.height, self.rows(|bit| bit != 0))
    }

    /// The mask as an image: `value` of 1 where the mask is set, and `value` of 0 elsewhere.
    fn rows<T>(&self, value: impl Fn(u8) -> T + Copy) -> Vec<T> {
        let (width, height) = (self.width as usize, self.height as usize);
        let words = width.div_ceil(64);
        // The places where the value changes on the way down a column. The first pixel is compared with 0.
        let mut changes = vec![0_u64; words * height];
        for (x, rows) in self.segments() {
            let (word, bit) = (x as usize / 64, 1 << (x % 64));
            changes[rows.start as usize * words + word] ^= bit;
            if rows.end < self.height {
                changes[rows.end as usize * words + word] ^= bit;
            }
        }
        let (mut data, mut row) = (Vec::with_capacity(width * height + 64), vec![0_u64; words]);
        for (y, changes) in changes.chunks_exact(words.max(1)).enumerate() {
            for (bits, change) in row.iter_mut().zip(changes) {
                *bits ^= change;
                bits.to_le_bytes().into_iter().for_each(|eight| data.extend(spread(eight).map(value)));
            }
            data.truncate((y + 1) * width);
        }
        data
    }

    /// Indices of the mask's pixels in a [`Plane`], down the columns.
    pub fn pixels(&self) -> impl Iterator<Item = usize> {
        let width = self.width as usize;
        self.segments().flat_map(move |(x, rows)| rows.map(move |y| y as usize * width + x as usize))
    }

    /// COCO's compressed `counts`: differences to the run before last, five bits a letter, low bits first.
    pub fn to_coco(&self) -> String {
        // A run of an object is seldom longer than 1023 pixels, or much longer than the run next to it.
        let mut out = Vec::with_capacity(self.counts.len() + self.counts.len() / 2 + 8);
        let mut letter = |group: i64| out.push(48 + group as u8);
        for (i, &count) in self.counts.iter().enumerate() {
            let mut rest = i64::from(count) - if i > 2 { i64::from(self.counts[i - 2]) } else { 0 };
            while !(-16..16).contains(&rest) {
                letter(rest & 0x1f | 0x20);
                rest >>= 5;
            }
            letter(rest & 0x1f);
        }
        String::from_utf8(out).expect("letters of ASCII")
    }

    /// Reads COCO's compressed `counts`.
    pub fn from_coco(width: u32, height: u32, text: &str) -> Result<Self> {
        let mut counts: Vec<u32> = Vec::with_capacity(text.len());
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
        Self::from_runs(width, height, counts)
    }
}

/// Eight bits as bytes of 0 and 1, the lowest bit first.
fn spread(bits: u8) -> [u8; 8] {
    // Each byte keeps a bit of its own, which is then moved to the top and from there to the bottom.
    let own = (u64::from(bits) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    (((own + 0x7f7f_7f7f_7f7f_7f7f) >> 7) & 0x0101_0101_0101_0101).to_le_bytes()
}

/// Eight truth values as bits, the first the lowest.
fn gather(values: [bool; 8]) -> u8 {
    // The product has bit `i` of the result from byte `i`, and nothing else reaches the highest byte.
    (u64::from_le_bytes(values.map(u8::from)).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

/// Up to 64 truth values as bits, the first the lowest.
fn word(values: &[bool]) -> u64 {
    let (eights, rest) = values.as_chunks();
    let bits = eights.iter().rev().fold(0, |bits, &eight| bits << 8 | u64::from(gather(eight)));
    if rest.is_empty() {
        return bits;
    }
    let mut last = [false; 8];
    last[..rest.len()].copy_from_slice(rest);
    bits | u64::from(gather(last)) << (8 * eights.len())
}

/// An image of bits, 64 columns a word, the first the lowest bit. Bits beyond the image are 0.
struct Bits {
    width: usize,
    words: usize,
    data: Vec<u64>,
}

impl Bits {
    fn of(image: &Plane<bool>) -> Self {
        let width = image.width() as usize;
        let words = width.div_ceil(64);
        let mut data = Vec::with_capacity(words * image.height() as usize);
        for row in image.data().chunks_exact(width.max(1)) {
            data.extend(row.chunks(64).map(word));
        }
        Self { width, words, data }
    }

    /// Calls `flip` with column and row of each pixel that differs from the previous pixel down the columns, row by
    /// row. The pixel before the first one of a column is the last one of the previous column; the pixel before all
    /// others is 0.
    fn flips(&self, mut flip: impl FnMut(usize, usize)) {
        let Some(bottom) = self.data.len().checked_sub(self.words) else { return };
        let mut above: Vec<u64> = Vec::with_capacity(self.words);
        let mut carry = 0;
        for &word in &self.data[bottom..] {
            above.push(word << 1 | carry);
            carry = word >> 63;
        }
        if !self.width.is_multiple_of(64) {
            above.iter_mut().last().into_iter().for_each(|word| *word &= (1 << (self.width % 64)) - 1);
        }
        for (y, row) in self.data.chunks_exact(self.words.max(1)).enumerate() {
            for (word, (&bits, above)) in row.iter().zip(&mut above).enumerate() {
                let mut changed = bits ^ std::mem::replace(above, bits);
                while changed != 0 {
                    flip(64 * word + changed.trailing_zeros() as usize, y);
                    changed &= changed - 1;
                }
            }
        }
    }
}

/// Walks over the runs of a mask.
struct RunCursor<'a> {
    counts: &'a [u32],
    run: usize,
    end: u32,
}

impl<'a> RunCursor<'a> {
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
        /// Blobs and noise on images of one and several words a row, whole and not.
        #[test]
        fn images_there_and_back((w, h) in (1_u32..200, 1_u32..9), seed: u64, size in 1_u32..20) {
            let bits = |x: u32, y: u32| {
                let cell = (u64::from(x / size) << 32 | u64::from(y / size)).wrapping_mul(seed | 1);
                cell.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 1
            };
            let (mask, plane) = (Mask::from_fn(w, h, bits), Plane::from_fn(w, h, bits));
            prop_assert_eq!(&mask.to_plane(), &plane);
            prop_assert_eq!(&Mask::from_plane(&plane), &mask);
            let pixels: Vec<usize> = (0..w).flat_map(|x| (0..h).map(move |y| (x, y)))
                .filter(|&(x, y)| bits(x, y)).map(|(x, y)| (y * w + x) as usize).collect();
            prop_assert_eq!(mask.pixels().collect::<Vec<_>>(), pixels);
            prop_assert_eq!(Mask::from_coco(w, h, &mask.to_coco()).expect("reads back"), mask);
        }

        #[test]
        fn algebra_matches_pixels(
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
            prop_assert_eq!(ma.shared_area(&mb), zip(|a, b| a && b).area());
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
            prop_assert_eq!(Mask::from_plane(&ma.to_plane()), ma.clone());
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
