//! The JSON Schema of recipes agrees with the program, as judged by an independent validator and by the tools that editors
//! use.

use crate::recipe_kit::{load, registry};
use jsonschema::Validator;
use serde_json::Value as Json;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};
use syntable_model::registry::{Entry, Shape, Slot};
use syntable_recipe::Source;
use syntable_testing::tools::{skip, skip_slow_tool};
use toml::{Table, Value};

/// A recipe that every kind fits into.
const BASE: &str = r#"
[dataset]
scenes = 2
views_per_scene = 1

[assets.objects]
kind = "mesh_folder"
root = "/data/gso"

[assets.materials]
kind = "pbr_folder"
root = "/data/materials"

[[place]]
id = "things"
kind = "drop_box"

[[place]]
id = "around"
kind = "room"
material = { floor = "materials" }

[write.first]
kind = "png"
include = ["instance"]
"#;

/// Compiles a schema with an independent validator.
fn compile(schema: &Json) -> Validator {
    jsonschema::draft7::new(schema).expect("a valid draft-07 schema")
}

/// Whether the schema and the program accept `BASE` with a table of a kind added.
fn accepted(entry: &Entry, body: &Table, schema: &Validator) -> (bool, bool) {
    let mut recipe: Table = toml::from_str(BASE).expect("valid");
    let mut table = Table::from_iter([("kind".to_owned(), Value::from(entry.kind))]);
    table.extend(body.clone());
    let slot = recipe.entry(entry.slot.name()).or_insert_with(|| match entry.slot.shape() {
        Shape::List => Value::Array(Vec::new()),
        _ => Value::Table(Table::new()),
    });
    match slot {
        Value::Array(items) => items.push(table.into()),
        Value::Table(tables) if entry.slot.shape() == Shape::Keyed => drop(tables.insert("new".into(), table.into())),
        one => *one = table.into(),
    }
    let text = recipe.to_string();
    let by_schema = schema.is_valid(&serde_json::to_value(&recipe).expect("a recipe is JSON"));
    // Which steps go together is beyond a schema: the base has a floor and objects already.
    let by_program = load(Source::embedded("test.toml", text), &[]).map_or_else(
        |report| {
            let mut errors =
                report.diagnostics.iter().filter(|diagnostic| diagnostic.severity == syntable_recipe::Severity::Error);
            errors.all(|error| error.code == syntable_recipe::Code::Placers)
        },
        |_| true,
    );
    (by_schema, by_program)
}

fn check(entry: &Entry, body: &Table, schema: &Validator, expected: bool) {
    let got = accepted(entry, body, schema);
    assert_eq!(got, (expected, expected), "(schema, program) on {}.{}:\n{body}", entry.slot, entry.kind);
}

/// Both accept every example, bare and with all its defaults; both refuse each of them with a wrong key, with a value
/// of a wrong type, and with a number outside its limits.
#[test]
fn schema_and_program_accept_and_refuse_the_same() {
    let registry = registry();
    let json = syntable_recipe::schema(&registry);
    let schema = compile(&syntable_recipe::editor_schema(&registry));
    let (mut refused, mut limits) = (0, 0);
    for entry in registry.entries() {
        let example: Table = toml::from_str(entry.example).expect("valid");
        check(entry, &example, &schema, true);
        let full = entry.construct_str(entry.example).unwrap_or_else(|error| panic!("{error:?}")).options;
        check(entry, &full, &schema, true);

        let with = |option: &str, value: Value| {
            let mut table = full.clone();
            table.insert(option.to_owned(), value);
            table
        };
        check(entry, &with("no_such_option", 1.into()), &schema, false);
        let definition = &json["definitions"][format!("{}.{}", entry.slot, entry.kind)];
        for (option, limit) in definition["properties"].as_object().expect("options") {
            if option == "kind" || option == "id" {
                continue;
            }
            let wrong: Value = if limit["type"] == "boolean" { "yes".into() } else { true.into() };
            check(entry, &with(option, wrong), &schema, false);
            refused += 1;
            for (key, step) in [("minimum", -1.0), ("maximum", 1.0), ("exclusiveMinimum", 0.0)] {
                let Some(bound) = limit.get(key).and_then(Json::as_f64) else { continue };
                let outside = bound + step;
                let value = if limit["type"] == "integer" { Value::from(outside as i64) } else { Value::from(outside) };
                check(entry, &with(option, value), &schema, false);
                limits += 1;
            }
        }
    }
    assert!(refused > 30 && limits > 10, "{refused} {limits}");
}

/// Both accept a recipe that leaves out what it inherits, and refuse it when it inherits nothing.
#[test]
fn what_is_required_may_be_inherited() {
    let schema = compile(&syntable_recipe::editor_schema(&registry()));
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("base.toml"), BASE).expect("written");
    let child = "remove = \"assets.materials\"\n[dataset]\nseed = 1\n[write.first]\nkind = \"png\"\ndepth = \"sixteen\"\n[write.png]\ninclude = [\"depth\"]\n[set]\n\"place.around.material\" = { floor = \"wood\" }\n[assets.wood]\nkind = \"pbr_folder\"\nroot = \"a\"\n";
    for (head, expected) in [("extends = \"base.toml\"\n", true), ("", false)] {
        let text = format!("{head}{child}");
        let table: Table = toml::from_str(&text).expect("valid");
        let by_schema = schema.is_valid(&serde_json::to_value(&table).expect("JSON"));
        let by_program = load(Source::file(folder.path().join("child.toml"), text), &[]);
        if let (true, Err(report)) = (expected, &by_program) {
            panic!("{report}");
        }
        assert_eq!((by_schema, by_program.is_ok()), (expected, expected), "{head}");
    }
}

#[test]
fn components_of_mixtures_have_the_tables_of_recipes() {
    let schema = compile(&syntable_recipe::editor_schema(&registry()));
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("base.toml"), BASE).expect("written");
    for (tables, expected) in [
        ("", true),
        ("weight = 0.5\n[mixture.a.camera]\nkind = \"pinhole\"", true),
        ("weight = -1", false),
        ("share = 1", false),
        ("[mixture.a.camera]\nkind = \"fisheye\"", false),
        ("[mixture.a.write.npy]", false),
        ("dataset = { scenes = 3 }", false),
    ] {
        let head = "[dataset]\nscenes = 2\nviews_per_scene = 2\n[write.npy]\n";
        let text =
            format!("{head}[mixture.b]\nextends = \"base.toml\"\n[mixture.a]\nextends = \"base.toml\"\n{tables}\n");
        let json = serde_json::to_value(toml::from_str::<Table>(&text).expect("valid")).expect("JSON");
        assert_eq!(schema.is_valid(&json), expected, "{tables}");
        let loaded = load(Source::file(folder.path().join("mixed.toml"), text), &[]);
        assert_eq!(loaded.is_ok(), expected, "{tables}");
    }
}

#[test]
fn a_table_whose_id_is_a_kind_is_of_that_kind() {
    let schema = compile(&syntable_recipe::editor_schema(&registry()));
    for (table, expected) in [
        ("[write.npy]", true),
        ("[write.npy]\nkind = \"npy\"", true),
        ("[write.npy]\nkind = \"png\"\ninclude = [\"depth\"]", false),
        ("[write.a_b-1]\nkind = \"npy\"", true),
        ("[write.\"a b\"]\nkind = \"npy\"", false),
        ("[write.mine]", false),
    ] {
        let text = format!("{BASE}{table}\n");
        let json = serde_json::to_value(toml::from_str::<Table>(&text).expect("valid")).expect("JSON");
        assert_eq!(schema.is_valid(&json), expected, "{table}");
        assert_eq!(load(Source::embedded("test.toml", text), &[]).is_ok(), expected, "{table}");
    }
}

#[test]
fn the_schema_is_stable_and_draft_07() {
    let text = syntable_recipe::schema_text(&registry());
    assert_eq!(text, syntable_recipe::schema_text(&registry()));
    let schema: Json = serde_json::from_str(&text).expect("JSON");
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    assert!(!text.contains("#/definitions/") && !text.contains("\"null\"") && !text.contains("prefixItems"));
    for slot in Slot::ALL {
        let section = &schema["properties"][slot.name()];
        let section = section["$ref"]
            .as_str()
            .map_or(section, |target| schema.pointer(target.trim_start_matches('#')).expect("a definition"));
        assert!(section["description"].is_string(), "{slot}");
    }
    assert_eq!(schema["$defs"]["place.room"]["description"], "A room around the table.");
    assert!(schema["$defs"]["assets.mesh_folder"]["properties"]["scale"].is_object());
    assert!(schema["$defs"]["assets.pbr_folder"]["properties"]["scale"].is_null());
}

/// Result of a tool on a file.
struct Verdict {
    accepted: bool,
    text: String,
}

/// A tool on the PATH.
fn tool(name: &str) -> Option<PathBuf> {
    let found = env::split_paths(&env::var_os("PATH").unwrap_or_default())
        .map(|folder| folder.join(name))
        .find(|path| path.is_file());
    if found.is_none() {
        // CI installs tombi; taplo takes minutes.
        let skip = if name == "taplo" { skip_slow_tool } else { skip };
        skip(&format!("{name} (pip install {name})"));
    }
    found
}

fn run(command: &mut Command) -> Verdict {
    let output = command.env("NO_COLOR", "1").output().expect("the tool starts");
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    Verdict { accepted: output.status.success(), text }
}

/// A tool accepts what the program accepts, and refuses every broken recipe whose mistake a schema can express.
fn agrees(check: impl Fn(&Path, &Path) -> Verdict) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let schema = folder.path().join("schema.json");
    fs::write(&schema, syntable_recipe::schema_text(&registry())).expect("written");
    let judge = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, format!("#:schema ./schema.json\n{text}")).expect("written");
        check(&path, &schema)
    };
    let child = "extends = \"base.toml\"\nremove = [\"write.first\"]\n\n[write.png]\ndepth = \"sixteen\"\n\n[set]\n\"place.things.count\" = 5\n";
    let resolved = load(Source::embedded("good.toml", BASE), &[]).map(|(recipe, _)| recipe.resolved).expect("good");
    let mixed = "[dataset]\nscenes = 1\n\n[mixture.a]\nweight = 2\nextends = \"base.toml\"\n\n[mixture.a.camera]\nkind = \"pinhole\"\n\n[write.npy]\n";
    for (name, text) in
        [("good.toml", BASE), ("child.toml", child), ("resolved.toml", &resolved), ("mixed.toml", mixed)]
    {
        let verdict = judge(name, text);
        assert!(verdict.accepted && !verdict.text.contains("strict"), "{name} is refused:\n{}\n{text}", verdict.text);
    }
    // A schema cannot express mistakes about the recipe's own names, about the machine, or found by a stage. The schema of
    // editors requires no sections.
    let beyond = [
        "base_steps",
        "default_names",
        "few_samples",
        "idle_stage",
        "invalid_values",
        "missing_sections",
        "no_writers",
        "not_storable",
        "overrides",
        "replaced_steps",
        "set_twice",
        "two_floors",
        "two_providers",
        "unknown_pool",
        "unknown_product",
        "variables",
        "warnings",
    ];
    let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recipes");
    let mut refused = 0;
    for file in fs::read_dir(recipes).expect("the folder") {
        let path = file.expect("an entry").path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("a name").to_owned();
        if path.extension().is_none_or(|extension| extension != "toml") || stem.starts_with("extends_") {
            continue;
        }
        let verdict = judge(&format!("{stem}.toml"), &fs::read_to_string(&path).expect("readable"));
        let expected = beyond.contains(&stem.as_str()) && stem != "invalid_values";
        assert_eq!(verdict.accepted, expected, "{stem}:\n{}", verdict.text);
        refused += usize::from(!verdict.accepted);
    }
    assert!(refused >= 15, "{refused}");
}

#[test]
fn taplo_agrees() {
    if let Some(taplo) = tool("taplo") {
        agrees(|path, schema| {
            let url = format!("file://{}", schema.display());
            run(Command::new(&taplo).args(["check", "--colors", "never", "--schema", &url]).arg(path))
        });
    }
}

#[test]
fn tombi_agrees() {
    if let Some(tombi) = tool("tombi") {
        agrees(|path, _| run(Command::new(&tombi).args(["lint", "--offline"]).arg(path)));
    }
}

/// Both judge the tables of alternatives alike.
#[test]
fn alternatives_are_judged_like_tables() {
    let schema = compile(&syntable_recipe::editor_schema(&registry()));
    for (tables, expected) in [
        ("[[place]]\none_of = [{ kind = \"drop_box\", weight = 2.5 }, { kind = \"drop_box\", count = 3 }]", true),
        ("[[lights]]\nid = \"main\"\none_of = [{ kind = \"sphere_lights\", count = 1 }]", true),
        ("[settle]\none_of = [{ duration_s = 3.0 }, { kind = \"rapier\", weight = 0 }]", true),
        ("[[place]]\none_of = [{ kind = \"drop_box\", heaviness = 2 }]", false),
        ("[[place]]\none_of = [{ kind = \"drop_box\", weight = -1 }]", false),
        ("[[place]]\none_of = [{ kind = \"drop_box\", id = \"a\" }]", false),
        ("[[place]]\none_of = [{ kind = \"drop_boxes\" }]", false),
        ("[[place]]\none_of = [{ count = 3 }]", false),
        ("[[place]]\none_of = []", false),
        ("[[place]]\none_of = [3]", false),
        ("[[place]]\nkind = \"drop_box\"\none_of = [{ kind = \"drop_box\" }]", false),
        ("[camera]\none_of = [{ kind = \"pinhole\" }]", false),
    ] {
        let text = format!("{BASE}\n{tables}\n");
        let recipe: Table = toml::from_str(&text).expect("valid");
        let by_schema = schema.is_valid(&serde_json::to_value(&recipe).expect("JSON"));
        let by_program = load(Source::embedded("test.toml", text), &[]);
        if let (true, Err(report)) = (expected, &by_program) {
            panic!("{report}");
        }
        assert_eq!((by_schema, by_program.is_ok()), (expected, expected), "(schema, program) on\n{tables}");
    }
}
