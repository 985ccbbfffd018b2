//! Shapes of the engine that make parry's broad phase cheap: the engine computes the bounding boxes of both shapes of
//! each pair at each step.

use parry3d::bounding_volume::{Aabb, BoundingSphere};
use parry3d::mass_properties::MassProperties;
use parry3d::math::{Pose, Vector};
use parry3d::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d::shape::{
    ConvexPolyhedron, FeatureId, HalfSpace, PolygonalFeatureMap, Shape, ShapeType, SupportMap, TypedShape,
};

/// Vertices that are transformed together.
const LANES: usize = 8;

/// A convex polyhedron that computes its bounding box for several vertices at once. The box is parry's, bit for bit.
#[derive(Debug, Clone)]
pub struct Polyhedron {
    of_parry: ConvexPolyhedron,
    /// The vertices by coordinate. The last vertex fills the last group.
    vertices: Vec<[[f32; LANES]; 3]>,
}

impl Polyhedron {
    /// The shape of a polyhedron.
    pub fn new(of_parry: ConvexPolyhedron) -> Self {
        let group = |points: &[Vector]| {
            let at = |lane: usize| points[lane.min(points.len() - 1)].to_array();
            std::array::from_fn(|axis| std::array::from_fn(|lane| at(lane)[axis]))
        };
        Self { vertices: of_parry.points().chunks(LANES).map(group).collect(), of_parry }
    }

    /// The polyhedron.
    pub fn of_parry(&self) -> &ConvexPolyhedron {
        &self.of_parry
    }

    /// The polyhedron of a shape, if it is one.
    pub fn of(shape: &dyn Shape) -> Option<&ConvexPolyhedron> {
        shape.as_shape::<Self>().map(Self::of_parry).or_else(|| shape.as_convex_polyhedron())
    }
}

/// A half-space whose bounding box ends near its surface if the surface is perpendicular to an axis. The box of
/// parry's half-space is infinite, so each body of a room would be tested against all of its walls.
#[derive(Debug, Clone, Copy)]
pub struct Wall {
    of_parry: HalfSpace,
    margin: f32,
}

/// A normal is along an axis if its other components are at most this.
const ALONG: f32 = 1e-9;

impl Wall {
    /// The shape of a half-space. Its bounding box contains all points up to `margin` above the surface: bodies whose
    /// boxes keep away from it are farther away than any contact is predicted.
    pub fn new(of_parry: HalfSpace, margin: f32) -> Self {
        Self { of_parry, margin }
    }

    /// The half-space of a shape, if it is one.
    pub fn of(shape: &dyn Shape) -> Option<&HalfSpace> {
        shape.as_shape::<Self>().map(|wall| &wall.of_parry).or_else(|| shape.as_halfspace())
    }
}

impl Shape for Polyhedron {
    fn compute_local_aabb(&self) -> Aabb {
        self.of_parry.local_aabb()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.of_parry.local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, _: u32) -> Option<Box<dyn Shape>> {
        Some(Box::new(Self::new(self.of_parry.clone().scaled(scale)?)))
    }

    fn compute_aabb(&self, position: &Pose) -> Aabb {
        // The product of a unit quaternion and a vector, in the order of operations of parry's vectors.
        let [bx, by, bz, w] = position.rotation.to_array();
        let (along, twice) = (w * w - (bx * bx + by * by + bz * bz), w * 2.0);
        let [tx, ty, tz] = position.translation.to_array();
        let (mut lowest, mut highest) = ([[f32::INFINITY; LANES]; 3], [[f32::NEG_INFINITY; LANES]; 3]);
        for [xs, ys, zs] in &self.vertices {
            for lane in 0..LANES {
                let (x, y, z) = (xs[lane], ys[lane], zs[lane]);
                let dot = (x * bx + y * by + z * bz) * 2.0;
                let world = [
                    x * along + bx * dot + (by * z - y * bz) * twice + tx,
                    y * along + by * dot + (bz * x - z * bx) * twice + ty,
                    z * along + bz * dot + (bx * y - x * by) * twice + tz,
                ];
                for axis in 0..3 {
                    let (low, high) = (&mut lowest[axis][lane], &mut highest[axis][lane]);
                    *low = if world[axis] < *low { world[axis] } else { *low };
                    *high = if world[axis] > *high { world[axis] } else { *high };
                }
            }
        }
        let lowest = lowest.map(|lanes| lanes.into_iter().fold(f32::INFINITY, f32::min));
        let highest = highest.map(|lanes| lanes.into_iter().fold(f32::NEG_INFINITY, f32::max));
        Aabb::new(lowest.into(), highest.into())
    }

    fn mass_properties(&self, density: f32) -> MassProperties {
        self.of_parry.mass_properties(density)
    }

    fn shape_type(&self) -> ShapeType {
        self.of_parry.shape_type()
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        self.of_parry.as_typed_shape()
    }

    fn ccd_thickness(&self) -> f32 {
        self.of_parry.ccd_thickness()
    }

    fn ccd_angular_thickness(&self) -> f32 {
        self.of_parry.ccd_angular_thickness()
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn as_support_map(&self) -> Option<&dyn SupportMap> {
        Some(&self.of_parry)
    }

    fn as_polygonal_feature_map(&self) -> Option<(&dyn PolygonalFeatureMap, f32)> {
        self.of_parry.as_polygonal_feature_map()
    }

    fn feature_normal_at_point(&self, subshape: u32, feature: FeatureId, point: Vector) -> Option<Vector> {
        self.of_parry.feature_normal_at_point(subshape, feature, point)
    }
}

impl Shape for Wall {
    fn compute_local_aabb(&self) -> Aabb {
        self.compute_aabb(&Pose::IDENTITY)
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.of_parry.local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(*self)
    }

    fn scale_dyn(&self, scale: Vector, _: u32) -> Option<Box<dyn Shape>> {
        Some(Box::new(Self { of_parry: self.of_parry.scaled(scale)?, ..*self }))
    }

    fn compute_aabb(&self, position: &Pose) -> Aabb {
        let Aabb { mins, maxs } = self.of_parry.local_aabb();
        let (mut mins, mut maxs) = (mins.to_array(), maxs.to_array());
        let (normal, surface) =
            ((position.rotation * self.of_parry.normal).to_array(), position.translation.to_array());
        for axis in 0..3 {
            if (0..3).all(|other| other == axis || normal[other].abs() <= ALONG) {
                match normal[axis] > 0.0 {
                    true => maxs[axis] = surface[axis] + self.margin,
                    false => mins[axis] = surface[axis] - self.margin,
                }
            }
        }
        Aabb::new(mins.into(), maxs.into())
    }

    fn mass_properties(&self, density: f32) -> MassProperties {
        Shape::mass_properties(&self.of_parry, density)
    }

    fn shape_type(&self) -> ShapeType {
        self.of_parry.shape_type()
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        self.of_parry.as_typed_shape()
    }

    fn ccd_thickness(&self) -> f32 {
        self.of_parry.ccd_thickness()
    }

    fn ccd_angular_thickness(&self) -> f32 {
        self.of_parry.ccd_angular_thickness()
    }

    fn is_convex(&self) -> bool {
        true
    }
}

/// Queries of rays and points, by parry's shape.
macro_rules! queries {
    ($($shape:ty),*) => {$(
        impl RayCast for $shape {
            fn cast_local_ray_and_get_normal(&self, ray: &Ray, most: f32, solid: bool) -> Option<RayIntersection> {
                self.of_parry.cast_local_ray_and_get_normal(ray, most, solid)
            }
        }

        impl PointQuery for $shape {
            fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
                self.of_parry.project_local_point(point, solid)
            }

            fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
                self.of_parry.project_local_point_and_get_feature(point)
            }
        }
    )*};
}
queries!(Polyhedron, Wall);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ConvexHull, HullOptions};
    use parry3d::math::Rotation;
    use syntable_model::random::Stream;

    #[test]
    fn boxes_of_polyhedra_are_parrys() {
        let mut stream = Stream::root(5);
        for count in [4, 5, 8, 9, 30, 64] {
            let points: Vec<[f32; 3]> =
                (0..count).map(|_| std::array::from_fn(|_| stream.uniform(-1.0, 1.0) as f32)).collect();
            let hull = ConvexHull::new(&points, &HullOptions::METERS).expect("a hull");
            let of_parry = hull.polyhedron(8.0).expect("a polyhedron");
            let shape = Polyhedron::new(of_parry.clone());
            for _ in 0..100 {
                let rotation = stream.rotation().coords.map(|x| x as f32);
                let rotation = Rotation::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w).normalize();
                let place: [f32; 3] = std::array::from_fn(|_| stream.uniform(-30.0, 30.0) as f32);
                let pose = Pose::from_parts(place.into(), rotation);
                assert_eq!(shape.compute_aabb(&pose), of_parry.aabb(&pose));
            }
        }
    }

    #[test]
    fn boxes_of_walls_end_above_their_surface() {
        let at = |x: f32, y: f32, z: f32| Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY);
        let bounds = |normal: Vector| Wall::new(HalfSpace::new(normal), 0.5).compute_aabb(&at(1.0, 2.0, 3.0));
        let floor = bounds(Vector::Z);
        assert_eq!((floor.maxs.z, floor.mins.z), (3.5, -f32::MAX / 2.0));
        assert_eq!((floor.mins.x, floor.maxs.y), (-f32::MAX / 2.0, f32::MAX / 2.0));
        assert_eq!(bounds(-Vector::X).mins.x, 0.5);
        assert_eq!(bounds(Vector::Y).maxs.y, 2.5);
        let oblique = bounds(Vector::new(0.0, 0.001, 1.0).normalize());
        assert_eq!(oblique, HalfSpace::new(Vector::Z).local_aabb());
    }
}
