//! Forces between bodies at rest.
//!
//! Rigid bodies under gravity: at every point the normal force is at least zero, the relative acceleration along the
//! normal too, and one of both vanishes (Baraff, SIGGRAPH 1994); friction opposes the tangential acceleration, up to
//! its coefficient times the normal force. Solved point by point, again and again (projected Gauss-Seidel).

use super::contact::Contact;
use super::solid::Solid;
use syntable_model::geometry::{Matrix3, Point3, Vector3};
use syntable_model::scene::Scene;

/// A force, N, or an acceleration, m/s², in the world.
pub type Force = Vector3<f64>;

/// Gravitational acceleration, m/s².
const GRAVITY_M_S2: f64 = 9.81;

/// Maximum number of passes over all points.
const MAX_PASSES: usize = 4000;

/// The solution is found when no force changes by more than this fraction of the lightest weight in a pass.
const CONVERGED: f64 = 1e-5;

/// Bodies are at least as thick as this for their inertia, meters.
const THICKNESS_M: f64 = 0.001;

/// A body that forces move.
pub struct Moving {
    kg: f64,
    /// Center of mass, world.
    center: Point3<f64>,
    inverse_inertia: Matrix3<f64>,
    /// Distance of the farthest corner of its box from its center of mass, meters.
    reach_m: f64,
}

impl Moving {
    /// The body of a solid; `None` if it is fixed or has no shape.
    pub fn of(solid: &Solid, scene: &Scene) -> Option<Self> {
        let body = scene.body(solid.id).filter(|_| solid.is_dynamic && !solid.parts.is_empty())?;
        let rotation = body.world_from_body.rotation.to_rotation_matrix();
        // A fixed body may have no mass.
        let kg = if body.mass.is_sound() { body.mass.kg } else { 1.0 };
        let bounds = body.object.mesh.bounds();
        let (center, specific) = if body.mass.is_sound() {
            (body.mass.center, body.mass.specific_inertia)
        } else {
            (bounds.center(), Matrix3::identity() * (bounds.size().norm_squared() / 18.0))
        };
        let inertia = (specific + Matrix3::identity() * (THICKNESS_M * THICKNESS_M / 6.0)) * kg;
        let inverse = rotation * inertia.try_inverse()? * rotation.inverse();
        let reach = bounds.corners().iter().map(|corner| (corner - center).norm()).fold(0.0, f64::max);
        Some(Self { kg, center: body.world_from_body * center, inverse_inertia: inverse, reach_m: reach })
    }

    /// Its weight, N.
    pub fn weight_n(&self) -> f64 {
        self.kg * GRAVITY_M_S2
    }
}

/// Contact forces, and the remaining acceleration by gravity.
pub struct Forces {
    /// For each contact, the forces of the first solid on the second at its points.
    pub of_points: Vec<Vec<Force>>,
    /// Acceleration of each solid: of the center of mass or of the farthest corner, whichever is larger, m/s².
    pub accelerations: Vec<f64>,
}

/// Linear and angular acceleration of a solid.
#[derive(Clone, Copy)]
struct Acceleration {
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

/// A row of the problem: a point, and one direction at it.
struct ForceRow {
    direction: Vector3<f64>,
    /// Acceleration along the direction per force.
    response: f64,
}

/// A point with its three rows: normal and two tangents.
struct ContactProblem {
    solids: [usize; 2],
    arms: [Vector3<f64>; 2],
    rows: [ForceRow; 3],
    friction: f64,
    /// Force along each row.
    force: [f64; 3],
}

impl Forces {
    /// Solves for the forces between solids. Only `moving` solids can accelerate.
    pub fn new(moving: &[Option<Moving>], contacts: &[Contact]) -> Self {
        let mut accelerations: Vec<Acceleration> = moving
            .iter()
            .map(|body| Acceleration {
                linear: body.as_ref().map_or(Vector3::zeros(), |_| Vector3::new(0.0, 0.0, -GRAVITY_M_S2)),
                angular: Vector3::zeros(),
            })
            .collect();
        let mut problems: Vec<ContactProblem> = contacts
            .iter()
            .flat_map(|contact| {
                contact.points.iter().map(|point| ContactProblem::new(contact, point.at, point.normal, moving))
            })
            .collect();
        let lightest = moving.iter().flatten().map(Moving::weight_n).fold(f64::INFINITY, f64::min);
        for _ in 0..MAX_PASSES {
            let changes = problems.iter_mut().map(|problem| problem.solve(moving, &mut accelerations));
            if changes.fold(0.0, f64::max) <= CONVERGED * lightest {
                break;
            }
        }
        let mut solved = problems.iter().map(ContactProblem::force);
        let of_points = contacts.iter().map(|contact| solved.by_ref().take(contact.points.len()).collect()).collect();
        let largest = |(body, of): (&Option<Moving>, &Acceleration)| {
            let reach = body.as_ref().map_or(0.0, |body| body.reach_m);
            of.linear.norm().max(of.angular.norm() * reach)
        };
        Self { of_points, accelerations: moving.iter().zip(&accelerations).map(largest).collect() }
    }
}

impl ContactProblem {
    fn new(contact: &Contact, at: Point3<f64>, normal: Vector3<f64>, moving: &[Option<Moving>]) -> Self {
        let arms = contact.solids.map(|index| moving[index].as_ref().map_or(Vector3::zeros(), |body| at - body.center));
        let least = normal.iamin();
        let tangent = normal.cross(&Vector3::ith(least, 1.0)).normalize();
        let row = |direction: Vector3<f64>| ForceRow {
            direction,
            response: (0..2)
                .filter_map(|side| {
                    let body = moving[contact.solids[side]].as_ref()?;
                    let turn = arms[side].cross(&direction);
                    Some(1.0 / body.kg + turn.dot(&(body.inverse_inertia * turn)))
                })
                .sum(),
        };
        Self {
            solids: contact.solids,
            arms,
            rows: [normal, tangent, normal.cross(&tangent)].map(row),
            friction: contact.friction,
            force: [0.0; 3],
        }
    }

    /// The force on the second solid.
    fn force(&self) -> Force {
        self.rows.iter().zip(self.force).map(|(row, force)| row.direction * force).sum()
    }

    /// Makes this point right, all others staying as they are. Returns the largest change of a force.
    fn solve(&mut self, moving: &[Option<Moving>], accelerations: &mut [Acceleration]) -> f64 {
        let wanted = self.wanted(accelerations, 0).max(0.0);
        let mut change = self.set(0, wanted, moving, accelerations);
        // Both tangents at once, so that the bound of friction is the same in all directions.
        let tangential = [1, 2].map(|row| self.wanted(accelerations, row));
        let norm = (tangential[0] * tangential[0] + tangential[1] * tangential[1]).sqrt();
        let bound = self.friction * self.force[0];
        let scale = if norm > bound { bound / norm } else { 1.0 };
        for (row, force) in (1..).zip(tangential) {
            change = change.max(self.set(row, force * scale, moving, accelerations));
        }
        change
    }

    /// The force along a row that leaves no relative acceleration along it.
    fn wanted(&self, accelerations: &[Acceleration], row: usize) -> f64 {
        let of = |side: usize| {
            let Acceleration { linear, angular } = accelerations[self.solids[side]];
            linear + angular.cross(&self.arms[side])
        };
        let ForceRow { direction, response } = &self.rows[row];
        if *response > 0.0 { self.force[row] - (of(1) - of(0)).dot(direction) / response } else { 0.0 }
    }

    /// Changes the force along a row. Returns by how much.
    fn set(&mut self, row: usize, force: f64, moving: &[Option<Moving>], accelerations: &mut [Acceleration]) -> f64 {
        let change = force - self.force[row];
        self.force[row] = force;
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            let Some(body) = &moving[self.solids[side]] else { continue };
            let force = self.rows[row].direction * (sign * change);
            let acceleration = &mut accelerations[self.solids[side]];
            acceleration.linear += force / body.kg;
            acceleration.angular += body.inverse_inertia * self.arms[side].cross(&force);
        }
        change.abs()
    }
}
