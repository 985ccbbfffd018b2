//! Images of values: one value, or one set of instances, per pixel.

use crate::scene::InstanceId;

/// An image of values, row-major `[height, width]`, row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane<T> {
    width: u32,
    height: u32,
    data: Vec<T>,
}

impl<T> Plane<T> {
    /// An image from its values, row by row. Panics if their number is not width × height.
    pub fn from_vec(width: u32, height: u32, data: Vec<T>) -> Self {
        assert_eq!(data.len(), width as usize * height as usize, "a plane has width × height values");
        Self { width, height, data }
    }

    /// An image from a function of (x, y).
    pub fn from_fn(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> T) -> Self {
        let data = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Self { width, height, data }
    }

    /// Width, px.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row by row.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The value at column x of row y.
    pub fn at(&self, x: u32, y: u32) -> &T {
        &self.data[y as usize * self.width as usize + x as usize]
    }

    /// A plane of the same size.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Plane<U> {
        Plane { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

/// A set of objects for every pixel: bit `i` stands for the object with instance id `i + 1`.
///
/// Only objects own bits; supports and room parts do not. The plane may be larger than the image by a margin on
/// every side, so that labels can cover what lies outside the image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BitPlane {
    width: u32,
    height: u32,
    margin: [u32; 2],
    objects: usize,
    words: usize,
    data: Vec<u64>,
}

impl BitPlane {
    /// An empty plane over an image of width × height, grown by `margin` = (columns, rows) on every side.
    pub fn new(width: u32, height: u32, margin: [u32; 2], objects: usize) -> Self {
        let words = objects.div_ceil(64).max(1);
        let pixels = (width + 2 * margin[0]) as usize * (height + 2 * margin[1]) as usize;
        Self { width, height, margin, objects, words, data: vec![0; pixels * words] }
    }

    /// Width of the image without margins, px.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the image without margins, px.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Columns and rows that the plane has beyond the image, on every side.
    pub fn margin(&self) -> [u32; 2] {
        self.margin
    }

    /// How many objects own a bit.
    pub fn objects(&self) -> usize {
        self.objects
    }

    /// Words a pixel.
    pub fn words(&self) -> usize {
        self.words
    }

    /// The set of a pixel as words, bit 0 first. x runs over `-margin .. width + margin`, y likewise.
    pub fn set(&self, x: i32, y: i32) -> &[u64] {
        let start = self.index(x, y);
        &self.data[start..start + self.words]
    }

    /// Whether an object is in the set of a pixel.
    pub fn contains(&self, x: i32, y: i32, id: InstanceId) -> bool {
        let bit = usize::from(id.0) - 1;
        bit < self.objects && self.set(x, y)[bit / 64] >> (bit % 64) & 1 == 1
    }

    /// Puts an object into the set of a pixel.
    pub fn insert(&mut self, x: i32, y: i32, id: InstanceId) {
        let bit = usize::from(id.0) - 1;
        assert!(bit < self.objects, "only objects own a bit");
        let start = self.index(x, y);
        self.data[start + bit / 64] |= 1 << (bit % 64);
    }

    /// All words: rows of the plane, pixels of a row, words of a pixel.
    pub fn data(&self) -> &[u64] {
        &self.data
    }

    /// All words, to be filled in parallel by rows of [`row_words`](Self::row_words).
    pub fn data_mut(&mut self) -> &mut [u64] {
        &mut self.data
    }

    /// Words in a row of the plane.
    pub fn row_words(&self) -> usize {
        (self.width + 2 * self.margin[0]) as usize * self.words
    }

    fn index(&self, x: i32, y: i32) -> usize {
        let column = (x + self.margin[0] as i32) as usize;
        let row = (y + self.margin[1] as i32) as usize;
        row * self.row_words() + column * self.words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_at_word_borders_and_in_margins() {
        for objects in [1, 64, 65] {
            let mut plane = BitPlane::new(3, 2, [1, 2], objects);
            let last = InstanceId(objects as u16);
            plane.insert(-1, -2, last);
            plane.insert(3, 3, InstanceId(1));
            assert!(plane.contains(-1, -2, last) && plane.contains(3, 3, InstanceId(1)));
            assert_eq!(plane.data().iter().map(|word| word.count_ones()).sum::<u32>(), 2);
        }
    }

    #[test]
    fn planes_are_row_major() {
        let plane = Plane::from_fn(3, 2, |x, y| 10 * y + x);
        assert_eq!(plane.data(), [0, 1, 2, 10, 11, 12]);
        assert_eq!(*plane.at(2, 1), 12);
    }
}
