//! Remarks of the lines of a whole dataset: anomalies, refused poses and omitted data.

use crate::pools::BAD;
use crate::run::dataset::draws::{PoseDraws, in_words};
use crate::run::dataset::journal::{Entries, JournalEntry, Notice, SceneLine};
use crate::run::dataset::loss::Loss;
use crate::run::outcome::RunOutcome;
use crate::run::progress::{Event, Reporter, Warnings, count};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::Log;
use syntable_model::error::Error;

/// Views are few if they are less than one in this number.
const FEW: u32 = 10;

/// Sums over the lines of a dataset.
#[derive(Default)]
pub struct DatasetRemarks {
    made: u32,
    views: u32,
    /// Anomalies of whole scenes: those that are reported.
    scenes: BTreeMap<Notice, ScenesWith>,
    /// Anomalies of some views of scenes.
    odd_views: BTreeMap<Notice, ViewsWith>,
    /// Anomalies of all scenes.
    all_have: BTreeSet<Notice>,
    poses: PoseDraws,
    /// The first scene with views without a good pose, and the first of these views.
    unmet: Option<(u32, u32)>,
    left_out: Vec<Loss>,
}

/// Scenes with an anomaly.
#[derive(Default)]
struct ScenesWith {
    scenes: u32,
    views: u32,
    /// All anomalies of the first of them.
    first: BTreeSet<Notice>,
}

/// Views with an anomaly, of scenes without it.
struct ViewsWith {
    views: u32,
    /// The first of them: scene and view.
    first: (u32, u32),
}

impl DatasetRemarks {
    /// Sums the lines of a dataset.
    pub fn of(entries: &Entries) -> Self {
        let mut sums = Self::default();
        // Most lines have no remark.
        let with_remarks = || entries.made().filter(SceneLine::has_remarks).map(|line| line.entry());
        for line in entries.made() {
            sums.made += 1;
            sums.views += line.views();
        }
        let mut remarked = 0;
        for entry in with_remarks() {
            sums.all_have = match remarked {
                0 => entry.notices.clone(),
                _ => sums.all_have.intersection(&entry.notices).copied().collect(),
            };
            remarked += 1;
            sums.add(&entry);
        }
        if remarked < sums.made {
            sums.all_have.clear();
        }
        sums.left_out = Loss::sum(with_remarks().flat_map(|entry| entry.left_out));
        sums
    }

    fn add(&mut self, entry: &JournalEntry) {
        for notice in Notice::reported(&entry.notices) {
            let with = self
                .scenes
                .entry(notice)
                .or_insert_with(|| ScenesWith { first: entry.notices.clone(), ..ScenesWith::default() });
            with.scenes += 1;
            with.views += entry.views();
        }
        for (notice, views) in &entry.odd_views {
            let Some(&view) = views.first() else { continue };
            let with = self.odd_views.entry(*notice).or_insert(ViewsWith { views: 0, first: (entry.scene, view) });
            with.views += views.len() as u32;
        }
        self.poses.add(&entry.poses);
        if let Some(&view) = entry.poses.unmet.first() {
            self.unmet.get_or_insert((entry.scene, view));
        }
    }

    /// The anomalies that make a dataset useless because all of its scenes have them.
    fn useless(&self) -> Vec<Notice> {
        let makes_useless = |notice: &Notice| [Notice::Black, Notice::Unlabeled].contains(notice);
        Notice::reported(&self.all_have).filter(makes_useless).collect()
    }

    /// The outcome of a run that ended with these lines. `losses` are what the end of the run omitted.
    pub fn outcome(&self, entries: &Entries, losses: Vec<Loss>) -> RunOutcome {
        let bad = entries.assets().iter().filter(|(_, digest)| *digest == BAD).map(|(name, _)| name.clone());
        let useless = self.useless().into_iter();
        RunOutcome {
            bad_assets: bad.collect(),
            scenes: self.made,
            failed: entries.len() as u32 - self.made,
            lacking: 0,
            missing: 0,
            useless: useless.map(|notice| (notice.text(&self.all_have), notice.help(&self.all_have))).collect(),
            images: self.views,
            left_out: Loss::sum(self.left_out.iter().cloned().chain(losses)),
        }
    }

    /// Tells of anomalies and of refused poses. `told` are the anomalies whose remedies the run has shown.
    pub fn tell(&self, told: &BTreeSet<Notice>, reporter: &dyn Reporter) {
        self.tell_of_notices(told, reporter);
        self.tell_of_poses(reporter);
    }

    /// Warns about anomalies of scenes and views. A few anomalous views may be intended, and cause no warning. The errors
    /// of the run name the anomalies that make it useless.
    fn tell_of_notices(&self, told: &BTreeSet<Notice>, reporter: &dyn Reporter) {
        let (log, useless) = (Warnings(reporter), self.useless());
        for notice in [Notice::Black, Notice::White, Notice::Unlit, Notice::Unlabeled] {
            let whole = self.scenes.get(&notice);
            if let Some(ScenesWith { scenes, first, .. }) = whole.filter(|_| !useless.contains(&notice)) {
                let of = format!("{scenes} of {}", count(self.made, "scene"));
                let warning = Error::new(notice.text(first)).context(of);
                if told.contains(&notice) {
                    reporter.event(&Event::Note { message: warning.to_string() });
                } else {
                    log.warn(&warning.help(notice.help(first)));
                }
            }
            let Some(ViewsWith { views, first: (scene, view) }) = self.odd_views.get(&notice) else { continue };
            let views = whole.map_or(0, |with| with.views) + views;
            let of = format!("{views} of {}, such as view {view} of scene {scene}", count(self.views, "view"));
            let warning = Error::new(notice.text_of_view()).help(notice.help_of_view()).context(of);
            if notice.may_be_meant() && views.saturating_mul(FEW) < self.views {
                reporter.event(&Event::Note { message: warning.to_string() });
            } else {
                log.warn(&warning);
            }
        }
    }

    /// Reports the camera poses that conditions refused, and warns about views that do not meet them.
    fn tell_of_poses(&self, reporter: &dyn Reporter) {
        let all = &self.poses;
        if !all.refused.is_empty() {
            let refused: u32 = all.refused.values().sum();
            let message = format!("camera poses: {refused} of {} refused: {}", all.drawn, in_words(&all.refused));
            reporter.event(&Event::Note { message });
        }
        if let Some((scene, view)) = self.unmet {
            let views = count(self.views, "view");
            let of = format!("{} of {views}, such as view {view} of scene {scene}", all.unmet.len());
            let warning = Error::new("no drawn camera pose meets the conditions of [views]").context(of);
            Warnings(reporter)
                .warn(&warning.help("raise `attempts`, relax the conditions, or let `on_failure` be \"error\""));
        }
    }
}
