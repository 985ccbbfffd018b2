//! Cameras.

use crate::geometry::{Point3, Pose, Vector3};
use serde::Serialize;

/// Pinhole intrinsics, pixels. The origin is the top-left corner of the image; pixel centers lie at half-integers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Intrinsics {
    /// Image width, px.
    pub width: u32,
    /// Image height, px.
    pub height: u32,
    /// Focal length along u, px.
    pub fx: f64,
    /// Focal length along v, px.
    pub fy: f64,
    /// Principal point, u, px from the left edge; `width / 2` is the center.
    pub cx: f64,
    /// Principal point, v, px from the top edge.
    pub cy: f64,
}

impl Intrinsics {
    /// Maximum width and height of an image, px.
    pub const MAX_EDGE: u32 = 16_384;

    /// Projects a point of the camera frame to (u, v), px. The point must be in front: z > 0.
    #[inline]
    pub fn project(&self, p_camera: &Point3<f64>) -> [f64; 2] {
        [self.fx * p_camera.x / p_camera.z + self.cx, self.fy * p_camera.y / p_camera.z + self.cy]
    }

    /// The direction of (u, v) in the camera frame with z = 1, so that depth is the ray parameter.
    #[inline]
    pub fn unproject(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }

    /// Whether (u, v) is in the image.
    #[inline]
    pub fn contains(&self, [u, v]: [f64; 2]) -> bool {
        (0.0..f64::from(self.width)).contains(&u) && (0.0..f64::from(self.height)).contains(&v)
    }

    /// The same image with `times` as many pixels along either edge. Each pixel becomes `times` × `times` pixels.
    pub fn subdivided(&self, times: u32) -> Self {
        let factor = f64::from(times);
        Self {
            width: self.width * times,
            height: self.height * times,
            fx: self.fx * factor,
            fy: self.fy * factor,
            cx: self.cx * factor,
            cy: self.cy * factor,
        }
    }

    /// The matrix K, row by row.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]]
    }
}

/// How a lens maps a direction to the image, as a map from the plane z = 1 to itself. OpenCV's models, with its names and
/// order of coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// A lens near a pinhole: Brown and Conrady, with OpenCV's rational and thin-prism terms.
    Polynomial(Polynomial),
    /// A wide lens: Kannala and Brandt, OpenCV's `fisheye`.
    Fisheye(Fisheye),
}

/// Lens distortion after Brown and Conrady.
///
/// A point at `(x, y) = (X/Z, Y/Z)` with `r² = x² + y²` is seen where an undistorted camera would see
/// `x' = x q + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴` and
/// `y' = y q + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴`, where
/// `q = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Polynomial {
    /// Radial coefficients `k1`, `k2`, `k3`.
    pub radial: [f64; 3],
    /// Tangential coefficients `p1`, `p2`.
    pub tangential: [f64; 2],
    /// Radial coefficients of the denominator, `k4`, `k5`, `k6`.
    pub denominator: [f64; 3],
    /// Thin-prism coefficients `s1` to `s4`.
    pub thin_prism: [f64; 4],
}

/// A fisheye lens after Kannala and Brandt.
///
/// A point at the angle `θ = atan r` from the optical axis is seen at the distance
/// `θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` from the center of the plane z = 1, in its own direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fisheye {
    /// Coefficients `k1` to `k4`.
    pub coefficients: [f64; 4],
}

/// Least derivative of a lens: below, two directions are seen at nearly the same place.
const LEAST_SLOPE: f64 = 1e-3;

impl Distortion {
    /// The five coefficients of Brown and Conrady: `[k1, k2, k3]` and `[p1, p2]`.
    pub const fn brown_conrady(radial: [f64; 3], tangential: [f64; 2]) -> Self {
        Self::Polynomial(Polynomial { radial, tangential, denominator: [0.0; 3], thin_prism: [0.0; 4] })
    }

    /// Where an undistorted point of the plane z = 1 is seen.
    pub fn distort(&self, point: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Polynomial(lens) => lens.distort(point),
            Self::Fisheye(lens) => lens.distort(point),
        }
    }

    /// The point that is seen at `(x', y')`. None where the lens folds the image over, and for directions farther than
    /// [`Fisheye::MAX_ANGLE`] from the axis of a fisheye.
    pub fn undistort(&self, seen: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            Self::Polynomial(lens) => lens.undistort(seen),
            Self::Fisheye(lens) => lens.undistort(seen),
        }
    }
}

/// `c1 t + c2 t² + c3 t³`, and its derivative.
fn cubic([c1, c2, c3]: [f64; 3], t: f64) -> (f64, f64) {
    (t * (c1 + t * (c2 + t * c3)), c1 + t * (2.0 * c2 + t * 3.0 * c3))
}

impl Polynomial {
    /// The factor q, and its derivative by r².
    fn radial(&self, r2: f64) -> (f64, f64) {
        let (over, over_slope) = cubic(self.radial, r2);
        let (under, under_slope) = cubic(self.denominator, r2);
        let (over, under) = (1.0 + over, 1.0 + under);
        (over / under, (over_slope * under - over * under_slope) / (under * under))
    }

    fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let r2 = x * x + y * y;
        let (radial, _) = self.radial(r2);
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
        ]
    }

    /// The derivatives `[[∂x'/∂x, ∂x'/∂y], [∂y'/∂x, ∂y'/∂y]]`.
    fn slope(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let r2 = x * x + y * y;
        let (radial, growth) = self.radial(r2);
        let growth = 2.0 * growth;
        let cross = x * y * growth + 2.0 * (p1 * x + p2 * y);
        let (prism_x, prism_y) = (2.0 * (s1 + 2.0 * s2 * r2), 2.0 * (s3 + 2.0 * s4 * r2));
        [
            [radial + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x + x * prism_x, cross + y * prism_x],
            [cross + x * prism_y, radial + y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x + y * prism_y],
        ]
    }

    /// Newton's method on [`distort`](Self::distort), from the center outwards, so that it finds the branch that goes
    /// through the center.
    fn undistort(&self, seen: [f64; 2]) -> Option<[f64; 2]> {
        const STEPS: i32 = 8;
        let mut at = [0.0; 2];
        for step in 1..=STEPS {
            let goal = seen.map(|x| x * f64::from(step) / f64::from(STEPS));
            for _ in 0..if step == STEPS { 12 } else { 2 } {
                let [x, y] = self.distort(at);
                let [[a, b], [c, d]] = self.slope(at);
                let determinant = a * d - b * c;
                if determinant <= LEAST_SLOPE {
                    return None;
                }
                let (dx, dy) = (goal[0] - x, goal[1] - y);
                at = [at[0] + (d * dx - b * dy) / determinant, at[1] + (a * dy - c * dx) / determinant];
            }
        }
        let [x, y] = self.distort(at);
        ((x - seen[0]).abs() + (y - seen[1]).abs() < 1e-9).then_some(at)
    }
}

impl Fisheye {
    /// Largest angle of a direction that is seen, radians: depth along the optical axis is positive and finite.
    pub const MAX_ANGLE: f64 = 89.5 * std::f64::consts::PI / 180.0;

    /// Distance from the center at which an angle is seen, and its derivative.
    pub fn radius(&self, angle: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.coefficients;
        let t = angle * angle;
        (
            angle * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)))),
            1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4))),
        )
    }

    /// The angle that is seen at a distance from the center; none beyond [`Self::MAX_ANGLE`], or where a smaller angle is
    /// seen at a greater distance.
    pub fn angle(&self, radius: f64) -> Option<f64> {
        const STEPS: i32 = 8;
        let mut angle = 0.0;
        for step in 1..=STEPS {
            let goal = radius * f64::from(step) / f64::from(STEPS);
            for _ in 0..if step == STEPS { 12 } else { 2 } {
                let (seen, slope) = self.radius(angle);
                if slope <= LEAST_SLOPE {
                    return None;
                }
                angle = (angle + (goal - seen) / slope).min(Self::MAX_ANGLE);
            }
        }
        ((self.radius(angle).0 - radius).abs() < 1e-9).then_some(angle)
    }

    fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r = libm::hypot(x, y);
        if r == 0.0 {
            return [x, y];
        }
        let factor = self.radius(libm::atan(r)).0 / r;
        [x * factor, y * factor]
    }

    fn undistort(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let radius = libm::hypot(x, y);
        if radius == 0.0 {
            return Some([x, y]);
        }
        let factor = libm::tan(self.angle(radius)?) / radius;
        Some([x * factor, y * factor])
    }
}

/// A lens of finite aperture: surfaces off the plane of focus are blurred. Labels are taken through the center of the
/// lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ThinLens {
    /// Radius of the aperture, meters: focal length over twice the f-number.
    pub aperture_radius_m: f64,
    /// Distance of the plane of focus along the optical axis, meters.
    pub focus_distance_m: f64,
}

/// The result of a camera model for a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// How directions become pixels.
    pub intrinsics: Intrinsics,
    /// Lens distortion, if any.
    pub distortion: Option<Distortion>,
    /// Depth of field; a pinhole without.
    pub lens: Option<ThinLens>,
    /// How scene light becomes an image.
    pub exposure: Exposure,
}

/// A camera in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// How directions become pixels.
    pub intrinsics: Intrinsics,
    /// Lens distortion, if any.
    pub distortion: Option<Distortion>,
    /// Depth of field; a pinhole without.
    pub lens: Option<ThinLens>,
    /// Pose of the camera frame: x right, y down, z forward.
    pub world_from_camera: Pose,
}

impl Camera {
    /// A pinhole camera without distortion.
    pub fn pinhole(intrinsics: Intrinsics, world_from_camera: Pose) -> Self {
        Self { intrinsics, distortion: None, lens: None, world_from_camera }
    }

    /// Projects a point of the camera frame to (u, v), px, distortion included. The point must be in front: z > 0.
    #[inline]
    pub fn project(&self, p_camera: &Point3<f64>) -> [f64; 2] {
        match &self.distortion {
            None => self.intrinsics.project(p_camera),
            Some(distortion) => {
                let [x, y] = distortion.distort([p_camera.x / p_camera.z, p_camera.y / p_camera.z]);
                self.intrinsics.project(&Point3::new(x, y, 1.0))
            }
        }
    }

    /// The directions that the centers of the pixels see.
    pub fn rays(&self) -> Rays<'_> {
        let k = &self.intrinsics;
        let columns = (0..k.width).map(|x| k.unproject(f64::from(x) + 0.5, 0.0).x).collect();
        let rows = (0..k.height).map(|y| k.unproject(0.0, f64::from(y) + 0.5).y).collect();
        Rays { columns, rows, distortion: self.distortion.as_ref() }
    }

    /// The direction that is seen at (u, v), in the camera frame with z = 1, so that depth is the ray parameter. None
    /// where the distortion has no inverse: such pixels see nothing.
    #[inline]
    pub fn unproject(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        let straight = self.intrinsics.unproject(u, v);
        match &self.distortion {
            None => Some(straight),
            Some(distortion) => distortion.undistort([straight.x, straight.y]).map(|[x, y]| Vector3::new(x, y, 1.0)),
        }
    }
}

/// The directions that the centers of a camera's pixels see, in its frame with z = 1.
#[derive(Debug, Clone)]
pub struct Rays<'a> {
    /// x of each column, without distortion.
    columns: Vec<f64>,
    /// y of each row.
    rows: Vec<f64>,
    distortion: Option<&'a Distortion>,
}

impl Rays<'_> {
    /// x and y of the direction of the pixel at column x of row y, whose z is 1: [`Camera::unproject`] of its center.
    #[inline]
    pub fn at(&self, x: u32, y: u32) -> Option<(f64, f64)> {
        let (x, y) = (self.columns[x as usize], self.rows[y as usize]);
        match self.distortion {
            None => Some((x, y)),
            Some(distortion) => distortion.undistort([x, y]).map(|[x, y]| (x, y)),
        }
    }

    /// The directions of all pixels of a row: their x and their y, NaN for a pixel without a direction.
    pub fn row(&self, y: u32) -> (Vec<f64>, Vec<f64>) {
        match self.distortion {
            None => (self.columns.clone(), vec![self.rows[y as usize]; self.columns.len()]),
            Some(_) => (0..self.columns.len() as u32).map(|x| self.at(x, y).unwrap_or((f64::NAN, f64::NAN))).unzip(),
        }
    }
}

/// How an image in nits becomes an 8-bit one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exposure {
    /// Luminance `1.2 · 2^EV100` nits becomes white.
    Fixed {
        /// Exposure value at ISO 100.
        ev100: f64,
    },
    /// Set from the image's own brightness.
    Auto {
        /// Stops brighter (positive) or darker than the automatic choice.
        compensation_ev: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_and_ray_agree() {
        let k = Intrinsics { width: 640, height: 480, fx: 457.0, fy: 461.0, cx: 320.0, cy: 240.0 };
        let p = Point3::from(k.unproject(100.5, 400.25) * 1.7);
        let [u, v] = k.project(&p);
        assert!((u - 100.5).abs() < 1e-9 && (v - 400.25).abs() < 1e-9);
        assert_eq!(k.project(&Point3::new(0.0, 0.0, 2.0)), [320.0, 240.0]);
        // Four pixels see what one saw: its corners are theirs.
        let fine = k.subdivided(2);
        assert_eq!((fine.width, fine.height), (1280, 960));
        for (u, v) in [(100.0, 400.0), (100.5, 400.5), (101.0, 401.0)] {
            assert!((fine.unproject(2.0 * u, 2.0 * v) - k.unproject(u, v)).norm() < 1e-12);
        }
        assert!(k.contains([0.0, 479.9]) && !k.contains([640.0, 1.0]) && !k.contains([1.0, -0.1]));
    }

    /// Values of `cv2.projectPoints` and `cv2.fisheye.projectPoints` of OpenCV 5.0 with an identity K.
    #[test]
    fn all_models_match_opencv_and_are_undone() {
        let eight = Polynomial {
            radial: [-0.28, 0.09, -0.01],
            tangential: [0.001, -0.0007],
            denominator: [0.11, -0.02, 0.004],
            thin_prism: [0.0; 4],
        };
        let twelve = Polynomial { thin_prism: [0.003, -0.001, -0.002, 0.0015], ..eight };
        let fisheye = Fisheye { coefficients: [0.05, -0.02, 0.006, -0.001] };
        let cases: [(Distortion, &[[[f64; 2]; 2]]); 3] = [
            (
                Distortion::Polynomial(eight),
                &[
                    [[0.3, -0.2], [0.2852034834404361, -0.19006632229362413]],
                    [[-0.7, 0.5], [-0.5490910643656842, 0.3925779031183459]],
                ],
            ),
            (
                Distortion::Polynomial(twelve),
                &[
                    [[0.3, -0.2], [0.2855765834404361, -0.19030097229362414]],
                    [[-0.7, 0.5], [-0.5474186643656842, 0.39191930311834594]],
                ],
            ),
            (
                Distortion::Fisheye(fisheye),
                &[
                    [[0.3, -0.2], [0.2895727315570745, -0.1930484877047164]],
                    [[-3.0, 1.5], [-1.200176307812358, 0.600088153906179]],
                    [[0.0, 8.0], [0.0, 1.5228890692460209]],
                    [[0.0, 0.0], [0.0, 0.0]],
                ],
            ),
        ];
        for (lens, points) in cases {
            for [point, want] in points {
                let seen = lens.distort(*point);
                let back = lens.undistort(*want).expect("within the image");
                for axis in 0..2 {
                    assert!((seen[axis] - want[axis]).abs() < 1e-12, "{lens:?} {seen:?} {want:?}");
                    assert!((back[axis] - point[axis]).abs() < 1e-7, "{lens:?} {back:?} {point:?}");
                }
            }
        }
        // 90 degrees are seen at θ = π/2 of an equidistant lens, but have no depth.
        let equidistant = Distortion::Fisheye(Fisheye::default());
        assert_eq!(equidistant.undistort([std::f64::consts::FRAC_PI_2, 0.0]), None);
        let edge = Fisheye::MAX_ANGLE - 1e-6;
        let [x, _] = equidistant.undistort([edge, 0.0]).expect("seen");
        assert!((x - edge.tan()).abs() < 1e-6, "{x}");
        // A lens that folds at θ = 1: nothing is seen beyond.
        let folds = Fisheye { coefficients: [-1.0 / 3.0, 0.0, 0.0, 0.0] };
        assert!(folds.angle(0.6).is_some() && folds.angle(0.7).is_none());
    }

    #[test]
    fn distortion_matches_opencv_and_is_undone() {
        let lens = Distortion::brown_conrady([-0.28, 0.09, -0.01], [0.001, -0.0007]);
        // cv::projectPoints of (0.3, -0.2, 1) with these coefficients and an identity K, by its documentation.
        let (x, y, r2) = (0.3_f64, -0.2_f64, 0.13_f64);
        let radial = 1.0 - 0.28 * r2 + 0.09 * r2.powi(2) - 0.01 * r2.powi(3);
        let want = [
            x * radial + 2.0 * 0.001 * x * y - 0.0007 * (r2 + 2.0 * x * x),
            y * radial + 0.001 * (r2 + 2.0 * y * y) - 2.0 * 0.0007 * x * y,
        ];
        let got = lens.distort([x, y]);
        assert!((got[0] - want[0]).abs() < 1e-12 && (got[1] - want[1]).abs() < 1e-12, "{got:?} {want:?}");
        for x in [-0.7, 0.0, 0.45] {
            for y in [-0.5, 0.1, 0.6] {
                let back = lens.undistort(lens.distort([x, y])).expect("within the image");
                assert!((back[0] - x).abs() < 1e-9 && (back[1] - y).abs() < 1e-9, "{x} {y}: {back:?}");
            }
        }
        let intrinsics = Intrinsics { width: 6, height: 5, fx: 4.0, fy: 5.0, cx: 2.5, cy: 3.0 };
        for distortion in [None, Some(lens)] {
            let camera = Camera { distortion, ..Camera::pinhole(intrinsics, Pose::identity()) };
            let rays = camera.rays();
            for (x, y) in (0..5).flat_map(|y| (0..6).map(move |x| (x, y))) {
                let ray = rays.at(x, y).map(|(x, y)| Vector3::new(x, y, 1.0));
                assert_eq!(ray, camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let (right, down) = rays.row(y);
                assert_eq!(rays.at(x, y), Some((right[x as usize], down[x as usize])));
            }
        }
        // A barrel that folds: nothing is seen beyond the fold.
        let folded = Distortion::brown_conrady([-0.5, 0.0, 0.0], [0.0; 2]);
        assert_eq!(folded.undistort([1.5, 0.0]), None);
        let wide = Intrinsics { width: 9, height: 1, fx: 2.0, fy: 2.0, cx: 4.5, cy: 0.5 };
        let camera = Camera { distortion: Some(folded), ..Camera::pinhole(wide, Pose::identity()) };
        let (right, down) = camera.rays().row(0);
        assert!(right[0].is_nan() && down[0].is_nan() && right[4] == 0.0 && right[5] > 0.0);
    }
}
