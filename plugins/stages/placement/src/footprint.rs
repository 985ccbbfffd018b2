//! Outlines of bodies seen from above.

use syntable_convex::convex_outline;
use syntable_model::geometry::Point3;
use syntable_model::scene::Region;

/// Bodies whose heights overlap by less are on each other, meters: hulls are rounded.
const TOUCH_M: f64 = 0.0005;

/// A convex outline in the plane, and the heights between which the body is, meters.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// Corners, world x and y, counterclockwise.
    pub outline: Vec<[f64; 2]>,
    /// Height of its lowest point.
    pub low: f64,
    /// Height of its highest point.
    pub high: f64,
}

impl Footprint {
    /// The footprint of points in the world.
    pub fn of(points: impl Iterator<Item = Point3<f64>>) -> Self {
        let (mut low, mut high, mut flat) = (f64::INFINITY, f64::NEG_INFINITY, Vec::new());
        for p in points {
            (low, high) = (low.min(p.z), high.max(p.z));
            flat.push([p.x, p.y]);
        }
        Self { outline: convex_outline(flat), low, high }
    }

    /// The footprint moved by meters.
    pub fn moved(&self, [x, y, z]: [f64; 3]) -> Self {
        let outline = self.outline.iter().map(|p| [p[0] + x, p[1] + y]).collect();
        Self { outline, low: self.low + z, high: self.high + z }
    }

    /// The footprint made smaller around its center: by some meters on each side at its widest, and by at most half.
    pub fn inset(&self, meters: f64) -> Self {
        let count = self.outline.len().max(1) as f64;
        let center = [0, 1].map(|axis| self.outline.iter().map(|p| p[axis]).sum::<f64>() / count);
        let reach = |p: &[f64; 2]| libm::hypot(p[0] - center[0], p[1] - center[1]);
        let farthest = self.outline.iter().map(reach).fold(0.0, f64::max);
        let factor = if farthest > 0.0 { (1.0 - 1.5 * meters / farthest).max(0.5) } else { 1.0 };
        let outline = self.outline.iter().map(|p| [0, 1].map(|axis| center[axis] + factor * (p[axis] - center[axis])));
        Self { outline: outline.collect(), ..*self }
    }

    /// Smallest and largest distance from the center of a region along each of its edges, meters.
    pub fn extent(&self, region: &Region) -> [[f64; 2]; 2] {
        let along = self.outline.iter().map(|p| region.along(&Point3::new(p[0], p[1], region.height())));
        along.fold([[f64::INFINITY, f64::NEG_INFINITY]; 2], |extent, p| {
            [0, 1].map(|edge| [extent[edge][0].min(p[edge]), extent[edge][1].max(p[edge])])
        })
    }

    /// Whether the footprint is within a region.
    pub fn is_within(&self, region: &Region) -> bool {
        let extent = self.extent(region);
        (0..2).all(|edge| extent[edge].iter().all(|x| x.abs() <= region.edges()[edge] / 2.0 + 1e-9))
    }

    /// Whether a point is inside the outline and at least `margin` meters from its edges.
    pub fn contains(&self, p: [f64; 2], margin: f64) -> bool {
        let inside = |a: &[f64; 2], b: &[f64; 2]| {
            let edge = [b[0] - a[0], b[1] - a[1]];
            let cross = edge[0] * (p[1] - a[1]) - edge[1] * (p[0] - a[0]);
            cross >= margin * libm::hypot(edge[0], edge[1])
        };
        self.outline.len() > 2 && self.edges().all(|(a, b)| inside(a, b))
    }

    /// Whether the bodies are nearer than `gap` meters, seen from above, and their heights overlap. At corners, the gap can be
    /// larger (separating axis theorem in the plane).
    pub fn is_near(&self, other: &Self, gap: f64) -> bool {
        if self.low + TOUCH_M >= other.high || other.low + TOUCH_M >= self.high {
            return false;
        }
        let separates = |(a, b): (&[f64; 2], &[f64; 2])| {
            let normal = [b[1] - a[1], a[0] - b[0]];
            let length = libm::hypot(normal[0], normal[1]);
            let dot = |p: &[f64; 2]| (p[0] * normal[0] + p[1] * normal[1]) / length;
            let range = |outline: &[[f64; 2]]| {
                let dots = outline.iter().map(dot);
                dots.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
            };
            let (own, others) = (range(&self.outline), range(&other.outline));
            length > 0.0 && (own.1 + gap <= others.0 || others.1 + gap <= own.0)
        };
        !self.edges().chain(other.edges()).any(separates)
    }

    /// The part of a triangle that is above or below the outline: its corners, in order. Fewer than three if no part is
    /// (Sutherland and Hodgman, Communications of the ACM 17, 1974).
    pub fn clip(&self, triangle: [Point3<f64>; 3]) -> Vec<Point3<f64>> {
        let mut polygon = triangle.to_vec();
        for (a, b) in self.edges() {
            let side = |p: &Point3<f64>| (b[0] - a[0]) * (p.y - a[1]) - (b[1] - a[1]) * (p.x - a[0]);
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, p) in polygon.iter().enumerate() {
                let next = &polygon[(i + 1) % polygon.len()];
                let (here, there) = (side(p), side(next));
                if here >= 0.0 {
                    kept.push(*p);
                }
                if (here >= 0.0) != (there >= 0.0) {
                    kept.push(p + (next - p) * (here / (here - there)));
                }
            }
            polygon = kept;
            if polygon.is_empty() {
                break;
            }
        }
        polygon
    }

    fn edges(&self) -> impl Iterator<Item = (&[f64; 2], &[f64; 2])> {
        self.outline.iter().zip(self.outline.iter().cycle().skip(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_convex::outline_area;
    use syntable_model::random::Stream;

    fn polygon(stream: &mut Stream, center: [f64; 2]) -> Footprint {
        let points: Vec<Point3<f64>> = (0..7)
            .map(|_| Point3::new(center[0] + stream.uniform(-1.0, 1.0), center[1] + stream.uniform(-1.0, 1.0), 0.0))
            .collect();
        Footprint { high: 1.0, ..Footprint::of(points.into_iter()) }
    }

    #[test]
    fn outlines_that_share_a_grid_point_are_near_and_apart_ones_are_not() {
        let mut stream = Stream::root(8);
        let mut counts = [0; 2];
        for _ in 0..300 {
            let a = polygon(&mut stream, [0.0, 0.0]);
            let center = [stream.uniform(-2.0, 2.0), stream.uniform(-2.0, 2.0)];
            let b = polygon(&mut stream, center);
            let grid = || (0..100).flat_map(|i| (0..100).map(move |k| [i, k].map(|x| f64::from(x) * 0.04 - 2.0)));
            let shared = grid().filter(|p| a.contains(*p, 0.0) && b.contains(*p, 0.0)).count();
            assert!(a.is_near(&b, 0.0) || shared == 0);
            assert!(!a.is_near(&b, 0.0) || shared > 0 || !a.is_near(&b, -0.1), "an overlap of 0.1 has a grid point");
            counts[usize::from(shared > 0)] += 1;
        }
        assert!(counts.iter().all(|count| *count > 50), "{counts:?}");
        let a = polygon(&mut stream, [0.0, 0.0]);
        let above = a.moved([0.0, 0.0, 1.0]);
        assert!(!a.is_near(&above, 0.1) && a.is_near(&a.moved([0.0, 0.0, 0.9]), 0.0));
    }

    #[test]
    fn a_clipped_triangle_has_the_area_of_the_grid_points_in_both() {
        let mut stream = Stream::root(9);
        for _ in 0..50 {
            let outline = polygon(&mut stream, [0.0, 0.0]);
            let corner = |stream: &mut Stream| {
                let [x, y] = [stream.uniform(-1.0, 1.0), stream.uniform(-1.0, 1.0)];
                Point3::new(x, y, 2.0 * x - y)
            };
            let triangle = [corner(&mut stream), corner(&mut stream), corner(&mut stream)];
            let clipped = outline.clip(triangle);
            let flat: Vec<[f64; 2]> = clipped.iter().map(|p| [p.x, p.y]).collect();
            let as_footprint = Footprint::of(triangle.into_iter());
            let inside = (0..200)
                .flat_map(|i| (0..200).map(move |k| [i, k].map(|x| f64::from(x) * 0.01 - 0.995)))
                .filter(|p| outline.contains(*p, 0.0) && as_footprint.contains(*p, 0.0))
                .count();
            assert!((outline_area(&flat).abs() - inside as f64 * 1e-4).abs() < 0.02);
            assert!(clipped.iter().all(|p| (p.z - (2.0 * p.x - p.y)).abs() < 1e-9), "corners stay in the plane");
        }
    }
}
