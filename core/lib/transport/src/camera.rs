//! Rays of a camera.

use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::Camera;
use syntable_model::stage::Window;
use syntable_simd::{Vec3, vec3};

/// A half-line. The direction need not have unit length; distances are in units of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin, meters.
    pub origin: [f32; 3],
    /// Direction.
    pub direction: [f32; 3],
}

/// A camera that generates rays. Without distortion, rays are affine in the pixel coordinates; they are computed in f64
/// and rounded once.
#[derive(Clone, Debug)]
pub struct RayCamera {
    origin: Vec3,
    /// Direction at (u, v) = (0, 0), and its change with u and with v; world.
    corner: Vector3<f64>,
    along_u: Vector3<f64>,
    along_v: Vector3<f64>,
    /// Rows of the rotation, camera from world.
    rows: [Vec3; 3],
    /// Angle that a pixel subtends at the center of the image, radians.
    pub pixel_angle: f32,
    warp: Option<Box<Warp>>,
    /// The lens, if it has an aperture.
    pub lens: Option<Lens>,
}

/// Distortion: the exact rays, and the rays through the pixels' corners, between which paths interpolate.
#[derive(Clone, Debug)]
struct Warp {
    camera: Camera,
    /// Directions in the camera's frame with z = 1 at the corners of all pixels, row by row, one more than pixels per
    /// row. NaN outside the lens's field of view.
    corners: Vec<[f32; 2]>,
    window: Window,
}

/// A lens of finite aperture.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// The aperture's radius along the image's rows, world, meters.
    pub right: Vec3,
    /// The aperture's radius along the image's columns, world, meters.
    pub down: Vec3,
    /// Depth of the plane of focus, meters.
    pub focus: f32,
}

impl RayCamera {
    /// Rays for the pixels of a window.
    pub fn new(camera: &Camera, window: Window) -> Self {
        let k = &camera.intrinsics;
        let pose = &camera.world_from_camera;
        let corner = k.unproject(0.0, 0.0);
        let rotation = pose.rotation.to_rotation_matrix();
        let eye = pose * Point3::origin();
        let row = |c: usize| vec3(rotation[(0, c)] as f32, rotation[(1, c)] as f32, rotation[(2, c)] as f32);
        let rows = [row(0), row(1), row(2)];
        Self {
            origin: vec3(eye.x as f32, eye.y as f32, eye.z as f32),
            corner: rotation * corner,
            along_u: rotation * Vector3::new(1.0 / k.fx, 0.0, 0.0),
            along_v: rotation * Vector3::new(0.0, 1.0 / k.fy, 0.0),
            rows,
            pixel_angle: (1.0 / (k.fx * k.fy).abs().sqrt()) as f32,
            warp: camera.distortion.map(|_| Box::new(Warp::new(camera, window))),
            lens: camera.lens.filter(|lens| lens.aperture_radius_m > 0.0).map(|lens| Lens {
                right: rows[0] * lens.aperture_radius_m as f32,
                down: rows[1] * lens.aperture_radius_m as f32,
                focus: lens.focus_distance_m.max(1e-3) as f32,
            }),
        }
    }

    /// The ray through (u, v), px from the top-left corner of the image, from the center of the lens. The direction
    /// advances one meter along the optical axis, so distances are depths. `None` where the distortion has no inverse.
    #[inline]
    pub fn ray(&self, u: f64, v: f64) -> Option<Ray> {
        let d = match &self.warp {
            None => self.corner + self.along_u * u + self.along_v * v,
            Some(warp) => warp.camera.world_from_camera.rotation * warp.camera.unproject(u, v)?,
        };
        Some(Ray { origin: self.origin.array(), direction: [d.x as f32, d.y as f32, d.z as f32] })
    }

    /// Origin of all rays of a pinhole.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Direction of [`Self::ray`] at a pixel's top-left corner, ignoring distortion.
    #[inline]
    pub fn corner(&self, x: i32, y: i32) -> Vec3 {
        let d = self.corner + self.along_u * f64::from(x) + self.along_v * f64::from(y);
        vec3(d.x as f32, d.y as f32, d.z as f32)
    }

    /// Derivatives of the direction of [`Self::ray`] by u and v, per pixel, ignoring distortion.
    pub fn slopes(&self) -> [Vec3; 2] {
        [self.along_u, self.along_v].map(|d| vec3(d.x as f32, d.y as f32, d.z as f32))
    }

    /// Whether rays are perturbed by distortion.
    pub fn is_warped(&self) -> bool {
        self.warp.is_some()
    }

    /// The distorted direction at a position within a pixel of the window, interpolated between the pixel's corners;
    /// `None` outside the lens's field of view.
    #[inline]
    pub fn warped(&self, x: i32, y: i32, [u, v]: [f32; 2]) -> Option<Vec3> {
        let warp = self.warp.as_ref()?;
        let columns = warp.columns();
        let at = (y - warp.window.y) as usize * columns + (x - warp.window.x) as usize;
        let mix = |i: usize| {
            let [a, b] = [at, at + columns].map(|at| {
                let [left, right] = [warp.corners[at][i], warp.corners[at + 1][i]];
                left + (right - left) * u
            });
            a + (b - a) * v
        };
        let (x, y) = (mix(0), mix(1));
        let [right, down, forward] = self.rows;
        (x.is_finite() && y.is_finite()).then(|| right * x + down * y + forward)
    }

    /// Directions in the camera's frame with z = 1 at the corners of the window's pixels, row by row, one more than
    /// pixels per row; NaN outside the lens's field of view. `None` without distortion.
    pub fn warped_corners(&self) -> Option<&[[f32; 2]]> {
        self.warp.as_ref().map(|warp| &warp.corners[..])
    }

    /// The direction at the center of a pixel, in the same form.
    pub fn warped_center(&self, x: i32, y: i32) -> [f32; 2] {
        let seen = self.warp.as_ref().and_then(|warp| warp.camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5));
        seen.map_or([f32::NAN; 2], |d| [d.x as f32, d.y as f32])
    }

    /// Rows of the rotation, camera from world.
    pub fn rows(&self) -> [Vec3; 3] {
        self.rows
    }

    /// Rotates a direction from the world to the camera's frame.
    pub fn rotate_to_camera(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.rows;
        vec3(x.dot(v), y.dot(v), z.dot(v))
    }
}

impl Warp {
    fn new(camera: &Camera, window: Window) -> Self {
        let corner = |x: i32, y: i32| match camera.unproject(f64::from(x), f64::from(y)) {
            Some(d) => [d.x as f32, d.y as f32],
            None => [f32::NAN; 2],
        };
        let rows = window.y..=window.bottom();
        let corners = rows.flat_map(|y| (window.x..=window.right()).map(move |x| (x, y)));
        Self { camera: *camera, corners: corners.map(|(x, y)| corner(x, y)).collect(), window }
    }

    fn columns(&self) -> usize {
        self.window.width as usize + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::look_at;
    use syntable_model::scene::{Distortion, Intrinsics};

    #[test]
    fn a_ray_through_a_projection_meets_the_point() {
        let intrinsics = Intrinsics { width: 640, height: 480, fx: 457.0, fy: 461.0, cx: 311.5, cy: 240.0 };
        let world_from_camera = look_at(Point3::new(1.0, -2.0, 1.5), Point3::new(0.1, 0.2, 0.7), Vector3::z());
        let straight = Camera::pinhole(intrinsics, world_from_camera);
        let perturbed =
            Camera { distortion: Some(Distortion::brown_conrady([-0.2, 0.05, 0.0], [1e-3, -2e-3])), ..straight };
        for (camera, p) in [straight, perturbed].into_iter().flat_map(|camera| {
            [[0.15, 0.05, 0.9], [-0.4, 0.3, 0.2], [0.5, 0.6, 1.0]].map(|p| (camera, Point3::from(p)))
        }) {
            let p_camera = world_from_camera.inverse_transform_point(&p);
            let [u, v] = camera.project(&p_camera);
            let rays = RayCamera::new(&camera, Window::of(&intrinsics));
            let ray = rays.ray(u, v).expect("within");
            let hit = Vec3::from(ray.origin) + Vec3::from(ray.direction) * p_camera.z as f32;
            assert!((hit - vec3(p.x as f32, p.y as f32, p.z as f32)).length() < 1e-6, "{hit:?}");
            // Interpolation between corners is accurate to a thousandth of a pixel.
            if let Some(warped) = rays.warped(u as i32, v as i32, [u.fract() as f32, v.fract() as f32]) {
                assert!((warped - Vec3::from(ray.direction)).length() < 1e-3 / 457.0, "{warped:?} {ray:?}");
            } else {
                assert!(camera.distortion.is_none());
            }
            let forward = world_from_camera * Vector3::z();
            let forward = rays.rotate_to_camera(vec3(forward.x as f32, forward.y as f32, forward.z as f32));
            assert!((forward - vec3(0.0, 0.0, 1.0)).length() < 1e-6);
        }
    }
}
