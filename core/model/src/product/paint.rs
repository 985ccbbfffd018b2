//! Masks painted into one plane of ids. Only this code decides which object a pixel shows if several masks claim it.

use super::{Mask, Plane};
use crate::left_out::LeftOut;
use crate::scene::InstanceId;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A plane with one object per pixel, and the pixels that objects lost in it.
///
/// A pixel that several masks claim goes to the smallest mask; if masks are equally large, it goes to the lowest id. So
/// a cup stays in front of the table whose mask includes it, whatever the order of the annotations.
#[derive(Debug, Clone, PartialEq)]
pub struct Painted {
    /// The object of each pixel; 0 outside of all masks.
    pub ids: Plane<InstanceId>,
    /// Number of pixels of each object in the plane. Objects with an empty mask are left out.
    areas: BTreeMap<InstanceId, u32>,
    /// Number of pixels that each object lost to others. Objects that lost no pixel are left out.
    lost: BTreeMap<InstanceId, u32>,
    /// Masks of all objects in the plane, computed when the mask of an object that lost pixels is first requested.
    masks: OnceLock<BTreeMap<InstanceId, Mask>>,
}

/// The pixels of every label of a plane. The default label has no mask. One pass finds all masks.
pub fn masks_of<L: Copy + Default + Ord>(map: &Plane<L>) -> BTreeMap<L, Mask> {
    let [width, height] = [map.width(), map.height()];
    let mut flips: BTreeMap<L, Vec<u32>> = BTreeMap::new();
    let mut before = L::default();
    for x in 0..width {
        for y in 0..height {
            let label = *map.at(x, y);
            if label != before {
                for of in [before, label] {
                    flips.entry(of).or_default().push(x * height + y);
                }
                before = label;
            }
        }
    }
    flips.remove(&L::default());
    flips.into_iter().map(|(label, flips)| (label, Mask::from_flips(width, height, &flips))).collect()
}

impl Painted {
    /// Paints masks of the size of the image. Every id comes once.
    pub fn new<'m>([width, height]: [u32; 2], masks: impl IntoIterator<Item = (InstanceId, &'m Mask)>) -> Self {
        let mut masks: Vec<(u32, InstanceId, &Mask)> =
            masks.into_iter().map(|(id, mask)| (mask.area(), id, mask)).filter(|it| it.0 > 0).collect();
        masks.sort_by_key(|&(area, id, _)| std::cmp::Reverse((area, id)));
        let mut ids = Plane::from_fn(width, height, |_, _| InstanceId::default());
        let mut areas: BTreeMap<InstanceId, u32> = masks.iter().map(|&(area, id, _)| (id, area)).collect();
        let mut lost: BTreeMap<InstanceId, u32> = BTreeMap::new();
        for (_, id, mask) in masks {
            for pixel in mask.pixels() {
                let below = std::mem::replace(&mut ids.data_mut()[pixel], id);
                if below != InstanceId::default() {
                    *lost.entry(below).or_default() += 1;
                }
            }
        }
        for (id, pixels) in &lost {
            *areas.get_mut(id).expect("what lost pixels had some") -= pixels;
        }
        Self { ids, areas, lost, masks: OnceLock::new() }
    }

    /// The pixels of an object's mask that the object has in the plane.
    pub fn mask<'m>(&self, id: InstanceId, mask: &'m Mask) -> Cow<'m, Mask> {
        if !self.lost.contains_key(&id) {
            return Cow::Borrowed(mask);
        }
        let left = self.masks.get_or_init(|| masks_of(&self.ids)).get(&id).cloned();
        Cow::Owned(left.unwrap_or_else(|| Mask::empty(self.ids.width(), self.ids.height())))
    }

    /// The objects that have pixels in the plane.
    pub fn shown(&self) -> impl Iterator<Item = InstanceId> {
        self.areas.iter().filter(|(_, area)| **area > 0).map(|(id, _)| *id)
    }

    /// The losses: how many objects have fewer pixels than their masks, and how many of these have none.
    pub fn left_out(&self) -> impl Iterator<Item = LeftOut> {
        let (all, gone) = (self.areas.len(), self.areas.values().filter(|area| **area == 0).count());
        let some = "objects lost pixels where masks overlap: a pixel shows one object, the one with the smallest mask";
        let whole = "objects lost all of their pixels where masks overlap: the image of ids does not show them";
        let help =
            "choose a format that stores each mask separately, such as coco, or npz with `visible_mask` in `include`";
        [LeftOut::new(self.lost.len(), all, some), LeftOut::new(gone, all, whole)]
            .into_iter()
            .map(move |it| it.help(help))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_the_pixels_of_their_objects_in_the_plane() {
        // Large squares below smaller ones. The second one covers the third one, which is equally large, entirely.
        let square = |from: [u32; 2], edge: u32| {
            Mask::from_fn(13, 11, |x, y| {
                (from[0]..from[0] + edge).contains(&x) && (from[1]..from[1] + edge).contains(&y)
            })
        };
        let squares = [([0, 0], 9), ([2, 3], 4), ([2, 3], 4), ([8, 8], 3), ([3, 3], 2)];
        let masks: Vec<(InstanceId, Mask)> =
            (1..).zip(squares).map(|(id, (from, edge))| (InstanceId(id), square(from, edge))).collect();
        let painted = Painted::new([13, 11], masks.iter().map(|(id, mask)| (*id, mask)));
        for (id, mask) in &masks {
            let shown = Mask::from_fn(13, 11, |x, y| *painted.ids.at(x, y) == *id);
            let got = painted.mask(*id, mask);
            assert_eq!(*got, shown, "object {id}");
            assert_eq!(matches!(got, Cow::Owned(_)), shown != *mask, "object {id}");
            assert_eq!(painted.shown().any(|it| it == *id), !shown.is_empty(), "object {id}");
        }
        assert!(painted.mask(InstanceId(3), &masks[2].1).is_empty(), "all of its pixels show others");
    }
}
