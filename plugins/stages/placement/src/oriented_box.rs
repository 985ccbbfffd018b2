//! Oriented bounding boxes and their overlap test.

use syntable_model::geometry::{Aabb, Point3, Pose, Vector3};

/// An oriented box in the world frame.
#[derive(Debug, Clone)]
pub struct OrientedBox {
    center: Point3<f64>,
    /// Half edges as vectors.
    axes: [Vector3<f64>; 3],
}

impl OrientedBox {
    /// A body's bounding box at a pose, grown by `margin` meters on all sides.
    pub fn new(bounds: &Aabb, world_from_body: &Pose, margin: f64) -> Self {
        let half = bounds.size() / 2.0 + Vector3::repeat(margin);
        let axes = std::array::from_fn(|i| {
            let mut axis = Vector3::zeros();
            axis[i] = half[i];
            world_from_body.rotation * axis
        });
        Self { center: world_from_body * bounds.center(), axes }
    }

    /// Height of the highest point above the center, meters.
    pub fn half_height(&self) -> f64 {
        self.axes.iter().map(|axis| axis.z.abs()).sum()
    }

    /// Height of the highest point, meters.
    pub fn top(&self) -> f64 {
        self.center.z + self.half_height()
    }

    /// Whether two boxes overlap or touch (separating axis theorem; Gottschalk, Lin and Manocha 1996).
    pub fn overlaps(&self, other: &Self) -> bool {
        let between = other.center - self.center;
        let separates = |axis: Vector3<f64>| {
            let extent = |box_: &Self| box_.axes.iter().map(|half| half.dot(&axis).abs()).sum::<f64>();
            between.dot(&axis).abs() > extent(self) + extent(other)
        };
        let faces = self.axes.iter().chain(&other.axes).copied();
        let edges = self.axes.iter().flat_map(|a| other.axes.iter().map(move |b| a.cross(b)));
        // Parallel edges have no cross product; the face normals decide then.
        let edges = edges.filter(|axis| axis.norm_squared() > 1e-18);
        !faces.chain(edges).any(separates)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    /// Whether any point of a fine grid over one box is inside the other.
    fn share_a_grid_point(a: &OrientedBox, b: &OrientedBox) -> bool {
        let n = 20;
        let at = |i: i32| f64::from(2 * i) / f64::from(n) - 1.0;
        (0..=n).any(|i| {
            (0..=n).any(|j| {
                (0..=n).any(|k| {
                    let p = a.center + a.axes[0] * at(i) + a.axes[1] * at(j) + a.axes[2] * at(k);
                    b.axes.iter().all(|axis| (p - b.center).dot(axis).abs() <= axis.norm_squared())
                })
            })
        })
    }

    #[test]
    fn overlap_agrees_with_a_grid_of_points() {
        let mut stream = Stream::root(4);
        let mut seen = [0; 2];
        for _ in 0..400 {
            let mut draw = || {
                let half = Vector3::from_fn(|_, _| stream.uniform(0.1, 1.0));
                let bounds = Aabb { min: Point3::from(-half), max: Point3::from(half) };
                let center = Vector3::from_fn(|_, _| stream.uniform(-1.2, 1.2));
                let pose = Pose::from_parts(center.into(), stream.rotation());
                [-0.05, 0.0].map(|margin| OrientedBox::new(&bounds, &pose, margin))
            };
            let ([small, a], [_, b]) = (draw(), draw());
            let overlap = a.overlaps(&b);
            // A shared grid point is an overlap, and a clear overlap contains one.
            assert!(overlap || !(share_a_grid_point(&a, &b) || share_a_grid_point(&b, &a)));
            assert!(!small.overlaps(&b) || share_a_grid_point(&a, &b) || share_a_grid_point(&b, &a));
            seen[usize::from(overlap)] += 1;
        }
        assert!(seen[0] > 100 && seen[1] > 100, "{seen:?}");
    }
}
