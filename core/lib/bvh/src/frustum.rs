//! The pyramid around a bundle of rays from one point, to rule out boxes for all of them at once.

use super::{Ray, ray::PLACED_BAND};
use syntable_prepare::Bounds;

/// Four planes through a common origin; conservative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frustum {
    /// Points `p` inside have `normal · p ≤ offset` for all four.
    planes: [([f32; 3], f32); 4],
}

impl Frustum {
    /// `None` unless the rays share their origin and lie within about 60° of their mean direction.
    /// `reach` is the largest absolute coordinate of the boxes that are tested later.
    pub fn around(rays: &[Ray], reach: f32) -> Option<Self> {
        let origin = rays.first()?.origin;
        let mean = rays.iter().fold([0.0; 3], |sum, ray| {
            let unit = scale(ray.direction, 1.0 / dot(ray.direction, ray.direction).sqrt());
            [0, 1, 2].map(|a| sum[a] + unit[a])
        });
        let axis = scale(mean, 1.0 / dot(mean, mean).sqrt());
        // Any vector well away from the axis gives a basis.
        let size = axis.map(f32::abs);
        let aside = if size[0] < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let right = cross(axis, aside);
        let right = scale(right, 1.0 / dot(right, right).sqrt());
        let up = cross(axis, right);
        let (mut lo, mut hi) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for ray in rays {
            let d = ray.direction;
            let ahead = dot(d, axis);
            if ray.origin != origin || !(ahead * ahead > 0.25 * dot(d, d) && ahead > 0.0) {
                return None;
            }
            for (side, basis) in [right, up].into_iter().enumerate() {
                let slope = dot(d, basis) / ahead;
                lo[side] = lo[side].min(slope);
                hi[side] = hi[side].max(slope);
            }
        }
        // Slopes stay below 2, so normals below 3 and rounding below a few bands.
        let farthest = origin.iter().fold(reach, |m, x| m + x.abs());
        let slack = 8.0 * PLACED_BAND * farthest;
        let plane = |basis: [f32; 3], slope: f32, sign: f32| {
            let normal = [0, 1, 2].map(|a| sign * (basis[a] - slope * axis[a]));
            (normal, dot(normal, origin) + slack)
        };
        let planes =
            [plane(right, hi[0], 1.0), plane(right, lo[0], -1.0), plane(up, hi[1], 1.0), plane(up, lo[1], -1.0)];
        planes.iter().all(|(_, offset)| offset.is_finite()).then_some(Self { planes })
    }

    /// False only if no ray of the bundle meets the box.
    pub fn meets(&self, bounds: &Bounds) -> bool {
        !bounds.is_empty()
            && self.planes.iter().all(|(normal, offset)| {
                let lowest = |a: usize| if normal[a] > 0.0 { bounds.lo[a] } else { bounds.hi[a] };
                dot(*normal, [lowest(0), lowest(1), lowest(2)]) <= *offset
            })
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn scale(a: [f32; 3], s: f32) -> [f32; 3] {
    a.map(|x| x * s)
}
