//! Images of objects, each cut to its object.

use super::{Mask, ObjectDepths, PerInstance, Pixel, Plane};
use crate::scene::InstanceId;
use std::collections::BTreeMap;
use std::ops::Range;

/// For each annotated instance, an image of the size of the view. Only the part that shows the instance is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectImages<P> {
    width: u32,
    height: u32,
    around: P,
    images: BTreeMap<InstanceId, ObjectImage<P>>,
}

/// The stored part of an object's image.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectImage<P> {
    /// Column of its left edge in the view.
    pub x: u32,
    /// Row of its top edge in the view.
    pub y: u32,
    /// The pixels. The value around them is the same for all images.
    pub pixels: Plane<P>,
}

impl<P: Pixel> ObjectImage<P> {
    /// The pixels of a mask's box. `pixel` gives each pixel of the mask from its index in the mask's image. Pixels
    /// outside of the mask, and pixels for which it gives none, are `around`.
    pub fn of_mask(mask: &Mask, around: P, mut pixel: impl FnMut(usize) -> Option<P>) -> Self {
        let mut image = Self::around(mask, around);
        let (width, image_width) = (image.pixels.width() as usize, mask.width() as usize);
        for (column, rows) in mask.segments() {
            for row in rows {
                if let Some(value) = pixel(row as usize * image_width + column as usize) {
                    let place = (row - image.y) as usize * width + (column - image.x) as usize;
                    image.pixels.data_mut()[place] = value;
                }
            }
        }
        image
    }

    /// The box of a mask, all of one value.
    fn around(mask: &Mask, value: P) -> Self {
        let [x, y, width, height] = <[i32; 4]>::from(mask.bbox()).map(|edge| edge as u32);
        Self { x, y, pixels: Plane::from_vec(width, height, vec![value; width as usize * height as usize]) }
    }

    /// The pixel at a column and row of the view, if it is stored.
    pub fn at(&self, x: u32, y: u32) -> Option<&P> {
        self.place(x, y).map(|place| &self.pixels.data()[place])
    }

    /// The stored pixels of some columns of a row of the view, and the column of the first.
    pub fn row(&self, y: u32, columns: Range<u32>) -> Option<(u32, &[P])> {
        self.part_of_row(y, columns).map(|(left, places)| (left, &self.pixels.data()[places]))
    }

    /// The same, with their indices among all stored pixels.
    fn part_of_row(&self, y: u32, columns: Range<u32>) -> Option<(u32, Range<usize>)> {
        let left = columns.start.max(self.x);
        let right = columns.end.min(self.x + self.pixels.width());
        let place = self.place(left, y).filter(|_| left < right)?;
        Some((left, place..place + (right - left) as usize))
    }

    /// Index of the pixel at a column and row of the view among the stored pixels.
    fn place(&self, x: u32, y: u32) -> Option<usize> {
        let (x, y) = (x.checked_sub(self.x)?, y.checked_sub(self.y)?);
        let (width, height) = (self.pixels.width(), self.pixels.height());
        (x < width && y < height).then(|| y as usize * width as usize + x as usize)
    }
}

impl<P: Pixel + Default> ObjectImages<P> {
    /// No images, for a view of a width and height. Images that are added are zero around their stored parts.
    pub fn new(width: u32, height: u32) -> Self {
        Self::within(P::default(), width, height)
    }
}

impl<P: Pixel> ObjectImages<P> {
    /// Width and height of the view, px.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// No images, for a view of a width and height. Images that are added are `around` outside of their stored parts.
    pub fn within(around: P, width: u32, height: u32) -> Self {
        Self { width, height, around, images: BTreeMap::new() }
    }

    /// Images of the boxes of masks, from the objects on the rays of a view. `values` gives a function for each object,
    /// which maps column and row of a pixel and the depth to a value. It sets the pixels of the mask at which the ray
    /// hits the object; all other pixels are `around`.
    pub fn of_hits<V: Fn([u32; 2], f32) -> P>(
        masks: &PerInstance<Mask>,
        hits: &ObjectDepths,
        around: P,
        values: impl Fn(InstanceId) -> V,
    ) -> Self {
        let places = masks.iter().map(|(id, _)| usize::from(id.0) + 1).max().unwrap_or(0);
        let mut images: Vec<Option<(Plane<bool>, ObjectImage<P>)>> = vec![None; places];
        for (id, mask) in masks.iter() {
            images[usize::from(id.0)] = Some((mask.within_box(0), ObjectImage::around(mask, around)));
        }
        for run in hits.runs() {
            for (place, id) in run.ids().enumerate() {
                let Some(Some((inside, image))) = images.get_mut(usize::from(id.0)) else { continue };
                let Some((left, places)) = image.part_of_row(run.y, run.x..run.x + run.length) else { continue };
                let value = values(id);
                let pixels = inside.data()[places.clone()].iter().zip(&mut image.pixels.data_mut()[places]);
                let depths = run.depths_from(left, place);
                for ((x, (is_inside, pixel)), depth) in (left..).zip(pixels).zip(depths) {
                    if *is_inside {
                        *pixel = value([x, run.y], depth);
                    }
                }
            }
        }
        let images = (0..).map(InstanceId).zip(images).filter_map(|(id, image)| Some((id, image?.1))).collect();
        Self { width: hits.width(), height: hits.height(), around, images }
    }

    /// Adds the image of an instance. Panics if it reaches beyond the view.
    pub fn insert(&mut self, id: InstanceId, image: ObjectImage<P>) {
        let (right, bottom) = (image.x + image.pixels.width(), image.y + image.pixels.height());
        assert!(right <= self.width && bottom <= self.height, "the image of an object is within the view");
        self.images.insert(id, image);
    }

    /// The stored part of an instance's image.
    pub fn get(&self, id: InstanceId) -> Option<&ObjectImage<P>> {
        self.images.get(&id)
    }

    /// Ids and the stored parts of their images, in id order.
    pub fn iter(&self) -> impl Iterator<Item = (InstanceId, &ObjectImage<P>)> {
        self.images.iter().map(|(&id, image)| (id, image))
    }

    /// The image of an instance in the size of the view.
    pub fn whole(&self, id: InstanceId) -> Option<Plane<P>> {
        self.get(id).map(|image| self.filled(image))
    }

    /// The image of the view. Each pixel comes from the image of the instance that it shows, and is `around` if the
    /// image does not store it.
    pub fn seen(&self, first: &Plane<InstanceId>) -> Plane<P> {
        let mut seen = vec![self.around; self.pixels()];
        let width = self.width.max(1) as usize;
        for (y, (ids, pixels)) in (0..).zip(first.data().chunks(width).zip(seen.chunks_mut(width))) {
            let mut x = 0;
            for run in ids.chunk_by(|a, b| a == b) {
                let end = x + run.len() as u32;
                if let Some((left, part)) = self.get(run[0]).and_then(|image| image.row(y, x..end)) {
                    pixels[left as usize..][..part.len()].copy_from_slice(part);
                }
                x = end;
            }
        }
        Plane::from_vec(self.width, self.height, seen)
    }

    pub(super) fn filled(&self, ObjectImage { x, y, pixels }: &ObjectImage<P>) -> Plane<P> {
        let mut plane = Plane::from_vec(self.width, self.height, vec![self.around; self.pixels()]);
        plane.paste([*x, *y], pixels);
        plane
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::{Form, Product, Value};

    #[test]
    fn an_image_of_a_mask_is_its_box() {
        let mask = Mask::from_fn(5, 4, |x, y| (x, y) == (1, 2) || (x, y) == (3, 1) || (x, y) == (3, 2));
        let image = ObjectImage::of_mask(&mask, -1.0_f32, |index| (index != 13).then_some(index as f32));
        assert_eq!((image.x, image.y), (1, 1));
        assert_eq!(
            [(3, 1), (4, 1), (0, 1), (1, 0)].map(|(x, y)| image.at(x, y).copied()),
            [Some(8.0), None, None, None]
        );
        assert_eq!(image.pixels, Plane::from_vec(3, 2, vec![-1.0, -1.0, 8.0, 11.0, -1.0, -1.0]));
        assert_eq!(image.row(1, 2..5), Some((2, &[-1.0, 8.0][..])));
        assert_eq!(image.row(2, 0..2), Some((1, &[11.0][..])));
        assert_eq!([(0, 0..5), (3, 0..5), (1, 0..1), (1, 4..5)].map(|(y, columns)| image.row(y, columns)), [None; 4]);
        let mut images = ObjectImages::within(-1.0, 5, 4);
        images.insert(InstanceId(1), image);
        images.insert(InstanceId(2), ObjectImage::of_mask(&Mask::empty(5, 4), -1.0, |_| None));
        let of = |x, y| *images.whole(InstanceId(1)).expect("inserted").at(x, y);
        assert_eq!([of(3, 1), of(1, 2), of(3, 2), of(0, 0), of(4, 3)], [8.0, 11.0, -1.0, -1.0, -1.0]);
        assert_eq!(images.whole(InstanceId(2)), Some(Plane::from_vec(5, 4, vec![-1.0; 20])));
    }

    #[test]
    fn hits_of_an_image_match_the_mask() {
        let mask = Mask::from_fn(5, 4, |x, y| (x, y) == (1, 2) || (x, y) == (3, 1) || (x, y) == (3, 2));
        let masks: PerInstance<Mask> =
            [(InstanceId(2), mask), (InstanceId(4), Mask::empty(5, 4))].into_iter().collect();
        // Hits of the second object: outside of its box, in the box but outside of the mask, and at two of the mask's
        // three pixels.
        let hits = [(0, 2, 9.0), (7, 2, 8.0), (8, 2, 2.0), (8, 1, 1.0), (11, 2, 3.0), (11, 4, 4.0), (19, 7, 1.0)];
        let hits = hits.map(|(pixel, id, depth)| (pixel, InstanceId(id), depth)).to_vec();
        let hits = ObjectDepths::from_hits(5, 4, hits);
        let images = ObjectImages::of_hits(&masks, &hits, [0; 3], |id| {
            move |[x, y], depth| [id.0, (10 * x + y) as u16, depth as u16]
        });
        let image = images.get(InstanceId(2)).expect("masked");
        assert_eq!((image.x, image.y, image.pixels.width(), image.pixels.height()), (1, 1, 3, 2));
        assert_eq!(image.pixels.data(), [[0; 3], [0; 3], [2, 31, 2], [2, 12, 3], [0; 3], [0; 3]]);
        assert_eq!(images.iter().map(|(id, _)| id.0).collect::<Vec<_>>(), [2, 4]);
    }

    #[test]
    fn what_is_seen_is_of_the_image_of_each_pixel() {
        let mut images = ObjectImages::within(-1, 4, 2);
        for (id, x, y) in [(1, 0, 0), (3, 2, 0), (4, 1, 1)] {
            let pixels = Plane::from_fn(2, 1, |x, _| i32::from(id) * 10 + x as i32);
            images.insert(InstanceId(id), ObjectImage { x, y, pixels });
        }
        // The view shows more of the first object than its stored pixels, the second without an image, and a part of
        // the others.
        let first = Plane::from_vec(4, 2, [1, 1, 1, 3, 4, 4, 2, 3].map(InstanceId).to_vec());
        assert_eq!(images.seen(&first).data(), [10, 11, -1, 31, -1, 40, -1, -1]);
    }

    #[test]
    fn images_are_zero_around_what_is_kept() {
        let mut images = ObjectImages::<[u8; 2]>::new(4, 3);
        let pixels = Plane::from_fn(2, 1, |x, _| [7, x as u8]);
        images.insert(InstanceId(3), ObjectImage { x: 1, y: 2, pixels });
        let whole = images.whole(InstanceId(3)).expect("inserted");
        let want = Plane::from_fn(4, 3, |x, y| match (x, y) {
            (1, 2) => [7, 0],
            (2, 2) => [7, 1],
            _ => [0, 0],
        });
        assert_eq!(whole, want);
        assert_eq!(images.whole(InstanceId(1)), None);
        let Value::PerInstance(values) = images.encode() else { panic!("a value per instance") };
        assert_eq!(values.into_iter().collect::<Vec<_>>(), [(InstanceId(3), want.encode())]);
        assert_eq!(ObjectImages::<[u8; 2]>::form().of_one(), &Form::from(&want.encode()));
    }
}
