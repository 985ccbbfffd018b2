//! Shards: the scenes of a recipe, dealt out to the tasks of a job array.

use crate::run::dataset::{foreign, layout};
use crate::run::scene_range;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;

/// One of `count` shards: every `count`-th scene, from scene `index`. A recipe that grows keeps its scenes in their
/// shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// Its number, from 0.
    pub index: u32,
    /// The number of shards.
    pub count: u32,
}

impl Shard {
    /// The shard with all scenes.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Largest number of shards of a dataset. `status` lists the missing ones.
    pub const MOST: u32 = 1_000_000;

    /// A shard by its number.
    ///
    /// # Errors
    /// If the number is not below the number of shards, or their number exceeds [`MOST`](Self::MOST).
    pub fn new(index: u32, count: u32) -> Result<Self> {
        if count > Self::MOST {
            let message = format!("{count} shards are more than a dataset may have");
            return Err(Error::new(message).help(format!("make at most {} shards", Self::MOST)).of_request());
        }
        if index < count {
            return Ok(Self { index, count });
        }
        let message = format!("shard {index} of {count} does not exist");
        Err(Error::new(message).help("shards are numbered from 0: the last of ten is 9/10").of_request())
    }

    /// The shard that a dataset is.
    ///
    /// # Errors
    /// If its file is damaged.
    pub(crate) fn of_dataset(dataset: &StoreFolder) -> Result<Option<Self>> {
        let path = layout::shard();
        let Some(text) = foreign::read_list(dataset, &path)? else { return Ok(None) };
        let shard =
            serde_json::from_slice::<Self>(&text).ok().filter(|shard| Self::new(shard.index, shard.count).is_ok());
        shard.map(Some).ok_or_else(|| {
            Error::new("not the number of a shard, such as {\"index\":3,\"count\":10}")
                .in_file(dataset.name_of(&path))
                .help("restore the file, or delete it if the dataset is no shard")
        })
    }

    /// Whether a scene belongs to it.
    pub fn has(self, scene: u32) -> bool {
        scene % self.count == self.index
    }

    /// The scenes of it that a recipe with `scenes` scenes has, ascending.
    pub fn scenes(self, scenes: u32) -> impl Iterator<Item = u32> + Clone {
        (self.index..scenes).step_by(self.count as usize)
    }

    /// The folder of the shards of a dataset: `data/mine.shards` for `data/mine`.
    pub fn folder_of_all(dataset: &Path) -> PathBuf {
        let mut name = dataset.file_name().unwrap_or_default().to_owned();
        name.push(".shards");
        dataset.with_file_name(name)
    }

    /// The folder of this shard of a dataset: `data/mine.shards/3-of-10` for `data/mine`.
    pub fn folder(self, dataset: &Path) -> PathBuf {
        Self::folder_of_all(dataset).join(format!("{}-of-{}", self.index, self.count))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// The scenes that a run makes: the scenes of a range that belong to a shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WantedScenes {
    range: Range<u32>,
    shard: Shard,
}

impl WantedScenes {
    /// The scenes of a range.
    pub fn of_range(range: Range<u32>) -> Self {
        Self { range, shard: Shard::WHOLE }
    }

    /// The scenes of a recipe with `count` scenes that a caller requests.
    ///
    /// # Errors
    /// If the range is empty, or the recipe does not have all its scenes.
    pub fn of(range: Option<&Range<u32>>, shard: Option<Shard>, count: u32) -> Result<Self> {
        let range = scene_range::within(range, count)?;
        Ok(Self { range, shard: shard.unwrap_or(Shard::WHOLE) })
    }

    /// Whether a scene is among them.
    pub fn has(&self, scene: u32) -> bool {
        self.range.contains(&scene) && self.shard.has(scene)
    }

    /// The scenes, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> + use<> {
        let Self { range, shard: Shard { index, count } } = self.clone();
        let gap = (u64::from(index) + u64::from(count) - u64::from(range.start % count)) % u64::from(count);
        let first = u64::from(range.start) + gap;
        (first..u64::from(range.end)).step_by(count as usize).map(|scene| scene as u32)
    }

    /// Number of scenes.
    pub fn count(&self) -> u32 {
        self.iter().count() as u32
    }
}

/// The shard that a user requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShardChoice {
    /// A shard by its number: `3/10`.
    This(Shard),
    /// The shard of the task of a job array that runs the program: `auto`, or `auto/10` with the number of shards.
    OfTask(Option<u32>),
}

impl FromStr for ShardChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("`{text}` is no shard; write 3/10, auto, or auto/10");
        let count = |count: &str| match count.parse() {
            Ok(0) => Err("a dataset has at least one shard, and 0/1 is all of it".to_owned()),
            Ok(count) => Ok(count),
            Err(_) => Err(wrong()),
        };
        match text.split_once('/') {
            None if text == "auto" => Ok(Self::OfTask(None)),
            Some(("auto", all)) => Ok(Self::OfTask(Some(count(all)?))),
            Some((index, all)) => {
                let index = index.parse().map_err(|_| wrong())?;
                let told = |error: Error| format!("{}; {}", error.message(), error.help_text().unwrap_or_default());
                Shard::new(index, count(all)?).map(Self::This).map_err(told)
            }
            None => Err(wrong()),
        }
    }
}

/// A system that runs a command as several tasks, and the variables in which each task finds its place.
struct JobSystem {
    name: &'static str,
    /// The number of the task.
    index: &'static str,
    /// The lowest and the highest number of a task, in systems where users choose them.
    ends: Option<[&'static str; 2]>,
    /// The number of tasks.
    count: Option<&'static str>,
}

/// All systems whose variables are known.
const SYSTEMS: [JobSystem; 8] = [
    JobSystem {
        name: "Slurm",
        index: "SLURM_ARRAY_TASK_ID",
        ends: Some(["SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX"]),
        count: Some("SLURM_ARRAY_TASK_COUNT"),
    },
    JobSystem { name: "Kubernetes", index: "JOB_COMPLETION_INDEX", ends: None, count: None },
    JobSystem {
        name: "AWS Batch",
        index: "AWS_BATCH_JOB_ARRAY_INDEX",
        ends: None,
        count: Some("AWS_BATCH_JOB_ARRAY_SIZE"),
    },
    JobSystem { name: "Google Cloud Batch", index: "BATCH_TASK_INDEX", ends: None, count: Some("BATCH_TASK_COUNT") },
    JobSystem { name: "Cloud Run", index: "CLOUD_RUN_TASK_INDEX", ends: None, count: Some("CLOUD_RUN_TASK_COUNT") },
    JobSystem { name: "SkyPilot", index: "SKYPILOT_JOB_RANK", ends: None, count: Some("SKYPILOT_NUM_JOBS") },
    JobSystem { name: "SkyPilot", index: "SKYPILOT_NODE_RANK", ends: None, count: Some("SKYPILOT_NUM_NODES") },
    JobSystem { name: "PBS", index: "PBS_ARRAY_INDEX", ends: None, count: None },
];

/// Reads a variable of the process; none if it is not set.
pub type Variables<'v> = dyn Fn(&str) -> Option<String> + 'v;

impl ShardChoice {
    /// The shard, and the variables that determined it.
    ///
    /// # Errors
    /// If the program runs in no job array, or the variables do not determine the shard.
    pub fn resolve(self, variables: &Variables<'_>) -> Result<(Shard, Vec<&'static str>)> {
        let all = match self {
            Self::This(shard) => return Ok((shard, Vec::new())),
            Self::OfTask(all) => all,
        };
        let value = |name: &str| variables(name).filter(|value| !value.is_empty());
        // A node of a job with one node, or a job that is no array, is no task.
        let is_array = |system: &&JobSystem| {
            let is_alone = system.count.and_then(value).is_some_and(|count| count == "1");
            value(system.index).is_some() && !(is_alone && (all.is_none() || system.ends.is_none()))
        };
        let found: Vec<&JobSystem> = SYSTEMS.iter().filter(is_array).collect();
        let alone = SYSTEMS.iter().find(|system| value(system.index).is_some()).filter(|_| all.is_none());
        let system = match found.as_slice() {
            [one] => *one,
            [] => match alone {
                Some(JobSystem { index, count, .. }) => {
                    return Ok((Shard::WHOLE, [Some(*index), *count].into_iter().flatten().collect()));
                }
                None => {
                    let names = SYSTEMS.map(|system| format!("{} ({})", system.index, system.name)).join(", ");
                    let message = "`options.shard` is `auto`, but no variable gives the number of a task";
                    return Err(Error::new(message)
                        .help(format!("write the shard, such as 3/10, or set one of {names}"))
                        .of_request());
                }
            },
            [first, second, ..] => {
                let message =
                    format!("`options.shard` is `auto`, but {} and {} are both set", first.index, second.index);
                return Err(Error::new(message).help("write the shard, such as 3/10").of_request());
            }
        };
        let number = |name: &'static str| -> Result<Option<u32>> {
            let Some(text) = value(name) else { return Ok(None) };
            let number = text.parse().map_err(|_| {
                Error::new(format!("{name} is {text:?}, not a number from 0"))
                    .help("write the shard, such as 3/10")
                    .of_request()
            })?;
            Ok(Some(number))
        };
        let index = number(system.index)?.unwrap_or_default();
        let mut read = vec![system.index];
        let Some(count) = all.map_or_else(|| of_array(system, &number, &mut read), |all| Ok(Some(all)))? else {
            let message = format!("{} does not tell its tasks how many they are", system.name);
            return Err(Error::new(message).help("write the number of tasks: auto/10").of_request());
        };
        // Users number the tasks of a Slurm array, often from 1.
        let first = match (system.ends, all) {
            (Some([lowest, _]), None) => number(lowest)?.unwrap_or_default(),
            _ => 0,
        };
        let shard = Shard::new(index.saturating_sub(first), count).map_err(|error| {
            let help = format!("{} is {index}: number the tasks from 0 to {}", system.index, count - 1);
            Error::new(error.message().to_owned()).help(help).of_request()
        })?;
        Ok((shard, read))
    }
}

/// The number of tasks of a job array, if its variables have it.
fn of_array(
    system: &JobSystem,
    number: &dyn Fn(&'static str) -> Result<Option<u32>>,
    read: &mut Vec<&'static str>,
) -> Result<Option<u32>> {
    let Some(name) = system.count else { return Ok(None) };
    read.push(name);
    let Some(count) = number(name)? else { return Ok(None) };
    let Some([lowest, highest]) = system.ends else { return Ok(Some(count)) };
    let (low, high) = (number(lowest)?.unwrap_or_default(), number(highest)?.unwrap_or_default());
    read.push(lowest);
    // Tasks that are submitted again alone are a smaller array, with other shards.
    if low > 1 || u64::from(high) + 1 != u64::from(low) + u64::from(count) {
        let message = format!("the array has {count} of the tasks {low} to {high}");
        let help = "write the number of tasks of the whole array, numbered from 0: auto/10";
        return Err(Error::new(message).help(help).of_request());
    }
    Ok(Some(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_scene_is_in_one_shard() {
        for (start, end, count) in [(0, 24, 3), (5, 23, 4), (0, 2, 5), (7, 8, 1)] {
            let mut seen: Vec<u32> = Vec::new();
            for index in 0..count {
                let wanted = WantedScenes { range: start..end, shard: Shard { index, count } };
                let scenes: Vec<u32> = wanted.iter().collect();
                assert!(scenes.iter().all(|&scene| wanted.has(scene)) && scenes.is_sorted());
                assert_eq!(scenes, (start..end).filter(|&scene| wanted.has(scene)).collect::<Vec<_>>());
                seen.extend(scenes);
            }
            seen.sort_unstable();
            assert_eq!(seen, (start..end).collect::<Vec<_>>());
        }
    }

    fn shard_of(choice: &str, variables: &[(&str, &str)]) -> std::result::Result<String, String> {
        let value =
            |name: &str| variables.iter().find(|(other, _)| *other == name).map(|(_, value)| (*value).to_owned());
        let choice: ShardChoice = choice.parse()?;
        choice.resolve(&value).map(|(shard, _)| shard.to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn tasks_of_job_arrays_find_their_shards() {
        let slurm = |id: &'static str, low: &'static str, high: &'static str, count: &'static str| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", low),
                ("SLURM_ARRAY_TASK_MAX", high),
                ("SLURM_ARRAY_TASK_COUNT", count),
            ]
        };
        for (choice, variables, shard) in [
            ("3/10", &[][..], "3/10"),
            ("auto", &slurm("3", "0", "9", "10"), "3/10"),
            ("auto", &slurm("10", "1", "10", "10"), "9/10"),
            ("auto/10", &slurm("3", "3", "7", "2"), "3/10"),
            ("auto/4", &[("JOB_COMPLETION_INDEX", "2")], "2/4"),
            ("auto", &[("AWS_BATCH_JOB_ARRAY_INDEX", "4"), ("AWS_BATCH_JOB_ARRAY_SIZE", "5")], "4/5"),
            ("auto", &[("SKYPILOT_NODE_RANK", "0"), ("SKYPILOT_NUM_NODES", "1")], "0/1"),
            (
                "auto",
                &[
                    ("SKYPILOT_NODE_RANK", "0"),
                    ("SKYPILOT_NUM_NODES", "1"),
                    ("SKYPILOT_JOB_RANK", "2"),
                    ("SKYPILOT_NUM_JOBS", "3"),
                ],
                "2/3",
            ),
        ] {
            assert_eq!(shard_of(choice, variables).as_deref(), Ok(shard), "{choice} {variables:?}");
        }
        for (choice, variables, word) in [
            ("10/10", &[][..], "numbered from 0"),
            ("3/0", &[], "at least one"),
            ("three", &[], "3/10"),
            ("auto", &[], "SLURM_ARRAY_TASK_ID (Slurm)"),
            ("auto", &slurm("3", "3", "7", "2"), "auto/10"),
            ("auto/10", &slurm("10", "1", "10", "10"), "from 0 to 9"),
            ("auto", &[("JOB_COMPLETION_INDEX", "2")], "auto/10"),
            ("auto/4", &[("JOB_COMPLETION_INDEX", "two")], "JOB_COMPLETION_INDEX is \"two\""),
            ("auto/4", &[("JOB_COMPLETION_INDEX", "1"), ("SLURM_ARRAY_TASK_ID", "1")], "both set"),
        ] {
            let error = shard_of(choice, variables).expect_err(choice);
            assert!(error.contains(word), "{choice} {variables:?}: {error}");
        }
    }
}
