//! `syntable new`: recipes and plugins to start from.

use super::{Console, Exit};
use clap::{Args, Subcommand};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;

#[derive(Args)]
pub(super) struct NewArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Write a commented recipe to start from.
    #[command(after_help = "Example:
  syntable new recipe my.toml && syntable run my.toml --out data")]
    Recipe {
        /// The file to write; it must not exist yet.
        #[arg(default_value = "recipe.toml")]
        file: PathBuf,
    },
    /// Write a plugin crate with an annotator, and a binary that links it with all stock plugins.
    #[command(after_help = "Example:
  syntable new plugin visible_area && cd visible_area && cargo run --release -- list products")]
    Plugin {
        /// Name of the crate and of the annotator's kind, snake_case.
        name: String,
        /// Folder to write to; the name if left out. It must not exist yet.
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

const RECIPE: &str = include_str!("scaffold/recipe.toml");
const MANIFEST: &str = include_str!("scaffold/Cargo.toml.txt");
const LIBRARY: &str = include_str!("scaffold/lib.rs.txt");
const MAIN: &str = include_str!("scaffold/main.rs.txt");
const PLUGIN_RECIPE: &str = include_str!("scaffold/plugin_recipe.toml");

pub(super) fn new(console: &Console, args: &NewArgs) -> Result<(), Exit> {
    match &args.what {
        What::Recipe { file } => {
            write(file, RECIPE)?;
            let file = file.display();
            console.print(&format!("wrote {file}\nnext: syntable run {file} --out data\n"))
        }
        What::Plugin { name, path, syntable } => {
            let folder = path.clone().unwrap_or_else(|| PathBuf::from(name));
            plugin(name, &folder, syntable.as_deref())?;
            let folder = folder.display();
            console.print(&format!(
                "wrote {folder}\nnext: cd {folder} && cargo run --release -- run recipe.toml --out data\n"
            ))
        }
    }
}

fn plugin(name: &str, folder: &Path, syntable: Option<&Path>) -> Result<(), Exit> {
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
    if folder.exists() {
        return Err(Exit::wrong(Error::new("it exists already").in_file(folder).help("choose another --path")));
    }
    // A binary built from a checkout knows where that is; otherwise the published crates of this version serve.
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let sources = syntable.map(Path::to_owned).or_else(|| built_from.join("core/model").is_dir().then_some(built_from));
    let dependency = |crate_folder: &str| match &sources {
        Some(root) => {
            let path = root.join(crate_folder);
            let path = path.canonicalize().map_err(|error| Exit::wrong(Error::io(&path, &error)))?;
            Ok(format!("{{ path = {:?} }}", path.display().to_string()))
        }
        None => Ok(format!("{:?}", env!("CARGO_PKG_VERSION"))),
    };
    let type_name: String = name
        .split('_')
        .filter_map(|word| word.split_at_checked(1))
        .map(|(first, rest)| first.to_uppercase() + rest)
        .collect();
    let (model, runtime, standard) =
        (dependency("core/model")?, dependency("core/runtime")?, dependency("plugins/standard")?);
    let fill = |text: &str| {
        text.replace("@NAME@", name)
            .replace("@KEY@", &name.to_uppercase())
            .replace("@TYPE@", &type_name)
            .replace("@MODEL@", &model)
            .replace("@RUNTIME@", &runtime)
            .replace("@STANDARD@", &standard)
    };
    write(&folder.join("Cargo.toml"), &fill(MANIFEST))?;
    write(&folder.join("src/lib.rs"), &fill(LIBRARY))?;
    write(&folder.join("src/main.rs"), &fill(MAIN))?;
    write(&folder.join("recipe.toml"), &fill(PLUGIN_RECIPE))
}

fn write(path: &Path, text: &str) -> Result<(), Exit> {
    let fail = |error: std::io::Error| Exit::wrong(Error::io(path, &error));
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(fail)?;
    }
    let mut file = fs::File::create_new(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            Exit::wrong(Error::new("it exists already").in_file(path).help("choose another path"))
        }
        _ => fail(error),
    })?;
    std::io::Write::write_all(&mut file, text.as_bytes()).map_err(fail)
}
