//! Faults of disks, networks, terminals and users during a run: in the end, the dataset equals the result of an
//! undisturbed run.
#![cfg(unix)]

use crate::support::{assert_same, fails, ok, skip, small_run, syntable, text};
use std::fs;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use syntable_testing::folder::files;
use syntable_testing::tools::skip_slow_tool;

/// A recipe and a folder of scanned objects, together in a separate folder.
fn scanned(folder: &Path) -> PathBuf {
    copy(&crate::support::root().join("tests/fixtures/assets/gso"), &folder.join("gso"));
    copy(&crate::support::root().join("tests/fixtures/assets/materials"), &folder.join("materials"));
    let recipe = fs::read_to_string(crate::support::root().join("recipes/quickstart.toml")).expect("there");
    let recipe = recipe
        .replace("kind = \"household\"", "kind = \"google_scanned_objects\"\nroot = \"gso\"")
        .replace("kind = \"procedural_materials\"", "kind = \"pbr_folder\"\nroot = \"materials\"")
        .lines()
        .filter(|line| !line.starts_with("surfaces = "))
        .collect::<Vec<_>>()
        .join("\n");
    let path = folder.join("recipe.toml");
    fs::write(&path, recipe).expect("writable");
    path
}

fn copy(from: &Path, to: &Path) {
    for (name, bytes) in files(from) {
        let path = to.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
}

fn run(recipe: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = syntable();
    command.arg("run").arg(recipe).arg("--out").arg(out).args(crate::support::SMALL).args(more);
    command
}

/// The library that makes calls fail; none without a C compiler.
fn shim(folder: &Path) -> Option<PathBuf> {
    let library = folder.join("shim.so");
    let source = crate::support::root().join("tests/fixtures/faults/shim.c");
    let built =
        Command::new("cc").args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(source).arg("-ldl").output();
    match built {
        Ok(output) if output.status.success() => Some(library),
        Ok(output) => panic!("{}", text(&output)),
        Err(_) => {
            skip("cc");
            None
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn an_asset_that_cannot_be_read_for_a_while_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let home = folder.path().canonicalize().expect("there");
    let Some(library) = shim(&home) else { return };
    let recipe = scanned(&home);
    let whole = home.join("whole");
    let log = home.join("calls");
    let faulty = |out: &Path, at: u64, count: u64, errno: i32| {
        let mut command = run(&recipe, out, &["--threads", "1"]);
        command.env("LD_PRELOAD", &library).env("FAULT_BELOW", home.join("gso")).env("FAULT_LOG", &log);
        command.env("FAULT_AT", at.to_string()).env("FAULT_COUNT", count.to_string());
        command.env("FAULT_ERRNO", errno.to_string());
        command
    };
    ok(&mut faulty(&whole, 0, 0, 0));
    let calls: u64 = fs::read_to_string(&log).expect("written").trim().parse().expect("a number");
    assert!(calls > 20, "{calls} calls");
    // EIO, EMFILE, ENFILE, ESTALE, ETIMEDOUT, ENOMEM, EACCES, EAGAIN.
    let errors = [5, 24, 23, 116, 110, 12, 13, 11];
    let (tries, mut stopped) = (10, 0);
    for number in 0..tries {
        let (at, errno) = (1 + number * (calls - 1) / (tries - 1), errors[number as usize % errors.len()]);
        let data = home.join(format!("data-{number}"));
        if number % 2 == 0 {
            // A single error: the call is retried.
            ok(&mut faulty(&data, at, 1, errno));
        } else {
            // Permanent errors: the run stops, and the same command continues when the disk is back.
            let error = fails(&mut faulty(&data, at, 1_000_000, errno), 1);
            assert!(error.contains("gso"), "call {at}, error {errno}: {error}");
            assert!(!error.contains("trying again"), "a scene was made with other assets: {error}");
            stopped += 1;
            ok(&mut run(&recipe, &data, &[]));
        }
        assert_same(&whole, &data);
        fs::remove_dir_all(&data).expect("removable");
    }
    assert_eq!(stopped, tries / 2);
}

#[cfg(target_os = "linux")]
#[test]
fn a_failing_disk_is_not_called_damage() {
    let folder = tempfile::tempdir().expect("a folder");
    let home = folder.path().canonicalize().expect("there");
    let Some(library) = shim(&home) else { return };
    let data = home.join("data");
    ok(&mut small_run(&data, &[]));
    let manifest = ".syntable/scenes/000/000000.json";
    let image = files(&data).into_keys().find(|name| name.ends_with(".png")).expect("an image");
    for (inside, verb) in
        [(image.as_str(), "verify"), (manifest, "verify"), (manifest, "run"), (".syntable/shards", "run")]
    {
        assert!(data.join(inside).exists(), "{inside}");
        let mut command = match verb {
            "run" => small_run(&data, &[]),
            _ => syntable(),
        };
        if verb == "verify" {
            command.arg(verb).arg(&data);
        }
        command.env("LD_PRELOAD", &library).env("FAULT_BELOW", data.join(inside));
        // EIO, whenever the file is opened.
        command.env("FAULT_AT", "1").env("FAULT_COUNT", "1000000").env("FAULT_ERRNO", "5");
        let error = fails(&mut command, 1);
        assert!(error.contains("input/output error") && error.contains("may be intact"), "{inside}, {verb}: {error}");
        assert!(!error.contains("damaged"), "{inside}, {verb}: {error}");
    }
    ok(syntable().arg("verify").arg(&data));
}

#[test]
fn a_log_that_cannot_be_written_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    // Warnings, failing attempts and progress: a bad asset, and scenes that fail at first.
    let recipe = scanned(folder.path());
    fs::write(folder.path().join("gso/Room_Essentials_Mug_White_Yellow/meshes/model.obj"), "f 1 2 3\n")
        .expect("writable");
    fails(&mut run(&recipe, &whole, &[]), 3);
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").expect("there");
    for format in ["human", "json"] {
        for way in ["full", "closed", "would block"] {
            let data = folder.path().join(format!("{format} {way}"));
            let mut command = run(&recipe, &data, &["--log-format", format]);
            // The other end is open, but never read.
            let mut other_end = None;
            match way {
                "full" => drop(command.stderr(full()).stdout(Stdio::null())),
                "closed" => {
                    let arguments: Vec<_> = command.get_args().map(ToOwned::to_owned).collect();
                    let mut shell = Command::new("sh");
                    shell.args(["-c", "exec \"$0\" \"$@\" >/dev/null 2>&-"]).arg(command.get_program()).args(arguments);
                    shell
                        .current_dir(crate::support::root())
                        .env("SYNTABLE_CACHE", crate::support::root().join("target/test-cache"));
                    command = shell;
                }
                _ => {
                    let (mut ours, theirs) = UnixStream::pair().expect("sockets");
                    for end in [&ours, &theirs] {
                        end.set_nonblocking(true).expect("non-blocking");
                    }
                    let mut fill = theirs.try_clone().expect("a copy");
                    while std::io::Write::write(&mut fill, &[0; 4096]).is_ok() {}
                    let _ = &mut ours;
                    other_end = Some(ours);
                    let theirs: OwnedFd = theirs.into();
                    command.stdout(Stdio::null()).stderr(Stdio::from(theirs));
                }
            }
            let status = command.status().expect("starts");
            assert_eq!(status.code(), Some(3), "{format}, {way}: {status}");
            assert_same(&whole, &data);
            drop(other_end);
        }
    }
}

#[test]
fn assets_that_change_are_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = scanned(folder.path());
    let list = folder.path().join("names.txt");
    fs::write(&list, "Room_Essentials_Mug_White_Yellow\nRoom_Essentials_Salad_Plate_Turquoise\n").expect("writable");
    let sets = ["--set", "assets.objects.include_list=\"names.txt\"", "--set", "dataset.scenes=3"];
    // Paths in `--set` are relative to the current folder.
    let run = |out: &Path, more: &[&str]| {
        let mut command = run(&recipe, out, &sets);
        command.args(more).current_dir(folder.path());
        command
    };
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    ok(&mut run(&whole, &[]));
    ok(&mut run(&data, &["--scenes", "0..2"]));
    let half = files(&data);
    let gso = folder.path().join("gso");
    let mesh = gso.join("Room_Essentials_Mug_White_Yellow/meshes/model.obj");
    let texture = gso.join("Room_Essentials_Salad_Plate_Turquoise/materials/textures/texture.png");
    let change = |path: &Path, bytes: Option<&[u8]>, says: &[&str], resolved_says: &[&str]| {
        let before = fs::read(path).ok();
        match bytes {
            Some(bytes) => {
                fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
                fs::write(path, bytes).expect("writable");
            }
            None => fs::remove_file(path).expect("removable"),
        }
        let error = fails(&mut run(&data, &[]), 2);
        assert!(says.iter().all(|word| error.contains(word)), "{says:?}: {error}");
        // The recipe of the whole dataset fails as well.
        let again = folder.path().join("again");
        let resolved = whole.join("recipe.toml");
        let error = fails(syntable().arg("run").arg(&resolved).arg("--out").arg(&again).current_dir(folder.path()), 2);
        assert!(resolved_says.iter().all(|word| error.contains(word)), "{resolved_says:?}: {error}");
        fs::remove_dir_all(again).expect("removable");
        match before {
            Some(before) => fs::write(path, before).expect("writable"),
            None => fs::remove_file(path).expect("removable"),
        }
        let changed = files(&data);
        let scenes = |name: &str| !name.contains("/lock");
        assert!(
            half.iter().filter(|(name, _)| scenes(name)).all(|(name, bytes)| changed.get(name) == Some(bytes)),
            "{says:?}"
        );
    };
    let mut text = fs::read_to_string(&mesh).expect("there");
    text.push_str("v 0.01 0.02 0.03\n");
    let shifted = text.replacen("v 0.", "v 0.0", 1).replacen("v -0.", "v -0.0", 1);
    change(&mesh, Some(shifted.as_bytes()), &["objects/Room_Essentials_Mug", "has changed"], &["has changed"]);
    change(&mesh, Some(b"f 1 2 3\n"), &["objects/Room_Essentials_Mug", "cannot be used"], &["cannot be used"]);
    let pixels = fs::read(gso.join("Room_Essentials_Mug_White_Yellow/materials/textures/texture.png")).expect("there");
    change(&texture, Some(&pixels), &["objects/Room_Essentials_Salad_Plate", "has changed"], &["has changed"]);
    let mut names = fs::read_dir(&gso).expect("there").map(|entry| entry.expect("readable").file_name());
    let coffee =
        names.find_map(|name| name.into_string().ok().filter(|name| name.starts_with("Nescafe"))).expect("coffee");
    let names = format!("Room_Essentials_Mug_White_Yellow\n{coffee}\n");
    let added = ["assets.objects", "added `Nescafe", "removed `Room_Essentials_Salad_Plate"];
    change(&list, Some(names.as_bytes()), &added, &added);
    let new = folder.path().join("materials/Zebra01/Zebra01_Color.png");
    change(&new, Some(&pixels), &["assets.floors", "added `Zebra01`"], &["assets.floors", "added `Zebra01`"]);
    // With all files restored, the run continues.
    ok(&mut run(&data, &[]));
    assert_same(&whole, &data);
}

#[test]
fn a_bad_asset_that_was_mended_is_another_asset() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = scanned(folder.path());
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    let mesh = folder.path().join("gso/Room_Essentials_Mug_White_Yellow/meshes/model.obj");
    let good = fs::read(&mesh).expect("there");
    let bad = "f 1 2 3\n";
    fs::write(&mesh, bad).expect("writable");
    // Enough draws that each scene uses it.
    let scenes = ["--set", "dataset.scenes=3", "--set", "place[2].count=12"];
    // Skipped assets are reported.
    fails(&mut run(&recipe, &whole, &scenes), 3);
    fails(run(&recipe, &data, &scenes).args(["--scenes", "0..2"]), 3);
    fs::write(&mesh, good).expect("writable");
    let error = fails(&mut run(&recipe, &data, &scenes), 2);
    assert!(
        error.contains("objects/Room_Essentials_Mug") && error.contains("could not be used, now it has"),
        "{error}"
    );
    fs::write(&mesh, bad).expect("writable");
    fails(&mut run(&recipe, &data, &scenes), 3);
    assert_same(&whole, &data);
}

#[test]
fn a_half_made_dataset_can_be_moved_and_names_no_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    fs::create_dir(&one).expect("writable");
    let whole = folder.path().join("whole");
    let recipe = scanned(&one);
    ok(&mut run(&recipe, &whole, &[]));
    ok(&mut run(&recipe, &one.join("data"), &["--scenes", "0..1"]));
    fs::rename(&one, &two).expect("moved");
    ok(&mut run(&two.join("recipe.toml"), &two.join("data"), &[]));
    assert_same(&whole, &two.join("data"));
    for (name, bytes) in files(&whole) {
        let place = folder.path().to_string_lossy().into_owned();
        assert!(!String::from_utf8_lossy(&bytes).contains(&place), "{name} names {place}");
    }
    // The resolved recipe finds the assets relative to the folder of the original recipe.
    let again = folder.path().join("again");
    ok(syntable().arg("run").arg(whole.join("recipe.toml")).arg("--out").arg(&again).current_dir(&two));
    assert_same(&whole, &again);
}

#[test]
fn signals_stop_a_run_that_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    let more = ["--set", "dataset.scenes=14"];
    ok(&mut small_run(&whole, &more));
    let data = folder.path().join("data");
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let mut command = small_run(&data, &more);
        let run = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts");
        let lines = || fs::read_to_string(data.join(".syntable/journal.jsonl")).unwrap_or_default().lines().count();
        let (start, before) = (Instant::now(), lines());
        while lines() < before + 2 && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
        }
        ok(Command::new("kill").args(["-s", signal, &run.id().to_string()]));
        let output = run.wait_with_output().expect("ends");
        let said = text(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(&format!("stopped by SIG{signal}")) && said.contains("same command goes on"), "{said}");
    }
    ok(&mut small_run(&data, &more));
    assert_same(&whole, &data);
}

#[test]
fn a_signal_ends_a_long_view() {
    let folder = tempfile::tempdir().expect("a folder");
    // A view that would take minutes.
    let more = ["--set", "render.samples_per_pixel=1000000", "--set", "camera.resolution=[640, 480]"];
    let data = folder.path().join("data");
    let run = small_run(&data, &more).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts");
    std::thread::sleep(Duration::from_secs(3));
    let start = Instant::now();
    ok(Command::new("kill").args(["-s", "INT", &run.id().to_string()]));
    let output = run.wait_with_output().expect("ends");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(130), "{said}");
    // A run that ends sooner than the line appears says the same in its error.
    let lines = ["note: stopping: finished scenes are kept", "stopped by SIGINT: 0 of"];
    assert!(lines.iter().any(|line| said.contains(line)), "{said}");
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
}

/// Runs a command repeatedly, killed later each time, until it finishes. Returns the number of kills.
fn killed_anywhere(command: &dyn Fn() -> Command, after_kill: &dyn Fn()) -> u32 {
    for kills in 0_u32.. {
        let mut run = command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
        let patience = Duration::from_millis(u64::from(kills.pow(3)) / 4 + 2);
        let start = Instant::now();
        while start.elapsed() < patience {
            if let Some(status) = run.try_wait().expect("waits") {
                assert!(status.success(), "{status}");
                return kills;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        run.kill().expect("killable");
        run.wait().expect("waits");
        after_kill();
    }
    unreachable!("a command ends")
}

/// Kills reports, conversions and files of scores at one call of each kind that affects the result, and makes it fail.
/// With `INTERRUPT_EVERY=N`, the test tries one in N of all calls, on one thread and on three; with 1, this takes an
/// hour. The unit tests of `durable` kill each call separately.
#[cfg(target_os = "linux")]
#[test]
fn results_are_whole_whatever_call_is_killed_or_fails() {
    let works = |tool: &str, args: &[&str]| Command::new(tool).args(args).output().is_ok_and(|it| it.status.success());
    if let Some(missing) = ["strace", "python3"].into_iter().find(|tool| !works(tool, &["-V"])) {
        return skip(missing);
    }
    if !works("strace", &["-o", "/dev/null", "true"]) {
        // A container may forbid it, and no installation changes that.
        return skip_slow_tool("the right to trace processes");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    // Two images: the replaced report shows one of them.
    ok(&mut small_run(&data, &["--set", "dataset.scenes=2", "--set", "dataset.views_per_scene=1"]));
    let every = std::env::var("INTERRUPT_EVERY").ok();
    let trials = match &every {
        Some(every) => vec![["--threads=1", "--every", every], ["--threads=3", "--every", every]],
        None => vec![["--threads=1", "--short", "--every=1"]],
    };
    for trial in trials {
        let program = syntable();
        let mut command = Command::new("python3");
        command.arg(crate::support::root().join("tests/interrupt.py")).arg(program.get_program()).arg(&data);
        let output = command.args(trial).output().expect("python3 starts");
        assert!(output.status.success(), "{}", text(&output));
        println!("{}:\n{}", trial[0], text(&output));
    }
}

/// `core/runtime/tests/run/stores.rs` kills other commands at each call to the store.
#[test]
fn kills_while_overwriting_leave_no_half_of_the_old_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    ok(&mut small_run(&whole, &[]));
    ok(&mut small_run(&data, &["--seed", "3", "--set", "dataset.scenes=4"]));
    let turn = std::cell::Cell::new(0_u32);
    let command = || {
        // After every third attempt, a command without `--overwrite` follows. It may find the whole old dataset and be
        // refused, or continue.
        turn.set(turn.get() + 1);
        small_run(&data, &["--overwrite"])
    };
    let after_kill = || {
        if turn.get().is_multiple_of(3) {
            let output = small_run(&data, &["--scenes", "0..1"]).output().expect("starts");
            let said = text(&output);
            match output.status.code() {
                Some(0) => {}
                Some(2) => {
                    assert!(said.contains("another recipe"), "{said}");
                    let found = ok(syntable().arg("verify").arg(&data));
                    assert!(found.contains("4 scenes"), "{found}");
                }
                code => panic!("{code:?}: {said}"),
            }
        }
    };
    assert!(killed_anywhere(&command, &after_kill) > 2);
    assert_same(&whole, &data);
}

#[test]
fn what_is_odd_about_scenes_is_told_once_and_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = small_run(folder.path(), &["--set", "lights=[]", "--threads", "1"]).output().expect("starts");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    for word in
        ["scene 0: all images are black", "of no use: all images are black, in 4 images", "no light", "[[lights]]"]
    {
        assert!(said.contains(word), "{word} is not in\n{said}");
    }
    assert!(!said.contains("scene 1: all images") && said.matches("warning").count() == 1, "{said}");
    let lit = text(&small_run(&folder.path().join("lit"), &[]).output().expect("starts"));
    assert!(!lit.contains("black") && !lit.contains("no light"), "{lit}");
}

#[test]
fn scenes_whose_objects_nobody_sees_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let says = "no object is labeled in any view";
    // Poses above the table, toward it and past it.
    let at = "{ look_at = { eye_m = [0.1, 0.0, 2.2], target_m = [0.0, 0.0, 0.0] } }";
    let past = "{ look_at = { eye_m = [1.5, 0.0, 1.6], target_m = [2.5, 0.0, 1.7] } }";
    let run = |name: &str, poses: &[&str]| {
        let views = format!("views={{ kind = \"fixed_poses\", poses = [{}] }}", poses.join(", "));
        let count = format!("dataset.views_per_scene={}", poses.len());
        let out = folder.path().join(name);
        let output = small_run(&out, &["--set", &views, "--set", &count]).output().expect("starts");
        let code = if poses.contains(&at) { 0 } else { 3 };
        assert_eq!(output.status.code(), Some(code), "{}", text(&output));
        (text(&output), fs::read_to_string(out.join(".syntable/journal.jsonl")).expect("written"))
    };
    let (said, journal) = run("past", &[past, past]);
    assert!(said.contains(&format!("of no use: {says}, in 4 images")) && said.contains("check [views]"), "{said}");
    assert_eq!(journal.matches(r#""unlabeled""#).count(), 2, "{journal}");
    assert!(!said.contains("black") && !said.contains("no light"), "{said}");
    assert!(!journal.contains("odd_views"), "{journal}");
    // One labeled view is enough for a scene. The other view is reported at the end, as a warning if many views are
    // affected.
    let (said, journal) = run("both", &[past, at]);
    assert!(!said.contains(says) && !journal.contains("notices"), "{said}\n{journal}");
    assert_eq!(journal.matches(r#""odd_views":{"unlabeled":[0]}"#).count(), 2, "{journal}");
    let says = "2 of 4 views, such as view 0 of scene 0: no object is labeled";
    assert!(said.contains(&format!("warning: {says}")) && said.contains("[views]"), "{said}");
    assert_eq!(said.matches("labeled").count(), 1, "{said}");
    let mut few = vec![at; 11];
    few[10] = past;
    let (said, _) = run("few", &few);
    let says = "2 of 22 views, such as view 10 of scene 0: no object is labeled";
    assert!(said.contains(&format!("note: {says}")) && !said.contains("warning"), "{said}");
}

#[test]
fn views_that_are_black_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    // From above the table, and from below the floor of the room, which hides everything.
    let at = "{ look_at = { eye_m = [0.1, 0.0, 2.2], target_m = [0.0, 0.0, 0.0] } }";
    let below = "{ look_at = { eye_m = [0.1, 0.0, -3.0], target_m = [0.0, 0.0, -9.0] } }";
    let views = format!("views={{ kind = \"fixed_poses\", poses = [{at}, {below}] }}");
    let out = folder.path().join("data");
    let set = ["--set", &views, "--set", "dataset.views_per_scene=2", "--threads", "1"];
    let output = small_run(&out, &set).output().expect("starts");
    let said = text(&output);
    assert!(output.status.success(), "{said}");
    for says in [
        "warning: scene 0, view 1: the image is black (the camera may be outside the room",
        "warning: 2 of 4 views, such as view 1 of scene 0: the image is black",
    ] {
        assert!(said.contains(says), "{says} is not in\n{said}");
    }
    assert!(!said.contains("scene 1, view 1") && !said.contains("images are black"), "{said}");
    let journal = fs::read_to_string(out.join(".syntable/journal.jsonl")).expect("written");
    assert_eq!(journal.matches(r#""black":[1]"#).count(), 2, "{journal}");
}

#[test]
fn views_that_are_white_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = text(
        &small_run(folder.path(), &["--threads", "1", "--set", "camera.exposure={ ev100 = -10 }"])
            .output()
            .expect("starts"),
    );
    for says in ["warning: scene 0: all images are white (lower the intensity", "2 of 2 scenes: all images are white"] {
        assert!(said.contains(says), "{says} is not in\n{said}");
    }
}

#[test]
fn files_of_a_lost_manifest_are_listed_with_their_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    ok(&mut small_run(folder.path(), &[]));
    let inside = |name: &&String| !name.starts_with(".syntable/");
    let of_scene = files(folder.path())
        .keys()
        .filter(inside)
        .filter(|name| name.contains("/1_") || name.contains("/000001_"))
        .count();
    fs::remove_file(folder.path().join(".syntable/scenes/000/000001.json")).expect("there");
    let output = syntable().arg("verify").arg(folder.path()).output().expect("starts");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(of_scene > 0 && said.contains(&format!("1 missing, 0 damaged, 0 foreign, {of_scene} unlisted")), "{said}");
    assert_eq!(said.matches("(of scene 1, whose manifest is lost)").count(), of_scene, "{said}");
    assert!(said.contains("--repair"), "{said}");
    let said = text(&small_run(folder.path(), &["--repair"]).output().expect("starts"));
    assert!(said.contains("1 file missing"), "{said}");
    let output = syntable().arg("verify").arg(folder.path()).output().expect("starts");
    assert!(text(&output).contains("0 missing, 0 damaged, 0 foreign\n"), "{}", text(&output));
}

#[test]
fn what_is_odd_about_a_pool_is_told_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let set = ["--set", "assets.objects.classes={ nothing = [\"no such*\"] }"];
    for repair in [&[][..], &["--repair"]] {
        let output = small_run(folder.path(), &[&set[..], repair].concat()).output().expect("starts");
        let said = text(&output);
        assert!(output.status.success(), "{said}");
        assert_eq!(said.matches("no asset is of one of the classes").count(), 1, "{said}");
        fs::remove_file(folder.path().join(".syntable/scenes/000/000001.json")).expect("there");
    }
}

#[test]
fn steps_that_do_not_go_together_are_found_at_their_lines() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = crate::support::root().join("recipes/quickstart.toml");
    for (kinds, code, says) in [
        (["room", "table", "ground"], 1, vec!["`room` and `ground` of [[place]] both set the floor", "3 |", "8 |"]),
        (
            ["table", "room", "table\"\nid = \"desk"],
            1,
            vec!["`table` and `desk` of [[place]] both set the support `table`"],
        ),
        (
            ["room", "drop_box", "table"],
            1,
            vec!["`drop_box` of [[place]] needs the support that step `table` sets", "5 |"],
        ),
        (
            ["room", "drop_box", "drop_box"],
            1,
            vec!["`drop_box` of [[place]] needs a support, and no step", "\"table\""],
        ),
        (["room", "table", "distractors"], 1, vec!["no step of [[place]] places objects", "8 |", "\"drop_box\""]),
        // A broken table is one mistake; it is not also reported as missing.
        (["room", "desk", "drop_box"], 0, vec!["no kind `desk`"]),
    ] {
        let pool = |kind: &str| match kind {
            "room" | "ground" => "",
            "drop_box" => "from = [\"objects\"]\n",
            _ => "from = [\"tables\"]\n",
        };
        let steps: String = kinds.iter().map(|kind| format!("[[place]]\nkind = \"{kind}\"\n{}", pool(kind))).collect();
        let recipe = folder.path().join("recipe.toml");
        fs::write(&recipe, format!("extends = \"{}\"\n\n{steps}", base.display())).expect("writable");
        for verb in ["check", "run"] {
            let error = fails(syntable().arg(verb).arg(&recipe).current_dir(folder.path()), 2);
            assert!(says.iter().all(|word| error.contains(word)), "{says:?}:\n{error}");
            assert_eq!(error.matches("[D0026]").count(), code, "{error}");
        }
    }
}

#[test]
fn check_finds_all_mistakes_that_do_not_follow_from_one_another() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("empty")).expect("made");
    let recipe = folder.path().join("recipe.toml");
    let text = "extends = \"builtin:quickstart\"\n[dataset]\nscens = 3\n\
        [assets.nothing]\nkind = \"mesh_folder\"\nroot = \"empty\"\n\
        [assets.gone]\nkind = \"mesh_folder\"\nroot = \"gone\"\n\
        [denoise]\nkind = \"oidn\"\nlibrary = \"/no/such.so\"\n\
        [write.a]\nkind = \"template\"\npath = \"/a\"\ntemplate = \"x\"\n\
        [write.b]\nkind = \"template\"\ntemplate = { file = \"no.tera\" }\n";
    fs::write(&recipe, text).expect("writable");
    let says = [
        "[D0003]: `dataset` has no option `scens`",
        "gone does not exist",
        "[D0011]: denoise: /no/such.so",
        "[D0011]: write.a, the file of view 0 of scene 0: `/a` is not a path inside",
        "error: assets.nothing:",
        "error: 6 errors; nothing was rendered",
    ];
    let error = fails(syntable().arg("check").arg(&recipe), 2);
    assert!(says.iter().all(|word| error.contains(word)), "{error}");
    for (file, times) in [("empty", 1), ("gone", 1), ("no.tera", 1)] {
        let path = format!("/{file}");
        assert_eq!(error.matches(&path).count(), times, "{file}:\n{error}");
    }
    let json = fails(syntable().args(["check", "--log-format", "json"]).arg(&recipe), 2);
    assert_eq!(json.matches(r#""level":"error""#).count(), 6, "nobody counts for a program: {json}");
}

#[test]
fn mistakes_of_steps_files_and_paths_are_found_by_check() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.tera");
    fs::write(&broken, "one\n{% if %}\n").expect("writable");
    let broken = format!("write.t={{ kind = \"template\", template = {{ file = \"{}\" }} }}", broken.display());
    let unknown = folder.path().join("unknown.tera");
    fs::write(&unknown, "one\n{{ sceen.id }}\n").expect("writable");
    let unknown = format!("write.t={{ kind = \"template\", template = {{ file = \"{}\" }} }}", unknown.display());
    let in_folder =
        format!("write.t={{ kind = \"template\", template = {{ file = \"{}\" }} }}", folder.path().display());
    let path = "write.t={ kind = \"template\", template = \"x\", path = ";
    for (set, says) in [
        (unknown.as_str(), vec!["write.t", "unknown.tera:2", "unknown variable `sceen`"]),
        (&in_folder, vec!["`template.file` names a file, but", "is a folder"]),
        (
            "write.t={ kind = \"template\", template = \"{{ view.cameraa }}\" }",
            vec!["line 1", "unknown field `view.cameraa`"],
        ),
        (
            "write.l={ kind = \"jsonl\", file = \"data\" }",
            vec!["`data` is a file of `write.l`, and a folder of `write.syntable`"],
        ),
        (
            "write.data={ kind = \"gltf\" }\u{0}write.l={ kind = \"jsonl\", file = \"data\" }",
            vec!["`data` is a file of `write.l`"],
        ),
        (
            &format!("{path}\"annotation_final.json/x\", per = \"dataset\" }}"),
            vec!["`annotation_final.json` is a file of `write.syntable`, and a folder of `write.t`"],
        ),
        (&format!("{path}\"data/mono/rgb/0_0.png\", per = \"dataset\" }}"), vec!["`write.syntable` and `write.t`"]),
        (&format!("{path}\"data//x.png\", per = \"dataset\" }}"), vec!["is not a path inside the dataset"]),
        (
            &format!("{path}\"contact_sheet/000000_00.png\", per = \"dataset\" }}"),
            vec!["`write.contact_sheet` and `write.t`"],
        ),
        (
            &format!("dataset.scenes=9\u{0}{path}\"contact_sheet/000007_00.png\", per = \"dataset\" }}"),
            vec!["`write.contact_sheet` and `write.t`"],
        ),
        (
            &format!(
                "write.n={{ kind = \"npy\", include = [\"amodal_mask\"] }}\u{0}{path}\"n/amodal_mask/000001_0000_ids.npy\", per = \"dataset\" }}"
            ),
            vec!["`write.n` and `write.t`"],
        ),
        (
            "place.table={ kind = \"support\", from = \"tables\", name = \"table\", on = \"table\" }",
            vec!["step `support` of [[place]] needs the support `table`, which it sets itself"],
        ),
        ("remove=[\"place.table\"]", vec!["needs a support", "[[place]] kind = \"table\""]),
        (
            "place.table={ kind = \"ground\" }\u{0}place.room={ kind = \"listed\", from = \"objects\", poses = [{ position_m = [0, 0, 1] }] }\u{0}place.objects={ kind = \"listed\", from = \"objects\", annotated = false, poses = [{ position_m = [0, 1, 1] }] }",
            vec![
                "`views` needs a support, and no step of [[place]] sets one in every scene",
                "give a `room` a `support`",
            ],
        ),
        (
            "place.room.floor_only=true",
            vec!["`lights.window_light` needs the walls of a room", "kind = \"room\" with walls"],
        ),
        (
            "place.objects={ kind = \"listed\", from = \"objects\", poses = [{ asset = \"spoon_0\", position_m = [0, 0, 1] }] }",
            vec!["place.listed: pose 0: the listed object `spoon_0` is in none of `objects`"],
        ),
        ("write.t={ kind = \"template\", template = { file = \"no/such.tera\" } }", vec!["write.t", "no/such.tera"]),
        (&broken, vec!["write.t", "broken.tera:2"]),
        (&format!("{path}\"labels.txt\" }}"), vec!["write.t", "one path, `labels.txt`", "{{ scene.id | pad"]),
        (&format!("{path}\"a/{{{{ scene.id }}}}.txt\" }}"), vec!["write.t", "view 0 of scene 0 and view 1 of scene 0"]),
        (&format!("{path}\"a/{{{{ view.id }}}}.txt\", per = \"scene\" }}"), vec!["write.t", "view.id"]),
        (&format!("{path}\"/tmp/x\", per = \"dataset\" }}"), vec!["write.t", "`/tmp/x` is not a path inside"]),
        (&format!("{path}\"recipe.toml\", per = \"dataset\" }}"), vec!["write.t", "keeps for itself"]),
        (&format!("{path}\"annotation_final.json\", per = \"dataset\" }}"), vec!["`write.syntable` and `write.t`"]),
        (
            &format!("{path}\"data/mono/rgb/{{{{ scene.id }}}}_{{{{ view.id }}}}.png\" }}"),
            vec!["`write.syntable` and `write.t`"],
        ),
    ] {
        let mut command = syntable();
        command.args(["check", "recipes/quickstart.toml"]);
        if let Some(what) = set.strip_prefix("remove=") {
            let recipe = folder.path().join("recipe.toml");
            let base = crate::support::root().join("recipes/quickstart.toml");
            fs::write(&recipe, format!("extends = \"{}\"\nremove = {what}\n", base.display())).expect("writable");
            command = syntable();
            command.arg("check").arg(recipe);
        } else {
            for set in set.split('\0') {
                command.args(["--set", set]);
            }
        }
        let error = fails(&mut command, 2);
        assert!(says.iter().all(|word| error.contains(word)), "{set}: {says:?}: {error}");
    }
    // Several writers may write into one folder, and a number beyond the dataset belongs to no scene.
    for set in [
        "write.data={ kind = \"png\" }",
        &format!("{path}\"contact_sheet/labels.txt\", per = \"dataset\" }}"),
        &format!("{path}\"contact_sheet/000007_00.png\", per = \"dataset\" }}"),
    ] {
        ok(syntable().args(["check", "recipes/quickstart.toml", "--set", set]));
    }
}
