//! Outlines in the half-plane of a solid of revolution, with rounded corners and curves.

use super::SlotMapping;

/// A line of (radius, height) nodes, meters. Seen with the radius to the right it runs counter-clockwise around the
/// solid: outwards along the bottom, up, and back to the axis.
#[derive(Debug, Clone)]
pub struct Profile {
    nodes: Vec<ProfileNode>,
    closed: bool,
}

#[derive(Debug, Clone, Copy)]
struct ProfileNode {
    at: [f64; 2],
    /// Radius of the arc that replaces the corner.
    round: f64,
    /// Mapping of the segment that ends here.
    mapping: SlotMapping,
}

/// Degrees of arc per segment of a rounded corner.
const STEP_DEG: f64 = 22.5;

impl Profile {
    /// Starts at a node.
    pub fn at(r: f64, z: f64) -> Self {
        Self { nodes: vec![ProfileNode { at: [r, z], round: 0.0, mapping: SlotMapping::fit(0) }], closed: false }
    }

    /// A straight segment.
    pub fn to(mut self, r: f64, z: f64, mapping: SlotMapping) -> Self {
        self.nodes.push(ProfileNode { at: [r, z], round: 0.0, mapping });
        self
    }

    /// Rounds the corner at the last node.
    pub fn round(mut self, radius: f64) -> Self {
        if let Some(node) = self.nodes.last_mut() {
            node.round = radius;
        }
        self
    }

    /// A cubic Bézier curve from the last node.
    pub fn curve(mut self, c1: [f64; 2], c2: [f64; 2], end: [f64; 2], steps: usize, mapping: SlotMapping) -> Self {
        let start = self.nodes.last().map_or(end, |node| node.at);
        for i in 1..=steps {
            let t = i as f64 / steps as f64;
            let s = 1.0 - t;
            let at = std::array::from_fn(|k| {
                s * s * s * start[k] + 3.0 * s * s * t * c1[k] + 3.0 * s * t * t * c2[k] + t * t * t * end[k]
            });
            // The end exactly, so that it can lie on the axis.
            self.nodes.push(ProfileNode { at: if i == steps { end } else { at }, round: 0.0, mapping });
        }
        self
    }

    /// Closes the line to a loop that does not touch the axis.
    pub fn closed(mut self, mapping: SlotMapping) -> Self {
        self.closed = true;
        self.nodes[0].mapping = mapping;
        self
    }

    /// Whether the line is a loop.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// The points with corners rounded, each with the mapping of the segment that ends there. A loop ends before its
    /// first point.
    pub fn points(&self) -> Vec<([f64; 2], SlotMapping)> {
        let n = self.nodes.len();
        let mut points = Vec::new();
        for (i, node) in self.nodes.iter().enumerate() {
            let inner = self.closed || (i > 0 && i + 1 < n);
            if node.round <= 0.0 || !inner {
                points.push((node.at, node.mapping));
                continue;
            }
            let (before, after) = (self.nodes[(i + n - 1) % n].at, self.nodes[(i + 1) % n].at);
            for p in arc(before, node.at, after, node.round) {
                points.push((p, node.mapping));
            }
        }
        points
    }
}

/// The arc that rounds the corner at `b` between `a` and `c`.
pub(super) fn arc(a: [f64; 2], b: [f64; 2], c: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let (to_a, length_a) = direction(b, a);
    let (to_c, length_c) = direction(b, c);
    let half = libm::acos((to_a[0] * to_c[0] + to_a[1] * to_c[1]).clamp(-1.0, 1.0)) / 2.0;
    let turn = std::f64::consts::PI - 2.0 * half;
    if turn < 0.05 || half < 0.02 {
        return vec![b];
    }
    let tangent = (radius / libm::tan(half)).min(0.49 * length_a).min(0.49 * length_c);
    let radius = tangent * libm::tan(half);
    let steps = ((turn.to_degrees() / STEP_DEG).ceil() as usize).max(1);
    // The center is on the bisector.
    let bisector = [to_a[0] + to_c[0], to_a[1] + to_c[1]];
    let norm = libm::hypot(bisector[0], bisector[1]);
    let center: [f64; 2] = std::array::from_fn(|k| b[k] + bisector[k] / norm * radius / libm::sin(half));
    let start: [f64; 2] = std::array::from_fn(|k| b[k] + to_a[k] * tangent - center[k]);
    let sign = (to_a[0] * to_c[1] - to_a[1] * to_c[0]).signum();
    (0..=steps)
        .map(|i| {
            let (sin, cos) = libm::sincos(-sign * turn * i as f64 / steps as f64);
            [center[0] + cos * start[0] - sin * start[1], center[1] + sin * start[0] + cos * start[1]]
        })
        .collect()
}

fn direction(from: [f64; 2], to: [f64; 2]) -> ([f64; 2], f64) {
    let d = [to[0] - from[0], to[1] - from[1]];
    let length = libm::hypot(d[0], d[1]).max(1e-12);
    ([d[0] / length, d[1] / length], length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_corner_is_an_arc_that_touches_both_sides() {
        let mapping = SlotMapping::fit(0);
        let outline = Profile::at(0.0, 0.0).to(2.0, 0.0, mapping).round(0.5).to(2.0, 2.0, mapping);
        let points: Vec<[f64; 2]> = outline.points().into_iter().map(|(p, _)| p).collect();
        assert_eq!((points[0], *points.last().expect("points")), ([0.0, 0.0], [2.0, 2.0]));
        for p in &points[1..points.len() - 1] {
            let distance = (p[0] - 1.5).hypot(p[1] - 0.5);
            assert!((distance - 0.5).abs() < 1e-12, "{p:?} is {distance} from the arc's center");
        }
        assert!((points[1][0] - 1.5).abs() < 1e-12 && points[1][1].abs() < 1e-12);
    }
}
