//! Containment: objects inside others.

use super::solid::Solid;
use super::support::SupportRelation;
use crate::units;
use parry3d::math::Vector;
use serde::Serialize;
use syntable_convex::{ConvexHull, Polyhedron};
use syntable_model::geometry::Point3;
use syntable_model::scene::{Role, Scene};

/// An object is in a container that holds at least this fraction of its volume.
const MIN_FRACTION: f64 = 0.5;

/// Points of a tetrahedron that represent a quarter of its volume each: weight of the nearest corner, and weight of the
/// others. These are the points of the rule of degree 2 (Hammer and Stroud, 1956).
const QUARTERS: [f32; 2] = [0.585_410_2, 0.138_196_6];

/// An entry of the product `inside`.
#[derive(Serialize)]
pub struct InsideEntry {
    id: u16,
    container: u16,
    fraction: f64,
}

/// Objects and distractors in a body that carries them.
pub fn inside(scene: &Scene, solids: &[Solid], support: &SupportRelation) -> Vec<InsideEntry> {
    let mut found = Vec::new();
    let can_hold = |index: &usize| scene.body(solids[*index].id).is_some_and(|body| body.role != Role::Room);
    for container in (0..solids.len()).filter(can_hold) {
        let carried = (0..solids.len()).filter(|&it| it != container && solids[it].is_foreground);
        let carried: Vec<usize> = carried.filter(|&it| support.carries(container, it)).collect();
        let Some(hull) = (if carried.is_empty() { None } else { Hull::of(scene, &solids[container]) }) else {
            continue;
        };
        for object in carried {
            let fraction = hull.fraction_of(&solids[object]);
            if fraction >= MIN_FRACTION {
                found.push(InsideEntry { id: solids[object].id.0, container: solids[container].id.0, fraction });
            }
        }
    }
    found.sort_by_key(|it| (it.id, it.container));
    found
}

/// The convex hull of a body in its frame, with the pose of the world in that frame.
struct Hull {
    hull: ConvexHull,
    body_from_world: syntable_model::geometry::Pose,
}

impl Hull {
    fn of(scene: &Scene, solid: &Solid) -> Option<Self> {
        let body = scene.body(solid.id)?;
        let hull = units::hull(&body.object.mesh.data().positions)?;
        Some(Self { hull, body_from_world: body.world_from_body.inverse() })
    }

    /// The fraction of a solid's volume inside: each convex part is cut into tetrahedra about its center, and each
    /// tetrahedron contributes the quarters whose points are inside.
    fn fraction_of(&self, solid: &Solid) -> f64 {
        let (mut within, mut all) = (0.0, 0.0);
        for part in &solid.parts {
            let Some(polyhedron) = Polyhedron::of(&*part.shape) else { continue };
            let (points, triangles) = polyhedron.to_trimesh();
            let points: Vec<Vector> = points.iter().map(|p| part.pose * *p).collect();
            let middle = points.iter().sum::<Vector>() / points.len() as f32;
            for triangle in triangles {
                let [a, b, c] = triangle.map(|index| points[index as usize]);
                let volume = f64::from((a - middle).dot((b - middle).cross(c - middle)).abs());
                all += volume;
                for corner in [middle, a, b, c] {
                    let sum = middle + a + b + c - corner;
                    let point = corner * QUARTERS[0] + sum * QUARTERS[1];
                    within += if self.contains(point) { volume / 4.0 } else { 0.0 };
                }
            }
        }
        if all > 0.0 { within / all } else { 0.0 }
    }

    fn contains(&self, point: Vector) -> bool {
        let world = Point3::from(point.to_array().map(units::meters));
        let local = self.body_from_world * world;
        self.hull.max_plane_distance([local.x, local.y, local.z].map(|x| x as f32)) <= 0.0
    }
}
