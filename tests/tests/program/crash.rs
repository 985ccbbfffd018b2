//! A run that is killed anywhere and started again produces the folder of an undisturbed run.

use crate::support::{assert_same, fails, ok, small_run, syntable};
use std::process::Stdio;
use std::time::{Duration, Instant};

#[test]
fn a_killed_run_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    let scenes = ["--set", "dataset.scenes=4"];
    let start = Instant::now();
    ok(&mut small_run(&whole, &scenes));
    let undisturbed = start.elapsed();
    // Kills it at increasing times until it finishes.
    let mut kills = 0;
    for step in 1_u32.. {
        let mut run = small_run(&broken, &scenes).stderr(Stdio::null()).stdout(Stdio::null()).spawn().expect("starts");
        let patience = undisturbed * step / 12 + Duration::from_millis(7 * u64::from(step));
        let start = Instant::now();
        let ended = loop {
            if let Some(status) = run.try_wait().expect("waits") {
                break Some(status);
            }
            if start.elapsed() > patience {
                break None;
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        match ended {
            Some(status) => {
                assert!(status.success());
                break;
            }
            None => {
                run.kill().expect("killable");
                run.wait().expect("waits");
                kills += 1;
            }
        }
    }
    assert!(kills > 0, "the run ended before it could be killed");
    assert_same(&whole, &broken);
}

/// Three workers share a dataset. One is killed, and one is paused until the others have taken over its scene.
#[cfg(unix)]
#[test]
fn a_killed_and_a_paused_worker_cost_a_scene_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, shared) = (folder.path().join("whole"), folder.path().join("shared"));
    let scenes = ["--set", "dataset.scenes=24", "--threads", "1"];
    ok(&mut small_run(&whole, &scenes));
    let worker = || {
        let mut run = small_run(&shared, &scenes);
        run.args(["--claim", "--lease", "1"]).stderr(Stdio::null()).stdout(Stdio::null()).spawn().expect("starts")
    };
    let [mut first, mut killed, mut paused] = [worker(), worker(), worker()];
    let count = |name: &str| std::fs::read_dir(shared.join(".syntable").join(name)).map_or(0, Iterator::count);
    let until = |what: &str, is_so: &dyn Fn() -> bool| {
        let start = Instant::now();
        while !is_so() {
            assert!(start.elapsed() < Duration::from_secs(60), "not within a minute: {what}");
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    let signal = |name: &str, worker: &std::process::Child| {
        ok(std::process::Command::new("kill").args([name, &worker.id().to_string()]));
    };
    until("all workers have claims, and a scene is made", &|| count("claims") >= 3 && count("journal") > 0);
    signal("-STOP", &paused);
    killed.kill().expect("killable");
    killed.wait().expect("waits");
    let of_paused = count("claims");
    until("all scenes are made", &|| count("journal") == 24);
    assert!(of_paused > 0 && paused.try_wait().expect("waits").is_none());
    signal("-CONT", &paused);
    assert!(first.wait().expect("waits").success() && paused.wait().expect("waits").success());
    assert_same(&whole, &shared);
    for name in ["claims", "journal", "staging"] {
        assert!(!shared.join(".syntable").join(name).exists(), "{name} stays");
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "not a folder").expect("writable");
    let error = fails(&mut small_run(&file.join("data"), &[]), 2);
    assert!(error.contains("file/data") && error.contains("choose a folder that can be written"), "{error}");
}

#[test]
fn a_full_disk_leaves_a_folder_that_resumes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (disk, whole) = (folder.path().join("disk"), folder.path().join("whole"));
    std::fs::create_dir(&disk).expect("writable");
    let mount = |options: &str| {
        let done =
            std::process::Command::new("mount").args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(&disk).output();
        done.is_ok_and(|output| output.status.success())
    };
    if !mount("size=100k") {
        eprintln!("skipped: a small disk cannot be mounted here");
        return;
    }
    let scenes_of = ["--set", "dataset.scenes=3"];
    let error = fails(&mut small_run(&disk, &scenes_of), 1);
    assert!(error.contains("no space left") && error.contains("run the same command"), "{error}");
    assert!(mount("remount,size=100m"), "the disk can grow");
    ok(&mut small_run(&disk, &scenes_of));
    ok(&mut small_run(&whole, &scenes_of));
    assert_same(&whole, &disk);
    std::process::Command::new("umount").arg(&disk).status().expect("unmounted");
    // Merges the parts onto a small disk.
    let parts = ["0..1", "1..3"].map(|scenes| {
        let part = folder.path().join(scenes);
        ok(small_run(&part, &scenes_of).args(["--scenes", scenes]));
        part
    });
    assert!(mount("size=60k"), "it was mounted before");
    let merge = || {
        let mut command = syntable();
        command.arg("merge").arg(&disk).args(&parts);
        command
    };
    let error = fails(&mut merge(), 1);
    assert!(error.contains("no space left") && error.contains("run the same command"), "{error}");
    assert!(mount("remount,size=100m"), "the disk can grow");
    ok(&mut merge());
    assert_same(&whole, &disk);
    std::process::Command::new("umount").arg(&disk).status().expect("unmounted");
}
