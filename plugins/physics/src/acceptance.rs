//! The acceptance check: which bodies violate a limit at rest, and what happens to them.

use crate::engine::{Engine, Overlap};
use crate::rapier::{OnViolation, Rapier, Remove};
use syntable_model::geometry::{Aabb, Point3, Pose, Translation3, Vector3};
use syntable_model::random::Stream;
use syntable_model::scene::{Role, SettleReport, Tabletop};

/// A respawned body starts this far above whatever is below it, meters.
const RESPAWN_CLEARANCE_M: f64 = 0.03;

/// After this many times `duration_s` of simulated time, no body is respawned any more.
const MAX_DURATIONS: f64 = 10.0;

/// Name of the random stream of respawn poses. It is part of the output: another name gives other datasets.
const RESPAWN_STREAM: &str = "drop_again";

/// What the acceptance check must know of a body.
pub struct BodyInfo {
    /// Its role; only objects are removed.
    pub role: Role,
    /// Number in spawn order: keys its random stream.
    pub spawn: u32,
    /// Name, for reasons of removal.
    pub name: String,
}

/// The outcome: the figures of the report, and the bodies that were removed, by index.
pub struct Outcome {
    /// Everything but `removed`.
    pub report: SettleReport,
    /// Removed bodies and the reason of each.
    pub removed: Vec<(usize, String)>,
}

/// A body that violates a limit.
struct Violator {
    body: usize,
    reason: String,
}

/// Lets the bodies of an engine come to rest and removes those that are not accepted.
pub struct Acceptance<'a> {
    config: &'a Rapier,
    engine: &'a mut Engine,
    infos: &'a [BodyInfo],
    tabletop: Option<Tabletop>,
    respawns: Vec<u32>,
    removed: Vec<(usize, String)>,
    simulated_s: f64,
    report: SettleReport,
}

impl<'a> Acceptance<'a> {
    /// A check of bodies that have just been added. Bodies are respawned above `tabletop`, and must be above it if
    /// those off it are removed.
    pub fn new(config: &'a Rapier, engine: &'a mut Engine, infos: &'a [BodyInfo], tabletop: Option<Tabletop>) -> Self {
        let respawns = vec![0; infos.len()];
        Self {
            config,
            engine,
            infos,
            tabletop,
            respawns,
            removed: Vec::new(),
            simulated_s: 0.0,
            report: SettleReport::default(),
        }
    }

    /// Simulates and checks, again and again, until no body violates a limit.
    pub fn run(mut self, stream: &Stream) -> Outcome {
        self.simulate();
        loop {
            if self.remove_off_tabletop() && self.config.on_violation != OnViolation::Keep && self.engine.is_awake() {
                self.simulate();
                continue;
            }
            let overlaps = self.engine.overlaps();
            let mut violators = self.violators(&overlaps);
            if self.config.on_violation == OnViolation::Keep {
                // A body without a finite pose cannot stay even then.
                violators.retain(|violator| self.engine.is_broken(violator.body));
            }
            if violators.is_empty() {
                return self.finish(&overlaps);
            }
            self.handle(violators, stream);
            self.simulate();
        }
    }

    fn simulate(&mut self) {
        let objects_only = self.infos.iter().all(|info| info.role == Role::Object);
        let floor = self.tabletop.filter(|_| objects_only && self.config.remove == Remove::OffTabletop);
        let mut fallen = Vec::new();
        let time = self.engine.run(floor.map(|tabletop| tabletop.height()), &mut fallen);
        self.removed.extend(fallen.into_iter().map(|body| (body, "fell off the table".to_owned())));
        self.simulated_s += time;
        self.report.simulated_s = self.report.simulated_s.max(time);
    }

    /// Removes objects whose center is off the tabletop. Returns whether there were any.
    fn remove_off_tabletop(&mut self) -> bool {
        let (Remove::OffTabletop, Some(tabletop)) = (self.config.remove, self.tabletop) else { return false };
        let off: Vec<usize> = self
            .objects()
            .filter(|&body| !self.engine.is_broken(body) && !tabletop.column_contains(&self.engine.center(body)))
            .collect();
        for &body in &off {
            let fell = self.engine.center(body).z < tabletop.height();
            self.remove(body, if fell { "fell off the table" } else { "beyond the edge of the table" }.to_owned());
        }
        !off.is_empty()
    }

    /// Objects that violate a limit, in the order of their indices.
    fn violators(&self, overlaps: &[Overlap]) -> Vec<Violator> {
        let mut violators: Vec<Violator> = Vec::new();
        for body in self.objects() {
            let (speed, angular_speed) = self.engine.speeds(body);
            if self.engine.is_broken(body) {
                violators.push(Violator { body, reason: "its motion left the range of numbers".to_owned() });
            } else if speed > self.config.max_speed_m_s {
                violators.push(Violator { body, reason: format!("still moving at {speed:.3} m/s") });
            } else if angular_speed > self.config.max_angular_speed_rad_s {
                violators.push(Violator { body, reason: format!("still turning at {angular_speed:.3} rad/s") });
            }
        }
        let is_violator = |violators: &[Violator], body: usize| violators.iter().any(|violator| violator.body == body);
        // Of two penetrating bodies only one has to go: the one with more such pairs, else the upper one.
        let mut pairs: Vec<&Overlap> =
            overlaps.iter().filter(|overlap| overlap.depth > self.config.max_penetration_m).collect();
        loop {
            pairs.retain(|pair| {
                !is_violator(&violators, pair.body) && pair.other.is_none_or(|other| !is_violator(&violators, other))
            });
            let rank = |body: usize| {
                let count = pairs.iter().filter(|pair| pair.body == body || pair.other == Some(body)).count();
                (count, self.engine.center(body).z, body)
            };
            let worst = pairs
                .iter()
                .flat_map(|pair| [Some(pair.body), pair.other])
                .flatten()
                .filter(|&body| self.infos[body].role == Role::Object)
                .map(rank)
                .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            let Some((_, _, body)) = worst else { break };
            let deepest = pairs
                .iter()
                .filter(|pair| pair.body == body || pair.other == Some(body))
                .max_by(|a, b| a.depth.total_cmp(&b.depth));
            if let Some(pair) = deepest {
                let other = if pair.body == body { pair.other } else { Some(pair.body) };
                let what = other.map_or("the table or the room", |other| &self.infos[other].name);
                violators.push(Violator { body, reason: format!("{:.1} mm deep in {what}", pair.depth * 1e3) });
            }
        }
        violators.sort_by_key(|violator| violator.body);
        violators
    }

    /// Respawns every violator, or removes it if it has used up its respawns.
    fn handle(&mut self, violators: Vec<Violator>, stream: &Stream) {
        let in_time = self.simulated_s < MAX_DURATIONS * self.config.duration_s;
        let mut respawned = Vec::new();
        for Violator { body, reason } in violators {
            let may_respawn = self.config.on_violation == OnViolation::Respawn && in_time;
            if may_respawn && self.respawns[body] < self.config.max_respawns && !self.engine.is_broken(body) {
                self.engine.take(body);
                respawned.push(body);
            } else {
                self.remove(body, reason);
            }
        }
        for body in respawned {
            self.respawns[body] += 1;
            self.report.respawned += 1;
            let stream =
                stream.child(RESPAWN_STREAM).at(u64::from(self.infos[body].spawn)).at(u64::from(self.respawns[body]));
            let pose = self.respawn_pose(body, stream);
            self.engine.put(body, &pose);
        }
    }

    /// A pose of random rotation and random position over the tabletop, clear of everything that is there.
    fn respawn_pose(&self, body: usize, mut stream: Stream) -> Pose {
        let rotation = stream.rotation();
        let rotated = Pose::from_parts(Translation3::identity(), rotation);
        let bounds = self.engine.bounds_at(body, &rotated);
        let (size, center, area) = (bounds.size(), bounds.center(), self.respawn_area());
        let mut along = |axis: usize| {
            let room = (area.size()[axis] - size[axis]).max(0.0);
            stream.uniform(-0.5, 0.5) * room + area.center()[axis] - center[axis]
        };
        let shift = Vector3::new(along(0), along(1), 0.0);
        let (min, max) = (bounds.min + shift, bounds.max + shift);
        let below = self
            .engine
            .present()
            .map(|other| self.engine.bounds(other))
            .filter(|other| (0..2).all(|axis| other.min[axis] < max[axis] && other.max[axis] > min[axis]));
        let top = below.map(|other| other.max.z).fold(area.min.z, f64::max);
        Pose::from_parts(Translation3::new(shift.x, shift.y, top + RESPAWN_CLEARANCE_M - min.z), rotation)
    }

    /// Flat box to respawn over: the tabletop, or the extent of what is there.
    fn respawn_area(&self) -> Aabb {
        if let Some(tabletop) = self.tabletop {
            let half = Vector3::new(tabletop.size[0] / 2.0, tabletop.size[1] / 2.0, 0.0);
            return Aabb { min: tabletop.center() - half, max: tabletop.center() + half };
        }
        let all = self.engine.present().map(|body| self.engine.bounds(body)).reduce(Aabb::union);
        all.unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() })
    }

    fn objects(&self) -> impl Iterator<Item = usize> + '_ {
        self.engine.present().filter(|&body| self.infos[body].role == Role::Object)
    }

    fn remove(&mut self, body: usize, reason: String) {
        self.engine.take(body);
        self.removed.push((body, reason));
    }

    fn finish(mut self, overlaps: &[Overlap]) -> Outcome {
        for body in self.engine.present() {
            let (speed, angular_speed) = self.engine.speeds(body);
            self.report.residual_speed_m_s = self.report.residual_speed_m_s.max(speed);
            self.report.residual_angular_speed_rad_s = self.report.residual_angular_speed_rad_s.max(angular_speed);
        }
        self.report.deepest_penetration_m = overlaps.iter().map(|overlap| overlap.depth).fold(0.0, f64::max);
        Outcome { report: self.report, removed: self.removed }
    }
}
