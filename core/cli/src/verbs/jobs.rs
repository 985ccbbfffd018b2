//! Files of `syntable new slurm` and `syntable new kubernetes`: jobs that make a dataset as shards, and merge it. And of
//! `syntable new skypilot`: a job whose copies make a dataset in a bucket together.

use clap::Args;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_runtime::run::Shard;

/// The dataset of a job.
#[derive(Args)]
pub(super) struct JobArgs {
    /// Recipe.
    #[arg(long, default_value = "recipe.toml")]
    recipe: String,
    /// Folder of the merged dataset. The shards go to `<DIR>.shards`.
    #[arg(long, value_name = "DIR")]
    out: Option<String>,
    /// Number of shards.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shards: u32,
}

/// The dataset of a job whose copies claim scenes.
#[derive(Args)]
pub(super) struct WorkerArgs {
    /// Recipe.
    #[arg(long, default_value = "recipe.toml")]
    recipe: String,
    /// URL of the dataset in an object store, such as `s3://bucket/mine`.
    #[arg(long, value_name = "URL")]
    out: String,
    /// Number of workers that the first lines of the file start.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    workers: u32,
}

const SLURM: &str = include_str!("scaffold/jobs/slurm.sbatch");
const SKYPILOT: &str = include_str!("scaffold/jobs/skypilot.yaml");
const KUBERNETES: &str = include_str!("scaffold/jobs/kubernetes.yaml");
const CONTAINER: [(&str, &str); 2] = [
    ("Dockerfile", include_str!("scaffold/jobs/Dockerfile")),
    (".dockerignore", include_str!("scaffold/jobs/dockerignore")),
];

/// Name of the container image that the job names.
const IMAGE: &str = concat!("registry.example.com/syntable:", env!("CARGO_PKG_VERSION"));

impl JobArgs {
    /// The script of a Slurm array, with the name of its file.
    ///
    /// # Errors
    /// If a text has a line break.
    pub(super) fn slurm(&self, file: &str) -> Result<String, Error> {
        let [recipe, out] = self.texts("data/dataset")?.map(|text| quoted(&text));
        let values =
            [("@FILE@", quoted(file)), ("@RECIPE@", recipe), ("@OUT@", out), ("@SHARDS@", self.shards.to_string())];
        Ok(filled(SLURM, &values))
    }

    /// The files of a Kubernetes job, by name: the manifest, and the files of its container.
    ///
    /// # Errors
    /// If a text has a line break.
    pub(super) fn kubernetes(&self) -> Result<Vec<(&'static str, String)>, Error> {
        let [recipe, out] = self.texts("/data/dataset")?;
        let shards = Shard::folder_of_all(&PathBuf::from(&out)).display().to_string();
        let json = |text: &str| serde_json::to_string(text).expect("text");
        let values = [
            ("@FILE@", "job.yaml".to_owned()),
            ("@RECIPE@", json(&recipe)),
            ("@OUT@", json(&out)),
            ("@PARTS@", json(&shards)),
            ("@SHARDS@", self.shards.to_string()),
            ("@IMAGE@", IMAGE.to_owned()),
        ];
        let container = CONTAINER.map(|(name, text)| (name, text.to_owned()));
        Ok([("job.yaml", filled(KUBERNETES, &values))].into_iter().chain(container).collect())
    }

    /// The recipe and the dataset.
    fn texts(&self, out: &str) -> Result<[String; 2], Error> {
        lines([self.recipe.clone(), self.out.clone().unwrap_or_else(|| out.to_owned())])
    }
}

impl WorkerArgs {
    /// The file of a SkyPilot task, with the name of its file.
    ///
    /// # Errors
    /// If the dataset is not in an object store, or a text has a line break.
    pub(super) fn skypilot(&self, file: &str) -> Result<String, Error> {
        if !self.out.contains("://") {
            return Err(Error::new(format!("`--out {}` is a folder, and the machines share none", self.out))
                .help("name a URL such as s3://bucket/mine"));
        }
        let [recipe, out] = lines([self.recipe.clone(), self.out.clone()])?.map(|text| quoted(&text));
        let values =
            [("@FILE@", quoted(file)), ("@RECIPE@", recipe), ("@OUT@", out), ("@WORKERS@", self.workers.to_string())];
        Ok(filled(SKYPILOT, &values))
    }
}

/// Texts of a line each.
fn lines<const N: usize>(texts: [String; N]) -> Result<[String; N], Error> {
    match texts.iter().find(|text| text.contains(['\n', '\r'])) {
        Some(text) => Err(Error::new(format!("{text:?} has a line break")).help("rename the file or folder")),
        None => Ok(texts),
    }
}

/// A text with the values of its `@NAMES@`.
fn filled(text: &str, values: &[(&str, String)]) -> String {
    // A value may contain another name.
    let mut filled = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('@') {
        filled += &rest[..at];
        rest = &rest[at..];
        match values.iter().find(|(name, _)| rest.starts_with(name)) {
            Some((name, value)) => {
                filled += value;
                rest = &rest[name.len()..];
            }
            None => {
                filled.push('@');
                rest = &rest[1..];
            }
        }
    }
    filled + rest
}

/// A word of a shell script.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:".contains(c);
    match text.is_empty() || !text.chars().all(is_plain) {
        true => format!("'{}'", text.replace('\'', r"'\''")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn scripts_keep_paths_as_they_are() {
        let (recipe, out) = ("it's $HOME/\"a\" @OUT@.toml", "data/`x` y");
        let args = JobArgs { recipe: recipe.into(), out: Some(out.into()), shards: 3 };
        let script = args.slurm("my job.sbatch").expect("a script");
        let variables = script.split("\n\n").find(|part| part.starts_with("recipe=")).expect("variables");
        let shown = format!("{variables}\nprintf '%s\\n' \"$recipe\" \"$dataset\" \"$shards\"");
        let output = Command::new("sh").args(["-c", &shown]).output().expect("a shell runs");
        assert_eq!(String::from_utf8_lossy(&output.stdout), format!("{recipe}\n{out}\n3\n"));
        let manifest = args.kubernetes().expect("files").remove(0).1;
        for text in [recipe, out, "data/`x` y.shards"] {
            assert!(manifest.contains(&serde_json::to_string(text).expect("text")), "{manifest}");
        }
        assert!(!manifest.contains("@SHARDS@") && !manifest.contains("@IMAGE@") && !script.contains("@FILE@"));
        assert!(JobArgs { out: Some("a\nb".into()), ..args }.slurm("x").is_err());
    }

    #[test]
    fn a_worker_of_skypilot_tries_again_after_a_failure_of_the_store_alone() {
        let args = WorkerArgs { recipe: "it's $A.toml".into(), out: "s3://bucket/a b".into(), workers: 4 };
        let task = args.skypilot("job.yaml").expect("a task");
        let run = task.split_once("run: |\n").expect("a script").1;
        let script: String = run.lines().map(|line| format!("{}\n", line.trim_start_matches("  "))).collect();
        for (codes, ends, calls) in [("0", 0, 1), ("2", 2, 1), ("1 1 3", 3, 3), ("1 1 1 1", 1, 4)] {
            let fake =
                "sleep() { :; }\nsyntable() { echo \"$*\"; set -- $codes; code=$1; shift; codes=$*; return $code; }\n";
            let output =
                Command::new("sh").args(["-c", &format!("codes='{codes}'\n{fake}{script}")]).output().expect("a shell");
            let shown = String::from_utf8_lossy(&output.stdout).into_owned();
            assert_eq!(shown, "run it's $A.toml --out s3://bucket/a b --claim\n".repeat(calls), "{codes}");
            assert_eq!(output.status.code(), Some(ends), "{codes}");
        }
        assert!(task.contains("seq 4)") && !task.contains("@OUT@"), "{task}");
        let folder = WorkerArgs { out: "data/mine".into(), ..args };
        assert!(folder.skypilot("job.yaml").is_err_and(|error| error.to_string().contains("s3://bucket/mine")));
    }
}
