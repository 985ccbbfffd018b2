//! All objects on the rays of a view, from front to back.

use crate::scene::InstanceId;

/// For each pixel, the objects on the ray through its center with the depth of their first surface, from front to back. Of
/// equal depths the lower id comes first.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectDepths {
    width: u32,
    height: u32,
    /// Index of the first object of each pixel, row by row, and at the end the number of all objects.
    pub(super) starts: Vec<u32>,
    pub(super) objects: Vec<(InstanceId, f32)>,
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

    /// All pixels as runs of neighbors in a row that have the same objects in the same order, row by row.
    pub fn runs(&self) -> impl Iterator<Item = ObjectRun<'_>> {
        let width = self.width as usize;
        let mut next: usize = 0;
        std::iter::from_fn(move || {
            let pixel = next;
            let row = pixel.checked_div(width).filter(|row| *row < self.height as usize)?;
            let starts = &self.starts[pixel..=(row + 1) * width];
            let hits = |from: u32, to: u32| &self.objects[from as usize..to as usize];
            let first = hits(starts[0], starts[1]);
            let is_same = |starts: &&[u32]| {
                let objects = hits(starts[0], starts[1]);
                objects.len() == first.len() && objects.iter().zip(first).all(|(a, b)| a.0 == b.0)
            };
            let length = starts.windows(2).take_while(is_same).count();
            next += length;
            let hits = hits(starts[0], starts[length]);
            let [x, y, length] = [pixel - row * width, row, length].map(|number| number as u32);
            Some(ObjectRun { x, y, length, objects: first.len(), hits })
        })
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

/// Pixels side by side in a row that have the same objects in the same order.
#[derive(Debug, Clone, Copy)]
pub struct ObjectRun<'a> {
    /// Column of the first pixel.
    pub x: u32,
    /// Row of the pixels.
    pub y: u32,
    /// Number of pixels.
    pub length: u32,
    /// Number of objects at each.
    objects: usize,
    /// Objects and depths, pixel by pixel.
    hits: &'a [(InstanceId, f32)],
}

impl<'a> ObjectRun<'a> {
    /// The objects of each pixel, from front to back.
    pub fn ids(&self) -> impl Iterator<Item = InstanceId> + use<'a> {
        self.hits[..self.objects].iter().map(|hit| hit.0)
    }

    /// Depths of the object at a place in this order, from the pixel at a column on.
    pub fn depths_from(&self, column: u32, place: usize) -> impl Iterator<Item = f32> + use<'a> {
        let pixels = self.hits[(column - self.x) as usize * self.objects..].chunks_exact(self.objects);
        pixels.map(move |hits| hits[place].1)
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

    #[test]
    fn runs_have_the_same_objects_in_the_same_order() {
        // Two objects that change their order, one of them alone up to the end of a row and on in the next.
        let pixels: [&[(u16, f32)]; 10] = [
            &[(1, 1.0), (2, 2.0)],
            &[(1, 1.5), (2, 2.5)],
            &[(2, 1.0), (1, 2.0)],
            &[(2, 3.0)],
            &[(2, 4.0)],
            &[(2, 5.0)],
            &[],
            &[],
            &[(3, 1.0)],
            &[(1, 1.0)],
        ];
        let hits = (0..)
            .zip(pixels)
            .flat_map(|(pixel, hits)| hits.iter().map(move |&(id, depth)| (pixel, InstanceId(id), depth)));
        let depths = ObjectDepths::from_hits(5, 2, hits.collect());
        let of_run = |run: ObjectRun<'_>| {
            let depths = |place| run.depths_from(run.x, place).collect::<Vec<_>>();
            let objects = run.ids().enumerate().map(|(place, id)| (id.0, depths(place))).collect::<Vec<_>>();
            ([run.x, run.y, run.length], objects)
        };
        let runs: Vec<_> = depths.runs().map(of_run).collect();
        let wanted = [
            ([0, 0, 2], vec![(1, vec![1.0, 1.5]), (2, vec![2.0, 2.5])]),
            ([2, 0, 1], vec![(2, vec![1.0]), (1, vec![2.0])]),
            ([3, 0, 2], vec![(2, vec![3.0, 4.0])]),
            ([0, 1, 1], vec![(2, vec![5.0])]),
            ([1, 1, 2], vec![]),
            ([3, 1, 1], vec![(3, vec![1.0])]),
            ([4, 1, 1], vec![(1, vec![1.0])]),
        ];
        assert_eq!(runs, wanted);
        assert_eq!(ObjectDepths::from_hits(0, 3, Vec::new()).runs().count(), 0);
    }
}
