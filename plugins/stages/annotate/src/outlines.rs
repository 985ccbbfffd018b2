//! Outlines of the masks as polygons.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_OUTLINE, VISIBLE_MASK, VISIBLE_OUTLINE};
use syntable_model::product::{BBox, Mask};

/// Outlines of the visible and amodal masks as polygons, as in COCO's `segmentation`: lists of x1, y1, x2, y2, … in pixels,
/// where pixel (0, 0) is the square from (0, 0) to (1, 1).
///
/// `polygons` are the outer outlines of a mask, clockwise in the image; `holes` are the inner ones, counterclockwise.
/// COCO has no holes: a reader of `polygons` alone fills them. Parts that touch only at corners are separate polygons.
/// An empty mask has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Outlines {
    /// Maximum distance of a polygon from the edges of the mask's pixels, pixels. 0.5 (the default) removes the steps
    /// of slanted edges. 0 keeps every corner of every pixel, so the polygons and holes equal the mask.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tolerance_px: f64,
}

impl Default for Outlines {
    fn default() -> Self {
        Self { tolerance_px: 0.5 }
    }
}

config!(Outlines => dyn ImageAnnotator, "outlines", "tolerance_px = 0.5");

/// A product of masks, and the product with their outlines.
type OfMasks = (Key<PerInstance<Mask>>, Key<PerInstance<Value>>);

/// Masks and the provided outlines.
const OF_MASKS: [OfMasks; 2] = [(VISIBLE_MASK, VISIBLE_OUTLINE), (AMODAL_MASK, AMODAL_OUTLINE)];

impl ImageAnnotator for Outlines {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_OUTLINE, AMODAL_OUTLINE]
    }

    fn groups(&self) -> Vec<ProductGroup> {
        let group = |(mask, outline): (Key<_>, Key<_>)| ProductGroup { reads: keys![mask], provides: keys![outline] };
        OF_MASKS.into_iter().map(group).collect()
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        for (mask, outline) in OF_MASKS {
            let Some(masks) = products.optional(mask)? else { continue };
            let outlines = masks.iter().map(|(id, mask)| Ok((id, Value::of(&self.outline(mask))?)));
            let outlines = outlines.collect::<Result<_>>()?;
            products.put(outline, outlines)?;
        }
        Ok(())
    }
}

/// An entry of the products.
#[derive(Serialize)]
struct OutlineView {
    polygons: Vec<Vec<f64>>,
    holes: Vec<Vec<f64>>,
}

impl Outlines {
    fn outline(&self, mask: &Mask) -> OutlineView {
        let flat =
            |ring: &Ring| simplified(ring, self.tolerance_px).iter().flatten().map(|&at| f64::from(at)).collect();
        let (parts, holes): (Vec<Ring>, Vec<Ring>) = rings(mask).into_iter().partition(|ring| doubled_area(ring) > 0);
        OutlineView { polygons: parts.iter().map(flat).collect(), holes: holes.iter().map(flat).collect() }
    }
}

/// A closed polygon of corners of pixels; the first corner is not repeated.
pub type Ring = Vec<[i32; 2]>;

/// Twice the area inside a ring, px²; negative if it is counterclockwise in the image.
pub fn doubled_area(ring: &[[i32; 2]]) -> i64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| i64::from(a[0]) * i64::from(b[1]) - i64::from(b[0]) * i64::from(a[1])).sum()
}

/// Right, down, left, up.
const STEPS: [[i32; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// The edges between a mask's pixels and all other pixels, as rings of corners, with the mask to the right of the
/// direction of the ring. Rings are in the order of their first corners, row by row.
pub fn rings(mask: &Mask) -> Vec<Ring> {
    let BBox { x: left, y: top, width, height } = mask.bbox();
    if mask.is_empty() {
        return Vec::new();
    }
    let inside = mask.within_box(1);
    // The directions, as bits, in which edges leave a corner: the mask has a pixel to the right of each.
    let columns = width + 1;
    let mut leaving = vec![0_u8; (columns * (height + 1)) as usize];
    let rows = inside.data().chunks_exact(inside.width() as usize);
    let corners = leaving.chunks_exact_mut(columns as usize);
    for ((above, below), corners) in rows.clone().zip(rows.skip(1)).zip(corners) {
        let (left, right) = (above.iter().zip(below), above[1..].iter().zip(&below[1..]));
        for ((corner, (&a, &c)), (&b, &d)) in corners.iter_mut().zip(left).zip(right) {
            let [right, down, left, up] = [d & !b, c & !d, a & !c, b & !a].map(u8::from);
            *corner = right | down << 1 | left << 2 | up << 3;
        }
    }
    let mut rings = Vec::new();
    let mut start = 0;
    while let Some(next) = leaving[start..].iter().position(|leaving| *leaving != 0) {
        start += next;
        while leaving[start] != 0 {
            rings.push(ring_from(start, columns, &mut leaving).into_iter().map(|[x, y]| [x + left, y + top]).collect());
        }
    }
    rings
}

/// Follows one ring and removes its edges from `leaving`. Only the corners at which it turns are kept.
fn ring_from(start: usize, columns: i32, leaving: &mut [u8]) -> Ring {
    let mut ring = Ring::new();
    let mut at = [start as i32 % columns, start as i32 / columns];
    let first = leaving[start].trailing_zeros() as usize;
    let (mut direction, mut turned) = (first, true);
    loop {
        if turned {
            ring.push(at);
        }
        let corner = (at[1] * columns + at[0]) as usize;
        leaving[corner] &= !(1 << direction);
        at = [at[0] + STEPS[direction][0], at[1] + STEPS[direction][1]];
        let corner = (at[1] * columns + at[0]) as usize;
        // Turning right first stays at the same pixel, so that parts that touch at a corner are separate.
        let next =
            [1, 0, 3].map(|turn| (direction + turn) % 4).into_iter().find(|next| leaving[corner] >> next & 1 == 1);
        let Some(next) = next else { break };
        (direction, turned) = (next, next != direction);
    }
    // The start is a corner of the ring only if the last edge turns there.
    if direction == first {
        ring.remove(0);
    }
    ring
}

/// A ring with fewer corners; the removed ones are at most a tolerance away from it (Douglas and Peucker, 1973). Two
/// corners always stay: the corner farthest from the first, and the corner farthest from that.
fn simplified(ring: &Ring, tolerance: f64) -> Ring {
    if tolerance <= 0.0 || ring.len() < 4 {
        return ring.clone();
    }
    let square = |a: [i32; 2], b: [i32; 2]| (0..2).map(|k| i64::from(a[k] - b[k]).pow(2)).sum::<i64>();
    let farthest = |from: usize| (0..ring.len()).max_by_key(|&i| (square(ring[from], ring[i]), ring.len() - i));
    let one = farthest(0).unwrap_or(0);
    let other = farthest(one).unwrap_or(0);
    let (first, second) = (one.min(other), one.max(other));
    let mut kept = vec![false; ring.len()];
    (kept[first], kept[second]) = (true, true);
    let mut open = vec![(first, second), (second, first + ring.len())];
    while let Some((a, b)) = open.pop() {
        let at = |i: usize| if i < ring.len() { ring[i] } else { ring[i - ring.len()] };
        let far =
            (a + 1..b).map(|i| (scaled_distance(at(i), at(a), at(b)), i)).reduce(|x, y| if y.0 > x.0 { y } else { x });
        let limit = tolerance * tolerance * squared_length(at(a), at(b)) as f64;
        if let Some((_, i)) = far.filter(|(far, _)| *far > limit) {
            kept[i % ring.len()] = true;
            open.extend([(a, i), (i, b)]);
        }
    }
    let corners: Ring = ring.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(&corner, _)| corner).collect();
    // A part that is as thin as the tolerance keeps its shape, and its direction of rotation.
    let same = corners.len() > 2 && doubled_area(&corners).signum() == doubled_area(ring).signum();
    if same { corners } else { ring.clone() }
}

/// Square of the distance of a point from a segment, times the square of the segment's length, which counts as 1 if it
/// is 0.
fn scaled_distance(p: [i32; 2], a: [i32; 2], b: [i32; 2]) -> f64 {
    let from = |q: [i32; 2]| [i64::from(p[0]) - i64::from(q[0]), i64::from(p[1]) - i64::from(q[1])];
    let (side, [x, y]) = ([0, 1].map(|k| i64::from(b[k]) - i64::from(a[k])), from(a));
    let along = x * side[0] + y * side[1];
    let length = squared_length(a, b);
    let to_end = |[x, y]: [i64; 2]| (x * x + y * y) as f64 * length as f64;
    if along <= 0 {
        to_end([x, y])
    } else if along >= length {
        to_end(from(b))
    } else {
        let across = (side[0] * y - side[1] * x) as f64;
        across * across
    }
}

/// Square of the length of a segment; 1 if it is 0.
fn squared_length(a: [i32; 2], b: [i32; 2]) -> i64 {
    let [x, y] = [0, 1].map(|k| i64::from(b[k]) - i64::from(a[k]));
    (x * x + y * y).max(1)
}

register!(Outlines);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn drawn(rows: &[&str]) -> Mask {
        let width = rows[0].len() as u32;
        Mask::from_fn(width, rows.len() as u32, |x, y| rows[y as usize].as_bytes()[x as usize] == b'#')
    }

    /// Whether a point is in a ring: a ray to the left meets the ring an odd number of times.
    fn is_inside(ring: &[[i32; 2]], [x, y]: [f64; 2]) -> bool {
        let next = ring.iter().cycle().skip(1);
        let meets = ring.iter().zip(next).filter(|(a, b)| {
            let [a, b] = [**a, **b].map(|corner| corner.map(f64::from));
            (a[1] > y) != (b[1] > y) && x > a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        meets.count() % 2 == 1
    }

    /// Distance of a point from a segment, px.
    fn distance(p: [i32; 2], a: [i32; 2], b: [i32; 2]) -> f64 {
        let [p, a, b] = [p, a, b].map(|q| q.map(f64::from));
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let length = along[0] * along[0] + along[1] * along[1];
        let t = if length > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
        (to[0] - t * along[0]).hypot(to[1] - t * along[1])
    }

    #[test]
    fn outlines_on_paper() {
        // A frame with a hole, a pixel that touches it at a corner, and a bar at the edge of the image.
        let mask = drawn(&["###...#", "#.#...#", "###....", "...#..."]);
        let found = rings(&mask);
        let wanted: [&[[i32; 2]]; 4] = [
            &[[0, 0], [3, 0], [3, 3], [0, 3]],
            &[[6, 0], [7, 0], [7, 2], [6, 2]],
            &[[1, 1], [1, 2], [2, 2], [2, 1]],
            &[[3, 3], [4, 3], [4, 4], [3, 4]],
        ];
        assert_eq!(found, wanted);
        assert_eq!(found.iter().map(|ring| doubled_area(ring)).collect::<Vec<_>>(), [18, 4, -2, 2]);
        let outline = Outlines::default().outline(&mask);
        assert_eq!((outline.polygons.len(), outline.holes.len()), (3, 1));
        assert_eq!(outline.polygons[0], [0.0, 0.0, 3.0, 0.0, 3.0, 3.0, 0.0, 3.0]);
        assert!(rings(&Mask::empty(4, 4)).is_empty());
        // Steps of a slanted edge become one line.
        let stairs = drawn(&["#....", "##...", "###..", "####.", "#####"]);
        let [ring] = &rings(&stairs)[..] else { panic!("one part") };
        assert!(ring.len() > 10 && simplified(ring, 0.75).len() <= 5, "{:?}", simplified(ring, 0.75));
    }

    proptest! {
        #[test]
        fn outlines_are_the_mask_and_stay_near_it(
            bits in prop::collection::vec(0_u8..5, 12 * 9),
            tolerance in 0.0..2.0_f64,
        ) {
            // Blobs instead of noise.
            let full = |x: i32, y: i32| (0..12).contains(&x) && (0..9).contains(&y) && bits[(y * 12 + x) as usize] > 1;
            let mask = Mask::from_fn(12, 9, |x, y| {
                (-1..2).filter(|d| full(x as i32 + d, y as i32)).count() + (-1..2).filter(|d| full(x as i32, y as i32 + d)).count() > 3
            });
            let rings = rings(&mask);
            prop_assert_eq!(rings.iter().map(|ring| doubled_area(ring)).sum::<i64>(), 2 * i64::from(mask.area()));
            for (x, y) in (0..9).flat_map(|y| (0..12).map(move |x| (x, y))) {
                let center = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let around = rings.iter().filter(|ring| is_inside(ring, center)).count();
                prop_assert_eq!(around % 2 == 1, *mask.to_plane().at(x, y));
            }
            for ring in &rings {
                prop_assert!(ring.iter().zip(ring.iter().cycle().skip(1)).all(|(a, b)| a != b));
                let few = simplified(ring, tolerance);
                prop_assert_eq!(doubled_area(&few).signum(), doubled_area(ring).signum());
                for corner in ring {
                    let sides = few.iter().zip(few.iter().cycle().skip(1));
                    let nearest = sides.map(|(a, b)| distance(*corner, *a, *b)).fold(f64::INFINITY, f64::min);
                    prop_assert!(nearest <= tolerance + 1e-9, "{nearest}");
                }
            }
        }
    }
}
