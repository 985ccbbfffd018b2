//! Rules of the architecture: dependencies between crates, and the form of every kind of stage.

use crate::support::root;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_cli as cli;
use syntable_model::registry::{Registry, Slot};
use syntable_program as _;

/// Folders of the crates in `core` and `plugins`, at any depth.
pub fn crate_folders() -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        if folder.join("Cargo.toml").is_file() {
            return found.push(folder.to_owned());
        }
        let entries = fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
        entries.filter(|path| path.is_dir()).for_each(|path| walk(&path, found));
    }
    let mut found = Vec::new();
    ["core", "plugins"].iter().for_each(|group| walk(&root().join(group), &mut found));
    found.sort();
    found
}

/// Dependencies of every crate of the workspace by crate name: (normal, for tests only).
fn dependencies() -> BTreeMap<String, (Vec<String>, Vec<String>)> {
    let mut crates = BTreeMap::new();
    for folder in crate_folders() {
        let manifest = folder.join("Cargo.toml");
        let table: toml::Table = fs::read_to_string(&manifest).expect("a manifest").parse().expect("TOML");
        let name = table["package"]["name"].as_str().expect("named").to_owned();
        let of = |key: &str| -> Vec<String> {
            table.get(key).and_then(toml::Value::as_table).map_or(Vec::new(), |table| table.keys().cloned().collect())
        };
        crates.insert(name, (of("dependencies"), of("dev-dependencies")));
    }
    crates
}

#[test]
fn plugins_depend_on_the_model_and_on_neutral_libraries() {
    /// Libraries of the core that know no stage: any plugin may use them.
    const NEUTRAL: [&str; 8] = [
        "syntable-bvh",
        "syntable-simd",
        "syntable-prepare",
        "syntable-transport",
        "syntable-mesh",
        "syntable-convex",
        "syntable-formats",
        "syntable-guided",
    ];
    let crates = dependencies();
    let ours = |names: &[String]| -> Vec<String> {
        names.iter().filter(|name| name.starts_with("syntable")).cloned().collect()
    };
    for (name, (normal, tests)) in &crates {
        let allowed: Vec<&str> = match name.as_str() {
            "syntable-simd" | "syntable-toml-schema" => vec![],
            "syntable-model" => vec!["syntable-toml-schema"],
            "syntable-transport" => vec!["syntable-model", "syntable-prepare", "syntable-simd"],
            "syntable-bvh" => vec!["syntable-prepare", "syntable-simd", "syntable-transport"],
            // Stable poses are computed from convex hulls.
            "syntable-mesh" => vec!["syntable-model", "syntable-convex"],
            name if NEUTRAL.contains(&name) => vec!["syntable-model", "syntable-simd"],
            "syntable-recipe" => vec!["syntable-model", "syntable-toml-schema"],
            "syntable-runtime" => vec!["syntable-model", "syntable-mesh", "syntable-prepare", "syntable-recipe"],
            "syntable-testing" => vec!["syntable-model"],
            "syntable-cli" => {
                vec!["syntable-model", "syntable-mesh", "syntable-recipe", "syntable-runtime", "syntable-simd"]
            }
            // The facade links everything except the command line, and the programs link everything.
            "syntable" => {
                let above = ["syntable-cli", "syntable-program", "syntable-python", "syntable-testing"];
                let is_above = |name: &&str| above.contains(name);
                crates.keys().map(String::as_str).filter(|name| !is_above(name)).collect()
            }
            "syntable-program" => {
                let is_above = |name: &&str| ["syntable-python", "syntable-testing"].contains(name);
                crates.keys().map(String::as_str).filter(|name| !is_above(name)).collect()
            }
            "syntable-python" => crates.keys().map(String::as_str).filter(|name| *name != "syntable-testing").collect(),
            // Tools work on runs and datasets.
            "syntable-evaluate" | "syntable-report" => {
                vec!["syntable-model", "syntable-formats", "syntable-recipe", "syntable-runtime"]
            }
            _ => std::iter::once("syntable-model").chain(NEUTRAL).collect(),
        };
        for dependency in ours(normal) {
            assert!(allowed.contains(&dependency.as_str()), "{name} must not depend on {dependency}");
        }
        for dependency in ours(tests) {
            // Denoisers are tested on rendered images. Results of the GPU are compared with the CPU.
            let rendered = ["syntable-denoise", "syntable-render-wgpu"].contains(&name.as_str())
                && dependency == "syntable-render-cpu";
            assert!(
                rendered
                    || ["syntable-model", "syntable-testing"].contains(&dependency.as_str())
                    || allowed.contains(&dependency.as_str()),
                "{name} tests with {dependency}"
            );
        }
    }
}

#[test]
fn heavy_packages_stay_in_their_rooms() {
    let rooms: [(&str, &[&str]); 25] = [
        ("rapier3d", &["syntable-physics"]),
        ("parry3d", &["syntable-physics", "syntable-convex"]),
        ("obvhs", &["syntable-prepare"]),
        ("wgpu", &["syntable-render-wgpu"]),
        ("pollster", &["syntable-render-wgpu"]),
        // The Python package names it only for its features.
        ("image", &["syntable-assets", "syntable-formats", "syntable-python", "syntable-sensor", "syntable-report"]),
        ("exr", &["syntable-assets", "syntable-formats", "syntable-write"]),
        ("gltf", &["syntable-assets"]),
        ("base64", &["syntable-assets", "syntable-report"]),
        ("hdf5-pure", &["syntable-hdf5"]),
        ("parquet", &["syntable-parquet"]),
        ("object_store", &["syntable-object-store"]),
        ("reqwest", &["syntable-object-store"]),
        ("rustls", &["syntable-object-store"]),
        ("tokio", &["syntable-object-store"]),
        ("tar", &["syntable-formats"]),
        ("tera", &["syntable-write", "syntable-report"]),
        ("clap", &["syntable-cli"]),
        ("indicatif", &["syntable-cli"]),
        ("signal-hook", &["syntable-cli"]),
        ("httparse", &["syntable-report"]),
        ("embedded-graphics", &["syntable-formats"]),
        ("libloading", &["syntable-denoise"]),
        ("numpy", &["syntable-python"]),
        ("pyo3", &["syntable-python"]),
    ];
    for (name, (normal, _)) in dependencies() {
        for (package, rooms) in rooms {
            assert!(!normal.iter().any(|d| d == package) || rooms.contains(&name.as_str()), "{package} in {name}");
        }
    }
}

/// Sources of crates whose results affect datasets, without their tests.
fn sources() -> Vec<(String, String)> {
    fn walk(folder: &Path, sources: &mut Vec<(String, String)>) {
        for entry in fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
            if path.is_dir() && name != "tests" {
                walk(&path, sources);
            } else if name.ends_with(".rs") && name != "tests.rs" {
                let text = fs::read_to_string(&path).expect("readable");
                let code = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default().to_owned();
                sources.push((path.strip_prefix(root()).expect("inside").display().to_string(), code));
            }
        }
    }
    let mut found = Vec::new();
    for folder in crate_folders().iter().filter(|folder| !folder.ends_with("core/testing")) {
        walk(&folder.join("src"), &mut found);
    }
    found
}

/// A message of the library names an option as `options.retry_failed`, and the command line prints `--retry-failed`:
/// this flag must exist.
#[test]
fn options_in_messages_have_flags() {
    const FIELD: &str = "`options.";
    let pages: String = cli::help_pages().into_iter().map(|(_, page)| page).collect();
    let sources = sources().into_iter().filter(|(path, _)| !path.contains("core/cli"));
    let names: BTreeSet<String> = sources
        .flat_map(|(_, text)| {
            let rest = text.split(FIELD).skip(1).filter_map(|rest| rest.split_once('`'));
            rest.map(|(name, _)| name.replace('_', "-")).collect::<Vec<_>>()
        })
        .collect();
    assert!(names.len() > 5 && names.contains("out"), "{names:?}");
    for name in names {
        assert!(
            pages.contains(&format!("--{name}\n")) || pages.contains(&format!("--{name} ")),
            "no verb has --{name}"
        );
    }
}

#[test]
fn mathematical_functions_do_not_depend_on_the_system() {
    const NAMES: [&str; 25] = [
        "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh",
        "atanh", "exp", "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "cbrt", "hypot",
    ];
    let of_std = |line: &str| {
        let code = line.split("//").next().unwrap_or_default();
        let uses = |name: &&str| {
            code.contains(&format!(".{name}("))
                || [32, 64].iter().any(|bits| code.contains(&format!("f{bits}::{name}")))
        };
        // `f64::exp2` contains `f64::exp`, so the longest name counts.
        NAMES.iter().filter(|name| uses(name)).max_by_key(|name| name.len()).copied()
    };
    assert_eq!(of_std("let y = (a + b).atan2(x); // angle"), Some("atan2"));
    assert_eq!(of_std("values.map(f64::exp2) + libm::exp(x)"), Some("exp2"));
    assert_eq!(of_std("x.sqrt() + libm::sin(x).exponent() // x.sin()"), None);
    let sources = sources();
    assert!(sources.len() > 200 && sources.iter().any(|(_, code)| code.contains("libm::")), "{}", sources.len());
    let found = sources.iter().flat_map(|(path, code)| {
        let lines = code.lines().enumerate();
        lines.filter_map(move |(i, line)| of_std(line).map(|name| format!("{path}:{}: `{name}`", i + 1)))
    });
    let found: Vec<String> = found.collect();
    assert!(found.is_empty(), "take these from `libm`, which gives the same bits everywhere:\n{}", found.join("\n"));
}

#[test]
fn the_top_level_is_what_the_card_says() {
    let mut found: Vec<String> = fs::read_dir(root())
        .expect("readable")
        .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
        .filter(|name| !name.starts_with('.') && !["data", "dist", "target"].contains(&name.as_str()))
        .collect();
    found.sort();
    let expected = [
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "Cargo.lock",
        "Cargo.toml",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "README.md",
        "book",
        "core",
        "deny.toml",
        "plugins",
        "recipes",
        "rust-toolchain.toml",
        "schemas",
        "tests",
    ];
    assert_eq!(found, expected);
}

#[test]
fn every_kind_keeps_the_house_rules() {
    let breaches = syntable_recipe::lints(&Registry::linked().expect("no clash"));
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

/// A kind can be found by its name: `<kind>.rs` or `<kind>/mod.rs` in the sources of the crate that registers it.
#[test]
fn every_kind_has_a_file_or_folder_of_its_name() {
    fn walk(folder: &Path, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            let stem = path.file_stem().expect("named").to_string_lossy().into_owned();
            if path.join("mod.rs").is_file() || path.extension().is_some_and(|extension| extension == "rs") {
                found.insert(stem);
            }
            if path.is_dir() {
                walk(&path, found);
            }
        }
    }
    let mut sources: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut homeless = Vec::new();
    let registry = Registry::linked().expect("no clash");
    for entry in registry.entries() {
        let files = sources.entry(entry.crate_name).or_insert_with(|| {
            let plugin = entry.crate_name.trim_start_matches("syntable-");
            let mut found = BTreeSet::new();
            let folder = crate_folders().into_iter().find(|folder| folder.ends_with(plugin)).expect("a crate here");
            walk(&folder.join("src"), &mut found);
            found
        });
        if !files.contains(entry.kind) {
            homeless.push(format!("{}.{} of {}", entry.slot, entry.kind, entry.crate_name));
        }
    }
    assert!(homeless.is_empty(), "no file is called like\n{}", homeless.join("\n"));
    // The stock crates are exactly the crates that register kinds here.
    assert_eq!(sources.into_keys().collect::<Vec<_>>(), syntable::STOCK_CRATES);
}

#[test]
fn every_annotator_works_with_its_defaults() {
    let registry = Registry::linked().expect("no clash");
    for slot in [Slot::Sensor, Slot::Annotate, Slot::Render, Slot::Views, Slot::Lights, Slot::Camera, Slot::Settle] {
        for entry in registry.of_slot(slot) {
            // The poses and the program are the user's.
            if !["fixed_poses", "exec"].contains(&entry.kind) {
                entry
                    .construct_str("")
                    .unwrap_or_else(|error| panic!("{slot}.{} has no defaults: {error:?}", entry.kind));
            }
        }
    }
}

/// Datasets can be stored anywhere, because only one file writes them to a file system.
#[test]
fn datasets_are_written_through_a_store() {
    const WRITES: [&str; 13] = [
        "fs::write",
        "fs::create_dir",
        "fs::rename",
        "fs::remove_",
        "fs::copy",
        "fs::hard_link",
        "File::create",
        "OpenOptions",
        "set_len",
        "renameat",
        "unlinkat",
        "mkdirat",
        "symlink",
    ];
    const STORES: [&str; 2] = ["core/model/src/store/file_system.rs", "core/model/src/store/inside.rs"];
    let writers =
        ["core/model/src/", "core/lib/formats/", "core/runtime/src/run/", "plugins/formats/", "plugins/stages/"];
    let (mut stores, mut seen) = (0, 0);
    // Downloads are a cache.
    let of_dataset = |file: &str| writers.iter().any(|folder| file.starts_with(folder)) && !file.contains("/mirror/");
    for (file, code) in sources().iter().filter(|(file, _)| of_dataset(file)) {
        seen += 1;
        // `symlink_metadata` only reads.
        let code = code.replace("symlink_metadata", "").replace("is_symlink", "");
        let found: Vec<&str> = WRITES.into_iter().filter(|call| code.contains(call)).collect();
        match STORES.contains(&file.as_str()) {
            true => stores += usize::from(!found.is_empty()),
            false => assert!(found.is_empty(), "{file} writes to the file system: {found:?}"),
        }
    }
    assert!(stores == STORES.len() && seen > 100, "{stores} stores among {seen} files");
    // Code that works on a dataset also reads it through its store.
    let dataset = |file: &str| file.starts_with("core/runtime/src/run/dataset/") && !file.ends_with("/manifest.rs");
    for (file, code) in sources().iter().filter(|(file, _)| dataset(file)) {
        assert!(!code.contains("std::fs") && !code.contains("File::open"), "{file} reads from the file system");
    }
}

/// Datasets can be read from URLs, because readers open their files in one way.
#[test]
fn readers_open_files_as_dataset_files() {
    let readers =
        ["core/lib/formats/", "plugins/formats/", "plugins/tools/evaluate/", "plugins/tools/report/src/stats"];
    let mut opened = 0;
    for (file, code) in sources().iter().filter(|(file, _)| readers.iter().any(|folder| file.starts_with(folder))) {
        opened += code.matches("DatasetFile::open(").count();
        // Other types have names that end alike.
        let code = code.replace(|letter: char| letter.is_whitespace() || letter == '(' || letter == ':', " ");
        let found = [" File  open ", "fs  read ", "fs  read_to_string "].into_iter().find(|call| code.contains(call));
        assert_eq!(found, None, "{file} opens a file that `DatasetFile` should open");
    }
    assert!(opened > 8, "{opened} calls");
}

/// Paths in backquotes on the architecture page exist, so that the page stays up to date.
#[test]
fn paths_named_in_the_book_exist() {
    let page = fs::read_to_string(root().join("book/src/architecture.md")).expect("the architecture page");
    let mut seen = 0;
    for word in page.split('`').skip(1).step_by(2) {
        let top = word.split('/').next().unwrap_or_default();
        if word.contains('/')
            && ["core", "plugins", "tests", "recipes", "schemas", "book"].contains(&top)
            && !word.contains(['*', '{', '<'])
        {
            seen += 1;
            assert!(root().join(word).exists(), "the architecture page names {word}, which does not exist");
        }
    }
    assert!(seen >= 10, "only {seen} paths are named");
}
