//! The acceptance check: which bodies violate a limit at rest, and what happens to them.

use crate::engine::{Engine, Overlap};
use crate::options::{OnViolation, Rapier, Remove};
use crate::static_body::SupportSurface;
use std::collections::VecDeque;
use syntable_model::context::Workers;
use syntable_model::geometry::{Aabb, Point3, Pose, Translation3, UnitQuaternion, Vector3};
use syntable_model::random::Stream;
use syntable_model::scene::{DropZone, Region, Role, SettleReport};

/// A respawned body starts this far above whatever is below it, meters.
const RESPAWN_CLEARANCE_M: f64 = 0.03;

/// After this multiple of `duration_s` of simulated time since all bodies have started, bodies are no longer respawned.
const MAX_DURATIONS: f64 = 10.0;

/// Time between two bodies that are poured on a support which is filled to a level, seconds.
const FILL_INTERVAL_S: f64 = 0.1;

/// Name of the random stream of respawn poses. The name affects the output: another name gives other datasets.
const RESPAWN_STREAM: &str = "drop_again";

/// Region in which a body is accepted.
pub struct AcceptanceRegion {
    /// The body is respawned above its area, and must be above its support if those off it are removed.
    pub zone: DropZone,
    /// Height of the ceiling, meters; `None` under the open sky.
    pub ceiling_m: Option<f64>,
    /// Whether the scene has a visible floor. Without one, a body that fell off the support would hang in the air.
    pub has_floor: bool,
}

impl AcceptanceRegion {
    /// Reason for the removal of an object below its support.
    fn fell_off(&self) -> String {
        format!("fell off the {}", self.zone.support.name)
    }
}

/// Properties of a body that the acceptance check needs.
pub struct BodyInfo {
    /// Role. Objects off their support are removed; distractors only without a floor.
    pub role: Role,
    /// Number in spawn order: keys its random stream.
    pub spawn: u32,
    /// Name, for reasons of removal.
    pub name: String,
    /// Pose at the start.
    pub start: Pose,
    /// Region in which the body is accepted; `None` if the scene has no support.
    pub place: Option<AcceptanceRegion>,
}

impl BodyInfo {
    /// The support that the body fills to a level.
    fn filled(&self) -> Option<&str> {
        let zone = &self.place.as_ref()?.zone;
        zone.full_at_m.is_some().then_some(&*zone.support.name)
    }

    /// Mean height of the pile at which the support is full for the body, meters above its surface.
    fn full_at_m(&self) -> f64 {
        self.place.as_ref().and_then(|place| place.zone.full_at_m).unwrap_or(f64::INFINITY)
    }

    /// Whether the body starts where it is to rest.
    fn starts_at_rest(&self) -> bool {
        self.place.as_ref().is_some_and(|place| place.zone.starts_at_rest)
    }
}

/// The outcome: the figures of the report, and the bodies that were removed, by index.
pub struct AcceptanceOutcome {
    /// Everything but `removed`.
    pub report: SettleReport,
    /// Removed bodies and the reason of each.
    pub removed: Vec<(usize, String)>,
    /// Bodies that were not poured because their support was full.
    pub spare: Vec<usize>,
}

/// A body that violates a limit.
struct Violator {
    body: usize,
    reason: String,
    /// Whether the body may come to rest with more time.
    is_moving: bool,
}

/// An object that was taken out because of its position.
struct Fallen {
    body: usize,
    reason: String,
}

/// Lets the bodies of an engine come to rest, and removes bodies that are not accepted.
pub struct Acceptance<'a> {
    config: &'a Rapier,
    engine: &'a mut Engine,
    infos: &'a [BodyInfo],
    /// Surface that carries the bodies.
    surface: &'a SupportSurface,
    /// Ends the simulation on request.
    workers: &'a dyn Workers,
    respawns: Vec<u32>,
    /// Whether a body had more time since it was last respawned.
    waited: Vec<bool>,
    removed: Vec<(usize, String)>,
    spare: Vec<usize>,
    /// Simulated time since all bodies have started, seconds.
    simulated_s: f64,
    report: SettleReport,
}

impl<'a> Acceptance<'a> {
    /// A check of bodies that have just been added.
    pub fn new(
        config: &'a Rapier,
        engine: &'a mut Engine,
        infos: &'a [BodyInfo],
        surface: &'a SupportSurface,
        workers: &'a dyn Workers,
    ) -> Self {
        Self {
            config,
            engine,
            infos,
            surface,
            workers,
            respawns: vec![0; infos.len()],
            waited: vec![false; infos.len()],
            removed: Vec::new(),
            spare: Vec::new(),
            simulated_s: 0.0,
            report: SettleReport::default(),
        }
    }

    /// Simulates and checks, again and again, until no body violates a limit.
    pub fn run(mut self, stream: &Stream) -> AcceptanceOutcome {
        let mut off = self.pour();
        self.simulated_s = 0.0;
        off.extend(self.simulate(self.config.duration_s));
        loop {
            off.extend(self.off_support());
            if !off.is_empty() {
                let respawned = self.handle_fallen(std::mem::take(&mut off), stream);
                if respawned || (self.config.on_violation != OnViolation::Keep && self.engine.is_awake()) {
                    off = self.simulate(self.config.duration_s);
                    continue;
                }
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
            off = self.simulate(self.config.duration_s);
        }
    }

    /// Pours bodies: they start one after another in the order of their placement. With `pour_interval_s`, all bodies are poured;
    /// otherwise only the bodies of supports that are filled to a level. Supports are filled side by side. Returns the bodies that
    /// fell off meanwhile.
    fn pour(&mut self) -> Vec<Fallen> {
        let interval_s = self.config.pour_interval_s.unwrap_or(FILL_INTERVAL_S);
        let mut queues: Vec<(Option<&'a str>, VecDeque<usize>)> = Vec::new();
        for body in self.engine.present() {
            let filled = self.infos[body].filled();
            if self.infos[body].starts_at_rest() || (filled.is_none() && self.config.pour_interval_s.is_none()) {
                continue;
            }
            match queues.iter_mut().find(|(support, _)| *support == filled) {
                Some((_, queue)) => queue.push_back(body),
                None => queues.push((filled, VecDeque::from([body]))),
            }
        }
        queues.iter().flat_map(|(_, queue)| queue).for_each(|&body| self.engine.take(body));
        let mut off = Vec::new();
        while queues.iter().any(|(_, queue)| !queue.is_empty()) {
            'queues: for (support, queue) in &mut queues {
                let Some(mut body) = queue.pop_front() else { continue };
                if let Some(support) = support {
                    let level = self.level(support, body);
                    // Steps with other levels can follow in the queue.
                    while self.infos[body].full_at_m() <= level || !self.fits(body) {
                        self.spare.push(body);
                        match queue.pop_front() {
                            Some(next) => body = next,
                            None => continue 'queues,
                        }
                    }
                }
                let pose = self.lifted(body, self.infos[body].start);
                self.engine.put(body, &pose);
            }
            off.extend(self.simulate(interval_s));
        }
        off
    }

    /// Mean height of the pile on a support, over the area that a body is dropped on, meters.
    fn level(&self, support: &str, body: usize) -> f64 {
        let there = self.engine.present().filter(|&other| self.infos[other].filled() == Some(support));
        let place = self.infos[body].place.as_ref();
        place.map_or(0.0, |place| self.engine.mean_height(there, &place.zone.area))
    }

    /// Whether a body that starts above the pile is below the end of the space, such as the next shelf board.
    fn fits(&self, body: usize) -> bool {
        let pose = self.lifted(body, self.infos[body].start);
        self.engine.bounds_at(body, &pose).max.z <= self.space_end(body)
    }

    /// Height at which the space of a body ends, meters.
    fn space_end(&self, body: usize) -> f64 {
        let place = self.infos[body].place.as_ref();
        place.and_then(|place| place.zone.support.top()).unwrap_or(f64::INFINITY)
    }

    /// Simulates for some time, or until all bodies sleep. Returns the objects that fell off their supports meanwhile.
    fn simulate(&mut self, duration_s: f64) -> Vec<Fallen> {
        let (infos, surface) = (self.infos, self.surface);
        let places: Vec<Option<&AcceptanceRegion>> = (0..infos.len()).map(|body| self.place_to_stay(body)).collect();
        // The whole body is below the surface, anywhere on the support.
        let is_below = |place: &AcceptanceRegion, bounds: &Aabb| {
            let top = Point3::new(bounds.center().x, bounds.center().y, bounds.max.z);
            let region = place.zone.support.outline();
            top.z < region.height() && !surface.is_on(&region, &top)
        };
        let mut fallen = Vec::new();
        let leaves = |body: usize, bounds: &Aabb| places[body].is_some_and(|place| is_below(place, bounds));
        let time = self.engine.run(duration_s, leaves, &mut fallen, self.workers);
        self.simulated_s += time;
        self.report.simulated_s = self.report.simulated_s.max(time);
        let fell = |body: usize| Some(Fallen { body, reason: places[body]?.fell_off() });
        fallen.into_iter().filter_map(fell).collect()
    }

    /// Takes out objects whose center is outside the space above their support.
    fn off_support(&mut self) -> Vec<Fallen> {
        let reason = |body: usize| {
            let place = self.place_to_stay(body)?;
            let (center, support) = (self.engine.center(body), &place.zone.support);
            if place.ceiling_m.is_some_and(|ceiling| center.z > ceiling) {
                Some("above the ceiling".to_owned())
            } else if support.top().is_some_and(|top| center.z > top) {
                Some(format!("above the space of the {}", support.name))
            } else if self.surface.is_on(&support.outline(), &center) {
                None
            } else if center.z < support.height() {
                Some(place.fell_off())
            } else {
                Some(format!("beyond the edge of the {}", support.name))
            }
        };
        let present = self.engine.present().filter(|&body| !self.engine.is_broken(body));
        let off: Vec<Fallen> = present.filter_map(|body| Some(Fallen { body, reason: reason(body)? })).collect();
        off.iter().for_each(|fallen| self.engine.take(fallen.body));
        off
    }

    /// Respawns or removes objects that were taken out. Returns whether any was respawned.
    fn handle_fallen(&mut self, off: Vec<Fallen>, stream: &Stream) -> bool {
        let (again, lost): (Vec<Fallen>, Vec<Fallen>) =
            off.into_iter().partition(|fallen| self.config.respawn_fallen && self.may_respawn(fallen.body));
        self.removed.extend(lost.into_iter().map(|Fallen { body, reason }| (body, reason)));
        again.iter().for_each(|fallen| self.respawn(fallen.body, stream));
        !again.is_empty()
    }

    /// Region in which a body must stay, if it is taken out elsewhere.
    fn place_to_stay(&self, body: usize) -> Option<&'a AcceptanceRegion> {
        let BodyInfo { role, place, .. } = &self.infos[body];
        let place = place.as_ref().filter(|_| self.config.remove == Remove::OffTabletop)?;
        (*role == Role::Object || !place.has_floor).then_some(place)
    }

    fn may_respawn(&self, body: usize) -> bool {
        self.infos[body].role == Role::Object
            && self.respawns[body] < self.config.max_respawns
            && self.simulated_s < MAX_DURATIONS * self.config.duration_s
            && !self.engine.is_broken(body)
    }

    /// Static surroundings that a body touches, in words.
    fn furniture(&self, body: usize) -> String {
        let support = self.infos[body].place.as_ref().map_or("table", |place| &place.zone.support.name);
        format!("the {support} or the room")
    }

    /// Bodies that violate a limit, in the order of their indices.
    fn violators(&self, overlaps: &[Overlap]) -> Vec<Violator> {
        let mut violators: Vec<Violator> = Vec::new();
        for body in self.engine.present() {
            let (speed, angular_speed) = self.engine.speeds(body);
            let (is_moving, reason) = if self.engine.is_broken(body) {
                (false, "its motion left the range of numbers".to_owned())
            } else if speed > self.config.max_speed_m_s {
                (true, format!("still moving at {speed:.3} m/s"))
            } else if angular_speed > self.config.max_angular_speed_rad_s {
                (true, format!("still turning at {angular_speed:.3} rad/s"))
            } else {
                continue;
            };
            violators.push(Violator { body, reason, is_moving });
        }
        let is_violator = |violators: &[Violator], body: usize| violators.iter().any(|violator| violator.body == body);
        // One body of each penetrating pair must go: the one with more such pairs, else the upper one.
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
                .map(rank)
                .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            let Some((_, _, body)) = worst else { break };
            let deepest = pairs
                .iter()
                .filter(|pair| pair.body == body || pair.other == Some(body))
                .max_by(|a, b| a.depth.total_cmp(&b.depth));
            if let Some(pair) = deepest {
                let other = if pair.body == body { pair.other } else { Some(pair.body) };
                let what = other.map_or_else(|| self.furniture(body), |other| self.infos[other].name.clone());
                let reason = format!("{:.1} mm deep in {what}", pair.depth * 1e3);
                violators.push(Violator { body, reason, is_moving: false });
            }
        }
        violators.sort_by_key(|violator| violator.body);
        violators
    }

    /// Gives moving violators more time, and respawns the others, or removes those without remaining respawns.
    fn handle(&mut self, violators: Vec<Violator>, stream: &Stream) {
        let in_time = self.simulated_s < MAX_DURATIONS * self.config.duration_s;
        let mut respawned = Vec::new();
        for Violator { body, reason, is_moving } in violators {
            if self.config.on_violation == OnViolation::Respawn && in_time && is_moving && !self.waited[body] {
                self.waited[body] = true;
            } else if self.config.on_violation == OnViolation::Respawn && self.may_respawn(body) {
                self.engine.take(body);
                respawned.push(body);
            } else {
                self.engine.take(body);
                self.removed.push((body, reason));
            }
        }
        respawned.into_iter().for_each(|body| self.respawn(body, stream));
    }

    /// Starts a body again that was taken out.
    fn respawn(&mut self, body: usize, stream: &Stream) {
        self.respawns[body] += 1;
        self.waited[body] = false;
        self.report.respawned += 1;
        let stream =
            stream.child(RESPAWN_STREAM).at(u64::from(self.infos[body].spawn)).at(u64::from(self.respawns[body]));
        let pose = self.respawn_pose(body, stream);
        self.engine.put(body, &pose);
    }

    /// A pose in the body's drop area, clear of all bodies. Its rotation is the start rotation, turned about the
    /// vertical, which preserves the distributions of placers.
    fn respawn_pose(&self, body: usize, mut stream: Stream) -> Pose {
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.uniform(0.0, std::f64::consts::TAU));
        let rotated = Pose::from_parts(Translation3::identity(), yaw * self.infos[body].start.rotation);
        let bounds = self.engine.bounds_at(body, &rotated);
        let area = self.respawn_area(body);
        let (size, center) = if area.yaw() == 0.0 {
            (bounds.size(), bounds.center())
        } else {
            // Extents along the edges of the area.
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), area.yaw());
            let along = self.engine.bounds_at(body, &(turn.inverse() * rotated));
            (along.size(), turn * along.center())
        };
        let mut along = |axis: usize| stream.uniform(-0.5, 0.5) * (area.edges()[axis] - size[axis]).max(0.0);
        let place = area.point([along(0), along(1)]);
        let shift = Translation3::new(place.x - center.x, place.y - center.y, area.height() - bounds.min.z);
        self.lifted(body, shift * rotated)
    }

    /// A pose lifted until the body is clear of everything that is below it.
    fn lifted(&self, body: usize, pose: Pose) -> Pose {
        let bounds = self.engine.bounds_at(body, &pose);
        // A shelf board above ends the space, with the bodies on it.
        let end = self.space_end(body);
        let below = self.engine.present().map(|other| self.engine.bounds(other)).filter(|other| {
            (0..2).all(|axis| other.min[axis] < bounds.max[axis] && other.max[axis] > bounds.min[axis])
                && other.min.z < end
        });
        let top = below.map(|other| other.max.z).fold(self.respawn_area(body).height(), f64::max);
        let lift = (top + RESPAWN_CLEARANCE_M - bounds.min.z).max(0.0);
        Translation3::new(0.0, 0.0, lift) * pose
    }

    /// Region above which a body respawns: the drop area of its placer, or the extent of all bodies.
    fn respawn_area(&self, body: usize) -> Region {
        if let Some(AcceptanceRegion { zone, .. }) = &self.infos[body].place {
            return zone.area;
        }
        let all = self.engine.present().map(|body| self.engine.bounds(body)).reduce(Aabb::union);
        let all = all.unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() });
        let (center, size) = (all.center(), all.size());
        Region::rectangle([center.x, center.y, all.min.z], [size.x, size.y])
    }

    fn finish(mut self, overlaps: &[Overlap]) -> AcceptanceOutcome {
        for body in self.engine.present() {
            let (speed, angular_speed) = self.engine.speeds(body);
            self.report.residual_speed_m_s = self.report.residual_speed_m_s.max(speed);
            self.report.residual_angular_speed_rad_s = self.report.residual_angular_speed_rad_s.max(angular_speed);
        }
        self.report.deepest_penetration_m = overlaps.iter().map(|overlap| overlap.depth).fold(0.0, f64::max);
        AcceptanceOutcome { report: self.report, removed: self.removed, spare: self.spare }
    }
}
