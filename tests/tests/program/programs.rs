//! Stages in programs of other languages: the examples of the crate `syntable-exec` in a whole run.

use crate::support::{assert_same, fails, ok, root, skip, syntable};
use std::fs;
use std::path::Path;
use std::process::Command;
use syntable_formats::npz_archive::NpzArchive;

const THRESHOLD: f64 = 0.3;

fn has(command: &str, arguments: &[&str]) -> bool {
    Command::new(command).args(arguments).output().is_ok_and(|output| output.status.success())
}

/// A writer of one file, with a line for each view.
const INDEX: &str = r#"
import io, json, struct, sys
import numpy as np

while len(start := sys.stdin.buffer.read(8)) == 8:
    message = np.load(io.BytesIO(sys.stdin.buffer.read(struct.unpack("<4sI", start)[1])))
    arrays = {"syntable_number": message["syntable_number"]}
    if message["syntable_message"] == "view":
        arrays["syntable_record"] = f"{message['syntable_scene']} {message['syntable_view']} {message['syntable_seed']}"
    if message["syntable_message"] == "finish":
        lines = json.loads(bytes(message["syntable_records"])) + [f"{len(message['syntable_scenes'])} scenes"]
        arrays["index.txt"] = np.frombuffer("\n".join(lines).encode(), np.uint8)
    file = io.BytesIO()
    np.savez(file, **arrays)
    sys.stdout.buffer.write(struct.pack("<4sI", b"SYN1", file.tell()) + file.getvalue())
    sys.stdout.buffer.flush()
"#;

/// A recipe with an annotator in Python, a writer in a shell, and a writer of a file for the whole dataset.
fn recipe(folder: &Path) -> std::path::PathBuf {
    let examples = root().join("plugins/stages/exec/examples");
    for name in ["darkness.py", "ppm.sh"] {
        fs::copy(examples.join(name), folder.join(name)).expect("copied");
    }
    fs::write(folder.join("index.py"), INDEX).expect("writable");
    let text = format!(
        r#"extends = "builtin:quickstart"
[dataset]
seed = 7
scenes = 2
[camera]
resolution = [64, 48]
[render]
samples_per_pixel = 2
[settle]
duration_s = 1.0
[annotate.darkness]
kind = "exec"
reads = ["rgb", "visible_mask"]
program = {{ file = "darkness.py", interpreter = ["python3"], processes = 2, options = {{ threshold = {THRESHOLD} }} }}
[annotate.darkness.provides.darkness]
form = "float per object"
[write.npz]
include = ["rgb", "visible_mask", "darkness"]
[write.images]
kind = "exec"
include = ["rgb"]
program = {{ file = "ppm.sh" }}
[write.index]
kind = "exec"
include = ["camera"]
finish = true
program = {{ file = "index.py", interpreter = ["python3"] }}
"#
    );
    let file = folder.join("recipe.toml");
    fs::write(&file, text).expect("writable");
    file
}

#[cfg(unix)]
#[test]
fn programs_annotate_and_write() {
    if !has("python3", &["-c", "import numpy"]) || !has("zip", &["-v"]) || !has("unzip", &["-v"]) {
        return skip("python3 with numpy, zip and unzip");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (recipe, out) = (recipe(folder.path()), folder.path().join("whole"));
    let run = |out: &Path, more: &[&str]| {
        let mut command = syntable();
        command.arg("run").arg(&recipe).arg("--out").arg(out).args(more);
        command
    };
    // `check` starts no program, and a run starts it only with consent.
    ok(syntable().arg("check").arg(&recipe));
    let refused = fails(&mut run(&out, &[]), 2);
    for shown in ["file = \"darkness.py\"", "interpreter = [\"python3\"]", "write.images.program = ", "--allow-code"] {
        assert!(refused.contains(shown), "{refused}");
    }
    ok(&mut run(&out, &["--allow-code"]));

    let mut images = 0;
    for entry in fs::read_dir(out.join("npz")).expect("archives") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|end| end != "npz") {
            continue;
        }
        images += 1;
        let mut archive = NpzArchive::open(&path).expect("an archive");
        let mut array = |name: &str| archive.array(name).expect("there").npy().expect("numbers");
        let (rgb, masks, shares) = (array("rgb"), array("visible_mask"), array("darkness"));
        let dark = |pixel: &[u8]| {
            let mean = f64::from(pixel.iter().map(|channel| u32::from(*channel)).sum::<u32>()) / 3.0;
            mean < 255.0 * THRESHOLD
        };
        let dark: Vec<bool> = rgb.bytes.chunks_exact(3).map(dark).collect();
        assert!(masks.shape[0] > 3);
        for (mask, share) in masks.bytes.chunks_exact(dark.len()).zip(shares.bytes.chunks_exact(8)) {
            let of_mask: Vec<bool> =
                mask.iter().zip(&dark).filter(|(set, _)| **set != 0).map(|(_, dark)| *dark).collect();
            let expected = of_mask.iter().filter(|dark| **dark).count() as f64 / of_mask.len().max(1) as f64;
            let found = f64::from_le_bytes(share.try_into().expect("eight bytes"));
            assert!((found - expected).abs() < 1e-12, "{found} is not {expected}");
        }
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
        let ppm = fs::read(out.join(format!("ppm/{name}.ppm"))).expect("an image");
        assert_eq!(ppm, [b"P6\n64 48\n255\n".as_slice(), &rgb.bytes].concat());
    }
    assert!(images > 1);
    let index = fs::read_to_string(out.join("index.txt")).expect("the file of the end");
    let places: Vec<String> = index.lines().map(|line| line.split(' ').take(2).collect::<Vec<_>>().join(" ")).collect();
    assert_eq!(places.last().map(String::as_str), Some("2 scenes"));
    assert_eq!(places.len(), images + 1);
    assert!(places.is_sorted(), "{index}");

    // Parts are merged to the same files; the end of a run is the program's, too.
    let parts = ["0..1", "1..2"].map(|scenes| (scenes, folder.path().join(format!("part-{}", &scenes[..1]))));
    for (scenes, part) in &parts {
        ok(&mut run(part, &["--allow-code", "--scenes", scenes]));
    }
    let merge = |more: &[&str]| {
        let mut command = syntable();
        // Programs of the recipe count from the current folder.
        command
            .current_dir(folder.path())
            .arg("merge")
            .arg(folder.path().join("merged"))
            .args(parts.iter().map(|(_, part)| part))
            .args(more);
        command
    };
    assert!(fails(&mut merge(&[]), 2).contains("--allow-code"));
    ok(&mut merge(&["--allow-code"]));
    assert_same(&folder.path().join("merged"), &out);

    // Another program would make other files: neither a run nor a merge continues with it.
    let program = folder.path().join("index.py");
    fs::write(&program, format!("{INDEX}# changed")).expect("writable");
    let changed = fails(&mut run(&out, &["--allow-code"]), 2);
    assert!(changed.contains("write.index.program.file") || changed.contains("index.py"), "{changed}");
    fs::remove_dir_all(folder.path().join("merged")).expect("removable");
    let changed = fails(&mut merge(&["--allow-code"]), 2);
    assert!(changed.contains("index.py"), "{changed}");
}
