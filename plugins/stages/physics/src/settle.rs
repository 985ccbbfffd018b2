//! The stage: moves the bodies of a scene to their poses at rest.

use crate::acceptance::{Acceptance, AcceptanceOutcome, AcceptanceRegion, BodyInfo};
use crate::collision_shape::CollisionShape;
use crate::engine::Engine;
use crate::hull_cache::{HullCache, Purpose};
use crate::options::{Collision, Mass, Rapier, Remove};
use crate::static_body::{self, SupportSurface, is_dynamic};
use crate::units::HULL_OPTIONS;
use syntable_model::context::{Context, Log};
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Pose};
use syntable_model::scene::{
    BodyDraft, BodyHandle, DropZone, Object, Removal, Role, SceneBuilder, SettleReport, Support,
};
use syntable_model::stage::Settler;

/// The settler of the kind `rapier`.
pub struct Settle {
    config: Rapier,
    hull_cache: HullCache,
    threads: usize,
}

impl Settle {
    /// A settler that simulates each scene on one thread: scenes run in parallel.
    pub fn new(config: Rapier) -> Self {
        Self { hull_cache: HullCache::new(&config), config, threads: 1 }
    }

    /// The same with more threads per scene.
    #[cfg(test)]
    pub fn with_threads(config: Rapier, threads: usize) -> Self {
        Self { threads, ..Self::new(config) }
    }
}

impl Settler for Settle {
    fn settle(&self, scene: &mut SceneBuilder, context: &Context) -> Result<SettleReport> {
        if self.config.remove == Remove::OffTabletop {
            scene.support(None)?;
        }
        let supports = scene.supports.clone();
        for (_, body) in scene.bodies() {
            check(body, self.config.mass).map_err(|error| error.context(body.asset.to_string()))?;
        }
        if let Mass::Kg(kg) = self.config.mass {
            let dynamic: Vec<BodyHandle> =
                scene.bodies().filter(|(_, body)| is_dynamic(body)).map(|(handle, _)| handle).collect();
            dynamic.into_iter().for_each(|handle| scene.assign_mass(handle, kg));
        }
        let bodies: Vec<(BodyHandle, BodyDraft)> =
            scene.bodies().map(|(handle, body)| (handle, body.clone())).collect();
        let is_room = |body: &BodyDraft| body.role == Role::Room && !is_dynamic(body);
        let shaped: Vec<&(BodyHandle, BodyDraft)> = bodies.iter().filter(|(_, body)| !is_room(body)).collect();
        let purpose = |body: &BodyDraft| static_body::purpose(body, &supports);
        let objects: Vec<(&Object, Purpose)> = shaped.iter().map(|(_, body)| (&*body.object, purpose(body))).collect();
        let surface =
            SupportSurface::new(shaped.iter().map(|(_, body)| body).filter(|body| body.role == Role::Support));
        let shapes = self.hull_cache.shapes(&objects, context.cache, context.workers, context.log);

        // Positions of objects: no wall may be between them and the supports.
        let inside: Vec<Point3<f64>> = bodies
            .iter()
            .filter(|(_, body)| is_dynamic(body))
            .map(|(_, body)| body.world_bounds().center())
            .chain(supports.iter().map(Support::center))
            .collect();
        let mut static_bodies = Vec::new();
        for (_, body) in bodies.iter().filter(|(_, body)| is_room(body)) {
            match static_body::room_part(body, &inside) {
                Some(part) => static_bodies.push(part),
                None => context.log.warn(
                    &Error::new("no collision shape can be made of its mesh, so that objects pass through it")
                        .context(body.asset.to_string()),
                ),
            }
        }
        let mut dynamic = Vec::new();
        for ((handle, body), shape) in shaped.into_iter().zip(shapes) {
            let shape = shape.map_err(|error| error.context(body.asset.to_string()))?;
            self.warn_of_filled_hollows(body, purpose(body), &shape, context.log);
            if is_dynamic(body) {
                dynamic.push((*handle, body, shape));
            } else {
                static_bodies.extend(static_body::support(body, &shape, &supports, &surface));
            }
        }
        static_bodies.push(static_body::ground(0.0));

        let infos: Vec<BodyInfo> = dynamic
            .iter()
            .map(|(handle, body, _)| BodyInfo {
                role: body.role,
                spawn: body.spawn,
                name: body.asset.to_string(),
                start: body.world_from_body,
                place: scene.drop_zone(*handle).map(|zone| place(scene, zone)),
            })
            .collect();
        let mut engine = Engine::new(&self.config, static_bodies);
        for (_, body, shape) in &dynamic {
            engine.add(body, shape.clone());
        }
        let (AcceptanceOutcome { report, removed, spare }, poses) = engine.on_threads(self.threads, |engine| {
            let acceptance = Acceptance::new(&self.config, engine, &infos, &surface, context.workers);
            let outcome = acceptance.run(&context.stream);
            let poses: Vec<(usize, Pose)> = engine.present().map(|body| (body, engine.pose(body))).collect();
            (outcome, poses)
        })?;

        for (index, pose) in poses {
            scene.set_pose(dynamic[index].0, pose);
        }
        let mut report = report;
        let is_gone = |i: &usize| removed.iter().any(|(index, _)| index == i) || spare.contains(i);
        let deviations = (0..dynamic.len()).filter(|i| !is_gone(i));
        report.collision_deviation_m = deviations.map(|i| f64::from(dynamic[i].2.deviation_m)).fold(0.0, f64::max);
        report.spare = spare.len() as u32;
        for index in spare {
            scene.remove(dynamic[index].0);
        }
        for (index, reason) in removed {
            let (handle, body, _) = &dynamic[index];
            scene.remove(*handle);
            if body.role != Role::Object {
                report.removed_distractors += 1;
                continue;
            }
            report.removed.push(Removal { spawn: body.spawn, asset: body.asset.clone(), reason });
        }
        report.removed.sort_by_key(|removal| removal.spawn);
        Ok(report)
    }
}

impl Settle {
    /// Warns once about an object whose convex parts fill its hollows more than permitted.
    fn warn_of_filled_hollows(&self, body: &BodyDraft, purpose: Purpose, shape: &CollisionShape, log: &dyn Log) {
        let (bound, is) = (f64::from(purpose.max_deviation_m(&self.config)), f64::from(shape.deviation_m));
        // Within the tolerance of hulls.
        let is_within = is <= bound + f64::from(HULL_OPTIONS.tolerance);
        if self.config.collision == Collision::Decomposition && !is_within && shape.is_first_time() {
            let (is, bound) = (is * 1e3, bound * 1e3);
            log.warn(
                &Error::new(format!("its collision shape fills hollows by up to {is:.1} mm, not {bound:.1} mm"))
                    .help("raise `max_parts` or `max_deviation_m` of [settle], or repair a mesh that has no inside")
                    .context(body.asset.to_string()),
            );
        }
    }
}

/// Region in which a body of a drop zone is accepted.
fn place(scene: &SceneBuilder, zone: DropZone) -> AcceptanceRegion {
    let (ceiling_m, has_floor) = (scene.ceiling_height(&zone.support), scene.has_floor(&zone.support));
    AcceptanceRegion { zone, ceiling_m, has_floor }
}

/// Refuses bodies that cannot be simulated.
fn check(body: &BodyDraft, mass: Mass) -> Result<()> {
    let pose = &body.world_from_body;
    if !pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite()) {
        return Err(Error::unlucky("its start pose is not finite"));
    }
    let kg = body.mass.kg;
    if is_dynamic(body) && mass == Mass::Real && !body.mass.is_sound() {
        return Err(Error::unlucky(format!("its mass is {kg} kg"))
            .help("give it a mass with `mass` or `properties` of its pool, or set `mass` in [settle]"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kit::*;
    use syntable_model::context::NoCache;

    #[test]
    fn one_thread_or_two_give_the_same_bits() {
        let settled = |threads: usize| {
            let mut scene = table_scene();
            drop_objects(&mut scene, &kit_objects(), 16, 7);
            let settler = Settle::with_threads(Rapier::default(), threads);
            let report = settle_with(&settler, &mut scene, &NoCache).expect("settles");
            (pose_bits(&scene), report)
        };
        assert_eq!(settled(1), settled(2));
    }
}
