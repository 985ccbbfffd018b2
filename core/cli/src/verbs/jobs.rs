//! Files of `syntable new slurm` and `syntable new kubernetes`: jobs that make a dataset as shards, and merge it. And of
//! `syntable new skypilot`: a job whose copies make a dataset in a bucket together.

use crate::shell::quoted;
use clap::Args;
use std::path::{Component, Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::store::is_url;
use syntable_recipe::{BUILTIN_PREFIX, Source};
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
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=i64::from(Shard::MOST)))]
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

/// Where each pod mounts the volume of the datasets.
const MOUNT: &str = "/data";
/// The part of a pod that mounts this volume.
const VOLUME: &str = include_str!("scaffold/jobs/volume.yaml");
/// How the file names of recipes end that the container file copies.
const COPIED: &str = "toml";

/// Name of the container image that the job names.
const IMAGE: &str = concat!("registry.example.com/syntable:", env!("CARGO_PKG_VERSION"));

impl JobArgs {
    /// The script of a Slurm array, with the path of its file.
    ///
    /// # Errors
    /// If the recipe cannot be read, or a text has a line break.
    pub(super) fn slurm(&self, file: &Path) -> Result<String, Error> {
        readable(&self.recipe, &[Path::new("")])?;
        self.script(&file.display().to_string())
    }

    fn script(&self, file: &str) -> Result<String, Error> {
        let [recipe, out] = self.texts("data/dataset")?.map(|text| quoted(&text));
        let values =
            [("@FILE@", quoted(file)), ("@RECIPE@", recipe), ("@OUT@", out), ("@SHARDS@", self.shards.to_string())];
        Ok(filled(SLURM, &values))
    }

    /// The files of a Kubernetes job, by name: the manifest, and the files of its container.
    ///
    /// # Errors
    /// If the container would lack the recipe, the dataset would be lost with the pods, or a text has a line break.
    pub(super) fn kubernetes(&self) -> Result<Vec<(&'static str, String)>, Error> {
        copied(&self.recipe, &[Path::new("")])?;
        if !self.recipe.starts_with(BUILTIN_PREFIX) && Path::new(&self.recipe).extension().is_none_or(|it| it != COPIED)
        {
            let message = format!(
                "`--recipe {}` does not end in `.{COPIED}`, as all recipes that the container gets",
                self.recipe
            );
            return Err(Error::new(message).help(format!("rename the recipe, such as to {}.{COPIED}", self.recipe)));
        }
        self.manifest()
    }

    fn manifest(&self) -> Result<Vec<(&'static str, String)>, Error> {
        let [recipe, out] = self.texts(&format!("{MOUNT}/dataset"))?;
        let (needs, volume) = match is_url(&out) {
            true => (
                "The pods need access to the bucket: a role of their service account, or variables with credentials.",
                "",
            ),
            false if is_on_volume(&out) => {
                ("The claim `datasets` is a volume that all nodes can write (ReadWriteMany).", VOLUME)
            }
            false => {
                let message = format!("`--out {out}` is not below {MOUNT}: the shards would be lost with their pods");
                let help = format!(
                    "name a path below {MOUNT}, the volume of all pods, such as {MOUNT}/mine, or a URL such as s3://bucket/mine"
                );
                return Err(Error::new(message).help(help));
            }
        };
        let shards = Shard::folder_of_all(&PathBuf::from(&out)).display().to_string();
        let values = [
            ("@FILE@", "job.yaml".to_owned()),
            ("@NEEDS@", needs.to_owned()),
            ("@VOLUME@\n", filled(volume, &[("@MOUNT@", MOUNT.to_owned())])),
            ("@RECIPE@", argument(&recipe)),
            ("@OUT@", argument(&out)),
            ("@PARTS@", argument(&shards)),
            ("@SHARDS@", self.shards.to_string()),
            ("@IMAGE@", IMAGE.to_owned()),
        ];
        let container = CONTAINER.map(|(name, text)| (name, filled(text, &[("@COPIED@", COPIED.to_owned())])));
        Ok([("job.yaml", filled(KUBERNETES, &values))].into_iter().chain(container).collect())
    }

    /// The recipe and the dataset. The dataset has no slash at its end, so that `.shards` can follow it.
    fn texts(&self, out: &str) -> Result<[String; 2], Error> {
        let out = self.out.as_deref().unwrap_or(out);
        let trimmed = out.trim_end_matches('/');
        let out = if trimmed.is_empty() { out } else { trimmed };
        lines([self.recipe.clone(), out.to_owned()])
    }
}

impl WorkerArgs {
    /// The file of a SkyPilot task, with the path of its file.
    ///
    /// # Errors
    /// If the machines would lack the recipe, the dataset is not in an object store, or a text has a line break.
    pub(super) fn skypilot(&self, file: &Path) -> Result<String, Error> {
        copied(&self.recipe, &[Path::new(""), file.parent().unwrap_or(Path::new(""))])?;
        self.task(&file.display().to_string())
    }

    fn task(&self, file: &str) -> Result<String, Error> {
        if !is_url(&self.out) {
            return Err(Error::new(format!("`--out {}` is a folder, and the machines share none", self.out))
                .help("name a URL such as s3://bucket/mine"));
        }
        let [recipe, out] = lines([self.recipe.clone(), self.out.clone()])?.map(|text| quoted(&text));
        let values =
            [("@FILE@", quoted(file)), ("@RECIPE@", recipe), ("@OUT@", out), ("@WORKERS@", self.workers.to_string())];
        Ok(filled(SKYPILOT, &values))
    }
}

/// Refuses a recipe that no other machine gets with a folder, and one that is in none of `folders`.
fn copied(recipe: &str, folders: &[&Path]) -> Result<(), Error> {
    let is_inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if !recipe.starts_with(BUILTIN_PREFIX) && !Path::new(recipe).components().all(is_inside) {
        let name = Path::new(recipe).file_name().map_or_else(|| "recipe.toml".into(), |name| name.to_string_lossy());
        return Err(Error::new(format!(
            "`--recipe {recipe}` is outside the folder that the job copies to its machines"
        ))
        .help(format!("copy the recipe with its assets to this folder, and write --recipe {}", quoted(&name))));
    }
    readable(recipe, folders)
}

/// Refuses a recipe that is not built in and cannot be read in any of `folders`.
fn readable(recipe: &str, folders: &[&Path]) -> Result<(), Error> {
    let read = |folder: &&Path| match recipe.starts_with(BUILTIN_PREFIX) {
        true => Source::read(recipe),
        false => Source::read(folder.join(recipe)),
    };
    let Some(first) = folders.first().map(read) else { return Ok(()) };
    match first {
        Err(error) if !folders[1..].iter().any(|folder| read(folder).is_ok()) => Err(match error.help_text() {
            Some(_) => error,
            None => error.help(format!(
                "name a recipe of this folder with --recipe; `syntable new recipe {recipe}` starts one, and builtin:quickstart needs no file"
            )),
        }),
        _ => Ok(()),
    }
}

/// Whether a path is below the volume of all pods.
fn is_on_volume(out: &str) -> bool {
    let Ok(below) = Path::new(out).strip_prefix(MOUNT) else { return false };
    below.file_name().is_some() && below.components().all(|part| matches!(part, Component::Normal(_)))
}

/// An argument in the manifest of a pod. Kubernetes reads `$$` as `$`, and `$(NAME)` as a variable.
fn argument(text: &str) -> String {
    serde_json::to_string(&text.replace('$', "$$")).expect("text")
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn scripts_keep_paths_as_they_are() {
        let (recipe, out) = ("it's $HOME/\"a\" @OUT@.toml", "data/`x` y");
        let args = JobArgs { recipe: recipe.into(), out: Some(out.into()), shards: 3 };
        let script = args.script("my job.sbatch").expect("a script");
        let variables = script.split("\n\n").find(|part| part.starts_with("recipe=")).expect("variables");
        let shown = format!("{variables}\nprintf '%s\\n' \"$recipe\" \"$dataset\" \"$shards\"");
        let output = Command::new("sh").args(["-c", &shown]).output().expect("a shell runs");
        assert_eq!(String::from_utf8_lossy(&output.stdout), format!("{recipe}\n{out}\n3\n"));
        assert!(!script.contains("@FILE@"));
        let slash = JobArgs { out: Some("data/mine/".into()), ..args };
        assert!(slash.script("x").is_ok_and(|script| script.contains("dataset=data/mine\n")));
        assert!(JobArgs { out: Some("a\nb".into()), ..slash }.script("x").is_err());
    }

    /// The lists of arguments in a manifest, as the program gets them in a pod.
    fn arguments(manifest: &str) -> Vec<Vec<String>> {
        let lists = manifest.lines().filter_map(|line| line.trim_start().strip_prefix("args: "));
        let mut all: Vec<Vec<String>> = lists.map(|list| serde_json::from_str(list).expect("a list")).collect();
        for text in all.iter_mut().flatten() {
            // The rule of Kubernetes: `$$` is `$`, and `$(NAME)` is a variable, here an empty one.
            let (mut read, mut rest) = (String::new(), text.as_str());
            while let Some((before, after)) = rest.split_once('$') {
                read += before;
                (read, rest) =
                    match (after.strip_prefix('$'), after.strip_prefix('(').and_then(|it| it.split_once(')'))) {
                        (Some(after), _) => (read + "$", after),
                        (None, Some((_, after))) => (read, after),
                        (None, None) => (read + "$", after),
                    };
            }
            *text = read + rest;
        }
        all
    }

    #[test]
    fn pods_get_paths_as_they_are() {
        let (recipe, out) = ("it's $(HOME) $$(A) $ \"a\" @OUT@.toml", "/data/`x` $(HOSTNAME) y");
        let args = JobArgs { recipe: recipe.into(), out: Some(out.into()), shards: 3 };
        let manifest = args.manifest().expect("files").remove(0).1;
        let shards = format!("{out}.shards");
        let run = ["run", recipe, "--out", out, "--shard", "auto/3"];
        assert_eq!(arguments(&manifest), [run.to_vec(), vec!["merge", out, &shards]]);
        assert_eq!(manifest.matches(&format!("mountPath: {MOUNT}\n")).count(), 2);
        let left = ["@SHARDS@", "@IMAGE@", "@VOLUME@", "@NEEDS@", "@MOUNT@"];
        assert!(left.iter().all(|name| !manifest.contains(name)), "{manifest}");
        let bucket = JobArgs { out: Some("s3://bucket/mine".into()), ..args };
        let manifest = bucket.manifest().expect("files").remove(0).1;
        assert!(!manifest.contains("olume") && !manifest.contains("\n\n"), "{manifest}");
        assert_eq!(arguments(&manifest)[1], ["merge", "s3://bucket/mine", "s3://bucket/mine.shards"]);
    }

    #[test]
    fn pods_write_to_a_bucket_or_to_their_volume() {
        let of = |out: &str| JobArgs { recipe: "a.toml".into(), out: Some(out.into()), shards: 3 }.manifest();
        for out in ["/data/mine", "/data/sets//mine/", "gs://bucket/mine"] {
            assert!(of(out).is_ok(), "{out}");
        }
        for out in ["data/mine", "/data", "/data/", "/data/../mine", "/data/..", "/database/mine", "/mnt/mine", "s3:/a"]
        {
            let error = of(out).expect_err(out).to_string();
            assert!(error.contains("below /data") && error.contains("/data/mine, or a URL"), "{error}");
        }
    }

    #[test]
    fn machines_get_the_recipe() {
        let folder = tempfile::tempdir().expect("a folder");
        let (here, jobs) = (folder.path().join("here"), folder.path().join("jobs"));
        for folder in [&here, &jobs] {
            std::fs::create_dir(folder).expect("a folder");
        }
        for file in [here.join("a.toml"), jobs.join("b.toml")] {
            std::fs::write(file, "").expect("writable");
        }
        let said =
            |recipe: &str| copied(recipe, &[&here, &jobs]).map_or_else(|error| error.to_string(), |()| String::new());
        for recipe in ["a.toml", "./a.toml", "b.toml", "builtin:quickstart"] {
            assert_eq!(said(recipe), "");
        }
        let outside = here.join("a.toml");
        for recipe in ["../here/a.toml", &outside.display().to_string(), "x/../a.toml"] {
            let error = said(recipe);
            assert!(error.contains("outside the folder") && error.contains("--recipe a.toml"), "{error}");
        }
        assert!(said("c.toml").contains("`syntable new recipe c.toml` starts one"));
        assert!(said("builtin:quick").contains("builtin:quickstart"));
        let error = readable("none/c.toml", &[Path::new("")]).expect_err("missing").to_string();
        assert!(error.contains("none/c.toml") && error.contains("builtin:quickstart needs no file"), "{error}");
        let args = |recipe: &str| JobArgs { recipe: recipe.into(), out: None, shards: 3 };
        let manifest = args("Cargo.toml").kubernetes().expect("files");
        assert!(manifest.iter().any(|(name, text)| *name == ".dockerignore" && text.contains("!**/*.toml\n")));
        let error = args("src/lib.rs").kubernetes().expect_err("not copied").to_string();
        assert!(error.contains("does not end in `.toml`"), "{error}");
        assert!(args("builtin:quickstart").kubernetes().is_ok() && args("c.toml").slurm(Path::new("x")).is_err());
    }

    #[test]
    fn a_worker_of_skypilot_tries_again_after_a_failure_of_the_store_alone() {
        let args = WorkerArgs { recipe: "it's $A.toml".into(), out: "s3://bucket/a b".into(), workers: 4 };
        let task = args.task("job.yaml").expect("a task");
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
        assert!(folder.task("job.yaml").is_err_and(|error| error.to_string().contains("s3://bucket/mine")));
    }
}
