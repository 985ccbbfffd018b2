//! The acceptance gate: which bodies may not stay as they are, and what becomes of them.

use crate::config::{OnViolation, Rapier, Remove};
use crate::engine::{Engine, Overlap};
use syntable_model::geometry::{Aabb, Point3, Pose, Translation3, Vector3};
use syntable_model::random::Stream;
use syntable_model::scene::{Role, SettleReport, Tabletop};

/// A body that is dropped again starts this far above whatever lies under it, metres.
const DROP_M: f64 = 0.03;

/// After this many times the duration, no body gets another try.
const PATIENCE: f64 = 10.0;

/// What the gate must know of an item.
pub struct Candidate {
    /// What it is for; only objects are taken out.
    pub role: Role,
    /// Number in spawn order: names its random stream.
    pub spawn: u32,
    /// Name, for reasons.
    pub name: String,
}

/// The outcome: the figures of the report, and why items left, by item number.
pub struct Outcome {
    /// Everything but `removed`.
    pub report: SettleReport,
    /// Items that were taken out, and why.
    pub removed: Vec<(usize, String)>,
}

/// Lets the items of an engine come to rest and takes out those that do not pass.
pub struct Gate<'a> {
    config: &'a Rapier,
    engine: &'a mut Engine,
    candidates: &'a [Candidate],
    tabletop: Option<Tabletop>,
    drops: Vec<u32>,
    removed: Vec<(usize, String)>,
    spent_s: f64,
    report: SettleReport,
}

impl<'a> Gate<'a> {
    /// A gate for items that have just been added. `tabletop` is where items are dropped again, and what they must be
    /// above if those off it are taken out.
    pub fn new(
        config: &'a Rapier,
        engine: &'a mut Engine,
        candidates: &'a [Candidate],
        tabletop: Option<Tabletop>,
    ) -> Self {
        let drops = vec![0; candidates.len()];
        Self {
            config,
            engine,
            candidates,
            tabletop,
            drops,
            removed: Vec::new(),
            spent_s: 0.0,
            report: SettleReport::default(),
        }
    }

    /// Simulates, judges, and does so again until nothing is left to object to.
    pub fn run(mut self, stream: &Stream) -> Outcome {
        self.simulate();
        loop {
            if self.remove_off_tabletop() && self.config.on_violation != OnViolation::Keep && self.engine.is_awake() {
                self.simulate();
                continue;
            }
            let overlaps = self.engine.overlaps();
            let mut culprits = self.culprits(&overlaps);
            if self.config.on_violation == OnViolation::Keep {
                // What has no pose cannot stay even then.
                culprits.retain(|(item, _)| self.engine.is_broken(*item));
            }
            if culprits.is_empty() {
                return self.finish(&overlaps);
            }
            self.handle(culprits, stream);
            self.simulate();
        }
    }

    fn simulate(&mut self) {
        let objects_only = self.candidates.iter().all(|candidate| candidate.role == Role::Object);
        let floor = self.tabletop.filter(|_| objects_only && self.config.remove == Remove::OffTabletop);
        let mut gone = Vec::new();
        let time = self.engine.run(floor.map(|tabletop| tabletop.height()), &mut gone);
        self.removed.extend(gone.into_iter().map(|item| (item, "fell off the table".to_owned())));
        self.spent_s += time;
        self.report.simulated_s = self.report.simulated_s.max(time);
    }

    /// Takes out objects whose middle is off the tabletop; tells whether there were any.
    fn remove_off_tabletop(&mut self) -> bool {
        let (Remove::OffTabletop, Some(tabletop)) = (self.config.remove, self.tabletop) else { return false };
        let off: Vec<usize> = self
            .objects()
            .filter(|&item| !self.engine.is_broken(item) && !tabletop.is_below(&self.engine.middle(item)))
            .collect();
        for &item in &off {
            let fell = self.engine.middle(item).z < tabletop.height();
            self.remove(item, if fell { "fell off the table" } else { "beyond the edge of the table" }.to_owned());
        }
        !off.is_empty()
    }

    /// Objects that exceed a limit, and in what, in the order of their numbers.
    fn culprits(&self, overlaps: &[Overlap]) -> Vec<(usize, String)> {
        let mut culprits: Vec<(usize, String)> = Vec::new();
        for item in self.objects() {
            let (speed, spin) = self.engine.speed_and_spin(item);
            if self.engine.is_broken(item) {
                culprits.push((item, "its motion left the range of numbers".to_owned()));
            } else if speed > self.config.max_speed_m_s {
                culprits.push((item, format!("still moving at {speed:.3} m/s")));
            } else if spin > self.config.max_spin_rad_s {
                culprits.push((item, format!("still turning at {spin:.3} rad/s")));
            }
        }
        let guilty = |culprits: &[(usize, String)], item: usize| culprits.iter().any(|(culprit, _)| *culprit == item);
        // Of two bodies in each other only one has to go: the one with more such pairs, else the upper one.
        let mut pairs: Vec<&Overlap> =
            overlaps.iter().filter(|overlap| overlap.depth > self.config.max_penetration_m).collect();
        loop {
            pairs.retain(|pair| {
                !guilty(&culprits, pair.item) && pair.other.is_none_or(|other| !guilty(&culprits, other))
            });
            let rank = |item: usize| {
                let count = pairs.iter().filter(|pair| pair.item == item || pair.other == Some(item)).count();
                (count, self.engine.middle(item).z, item)
            };
            let worst = pairs
                .iter()
                .flat_map(|pair| [Some(pair.item), pair.other])
                .flatten()
                .filter(|&item| self.candidates[item].role == Role::Object)
                .map(rank)
                .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            let Some((_, _, item)) = worst else { break };
            let deepest = pairs
                .iter()
                .filter(|pair| pair.item == item || pair.other == Some(item))
                .max_by(|a, b| a.depth.total_cmp(&b.depth));
            if let Some(pair) = deepest {
                let other = if pair.item == item { pair.other } else { Some(pair.item) };
                let what = other.map_or("the table or the room", |other| &self.candidates[other].name);
                culprits.push((item, format!("{:.1} mm deep in {what}", pair.depth * 1e3)));
            }
        }
        culprits.sort_by_key(|(item, _)| *item);
        culprits
    }

    /// Gives every culprit another try, or takes it out if it has had its tries.
    fn handle(&mut self, culprits: Vec<(usize, String)>, stream: &Stream) {
        let patient = self.spent_s < PATIENCE * self.config.duration_s;
        let mut again = Vec::new();
        for (item, reason) in culprits {
            let may_drop = self.config.on_violation == OnViolation::DropAgain && patient;
            if may_drop && self.drops[item] < self.config.max_drops && !self.engine.is_broken(item) {
                self.engine.take(item);
                again.push(item);
            } else {
                self.remove(item, reason);
            }
        }
        for item in again {
            self.drops[item] += 1;
            self.report.dropped_again += 1;
            let stream =
                stream.child("drop_again").at(u64::from(self.candidates[item].spawn)).at(u64::from(self.drops[item]));
            let pose = self.drop_pose(item, stream);
            self.engine.put(item, &pose);
        }
    }

    /// A pose of random rotation and random place over the tabletop, clear of everything that is there.
    fn drop_pose(&self, item: usize, mut stream: Stream) -> Pose {
        let rotation = stream.rotation();
        let turned = Pose::from_parts(Translation3::identity(), rotation);
        let bounds = self.engine.bounds_at(item, &turned);
        let (size, centre, area) = (bounds.size(), bounds.centre(), self.drop_area());
        let mut along = |axis: usize| {
            let room = (area.size()[axis] - size[axis]).max(0.0);
            stream.uniform(-0.5, 0.5) * room + area.centre()[axis] - centre[axis]
        };
        let shift = Vector3::new(along(0), along(1), 0.0);
        let (min, max) = (bounds.min + shift, bounds.max + shift);
        let below = self
            .engine
            .present()
            .map(|other| self.engine.bounds(other))
            .filter(|other| (0..2).all(|axis| other.min[axis] < max[axis] && other.max[axis] > min[axis]));
        let top = below.map(|other| other.max.z).fold(area.min.z, f64::max);
        Pose::from_parts(Translation3::new(shift.x, shift.y, top + DROP_M - min.z), rotation)
    }

    /// Box to drop into: over the tabletop, or over what is there; its floor is what there is to land on.
    fn drop_area(&self) -> Aabb {
        if let Some(tabletop) = self.tabletop {
            let half = Vector3::new(tabletop.size[0] / 2.0, tabletop.size[1] / 2.0, 0.0);
            return Aabb { min: tabletop.centre() - half, max: tabletop.centre() + half };
        }
        let all = self.engine.present().map(|item| self.engine.bounds(item)).reduce(Aabb::union);
        all.unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() })
    }

    fn objects(&self) -> impl Iterator<Item = usize> + '_ {
        self.engine.present().filter(|&item| self.candidates[item].role == Role::Object)
    }

    fn remove(&mut self, item: usize, reason: String) {
        self.engine.take(item);
        self.removed.push((item, reason));
    }

    fn finish(mut self, overlaps: &[Overlap]) -> Outcome {
        for item in self.engine.present() {
            let (speed, spin) = self.engine.speed_and_spin(item);
            self.report.residual_speed_m_s = self.report.residual_speed_m_s.max(speed);
            self.report.residual_spin_rad_s = self.report.residual_spin_rad_s.max(spin);
        }
        self.report.deepest_penetration_m = overlaps.iter().map(|overlap| overlap.depth).fold(0.0, f64::max);
        Outcome { report: self.report, removed: self.removed }
    }
}
