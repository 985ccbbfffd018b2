//! Images of objects, each cut to where the object is.

use super::{Form, Pixel, Plane, Product, Value};
use crate::scene::InstanceId;
use std::collections::BTreeMap;

/// For each annotated instance an image of the size of the view, of which the part that may differ from zero is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectImages<P> {
    width: u32,
    height: u32,
    images: BTreeMap<InstanceId, ObjectImage<P>>,
}

/// What is kept of an object's image.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectImage<P> {
    /// Column of its left edge in the view.
    pub x: u32,
    /// Row of its top edge in the view.
    pub y: u32,
    /// The pixels; those around them are zero.
    pub pixels: Plane<P>,
}

impl<P: Pixel + Default> ObjectImages<P> {
    /// No images, for a view of a width and height.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, images: BTreeMap::new() }
    }

    /// Adds the image of an instance. Panics if it reaches beyond the view.
    pub fn insert(&mut self, id: InstanceId, image: ObjectImage<P>) {
        let (right, bottom) = (image.x + image.pixels.width(), image.y + image.pixels.height());
        assert!(right <= self.width && bottom <= self.height, "the image of an object is within the view");
        self.images.insert(id, image);
    }

    /// What is kept of an instance's image.
    pub fn get(&self, id: InstanceId) -> Option<&ObjectImage<P>> {
        self.images.get(&id)
    }

    /// Ids and what is kept of their images, in id order.
    pub fn iter(&self) -> impl Iterator<Item = (InstanceId, &ObjectImage<P>)> {
        self.images.iter().map(|(&id, image)| (id, image))
    }

    /// The image of an instance in the size of the view.
    pub fn whole(&self, id: InstanceId) -> Option<Plane<P>> {
        self.get(id).map(|image| self.filled(image))
    }

    fn filled(&self, ObjectImage { x, y, pixels }: &ObjectImage<P>) -> Plane<P> {
        let mut plane = Plane::from_vec(self.width, self.height, vec![P::default(); self.pixels()]);
        plane.paste([*x, *y], pixels);
        plane
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl<P: Pixel + Default> Product for ObjectImages<P> {
    fn encode(&self) -> Value {
        Value::PerInstance(self.iter().map(|(id, image)| (id, self.filled(image).encode())).collect())
    }

    fn form() -> Form {
        Form::PerInstance(Box::new(Plane::<P>::form()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
