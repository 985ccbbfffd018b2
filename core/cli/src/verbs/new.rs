//! `syntable new`: recipes and plugins to start from.

use super::list::products;
use super::template::{TEMPLATES, Template, crates};
use crate::{Console, Exit};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::fs;
use std::path::{Component, Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::registry::{Registry, Slot};
use syntable_runtime::durable::{self, Draft};
use syntable_runtime::recipe::{BUILTINS, Builtin, schema_text};

#[derive(Args)]
pub(crate) struct NewArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Write a recipe to start from, and next to it the schema with which editors complete and check it.
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
        /// Name of the crate and of what it adds, snake_case.
        name: String,
        /// What the plugin adds: a stage of a slot, or another thing.
        #[arg(long, default_value = "annotate", value_parser = slots())]
        slot: &'static Template,
        /// Output folder, which must not exist yet. Default: the name.
        #[arg(long)]
        path: Option<PathBuf>,
        /// Folder of the SynTable sources that the crate depends on.
        #[arg(long, value_name = "DIR")]
        syntable: Option<PathBuf>,
    },
}

/// Words that cannot name a crate: Rust's keywords, and the crates that every program has.
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

pub(crate) fn new(console: &Console, registry: &Registry, args: &NewArgs) -> Result<(), Exit> {
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
            let (file, schema) = (file.display(), schema.display());
            console.print(&format!("wrote {file}\nwrote {schema}\nnext: syntable run {file} --out data\n"))
        }
        What::Plugin { name, slot, path, syntable } => {
            let folder = path.clone().unwrap_or_else(|| PathBuf::from(name));
            plugin(registry, slot, name, &folder, syntable.as_deref())?;
            let (folder, show) = (folder.display(), slot.renamed(slot.show, name));
            console.print(&format!("wrote {folder}\nnext: cd {folder} && cargo run --release -- {show}\n"))
        }
    }
}

/// The recipe of the program that `--extends` names; a file is not one.
fn base(name: &str) -> Result<&'static Builtin, Error> {
    let short = name.strip_prefix("builtin:").unwrap_or(name);
    Builtin::find(short).map_err(|error| {
        if name.starts_with("builtin:") || !(short.ends_with(".toml") || Path::new(short).exists()) {
            return error;
        }
        let names: Vec<&str> = BUILTINS.iter().map(|builtin| builtin.name).collect();
        Error::new(format!("--extends takes a recipe of the program, and `{name}` is a file")).help(format!(
            "the recipes of the program are {}; to extend a file, write a recipe that begins with: extends = \"{name}\"",
            names.join(", ")
        ))
    })
}

/// The values of `--slot`.
fn slots() -> impl TypedValueParser<Value = &'static Template> {
    let values = TEMPLATES.iter().map(|template| PossibleValue::new(template.slot).help(template.doc));
    PossibleValuesParser::new(values)
        .try_map(|slot| Template::find(&slot).ok_or_else(|| format!("`{slot}` has no template")))
}

fn plugin(
    registry: &Registry,
    template: &Template,
    name: &str,
    folder: &Path,
    syntable: Option<&Path>,
) -> Result<(), Exit> {
    let sound = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if !sound {
        return Err(Exit::wrong(
            Error::new(format!("`{name}` is not snake_case"))
                .help("use small letters, digits and _, with a letter first"),
        ));
    }
    if KEYWORDS.contains(&name) {
        return Err(Exit::wrong(
            Error::new(format!("`{name}` is a word of Rust or one of its crates")).help("choose another name"),
        ));
    }
    if let Some(taken) = taken(registry, name) {
        return Err(Exit::wrong(Error::new(format!("`{name}` is {taken} already")).help("choose another name")));
    }
    if folder.exists() {
        // A call that was killed at its very end leaves the whole folder, and something beside it.
        let _ = durable::mend(folder);
        return Err(Exit::wrong(Error::new("it exists already").in_file(folder).help("choose another --path")));
    }
    // A binary built from a checkout knows where that is; otherwise the published crates of this version serve.
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let sources = syntable.map(Path::to_owned).or_else(|| built_from.join("core/model").is_dir().then_some(built_from));
    let whole = |path: &Path| path.canonicalize().map_err(|error| Exit::wrong(Error::io(path, &error)));
    let own = syntable_runtime::paths::whole(&std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()));
    let dependency = |crate_folder: &str| match &sources {
        // A relative path, so that the two folders can move together.
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
    // The versions that the program was tested with. Cargo takes out what the crate does not need.
    if let Some(lock) = sources.map(|root| root.join("Cargo.lock")).filter(|lock| lock.is_file()) {
        let text = fs::read_to_string(&lock).map_err(|error| Exit::wrong(Error::io(&lock, &error)))?;
        files.push(("Cargo.lock", text));
    }
    let draft = Draft::begin(folder).map_err(Exit::stopped)?;
    files.iter().try_for_each(|(path, text)| draft.write(path, text.as_bytes())).map_err(Exit::stopped)?;
    draft.publish().map_err(Exit::stopped)
}

/// What already has a name that a plugin would give its crate, its kind, its product or its verb.
fn taken(registry: &Registry, name: &str) -> Option<String> {
    let entry = registry.entries().iter().find(|entry| entry.kind == name);
    match entry {
        Some(entry) => Some(format!("a kind of `{}`", entry.slot)),
        None if products(registry).iter().any(|(key, _)| key.product == name) => Some("a product".to_owned()),
        None if registry.checks().iter().any(|check| check.name() == name) => Some("a check of labels".to_owned()),
        None if registry.formats().iter().any(|format| format.name() == name) => Some("a dataset format".to_owned()),
        None if crate::whole().find_subcommand(name).is_some() => Some("a verb of the program".to_owned()),
        None if Slot::ALL.iter().any(|slot| slot.name() == name) => Some("a section of recipes".to_owned()),
        None if crates().any(|it| it == name) => Some("a crate that the plugin needs".to_owned()),
        None => None,
    }
}

/// The way from one absolute folder to another.
fn relative(from: &Path, to: &Path) -> PathBuf {
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(to.components().skip(shared)).collect()
}

/// Writes the schema of this program, over that of an earlier one.
fn write_schema(registry: &Registry, folder: &Path) -> Result<PathBuf, Exit> {
    let path = folder.join(SCHEMA);
    let ours = |text: &str| text.contains("\"title\": \"SynTable recipe\"");
    match fs::read_to_string(&path) {
        Ok(text) if !ours(&text) => {
            Err(Exit::wrong(Error::new("it is another schema").in_file(&path).help("choose another folder")))
        }
        _ => {
            durable::write_file(&path, schema_text(registry).as_bytes()).map_err(Exit::stopped)?;
            Ok(path)
        }
    }
}

/// Writes a file that must not be there yet, in a folder that is made if need be.
fn create(path: &Path, text: &str) -> Result<(), Exit> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| Exit::wrong(Error::io(path, &error)))?;
    }
    durable::create_file(path, text.as_bytes()).map_err(Exit::stopped)
}
