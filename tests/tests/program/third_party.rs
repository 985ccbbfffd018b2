//! Plugins from outside: a crate with its own annotator and binary, and the crates that `syntable new plugin` creates.
//!
//! The crate is a member of the workspace, so that a binary with it costs only one link. In a separate workspace, Cargo
//! builds every crate of the program again, for minutes: the tests that do so are ignored, and `.ci/nightly` runs them.

use crate::support::{ok, root, syntable};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use syntable_testing::folder::files;

/// A command of the program of a crate, run in its folder.
type Program = fn(&Path, &[&str]) -> Command;

/// The program with the crate `tests/third-party`, built with the workspace.
fn built(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_outside-under-test"));
    command.args(args).current_dir(folder).env("SYNTABLE_CACHE", root().join("target/test-cache"));
    command
}

/// Cargo in a foreign crate. The target folder is shared, so that crates with the same features are not built again.
fn cargo(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    let target = Path::new(env!("CARGO_BIN_EXE_syntable-under-test")).ancestors().nth(2).expect("in a target folder");
    command
        .args(args)
        .current_dir(folder)
        .env("CARGO_TARGET_DIR", target)
        // `.ci/timed-test` sets it for libtest; Cargo would otherwise rebuild everything for another compiler.
        .env_remove("RUSTC_BOOTSTRAP")
        .env("SYNTABLE_CACHE", root().join("target/test-cache"));
    command
}

/// `cargo run --release` in a foreign crate.
fn foreign(folder: &Path, args: &[&str]) -> Command {
    cargo(folder, &[&["run", "--release", "--quiet", "--offline", "--"], args].concat())
}

fn copy(from: &Path, to: &Path) {
    for (name, bytes) in files(from) {
        let path = to.join(name);
        std::fs::create_dir_all(path.parent().expect("in a folder")).expect("writable");
        std::fs::write(path, bytes).expect("writable");
    }
}

/// Runs the recipe of a crate. Returns its only JSON-lines file.
fn check(program: Program, folder: &Path, product: &str) -> String {
    let listed = ok(&mut program(folder, &["list", "products"]));
    assert!(listed.contains(product), "{listed}");
    let schema = ok(&mut program(folder, &["schema"]));
    assert!(schema.contains(&format!("\"{product}\"")), "the schema knows the foreign kind");
    let out = folder.join("out");
    ok(&mut program(folder, &["run", "recipe.toml", "--out", "out"]));
    let lines: Vec<String> = files(&out)
        .into_iter()
        .filter(|(name, _)| name.ends_with(".jsonl") && !name.starts_with(".syntable"))
        .map(|(_, bytes)| String::from_utf8(bytes).expect("text"))
        .collect();
    assert_eq!(lines.len(), 1);
    lines.into_iter().next().expect("one")
}

#[test]
fn a_crate_from_outside_adds_products_formats_and_verbs() {
    let folder = tempfile::tempdir().expect("a folder");
    copy(&root().join("tests/third-party"), folder.path());
    check_everything(built, folder.path());
}

#[test]
#[ignore = "builds the program once more"]
fn foreign_workspace_builds_the_crate_from_outside() {
    let folder = tempfile::tempdir().expect("a folder");
    copy(&root().join("tests/third-party"), folder.path());
    for (manifest, up, more) in
        [("Cargo.toml", "../../", "\n[workspace]\nmembers = [\"samples\"]\n"), ("samples/Cargo.toml", "../../../", "")]
    {
        let manifest = folder.path().join(manifest);
        let text = std::fs::read_to_string(&manifest).expect("there");
        std::fs::write(manifest, text.replace(up, &format!("{}/", root().display())) + more).expect("writable");
    }
    // The sources of templates are in another folder.
    for source in ["src/lib.rs", "tests/templates.rs"] {
        let source = folder.path().join(source);
        let text = std::fs::read_to_string(&source).expect("there");
        std::fs::write(source, text.replace("../../../", &format!("{}/", root().display()))).expect("writable");
    }
    // Uses the dependency versions of this workspace.
    std::fs::copy(root().join("Cargo.lock"), folder.path().join("Cargo.lock")).expect("copied");
    check_everything(foreign, folder.path());
    ok(&mut foreign(&folder.path().join("samples"), &[&folder.path().join("by-functions").display().to_string()]));
}

/// All additions of the crate `tests/third-party`, copied to a folder, to the program.
fn check_everything(program: Program, folder: &Path) {
    let lines = check(program, folder, "centroid");
    // Two views; every object's centroid lies inside the image.
    assert_eq!(lines.lines().filter(|line| line.contains("centroid")).count(), 2);
    let mut seen_in: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for line in lines.lines().filter(|line| line.contains("centroid")) {
        let record: serde_json::Value = serde_json::from_str(line).expect("JSON");
        let centroids = record["centroid"].as_object().expect("one per object");
        assert!(!centroids.is_empty());
        for (id, centroid) in centroids {
            let (u, v) = (centroid[0].as_f64().expect("u"), centroid[1].as_f64().expect("v"));
            assert!((0.0..=160.0).contains(&u) && (0.0..=120.0).contains(&v), "{u} {v}");
            seen_in.entry(id.clone()).or_default().push(record["view"].as_u64().expect("a number"));
        }
    }
    // The annotation across views agrees with the views.
    let scene = lines.lines().find(|line| line.contains("seen_in")).expect("a line of the scene");
    let scene: serde_json::Value = serde_json::from_str(scene).expect("JSON");
    assert_eq!(scene["seen_in"], serde_json::to_value(&seen_in).expect("plain data"));
    let dataset = lines.lines().find(|line| line.contains("mean_area")).expect("a line of the dataset");
    let dataset: serde_json::Value = serde_json::from_str(dataset).expect("JSON");
    let mean = dataset["mean_area"].as_f64().expect("a number");
    let table = std::fs::read_to_string(folder.join("out/area_table/000000.csv")).expect("written");
    let areas: Vec<f64> = table.lines().skip(1).filter_map(|line| line.rsplit(',').next()?.parse().ok()).collect();
    assert!((mean - areas.iter().sum::<f64>() / areas.len() as f64).abs() < 1e-9, "{mean}: {areas:?}");

    // A float image that no writer knows by name, in three formats that agree.
    let out = files(&folder.join("out"));
    let npy = floats(&out["npy/headroom/000000_0001.npy"]);
    assert_eq!(npy.len(), 160 * 120);
    assert!(npy.iter().any(|&value| value > 0.1));
    let png = gray16(&out["png/headroom/000000_0001.png"]);
    let millimeters: Vec<u16> = npy.iter().map(|value| (f64::from(*value) * 1000.0).round() as u16).collect();
    assert_eq!(png, millimeters);
    assert!(out["exr/headroom/000000_0001.exr"].starts_with(&[0x76, 0x2f, 0x31, 0x01]), "OpenEXR's magic number");

    // The source, the placer, the sensor and the writer took part: a tower of two cubes, black pixels, a table.
    let objects = lines.lines().find(|line| line.contains("object_info")).expect("a line of a view");
    let cubes = objects.matches("\"cube\"").count();
    assert!((1..=2).contains(&cubes), "{cubes} cubes: {objects}");
    assert!(out.contains_key("png/rgb_dead_pixels/000000_0001.png"));
    let table = std::str::from_utf8(&out["area_table/000000.csv"]).expect("text");
    assert!(table.starts_with("view,instance,pixels\n0,"), "{table}");
    assert!(table.lines().skip(1).all(|line| line.split(',').all(|number| number.parse::<u32>().is_ok())), "{table}");

    // A second provider of a product does not affect recipes that do not mention it.
    let provider = |more: &[&str]| {
        let plan = ok(&mut program(folder, &[&["plan", "builtin:quickstart"], more].concat()));
        let line = plan.lines().find(|line| line.starts_with("visible_box ")).expect("planned");
        line.split_whitespace().nth(1).expect("a provider").to_owned()
    };
    assert_eq!(provider(&[]), "annotate.boxes");
    assert_eq!(provider(&["--set", "annotate.rival_boxes={}"]), "annotate.rival_boxes");

    // The mesh format also works with `check --asset`, and the verb is in the help.
    let asset = ok(&mut program(folder, &["check", "--asset", "shapes/wedge.off"]));
    assert!(asset.contains("OFF") && asset.contains('8'), "{asset}");
    assert!(ok(&mut program(folder, &["--help"])).contains("Print the kinds of a slot"));
    assert!(ok(&mut program(folder, &["slot_kinds", "annotate"])).lines().any(|kind| kind == "seen_in"));
    let output = program(folder, &["slot_kinds", "nothing"]).output().expect("runs");
    assert_eq!(output.status.code(), Some(2));

    // Additions with state at run time: a verb, a check and a dataset format.
    let with_least = |args: &[&str]| {
        let mut command = program(folder, args);
        command.env("LEAST_PIXELS", "160");
        command
    };
    assert_eq!(ok(&mut with_least(&["settings"])), "least_pixels = 160\n");
    assert!(ok(&mut with_least(&["completions", "bash"])).contains("settings"));
    let boxes = "image,width,height,left,top,right,bottom\na,40,30,5,5,15,20\na,40,30,20,10,36,20\n";
    std::fs::create_dir(folder.join("boxes")).expect("writable");
    std::fs::write(folder.join("boxes/boxes.csv"), boxes).expect("writable");
    std::fs::write(folder.join("boxes.pointer"), "boxes\n").expect("writable");
    for dataset in ["boxes", "boxes.pointer"] {
        ok(&mut program(folder, &["validate", dataset]));
        let output = with_least(&["validate", dataset]).output().expect("runs");
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(
            said.contains("instance 1: it has 150 pixels, fewer than 160") && !said.contains("instance 2"),
            "{said}"
        );
    }
    // The image format, the metric and the topic.
    std::fs::write(folder.join("red.ppm"), "P3 1 1 255 200 30 30\n").expect("writable");
    assert!(ok(&mut program(folder, &["check", "--asset", "red.ppm"])).contains("plain PPM"));
    assert!(ok(&mut program(folder, &["list", "metrics"])).contains("count_error"));
    assert!(
        ok(&mut program(folder, &["list", "linked_crates"])).lines().any(|line| line.starts_with("syntable-physics"))
    );
}

/// A copy of the crate from outside, and the records of a JSON-lines file from a run of one of its recipes.
fn run_recipe(recipe: &str, more: &[&str]) -> (tempfile::TempDir, Vec<serde_json::Value>) {
    let folder = tempfile::tempdir().expect("a folder");
    copy(&root().join("tests/third-party"), folder.path());
    ok(&mut built(folder.path(), &[&["run", recipe, "--out", "out"], more].concat()));
    let mut out = files(&folder.path().join("out"));
    let lines = String::from_utf8(out.remove("jsonl.jsonl").expect("a file of records")).expect("text");
    let records = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    (folder, records)
}

#[test]
fn a_bin_from_outside_is_a_support_and_its_scene_needs_no_table() {
    let (folder, records) = run_recipe("bins.toml", &[]);
    let scene = records.iter().find(|record| record.get("bodies").is_some()).expect("a record of the scene");
    assert!(scene["settle_report"]["removed"].as_array().is_some_and(Vec::is_empty), "{scene}");
    let bodies = scene["bodies"].as_array().expect("a list");
    let supports = bodies.iter().filter(|body| body["role"] == "support").count();
    assert_eq!(supports, 10, "two bins of five boxes");
    let place = |body: &serde_json::Value| [0, 1, 2].map(|k| body["world_from_body"][k][3].as_f64().expect("a number"));
    let objects: Vec<[f64; 3]> = bodies.iter().filter(|body| body["role"] == "object").map(place).collect();
    assert_eq!(objects.len(), 3);
    // Inside the bin at the origin: 0.4 m × 0.3 m, above its bottom of 2 cm, at most stacked on each other.
    for [x, y, z] in objects {
        assert!(x.abs() < 0.18 && y.abs() < 0.13 && (0.035..0.2).contains(&z), "{x} {y} {z}");
    }
    // The camera looks at them.
    let boxes = records.iter().find_map(|record| record.get("visible_box")).expect("a record of the view");
    assert!(boxes.as_object().is_some_and(|boxes| !boxes.is_empty()), "{boxes}");
    assert!(files(&folder.path().join("out")).contains_key("annotation_final.json"));
    // Names that no step sets are reported before the run, with the existing names.
    for (set, line) in [
        ("views.support=\"bim\"", "sets a support `bim`"),
        ("place.drop_box.support=\"bim\"", "needs the support `bim`"),
    ] {
        let output = built(folder.path(), &["check", "bins.toml", "--set", set]).output().expect("runs");
        let said = crate::support::text(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        let names = "supports of the scene: `empty`, `bin`";
        assert!([line, "did you mean `bin`?", names].iter().all(|part| said.contains(part)), "{said}");
    }
}

#[test]
fn a_scripted_body_moves_between_the_moments_of_two_views() {
    let (folder, records) = run_recipe("moments.toml", &[]);
    let views: Vec<&serde_json::Value> = records.iter().filter(|record| record.get("cuboid").is_some()).collect();
    // 0.2 m/s for half a second. The top of the cube is 0.9 m from the camera, whose focal length is 60 px.
    let x = |view: usize| views[view]["cuboid"]["1"]["world_from_cuboid"][0][3].as_f64().expect("a number");
    assert!(x(0).abs() < 1e-6 && (x(1) - 0.1).abs() < 1e-6, "{} {}", x(0), x(1));
    let expected = 60.0 * 0.1 / 0.9;
    let shift = &views[0]["shift"]["1"];
    let (u, v) = (shift[0].as_f64().expect("u"), shift[1].as_f64().expect("v"));
    assert!((u - expected).abs() < 0.7 && v.abs() < 0.5, "{u} {v}");
    assert_eq!(views[1]["shift"]["1"], serde_json::json!([0.0, 0.0]), "the last view has no next one");
    // Optical flow includes the motion of the body: its top moves by the same distance, and the floor does not move.
    let out = files(&folder.path().join("out"));
    let flow = floats(&out["npy/flow/000000_0000.npy"]);
    let flow: Vec<&[f32]> = flow.chunks(2).collect();
    let top = flow.iter().filter(|flow| (f64::from(flow[0]) - expected).abs() < 1e-3 && flow[1].abs() < 1e-3).count();
    assert!((30..60).contains(&top), "{top} pixels of the top");
    assert!(flow.iter().filter(|flow| flow[0].abs() + flow[1].abs() < 1e-6).count() > 64 * 48 - 100);
}

#[test]
fn a_product_of_a_moment_is_made_once_for_all_views_at_it() {
    for (interval_s, moments) in [("0.5", 2), ("0", 1)] {
        let interval = format!("views.interval_s={interval_s}");
        let more = ["--set", &interval, "--set", "dataset.views_per_scene=4", "--set", "place.slider.duration_s=0.5"];
        let (folder, records) = run_recipe("moments.toml", &more);
        let x = |view: &serde_json::Value| view["object_positions"]["1"][0].as_f64();
        let found: Vec<f64> = records.iter().filter_map(x).collect();
        // The cube slides 0.1 m until the second view, and then rests.
        let way = if moments == 1 { 0.0 } else { 0.1 };
        let expected = [0.0, way, way, way];
        assert!(found.len() == 4 && found.iter().zip(expected).all(|(x, at)| (x - at).abs() < 1e-6), "{found:?}");
        let travel = records.iter().find_map(|record| record["travel"]["1"].as_f64()).expect("a record of the scene");
        assert!((travel - way).abs() < 1e-6, "{travel}");
        let times = std::fs::read(folder.path().join("out/.syntable/times.jsonl")).expect("times of the run");
        let times: serde_json::Value = serde_json::from_slice(&times).expect("one line");
        let calls = if moments == 1 { 1 } else { 4 };
        assert_eq!(times["stages"]["annotate.object_positions"]["calls"], calls, "{times}");
        // The views at a moment are still computed one by one.
        assert_eq!(times["stages"]["annotate.optical_flow"]["calls"], 4, "{times}");
    }
}

#[test]
fn a_program_without_a_command_line_has_samples_scores_and_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut program = Command::new(env!("CARGO_BIN_EXE_samples-under-test"));
    let said = ok(program.arg(folder.path()).env("SYNTABLE_CACHE", root().join("target/test-cache")));
    let lines: Vec<&str> = said.lines().collect();
    let areas = lines.iter().filter(|line| line.starts_with("view "));
    assert!(areas.clone().count() == 2 && areas.clone().all(|line| !line.ends_with("Uint(0)")), "{said}");
    assert!(lines.contains(&"views annotated: 2") && lines.contains(&"amodal F: Some(1.0)"), "{said}");
    assert!(lines.contains(&"small objects: Some(1.0)"), "{said}");
    let report = lines.iter().find_map(|line| line.strip_prefix("report: ")).expect("a report");
    assert!(Path::new(report).is_file(), "{said}");
    let mut tree = Command::new(env!("CARGO"));
    tree.args(["tree", "--offline", "--package", "samples", "--edges", "normal", "--prefix", "none"]);
    let tree = ok(tree.current_dir(root()));
    assert!(tree.lines().any(|line| line.starts_with("syntable-runtime ")), "{tree}");
    for heavy in ["clap ", "indicatif ", "signal-hook ", "syntable-cli "] {
        assert!(!tree.lines().any(|line| line.starts_with(heavy)), "{heavy}");
    }
}

/// Values of a NumPy file of little-endian floats.
fn floats(npy: &[u8]) -> Vec<f32> {
    let header = usize::from(u16::from_le_bytes([npy[8], npy[9]])) + 10;
    npy[header..].as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// Values of a 16-bit gray PNG file.
fn gray16(png: &[u8]) -> Vec<u16> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
    let info = reader.next_frame(&mut bytes).expect("an image");
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Grayscale, png::BitDepth::Sixteen));
    bytes[..info.buffer_size()].as_chunks().0.iter().map(|&bytes| u16::from_be_bytes(bytes)).collect()
}

/// The templates of `syntable new plugin`: values of `--slot`, and names of their examples.
const TEMPLATES: [(&str, &str); 18] = [
    ("assets", "plain_cubes"),
    ("place", "object_tower"),
    ("settle", "straight_drop"),
    ("camera", "square_camera"),
    ("views", "top_view"),
    ("lights", "head_light"),
    ("render", "first_hit"),
    ("denoise", "box_filter"),
    ("sensor", "dead_pixels"),
    ("annotate", "visible_area"),
    ("write", "area_table"),
    ("mesh-format", "off_mesh"),
    ("image-format", "plain_ppm"),
    ("dataset-format", "box_table"),
    ("check", "sane_sizes"),
    ("metric", "count_error"),
    ("verb", "slot_kinds"),
    ("topic", "linked_crates"),
];

/// Creates a plugin, checks the output and files of `syntable new plugin`, and returns the command that it prints.
fn new_plugin(slot: &str, name: &str, folder: &Path) -> String {
    let said = ok(syntable().args(["new", "plugin", name, "--slot", slot, "--path"]).arg(folder));
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect("written");
    assert!(manifest.contains("path = \"../") && !manifest.contains("path = \"/"), "{manifest}");
    assert!(folder.join("Cargo.lock").is_file());
    let (_, show) = said.split_once("cargo run --release -- ").unwrap_or_else(|| panic!("no next step: {said}"));
    show.trim_end().to_owned()
}

/// The recipes of the plugin `visible_area` and of the book's page on plugins.
fn check_plugin(program: Program, folder: &Path) {
    let lines = check(program, folder, "visible_area");
    assert!(lines.lines().count() == 2 && lines.contains("\"visible_area\""), "{lines}");
    // A recipe that the program creates knows the kind.
    ok(&mut program(folder, &["new", "recipe", "fresh/mine.toml"]));
    let schema = std::fs::read_to_string(folder.join("fresh/recipe.schema.json")).expect("written");
    assert!(schema.contains("\"visible_area\""));
    // The recipe of the book, on top of the quickstart recipe.
    let page = std::fs::read_to_string(root().join("book/src/plugins.md")).expect("the page");
    let block = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a recipe");
    let base = root().join("recipes/quickstart.toml");
    let recipe = format!("extends = \"{}\"\n{block}", base.display());
    std::fs::write(folder.join("book.toml"), recipe).expect("writable");
    let said = ok(&mut program(folder, &["check", "book.toml"]));
    assert!(said.contains("no errors; "), "{said}");
}

/// The program with the crate `tests/third-party` contains each template under its own name. This crate also runs the
/// tests of the templates (`tests/third-party/tests/templates.rs`).
#[test]
fn new_plugins_are_the_sources_that_the_workspace_compiles() {
    let folder = tempfile::tempdir().expect("a folder");
    for (slot, name) in TEMPLATES {
        let plugin = folder.path().join(name);
        let show = new_plugin(slot, name, &plugin);
        let templates = root().join("core/cli/src/verbs/scaffold/plugins").join(slot);
        let made = files(&plugin);
        for (path, text) in files(&templates) {
            assert!(made[&path].starts_with(&text), "{slot}: {path}");
        }
        match made.contains_key("recipe.toml") {
            true => {
                let said = ok(&mut built(&plugin, &["check", "recipe.toml"]));
                assert!(said.contains("no errors; "), "{slot}: {said}");
            }
            // Without a recipe, the printed command is cheap to run, except for a check, which renders first.
            false if slot != "check" => {
                ok(&mut built(&plugin, &show.split_whitespace().collect::<Vec<_>>()));
            }
            false => {}
        }
        // Another name replaces the template's name everywhere, except in names of files and crates.
        let other = folder.path().join(format!("other_{name}"));
        new_plugin(slot, "my_thing", &other);
        let made = files(&other);
        let text = String::from_utf8(made["src/lib.rs"].clone()).expect("text");
        assert!(text.contains("my_thing") && !text.contains(name), "{text}");
    }
    // Cargo finds everything that a manifest names, and the lock file is complete.
    for (_, name) in [TEMPLATES[0], TEMPLATES[10], TEMPLATES[15], TEMPLATES[16]] {
        ok(&mut cargo(&folder.path().join(name), &["metadata", "--format-version", "1", "--offline"]));
    }
    check_plugin(built, &folder.path().join("visible_area"));
    for (slot, name) in [("verb", "validate"), ("check", "visible_masks_disjoint"), ("dataset-format", "yolo")] {
        let output = syntable().args(["new", "plugin", name, "--slot", slot]).output().expect("runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains("already"), "{said}");
    }
    let output = syntable().args(["new", "plugin", "my_thing", "--slot", "nothing"]).output().expect("runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(TEMPLATES.iter().all(|(slot, _)| said.contains(slot)), "{said}");
}

#[test]
#[ignore = "builds the program once more"]
fn foreign_workspace_builds_new_plugins_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    for (slot, name) in TEMPLATES {
        let plugin = folder.path().join(format!("my_{name}"));
        new_plugin(slot, &format!("my_{name}"), &plugin);
        // Members of one workspace share features, so the crates of the program are built once.
        let manifest = plugin.join("Cargo.toml");
        let text = std::fs::read_to_string(&manifest).expect("written");
        let alone = "# A workspace of its own, wherever the folder is.\n[workspace]\n\n";
        assert!(text.contains(alone), "{text}");
        std::fs::write(&manifest, text.replace(alone, "")).expect("writable");
    }
    let workspace = "[workspace]\nmembers = [\"my_*\"]\nresolver = \"3\"\n";
    std::fs::write(folder.path().join("Cargo.toml"), workspace).expect("writable");
    std::fs::copy(root().join("Cargo.lock"), folder.path().join("Cargo.lock")).expect("copied");
    let in_all = |args: &[&str]| {
        let mut command = cargo(folder.path(), args);
        command.args(["--release", "--quiet", "--offline", "--workspace"]);
        let output = command.output().expect("runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && !said.contains("warning:"), "{args:?}: {said}");
    };
    in_all(&["clippy", "--all-targets"]);
    in_all(&["test"]);
}

#[test]
#[ignore = "builds the program once more"]
fn foreign_workspace_builds_a_new_plugin_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let plugin = folder.path().join("visible_area");
    new_plugin("annotate", "visible_area", &plugin);
    check_plugin(foreign, &plugin);
}
