//! Rays of a pinhole camera.

use crate::bvh::Ray;
use crate::vec3::{Vec3, vec3};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::Camera;

/// A camera whose rays are affine in the pixel coordinates; computed in f64 and rounded once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayCamera {
    origin: Vec3,
    /// Direction at (u, v) = (0, 0), and its change with u and with v; world.
    corner: Vector3<f64>,
    along_u: Vector3<f64>,
    along_v: Vector3<f64>,
    /// Rows of the rotation, camera from world.
    rows: [Vec3; 3],
    /// Angle that a pixel subtends in the middle of the picture, radians.
    pub pixel_angle: f32,
}

impl RayCamera {
    pub fn new(camera: &Camera) -> Self {
        let k = &camera.intrinsics;
        let pose = &camera.world_from_camera;
        let corner = k.unproject(0.0, 0.0);
        let rotation = pose.rotation.to_rotation_matrix();
        let eye = pose * Point3::origin();
        let row = |c: usize| vec3(rotation[(0, c)] as f32, rotation[(1, c)] as f32, rotation[(2, c)] as f32);
        Self {
            origin: vec3(eye.x as f32, eye.y as f32, eye.z as f32),
            corner: rotation * corner,
            along_u: rotation * Vector3::new(1.0 / k.fx, 0.0, 0.0),
            along_v: rotation * Vector3::new(0.0, 1.0 / k.fy, 0.0),
            rows: [row(0), row(1), row(2)],
            pixel_angle: (1.0 / (k.fx * k.fy).abs().sqrt()) as f32,
        }
    }

    /// The ray through (u, v), px from the top-left corner of the picture. The direction advances one metre along the
    /// optical axis, so that distances are depths.
    #[inline]
    pub fn ray(&self, u: f64, v: f64) -> Ray {
        let d = self.corner + self.along_u * u + self.along_v * v;
        Ray { origin: self.origin.array(), direction: [d.x as f32, d.y as f32, d.z as f32] }
    }

    /// How the direction of [`Self::ray`] changes with u and with v, a pixel.
    pub fn slopes(&self) -> [Vec3; 2] {
        [self.along_u, self.along_v].map(|d| vec3(d.x as f32, d.y as f32, d.z as f32))
    }

    /// A direction of the world in the camera's frame.
    pub fn turned(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.rows;
        vec3(x.dot(v), y.dot(v), z.dot(v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::look_at;
    use syntable_model::scene::Intrinsics;

    #[test]
    fn a_ray_through_a_projection_meets_the_point() {
        let intrinsics = Intrinsics { width: 640, height: 480, fx: 457.0, fy: 461.0, cx: 311.5, cy: 240.0 };
        let world_from_camera = look_at(Point3::new(1.0, -2.0, 1.5), Point3::new(0.1, 0.2, 0.7), Vector3::z());
        let camera = Camera::pinhole(intrinsics, world_from_camera);
        let p = Point3::new(0.15, 0.05, 0.9);
        let p_camera = world_from_camera.inverse_transform_point(&p);
        let [u, v] = intrinsics.project(&p_camera);
        let rays = RayCamera::new(&camera);
        let ray = rays.ray(u, v);
        let met = Vec3::from(ray.origin) + Vec3::from(ray.direction) * p_camera.z as f32;
        assert!((met - vec3(p.x as f32, p.y as f32, p.z as f32)).length() < 1e-6, "{met:?}");
        let forward = world_from_camera * Vector3::z();
        let forward = rays.turned(vec3(forward.x as f32, forward.y as f32, forward.z as f32));
        assert!((forward - vec3(0.0, 0.0, 1.0)).length() < 1e-6);
    }
}
