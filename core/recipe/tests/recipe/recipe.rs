//! Recipes: good ones load to stages and to a resolved text, broken ones to readable diagnostics, and the JSON Schema
//! agrees with the program.

use crate::recipe_kit::{load, registry};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syntable_model::prelude::*;
use syntable_model::registry::{ConstructError, Entry, Registry, Slot};
use syntable_model::stage::Input;
use syntable_recipe::message::{Message, Record};
use syntable_recipe::{CatalogLock, Code, Lock, Overrides, Recipe, Report, Source};

const GOOD: &str = r#"
[dataset]
scenes = 2
views_per_scene = 3

[assets.objects]
kind = "mesh_folder"
root = "${ASSETS}/gso"

[assets.materials]
kind = "pbr_folder"
root = "/data/materials"

[[place]]
kind = "room"
material = { floor = "materials" }

[[place]]
kind = "drop_box"
from = ["objects"]

[[place]]
kind = "drop_box"
from = ["objects"]
count = 3

[write.png]
include = ["radiance", "amodal_mask"]
"#;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recipes")
}

fn good(text: &str) -> Recipe {
    match load(Source::embedded("good.toml", text), &[]) {
        Ok((recipe, warnings)) => {
            let warnings: Vec<String> = warnings.iter().map(|warning| warning.render(false)).collect();
            assert!(warnings.is_empty(), "{}", warnings.join("\n"));
            recipe
        }
        Err(report) => panic!("{report}"),
    }
}

fn bad(text: &str, set: &[(&str, &str)]) -> Report {
    match load(Source::embedded("bad.toml", text), set) {
        Ok(_) => panic!("loads:\n{text}"),
        Err(report) => report,
    }
}

/// The producers that run, in order.
fn stages(recipe: &Recipe) -> Vec<&str> {
    recipe.components.first().plan.stages().map(|planned| planned.stage.as_str()).collect()
}

fn messages(text: &str, set: &[(&str, &str)]) -> Vec<String> {
    bad(text, set).iter().map(|diagnostic| format!("{} {}", diagnostic.code, diagnostic.message)).collect()
}

/// Every file of tests/recipes gives exactly the text of the file next to it. `UPDATE=1` writes that text; read it
/// before you commit.
#[test]
fn broken_recipes_give_the_expected_text() {
    let update = std::env::var_os("UPDATE").is_some();
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder()).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    let mut codes = BTreeSet::new();
    let mut count = 0;
    for path in &files {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
        if name.starts_with("base_") {
            continue;
        }
        count += 1;
        let text = fs::read_to_string(path).expect("readable");
        let set: Vec<(&str, &str)> =
            text.lines().filter_map(|line| line.strip_prefix("#! --set ")?.split_once('=')).collect();
        let source =
            Source { name: name.to_owned(), path: Some(Path::new("tests/recipes").join(name)), text: text.clone() };
        let (got, found) = match load(source, &set) {
            Err(report) => (report.to_string(), report.diagnostics),
            Ok((_, warnings)) => {
                let text = warnings.iter().cloned().map(|it| Message::Diagnostic(it).render(false) + "\n").collect();
                (text, warnings)
            }
        };
        codes.extend(found.iter().map(|diagnostic| diagnostic.code));
        let got = got.replace(env!("CARGO_MANIFEST_DIR"), "<folder>").replace(env!("CARGO_PKG_VERSION"), "<version>");
        let expected = path.with_extension("expected");
        if update {
            fs::write(&expected, &got).expect("writable");
        }
        let expected = fs::read_to_string(&expected).unwrap_or_default();
        assert_eq!(got, expected, "{name}: got\n{got}\nexpected\n{expected}\nUPDATE=1 accepts what was got");
    }
    assert!(count >= 20, "{count} recipes");
    // No recipe makes a plugin faulty.
    let missing: Vec<&Code> =
        Code::ALL.iter().filter(|&&code| !codes.contains(&code) && code != Code::Plugin).collect();
    assert!(missing.is_empty(), "no recipe shows {missing:?}");
}

#[test]
fn a_recipe_becomes_stages() {
    let recipe = good(GOOD);
    assert_eq!((recipe.dataset.scenes, recipe.dataset.views_per_scene, recipe.dataset.max_attempts), (2, 3, 3));
    let ids: Vec<&str> = recipe.components.first().place.iter().map(|(id, _)| id.as_str()).collect();
    assert_eq!(ids, ["room", "drop_box", "drop_box_2"]);
    let lights: Vec<&str> = recipe.components.first().lights.iter().map(|(id, _)| id.as_str()).collect();
    assert_eq!(lights, ["sphere_lights"], "a missing section gets its default kinds");
    let reads: Vec<String> = recipe.write[0].1.reads().into_iter().map(|input| input.product).collect();
    assert_eq!(reads, ["radiance", "amodal_mask"]);
    assert_eq!(recipe.assets["objects"].kind, "mesh_folder");
}

/// Loading the resolved text gives the same text, byte for byte, and needs no defaults.
#[test]
fn the_resolved_text_is_a_fixed_point() {
    let lists = "lights = []\n";
    let more = r#"
[dataset]
name = "a \"b\"\nc"
seed = 9223372036854775807
scenes = 2

[assets.mm]
kind = "mesh_folder"
root = "meshes"
endings = ["glb", "obj"]
scale = 0.001
split = { part = "val" }
exclude_list = "../${ASSETS}.txt"

[[place]]
id = "few"
kind = "drop_box"
from = ["mm"]
count = { choice = [1, 5] }
area = { disc = { radius_m = 1e-9 } }

[views]
kind = "listed"
eyes_m = [[1, 0, 1], [0.1, 1, 1]]

[camera]
kind = "pinhole"
device = "L515"

[annotate.masks]
keep_hidden = true

[write.second]
kind = "npy"
include = ["depth", "amodal_mask"]
limits = { "a b" = { type = "between", bounds = [0, 1e300] } }

[write.first]
kind = "npy"
"#;
    for text in [GOOD.to_owned(), format!("{lists}{more}"), more.to_owned()] {
        let recipe = good(&text);
        let again = good(&recipe.resolved);
        assert_eq!(again.resolved, recipe.resolved);
        assert!(recipe.resolved.contains("kind = "), "{}", recipe.resolved);
        let digests = BTreeMap::from([("mm/a b".to_owned(), "0123456789abcdef0123456789abcdef".to_owned())]);
        let catalogs = BTreeMap::from([("mm".to_owned(), CatalogLock { assets: 3, digest: "01".into() })]);
        let files = BTreeMap::from([("write.first.file".to_owned(), "02".to_owned())]);
        let lock = Lock { devices: ["X1 (driver 2)".to_owned()].into(), catalogs, files, assets: digests };
        let locked = good(&syntable_recipe::with_lock(&recipe.resolved, &lock));
        assert_eq!(locked.lock, lock);
        assert_eq!(locked.resolved, syntable_recipe::with_lock(&recipe.resolved, &lock));
        assert_eq!(syntable_recipe::without_lock(&locked.resolved), recipe.resolved);
    }
    let recipe = good(&format!("{lists}{more}"));
    assert!(recipe.components.first().lights.is_empty() && recipe.dataset.views_per_scene == 2);
    assert_eq!(recipe.write.iter().map(|(id, _)| id.as_str()).collect::<Vec<_>>(), ["first", "second"]);
    for line in [
        "root = \"meshes\"",
        "exclude_list = \"../${ASSETS}.txt\"",
        "split = { part = \"val\", val_fraction = 0.1, test_fraction = 0.0, seed = 0 }",
        "id = \"few\"",
        "syntable-kit = \"1.2.3\"",
    ] {
        assert!(recipe.resolved.contains(line), "{line} is not in\n{}", recipe.resolved);
    }
    assert!(
        !recipe.resolved.contains("single_part_only = true") && recipe.resolved.contains("single_part_only = false")
    );
    assert!(good(GOOD).resolved.contains("root = \"${ASSETS}/gso\""));
}

/// The resolved text names the annotators that run with their defaults, and only if their products are wanted.
#[test]
fn the_resolved_text_names_what_runs_with_defaults() {
    let resolved = good(GOOD).resolved;
    assert!(resolved.contains("[annotate.masks]\nkind = \"masks\"\nkeep_hidden = false\n"), "{resolved}");
    assert!(!resolved.contains("[annotate.rate]"), "{resolved}");
    let own = good(&format!("{GOOD}\n[annotate.mine]\nkind = \"masks\"\n"));
    assert!(own.resolved.contains("[annotate.mine]") && !own.resolved.contains("[annotate.masks]"), "{}", own.resolved);
    assert_eq!((stages(&own), own.components.first().plan.implied.len()), (vec!["annotate.mine"], 0));
    let rates = good(&format!("{GOOD}\n[write.npy]\ninclude = [\"occlusion_rate\"]\n"));
    assert!(rates.resolved.contains("[annotate.masks]") && rates.resolved.contains("[annotate.rate]"));
    assert_eq!(
        (stages(&rates), rates.components.first().plan.implied.len()),
        (vec!["annotate.masks", "annotate.rate"], 2)
    );
}

/// A source of objects with an option that pools have, and one whose limit no validator knows.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Clashing {
    /// Folder.
    #[schemars(extend("pattern" = "^/"))]
    root: String,
    /// Scale factor.
    #[schemars(range(min = 0))]
    scale: f64,
}

impl Config for Clashing {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "clashing";
    const EXAMPLE: &'static str = "root = \"/a\"\nscale = 1.0";
    fn build(self) -> Result<Box<dyn AssetSource>, ConfigError> {
        Err(ConfigError::new("root", format!("{} is empty", self.root)))
    }
}

#[test]
fn faulty_plugins_are_named() {
    let entry = Entry::of::<Clashing>("syntable-clash", "0.1.0");
    let registry =
        Registry::new(registry().entries().iter().cloned().chain([entry.clone()])).expect("kinds are unique");
    let overrides = Overrides::of_process(Vec::new());
    let text = GOOD.replace("${ASSETS}", "/data");
    let report = syntable_recipe::load(&registry, Source::embedded("r.toml", text), &overrides).err().expect("refused");
    let found: Vec<(Code, &str)> =
        report.iter().map(|diagnostic| (diagnostic.code, diagnostic.message.as_str())).take(2).collect();
    let expected = [
        "`assets.clashing` of the crate syntable-clash: its schema has the unsupported keyword `pattern` at `root`",
        "`assets.clashing` of the crate syntable-clash: its option `scale` is an option of every pool already",
    ];
    assert_eq!(found, expected.map(|message| (Code::Plugin, message)));
    let lints = syntable_recipe::lints(&registry);
    for line in expected {
        assert!(lints.iter().any(|lint| lint == line), "{lints:#?}");
    }
    assert!(matches!(
        entry.construct_str(Clashing::EXAMPLE),
        Err(ConstructError::Invalid(invalid)) if invalid.message.contains("`pattern`")
    ));
}

/// Callers of the library meet the limits that recipes meet.
#[test]
fn limits_hold_for_library_callers() {
    let registry = registry();
    let refused =
        |slot: Slot, kind: &str, text: &str| match registry.find(slot, kind).expect("a kind").construct_str(text) {
            Err(ConstructError::Invalid(invalid)) => (invalid.key, invalid.message),
            Err(other) => panic!("{other:?}"),
            Ok(_) => panic!("{text} is accepted"),
        };
    let own = |key: &str, message: &str| (key.to_owned(), message.to_owned());
    assert_eq!(refused(Slot::Place, "room", "size_m = 0.5"), own("size_m", "`size_m` cannot be 0.5"));
    assert_eq!(
        refused(Slot::Place, "drop_box", "area = { disc = { radius_m = 0 } }"),
        own("area.disc.radius_m", "`area.disc.radius_m` cannot be 0")
    );
    assert_eq!(refused(Slot::Write, "png", ""), own("include", "`png` needs `include`"));
    assert_eq!(refused(Slot::Write, "png", "include = [3]").0, "include[0]");
}

#[test]
fn options_of_objects_are_not_written_for_materials() {
    let resolved = good(GOOD).resolved;
    let materials =
        resolved.split("[assets.materials]").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("there");
    assert!(!materials.contains("scale") && materials.contains("include = []"), "{materials}");
}

#[test]
fn overrides_reach_everywhere() {
    let set = |set: &[(&str, &str)]| match load(Source::embedded("r.toml", GOOD), set) {
        Ok((recipe, _)) => recipe.resolved,
        Err(report) => panic!("{report}"),
    };
    let resolved = set(&[
        ("dataset.name", "bare word"),
        ("place[1].count", "{ integers = [2, 4] }"),
        ("place.drop_box_2.count", "7"),
        ("render.samples_per_pixel", "5"),
        ("place.room.material.walls", "materials"),
        ("write.png.include[0]", "depth"),
    ]);
    for line in [
        "name = \"bare word\"",
        "count = { integers = [2, 4] }",
        "count = 7",
        "samples_per_pixel = 5",
        "material = { floor = \"materials\", walls = \"materials\" }",
        "include = [\"depth\", \"amodal_mask\"]",
    ] {
        assert!(resolved.contains(line), "{line} is not in\n{resolved}");
    }
}

#[test]
fn one_bad_table_hides_no_other() {
    let text = GOOD
        .replace("scenes = 2", "scenes = 0\nscens = 1")
        .replace("kind = \"room\"", "kind = \"rom\"")
        .replace("count = 3", "count = \"3\"\nrotation = \"euler\"")
        .replace("amodal_mask", "amodal_masks");
    assert_eq!(
        messages(&text, &[("render.kind", "cpu_path"), ("render.samples_per_pixel", "0")]),
        [
            "D0008 `scenes` cannot be 0",
            "D0003 `dataset` has no option `scens`",
            "D0005 `place` has no kind `rom`",
            "D0007 `count` must be an integer or a table with one of `integers`, `choice`",
            "D0012 `rotation` cannot be \"euler\"",
            "D0004 unknown product `amodal_masks`",
            "D0008 `samples_per_pixel` cannot be 0",
        ]
    );
}

/// A product that a caller asks for has no line in the recipe: its help names the nearest product, or else all of them.
#[test]
fn a_product_of_a_caller_gets_a_suggestion() {
    let help = |product: &str| {
        let overrides = Overrides {
            exists: &|_| true,
            opens_urls: false,
            set: Vec::new(),
            variable: &|name| (name == "ASSETS").then(|| "/data/assets".to_owned()),
            read: &|path| fs::read_to_string(path),
            current_folder: folder(),
            choose: false,
            wanted: vec![Input::named(product)],
        };
        let loaded = syntable_recipe::load(&registry(), Source::embedded("good.toml", GOOD), &overrides);
        let report = loaded.err().unwrap_or_else(|| panic!("{product}: loads"));
        report.iter().map(|diagnostic| diagnostic.help.join("; ")).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(help("dpeth"), "did you mean `depth`? `syntable list products` lists all");
    assert!(help("banana").starts_with("provided by linked plugins: `amodal_mask`, `depth`,"), "{}", help("banana"));
}

#[test]
fn one_bad_option_hides_no_other_of_its_table() {
    let with = |table: &str| messages(&format!("{GOOD}\n{table}"), &[]);
    let (near, long) = (
        "D0011 the far distance 1 is not beyond the near one 5",
        "D0011 `duration_s` beyond 30 needs `steps_per_second` of at least 300",
    );
    let camera = "[camera]\nkind = \"pinhole\"\n";
    assert_eq!(with(&format!("{camera}clip_m = [5, 1]\n")), [near]);
    assert_eq!(
        with(&format!("{camera}develop = 1\nclip_m = [5, 1]\nfocal = 3\n")),
        ["D0007 `develop` must be a boolean", near, "D0003 `pinhole` has no option `focal`"]
    );
    let settle = "[settle]\nkind = \"rapier\"\nduration_s = 40\n";
    assert_eq!(with(settle), [long]);
    // The default of a wrong option implies nothing about the others.
    let steps = "D0007 `steps_per_second` must be an integer";
    assert_eq!(with(&format!("{settle}steps_per_second = \"400\"\n")), [steps]);
}

#[test]
fn another_kind_keeps_what_both_have() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let base = format!(
        "{GOOD}\n[views]\nkind = \"hemisphere_shell\"\nradius_m = 2\n\
         [write.out]\nkind = \"png\"\ninclude = [\"radiance\"]\ndepth = \"sixteen\"\n\
         [assets.more]\nkind = \"pbr_folder\"\nroot = \"/data/more\"\n"
    );
    let base = base.replace("${ASSETS}", "/assets");
    fs::write(folder.path().join("base.toml"), base).expect("written");
    let load = |text: &str, set: &[(&str, &str)]| {
        let child = Source::file(folder.path().join("child.toml"), format!("extends = \"base.toml\"\n{text}"));
        load(child, set).map(|(recipe, _)| recipe.resolved).map_err(|report| {
            report.iter().map(|it| format!("{} {}", it.code, it.message)).collect::<Vec<_>>().join("\n")
        })
    };
    let eyes = "[[1, 0, 1], [0, 1, 1], [1, 1, 1]]";
    let table = load(&format!("[views]\nkind = \"listed\"\neyes_m = {eyes}\n[write.out]\nkind = \"npy\"\n"), &[]);
    let table = table.expect("no mistake");
    assert!(table.contains("kind = \"listed\"") && !table.contains("radius_m"), "{table}");
    assert!(table.contains("[write.out]\nkind = \"npy\"\ninclude = [\"radiance\"]\n"), "{table}");
    // In any order.
    let set = [("write.out.kind", "npy"), ("views.eyes_m", eyes), ("views.kind", "listed")];
    for order in [[0, 1, 2], [2, 1, 0]] {
        let set: Vec<(&str, &str)> = order.into_iter().map(|i| set[i]).collect();
        let lines: String = set
            .iter()
            .map(|(path, value)| match *path {
                "views.eyes_m" => format!("{path} = {value}\n"),
                _ => format!("\"{path}\" = \"{value}\"\n"),
            })
            .collect();
        assert_eq!(load("", &set).as_ref(), Ok(&table), "--set");
        assert_eq!(load(&format!("[set]\n{lines}"), &[]).as_ref(), Ok(&table), "[set]");
    }
    // An option that is written beside the new kind is not inherited.
    let unknown = Err("D0003 `listed` has no option `radius_m`".to_owned());
    let own = format!("[views]\nkind = \"listed\"\neyes_m = {eyes}\nradius_m = 3\n");
    assert_eq!(load(&own, &[]), unknown);
    let own = format!("[views]\nradius_m = 3\n[set.views]\neyes_m = {eyes}\nkind = \"listed\"\n");
    assert_eq!(load(&own, &[]), unknown);
    assert_eq!(load("", &[("views.radius_m", "3"), ("views.kind", "listed"), ("views.eyes_m", eyes)]), unknown);
    // The same kind once more changes nothing.
    let same = load("[views]\nkind = \"hemisphere_shell\"\n", &[("views.kind", "hemisphere_shell")]);
    assert!(same.as_ref().is_ok_and(|text| text.contains("radius_m = 2")), "{same:?}");
    // A pool of another kind is another pool.
    let root = Err("D0009 `mesh_folder` needs `root`".to_owned());
    assert_eq!(load("[assets.more]\nkind = \"mesh_folder\"\n", &[]), root);
    assert_eq!(load("set.assets.more.kind = \"mesh_folder\"\n", &[]), root);
    assert_eq!(load("", &[("assets.more.kind", "mesh_folder")]), root);
}

#[test]
fn views_are_counted() {
    let listed = format!("{GOOD}\n[views]\nkind = \"listed\"\neyes_m = [[1, 0, 1], [0, 1, 1]]\n");
    assert_eq!(messages(&listed, &[]), ["D0011 `views_per_scene` is 3, but `[views]` has 2"]);
    assert_eq!(good(&listed.replace("views_per_scene = 3", "")).dataset.views_per_scene, 2);
    assert_eq!(good(&listed.replace("views_per_scene = 3", "views_per_scene = 1")).dataset.views_per_scene, 1);
    assert_eq!(messages(&GOOD.replace("views_per_scene = 3", ""), &[]), ["D0009 `dataset` needs `views_per_scene`"]);
}

#[test]
fn children_win_at_a_definite_depth() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(&path, text).expect("written");
        path
    };
    write("base/base.toml", &GOOD.replace("${ASSETS}/gso", "gso"));
    write("base/views.toml", "[views]\nkind = \"hemisphere_shell\"\nradius_m = { uniform = [1, 2] }\n[write.npy]\n");
    let child = write(
        "child/child.toml",
        r#"
extends = ["../base/base.toml", "../base/views.toml"]
remove = ["write.npy"]

[dataset]
seed = 5

[assets.objects]
exclude_list = "bad.txt"

[assets.materials]
kind = "mesh_folder"
root = "tables"

[views]
radius_m = { choice = [1, 2] }

[set]
place.drop_box.count = 9
"place[1]".clearance_m = 0.5
"place.room.material" = { floor = "more" }

[set.place.drop_box_2]
from = ["objects", "materials"]

[assets.more]
kind = "pbr_folder"
root = "m"
"#,
    );
    let text = fs::read_to_string(&child).expect("readable");
    let resolved = match load(Source::file(&child, text), &[]) {
        Ok((recipe, warnings)) if warnings.is_empty() => recipe.resolved,
        Ok((_, warnings)) => panic!("{warnings:?}"),
        Err(report) => panic!("{report}"),
    };
    for line in [
        "seed = 5",
        "views_per_scene = 3",
        "radius_m = { choice = [1.0, 2.0] }",
        "count = 9",
        "clearance_m = 0.5",
        "root = \"../base/gso\"",
        "exclude_list = \"bad.txt\"",
        "root = \"tables\"",
        "material = { floor = \"more\" }",
        "from = [\"objects\", \"materials\"]",
    ] {
        assert!(resolved.contains(line), "{line} is not in\n{resolved}");
    }
    assert!(!resolved.contains("[write.npy]"), "{resolved}");
}

#[test]
fn diagnostics_are_records_too() {
    let report = bad(&GOOD.replace("count = 3", "cuont = 3"), &[]);
    let record = serde_json::to_value(Record::from(&report.diagnostics[0])).expect("plain data");
    let text = |key: &str| record[key].as_str().unwrap_or_default().to_owned();
    let line = 1 + GOOD.lines().position(|line| line == "count = 3").expect("there");
    assert_eq!((text("level"), text("code"), text("file")), ("error".into(), "D0003".into(), "bad.toml".into()));
    assert_eq!(text("message"), "`drop_box` has no option `cuont`");
    assert_eq!(text("label"), "did you mean `count`?");
    assert_eq!((record["line"].as_u64(), record["column"].as_u64()), (Some(line as u64), Some(1)));
    assert_eq!((record["end_line"].as_u64(), record["end_column"].as_u64()), (Some(line as u64), Some(6)));
    assert!(record["help"].is_array() && record["byte"].is_null() && record["related"].is_null(), "{record}");
    let message = &report.messages()[0];
    assert!(message.render(true).contains("\u{1b}["), "colors");
    assert!(!message.render(false).contains('\u{1b}'), "no colors");
}

/// Damaged text gives a report and no panic: every prefix of a recipe, and random damage.
#[test]
fn damaged_text_never_panics() {
    let mut stream = syntable_model::random::Stream::root(11);
    let bytes = GOOD.as_bytes();
    let mut texts: Vec<String> = (0..bytes.len()).step_by(3).map(|end| GOOD[..end].to_owned()).collect();
    let letters = b"[]{}\"'=.,#\\\n $0-x";
    for _ in 0..1500 {
        let mut damaged = bytes.to_vec();
        for _ in 0..=stream.below(3) {
            let at = stream.below(damaged.len() as u64) as usize;
            let letter = letters[stream.below(letters.len() as u64) as usize];
            match stream.below(3) {
                0 => damaged[at] = letter,
                1 => damaged.insert(at, letter),
                _ => drop(damaged.remove(at)),
            }
        }
        texts.push(String::from_utf8(damaged).expect("ASCII"));
    }
    let mut refused = 0;
    for text in texts {
        if let Err(report) = load(Source::embedded("damaged.toml", text.clone()), &[("place[0].size_m", "3")]) {
            refused += 1;
            assert!(report.iter().any(|diagnostic| diagnostic.is_error()), "{text}");
            let shown = report.to_string();
            assert!(shown.contains("damaged.toml") || shown.contains("<--set>"), "{text}");
        }
    }
    assert!(refused > 1000, "{refused}");
}

#[test]
fn the_kit_keeps_the_house_rules() {
    assert_eq!(syntable_recipe::lints(&registry()), Vec::<String>::new());
}

/// Relative paths of pools count from the recipe that names them, paths of `--set` from the current folder, and a
/// mistake names this folder.
#[test]
fn paths_of_pools_count_from_who_names_them() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = "root = \"${ASSETS}/gso\"\n";
    let load = |option: &str, set: &[(&str, &str)], exists: bool| {
        let text = GOOD.replace(root, &format!("{root}{option}"));
        let source = Source { name: "good.toml".into(), path: Some("tests/recipes/good.toml".into()), text };
        syntable_recipe::load(
            &registry(),
            source,
            &Overrides {
                exists: &|path| exists || !path.ends_with("names.json"),
                opens_urls: false,
                set: set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
                variable: &|name| (name == "ASSETS").then(|| "/data/assets".to_owned()),
                read: &|path| fs::read_to_string(path),
                current_folder: here.to_owned(),
                choose: false,
                wanted: Vec::new(),
            },
        )
    };
    for key in ["include_list", "properties", "ids"] {
        let path = format!("assets.objects.{key}");
        let found = |option: &str, set: &[(&str, &str)]| {
            let (recipe, _) = load(option, set, true).unwrap_or_else(|report| panic!("{report}"));
            serde_json::to_value(&recipe.assets["objects"].options).expect("plain data")[key].clone()
        };
        let said = |option: &str, set: &[(&str, &str)]| match load(option, set, false) {
            Ok(_) => panic!("{key}: loads"),
            Err(report) => report.to_string(),
        };
        let option = |value: &str| format!("{key} = \"{value}\"\n");
        let is = |folder: &Path| serde_json::json!(folder.join("names.json").to_str().expect("UTF-8"));
        assert_eq!(found(&option("names.json"), &[]), is(&here.join("tests/recipes")), "{key}");
        assert_eq!(found(&option("${ASSETS}/names.json"), &[]), is(Path::new("/data/assets")), "{key}");
        for set in ["names.json", "\"names.json\""] {
            assert_eq!(found("", &[(&path, set)]), is(here), "{key}");
        }
        let error = said(&option("names.json"), &[]);
        assert!(error.contains("relative paths start from the folder of the recipe"), "{error}");
        assert!(
            error.contains(&format!("{} does not exist", here.join("tests/recipes/names.json").display())),
            "{error}"
        );
        let error = said("", &[(&path, "names.json")]);
        assert!(error.contains("relative paths of --set start from the current folder"), "{error}");
        assert!(error.contains(&format!("{} does not exist", here.join("names.json").display())), "{error}");
        assert_eq!(error.matches("does not exist").count(), 1, "{error}");
        let error = said("", &[(&path, "src")]);
        assert!(
            error.contains(&format!("`{key}` names a file, but {} is a folder", here.join("src").display())),
            "{error}"
        );
    }
}

#[test]
fn alternatives_are_completed_and_written_back() {
    let text = GOOD.replace(
        "[[place]]\nkind = \"room\"\nmaterial = { floor = \"materials\" }\n",
        "[[place]]\none_of = [{ kind = \"room\", material = { floor = \"materials\" } }, { kind = \"room\", weight = 3 }]\n",
    );
    let recipe = good(&text);
    let ids: Vec<&str> = recipe.components.first().place.iter().map(|(id, _)| id.as_str()).collect();
    assert_eq!(ids, ["one_of", "drop_box", "drop_box_2"]);
    assert_eq!(recipe.components.first().place[0].1.all().count(), 2);
    assert_eq!(recipe.components.first().draws[0].option, "place.one_of.one_of[0].material.floor");
    let resolved: toml::Table = recipe.resolved.parse().expect("TOML");
    let alternatives = resolved["place"][0]["one_of"].as_array().expect("alternatives");
    let weights: Vec<f64> = alternatives.iter().filter_map(|it| it["weight"].as_float()).collect();
    assert_eq!(weights, [1.0, 3.0]);
    assert!(alternatives.iter().all(|it| it["kind"].as_str() == Some("room") && it.get("size_m").is_some()));
    assert!(resolved["place"][0].get("kind").is_none() && resolved["place"][0]["id"].as_str() == Some("one_of"));
    assert_eq!(good(&recipe.resolved).resolved, recipe.resolved);
}

#[test]
fn a_part_that_some_alternatives_set_is_not_there_in_every_scene() {
    let floors = "[[place]]\none_of = [{ kind = \"room\" }, { kind = \"drop_box\", from = [\"objects\"] }]\n";
    let twice = GOOD.replace("[[place]]\nkind = \"drop_box\"\nfrom = [\"objects\"]\ncount = 3\n", floors);
    let found = messages(&twice, &[]);
    assert!(found.iter().any(|message| message.contains("both set the floor")), "{found:?}");
}

#[test]
fn every_kind_of_views_has_conditions() {
    let given =
        "[views]\nkind = \"listed\"\neyes_m = [[1, 0, 1]]\nconditions = { min_objects = \"all\", uncut = true }\n";
    let recipe = good(&format!("{}{given}", GOOD.replace("views_per_scene = 3\n", "")));
    let conditions = recipe.components.first().conditions.as_ref().expect("given");
    assert!(conditions.uncut && conditions.outside_bodies && conditions.attempts == 100);
    assert!(recipe.resolved.contains("min_objects = \"all\"") && recipe.resolved.contains("on_failure = \"error\""));
    assert_eq!(good(&recipe.resolved).resolved, recipe.resolved);
    assert!(good(GOOD).components.first().conditions.is_none() && !good(GOOD).resolved.contains("conditions"));
    let empty = messages(GOOD, &[("views.conditions.distance_m", "[2, 1]")]);
    assert!(empty.len() == 1 && empty[0].contains("`distance_m = [2, 1]` is empty"), "{empty:?}");
}
