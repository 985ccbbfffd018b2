//! Frames and units, stated once.
//!
//! - **World**: right-handed, z up, meters; the origin is on the floor under the table's center.
//! - **Body**: an asset's own frame, meters, z up.
//! - **Camera**: x right, y down, z forward (the convention of OpenCV and BOP).
//! - **Image**: the origin is the top-left *corner* of the top-left pixel, u to the right, v down; pixel centers
//!   lie at half-integers. Formats with integer centers subtract one half from the principal point.
//!
//! Poses are named `target_from_source`, so that names cancel in a product:
//! `camera_from_body = camera_from_world * world_from_body`.

use crate::error::ConfigError;

pub use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// A rigid motion, `target_from_source`, in f64.
pub type Pose = Isometry3<f64>;

/// An axis-aligned box, meters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Point3<f64>,
    /// Largest corner.
    pub max: Point3<f64>,
}

impl Aabb {
    /// The empty box: contains no point, and grows to each point or box that is added.
    pub fn empty() -> Self {
        Self { min: Point3::from([f64::INFINITY; 3]), max: Point3::from([f64::NEG_INFINITY; 3]) }
    }

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = Point3<f64>>) -> Self {
        points.into_iter().fold(Self::empty(), |aabb, p| aabb.with(p))
    }

    /// Grown to hold a point.
    pub fn with(self, p: Point3<f64>) -> Self {
        Self { min: self.min.inf(&p), max: self.max.sup(&p) }
    }

    /// Grown to hold another box.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Whether the box contains no point.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.min[i] > self.max[i])
    }

    /// Edge lengths, meters.
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    /// Center of the box.
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Length of the diagonal, meters.
    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }

    /// The eight corners.
    pub fn corners(&self) -> [Point3<f64>; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            Point3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// The free space between boxes around a point: the widest box that ends, along each axis, at the first box that the
/// axis-parallel line through the point meets. Infinite in a direction without a box; boxes that contain the point do
/// not count.
///
/// For the parts of a room and a point inside, it is the inside of the room.
pub fn space_around(point: &Point3<f64>, boxes: impl IntoIterator<Item = Aabb>) -> Aabb {
    let mut space = Aabb { min: Point3::from([f64::NEG_INFINITY; 3]), max: Point3::from([f64::INFINITY; 3]) };
    for aabb in boxes {
        for axis in 0..3 {
            let beside = (0..3).any(|k| k != axis && !(aabb.min[k] <= point[k] && point[k] <= aabb.max[k]));
            if !beside && aabb.min[axis] > point[axis] {
                space.max[axis] = space.max[axis].min(aabb.min[axis]);
            }
            if !beside && aabb.max[axis] < point[axis] {
                space.min[axis] = space.min[axis].max(aabb.max[axis]);
            }
        }
    }
    space
}

/// The rigid motion of a matrix of 4 × 4, row by row; its upper left part is a rotation.
pub fn pose_of_matrix(m: &[[f64; 4]; 4]) -> Pose {
    let column = |axis: usize| Vector3::new(m[0][axis], m[1][axis], m[2][axis]);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[column(0), column(1), column(2)]));
    Pose::from_parts(column(3).into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// The rigid motion of a matrix of 4 × 4 in an option, row by row. Rounded digits of a rotation are accepted.
///
/// # Errors
/// If the matrix scales, mirrors or shears, or its last row is not [0, 0, 0, 1]. `key` is the option's path.
pub fn rigid(rows: [[f64; 4]; 4], key: &str) -> Result<Pose, ConfigError> {
    let name = key.rsplit('.').next().unwrap_or(key);
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        let message = format!("the last row of `{name}` is {:?}", rows[3]);
        return Err(
            ConfigError::new(format!("{key}[3]"), message).help("write the matrix row by row, ending in [0, 0, 0, 1]")
        );
    }
    let rotation = Matrix3::from_fn(|r, c| rows[r][c]);
    let error = (rotation * rotation.transpose() - Matrix3::identity()).abs().max();
    let determinant = rotation.determinant();
    if error > 1e-4 || determinant < 0.0 {
        let message = format!(
            "`{name}` is not a rigid transform: R Rᵀ differs from the identity by {error:.1e}, and the \
             determinant is {determinant:.3}"
        );
        return Err(ConfigError::new(key, message)
            .help("its upper left 3 × 3 block must be a rotation, without scale or mirroring"));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
        &rotation,
        1e-12,
        100,
        Rotation3::from_matrix_unchecked(rotation),
    ));
    Ok(Pose::from_parts(Translation3::new(rows[0][3], rows[1][3], rows[2][3]), rotation))
}

/// A camera's `world_from_camera` at `eye`, looking at `target`, with `up` towards the top of the image.
///
/// When the direction is parallel to `up`, the image's top points along world y.
pub fn look_at(eye: Point3<f64>, target: Point3<f64>, up: Vector3<f64>) -> Pose {
    let forward = (target - eye).try_normalize(1e-12).unwrap_or_else(|| -Vector3::z());
    let right = forward
        .cross(&up)
        .try_normalize(1e-9)
        .or_else(|| forward.cross(&Vector3::y()).try_normalize(1e-9))
        .unwrap_or_else(Vector3::x);
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    Pose::from_parts(Translation3::from(eye.coords), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_looks_along_its_z_axis_with_y_down() {
        let pose = look_at(Point3::new(2.0, 0.0, 1.0), Point3::new(0.0, 0.0, 1.0), Vector3::z());
        assert!((pose * Vector3::z() - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!((pose * Vector3::y() - Vector3::new(0.0, 0.0, -1.0)).norm() < 1e-12);
        assert!((pose * Vector3::x() - Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn looking_straight_down_is_a_rotation() {
        let pose = look_at(Point3::new(0.0, 0.0, 2.0), Point3::origin(), Vector3::z());
        assert!((pose * Vector3::z() + Vector3::z()).norm() < 1e-12);
        assert!((pose.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn boxes_join() {
        let a = Aabb::of([Point3::new(0.0, 1.0, 2.0), Point3::new(1.0, 0.0, 3.0)]);
        assert_eq!(a.size(), Vector3::new(1.0, 1.0, 1.0));
        assert_eq!(a.union(Aabb::empty()), a);
        assert!(Aabb::empty().is_empty() && !a.is_empty());
        assert!(a.corners().contains(&Point3::new(1.0, 0.0, 3.0)));
    }

    #[test]
    fn the_space_in_a_room_is_its_inside() {
        let slab = |min: [f64; 3], max: [f64; 3]| Aabb { min: min.into(), max: max.into() };
        let parts = [
            slab([-3.1, -2.1, -0.1], [3.1, 2.1, 0.0]),
            slab([3.0, -2.0, 0.0], [3.1, 2.0, 2.5]),
            slab([-3.1, -2.0, 0.0], [-3.0, 2.0, 2.5]),
            slab([-3.0, 2.0, 0.0], [3.0, 2.1, 2.5]),
            // A second wall behind, a pillar aside, and a box around the point do not count.
            slab([4.0, -2.0, 0.0], [4.1, 2.0, 2.5]),
            slab([1.0, 1.0, 0.0], [1.2, 1.2, 2.5]),
            slab([-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]),
        ];
        let space = space_around(&Point3::new(0.2, 0.1, 0.7), parts);
        assert_eq!(space.min, Point3::new(-3.0, f64::NEG_INFINITY, 0.0));
        assert_eq!(space.max, Point3::new(3.0, 2.0, f64::INFINITY));
    }
}
