//! The verbs, as a new user types them.

mod support;
use std::process::Stdio;
use support::{fails, ok, root, small_run, syntable};
use syntable_model::registry::Registry;
use syntable_runtime::recipe::{self, Overrides, Source};
use syntable_standard as _;

#[test]
fn list_names_kinds_crates_and_products() {
    let listed = ok(syntable().arg("list"));
    for word in ["household", "syntable-assets", "drop_box", "rapier", "cpu_path", "contact_sheet", "occlusion_order"] {
        assert!(listed.contains(word), "{word} is not in\n{listed}");
    }
    assert!(ok(syntable().args(["list", "lights"])).contains("sphere_lights"));
    let formats = ok(syntable().args(["list", "formats"]));
    for word in ["glb", "obj", "png", "exr"] {
        assert!(formats.contains(word), "{word} is not in\n{formats}");
    }
    assert!(fails(syntable().args(["list", "wine"]), 2).contains("nothing to list under `wine`"));
}

#[test]
fn plan_tells_what_is_computed_for_whom() {
    let plan = ok(syntable().args(["plan", "recipes/quickstart.toml"]));
    for word in ["radiance", "annotate.masks", "write.syntable", "4 images", "16 paths"] {
        assert!(plan.contains(word), "{word} is not in\n{plan}");
    }
    let error = fails(syntable().args(["plan", "recipes/quickstart.toml", "--set", "write.npy.include=[\"dept\"]"]), 2);
    assert!(error.contains("dept") && error.contains("did you mean `depth`"), "{error}");
}

#[test]
fn check_finds_every_mistake_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.toml");
    let good = std::fs::read_to_string(support::root().join("recipes/quickstart.toml")).expect("there");
    let bad = good
        .replace("samples_per_pixel", "sampels_per_pixel")
        .replace("kind = \"sphere_lights\"", "kind = \"sphere_light\"")
        .replace("from = [\"tables\"]", "from = [\"tabels\"]");
    std::fs::write(&file, bad).expect("writable");
    let error = fails(syntable().arg("check").arg(&file), 2);
    for word in ["sampels_per_pixel", "samples_per_pixel", "sphere_lights", "tables", "bad.toml:", "3 errors"] {
        assert!(error.contains(word), "{word} is not in\n{error}");
    }
    // What the library shows is what is printed, byte for byte.
    let registry = Registry::linked().expect("no clash");
    let source = Source::read(&file).expect("readable");
    let report = recipe::load(&registry, source, &Overrides::of_process(Vec::new())).err().expect("refused");
    assert_eq!(error, report.to_string());
    assert!(ok(syntable().args(["check", "recipes/quickstart.toml"])).contains("no mistake found"));
}

#[test]
fn a_missing_library_is_told_before_anything_is_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let settings = ["--set", "denoise={ kind = 'oidn', library = 'no/such/library.so' }"];
    for arguments in [vec!["check"], vec!["run", "--out", out.to_str().expect("text")]] {
        let error = fails(syntable().args(&arguments).arg("recipes/quickstart.toml").args(settings), 2);
        for word in ["denoise", "no/such/library.so", "pyoidn", "guided"] {
            assert!(error.contains(word), "{word} is not in\n{error}");
        }
    }
    assert!(!out.exists(), "nothing was begun");
}

#[test]
fn machines_get_json_lines() {
    let schema = std::fs::read_to_string(root().join("schemas/log.schema.json")).expect("readable");
    let schema = serde_json::from_str(&schema).expect("JSON");
    let log = jsonschema::draft7::new(&schema).expect("a schema");
    let error = fails(
        syntable().args(["check", "recipes/quickstart.toml", "--set", "dataset.scenes=0", "--log-format", "json"]),
        2,
    );
    for line in error.lines() {
        let record: serde_json::Value = serde_json::from_str(line).unwrap_or_else(|_| panic!("not JSON: {line}"));
        assert!(record["message"].as_str().is_some_and(|message| message.contains("scenes")), "{record}");
        assert!(log.is_valid(&record), "{record} is not what schemas/log.schema.json says");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let output = small_run(folder.path(), &["--log-format", "json"]).output().expect("the program starts");
    let lines = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && lines.lines().count() > 3, "{lines}");
    for line in lines.lines() {
        let record = serde_json::from_str(line).unwrap_or_else(|_| panic!("not JSON: {line}"));
        assert!(log.is_valid(&record), "{record} is not what schemas/log.schema.json says");
    }
}

#[test]
fn a_reader_that_goes_away_stops_no_run() {
    let folder = tempfile::tempdir().expect("a folder");
    for (number, format) in ["human", "json"].into_iter().enumerate() {
        let out = folder.path().join(number.to_string());
        let mut command = small_run(&out, &["--log-format", format]);
        let mut run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        drop((run.stdout.take(), run.stderr.take()));
        assert!(run.wait().expect("it ends").success(), "{format}");
        assert!(out.join("annotation_final.json").is_file(), "{format}");
    }
}

#[test]
fn doctor_and_completions_and_new_recipe() {
    let said = ok(syntable().arg("doctor"));
    for word in ["threads", "memory", "cache", "cpu_path", "syntable-physics"] {
        assert!(said.contains(word), "{word} is not in\n{said}");
    }
    assert!(ok(syntable().args(["completions", "bash"])).contains("syntable"));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("my.toml");
    ok(syntable().args(["new", "recipe"]).arg(&file));
    ok(syntable().arg("check").arg(&file));
    assert!(fails(syntable().args(["new", "recipe"]).arg(&file), 2).contains("exists already"));
    assert!(fails(syntable().args(["new", "plugin", "My-Plugin"]), 2).contains("not snake_case"));
    assert!(fails(syntable().args(["new", "plugin", "fn"]), 2).contains("a word of Rust"));
}

#[test]
fn wrong_words_are_answered_with_help() {
    assert!(fails(syntable().arg("rum"), 2).contains("run"));
    assert!(fails(syntable().args(["run", "no/such.toml"]), 2).contains("no/such.toml"));
    assert!(fails(syntable().args(["run", "--set", "seed"]), 2).contains("KEY=VALUE"));
    assert!(fails(syntable().args(["run", "--scenes", "5..9", "--out", "target/never"]), 2).contains("scenes 0..2"));
}
