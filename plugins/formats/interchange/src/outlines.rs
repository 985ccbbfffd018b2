//! Polygons and rotated boxes around masks.

use crate::coco::MaskChoice;
use serde::de::DeserializeOwned;
use syntable_formats::json;
use syntable_formats::read::label_of;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_OUTLINE, AMODAL_ROTATED_BOX, VISIBLE_OUTLINE, VISIBLE_ROTATED_BOX};

/// Corners of a closed polygon, px; the first one is not repeated.
pub type PolygonRing = Vec<[f64; 2]>;

/// The outline of an object in a product `*_outline`. A polygon of COCO's family has no holes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct OutlineRecord {
    polygons: Vec<Vec<f64>>,
    #[serde(default)]
    holes: Vec<Vec<f64>>,
}

/// The box of an object in a product `*_rotated_box`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct RotatedBoxRecord {
    corners_px: [[f64; 2]; 4],
}

/// The product of the outlines of these masks.
pub fn outline_key(masks: MaskChoice) -> Key<PerInstance<Value>> {
    match masks {
        MaskChoice::Visible => VISIBLE_OUTLINE,
        MaskChoice::Amodal => AMODAL_OUTLINE,
    }
}

/// The product of the rotated boxes of these masks.
pub fn rotated_box_key(masks: MaskChoice) -> Key<PerInstance<Value>> {
    match masks {
        MaskChoice::Visible => VISIBLE_ROTATED_BOX,
        MaskChoice::Amodal => AMODAL_ROTATED_BOX,
    }
}

/// The polygons around the parts of an object's mask, as lists x1, y1, x2, y2, … in pixels. Holes are left out.
pub fn polygons(products: &Products, masks: MaskChoice, id: InstanceId) -> Result<Vec<Vec<f64>>> {
    Ok(record::<OutlineRecord>(products, outline_key(masks), id)?.polygons)
}

/// Pixels of the holes of an object's mask, which its polygons fill; 0 if its outline has no holes.
pub fn hole_area(products: &Products, masks: MaskChoice, id: InstanceId, mask: &Mask) -> Result<u32> {
    let outline: OutlineRecord = record(products, outline_key(masks), id)?;
    Ok(if outline.holes.is_empty() { 0 } else { pixels_of_holes(mask) })
}

/// Reports the number of these objects with holes in their masks, which polygons fill.
pub fn report_holes(
    log: &dyn Log,
    products: &Products,
    masks: MaskChoice,
    ids: impl ExactSizeIterator<Item = InstanceId>,
) -> Result<()> {
    let (mut filled, all) = (0, ids.len());
    for id in ids {
        filled += usize::from(!record::<OutlineRecord>(products, outline_key(masks), id)?.holes.is_empty());
    }
    let kind = match masks {
        MaskChoice::Visible => "visible",
        MaskChoice::Amodal => "amodal",
    };
    let what = format!("objects have holes in their {kind} masks, which the polygons of the format fill");
    log.left_out(&LeftOut::new(filled, all, what).help("the writers `coco` and `d2sa` store masks with holes"));
    Ok(())
}

/// Number of pixels outside of a mask that cannot be reached from the outside without crossing the mask. Pixels that
/// meet only at a corner are not connected in the mask, so they are connected outside of it.
fn pixels_of_holes(mask: &Mask) -> u32 {
    let mut free = mask.within_box(1);
    let [width, height] = [free.width(), free.height()];
    free.data_mut().iter_mut().for_each(|pixel| *pixel = !*pixel);
    let mut open = vec![(0, 0)];
    while let Some((x, y)) = open.pop() {
        let pixel = &mut free.data_mut()[(y * width + x) as usize];
        if std::mem::take(pixel) {
            let around = |at: u32, end: u32| at.saturating_sub(1)..(at + 2).min(end);
            open.extend(around(y, height).flat_map(|y| around(x, width).map(move |x| (x, y))));
        }
    }
    free.data().iter().filter(|pixel| **pixel).count() as u32
}

/// The corners of the rotated box around an object's mask, px.
pub fn rotated_box(products: &Products, masks: MaskChoice, id: InstanceId) -> Result<[[f64; 2]; 4]> {
    Ok(record::<RotatedBoxRecord>(products, rotated_box_key(masks), id)?.corners_px)
}

/// One polygon around all parts of an object's mask; none if the mask is empty. Holes are left out.
pub fn ring(products: &Products, masks: MaskChoice, id: InstanceId) -> Result<PolygonRing> {
    let polygons = polygons(products, masks, id)?;
    let rings: Vec<&[[f64; 2]]> = polygons.iter().map(|polygon| polygon.as_chunks().0).collect();
    Ok(joined(&rings))
}

/// Joins several polygons into one. Each polygon is linked to its predecessors by an edge back and forth between their
/// nearest corners, which encloses no area. Ultralytics' converter from COCO links polygons in the same way.
fn joined(rings: &[&[[f64; 2]]]) -> PolygonRing {
    let mut all = PolygonRing::new();
    for ring in rings {
        let Some((at, start)) = nearest(&all, ring) else {
            all.extend_from_slice(ring);
            continue;
        };
        let around = ring[start..].iter().chain(&ring[..=start]).chain(std::iter::once(&all[at]));
        let around: PolygonRing = around.copied().collect();
        all.splice(at + 1..at + 1, around);
    }
    all
}

/// The indices of the nearest corners of two polygons; the first pair if several are equally near. None if a polygon
/// has no corner.
fn nearest(one: &[[f64; 2]], other: &[[f64; 2]]) -> Option<(usize, usize)> {
    let square = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
    let pairs =
        one.iter().enumerate().flat_map(|(i, a)| other.iter().enumerate().map(move |(j, b)| (square(a, b), i, j)));
    pairs.reduce(|best, pair| if pair.0 < best.0 { pair } else { best }).map(|(_, i, j)| (i, j))
}

/// The record of an object in a product, as a type.
fn record<T: DeserializeOwned>(products: &Products, key: Key<PerInstance<Value>>, id: InstanceId) -> Result<T> {
    json::of_record(label_of(products, key, id)?).map_err(|error| {
        Error::new(format!("`{}` of instance {id} is not what it should be: {error}", key.name()))
            .help("the annotator that provides it must give what the reference of products says")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the area, by the shoelace formula.
    fn doubled_area(ring: &[[f64; 2]]) -> f64 {
        let next = ring.iter().cycle().skip(1);
        ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum()
    }

    fn square(x: f64, y: f64, side: f64) -> PolygonRing {
        vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    }

    #[test]
    fn parts_are_linked_at_their_nearest_corners() {
        let (a, b) = (square(0.0, 0.0, 2.0), square(5.0, 1.0, 1.0));
        let want = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 2.0],
            [5.0, 2.0],
            [5.0, 1.0],
            [6.0, 1.0],
            [6.0, 2.0],
            [5.0, 2.0],
            [2.0, 2.0],
            [0.0, 2.0],
        ];
        assert_eq!(joined(&[&a, &b]), want);
        assert_eq!(joined(&[&a]), a);
        assert!(joined(&[]).is_empty());
    }

    #[test]
    fn links_enclose_nothing() {
        let mut stream = Stream::root(4);
        for _ in 0..100 {
            let parts: Vec<PolygonRing> = (0..stream.integer(1, 8))
                .map(|_| square(stream.uniform(0.0, 90.0), stream.uniform(0.0, 90.0), stream.uniform(1.0, 9.0)))
                .collect();
            let slices: Vec<&[[f64; 2]]> = parts.iter().map(Vec::as_slice).collect();
            let ring = joined(&slices);
            let areas: f64 = parts.iter().map(|part| doubled_area(part)).sum();
            assert!((doubled_area(&ring) - areas).abs() < 1e-9, "{ring:?}");
            // Each link adds a corner at both of its ends.
            assert_eq!(ring.len(), 4 * parts.len() + 2 * (parts.len() - 1));
        }
    }
}
