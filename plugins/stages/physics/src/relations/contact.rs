//! Points at which bodies touch.

use super::solid::{Solid, SolidPart};
use crate::units;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Vector;
use parry3d::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, QueryDispatcher};
use syntable_convex::PolyhedronContacts;
use syntable_model::geometry::{Point3, Vector3};

/// Points this close with the same normal are one, meters.
const SAME_POINT_M: f64 = 1e-4;

/// Normals this close are the same: cos 1°.
const SAME_NORMAL_COS: f64 = 0.999_85;

/// Two solids that touch.
pub struct Contact {
    /// Their indices, ascending by id.
    pub solids: [usize; 2],
    /// Friction coefficient between them.
    pub friction: f64,
    /// Points of contact; at least one.
    pub points: Vec<TouchPoint>,
}

/// A point at which two solids touch.
pub struct TouchPoint {
    /// Halfway between the surfaces, world, meters.
    pub at: Point3<f64>,
    /// Unit vector from the first to the second.
    pub normal: Vector3<f64>,
    /// Distance of the surfaces along the normal, meters; negative where they overlap.
    pub gap_m: f64,
}

impl TouchPoint {
    /// Whether another part touches at the same point, such as where two parts meet.
    fn is_same_as(&self, other: &Self) -> bool {
        (self.at - other.at).norm() < SAME_POINT_M && self.normal.dot(&other.normal) > SAME_NORMAL_COS
    }
}

impl Contact {
    /// Ids of both.
    pub fn ids(&self, solids: &[Solid]) -> [u16; 2] {
        self.solids.map(|index| solids[index].id.0)
    }

    /// Unit vector along the sum of the points' normals; zero if they cancel.
    pub fn mean_normal(&self) -> Vector3<f64> {
        let sum: Vector3<f64> = self.points.iter().map(|point| point.normal).sum();
        sum.try_normalize(1e-9).unwrap_or_default()
    }
}

/// All contacts of movable solids, ascending by ids. The ground is included where a body touches no fixed part of the
/// scene.
pub fn contacts(solids: &[Solid], margin_m: f64) -> Vec<Contact> {
    // The ground has the lowest id, and is the last solid.
    let mut order: Vec<usize> = (0..solids.len()).collect();
    order.sort_by_key(|&index| solids[index].id);
    let pairs = order.iter().enumerate().flat_map(|(at, &i)| order[at + 1..].iter().map(move |&j| [i, j]));
    let mut contacts: Vec<Contact> = pairs
        .filter(|pair| pair.iter().any(|&index| solids[index].is_dynamic))
        .filter_map(|pair| contact(pair, solids, margin_m))
        .collect();
    let is_ground = |index: usize| solids[index].id.0 == 0;
    let on_fixed: Vec<bool> = (0..solids.len())
        .map(|body| {
            contacts.iter().any(|contact| {
                contact.solids.contains(&body)
                    && contact.solids.iter().any(|&other| !solids[other].is_dynamic && !is_ground(other))
            })
        })
        .collect();
    contacts.retain(|contact| {
        !contact.solids.iter().any(|&it| is_ground(it)) || !contact.solids.iter().any(|&it| on_fixed[it])
    });
    contacts
}

fn contact(pair: [usize; 2], solids: &[Solid], margin_m: f64) -> Option<Contact> {
    let [one, two] = pair.map(|index| &solids[index]);
    let margin = units::length(margin_m);
    if !one.bounds?.loosened(margin).intersects(&two.bounds?) {
        return None;
    }
    let mut points = Vec::new();
    for first in
        one.parts.iter().filter(|part| part.bounds.loosened(margin).intersects(&two.bounds.unwrap_or(part.bounds)))
    {
        let near = first.bounds.loosened(margin);
        for second in two.parts.iter().filter(|part| near.intersects(&part.bounds)) {
            add_points(first, second, margin, &mut points);
        }
    }
    // As in the simulation.
    let friction = (one.friction + two.friction) / 2.0;
    (!points.is_empty()).then_some(Contact { solids: pair, friction, points })
}

fn add_points(first: &SolidPart, second: &SolidPart, margin: f32, points: &mut Vec<TouchPoint>) {
    let dispatcher = PolyhedronContacts { units_per_meter: units::PER_METER }.chain(DefaultQueryDispatcher);
    let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
    let pos12 = first.pose.inv_mul(&second.pose);
    if dispatcher.contact_manifolds(&pos12, &*first.shape, &*second.shape, margin, &mut manifolds, &mut None).is_err() {
        return;
    }
    for manifold in &manifolds {
        let frame = manifold.subshape_pos1().map_or(first.pose, |local| first.pose * *local);
        let normal = (frame.rotation * manifold.local_n1).normalize();
        for point in manifold.points.iter().filter(|point| point.dist <= margin) {
            let at = frame * point.local_p1 + normal * (point.dist / 2.0);
            let at = at.to_array().map(units::meters).into();
            let point = TouchPoint { at, normal: unit(normal), gap_m: units::meters(point.dist) };
            match points.iter_mut().find(|other| other.is_same_as(&point)) {
                Some(other) => other.gap_m = other.gap_m.min(point.gap_m),
                None => points.push(point),
            }
        }
    }
}

fn unit(normal: Vector) -> Vector3<f64> {
    Vector3::from(normal.to_array().map(f64::from)).normalize()
}
