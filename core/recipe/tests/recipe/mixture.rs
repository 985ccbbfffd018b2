//! Mixtures: several recipes whose scenes make one dataset.

use crate::recipe_kit::{load, registry};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syntable_recipe::{Code, Overrides, Recipe, Report, Source};

const TABLES: &str = r#"
[dataset]
name = "tables"
scenes = 2
views_per_scene = 3
[assets.objects]
kind = "mesh_folder"
root = "meshes"
[assets.materials]
kind = "pbr_folder"
root = "/data/materials"
[[place]]
kind = "room"
material = { floor = "materials" }
[[place]]
kind = "drop_box"
id = "objects"
from = ["objects"]
[write.npy]
"#;

const MIXED: &str = r#"
[dataset]
name = "mixed"
scenes = 4000
views_per_scene = 2
[mixture.tables]
weight = 3
extends = "tables.toml"
[mixture.bins]
extends = "bins.toml"
[write.png]
include = ["radiance", "amodal_mask"]
"#;

/// Recipes by the names of their files, in a folder that does not exist.
fn load_files(text: &str, bins: &str, set: &[(&str, &str)]) -> Result<Recipe, Report> {
    let files = BTreeMap::from([("tables.toml", TABLES.to_owned()), ("bins.toml", bins.to_owned())]);
    let read = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        files.get(name).cloned().ok_or_else(|| std::io::Error::other("no such file"))
    };
    let overrides = Overrides {
        set: set.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect(),
        read: &read,
        current_folder: PathBuf::from("/recipes"),
        ..Overrides::of_process(Vec::new())
    };
    syntable_recipe::load(&registry(), Source::file("mixed.toml", text), &overrides).map(|(recipe, _)| recipe)
}

fn bins() -> String {
    TABLES.replace("root = \"meshes\"", "root = \"other\"")
}

fn mixed() -> Recipe {
    load_files(MIXED, &bins(), &[]).unwrap_or_else(|report| panic!("{report}"))
}

#[test]
fn the_resolved_text_has_all_components_and_loads_to_itself() {
    let recipe = mixed();
    let resolved: toml::Table = recipe.resolved.parse().expect("TOML");
    let mixture = resolved["mixture"].as_table().expect("a table");
    assert_eq!(mixture.keys().collect::<Vec<_>>(), ["bins", "tables"]);
    assert_eq!((mixture["tables"]["weight"].as_float(), mixture["bins"]["weight"].as_float()), (Some(3.0), Some(1.0)));
    assert!(mixture["bins"].get("write").is_none() && resolved["write"].get("npy").is_none());
    assert!(!recipe.resolved.contains("extends"), "{}", recipe.resolved);
    let again = load_files(&recipe.resolved, "", &[]).unwrap_or_else(|report| panic!("{report}"));
    assert_eq!(again.resolved, recipe.resolved);
    // Each component alone is what the extended recipe is.
    let table = |text: &str| text.parse::<toml::Table>().expect("TOML");
    let alone = load_files(TABLES, "", &[]).unwrap_or_else(|report| panic!("{report}"));
    let (alone, own) = (table(&alone.resolved), mixture["tables"].as_table().expect("a table"));
    for section in ["assets", "place", "settle", "camera", "views", "render"] {
        assert_eq!(alone[section], own[section], "{section}");
    }
}

#[test]
fn scenes_take_components_by_weight_and_whatever_the_number_of_scenes() {
    let recipe = mixed();
    let of = |recipe: &Recipe| (0..4000).map(|scene| recipe.component_of(scene).1.id.clone()).collect::<Vec<_>>();
    let drawn = of(&recipe);
    let tables = drawn.iter().filter(|id| *id == "tables").count();
    // Five standard deviations of a binomial distribution: 5·√(4000·¼·¾) = 137.
    assert!(tables.abs_diff(3000) < 137, "{tables}");
    let set = |key: &str, value: &str| {
        of(&load_files(MIXED, &bins(), &[(key, value)]).unwrap_or_else(|report| panic!("{report}")))
    };
    assert_eq!(set("dataset.scenes", "5000"), drawn);
    assert_ne!(set("dataset.seed", "1"), drawn);
    assert!(set("mixture.bins.weight", "0").iter().all(|id| id == "tables"));
}

#[test]
fn pools_that_differ_have_different_names_and_equal_pools_are_one() {
    let recipe = mixed();
    let names: Vec<&String> = recipe.assets.keys().collect();
    assert_eq!(names, ["bins.objects", "materials", "tables.objects"]);
    assert_eq!(recipe.assets["tables.objects"].table, "mixture.tables.assets.objects");
    for component in recipe.components.all() {
        assert_eq!(component.pools["objects"], format!("{}.objects", component.id));
        assert_eq!(component.labeled_pools.iter().collect::<Vec<_>>(), [&component.pools["objects"]]);
    }
    let same = load_files(MIXED, TABLES, &[]).unwrap_or_else(|report| panic!("{report}"));
    assert_eq!(same.assets.keys().collect::<Vec<_>>(), ["materials", "objects"]);
    assert_eq!(same.labeled_pools().into_iter().collect::<Vec<_>>(), ["objects"]);
}

#[test]
fn overrides_reach_into_a_component() {
    let set = [("mixture.bins.place.objects.count", "9"), ("mixture.bins.remove", "[\"assets.materials\"]")];
    let recipe = load_files(MIXED, &bins(), &set[..1]).unwrap_or_else(|report| panic!("{report}"));
    let resolved: toml::Table = recipe.resolved.parse().expect("TOML");
    let count = |component: &str| resolved["mixture"][component]["place"][1]["count"].clone();
    assert_eq!(count("bins"), 9.into());
    assert_ne!(count("tables"), 9.into());
    let report = load_files(MIXED, &bins(), &set).err().expect("a pool is missing");
    let missing = report.iter().find(|found| found.code == Code::UnknownPool).expect("found");
    assert!(missing.labels[0].file.name().ends_with("bins.toml"), "{report}");
    let report = load_files(MIXED, &bins(), &[("mixture.bin.camera.height", "1")]).err().expect("no such component");
    assert!(report.to_string().contains("did you mean `bins`"), "{report}");
}

#[test]
fn mistakes_point_into_the_file_of_the_component() {
    let broken = bins().replace("from = [\"objects\"]", "from = [\"things\"]\ncuont = 3");
    let report = load_files(MIXED, &broken, &[]).err().expect("mistakes");
    let places: Vec<(Code, &str, usize)> =
        report.iter().map(|found| (found.code, found.labels[0].file.name(), found.labels[0].line_column().0)).collect();
    let line = broken.lines().position(|line| line.starts_with("from")).expect("there") + 1;
    assert_eq!(places, [(Code::UnknownPool, "bins.toml", line), (Code::UnknownKey, "bins.toml", line + 1)], "{report}");
    assert!(report.to_string().contains("the component `bins`"), "{report}");
    let check = |text: &str, code: Code, want: &str| {
        let report = load_files(text, &bins(), &[]).err().unwrap_or_else(|| panic!("{want}"));
        let codes: Vec<Code> = report.iter().map(|found| found.code).collect();
        assert!(codes.contains(&code) && report.to_string().contains(want), "{report}");
    };
    let with = |more: &str| MIXED.replace("[mixture.bins]", &format!("{more}\n[mixture.bins]"));
    check(&with("dataset = {}"), Code::UnknownKey, "write [dataset] once, for all components");
    check(&format!("[camera]\nkind = \"pinhole\"\n{MIXED}"), Code::UnknownKey, "`camera` beside `mixture`");
    check(&MIXED.replace("bins.toml", "mixed.toml"), Code::Extends, "cannot read the extended recipe");
    check(&with("[mixture.\"a b\"]\nextends = \"bins.toml\""), Code::BadId, "\"a b\" cannot be an id");
    check(&MIXED.replace("weight = 3", "weight = -3"), Code::InvalidValue, "`weight` must be a number from 0");
    let none = MIXED.replace("weight = 3", "weight = 0").replace("[mixture.bins]", "[mixture.bins]\nweight = 0");
    check(&none, Code::InvalidValue, "no component has a weight above 0");
    check("[dataset]\nscenes = 1\n[mixture]\n[write.npy]\n", Code::InvalidValue, "`mixture` needs a component");
    // A component without a section is reported at its table.
    check(&with("[mixture.empty]"), Code::MissingSection, "a recipe needs `[[place]]`");
}

#[test]
fn a_mixture_of_mixtures_is_refused() {
    let inner = "[dataset]\nscenes = 1\n[mixture.a]\nextends = \"tables.toml\"\n[write.npy]\n";
    let report = load_files(MIXED, inner, &[]).err().expect("refused");
    assert!(report.to_string().contains("`mixture.bins` is a mixture itself"), "{report}");
}

#[test]
fn paths_of_components_count_from_their_own_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("writable");
        path
    };
    std::fs::create_dir(folder.path().join("deep")).expect("writable");
    write("tables.toml", TABLES);
    write("deep/bins.toml", &bins());
    let path = write("mixed.toml", &MIXED.replace("bins.toml", "deep/bins.toml"));
    let (recipe, _) = load(Source::read(&path).expect("readable"), &[]).unwrap_or_else(|report| panic!("{report}"));
    assert_eq!(recipe.components.all().count(), 2);
    for root in ["root = \"meshes\"", "root = \"deep/other\""] {
        assert!(recipe.resolved.contains(root), "{root} is not in\n{}", recipe.resolved);
    }
}

#[test]
fn sections_of_the_mixture_cannot_be_set_in_a_component() {
    for path in ["write.png.include", "dataset.seed"] {
        let set = format!("mixture.bins.{path}");
        let report = load_files(MIXED, &bins(), &[(&set, "1")]).err().unwrap_or_else(|| panic!("{path}"));
        let codes: Vec<Code> = report.iter().map(|found| found.code).collect();
        assert_eq!(codes, [Code::BadOverride], "{report}");
        assert!(report.to_string().contains(&format!("use `--set {path}`")), "{report}");
    }
    for line in ["\"write.png.include\" = []", "write.png.include = []"] {
        let report = load_files(&format!("{MIXED}[mixture.bins.set]\n{line}\n"), &bins(), &[]).err().expect("refused");
        let codes: Vec<Code> = report.iter().map(|found| found.code).collect();
        assert_eq!(codes, [Code::BadOverride], "{report}");
        assert!(report.to_string().contains("`write` belongs to the mixture"), "{report}");
    }
}

#[test]
fn remedies_name_tables_of_the_component_or_of_its_file() {
    let report = |text: &str, bins: &str| load_files(text, bins, &[]).err().expect("refused").to_string();
    // Sections that are missing everywhere are missing in each component.
    let empty =
        "[dataset]\nscenes = 1\nviews_per_scene = 1\n[mixture.a]\n[mixture.b]\n[write.png]\ninclude = [\"rgb\"]\n";
    let found = report(empty, "");
    for id in ["a", "b"] {
        assert!(found.contains(&format!("[[mixture.{id}.place]]")), "{found}");
        assert!(found.contains(&format!("found in the component `{id}`")), "{found}");
    }
    assert!(!found.contains("add [[place]]"), "{found}");
    // The only component is named, too.
    let only =
        report("[dataset]\nscenes = 1\nviews_per_scene = 1\n[mixture.a]\n[write.png]\ninclude = [\"rgb\"]\n", "");
    assert!(only.contains("found in the component `a`") && only.contains("[[mixture.a.place]]"), "{only}");
    // A mistake in another file is mended there.
    let (start, end) = (TABLES.find("[assets.objects]").expect("there"), TABLES.find("[[place]]").expect("there"));
    let without_pools = format!("{}{}", &TABLES[..start], &TABLES[end..]);
    let elsewhere = report(MIXED, &without_pools);
    assert!(elsewhere.contains("add [assets.") && !elsewhere.contains("mixture.bins.assets"), "{elsewhere}");
}
