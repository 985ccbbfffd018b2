//! Rotated boxes around the masks.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_ROTATED_BOX, VISIBLE_MASK, VISIBLE_ROTATED_BOX};
use syntable_model::product::{BBox, Mask};

/// Rotated boxes of the visible and amodal masks: the rectangles of minimum area around all pixels of a mask.
///
/// `center_px` is (u, v), where pixel (0, 0) is the square from (0, 0) to (1, 1). `size_px` has the longer side and the
/// shorter one. `angle_deg` is the angle from the u axis to the longer side, clockwise in the image, in [−90, 90).
/// `corners_px` are in clockwise order. Of several rectangles of minimum area, the one along the first edge of the
/// mask's convex hull is used. The box of an empty mask is all zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RotatedBoxes {}

config!(RotatedBoxes => dyn ImageAnnotator, "rotated_boxes");

/// A product of masks, and the product with their boxes.
type OfMasks = (Key<PerInstance<Mask>>, Key<PerInstance<Value>>);

/// Masks and the provided boxes.
const OF_MASKS: [OfMasks; 2] = [(VISIBLE_MASK, VISIBLE_ROTATED_BOX), (AMODAL_MASK, AMODAL_ROTATED_BOX)];

impl ImageAnnotator for RotatedBoxes {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_ROTATED_BOX, AMODAL_ROTATED_BOX]
    }

    fn groups(&self) -> Vec<ProductGroup> {
        let group = |(mask, rotated): (Key<_>, Key<_>)| ProductGroup { reads: keys![mask], provides: keys![rotated] };
        OF_MASKS.into_iter().map(group).collect()
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        for (mask, rotated) in OF_MASKS {
            let Some(masks) = products.optional(mask)? else { continue };
            let boxes = masks.iter().map(|(id, mask)| Ok((id, Value::of(&RotatedBox::around(mask))?)));
            let boxes = boxes.collect::<Result<_>>()?;
            products.put(rotated, boxes)?;
        }
        Ok(())
    }
}

/// A rectangle in the image, px.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct RotatedBox {
    center_px: [f64; 2],
    size_px: [f64; 2],
    angle_deg: f64,
    corners_px: [[f64; 2]; 4],
}

impl RotatedBox {
    /// The rectangle of minimum area around a mask: one of its sides lies on a side of the convex hull (Freeman and
    /// Shapira, 1975).
    pub fn around(mask: &Mask) -> Self {
        let hull = convex_hull(&ends(mask));
        let sides = hull.iter().zip(hull.iter().cycle().skip(1));
        let boxes = sides.map(|(a, b)| Around::new(&hull, *a, *b));
        let least = boxes.reduce(|best, other| if other.area() < best.area() { other } else { best });
        least.map(Self::from).unwrap_or_default()
    }
}

/// A rectangle around points, with a side along the line from one point to another.
struct Around {
    /// Directions of the sides. Clockwise in the image: the second direction is the first one rotated from u to v.
    axes: [[f64; 2]; 2],
    /// Start and end along each direction.
    ends: [[f64; 2]; 2],
}

impl Around {
    fn new(points: &[[i32; 2]], a: [i32; 2], b: [i32; 2]) -> Self {
        let [dx, dy] = [0, 1].map(|k| f64::from(b[k] - a[k]));
        let length = libm::hypot(dx, dy);
        let axes = [[dx / length, dy / length], [-dy / length, dx / length]];
        let ends = axes.map(|axis| {
            let along = points.iter().map(|p| f64::from(p[0]) * axis[0] + f64::from(p[1]) * axis[1]);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        });
        Self { axes, ends }
    }

    fn sides(&self) -> [f64; 2] {
        self.ends.map(|[low, high]| high - low)
    }

    fn area(&self) -> f64 {
        self.sides()[0] * self.sides()[1]
    }
}

impl From<Around> for RotatedBox {
    fn from(around: Around) -> Self {
        let (axes, [across, down], [width, height]) = (around.axes, around.ends, around.sides());
        let point = |s: f64, t: f64| [0, 1].map(|k| s * axes[0][k] + t * axes[1][k]);
        let middle = |[low, high]: [f64; 2]| (low + high) / 2.0;
        let longer = if width >= height { axes[0] } else { axes[1] };
        let turned = libm::atan2(longer[1], longer[0]).to_degrees();
        let angle = if turned >= 90.0 {
            turned - 180.0
        } else if turned < -90.0 {
            turned + 180.0
        } else {
            turned
        };
        Self {
            center_px: point(middle(across), middle(down)),
            size_px: [width.max(height), width.min(height)],
            angle_deg: angle,
            corners_px: [
                point(across[0], down[0]),
                point(across[1], down[0]),
                point(across[1], down[1]),
                point(across[0], down[1]),
            ],
        }
    }
}

/// The ends of the columns of corners around a mask's pixels, from left to right, the upper one first. They determine
/// the convex hull.
fn ends(mask: &Mask) -> Vec<[i32; 2]> {
    let BBox { x: left, width, .. } = mask.bbox();
    let mut rows = vec![[i32::MAX, i32::MIN]; width as usize + 1];
    for (column, segment) in mask.segments() {
        for ends in rows[column as usize - left as usize..].iter_mut().take(2) {
            *ends = [ends[0].min(segment.start as i32), ends[1].max(segment.end as i32)];
        }
    }
    let columns = (left..).zip(rows).filter(|(_, [top, bottom])| top < bottom);
    columns.flat_map(|(x, rows)| rows.map(|y| [x, y])).collect()
}

/// The corners of the convex hull of points in ascending order, clockwise in the image from the leftmost (Andrew's
/// monotone chain), without points on its sides.
fn convex_hull(points: &[[i32; 2]]) -> Vec<[i32; 2]> {
    let turn = |a: [i32; 2], b: [i32; 2], c: [i32; 2]| {
        let [ab, ac] = [b, c].map(|p| [0, 1].map(|k| i64::from(p[k] - a[k])));
        ab[0] * ac[1] - ab[1] * ac[0]
    };
    let chain = |points: &mut dyn Iterator<Item = [i32; 2]>| {
        let mut chain: Vec<[i32; 2]> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let there = chain(&mut points.iter().copied());
    let back = chain(&mut points.iter().rev().copied());
    [there, back].concat()
}

register!(RotatedBoxes);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn boxes_on_paper() {
        let bar = RotatedBox::around(&Mask::from_fn(20, 20, |x, y| (3..13).contains(&x) && (5..7).contains(&y)));
        assert_eq!((bar.center_px, bar.size_px, bar.angle_deg), ([8.0, 6.0], [10.0, 2.0], 0.0));
        let upright = RotatedBox::around(&Mask::from_fn(20, 20, |x, y| (3..5).contains(&x) && (5..16).contains(&y)));
        assert_eq!((upright.center_px, upright.size_px, upright.angle_deg), ([4.0, 10.5], [11.0, 2.0], -90.0));
        // A diagonal of pixels, down to the right: √2 wide, and 10 √2 long.
        let slanted = RotatedBox::around(&Mask::from_fn(20, 20, |x, y| x == y && x < 10));
        let size = [10.0, 1.0].map(|side: f64| side * 2.0_f64.sqrt());
        assert!((0..2).all(|k| (slanted.size_px[k] - size[k]).abs() < 1e-9), "{slanted:?}");
        assert!((slanted.angle_deg - 45.0).abs() < 1e-9 && (slanted.center_px[0] - 5.0).abs() < 1e-9, "{slanted:?}");
        assert_eq!(RotatedBox::around(&Mask::empty(4, 4)), RotatedBox::default());
    }

    proptest! {
        /// No rectangle of another angle is smaller, and all pixels are inside.
        #[test]
        fn the_box_is_the_least_of_all_angles(bits in prop::collection::vec(0_u8..4, 10 * 8)) {
            let mask = Mask::from_fn(10, 8, |x, y| bits[(y * 10 + x) as usize] == 0);
            let found = RotatedBox::around(&mask);
            let corners: Vec<[f64; 2]> = (mask.to_plane().data().iter().enumerate().filter(|(_, here)| **here))
                .flat_map(|(i, _)| [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[dx, dy]| [(i % 10 + dx) as f64, (i / 10 + dy) as f64]))
                .collect();
            prop_assume!(!corners.is_empty());
            let extent = |angle: f64| {
                let (sin, cos) = angle.to_radians().sin_cos();
                let along = |axis: [f64; 2]| {
                    let at = corners.iter().map(|p| p[0] * axis[0] + p[1] * axis[1]);
                    at.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
                };
                [along([cos, sin]), along([-sin, cos])].map(|[low, high]| high - low)
            };
            for step in 0..720 {
                let [width, height] = extent(f64::from(step) / 8.0);
                prop_assert!(width * height >= found.size_px[0] * found.size_px[1] - 1e-9);
            }
            let [width, height] = extent(found.angle_deg);
            prop_assert!((width - found.size_px[0]).abs() < 1e-9 && (height - found.size_px[1]).abs() < 1e-9);
            prop_assert!((-90.0..90.0).contains(&found.angle_deg) && found.size_px[0] >= found.size_px[1]);
        }
    }
}
