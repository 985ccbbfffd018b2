//! Where a recorded scene is in the world.

use syntable_convex::{ConvexHull, HullOptions};
use syntable_model::geometry::{Point3, Pose, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::Support;

/// Accuracy of the hull around all objects.
const HULL: HullOptions = HullOptions { max_vertices: 512, ..HullOptions::METERS };

/// Objects rest on a plane that is within this distance of their lowest points, meters: poses of recorded scenes are estimates.
const RESTS_WITHIN_M: f64 = 0.008;

/// Normals within this angle belong to one plane: 5°.
const SAME_PLANE_COS: f64 = 0.996;

/// The vertical in the frame of a camera that looks down at 55°, x right, y down, z forward: the side of the ground from which
/// cameras at 10° to 90° see a scene.
const LIKELY_UP: Vector3<f64> = Vector3::new(0.0, -0.574, -0.819);

/// Planes within this angle of the likeliest are as likely: 15°.
const LIKELY_COS: f64 = 0.966;

/// Gap between the lowest point of a rebuilt scene and its support, meters.
const GAP_M: f64 = 1e-4;

/// How the frame of a recorded scene becomes the world.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordedFrame {
    /// The plane on which most objects rest becomes the surface of the support. The first camera looks along the world's +y axis, before
    /// `yaw_deg`.
    #[default]
    RestingPlane,
    /// The recorded z axis points up, and the lowest point of the objects is on the surface of the support.
    ZUp,
    /// Poses stay as they were recorded.
    World,
}

/// The objects of a recorded scene, as corners of their hulls in the recorded frame.
pub type Corners = Vec<Vec<Point3<f64>>>;

/// The pose of a recorded frame that puts its objects on a support. `yaw` is in radians.
///
/// # Errors
/// If the objects rest on no plane below the camera.
pub fn on_support(frame: RecordedFrame, objects: &Corners, camera: &Pose, support: &Support, yaw: f64) -> Result<Pose> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    let rotation = match frame {
        RecordedFrame::World => return Ok(Pose::identity()),
        RecordedFrame::ZUp => turn,
        RecordedFrame::RestingPlane => {
            let up = resting_plane(objects, camera).ok_or_else(|| {
                Error::new("the recorded objects rest on no plane below their camera")
                    .help("set `frame = \"z_up\"`, or `frame = \"world\"`")
            })?;
            turn * upright(&up, camera)
        }
    };
    let all = || objects.iter().flatten().map(|p| rotation * p);
    let low = all().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(&p.coords));
    let high = all().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p.coords));
    let middle = (low + high) / 2.0;
    let to = support.center().coords - Vector3::new(middle.x, middle.y, low.z - GAP_M);
    Ok(Pose::from_parts(to.into(), rotation))
}

/// The rotation that turns `up` upwards, and the direction of a camera along +y.
fn upright(up: &Vector3<f64>, camera: &Pose) -> UnitQuaternion<f64> {
    let level = |direction: Vector3<f64>| (direction - up * up.dot(&direction)).try_normalize(1e-3);
    let [forward, image_up, right] =
        [Vector3::z(), -Vector3::y(), Vector3::x()].map(|axis| level(camera.rotation * axis));
    // A camera that looks straight down has no level direction, but then the top of its image has.
    let ahead = forward.or(image_up).or(right).unwrap_or_else(Vector3::y);
    let recorded_axes = [ahead.cross(up), ahead, *up];
    UnitQuaternion::from_basis_unchecked(&recorded_axes).inverse()
}

/// The direction, recorded frame, that points up from the plane on which most objects rest. The plane is a face of the convex hull of
/// all objects, and the camera is above it. Of planes on which equally many rest, it faces the top of the image and the camera, as
/// the ground does, and of those within 15° it is the one with the largest area.
fn resting_plane(objects: &Corners, camera: &Pose) -> Option<Vector3<f64>> {
    let first = objects.iter().flatten().next()?.coords;
    let points: Vec<[f32; 3]> = objects.iter().flatten().map(|p| (p.coords - first).map(|x| x as f32).into()).collect();
    let hull = ConvexHull::new(&points, &HULL)?;
    let vertex = |index: u32| Vector3::from(hull.points[index as usize].map(f64::from)) + first;
    let faces: Vec<(Vector3<f64>, f64, Vector3<f64>)> = hull
        .triangles
        .iter()
        .filter_map(|triangle| {
            let [a, b, c] = triangle.map(vertex);
            let across = (b - a).cross(&(c - a));
            Some((-across.try_normalize(1e-12)?, across.norm() / 2.0, a))
        })
        .collect();
    let eye = camera.translation.vector;
    let resting = |(up, _, at): &(Vector3<f64>, f64, Vector3<f64>)| {
        let rests = |object: &&Vec<Point3<f64>>| object.iter().any(|p| up.dot(&(p.coords - at)) <= RESTS_WITHIN_M);
        objects.iter().filter(rests).count()
    };
    let below = faces.iter().filter(|(up, _, at)| up.dot(&(eye - at)) > 0.0);
    let ranked: Vec<(usize, Vector3<f64>)> = below.map(|face| (resting(face), face.0)).collect();
    let most = ranked.iter().map(|(count, _)| *count).max()?;
    let ups: Vec<Vector3<f64>> = ranked.into_iter().filter(|(count, _)| *count == most).map(|(_, up)| up).collect();
    let toward = camera.rotation * LIKELY_UP;
    let likely = ups.iter().copied().max_by(|a, b| a.dot(&toward).total_cmp(&b.dot(&toward)))?;
    let area = |up: &Vector3<f64>| -> f64 {
        faces.iter().filter(|(other, ..)| other.dot(up) >= SAME_PLANE_COS).map(|(_, area, _)| area).sum()
    };
    let near = ups.into_iter().filter(|up| up.dot(&likely) >= LIKELY_COS);
    near.max_by(|a, b| area(a).total_cmp(&area(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::look_at;
    use syntable_model::scene::Region;

    /// Three boxes on the plane z = 0, one on top of another, seen by a camera.
    fn recorded() -> (Corners, Pose) {
        let cuboid = |[x, y, z]: [f64; 3], half: f64| -> Vec<Point3<f64>> {
            let signs = [-half, half];
            let corner = |i: usize| Point3::new(x + signs[i & 1], y + signs[i >> 1 & 1], z + signs[i >> 2 & 1]);
            (0..8).map(corner).collect()
        };
        let objects = vec![
            cuboid([0.0, 0.0, 0.05], 0.05),
            cuboid([0.25, 0.05, 0.03], 0.03),
            cuboid([0.1, 0.3, 0.04], 0.04),
            cuboid([0.0, 0.0, 0.12], 0.02),
        ];
        let camera = look_at(Point3::new(-0.5, -0.8, 0.7), Point3::new(0.1, 0.1, 0.0), Vector3::z());
        (objects, camera)
    }

    #[test]
    fn the_resting_plane_is_found_in_any_frame() {
        let (objects, camera) = recorded();
        let mut stream = Stream::root(5);
        let surface = Region::rectangle([0.4, -0.2, 0.75], [1.0, 1.0]);
        let support = Support::new("table", surface);
        for _ in 0..50 {
            let rotation = UnitQuaternion::from_euler_angles(
                stream.uniform(-3.0, 3.0),
                stream.uniform(-1.5, 1.5),
                stream.uniform(-3.0, 3.0),
            );
            let hidden = Pose::from_parts(Vector3::new(0.3, -2.0, 1.1).into(), rotation);
            let noise = |stream: &mut Stream| Vector3::from_fn(|_, _| stream.uniform(-0.002, 0.002));
            let moved: Corners = objects
                .iter()
                .map(|object| {
                    let shift = noise(&mut stream);
                    object.iter().map(|p| hidden * p + shift).collect()
                })
                .collect();
            let seen_from = hidden * camera;
            let yaw = stream.uniform(0.0, 6.0);
            let found = on_support(RecordedFrame::RestingPlane, &moved, &seen_from, &support, yaw).expect("a plane");
            // The hidden vertical is vertical again, within the noise over the distances of the boxes.
            let up = (found * hidden).rotation * Vector3::z();
            assert!(up.z > 0.9995, "{up}");
            let lowest = moved.iter().flatten().map(|p| (found * p).z).fold(f64::INFINITY, f64::min);
            assert!((lowest - 0.75 - GAP_M).abs() < 1e-9, "{lowest}");
            // The camera looks along +y, turned by the yaw.
            let ahead = (found * seen_from).rotation * Vector3::z();
            let angle = libm::atan2(-ahead.x, ahead.y) - yaw;
            assert!(libm::sin(angle).abs() < 1e-6 && libm::cos(angle) > 0.0, "{ahead}");
        }
    }

    #[test]
    fn a_recorded_vertical_is_kept() {
        let (objects, camera) = recorded();
        let support = Support::new("table", Region::rectangle([0.0, 0.0, 0.5], [1.0, 1.0]));
        let found = on_support(RecordedFrame::ZUp, &objects, &camera, &support, 0.0).expect("placed");
        assert_eq!(found.rotation, UnitQuaternion::identity());
        assert!((found.translation.z - 0.5 - GAP_M).abs() < 1e-12);
    }
    /// Corners of a convex body from its base at z = 0 to a height.
    fn upright(outline: &[[f64; 2]], height: f64) -> Vec<Point3<f64>> {
        outline.iter().flat_map(|p| [0.0, height].map(|z| Point3::new(p[0], p[1], z))).collect()
    }

    #[test]
    fn tall_things_stand_as_they_were_seen() {
        let carton = upright(&[[-0.095, -0.03], [0.095, -0.03], [0.095, 0.03], [-0.095, 0.03]], 0.275);
        let can = |x: f64| {
            let corner = |i: i32| {
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(i) / 32.0);
                [x + 0.033 * cos, 0.033 * sin]
            };
            upright(&(0..32).map(corner).collect::<Vec<_>>(), 0.12)
        };
        for objects in [vec![carton], vec![can(0.0), can(0.2)], vec![can(0.0)]] {
            for elevation in [15.0_f64, 30.0, 50.0, 70.0, 85.0] {
                for azimuth in 0..12 {
                    let (sin, cos) = libm::sincos(elevation.to_radians());
                    let (y, x) = libm::sincos(std::f64::consts::TAU * (f64::from(azimuth) + 0.3) / 12.0);
                    let eye = Point3::new(0.8 * cos * x, 0.8 * cos * y, 0.8 * sin);
                    let camera = look_at(eye, Point3::new(0.05, 0.0, 0.06), Vector3::z());
                    let up = resting_plane(&objects, &camera).expect("a plane");
                    assert!(up.z > 0.999, "{elevation} {azimuth}: {up}");
                }
            }
        }
    }
}
