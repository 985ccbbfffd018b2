//! All objects on the rays of a view, from front to back.

use super::{DType, Form, Product, Tensor, Value};
use crate::scene::InstanceId;

/// For each pixel, the objects on the ray through its center with the depth of their first surface, from front to back. Of
/// equal depths the lower id comes first.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectDepths {
    width: u32,
    height: u32,
    /// Where the objects of each pixel begin, row by row, and at last where those of the last pixel end.
    starts: Vec<u32>,
    objects: Vec<(InstanceId, f32)>,
}

impl ObjectDepths {
    /// From hits in any order: index of the pixel, row by row; the object; its depth. An object hits a pixel once.
    pub fn from_hits(width: u32, height: u32, mut hits: Vec<(u32, InstanceId, f32)>) -> Self {
        hits.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)).then(a.1.cmp(&b.1)));
        let mut starts = vec![0; width as usize * height as usize + 1];
        for (pixel, ..) in &hits {
            starts[*pixel as usize + 1] += 1;
        }
        for pixel in 1..starts.len() {
            starts[pixel] += starts[pixel - 1];
        }
        Self { width, height, starts, objects: hits.into_iter().map(|(_, id, depth)| (id, depth)).collect() }
    }

    /// Width, px.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Objects and depths of each pixel, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = &[(InstanceId, f32)]> {
        self.starts.windows(2).map(|ends| &self.objects[ends[0] as usize..ends[1] as usize])
    }

    /// Objects and depths of the pixel at column x of row y.
    pub fn at(&self, x: u32, y: u32) -> &[(InstanceId, f32)] {
        self.of_pixel(y as usize * self.width as usize + x as usize)
    }

    /// Depth of an object at a pixel, by the pixel's index in a [`Plane`](super::Plane); none where its ray misses the object.
    pub fn of(&self, id: InstanceId, pixel: usize) -> Option<f32> {
        self.of_pixel(pixel).iter().find(|(other, _)| *other == id).map(|(_, depth)| *depth)
    }

    fn of_pixel(&self, pixel: usize) -> &[(InstanceId, f32)] {
        &self.objects[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }
}

impl Product for ObjectDepths {
    fn encode(&self) -> Value {
        let list = |dtype, axis, bytes: Vec<u8>| {
            let count = bytes.len() / DType::size(dtype);
            Value::Tensor(Tensor::new(dtype, &[axis], vec![count], bytes))
        };
        let starts = self.starts.iter().flat_map(|start| start.to_le_bytes()).collect();
        let ids = self.objects.iter().flat_map(|(id, _)| id.0.to_le_bytes()).collect();
        let depths = self.objects.iter().flat_map(|(_, depth)| depth.to_le_bytes()).collect();
        Value::record([
            ("starts", list(DType::U32, "pixel", starts)),
            ("ids", list(DType::U16, "hit", ids)),
            ("depths", list(DType::F32, "hit", depths)),
        ])
    }

    fn form() -> Form {
        Form::Record
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_come_from_front_to_back() {
        let id = InstanceId;
        let hits = vec![(5, id(2), 2.0), (0, id(1), 1.0), (5, id(3), 1.0), (5, id(1), 2.0)];
        let depths = ObjectDepths::from_hits(3, 2, hits);
        assert_eq!(depths.at(2, 1), [(id(3), 1.0), (id(1), 2.0), (id(2), 2.0)]);
        assert_eq!(depths.at(0, 0), [(id(1), 1.0)]);
        assert_eq!([depths.of(id(2), 5), depths.of(id(4), 5), depths.of(id(1), 1)], [Some(2.0), None, None]);
        let counts: Vec<usize> = depths.pixels().map(<[_]>::len).collect();
        assert_eq!(counts, [1, 0, 0, 0, 0, 3]);
    }
}
