//! Windows around objects, packed side by side.

use super::Window;
use crate::product::{BitPlane, Plane, extents};
use crate::scene::InstanceId;
use std::cmp::Reverse;

/// Pixels that a window has beyond its object on each side: samples reach one pixel beyond their own.
const MARGIN: u32 = 2;

/// One window of the image for each object that covers a part of it, packed side by side: the layout of rendered products of
/// [single objects](crate::product::Framing::objects).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Atlas {
    /// Width and height, px; never 0, and no wider than the image.
    pub size: [u32; 2],
    /// The windows, in order of the ids.
    pub tiles: Vec<AtlasTile>,
}

/// The window of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AtlasTile {
    /// The object.
    pub id: InstanceId,
    /// The pixels of the image that it shows: the object and a margin.
    pub window: Window,
    /// Column and row of the window's first pixel in the atlas.
    pub at: [u32; 2],
}

impl Atlas {
    /// The atlas of a view with this [`COVERAGE`](crate::product::standard::COVERAGE). Windows are in rows, the highest
    /// first.
    pub fn of(coverage: &BitPlane) -> Self {
        let [right, bottom] = [coverage.width(), coverage.height()];
        let grown = |[x, y, width, height]: [u32; 4]| {
            let (left, top) = (x.saturating_sub(MARGIN), y.saturating_sub(MARGIN));
            let (width, height) = ((x + width + MARGIN).min(right) - left, (y + height + MARGIN).min(bottom) - top);
            Window { x: left as i32, y: top as i32, width, height }
        };
        let covering = extents(coverage).into_iter().zip(1..).filter(|(extent, _)| extent.area > 0);
        let tile = |(extent, id): (crate::product::Extent, u16)| AtlasTile {
            id: InstanceId(id),
            window: grown(extent.bounds()),
            at: [0, 0],
        };
        let mut tiles: Vec<AtlasTile> = covering.map(tile).collect();
        let mut order: Vec<&mut AtlasTile> = tiles.iter_mut().collect();
        order.sort_by_key(|tile| (Reverse(tile.window.height), tile.id));
        let (mut size, mut at) = ([0, 0], [0, 0]);
        for AtlasTile { window, at: place, .. } in order {
            if at[0] + window.width > right {
                at = [0, size[1]];
            }
            *place = at;
            at[0] += window.width;
            size = [size[0].max(at[0]), size[1].max(at[1] + window.height)];
        }
        Self { size: size.map(|edge: u32| edge.max(1)), tiles }
    }

    /// The window of an object; none if it covers nothing of the image.
    pub fn tile(&self, id: InstanceId) -> Option<&AtlasTile> {
        self.tiles.binary_search_by_key(&id, |tile| tile.id).ok().map(|index| &self.tiles[index])
    }

    /// Part of a plane of the atlas that shows a tile.
    pub fn cut<T: Copy>(plane: &Plane<T>, tile: &AtlasTile) -> Plane<T> {
        let ([x, y], Window { width, height, .. }) = (tile.at, tile.window);
        Plane::from_fn(width, height, |column, row| *plane.at(x + column, y + row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn windows_hold_their_objects_and_do_not_overlap() {
        let mut stream = Stream::root(5);
        let (width, height, objects) = (50, 40, 9);
        let mut coverage = BitPlane::new(width, height, objects);
        let mut boxes = Vec::new();
        // The third covers nothing.
        for id in (1..=9).filter(|id| *id != 3).map(InstanceId) {
            let [x, y] = [width - 12, height - 15].map(|most| stream.uniform(0.0, f64::from(most)) as u32);
            let [w, h] = [12, 15].map(|most| stream.uniform(1.0, f64::from(most)) as u32);
            (0..w * h).for_each(|i| coverage.insert(x + i % w, y + i / w, id));
            boxes.push((id, [x, y, x + w, y + h]));
        }
        let atlas = Atlas::of(&coverage);
        assert_eq!(
            atlas.tiles.iter().map(|tile| tile.id).collect::<Vec<_>>(),
            boxes.iter().map(|(id, _)| *id).collect::<Vec<_>>()
        );
        assert!(atlas.size[0] <= width);
        let mut taken = Plane::from_fn(atlas.size[0], atlas.size[1], |_, _| false);
        assert_eq!((atlas.tile(InstanceId(4)), atlas.tile(InstanceId(3))), (Some(&atlas.tiles[2]), None));
        for (tile, (_, [x0, y0, x1, y1])) in atlas.tiles.iter().zip(&boxes) {
            let window = tile.window;
            let grown = [
                x0.saturating_sub(2) as i32,
                y0.saturating_sub(2) as i32,
                (x1 + 2).min(width) as i32,
                (y1 + 2).min(height) as i32,
            ];
            assert_eq!([window.x, window.y, window.right(), window.bottom()], grown);
            for (x, y) in (0..window.height).flat_map(|y| (0..window.width).map(move |x| (x, y))) {
                let index = (tile.at[1] + y) * atlas.size[0] + tile.at[0] + x;
                assert!(!std::mem::replace(&mut taken.data_mut()[index as usize], true), "two tiles at ({x}, {y})");
            }
        }
        let number = Plane::from_fn(atlas.size[0], atlas.size[1], |x, y| [x, y]);
        let part = Atlas::cut(&number, &atlas.tiles[4]);
        let [x, y] = atlas.tiles[4].at;
        assert_eq!((*part.at(0, 0), *part.at(1, 1)), ([x, y], [x + 1, y + 1]));
        assert_eq!(Atlas::of(&BitPlane::new(8, 8, 2)), Atlas { size: [1, 1], tiles: Vec::new() });
    }
}
