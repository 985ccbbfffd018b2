//! The rigid-body engine for this crate: bodies in, poses and measurements out.
//!
//! Settings that differ from rapier's defaults, each measured on 24 piles of 40 scanned objects:
//! - tolerances for bodies of decimeters (`length_unit = 0.1`): a sixth of the penetration;
//! - one collider per convex part, not one compound per body: merging the contacts of a compound's parts leaves a few
//!   bodies in every pile jittering forever, while single colliders let all of them fall asleep;
//! - contacts twice as stiff (60 Hz), and recomputed after 1 mm of motion instead of 5 mm: half as many deep
//!   penetrations;
//! - rolling resistance, which rapier lacks: without it, some round bodies keep rocking on the faces of their shapes,
//!   and some piles take several times as long;
//! - speculative contacts up to 2 cm ahead of a moving body, instead of continuous collision detection, which
//!   recomputes the mass properties of every part at each step and takes twice as long.

use crate::collision_shape::CollisionShape;
use crate::options::Rapier;
use crate::static_body::StaticBody;
use crate::units;
use crate::units::friction;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::mass_properties::MassProperties;
use parry3d::math::{Pose as EnginePose, Vector};
use parry3d::query::{DefaultQueryDispatcher, QueryDispatcher, Ray};
use parry3d::shape::SharedShape;
use rapier3d::dynamics::{RigidBodyBuilder, RigidBodyHandle};
use rapier3d::geometry::{ColliderBuilder, NarrowPhase};
use rapier3d::pipeline::PhysicsWorld;
use std::sync::Arc;
use syntable_convex::{PolyhedronContacts, Wall, penetration_depth};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Aabb, Point3, Pose};
use syntable_model::scene::{BodyDraft, MassProperties as BodyMass, Region};

/// Minimum distance ahead of a moving body at which contacts are predicted, meters.
const SPECULATIVE_M: f64 = 0.02;

/// Speed of a body after a fall of one meter, m/s. Contacts within a time step at this speed are predicted, so that
/// bodies do not tunnel.
const FALLING_M_S: f64 = 4.5;

/// Bodies that are faster fall rather than roll, m/s.
const ROLLING_M_S: f64 = 0.5;

/// Seconds of stillness after which a body sleeps.
const SLEEP_AFTER_S: f32 = 0.5;

/// Maximum distance ahead of a body at which contacts are predicted, for a time step, engine units.
fn speculative(step_s: f64) -> f32 {
    units::length(SPECULATIVE_M.max(FALLING_M_S * step_s))
}

/// A body that started less than this ago may be slow in the air, seconds.
const START_S: f64 = 0.08;

/// Points along each edge of a region at which the height of a pile is measured.
const LEVEL_POINTS: usize = 16;

/// Steps between two checks for bodies that have fallen off.
const FALL_CHECK_STEPS: usize = 8;

/// A dynamic body.
pub struct DynamicBody {
    /// Its shape.
    pub shape: Arc<CollisionShape>,
    /// Center of its bounding box, body frame.
    center: Point3<f64>,
    mass: MassProperties,
    /// Angular deceleration by rolling resistance, rad/s².
    rolling_rad_s2: f32,
    friction: f32,
    restitution: Option<f32>,
    rigid: Option<RigidBodyHandle>,
    /// Number of the step at which the body was last put into the world.
    put_at: usize,
}

/// Two penetrating bodies: a dynamic one, and another dynamic or a static one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The dynamic body with the smaller index.
    pub body: usize,
    /// The other dynamic body; `None` for a support or a part of the room.
    pub other: Option<usize>,
    /// Penetration depth, meters.
    pub depth: f64,
}

/// A simulation of one scene. Dynamic bodies are named by indices from 0; a removed body keeps its index.
pub struct Engine {
    world: PhysicsWorld,
    bodies: Vec<DynamicBody>,
    static_bodies: Vec<StaticBody>,
    step_s: f64,
    restitution: f32,
    angular_damping: f32,
    /// Gravity times the coefficient of rolling resistance, m/s².
    rolling_m_s2: f64,
    /// Number of steps so far.
    steps: usize,
}

impl Engine {
    /// A world with static bodies only.
    pub fn new(config: &Rapier, static_bodies: Vec<StaticBody>) -> Self {
        let mut world = PhysicsWorld {
            gravity: Vector::new(0.0, 0.0, -units::length(config.gravity_m_s2)),
            ..PhysicsWorld::default()
        };
        let contacts = PolyhedronContacts { units_per_meter: units::PER_METER };
        world.narrow_phase = NarrowPhase::with_query_dispatcher(contacts.chain(DefaultQueryDispatcher));
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.time_step_s as f32;
        parameters.length_unit = 0.1 * units::PER_METER;
        parameters.contact_softness.natural_frequency = 60.0;
        parameters.normalized_contact_recycle_distance = 0.01;
        parameters.max_ccd_substeps = 0;
        for body in &static_bodies {
            for (local, part) in body.parts() {
                let part = match part.as_halfspace() {
                    Some(half_space) => SharedShape::new(Wall::new(*half_space, 2.0 * speculative(config.time_step_s))),
                    None => part,
                };
                let collider = ColliderBuilder::new(part)
                    .position(body.pose * local)
                    .friction(body.friction)
                    .restitution(config.restitution as f32);
                world.insert_collider(collider, None);
            }
        }
        Self {
            world,
            bodies: Vec::new(),
            static_bodies,
            step_s: config.time_step_s,
            restitution: config.restitution as f32,
            angular_damping: config.angular_damping_per_s as f32,
            rolling_m_s2: config.rolling_resistance * config.gravity_m_s2,
            steps: 0,
        }
    }

    /// Runs `work` with the engine on a pool of `threads` threads. Parallel parts of the engine stay inside.
    pub fn on_threads<T: Send>(&mut self, threads: usize, work: impl FnOnce(&mut Self) -> T + Send) -> Result<T> {
        let failed = |error: &dyn std::fmt::Display| Error::new(format!("no thread for the simulation: {error}"));
        self.world.configure_thread_pool(threads).map_err(|error| failed(&error))?;
        let pool = self.world.thread_pool().ok_or_else(|| failed(&"the pool is gone"))?;
        Ok(pool.install(|| work(self)))
    }

    /// Adds a dynamic body at its pose and at rest.
    pub fn add(&mut self, body: &BodyDraft, shape: Arc<CollisionShape>) {
        self.bodies.push(DynamicBody {
            shape,
            center: body.object.mesh.bounds().center(),
            mass: units::mass(&body.mass),
            rolling_rad_s2: self.rolling_deceleration(&body.mass),
            friction: friction(body.friction),
            restitution: body.restitution.map(|restitution| restitution as f32),
            rigid: None,
            put_at: 0,
        });
        self.put(self.bodies.len() - 1, &body.world_from_body);
    }

    /// The torque of rolling resistance is the coefficient times weight and radius, with the radius of a ball that has
    /// the body's mean moment of inertia, 2/5 m r².
    fn rolling_deceleration(&self, mass: &BodyMass) -> f32 {
        let radius = (mass.inertia().trace() / 3.0 / mass.kg / 0.4).sqrt();
        let deceleration = self.rolling_m_s2 / (0.4 * radius);
        if deceleration.is_finite() { deceleration as f32 } else { 0.0 }
    }

    /// Puts a body at a pose and at rest, whether it was in the world or not.
    pub fn put(&mut self, index: usize, world_from_body: &Pose) {
        self.take(index);
        let DynamicBody { shape, mass, friction, restitution, .. } = &self.bodies[index];
        let restitution = restitution.unwrap_or(self.restitution);
        let mut body = RigidBodyBuilder::dynamic()
            .pose(units::pose(world_from_body))
            .additional_mass_properties(*mass)
            .angular_damping(self.angular_damping)
            .soft_ccd_prediction(speculative(self.step_s))
            .build();
        body.activation_mut().time_until_sleep = SLEEP_AFTER_S;
        let rigid = self.world.insert_body(body);
        for part in &shape.parts {
            let collider = ColliderBuilder::new(part.clone()).density(0.0).friction(*friction).restitution(restitution);
            self.world.insert_collider(collider, Some(rigid));
        }
        self.bodies[index].rigid = Some(rigid);
        self.bodies[index].put_at = self.steps;
    }

    /// Takes a body out of the world. Bodies that it touched wake up.
    pub fn take(&mut self, index: usize) {
        if let Some(rigid) = self.bodies[index].rigid.take() {
            self.world.remove_body(rigid);
        }
    }

    /// Indices of the bodies that are in the world, in order.
    pub fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.bodies.len()).filter(|&body| self.bodies[body].rigid.is_some())
    }

    /// Simulates one step.
    fn step(&mut self) {
        self.world.step();
        self.steps += 1;
        let slow = units::length(ROLLING_M_S);
        for body in &self.bodies {
            let Some(handle) = body.rigid else { continue };
            let rigid = &self.world.bodies[handle];
            let (spin, decelerated) = (rigid.angvel(), body.rolling_rad_s2 * self.step_s as f32);
            // The engine looks again at every body that was borrowed for a change.
            if !rigid.is_sleeping() && rigid.linvel().length() < slow && spin != Vector::ZERO {
                let spin = spin * (1.0 - decelerated / spin.length()).max(0.0);
                self.world.bodies[handle].set_angvel(spin, false);
            }
        }
    }

    /// Simulates until all bodies sleep or `duration_s` is over. Returns the simulated time, s. Takes out bodies for
    /// which `has_fallen` returns `true`, given index and bounding box, and adds their indices to `fallen`.
    pub fn run(
        &mut self,
        duration_s: f64,
        has_fallen: impl Fn(usize, &Aabb) -> bool,
        fallen: &mut Vec<usize>,
        workers: &dyn Workers,
    ) -> f64 {
        let steps = (duration_s / self.step_s).ceil() as usize;
        for step in 1..=steps {
            workers.check_stop();
            self.step();
            if step % FALL_CHECK_STEPS == 0 {
                let below: Vec<usize> = self.present().filter(|&body| has_fallen(body, &self.bounds(body))).collect();
                below.iter().for_each(|&body| self.take(body));
                fallen.extend(below);
            }
            if self.world.islands.num_active_bodies() == 0 {
                return step as f64 * self.step_s;
            }
        }
        steps as f64 * self.step_s
    }

    /// Whether any body is awake.
    pub fn is_awake(&self) -> bool {
        self.present().any(|body| self.bodies[body].rigid.is_some_and(|rigid| !self.world.bodies[rigid].is_sleeping()))
    }

    /// Whether the engine disabled a body, or its position is not finite.
    pub fn is_broken(&self, index: usize) -> bool {
        self.bodies[index].rigid.is_some_and(|rigid| {
            let body = &self.world.bodies[rigid];
            !body.is_enabled() || !body.translation().is_finite()
        })
    }

    /// Pose of a body that is in the world.
    pub fn pose(&self, index: usize) -> Pose {
        units::pose_of(&self.engine_pose(index))
    }

    /// Center of a body's bounding box, world, meters.
    pub fn center(&self, index: usize) -> Point3<f64> {
        self.pose(index) * self.bodies[index].center
    }

    /// Bounding box of a body's collision shape, world, meters.
    pub fn bounds(&self, index: usize) -> Aabb {
        units::aabb_of(&self.bodies[index].shape.bounds(&self.engine_pose(index)))
    }

    /// Bounding box that a body would have at a pose, meters.
    pub fn bounds_at(&self, index: usize, world_from_body: &Pose) -> Aabb {
        units::aabb_of(&self.bodies[index].shape.bounds(&units::pose(world_from_body)))
    }

    /// Speed of a body's center of mass, m/s, and its angular speed, rad/s.
    pub fn speeds(&self, index: usize) -> (f64, f64) {
        self.bodies[index].rigid.map_or((0.0, 0.0), |rigid| {
            let body = &self.world.bodies[rigid];
            (units::meters(body.linvel().length()), f64::from(body.angvel().length()))
        })
    }

    /// Mean height of bodies above a region, meters: of the highest point of any of them over each point of a grid, 0 without a body.
    /// Bodies that fall, or have just started, do not count.
    pub fn mean_height(&self, bodies: impl Iterator<Item = usize>, region: &Region) -> f64 {
        let is_new = |body: usize| ((self.steps - self.bodies[body].put_at) as f64) * self.step_s < START_S;
        let resting = bodies.filter(|&body| self.speeds(body).0 < ROLLING_M_S && !is_new(body));
        let resting: Vec<_> = resting.map(|body| (body, self.engine_pose(body), self.bounds(body))).collect();
        let highest = resting.iter().map(|(.., bounds)| bounds.max.z).fold(region.height(), f64::max) + 0.01;
        let at = |i: usize, edge: usize| ((i as f64 + 0.5) / LEVEL_POINTS as f64 - 0.5) * region.edges()[edge];
        let mut sum = 0.0;
        for i in 0..LEVEL_POINTS {
            for k in 0..LEVEL_POINTS {
                let mut from = region.point([at(i, 0), at(k, 1)]);
                from.z = highest;
                let ray = Ray::new(units::point(&from), -Vector::Z);
                let is_below = |bounds: &Aabb| (0..2).all(|k| bounds.min[k] <= from[k] && from[k] <= bounds.max[k]);
                let hits = resting
                    .iter()
                    .filter(|(.., bounds)| is_below(bounds))
                    .filter_map(|(body, pose, _)| self.bodies[*body].shape.whole.cast_ray(pose, &ray, f32::MAX, true));
                let nearest = hits.reduce(f32::min).map_or(f64::INFINITY, units::meters);
                sum += (highest - nearest - region.height()).max(0.0);
            }
        }
        sum / (LEVEL_POINTS * LEVEL_POINTS) as f64
    }

    /// All pairs of penetrating bodies, in order. The deepest static body represents all static ones.
    pub fn overlaps(&self) -> Vec<Overlap> {
        let with_bounds = |body: usize| {
            let pose = self.engine_pose(body);
            (body, pose, self.bodies[body].shape.bounds(&pose))
        };
        let bodies: Vec<_> = self.present().map(with_bounds).collect();
        let mut overlaps = Vec::new();
        for (i, (body, pose, bounds)) in bodies.iter().enumerate() {
            let shape = &*self.bodies[*body].shape.whole;
            let depths =
                self.static_bodies.iter().map(|other| penetration_depth(pose, shape, &other.pose, &*other.whole));
            let deepest_static = depths.fold(0.0, f32::max);
            let others = bodies[i + 1..].iter().filter(|(_, _, other)| bounds.intersects(other)).map(
                |(other, other_pose, _)| {
                    (Some(*other), penetration_depth(pose, shape, other_pose, &*self.bodies[*other].shape.whole))
                },
            );
            overlaps.extend(
                std::iter::once((None, deepest_static))
                    .chain(others)
                    .filter(|(_, depth)| *depth > 0.0)
                    .map(|(other, depth)| Overlap { body: *body, other, depth: units::meters(depth) }),
            );
        }
        overlaps
    }

    fn engine_pose(&self, index: usize) -> EnginePose {
        self.bodies[index].rigid.map_or(EnginePose::IDENTITY, |rigid| *self.world.bodies[rigid].position())
    }

    /// Kinetic and potential energy of all bodies, J.
    #[cfg(test)]
    pub fn energy(&self) -> f64 {
        let gravity = self.world.gravity;
        self.present()
            .filter_map(|body| self.bodies[body].rigid)
            .map(|rigid| {
                let body = &self.world.bodies[rigid];
                f64::from(body.kinetic_energy() - body.mass() * gravity.dot(body.center_of_mass()))
                    / f64::from(units::PER_METER).powi(2)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kit;
    use crate::static_body;
    use syntable_model::geometry::Translation3;
    use syntable_model::random::Stream;

    fn shape_of(hull: syntable_convex::ConvexHull) -> CollisionShape {
        CollisionShape::new(&crate::decompose::ConvexParts { hulls: vec![hull], deviation_m: 0.0 }).expect("a shape")
    }

    fn falling(config: &Rapier, count: usize) -> Engine {
        let mut engine = Engine::new(config, vec![static_body::ground(0.0)]);
        let mut stream = Stream::root(3);
        let shapes: Vec<_> = kit::kit_objects()
            .into_iter()
            .map(|object| {
                let hull = units::hull(&object.mesh.data().positions).expect("a hull");
                (object, Arc::new(shape_of(hull)))
            })
            .collect();
        for i in 0..count {
            let (object, shape) = stream.pick(&shapes).expect("shapes").clone();
            let place = Translation3::new(stream.uniform(-0.1, 0.1), stream.uniform(-0.1, 0.1), 0.2 + 0.15 * i as f64);
            let body = kit::dynamic(&object, Pose::from_parts(place, stream.rotation()));
            engine.add(&body, shape);
        }
        engine
    }

    #[test]
    fn energy_does_not_grow() {
        let mut engine = falling(&Rapier::default(), 12);
        engine.step();
        let start = engine.energy();
        let (mut lowest, mut before) = (start, start);
        for step in 0..1200 {
            engine.step();
            let now = engine.energy();
            // Pushing penetrating bodies apart lifts them slightly: 0.1 % of the start in one step at most.
            assert!(now <= before + 0.001 * start, "step {step}: {before} J, then {now} J");
            assert!(now <= lowest + 0.01 * start, "step {step}: {now} J after {lowest} J");
            (before, lowest) = (now, lowest.min(now));
        }
        assert!(before < 0.2 * start, "most of it is gone: {before} of {start} J");
    }

    #[test]
    fn a_fall_has_the_energy_of_the_objects_masses() {
        let mut engine = falling(&Rapier::default(), 3);
        // Before the first step the engine has not computed any masses.
        engine.step();
        // In free fall, the potential energy m g h becomes kinetic energy.
        let height = |body: usize| {
            engine.bodies[body].rigid.map_or(0.0, |r| units::meters(engine.world.bodies[r].center_of_mass().z))
        };
        let potential: f64 = engine.present().map(|body| 0.15 * 9.81 * height(body)).sum();
        assert!((engine.energy() / potential - 1.0).abs() < 0.01, "{} J, {potential} J", engine.energy());
    }

    #[test]
    fn a_body_turns_about_its_center_of_mass_with_its_inertia() {
        // A bar with its mass far off the middle of its collision shape, like a hammer.
        let object = kit::object("bar", kit::cuboid([0.0; 3], [0.3, 0.03, 0.03]), 1.0);
        let hull = units::hull(&object.mesh.data().positions).expect("a hull");
        let shape = Arc::new(shape_of(hull));
        let mut engine = Engine::new(&Rapier { angular_damping_per_s: 0.0, ..Rapier::default() }, Vec::new());
        let mut body = kit::dynamic(&object, kit::at(0.0, 0.0, 1.0));
        body.mass.center.x = 0.12;
        engine.add(&body, shape);
        engine.step();
        let rigid = engine.bodies[0].rigid.expect("in the world");
        let inertia = body.mass.inertia();
        let rigid = &engine.world.bodies[rigid];
        assert!((units::meters(rigid.center_of_mass().x) - 0.12).abs() < 1e-6);
        let found = rigid.mass_properties().local_mprops.principal_inertia() / units::PER_METER.powi(2);
        let mut found = found.to_array().map(f64::from);
        found.sort_by(f64::total_cmp);
        for (found, wanted) in found.iter().zip([inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]]) {
            assert!((found / wanted - 1.0).abs() < 2e-3, "{found}, not {wanted}");
        }
    }

    #[test]
    fn a_ball_slows_down_by_rolling_resistance() {
        let ball = kit::object("ball", kit::sphere(0.03), 0.1);
        let hull = units::hull(&ball.mesh.data().positions).expect("a hull");
        let config = Rapier { angular_damping_per_s: 0.0, rolling_resistance: 0.02, ..Rapier::default() };
        let mut engine = Engine::new(&config, Vec::new());
        engine.add(&kit::dynamic(&ball, kit::at(0.0, 0.0, 1.0)), Arc::new(shape_of(hull)));
        let rigid = engine.bodies[0].rigid.expect("in the world");
        engine.world.bodies[rigid].set_angvel(Vector::new(0.0, 3.0, 4.0), true);
        (0..10).for_each(|_| engine.step());
        // Torque μ m g r over the moment of inertia 2/5 m r²; the ball is a polyhedron of 1 % less.
        let expected = 5.0 - 0.02 * 9.81 / (0.4 * 0.03) * 10.0 / 240.0;
        let (_, found) = engine.speeds(0);
        assert!((found - expected).abs() < 0.015, "{found} rad/s, not {expected}");
        assert!((engine.world.bodies[rigid].angvel().normalize() - Vector::new(0.0, 0.6, 0.8)).length() < 1e-3);
    }

    #[test]
    fn overlaps_match_the_poses() {
        let config = Rapier::default();
        let mut engine = Engine::new(&config, vec![static_body::ground(0.0)]);
        let cube = kit::object("cube", kit::cuboid([0.0; 3], [0.1; 3]), 1.0);
        let hull = units::hull(&cube.mesh.data().positions).expect("a hull");
        let shape = Arc::new(shape_of(hull));
        for (x, z) in [(0.0, 0.048), (0.093, 0.06), (0.5, 0.06)] {
            engine.add(&kit::dynamic(&cube, kit::at(x, 0.0, z)), shape.clone());
        }
        let overlaps = engine.overlaps();
        let [table, pair] = overlaps[..] else { panic!("{overlaps:?}") };
        assert_eq!((table.body, table.other, pair.body, pair.other), (0, None, 0, Some(1)));
        assert!((table.depth - 0.002).abs() < 1e-5 && (pair.depth - 0.007).abs() < 1e-5, "{overlaps:?}");
        engine.take(0);
        assert_eq!(engine.overlaps(), []);
    }
}
