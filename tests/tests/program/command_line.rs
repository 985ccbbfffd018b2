//! The verbs, as a new user types them.

use crate::support::{SMALL, fails, ok, root, small_run, syntable, text};
use std::process::Stdio;
use syntable::{DiskCache, GenerateOptions, Quiet, RecipeRequest, RunOptions, generate};
use syntable_model::registry::Registry;
use syntable_program as _;
use syntable_recipe::{Overrides, Source};

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
    assert!(fails(syntable().args(["list", "wine"]), 2).contains("no kind or list has the name `wine`"));
}

#[test]
fn plan_tells_what_is_computed_for_whom() {
    let plan = ok(syntable().args(["plan", "recipes/quickstart.toml"]));
    for word in ["radiance", "annotate.masks", "write.syntable", "4 images", "8 paths"] {
        assert!(plan.contains(word), "{word} is not in\n{plan}");
    }
    // 100 views of 1024 × 1024 pixels: 4 bytes of depth, 3 of color.
    let sized = [
        "write={ npy = { include = ['depth'] }, png = { include = ['rgb'] } }",
        "camera.resolution=[1024, 1024]",
        "dataset.scenes=100",
        "dataset.views_per_scene=1",
    ];
    let plan = ok(syntable().arg("plan").args(sized.iter().flat_map(|set| ["--set", set])));
    assert!(plan.contains("at most 7.0 MiB per view, 700.0 MiB in all"), "{plan}");
    let error = fails(syntable().args(["plan", "recipes/quickstart.toml", "--set", "write.npy.include=[\"dept\"]"]), 2);
    assert!(error.contains("dept") && error.contains("did you mean `depth`"), "{error}");
}

#[test]
fn plan_measures_how_long_a_run_takes() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = crate::support::root().join("recipes/quickstart.toml");
    let plan = |more: &[&str]| {
        let mut command = syntable();
        command.arg("plan").arg(&recipe).args(SMALL).args(more).current_dir(folder.path());
        ok(&mut command)
    };
    assert!(plan(&[]).contains("time: not measured; `--time` makes a few scenes"));
    // One scene warms up, and the other is measured.
    let said = plan(&["--time", "--scenes", "7", "--threads", "1"]);
    for words in [
        "with 1 thread, from 1 measured scene with ",
        " images/h\n",
        " for 2 scenes (",
        " MiB per scene, ",
        "; time of a scene: ",
    ] {
        assert!(said.contains(words), "{words:?} is not in\n{said}");
    }
    let said = plan(&["--time", "--set", "dataset.scenes=1"]);
    assert!(said.contains("part of the only scene"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("there").count(), 0, "nothing is written");
    let error = fails(syntable().args(["plan", "--scenes", "2"]), 2);
    assert!(error.contains("--time"), "{error}");
}

#[test]
fn a_run_names_the_next_steps_for_people() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let output = small_run(&out, &[&["--scenes", "0", "--views", "1"], more].concat()).output().expect("starts");
        (out.display().to_string(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (out, text) = said("human", &[]);
    // The tests call it by its path, and the shell finds no `syntable`.
    let program = syntable().get_program().display().to_string();
    assert_eq!(text.matches(&format!("next: {program} view {out} ")).count(), 1, "{text}");
    assert!(text.contains(&format!("      {program} report {out} ")), "{text}");
    let (_, text) = said("json", &["--log-format", "json"]);
    assert!(!text.contains("next:"), "{text}");
}

#[test]
fn check_finds_every_mistake_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.toml");
    let good = std::fs::read_to_string(crate::support::root().join("recipes/quickstart.toml")).expect("there");
    let bad = good
        .replace("samples_per_pixel", "sampels_per_pixel")
        .replace("kind = \"sphere_lights\"", "kind = \"sphere_light\"")
        .replace("from = [\"tables\"]", "from = [\"tabels\"]");
    std::fs::write(&file, bad).expect("writable");
    let error = fails(syntable().arg("check").arg(&file), 2);
    for word in ["sampels_per_pixel", "samples_per_pixel", "sphere_lights", "tables", "bad.toml:", "3 errors"] {
        assert!(error.contains(word), "{word} is not in\n{error}");
    }
    // The library's report equals the printed text, byte for byte.
    let registry = Registry::linked().expect("no clash");
    let source = Source::read(&file).expect("readable");
    let report = syntable_recipe::load(&registry, source, &Overrides::of_process(Vec::new())).err().expect("refused");
    assert_eq!(error, report.to_string());
    assert!(ok(syntable().args(["check", "recipes/quickstart.toml"])).contains("no errors; "));
}

/// Only old names change, and only in files that the command line names.
#[test]
fn check_rewrites_old_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let base = "extends = \"builtin:quickstart\"\n# The former name stays in words: longest_side_m.\n[assets.mugs]\n\
                kind = \"household\"   # procedural\nlongest_side_m = 0.1  # a mug\n";
    let [own, fixed, diff] = ["own.toml", "own.fixed.toml", "own.diff"]
        .map(|name| std::fs::read_to_string(root().join("tests/fixtures/old_names").join(name)).expect("a fixture"));
    std::fs::write(path("base.toml"), base).expect("writable");
    std::fs::write(path("own.toml"), &own).expect("writable");
    let check = |names: &[&str]| {
        let mut check = syntable();
        check.current_dir(folder.path()).args(["check", "--fix"]).args(names);
        check
    };
    let text = |name: &str| std::fs::read_to_string(path(name)).expect("there");
    // The base has an old name, too.
    let output = check(&["own.toml"]).output().expect("starts");
    assert_eq!(output.status.code(), Some(2));
    assert_eq!((text("own.toml"), text("base.toml")), (fixed, base.to_owned()));
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(said.starts_with(&diff), "{said}");
    let said = ok(&mut check(&["own.toml", "base.toml"]));
    assert_eq!(text("base.toml"), base.replace("\nlongest_side_m", "\nscale.longest_side_m"));
    assert!(said.contains("own.toml: ") && said.ends_with("2 recipes: 2 without errors, 0 with errors\n"), "{said}");
    assert!(ok(&mut check(&["own.toml"])).starts_with("no old names found\n"));
    assert!(fails(&mut check(&["builtin:quickstart"]), 2).contains("--fix rewrites files"));
}

#[test]
fn check_takes_several_recipes() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.toml");
    std::fs::write(&file, "extends = \"builtin:quickstart\"\n[rendr]\n").expect("writable");
    let output = syntable().args(["check", "builtin:quickstart"]).arg(&file).output().expect("starts");
    let [said, error] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("builtin:quickstart: ") && said.contains("bad.toml: has errors\n"), "{said}");
    assert!(said.ends_with("2 recipes: 1 without errors, 1 with errors\n"), "{said}");
    assert!(error.contains("rendr"), "{error}");
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
    let said = ok(syntable().args(["new", "recipe"]).arg(&file));
    assert!(said.contains(&format!("how long it takes: syntable plan {} --time\n", file.display())), "{said}");
    ok(syntable().arg("check").arg(&file));
    assert!(fails(syntable().args(["new", "recipe"]).arg(&file), 2).contains("already exists"));
    assert!(fails(syntable().args(["new", "plugin", "My-Plugin"]), 2).contains("not in snake_case"));
    assert!(fails(syntable().args(["new", "plugin", "fn"]), 2).contains("a Rust keyword"));
}

#[test]
fn list_shows_the_options_of_a_kind() {
    let page = ok(syntable().args(["list", "drop_box"]));
    for words in
        ["place.drop_box", "integer or distribution, 0 to 10000", "{ integers = [1, 40] }", "material.from", "required"]
    {
        assert!(page.contains(words), "{words} is not in\n{page}");
    }
    assert!(ok(syntable().args(["list", "lights.sun"])).contains("illuminance_lx"));
    assert!(fails(syntable().args(["list", "drop_bix"]), 2).contains("did you mean drop_box"));
    // Every kind has a page with all of its options.
    let registry = Registry::linked().expect("no clash");
    let schema = syntable_recipe::schema(&registry);
    for entry in registry.entries() {
        let name = format!("{}.{}", entry.slot, entry.kind);
        let options = syntable_recipe::options_of(&registry, entry);
        for option in schema["definitions"][&name]["properties"].as_object().expect("options").keys() {
            let known = option == "kind" || option == "id" || options.iter().any(|known| known.path == *option);
            assert!(known, "{name} does not show {option}");
        }
        assert!(
            options.iter().all(|option| !option.meaning.is_empty() || option.path.contains('.')),
            "{name}: {options:?}"
        );
    }
}

#[test]
fn recipes_of_the_program_run_and_are_extended_by_name() {
    let listed = ok(syntable().args(["list", "recipes"]));
    assert!(listed.contains("builtin:quickstart") && listed.contains("builtin:syntable-sim/train"), "{listed}");
    let folder = tempfile::tempdir().expect("a folder");
    let mut elsewhere = syntable();
    // Equals the file in the checkout, from any folder.
    let by_name = ok(elsewhere.args(["plan", "builtin:window-room"]).current_dir(folder.path()));
    assert_eq!(by_name, ok(syntable().args(["plan", "recipes/window-room.toml"])));
    // A recipe that extends a file next to it.
    ok(syntable().args(["plan", "builtin:syntable-sim/val"]).env("ASSETS", "/assets").current_dir(folder.path()));
    let file = folder.path().join("my.toml");
    std::fs::write(&file, "extends = \"builtin:quickstart\"\n[dataset]\nscenes = 7\n").expect("writable");
    assert!(ok(syntable().arg("plan").arg(&file)).contains("7 scenes"));
    std::fs::write(&file, "extends = \"builtin:quikstart\"\n").expect("writable");
    let error = fails(syntable().arg("check").arg(&file), 2);
    assert!(error.contains("did you mean `builtin:quickstart`") && error.contains("`open-sky`"), "{error}");
    // Parts that are missing only without the base are not reported separately.
    assert!(error.contains("error: 1 error"), "{error}");
    assert!(fails(syntable().args(["plan", "quickstart"]), 2).contains("builtin:quickstart"));
}

#[test]
fn a_new_recipe_brings_the_schema_of_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let schema = ok(syntable().arg("schema"));
    for (name, more) in [("whole.toml", &[][..]), ("short.toml", &["--extends", "builtin:window-room"])] {
        let file = folder.path().join(name);
        ok(syntable().args(["new", "recipe"]).arg(&file).args(more));
        ok(syntable().arg("check").arg(&file));
        let text = std::fs::read_to_string(&file).expect("written");
        assert_eq!(text.lines().next(), Some("#:schema ./recipe.schema.json"));
        assert_eq!(std::fs::read_to_string(folder.path().join("recipe.schema.json")).expect("written"), schema);
    }
    // A schema file with other content stays.
    std::fs::write(folder.path().join("recipe.schema.json"), "{}").expect("writable");
    let error = fails(syntable().args(["new", "recipe"]).arg(folder.path().join("third.toml")), 2);
    assert!(error.contains("the file is not a schema of SynTable recipes"), "{error}");
    for name in ["camera", "rgb", "self", "core", "serde"] {
        let error = fails(syntable().args(["new", "plugin", name, "--path"]).arg(folder.path().join(name)), 2);
        assert!(error.contains("choose another name") && !folder.path().join(name).exists(), "{name}: {error}");
    }
}

#[test]
fn mistakes_of_the_request_give_exit_code_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let file = folder.path().join("file");
    std::fs::write(&file, "").expect("writable");
    fails(syntable().args(["run", "--out"]).arg(file.join("below")), 2);
    std::fs::create_dir(&out).expect("writable");
    std::fs::write(out.join("notes.txt"), "").expect("writable");
    assert!(fails(syntable().args(["run", "--out"]).arg(&out), 2).contains("has no dataset"));
    let missing = ["run", "builtin:real-objects", "--out"];
    let error = fails(syntable().args(missing).arg(folder.path().join("new")).env("ASSETS", folder.path()), 2);
    for pool in ["assets.bop", "assets.gso", "assets.materials", "assets.tables", "assets.ycb"] {
        assert!(error.contains(pool), "{pool} is not in\n{error}");
    }
    for name in ["../evil", "a/b", "..", "a\\\\b"] {
        let error = fails(syntable().args(["check", "--set", &format!("dataset.name=\"{name}\"")]), 2);
        assert!(error.contains("`name` cannot be"), "{name}: {error}");
    }
}

#[cfg(unix)]
#[test]
fn paths_that_no_try_can_write_give_exit_code_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    // The image folder of a YOLO dataset is a dataset.
    for name in ["data/images", "data/labels"] {
        std::fs::create_dir_all(path(name)).expect("writable");
    }
    image::RgbImage::new(8, 8).save(path("data/images/a.png")).expect("writable");
    std::fs::write(path("file"), "").expect("writable");
    for (link, target) in [("one", "two"), ("two", "one")] {
        std::os::unix::fs::symlink(path(target), path(link)).expect("a link");
    }
    let data = path("data");
    for out in ["file/below".to_owned(), "x".repeat(300), "one".to_owned(), "one/below".to_owned()] {
        let out = path(&out);
        fails(&mut crate::support::convert(&data, "coco", &out), 2);
        fails(syntable().args(["run", "--out"]).arg(&out), 2);
        fails(syntable().arg("report").arg(&data).arg("--out").arg(&out), 2);
        fails(syntable().arg("stats").arg(&data).arg("--csv").arg(&out), 2);
        fails(syntable().args(["new", "recipe"]).arg(&out), 2);
        fails(syntable().args(["new", "plugin", "gloss", "--path"]).arg(&out), 2);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_cannot_be_printed_give_exit_code_1() {
    for arguments in [&["list"][..], &["--help"], &["--version"], &["stats", "--help"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").expect("there");
        let error = fails(syntable().args(arguments).stdout(full), 1);
        assert!(error.contains("standard output: no space left"), "{error}");
    }
}

#[test]
fn check_tells_every_missing_folder_beside_other_mistakes() {
    let mut check = syntable();
    check.args(["check", "builtin:real-objects", "--set", "render.samples_per_pixel=0"]).env("ASSETS", "/nowhere");
    let error = fails(&mut check, 2);
    for words in ["/nowhere/bop", "/nowhere/gso", "/nowhere/ycb", "cannot be 0", "error: 6 errors"] {
        assert!(error.contains(words), "{words} is not in\n{error}");
    }
    // Every value that the stage refuses.
    let refused = ["size_m = { uniform = [0.1, 5] }", "height_m = { uniform = [0.1, 5] }"].join(", ");
    let error = fails(syntable().args(["check", "--set", &format!("place[0]={{ kind = 'room', {refused} }}")]), 2);
    assert!(error.contains("`size_m` can become 0.1") && error.contains("`height_m` can become 0.1"), "{error}");
}

#[test]
fn an_inherited_pool_may_go_unused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("my.toml");
    let redirected = "extends = \"builtin:quickstart\"\n[assets.mine]\nkind = \"household\"\nfamilies = [\"mug\"]\n\
                      [set]\n\"place.objects.from\" = [\"mine\"]\n";
    std::fs::write(&file, redirected).expect("writable");
    let said = syntable().arg("check").arg(&file).output().expect("starts");
    assert!(said.status.success() && said.stderr.is_empty(), "{}", crate::support::text(&said));
    std::fs::write(&file, format!("{redirected}[assets.idle]\nkind = \"household\"\n")).expect("writable");
    let said = syntable().arg("check").arg(&file).output().expect("starts");
    assert!(
        crate::support::text(&said).contains("no stage draws from the pool `idle`"),
        "{}",
        crate::support::text(&said)
    );
}

#[test]
fn overrides_remove_and_say_what_they_cannot() {
    let plan = ok(syntable().args(["plan", "--set", "remove=[\"write.contact_sheet\"]"]));
    assert!(plan.contains("write.syntable") && !plan.contains("write.contact_sheet"), "{plan}");
    assert!(
        fails(syntable().args(["plan", "--set", "remove=\"write.nothing\""]), 2)
            .contains("`write.nothing` does not exist")
    );
    for set in ["extends=\"other.toml\"", "set.render=1"] {
        assert!(
            fails(syntable().args(["plan", "--set", set]), 2).contains("cannot be set from the command line"),
            "{set}"
        );
    }
}

#[test]
fn a_library_beside_the_recipe_needs_consent() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("my.toml"), folder.path().join("out"));
    let text = "extends = \"builtin:quickstart\"\n[denoise]\nkind = \"oidn\"\nlibrary = \"lib.so\"\n";
    std::fs::write(&file, text).expect("writable");
    // The file is not a library: loading it fails, but `check` does not load it.
    std::fs::write(folder.path().join("lib.so"), "no library").expect("writable");
    ok(syntable().arg("check").arg(&file));
    let run = |more: &[&str]| fails(syntable().arg("run").arg(&file).arg("--out").arg(&out).args(more), 2);
    assert!(run(&[]).contains("--allow-code"));
    let loaded = run(&["--allow-code"]);
    assert!(!loaded.contains("--allow-code") && loaded.contains("lib.so"), "{loaded}");
    let typed = run(&["--set", &format!("denoise.library={:?}", folder.path().join("lib.so"))]);
    assert_eq!(typed, loaded);

    // The library refuses it as well.
    let registry = syntable::Registry::linked().expect("no clash");
    let recipe = RecipeRequest::new(file).load(&registry, &["rgb"], &Quiet).expect("a sound recipe");
    let generated = generate(&recipe, &GenerateOptions::default(), &Quiet, &mut |_| Ok(())).expect_err("no consent");
    let written =
        syntable::run(&recipe, &RunOptions::new(&*out, 1, DiskCache::none()), &Quiet).expect_err("no consent");
    for error in [generated, written] {
        assert!(error.to_string().contains("options.allow_code"), "{error}");
    }
    assert!(!out.exists());
}

#[test]
fn a_diamond_of_recipes_is_merged_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |level: usize, side: &str| folder.path().join(format!("{level}{side}.toml"));
    for side in ["a", "b"] {
        std::fs::write(path(0, side), "extends = \"builtin:quickstart\"\n").expect("writable");
    }
    for level in 1..=25 {
        for side in ["a", "b"] {
            let text = format!("extends = [\"{0}a.toml\", \"{0}b.toml\"]\n", level - 1);
            std::fs::write(path(level, side), text).expect("writable");
        }
    }
    let start = std::time::Instant::now();
    ok(syntable().arg("plan").arg(path(25, "a")));
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_no_recipes() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe.toml");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo is there").success());
    assert!(fails(syntable().arg("check").arg(&pipe), 2).contains("not a regular file"));
    assert!(fails(syntable().args(["check", "/dev/zero"]), 2).contains("not a regular file"));
    let file = folder.path().join("my.toml");
    std::fs::write(&file, "extends = \"pipe.toml\"\n").expect("writable");
    assert!(fails(syntable().arg("check").arg(&file), 2).contains("not a regular file"));
    let list = format!("assets.objects.include_list={pipe:?}");
    assert!(fails(syntable().args(["check", "--set", &list]), 2).contains("not a regular file"));
}

#[test]
fn wrong_words_are_answered_with_help() {
    assert!(fails(syntable().arg("rum"), 2).contains("run"));
    assert!(fails(syntable().args(["run", "no/such.toml"]), 2).contains("no/such.toml"));
    assert!(fails(syntable().args(["run", "--set", "seed"]), 2).contains("KEY=VALUE"));
    assert!(fails(syntable().args(["run", "--scenes", "5..9", "--out", "target/never"]), 2).contains("scenes 0..2"));
}

#[test]
fn a_broken_denoiser_is_one_mistake() {
    let with = |denoise: &str, product: &str| {
        let mut check = syntable();
        check.args(["check", "recipes/quickstart.toml", "--set", &format!("denoise={denoise}"), "--set"]);
        check
            .arg(format!("write.more={{ kind = \"jsonl\", include = [\"{product}\"] }}"))
            .env_remove("SYNTABLE_NOT_SET");
        check
    };
    for product in ["denoiser", "radiance_noisy"] {
        ok(&mut with("{ kind = \"guided\" }", product));
        for (denoise, code) in [
            ("{ kind = \"guided\", force = 1 }", "D0003"),
            ("{ kind = \"gided\" }", "D0005"),
            ("{ kind = \"oidn\", library = \"${SYNTABLE_NOT_SET}\" }", "D0015"),
            ("3", "D0007"),
        ] {
            let error = fails(&mut with(denoise, product), 2);
            let found: Vec<&str> = error.split("error[").skip(1).map(|rest| &rest[..5]).collect();
            assert_eq!(found, [code], "{denoise}: {error}");
        }
    }
    // A product that no denoiser provides is a separate mistake.
    let error = fails(&mut with("{ kind = \"gided\" }", "denoisr"), 2);
    assert!(error.contains("D0004") && error.contains("D0005"), "{error}");
}

#[test]
fn what_selects_nothing_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let list = folder.path().join("names.txt");
    let check = |set: &str| {
        let output = syntable().args(["check", "recipes/quickstart.toml", "--set", set]).output().expect("starts");
        assert!(output.status.success(), "{}", crate::support::text(&output));
        crate::support::text(&output)
    };
    let plain = check("assets.objects={ kind = \"household\" }");
    assert!(!plain.contains("warning"), "{plain}");
    let said =
        check("assets.objects={ kind = \"household\", include = [\"*mug*\", \"kettles_*\"], exclude = [\"x?\"] }");
    for words in
        ["assets.objects: include[1] = \"kettles_*\" matches no asset", "exclude[0] = \"x?\"", "names, such as `"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(!said.contains("include[0]") && said.contains(".syntable/catalogs/<pool>.json"), "{said}");
    let name =
        said.split("names, such as `").nth(1).and_then(|rest| rest.split('`').next()).expect("a name").to_owned();
    std::fs::write(&list, format!("{name}\nmugg\n")).expect("writable");
    let said = check(&format!("assets.objects={{ kind = \"household\", include_list = \"{}\" }}", list.display()));
    assert!(said.contains("include_list: the pool has no asset of these names: mugg (it has 800 names"), "{said}");
    assert!(said.contains("assets.objects: 1 assets") && said.contains("names.txt"), "{said}");
}

#[test]
fn a_new_recipe_extends_a_recipe_of_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("k"), "").expect("writable");
    let new = |base: &str| {
        let mut command = syntable();
        command.current_dir(folder.path()).args(["new", "recipe", "x.toml", "--extends", base]);
        command
    };
    for file in ["k.toml", "k"] {
        let error = fails(&mut new(file), 2);
        assert!(error.contains("takes a built-in recipe") && error.contains("window-room"), "{error}");
        assert!(error.contains(&format!("extends = \"{file}\"")), "{error}");
    }
    assert!(fails(&mut new("window-rom"), 2).contains("did you mean `builtin:window-room`?"));
    ok(&mut new("window-room"));
}

#[test]
fn sections_without_a_kind_have_the_default_kind() {
    let folder = tempfile::tempdir().expect("a folder");
    let (plain, named) = (folder.path().join("plain.toml"), folder.path().join("named.toml"));
    let recipe = |kinds: [&str; 4]| {
        let [settle, camera, views, render] =
            kinds.map(|kind| if kind.is_empty() { String::new() } else { format!("kind = \"{kind}\"\n") });
        format!(
            "[dataset]\nscenes = 1\nviews_per_scene = 1\n[assets.things]\nkind = \"household\"\n[assets.tables]\nkind = \"procedural_tables\"\n\
             [[place]]\nkind = \"table\"\nfrom = \"tables\"\n[[place]]\nkind = \"drop_box\"\nfrom = \"things\"\ncount = 3\n\
             [settle]\n{settle}duration_s = 2\n[camera]\n{camera}resolution = [64, 48]\n\
             [views]\n{views}roll_deg = 4\n[render]\n{render}samples_per_pixel = 4\n[write.coco]\n"
        )
    };
    std::fs::write(&plain, recipe(["", "", "", ""])).expect("writable");
    std::fs::write(&named, recipe(["rapier", "pinhole", "hemisphere_shell", "cpu_path"])).expect("writable");
    let resolved = |file: &std::path::Path| ok(syntable().arg("plan").arg(file)).replace("plain.toml", "named.toml");
    assert_eq!(resolved(&plain), resolved(&named));
    // A table of an optional slot must name the stage that it adds.
    std::fs::write(&plain, recipe(["", "", "", ""]) + "[denoise]\n").expect("writable");
    assert!(fails(syntable().arg("check").arg(&plain), 2).contains("`[denoise]` needs a `kind`"));
    // A value that a table of the option takes, and a size in quotes.
    for (from, to, says) in [
        ("roll_deg = 4", "roll_deg = [0, 9]", "write `{ uniform = [0, 9] }`"),
        ("[64, 48]", "\"64x48\"", "write [64, 48]"),
    ] {
        std::fs::write(&plain, recipe(["", "", "", ""]).replace(from, to)).expect("writable");
        let said = fails(syntable().arg("check").arg(&plain), 2);
        assert!(said.contains(says), "{said}");
    }
    // No advice that the option would refuse.
    std::fs::write(&plain, recipe(["", "", "", ""]).replace("count = 3", "count = \"3x4\"")).expect("writable");
    assert!(!fails(syntable().arg("check").arg(&plain), 2).contains("write [3, 4]"));
}

#[test]
fn mistakes_in_flags_name_them_and_the_words_to_write() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out").display().to_string();
    let data = root().join("tests/fixtures").display().to_string();
    for (arguments, says) in [
        (vec!["generate"], "did you mean `syntable run`?"),
        (vec!["run", "--out", &out, "--views", "0"], "--views"),
        (vec!["run", "--out", &out, "--scenes", "-1"], "`-1` is not a scene number; write 0 for the first scene"),
        (vec!["run", "--out", &out, "--set", "dataset.scenes=[3]"], "this is an array; write 3"),
        (vec!["run", "none.toml", "--out", &out], "none.toml: no such file or directory"),
        (vec!["convert", &data, "--out", &out, "--to", "coco", "--set", "coco"], "write `coco.KEY=VALUE`"),
        (vec!["convert", &data, "--out", &out, "--to", "coco", "--set", "masks='visible'"], "write `coco.masks="),
        (vec!["convert", &data, "--out", &out, "--to", "coco", "--set", "coco.masks='amodl'"], "one of `visible`"),
        (vec!["preview", "--out", "sheet.jpg"], "name it sheet.png"),
    ] {
        let said = fails(syntable().args(&arguments), 2);
        assert!(said.contains(says) && !said.contains("os error"), "{arguments:?}: {said}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_path_that_cannot_be_printed_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = std::fs::File::options().write(true).open("/dev/full").expect("there");
    let mut run = small_run(&folder.path().join("data"), &["--scenes", "0"]);
    let output = run.stdout(full).output().expect("starts");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(text(&output).contains("standard output: no space left"), "{}", text(&output));
}
