//! `syntable new`: starts recipes and plugins.

use super::jobs::{JobArgs, WorkerArgs};
use super::list::products;
use super::template::{CrateTemplate, TEMPLATES, crates};
use crate::console::Console;
use crate::exit::Exit;
use crate::shell::quoted;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::fs;
use std::path::{Component, Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::registry::{Registry, Slot};
use syntable_recipe::{BUILTINS, Builtin, schema_text};
use syntable_runtime::durable::{self, Draft};

#[derive(Args)]
pub(crate) struct NewArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Write a starter recipe, and next to it the schema that editors use to complete and check it.
    #[command(after_help = "Examples:
  syntable new recipe my.toml && syntable run my.toml --out data       a whole recipe, with comments
  syntable new recipe my.toml --extends builtin:window-room            a few changes to a built-in recipe")]
    Recipe {
        /// Output file. It must not exist yet.
        #[arg(default_value = "recipe.toml")]
        file: PathBuf,
        /// Extend a built-in recipe instead: `builtin:NAME` (see `syntable list recipes`).
        #[arg(long, value_name = "RECIPE")]
        extends: Option<String>,
    },
    /// Write a plugin crate: a small working example, its test, and a binary that links it with all stock plugins.
    #[command(after_help = "Examples:
  syntable new plugin visible_area && cd visible_area && cargo run --release -- run recipe.toml --out data
  syntable new plugin my_noise --slot sensor
  syntable new plugin my_layout --slot dataset-format     a reader of datasets")]
    Plugin {
        /// Name of the crate and of its addition, snake_case.
        name: String,
        /// Kind of plugin: a stage of a slot, or another extension.
        #[arg(long, default_value = "annotate", value_parser = slots())]
        slot: &'static CrateTemplate,
        /// Output folder, which must not exist yet. Default: the name.
        #[arg(long)]
        path: Option<PathBuf>,
        /// Folder of the SynTable sources that the crate depends on.
        #[arg(long, value_name = "DIR")]
        syntable: Option<PathBuf>,
    },
    /// Write the script of a Slurm array that makes a dataset as shards, and merges it.
    #[command(after_help = "Example:
  syntable new slurm job.sbatch --recipe my.toml --out /shared/mine --shards 20 && bash job.sbatch")]
    Slurm {
        /// Output file. It must not exist yet.
        #[arg(default_value = "job.sbatch")]
        file: PathBuf,
        #[command(flatten)]
        job: JobArgs,
    },
    /// Write the manifest of a Kubernetes Indexed Job that makes a dataset as shards, a second Job that merges it, and a
    /// container file.
    #[command(after_help = "Example:
  syntable new kubernetes job --recipe my.toml --out /data/mine --shards 20")]
    Kubernetes {
        /// Output folder, which must not exist yet.
        #[arg(default_value = "kubernetes")]
        folder: PathBuf,
        #[command(flatten)]
        job: JobArgs,
    },
    /// Write a SkyPilot task whose copies make a dataset in a bucket together, on spot machines.
    #[command(after_help = "Example:
  syntable new skypilot job.yaml --recipe my.toml --out s3://bucket/mine --workers 20")]
    Skypilot {
        /// Output file. It must not exist yet.
        #[arg(default_value = "job.yaml")]
        file: PathBuf,
        #[command(flatten)]
        job: WorkerArgs,
    },
}

/// Words that cannot name a crate: Rust's keywords, and the crates of every program.
const KEYWORDS: [&str; 57] = [
    "abstract",
    "alloc",
    "as",
    "async",
    "await",
    "become",
    "box",
    "break",
    "const",
    "continue",
    "core",
    "crate",
    "do",
    "dyn",
    "else",
    "enum",
    "extern",
    "false",
    "final",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "let",
    "loop",
    "macro",
    "match",
    "mod",
    "move",
    "mut",
    "override",
    "priv",
    "proc_macro",
    "pub",
    "ref",
    "return",
    "self",
    "static",
    "std",
    "struct",
    "super",
    "syntable",
    "test",
    "trait",
    "true",
    "try",
    "type",
    "typeof",
    "unsafe",
    "unsized",
    "use",
    "virtual",
    "where",
    "while",
    "yield",
];

/// The schema that recipes in a folder share.
const SCHEMA: &str = "recipe.schema.json";

const EXTENDING: &str = include_str!("scaffold/extending.toml");
const RECIPE: &str = include_str!("scaffold/recipe.toml");

/// `program` is the command line, whose verbs a plugin must not repeat.
pub(crate) fn new(console: &Console, registry: &Registry, args: &NewArgs, program: &clap::Command) -> Result<(), Exit> {
    match &args.what {
        What::Recipe { file, extends } => {
            let text = match extends {
                Some(name) => {
                    base(name).map_err(Exit::wrong)?;
                    EXTENDING.replace("@BASE@", &format!("builtin:{}", name.trim_start_matches("builtin:")))
                }
                None => RECIPE.to_owned(),
            };
            create(file, &text)?;
            let schema = write_schema(registry, file.parent().unwrap_or(Path::new("")))?;
            let (file, schema, word) = (file.display(), schema.display(), word(file));
            console.print(&format!("wrote {file}\nwrote {schema}\nnext: syntable run {word} --out data\nhow long it takes: syntable plan {word} --time\n"))
        }
        What::Plugin { name, slot, path, syntable } => {
            let folder = path.clone().unwrap_or_else(|| PathBuf::from(name));
            plugin((registry, program), slot, name, &folder, syntable.as_deref())?;
            let (word, folder, show) = (word(&folder), folder.display(), slot.renamed(slot.show, name));
            console.print(&format!("wrote {folder}\nnext: cd {word} && cargo run --release -- {show}\n"))
        }
        What::Slurm { file, job } => {
            let text = job.slurm(file).map_err(Exit::wrong)?;
            create(file, &text)?;
            let (file, word) = (file.display(), word(file));
            console.print(&format!(
                "wrote {file}\nnext: set the memory, the time and the partition in it, then: bash {word}\n"
            ))
        }
        What::Skypilot { file, job } => {
            let text = job.skypilot(file).map_err(Exit::wrong)?;
            create(file, &text)?;
            let file = file.display();
            console.print(&format!(
                "wrote {file}\nnext: copy the wheel, the recipe and its assets beside it, and follow its first lines\n"
            ))
        }
        What::Kubernetes { folder, job } => {
            let files = job.kubernetes().map_err(Exit::wrong)?;
            if folder.exists() {
                return Err(Exit::wrong(Error::new("the folder exists").in_file(folder).help("choose another folder")));
            }
            let draft = Draft::begin(folder).map_err(Exit::stopped)?;
            files.iter().try_for_each(|(name, text)| draft.write(name, text.as_bytes())).map_err(Exit::stopped)?;
            draft.publish().map_err(Exit::stopped)?;
            let folder = folder.display();
            console.print(&format!(
                "wrote {folder}\nnext: copy the wheel, the recipe and its assets to {folder}, name your registry in job.yaml, and follow its first lines\n"
            ))
        }
    }
}

/// A path in a command that the program suggests.
fn word(path: &Path) -> String {
    quoted(&path.display().to_string())
}

/// The built-in recipe that `--extends` names. A file is refused.
fn base(name: &str) -> Result<&'static Builtin, Error> {
    let short = name.strip_prefix("builtin:").unwrap_or(name);
    Builtin::find(short).map_err(|error| {
        if name.starts_with("builtin:") || !(short.ends_with(".toml") || Path::new(short).exists()) {
            return error;
        }
        let names: Vec<&str> = BUILTINS.iter().map(|builtin| builtin.name).collect();
        Error::new(format!("--extends takes a built-in recipe, but `{name}` is a file")).help(format!(
            "built-in recipes: {}; to extend a file, write a recipe that begins with: extends = \"{name}\"",
            names.join(", ")
        ))
    })
}

/// The values of `--slot`.
fn slots() -> impl TypedValueParser<Value = &'static CrateTemplate> {
    let values = TEMPLATES.iter().map(|template| PossibleValue::new(template.slot).help(template.doc));
    PossibleValuesParser::new(values)
        .try_map(|slot| CrateTemplate::find(&slot).ok_or_else(|| format!("`{slot}` has no template")))
}

fn plugin(
    (registry, program): (&Registry, &clap::Command),
    template: &CrateTemplate,
    name: &str,
    folder: &Path,
    syntable: Option<&Path>,
) -> Result<(), Exit> {
    let sound = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if !sound {
        return Err(Exit::wrong(
            Error::new(format!("`{name}` is not in snake_case"))
                .help("use lower-case letters, digits and _, starting with a letter"),
        ));
    }
    if KEYWORDS.contains(&name) {
        return Err(Exit::wrong(
            Error::new(format!("`{name}` is a Rust keyword or a standard crate")).help("choose another name"),
        ));
    }
    if let Some(taken) = taken(registry, program, name) {
        return Err(Exit::wrong(Error::new(format!("`{name}` is already {taken}")).help("choose another name")));
    }
    if folder.exists() {
        // A call that was killed in its last step leaves the complete folder and a temporary file.
        let _ = durable::mend(folder);
        return Err(Exit::wrong(Error::new("the folder exists").in_file(folder).help("choose another --path")));
    }
    // A binary built from a checkout knows its path; any other binary depends on the published crates of its version.
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let sources = syntable.map(Path::to_owned).or_else(|| built_from.join("core/model").is_dir().then_some(built_from));
    let whole = |path: &Path| path.canonicalize().map_err(|error| Exit::wrong(Error::io(path, &error)));
    let own = syntable_runtime::paths::whole(&std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()));
    let dependency = |crate_folder: &str| match &sources {
        // A relative path lets the two folders move together.
        Some(root) => {
            let path = relative(&own, &whole(&root.join(crate_folder))?);
            Ok(format!("{{ path = {:?} }}", path.display().to_string()))
        }
        None => Ok(format!("{:?}", env!("CARGO_PKG_VERSION"))),
    };
    let mut files = template.crate_files(name, dependency)?;
    if template.stage().is_some() {
        files.push((SCHEMA, schema_text(registry)));
    }
    // The versions that the program was tested with. Cargo removes unneeded ones.
    if let Some(lock) = sources.map(|root| root.join("Cargo.lock")).filter(|lock| lock.is_file()) {
        let text = fs::read_to_string(&lock).map_err(|error| Exit::wrong(Error::io(&lock, &error)))?;
        files.push(("Cargo.lock", text));
    }
    let draft = Draft::begin(folder).map_err(Exit::stopped)?;
    files.iter().try_for_each(|(path, text)| draft.write(path, text.as_bytes())).map_err(Exit::stopped)?;
    draft.publish().map_err(Exit::stopped)
}

/// Describes the existing item whose name the plugin's crate, kind, product or verb would repeat.
fn taken(registry: &Registry, program: &clap::Command, name: &str) -> Option<String> {
    let entry = registry.entries().iter().find(|entry| entry.kind == name);
    match entry {
        Some(entry) => Some(format!("a kind of `{}`", entry.slot)),
        None if products(registry).iter().any(|(key, _)| key.product == name) => Some("a product".to_owned()),
        None if registry.checks().iter().any(|check| check.name() == name) => Some("a check of labels".to_owned()),
        None if registry.formats().iter().any(|format| format.name() == name) => Some("a dataset format".to_owned()),
        None if program.find_subcommand(name).is_some() => Some("a verb of the program".to_owned()),
        None if Slot::ALL.iter().any(|slot| slot.name() == name) => Some("a section of recipes".to_owned()),
        None if crates().any(|it| it == name) => Some("a crate that the plugin needs".to_owned()),
        None => None,
    }
}

/// The relative path between two absolute folders.
fn relative(from: &Path, to: &Path) -> PathBuf {
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(to.components().skip(shared)).collect()
}

/// Writes the schema of this program, replacing the schema of an earlier version.
fn write_schema(registry: &Registry, folder: &Path) -> Result<PathBuf, Exit> {
    let path = folder.join(SCHEMA);
    let ours = |text: &str| text.contains("\"title\": \"SynTable recipe\"");
    match fs::read_to_string(&path) {
        Ok(text) if !ours(&text) => Err(Exit::wrong(
            Error::new("the file is not a schema of SynTable recipes").in_file(&path).help("choose another folder"),
        )),
        _ => {
            durable::write_file(&path, schema_text(registry).as_bytes()).map_err(Exit::stopped)?;
            Ok(path)
        }
    }
}

/// Writes a new file, and creates its folder.
fn create(path: &Path, text: &str) -> Result<(), Exit> {
    durable::check_here(path).map_err(Exit::stopped)?;
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| Exit::wrong(Error::io(path, &error)))?;
    }
    durable::create_file(path, text.as_bytes()).map_err(Exit::stopped)
}
