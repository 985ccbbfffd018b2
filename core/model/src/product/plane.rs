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
        let mut data = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            data.extend((0..width).map(|x| f(x, y)));
        }
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

    /// Replaces some pixels by a smaller plane, with its first pixel at column x of row y. Panics if it reaches beyond
    /// this plane.
    pub fn paste(&mut self, [x, y]: [u32; 2], part: &Self)
    where
        T: Copy,
    {
        assert!(x + part.width <= self.width && y + part.height <= self.height, "a part is within its plane");
        let (width, columns) = (self.width as usize, part.width as usize);
        let rows = self.data.chunks_mut(width.max(1)).skip(y as usize);
        for (row, part) in rows.zip(part.data.chunks(columns.max(1))) {
            row[x as usize..][..columns].copy_from_slice(part);
        }
    }

    /// A plane of the same size.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Plane<U> {
        Plane { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

/// A set of objects for every pixel, row 0 at the top: bit `i` represents the object with instance id `i + 1`.
///
/// Only objects own bits; supports and room parts do not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BitPlane {
    width: u32,
    height: u32,
    objects: usize,
    words: usize,
    data: Vec<u64>,
}

impl BitPlane {
    /// A plane of empty sets.
    pub fn new(width: u32, height: u32, objects: usize) -> Self {
        let words = objects.div_ceil(64).max(1);
        Self { width, height, objects, words, data: vec![0; width as usize * height as usize * words] }
    }

    /// A plane of sets, from words in the order of [`Self::data`].
    ///
    /// # Panics
    /// If the number of words does not match the size of the plane.
    pub fn from_words(width: u32, height: u32, objects: usize, data: Vec<u64>) -> Self {
        let words = objects.div_ceil(64).max(1);
        assert_eq!(data.len(), width as usize * height as usize * words, "words of the plane");
        Self { width, height, objects, words, data }
    }

    /// Width, px.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Number of objects that own a bit.
    pub fn objects(&self) -> usize {
        self.objects
    }

    /// Words per pixel.
    pub fn words(&self) -> usize {
        self.words
    }

    /// The set of the pixel at column x of row y as words, bit 0 first.
    pub fn set(&self, x: u32, y: u32) -> &[u64] {
        let start = self.index(x, y);
        &self.data[start..start + self.words]
    }

    /// Whether an object is in the set of a pixel.
    pub fn contains(&self, x: u32, y: u32, id: InstanceId) -> bool {
        let bit = usize::from(id.0) - 1;
        bit < self.objects && self.set(x, y)[bit / 64] >> (bit % 64) & 1 == 1
    }

    /// Adds an object to the set of a pixel.
    pub fn insert(&mut self, x: u32, y: u32, id: InstanceId) {
        let bit = usize::from(id.0) - 1;
        assert!(bit < self.objects, "only objects own a bit");
        let start = self.index(x, y);
        self.data[start + bit / 64] |= 1 << (bit % 64);
    }

    /// All words: rows of the plane, pixels of a row, words of a pixel.
    pub fn data(&self) -> &[u64] {
        &self.data
    }

    /// Words per row.
    pub fn row_words(&self) -> usize {
        self.width as usize * self.words
    }

    fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.row_words() + x as usize * self.words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_at_word_borders() {
        for objects in [1, 64, 65] {
            let mut plane = BitPlane::new(3, 2, objects);
            let last = InstanceId(objects as u16);
            plane.insert(0, 0, last);
            plane.insert(2, 1, InstanceId(1));
            assert!(plane.contains(0, 0, last) && plane.contains(2, 1, InstanceId(1)));
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
