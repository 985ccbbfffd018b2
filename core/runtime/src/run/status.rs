//! The state of datasets while they are made, perhaps by other processes or machines.

use crate::run::dataset::ending;
use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, LatestLines, SceneLine};
use crate::run::dataset::layout;
use crate::run::dataset::locking::is_busy;
use crate::run::dataset::vanished::vanished;
use crate::run::merge::datasets_in;
use crate::run::shard::Shard;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;

/// The state of some datasets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Each dataset.
    pub datasets: Vec<DatasetStatus>,
    /// Shards that are in no folder, as `3/10`; empty if the folder of one shard is the only one named.
    pub missing_shards: Vec<String>,
    /// All datasets, and the scenes of missing shards, together.
    pub total: Progress,
}

/// The state of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DatasetStatus {
    /// Its folder.
    pub dataset: PathBuf,
    /// The shard that it is, as `3/10`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// Whether a run is writing it now.
    pub running: bool,
    /// Whether its last run ended: the annotation files have all scenes.
    pub finished: bool,
    /// Its scenes.
    #[serde(flatten)]
    pub progress: Progress,
    /// Faults of its journal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<String>,
}

/// Counts of scenes, and their pace.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Scenes of the recipe.
    pub scenes: u32,
    /// Scenes that are in the dataset.
    pub done: u32,
    /// Scenes that could not be made.
    pub failed: u32,
    /// Scenes that are neither done nor failed.
    pub missing: u32,
    /// Images in the dataset.
    pub images: u64,
    /// Pace of the latest scenes, scenes per hour. None without an active run, or with too few scenes.
    pub scenes_per_hour: Option<f64>,
    /// Time until all scenes are made at this pace, s.
    pub left_s: Option<f64>,
}

/// Number of the latest scenes that determine the pace.
const RECENT: usize = 64;
/// A time between two scenes that is so many times the median is a pause between two runs.
const PAUSE: u32 = 20;

/// The state of datasets, or of the datasets in folders, such as the shards of a job. Changes nothing, and does not disturb
/// runs.
///
/// # Errors
/// If a folder has no dataset, or cannot be read.
pub fn status(named: &[StoreFolder]) -> Result<Status> {
    let mut datasets = Vec::new();
    let (mut shards, mut total): (Vec<(Shard, u32)>, Progress) = (Vec::new(), Progress::default());
    for dataset in named.iter().map(datasets_in).collect::<Result<Vec<_>>>()?.concat() {
        if !layout::is_dataset(&dataset)? {
            return Err(Error::new("no dataset in this folder")
                .in_file(dataset.name())
                .help("name the output folder of a run, or the folder of its shards"));
        }
        let (state, shard) = of_dataset(&dataset)?;
        shards.extend(shard);
        total.add(&state.progress);
        datasets.push(state);
    }
    // The folder of one shard says nothing about the folders of the others.
    let is_alone = matches!((named, &*datasets), ([named], [one]) if one.dataset == named.name());
    let missing = if is_alone { Vec::new() } else { missing_shards(&shards) };
    for (shard, scenes) in &missing {
        let lacking = shard.scenes(*scenes).count() as u32;
        total.scenes += lacking;
        total.missing += lacking;
    }
    total.left_s = left(total.missing, total.scenes_per_hour);
    Ok(Status { datasets, missing_shards: missing.iter().map(|(shard, _)| shard.to_string()).collect(), total })
}

/// Shards of a division that no dataset is, each with the number of scenes of the recipe.
fn missing_shards(found: &[(Shard, u32)]) -> Vec<(Shard, u32)> {
    let Some(&(Shard { count, .. }, scenes)) = found.first() else { return Vec::new() };
    if found.iter().any(|(shard, _)| shard.count != count) {
        return Vec::new();
    }
    let found: BTreeSet<u32> = found.iter().map(|(shard, _)| shard.index).collect();
    let missing = (0..count).filter(|index| !found.contains(index));
    missing.map(|index| (Shard { index, count }, scenes)).collect()
}

impl Progress {
    fn add(&mut self, other: &Self) {
        self.scenes += other.scenes;
        self.done += other.done;
        self.failed += other.failed;
        self.missing += other.missing;
        self.images += other.images;
        if let Some(pace) = other.scenes_per_hour {
            *self.scenes_per_hour.get_or_insert_default() += pace;
        }
    }
}

/// The time for some scenes at a pace, s.
fn left(missing: u32, scenes_per_hour: Option<f64>) -> Option<f64> {
    scenes_per_hour.map(|pace| f64::from(missing) / pace * 3600.0)
}

/// The state of a dataset; for a shard, also its number and the number of scenes of the whole recipe.
fn of_dataset(dataset: &StoreFolder) -> Result<(DatasetStatus, Option<(Shard, u32)>)> {
    let running = is_busy(dataset)?;
    let LatestLines { entries, order, faults } = Journal::latest(dataset, RECENT)?;
    let shard = Shard::of_dataset(dataset)?;
    let scenes = match scenes_of_recipe(dataset)? {
        Some(scenes) => scenes,
        None if entries.is_empty() => 0,
        None => return Err(vanished(dataset)),
    };
    let failed = entries.iter().filter(SceneLine::failed).count() as u32;
    let own = shard.unwrap_or(Shard::WHOLE).scenes(scenes);
    let missing = own.clone().filter(|scene| !entries.contains(*scene)).count() as u32;
    let scenes_per_hour = if running { pace(&times_of(dataset, &order)?) } else { None };
    let progress = Progress {
        scenes: own.count() as u32,
        done: entries.len() as u32 - failed,
        failed,
        missing,
        images: entries.iter().map(|line| u64::from(line.views())).sum(),
        scenes_per_hour,
        left_s: left(missing, scenes_per_hour),
    };
    let state = DatasetStatus {
        dataset: dataset.name(),
        shard: shard.map(|shard| shard.to_string()),
        running,
        finished: !running && ending::is_finished(dataset)?,
        progress,
        faults,
    };
    Ok((state, shard.map(|shard| (shard, scenes))))
}

/// Number of scenes of a dataset's recipe; none if a run has begun and not yet written the recipe.
fn scenes_of_recipe(dataset: &StoreFolder) -> Result<Option<u32>> {
    let path = layout::recipe();
    let text = foreign::read(dataset, &path)?;
    if text.is_empty() {
        return Ok(None);
    }
    let table: Option<toml::Table> = toml::from_str(&String::from_utf8_lossy(&text)).ok();
    let scenes = table.as_ref().and_then(|table| table.get("dataset")?.get("scenes")?.as_integer());
    scenes.and_then(|scenes| u32::try_from(scenes).ok()).map(Some).ok_or_else(|| {
        Error::new("the recipe of the dataset has no `dataset.scenes`")
            .in_file(dataset.name_of(&path))
            .help("restore the file, or run with its recipe, `options.out` and `options.repair`")
    })
}

/// The times at which scenes were finished, ascending.
fn times_of(dataset: &StoreFolder, scenes: &[u32]) -> Result<Vec<SystemTime>> {
    let mut times = Vec::new();
    for &scene in scenes {
        times.extend(dataset.look(&layout::manifest(scene))?.and_then(|found| found.modified));
    }
    times.sort_unstable();
    Ok(times)
}

/// Scenes per hour since the last pause.
fn pace(times: &[SystemTime]) -> Option<f64> {
    let mut gaps: Vec<Duration> =
        times.windows(2).map(|pair| pair[1].duration_since(pair[0]).unwrap_or_default()).collect();
    let in_order = gaps.clone();
    gaps.sort_unstable();
    let median = *gaps.get(gaps.len() / 2)?;
    let is_pause = |gap: &Duration| *gap > (median * PAUSE).max(Duration::from_secs(1));
    let recent: Vec<Duration> = in_order.into_iter().rev().take_while(|gap| !is_pause(gap)).collect();
    let seconds = recent.iter().sum::<Duration>().as_secs_f64();
    (seconds > 0.0).then(|| recent.len() as f64 / seconds * 3600.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: &[u64]) -> Vec<SystemTime> {
        seconds.iter().map(|&seconds| SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)).collect()
    }

    #[test]
    fn a_pause_between_runs_does_not_slow_the_pace() {
        assert_eq!(pace(&at(&[0, 10, 20, 30])), Some(360.0));
        assert_eq!(pace(&at(&[0, 10, 20, 4000, 4010, 4020])), Some(360.0));
        assert_eq!(pace(&at(&[5])), None);
        assert_eq!(pace(&at(&[5, 5])), None);
    }

    #[test]
    fn missing_shards_are_named() {
        let shard = |index| (Shard { index, count: 4 }, 24);
        assert_eq!(missing_shards(&[shard(0), shard(3)]), [shard(1), shard(2)]);
        assert!(missing_shards(&[]).is_empty());
        // A part that a stranger made must not ask for gigabytes.
        assert!(Shard::new(0, Shard::MOST).is_ok() && Shard::new(0, u32::MAX).is_err());
    }
}
