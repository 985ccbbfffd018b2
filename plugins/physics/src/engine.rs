//! The rigid-body engine, as this crate uses it: bodies in, poses and measurements out.
//!
//! Settings that differ from rapier's defaults, each measured on 24 piles of 40 scanned objects:
//! - tolerances for bodies of decimetres (`length_unit = 0.1`): a sixth of the penetration;
//! - one collider per convex part, not one compound per body: merging the contacts of a compound's parts leaves a few
//!   bodies in every pile trembling for good, while single colliders let all of them fall asleep;
//! - contacts twice as stiff (60 Hz), and recomputed after 1 mm of motion rather than 5: half the deep bodies;
//! - speculative contacts up to 2 cm ahead of a moving body, in place of swept collision tests, which computed the mass
//!   properties of every part anew at each step and doubled the time.

use crate::config::{Mass, Rapier};
use crate::depth::depth;
use crate::fixed::Fixed;
use crate::manifold::Polyhedra;
use crate::shape::CollisionShape;
use crate::units;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::{Pose as EnginePose, Vector};
use parry3d::query::{DefaultQueryDispatcher, QueryDispatcher};
use rapier3d::dynamics::{RigidBodyBuilder, RigidBodyHandle};
use rapier3d::geometry::{ColliderBuilder, NarrowPhase};
use rapier3d::pipeline::PhysicsWorld;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Aabb, Point3, Pose};
use syntable_model::scene::BodyDraft;

/// How far ahead of a moving body contacts are sought, metres.
const SPECULATIVE_M: f64 = 0.02;

/// Seconds of stillness after which a body sleeps.
const SLEEP_AFTER_S: f32 = 0.5;

/// Steps between two looks at which bodies have fallen.
const LOOK_EVERY: usize = 8;

/// A dynamic body.
pub struct Item {
    /// Its shape.
    pub shape: Arc<CollisionShape>,
    /// Middle of its bounding box, body frame.
    middle: Point3<f64>,
    mass: f64,
    friction: f32,
    rigid: Option<RigidBodyHandle>,
}

/// Two bodies in each other: an item, and another item or a fixed thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The item with the smaller number.
    pub item: usize,
    /// The other item; none for a support or a part of the room.
    pub other: Option<usize>,
    /// Depth, metres.
    pub depth: f64,
}

/// A simulation of one scene. Items have fixed numbers; one that was taken out keeps its number.
pub struct Engine {
    world: PhysicsWorld,
    items: Vec<Item>,
    fixed: Vec<Fixed>,
    step_s: f64,
    duration_s: f64,
    restitution: f32,
    angular_damping: f32,
}

impl Engine {
    /// An empty world with fixed things in it.
    pub fn new(config: &Rapier, fixed: Vec<Fixed>) -> Self {
        let mut world = PhysicsWorld {
            gravity: Vector::new(0.0, 0.0, -units::length(config.gravity_m_s2)),
            ..PhysicsWorld::default()
        };
        world.narrow_phase = NarrowPhase::with_query_dispatcher(Polyhedra.chain(DefaultQueryDispatcher));
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.time_step_s as f32;
        parameters.length_unit = 0.1 * units::PER_METRE;
        parameters.contact_softness.natural_frequency = 60.0;
        parameters.normalized_contact_recycle_distance = 0.01;
        parameters.max_ccd_substeps = 0;
        for thing in &fixed {
            for (local, part) in thing.parts() {
                let collider = ColliderBuilder::new(part.clone())
                    .position(thing.pose * local)
                    .friction(thing.friction)
                    .restitution(config.restitution as f32);
                world.insert_collider(collider, None);
            }
        }
        Self {
            world,
            items: Vec::new(),
            fixed,
            step_s: config.time_step_s,
            duration_s: config.duration_s,
            restitution: config.restitution as f32,
            angular_damping: config.angular_damping_per_s as f32,
        }
    }

    /// Does work with the engine on a pool of so many threads. Parallel parts of the engine stay inside.
    pub fn on_threads<T: Send>(&mut self, threads: usize, work: impl FnOnce(&mut Self) -> T + Send) -> Result<T> {
        let failed = |error: &dyn std::fmt::Display| Error::new(format!("no thread for the simulation: {error}"));
        self.world.configure_thread_pool(threads).map_err(|error| failed(&error))?;
        let pool = self.world.thread_pool().ok_or_else(|| failed(&"the pool is gone"))?;
        Ok(pool.install(|| work(self)))
    }

    /// Adds a dynamic body at its pose and at rest. Items are numbered from 0.
    pub fn add(&mut self, body: &BodyDraft, shape: Arc<CollisionShape>, mass: Mass) {
        let mass = match mass {
            Mass::Real => body.object.mass_kg,
            Mass::Kg(kg) => kg,
        };
        self.items.push(Item {
            shape,
            middle: body.object.mesh.bounds().centre(),
            mass,
            friction: friction(body.object.friction),
            rigid: None,
        });
        self.put(self.items.len() - 1, &body.world_from_body);
    }

    /// Puts an item at a pose and at rest, whether it was in the world or not.
    pub fn put(&mut self, item: usize, world_from_body: &Pose) {
        self.take(item);
        let Item { shape, mass, friction, .. } = &self.items[item];
        let mut body = RigidBodyBuilder::dynamic()
            .pose(units::pose(world_from_body))
            .additional_mass_properties(shape.with_mass(*mass))
            .angular_damping(self.angular_damping)
            .soft_ccd_prediction(units::length(SPECULATIVE_M))
            .build();
        body.activation_mut().time_until_sleep = SLEEP_AFTER_S;
        let rigid = self.world.insert_body(body);
        for part in &shape.parts {
            let collider =
                ColliderBuilder::new(part.clone()).density(0.0).friction(*friction).restitution(self.restitution);
            self.world.insert_collider(collider, Some(rigid));
        }
        self.items[item].rigid = Some(rigid);
    }

    /// Takes an item out. What it touched wakes up.
    pub fn take(&mut self, item: usize) {
        if let Some(rigid) = self.items[item].rigid.take() {
            self.world.remove_body(rigid);
        }
    }

    /// Numbers of the items that are in the world, in order.
    pub fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.items.len()).filter(|&item| self.items[item].rigid.is_some())
    }

    /// Simulates until everything sleeps or the time is over, and gives the simulated time, s. Items that lie wholly
    /// below `gone_below` are taken out on the way; their numbers are added to `gone`.
    pub fn run(&mut self, gone_below: Option<f64>, gone: &mut Vec<usize>) -> f64 {
        let steps = (self.duration_s / self.step_s).ceil() as usize;
        for step in 1..=steps {
            self.world.step();
            if let Some(height) = gone_below
                && step % LOOK_EVERY == 0
            {
                let below: Vec<usize> = self.present().filter(|&item| self.bounds(item).max.z < height).collect();
                below.iter().for_each(|&item| self.take(item));
                gone.extend(below);
            }
            if self.world.islands.num_active_bodies() == 0 {
                return step as f64 * self.step_s;
            }
        }
        steps as f64 * self.step_s
    }

    /// Whether any item is awake.
    pub fn is_awake(&self) -> bool {
        self.present().any(|item| self.items[item].rigid.is_some_and(|rigid| !self.world.bodies[rigid].is_sleeping()))
    }

    /// Whether an item was stopped because its numbers ran out of range.
    pub fn is_broken(&self, item: usize) -> bool {
        self.items[item].rigid.is_some_and(|rigid| {
            let body = &self.world.bodies[rigid];
            !body.is_enabled() || !body.translation().is_finite()
        })
    }

    /// Pose of an item that is in the world.
    pub fn pose(&self, item: usize) -> Pose {
        units::pose_of(&self.engine_pose(item))
    }

    /// Middle of an item's bounding box, world, metres.
    pub fn middle(&self, item: usize) -> Point3<f64> {
        self.pose(item) * self.items[item].middle
    }

    /// Bounding box of an item's collision shape, world, metres.
    pub fn bounds(&self, item: usize) -> Aabb {
        units::aabb_of(&self.items[item].shape.bounds(&self.engine_pose(item)))
    }

    /// Bounding box that an item would have at a pose, metres.
    pub fn bounds_at(&self, item: usize, world_from_body: &Pose) -> Aabb {
        units::aabb_of(&self.items[item].shape.bounds(&units::pose(world_from_body)))
    }

    /// Speed of an item's centre of mass, m/s, and its angular speed, rad/s.
    pub fn speed_and_spin(&self, item: usize) -> (f64, f64) {
        self.items[item].rigid.map_or((0.0, 0.0), |rigid| {
            let body = &self.world.bodies[rigid];
            (units::metres(body.linvel().length()), f64::from(body.angvel().length()))
        })
    }

    /// All pairs of bodies that are in each other, in order.
    pub fn overlaps(&self) -> Vec<Overlap> {
        let with_bounds = |item: usize| {
            let pose = self.engine_pose(item);
            (item, pose, self.items[item].shape.bounds(&pose))
        };
        let items: Vec<_> = self.present().map(with_bounds).collect();
        let mut overlaps = Vec::new();
        for (place, (item, pose, bounds)) in items.iter().enumerate() {
            let shape = &*self.items[*item].shape.whole;
            let fixed =
                self.fixed.iter().map(|thing| depth(pose, shape, &thing.pose, &*thing.whole)).fold(0.0, f32::max);
            let others = items[place + 1..].iter().filter(|(_, _, other)| bounds.intersects(other)).map(
                |(other, other_pose, _)| {
                    (Some(*other), depth(pose, shape, other_pose, &*self.items[*other].shape.whole))
                },
            );
            overlaps.extend(
                std::iter::once((None, fixed))
                    .chain(others)
                    .filter(|(_, depth)| *depth > 0.0)
                    .map(|(other, depth)| Overlap { item: *item, other, depth: units::metres(depth) }),
            );
        }
        overlaps
    }

    fn engine_pose(&self, item: usize) -> EnginePose {
        self.items[item].rigid.map_or(EnginePose::IDENTITY, |rigid| *self.world.bodies[rigid].position())
    }

    /// Kinetic and potential energy of all items, J.
    #[cfg(test)]
    pub fn energy(&self) -> f64 {
        let gravity = self.world.gravity;
        self.present()
            .filter_map(|item| self.items[item].rigid)
            .map(|rigid| {
                let body = &self.world.bodies[rigid];
                f64::from(body.kinetic_energy() - body.mass() * gravity.dot(body.center_of_mass()))
                    / f64::from(units::PER_METRE).powi(2)
            })
            .sum()
    }

    /// Simulates one step.
    #[cfg(test)]
    pub fn step(&mut self) {
        self.world.step();
    }
}

/// A friction coefficient that the engine can work with.
pub fn friction(coefficient: f64) -> f32 {
    if coefficient.is_finite() { coefficient.clamp(0.0, 10.0) as f32 } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed;
    use crate::hull::Hull;
    use crate::kit;
    use syntable_model::geometry::Translation3;
    use syntable_model::random::Stream;

    fn falling(config: &Rapier, count: usize) -> Engine {
        let mut engine = Engine::new(config, vec![fixed::ground(0.0)]);
        let mut stream = Stream::root(3);
        let shapes: Vec<_> = kit::kit_objects()
            .into_iter()
            .map(|object| {
                let hull = Hull::around(&object.mesh.data().positions).expect("a hull");
                (object, Arc::new(CollisionShape::new(&[hull]).expect("a shape")))
            })
            .collect();
        for i in 0..count {
            let (object, shape) = stream.pick(&shapes).expect("shapes").clone();
            let place = Translation3::new(stream.uniform(-0.1, 0.1), stream.uniform(-0.1, 0.1), 0.2 + 0.15 * i as f64);
            let body = kit::dynamic(&object, Pose::from_parts(place, stream.rotation()));
            engine.add(&body, shape, config.mass);
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
            // Pushing overlapping bodies apart lifts them a little: 0.1 % of the start in one step at most.
            assert!(now <= before + 0.001 * start, "step {step}: {before} J, then {now} J");
            assert!(now <= lowest + 0.01 * start, "step {step}: {now} J after {lowest} J");
            (before, lowest) = (now, lowest.min(now));
        }
        assert!(before < 0.2 * start, "most of it is gone: {before} of {start} J");
    }

    #[test]
    fn mass_is_the_objects_own_or_the_same_for_all() {
        for (mass, wanted) in [(Mass::Real, 0.15), (Mass::Kg(1.0), 1.0)] {
            let engine = falling(&Rapier { mass, ..Rapier::default() }, 3);
            for item in engine.present() {
                // Before the first step the engine has not summed anything up.
                let shape = &engine.items[item].shape;
                assert!((shape.with_mass(engine.items[item].mass).mass() - wanted).abs() < 1e-6);
            }
            // Free fall gives the potential energy m g h back as kinetic energy.
            let mut engine = engine;
            engine.step();
            let weight: f64 = engine.items.iter().map(|item| item.mass).sum();
            let height = |engine: &Engine| {
                let of = |item: usize| {
                    engine.items[item].rigid.map_or(0.0, |r| units::metres(engine.world.bodies[r].center_of_mass().z))
                };
                engine.present().map(of).sum::<f64>() / 3.0
            };
            let potential = weight * 9.81 * height(&engine);
            assert!((engine.energy() / potential - 1.0).abs() < 0.01, "{} J, {potential} J", engine.energy());
        }
    }

    #[test]
    fn overlaps_are_those_of_the_poses() {
        let config = Rapier::default();
        let mut engine = Engine::new(&config, vec![fixed::ground(0.0)]);
        let cube = kit::object("cube", kit::cuboid([0.0; 3], [0.1; 3]), 1.0);
        let hull = Hull::around(&cube.mesh.data().positions).expect("a hull");
        let shape = Arc::new(CollisionShape::new(&[hull]).expect("a shape"));
        for (x, z) in [(0.0, 0.048), (0.093, 0.06), (0.5, 0.06)] {
            engine.add(&kit::dynamic(&cube, kit::at(x, 0.0, z)), shape.clone(), config.mass);
        }
        let overlaps = engine.overlaps();
        let [table, pair] = overlaps[..] else { panic!("{overlaps:?}") };
        assert_eq!((table.item, table.other, pair.item, pair.other), (0, None, 0, Some(1)));
        assert!((table.depth - 0.002).abs() < 1e-5 && (pair.depth - 0.007).abs() < 1e-5, "{overlaps:?}");
        engine.take(0);
        assert_eq!(engine.overlaps(), []);
    }
}
