//! Tests the conditions on camera poses.
//!
//! Rays against the bodies of the scene answer every question, so the result depends neither on the renderer nor on the
//! resolution. Cheap conditions come first, and the first condition that a pose does not meet refuses it.

use crate::run::dataset::draws::Condition;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::{Body, Camera, Role, Scene, Support};
use syntable_prepare::RayScene;
use syntable_recipe::{ObjectCount, ViewConditions};

/// Number of rays along the longer edge of the image that look for near surfaces.
const CLEARANCE_RAYS: u32 = 48;

/// Number of rays along either edge of the rectangle around an object: at first, and at most.
const OBJECT_RAYS: [u32; 2] = [24, 96];

/// Number of rays that must hit an object, unless the finest grid hits it less often.
const MIN_HITS: u32 = 64;

/// Edge of the canvas around the image on which outlines are measured, as a multiple of the image's.
const CANVAS: f64 = 3.0;

/// Depth from which on a corner of a box is projected, meters.
const MIN_DEPTH_M: f64 = 1e-3;

/// A body hides a point from this distance in front of it on, as a fraction of the distance to the camera. Objects touch
/// the bodies that they lie on.
const HIDES_FROM: f64 = 1.0 - 1e-6;

/// A line of sight ends this fraction of its length before the point that the camera looks at, which can be on a surface.
const SIGHT_END: f64 = 0.999;

/// How well a pose meets the conditions. A greater one is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The first condition that it does not meet, and the number of objects in the view if all others are met.
    Refused(Condition, u32),
    /// It meets all conditions.
    Accepted,
}

/// The conditions in a scene at a moment.
pub struct ConditionTest<'s> {
    pub conditions: &'s ViewConditions,
    pub scene: &'s Scene,
    pub rays: &'s RayScene,
    /// Center of the shell that the cameras are in.
    pub center: Point3<f64>,
    /// The point that the camera looks at, if the kind of views states one.
    pub target: Option<Point3<f64>>,
}

impl ConditionTest<'_> {
    /// Tests a camera.
    ///
    /// # Errors
    /// If a condition needs the point that the camera looks at, and the view sampler names none.
    pub fn verdict(&self, camera: &Camera) -> Result<Verdict> {
        let (conditions, eye) = (self.conditions, Point3::from(camera.world_from_camera.translation.vector));
        let refused = |condition| Ok(Verdict::Refused(condition, 0));
        if conditions.above_support && self.support().is_some_and(|support| eye.z < support.height()) {
            return refused(Condition::AboveSupport);
        }
        if conditions.outside_bodies && self.is_inside(&eye) {
            return refused(Condition::OutsideBodies);
        }
        if conditions.line_of_sight && !self.sees_target(&eye)? {
            return refused(Condition::LineOfSight);
        }
        if conditions.clearance_m > 0.0 && self.is_near(camera) {
            return refused(Condition::Clearance);
        }
        let counted = || self.scene.objects().iter().filter(|body| self.counts(body)).count() as u32;
        let wanted = match conditions.min_objects {
            ObjectCount::AtLeast(count) => count,
            ObjectCount::All(_) => counted(),
        };
        let mut seen = 0;
        for (index, body) in self.scene.objects().iter().enumerate().filter(|(_, body)| self.counts(body)) {
            if seen >= wanted {
                break;
            }
            seen += u32::from(self.is_in_view(camera, index, body));
        }
        Ok(if seen >= wanted { Verdict::Accepted } else { Verdict::Refused(Condition::MinObjects, seen) })
    }

    /// The highest support below the center of the views, or else the main one.
    fn support(&self) -> Option<&Support> {
        let below = self.scene.supports.iter().filter(|support| support.surface.column_contains(&self.center));
        let highest = below.max_by(|one, other| one.height().total_cmp(&other.height()));
        highest.or_else(|| self.scene.supports.main())
    }

    fn is_inside(&self, eye: &Point3<f64>) -> bool {
        self.scene.bodies().iter().enumerate().any(|(index, body)| match self.rays.winding(index, eye) {
            // A room of one mesh that is seen from its inside is turned inside out.
            winding if body.role == Role::Room => winding > 0,
            winding => winding != 0,
        })
    }

    fn sees_target(&self, eye: &Point3<f64>) -> Result<bool> {
        let target = self.target.ok_or_else(|| {
            Error::new("`line_of_sight` needs a point that the camera looks at, and the pose of this view names none")
                .help("remove `line_of_sight` from [views.conditions], or let [views] look at one point, such as `look_at = \"tabletop_center\"`")
        })?;
        let objects = self.scene.objects().len();
        Ok(self.rays.first(eye, &(target - eye), SIGHT_END, |body| body >= objects).is_none())
    }

    /// Whether a surface in the view is too near.
    fn is_near(&self, camera: &Camera) -> bool {
        let k = &camera.intrinsics;
        let step = f64::from(k.width.max(k.height)) / f64::from(CLEARANCE_RAYS);
        let count = |edge: u32| (f64::from(edge) / step).ceil().max(1.0) as u32;
        let (columns, rows) = (count(k.width), count(k.height));
        (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))).any(|(column, row)| {
            let at = |index: u32, count: u32, edge: u32| (f64::from(index) + 0.5) / f64::from(count) * f64::from(edge);
            let Some((eye, direction)) = ray(camera, [at(column, columns, k.width), at(row, rows, k.height)]) else {
                return false;
            };
            let end = self.conditions.clearance_m / direction.norm();
            self.rays.first(&eye, &direction, end, |_| true).is_some()
        })
    }

    /// Whether an object is of a category that counts.
    fn counts(&self, body: &Body) -> bool {
        let categories = &self.conditions.categories;
        categories.is_empty() || categories.contains(&body.object.category)
    }

    fn is_in_view(&self, camera: &Camera, index: usize, body: &Body) -> bool {
        let (conditions, world_from_camera) = (self.conditions, &camera.world_from_camera);
        if let Some([nearest, farthest]) = conditions.distance_m {
            let center = body.world_from_body * body.object.mesh.bounds().center();
            let distance = (center - Point3::from(world_from_camera.translation.vector)).norm();
            if !(nearest..=farthest).contains(&distance) {
                return false;
            }
        }
        if conditions.uncut && !is_uncut(camera, body) {
            return false;
        }
        let [low, high] = rectangle(camera, body);
        if (0..2).any(|axis| low[axis] >= high[axis]) {
            return false;
        }
        let [mut count, most] = OBJECT_RAYS;
        loop {
            let (hits, visible) = self.sample(camera, index, [low, high], count);
            if hits >= MIN_HITS || count >= most {
                return visible > 0 && f64::from(visible) >= conditions.min_visible * f64::from(hits);
            }
            count *= 2;
        }
    }

    /// Numbers of rays of a grid in a rectangle of the image plane that hit an object at any depth, and that hit it first and
    /// in the image.
    fn sample(&self, camera: &Camera, object: usize, [low, high]: [[f64; 2]; 2], count: u32) -> (u32, u32) {
        let at = |index: u32, axis: usize| {
            low[axis] + (f64::from(index) + 0.5) / f64::from(count) * (high[axis] - low[axis])
        };
        let (mut hits, mut visible) = (0, 0);
        for (column, row) in (0..count).flat_map(|row| (0..count).map(move |column| (column, row))) {
            let pixel = [at(column, 0), at(row, 1)];
            let Some((eye, direction)) = ray(camera, pixel) else { continue };
            let Some(t) = self.rays.hit(object, &eye, &direction) else { continue };
            hits += 1;
            let is_visible = camera.intrinsics.contains(pixel)
                && self.rays.first(&eye, &direction, t * HIDES_FROM, |body| body != object).is_none();
            visible += u32::from(is_visible);
        }
        (hits, visible)
    }
}

/// The ray of a point of the image plane, px.
fn ray(camera: &Camera, [u, v]: [f64; 2]) -> Option<(Point3<f64>, Vector3<f64>)> {
    let direction = camera.world_from_camera * camera.unproject(u, v)?;
    Some((Point3::from(camera.world_from_camera.translation.vector), direction))
}

/// The part of the canvas in which an object can be, px: lowest and highest corner.
fn rectangle(camera: &Camera, body: &Body) -> [[f64; 2]; 2] {
    let k = &camera.intrinsics;
    let beyond = [k.width, k.height].map(|edge| f64::from(edge) * (CANVAS - 1.0) / 2.0);
    let canvas = [beyond.map(|edge| -edge), [f64::from(k.width) + beyond[0], f64::from(k.height) + beyond[1]]];
    let camera_from_body = camera.world_from_camera.inverse() * body.world_from_body;
    let corners = body.object.mesh.bounds().corners().map(|corner| camera_from_body * corner);
    if corners.iter().any(|corner| corner.z < MIN_DEPTH_M) {
        // Entirely behind the camera, or on both sides of it.
        let is_behind = corners.iter().all(|corner| corner.z <= 0.0);
        return if is_behind { [[0.0; 2]; 2] } else { canvas };
    }
    let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for seen in corners.map(|corner| camera.project(&corner)) {
        for axis in 0..2 {
            (low[axis], high[axis]) = (low[axis].min(seen[axis]), high[axis].max(seen[axis]));
        }
    }
    for axis in 0..2 {
        (low[axis], high[axis]) = (low[axis].max(canvas[0][axis]), high[axis].min(canvas[1][axis]));
    }
    [low, high]
}

/// Whether the border of the image cuts no part of an object: all its vertices are in the image.
fn is_uncut(camera: &Camera, body: &Body) -> bool {
    let camera_from_body = camera.world_from_camera.inverse() * body.world_from_body;
    body.object.mesh.data().positions.iter().all(|p| {
        let p = camera_from_body * Point3::from(p.map(f64::from));
        p.z > 0.0 && camera.intrinsics.contains(camera.project(&p))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use syntable_model::scene::SettleReport;
    use syntable_prepare::RayMesh;
    use syntable_recipe::AllObjects;
    use syntable_testing::scenes::{body, box_mesh, boxes, object, table, view};

    fn verdict(
        scene: &Scene,
        camera: &Camera,
        conditions: &ViewConditions,
        target: Option<[f64; 3]>,
    ) -> Result<Verdict> {
        let rays = RayScene::new(scene, |object| Arc::new(RayMesh::new(&object.mesh)));
        let (center, target) = (Point3::new(0.0, 0.0, 0.2), target.map(Point3::from));
        ConditionTest { conditions, scene, rays: &rays, center, target }.verdict(camera)
    }

    fn of(scene: &Scene, camera: &Camera, conditions: &ViewConditions) -> Verdict {
        verdict(scene, camera, conditions, None).expect("no target needed")
    }

    fn few(count: u32) -> Verdict {
        Verdict::Refused(Condition::MinObjects, count)
    }

    /// From 10 m above, so that perspective is small.
    fn from_above(x: f64, fov_deg: f64) -> Camera {
        view([x, 0.0, 10.0], [x, 1e-6, 0.0], [640, 480], fov_deg).camera
    }

    #[test]
    fn the_visible_fraction_is_the_fraction_of_the_outline() {
        // A plate hides three quarters of a flat box: they are seen from 10 m above.
        let plate =
            body(object("plate", box_mesh([0.15, 0.4, 0.002]), [0.5; 3]), [-0.025, 0.0, 0.021], Role::Distractor);
        let mut builder = table();
        builder.add(body(object("box", box_mesh([0.2, 0.2, 0.02]), [0.5; 3]), [0.0, 0.0, 0.01], Role::Object));
        builder.add(plate);
        let scene = builder.freeze(SettleReport::default()).expect("sound");
        let camera = from_above(0.0, 10.0);
        let at_least = |min_visible| ViewConditions { min_visible, ..ViewConditions::default() };
        assert_eq!(of(&scene, &camera, &at_least(0.22)), Verdict::Accepted);
        assert_eq!(of(&scene, &camera, &at_least(0.28)), few(0));
        // Half of a box without a cover is beyond the border of the image, which is 0.875 m from the center.
        let free = boxes(&[([0.0, 0.0, 0.01], [0.2, 0.2, 0.02])]);
        let aside = from_above(0.875, 10.0);
        assert_eq!(of(&free, &aside, &at_least(0.47)), Verdict::Accepted);
        assert_eq!(of(&free, &aside, &at_least(0.53)), few(0));
        let uncut = ViewConditions { uncut: true, ..ViewConditions::default() };
        assert_eq!((of(&free, &aside, &uncut), of(&free, &camera, &uncut)), (few(0), Verdict::Accepted));
    }

    #[test]
    fn objects_count_by_category_and_distance() {
        let scene = boxes(&[([0.0, 0.0, 0.05], [0.1; 3]), ([0.5, 0.0, 0.05], [0.1; 3]), ([5.0, 0.0, 0.05], [0.1; 3])]);
        let camera = from_above(0.0, 10.0);
        let count = |min_objects| ViewConditions { min_objects, ..ViewConditions::default() };
        assert_eq!(of(&scene, &camera, &count(ObjectCount::AtLeast(2))), Verdict::Accepted);
        assert_eq!(of(&scene, &camera, &count(ObjectCount::AtLeast(3))), few(2));
        assert_eq!(of(&scene, &camera, &count(ObjectCount::All(AllObjects::All))), few(2));
        assert_eq!(
            of(&scene, &camera, &ViewConditions { categories: vec!["mug".into()], ..count(ObjectCount::AtLeast(1)) }),
            few(0)
        );
        // The centers are at distances of 9.95 m and √(9.95² + 0.5²) m = 9.9626 m.
        let within = |distance_m| ViewConditions { distance_m: Some(distance_m), ..count(ObjectCount::AtLeast(2)) };
        assert_eq!(of(&scene, &camera, &within([9.94, 9.96])), few(1));
        assert_eq!(of(&scene, &camera, &within([9.94, 9.97])), Verdict::Accepted);
    }

    #[test]
    fn cameras_in_bodies_below_the_support_and_near_surfaces_are_refused() {
        let scene = boxes(&[([0.0, 0.0, 0.2], [0.4; 3])]);
        let none = ViewConditions { min_objects: ObjectCount::AtLeast(0), ..ViewConditions::default() };
        let at = |eye: [f64; 3], conditions: &ViewConditions| {
            of(&scene, &view(eye, [0.0, 0.0, 0.2], [64, 48], 60.0).camera, conditions)
        };
        let refused = |condition| Verdict::Refused(condition, 0);
        assert_eq!(at([0.1, 0.1, 0.3], &none), refused(Condition::OutsideBodies));
        assert_eq!(at([0.3, 0.1, 0.3], &none), Verdict::Accepted);
        assert_eq!(at([1.5, 0.1, -0.01], &none), refused(Condition::AboveSupport));
        let anywhere = ViewConditions { outside_bodies: false, above_support: false, ..none.clone() };
        assert_eq!(at([0.1, 0.1, 0.3], &anywhere), Verdict::Accepted);
        assert_eq!(at([1.5, 0.1, -0.01], &anywhere), Verdict::Accepted);
        // The lower border of the image looks down by 23.4°, and meets the table at 0.2 m / sin 23.4° = 0.503 m. The lowest
        // rays are 0.6° above it.
        let clear = |clearance_m| ViewConditions { clearance_m, ..none.clone() };
        assert_eq!(at([1.0, 0.0, 0.2], &clear(0.53)), refused(Condition::Clearance));
        assert_eq!(at([1.0, 0.0, 0.2], &clear(0.5)), Verdict::Accepted);
    }

    #[test]
    fn objects_may_hide_the_target_and_furniture_may_not() {
        let conditions = ViewConditions { line_of_sight: true, ..ViewConditions::default() };
        let camera = view([1.0, 0.0, 0.5], [0.0; 3], [64, 48], 60.0).camera;
        let target = Some([0.0; 3]);
        // The line passes 0.25 m above the table at half its length.
        let with = |role: Role| {
            let mut builder = table();
            builder.add(body(object("box", box_mesh([0.1; 3]), [0.5; 3]), [0.0, 0.3, 0.05], Role::Object));
            builder.add(body(object("post", box_mesh([0.05, 0.05, 0.6]), [0.5; 3]), [0.5, 0.0, 0.3], role));
            let scene = builder.freeze(SettleReport::default()).expect("sound");
            verdict(&scene, &camera, &conditions, target).expect("has a target")
        };
        assert_eq!(with(Role::Object), Verdict::Accepted);
        for role in [Role::Fixture, Role::Distractor, Role::Room] {
            assert_eq!(with(role), Verdict::Refused(Condition::LineOfSight, 0), "{role:?}");
        }
        let scene = boxes(&[([0.0, 0.0, 0.05], [0.1; 3])]);
        assert!(verdict(&scene, &camera, &conditions, None).expect_err("no target").is_permanent());
    }
}
