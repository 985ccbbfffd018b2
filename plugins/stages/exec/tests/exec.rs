//! Programs that answer well, end, hang or lie. They are shell scripts that print prepared answers.
#![cfg(unix)]

use std::fs::{Permissions, write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use syntable_exec as _;
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::npz;
use syntable_formats::npz_archive::NpzArchive;
use syntable_model::context::{Collected, DatasetContext, ImageContext, Serial, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{RGB, VISIBLE_MASK};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{SceneId, ViewId};
use syntable_testing::scenes::dataset;

const SIZE: [u32; 2] = [4, 3];
const IDS: [InstanceId; 2] = [InstanceId(2), InstanceId(7)];

/// A script of a shell in its own folder, and answers beside it.
struct Script(tempfile::TempDir);

impl Script {
    /// `body` runs in the folder of the script.
    fn new(body: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("program.sh");
        write(&path, format!("#!/bin/sh\ncd '{}'\n{body}\n", folder.path().display())).expect("writable");
        std::fs::set_permissions(&path, Permissions::from_mode(0o755)).expect("a mode");
        let script = Self(folder);
        script.answer("empty", 0, &[]);
        script
    }

    /// A script that answers the start and one view. The answer to the view is prepared.
    fn answering(arrays: &[(&str, Array)]) -> Self {
        let script = Self::new("cat empty view; cat > messages");
        script.answer("view", 1, arrays);
        script
    }

    /// Prepares the answer to a message: 0 is the start, 1 the first view.
    fn answer(&self, name: &str, number: u64, arrays: &[(&str, Array)]) {
        let number = numbers("<u8", &[], number.to_le_bytes().to_vec());
        let arrays = arrays.iter().map(|(name, array)| (*name, array)).chain([("syntable_number", &number)]);
        self.archive(name, &npz::encode(arrays, false).expect("an archive"));
    }

    fn archive(&self, name: &str, archive: &[u8]) {
        let mut bytes = b"SYN1".to_vec();
        bytes.extend_from_slice(&(archive.len() as u32).to_le_bytes());
        bytes.extend_from_slice(archive);
        write(self.at(name), bytes).expect("writable");
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn annotator(&self, provides: &str, more: &str) -> Box<dyn ImageAnnotator> {
        annotator(&self.at("program.sh"), provides, more)
    }

    /// The products of a view, or the error.
    fn annotate(&self, provides: &str, more: &str) -> Result<Products> {
        annotate(&*self.annotator(provides, more), &Serial, &Collected::default())
    }
}

fn annotator(file: &Path, provides: &str, more: &str) -> Box<dyn ImageAnnotator> {
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Annotate, "exec").expect("registered");
    let options = format!(
        "reads = [\"rgb\", \"visible_mask\"]\nprovides = {{ {provides} }}\n[program]\nfile = {:?}\n{more}\n",
        file.display().to_string()
    );
    match entry.construct_str(&options).expect("good options").stage {
        Stage::AnnotateImage(annotator) => annotator,
        _ => panic!("it annotates images"),
    }
}

fn annotate(annotator: &dyn ImageAnnotator, workers: &dyn Workers, log: &dyn Log) -> Result<Products> {
    let dataset = dataset();
    let mut products = Products::new();
    let [width, height] = SIZE;
    products.put(RGB, Plane::from_fn(width, height, |x, y| [x as u8, y as u8, 9])).expect("new");
    let masks = IDS.map(|id| (id, Mask::from_fn(width, height, |x, _| x % u32::from(id.0) == 0)));
    products.put(VISIBLE_MASK, PerInstance::from_iter(masks)).expect("new");
    let cx: ImageContext = DatasetContext::new(&dataset, workers, log).images(SceneId(3)).image(ViewId(1), SIZE);
    annotator.annotate(&cx, &mut products)?;
    Ok(products)
}

fn numbers(descr: &'static str, shape: &[usize], bytes: Vec<u8>) -> Array {
    Array { descr: descr.into(), shape: shape.to_vec(), bytes }
}

fn floats(values: &[f64]) -> Array {
    numbers("<f8", &[values.len()], values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// The arrays of the messages that a script has kept.
fn messages(path: &Path) -> Vec<NpzArchive<std::io::Cursor<Vec<u8>>>> {
    let bytes = std::fs::read(path).expect("kept");
    let (mut rest, mut found) = (bytes.as_slice(), Vec::new());
    while let Some((start, more)) = rest.split_at_checked(8) {
        assert_eq!(start[..4], *b"SYN1");
        let length = u32::from_le_bytes(start[4..].try_into().expect("four bytes")) as usize;
        found.push(NpzArchive::of_bytes(more[..length].to_vec(), path).expect("an archive"));
        rest = &more[length..];
    }
    assert!(rest.is_empty());
    found
}

#[test]
fn a_program_gets_its_products_and_answers_with_others() {
    let heat = [0.5_f32, 1.5, 2.5, 3.5].repeat(3);
    let heat_bytes = heat.iter().flat_map(|value| value.to_le_bytes()).collect();
    let masks: Vec<u8> = (0..24).map(|at| u8::from(at % 3 == 0)).collect();
    let script = Script::answering(&[
        ("share", floats(&[0.25, 0.75])),
        ("heat", numbers("<f4", &[3, 4], heat_bytes)),
        ("part", numbers("|b1", &[2, 3, 4], masks.clone())),
        ("count", numbers("<i8", &[], 7_i64.to_le_bytes().to_vec())),
        ("note_author", Array::text("me")),
        ("note_at", floats(&[1.0, 2.0])),
    ]);
    let provides = "share = { form = \"float per object\" }, heat = { form = \"image\", dtype = \"float32\" }, \
                    part = { form = \"Mask per object\" }, count = { form = \"int\" }, note = { form = \"dict\" }";
    let annotator = script.annotator(provides, "[program.options]\nthreshold = 0.5");
    let products = annotate(&*annotator, &Serial, &Collected::default()).expect("answers");
    let shares = IDS.into_iter().zip([Value::Float(0.25), Value::Float(0.75)]).collect();
    assert_eq!(products.value("share").expect("put"), Value::PerInstance(shares));
    let found: Key<Plane<f32>> = Key::view("heat", "");
    assert_eq!(products.get(found).expect("put").data(), heat);
    let part: Key<PerInstance<Mask>> = Key::view("part", "");
    let of_mask = |at: usize| Mask::from_fn(4, 3, |x, y| masks[12 * at + (4 * y + x) as usize] != 0);
    let parts = IDS.into_iter().enumerate().map(|(at, id)| (id, of_mask(at)));
    assert_eq!(*products.get(part).expect("put"), PerInstance::from_iter(parts));
    assert_eq!(products.value("count").expect("put"), Value::Int(7));
    let note = Value::record([("at", Value::from([1.0, 2.0])), ("author", "me".into())]);
    assert_eq!(products.value("note").expect("put"), note);
    // The program ends when its messages end, and has kept them.
    drop(annotator);
    let [start, view] = &mut messages(&script.at("messages"))[..] else { panic!("two messages") };
    let text = |archive: &mut NpzArchive<_>, name: &str| {
        format!("{:?}", archive.array(name).expect("an array").npy_array().expect("readable"))
    };
    assert!(text(start, "syntable_message").contains("start"));
    assert!(text(start, "syntable_options").contains(r#"{\"threshold\":0.5}"#));
    assert!(text(start, "syntable_provides").contains("\"heat\""));
    let names: Vec<String> = view.names().into_iter().collect();
    let own = ["message", "number", "scene", "seed", "size", "view"].map(|name| format!("syntable_{name}"));
    assert_eq!(names, [vec!["rgb".to_owned()], own.to_vec(), vec!["visible_mask".to_owned()]].concat());
    assert_eq!(view.ids().expect("sound"), Some(IDS.to_vec()));
    let rgb = view.array("rgb").expect("there").npy().expect("numbers");
    assert_eq!((rgb.shape, &rgb.bytes[3..6]), (vec![3, 4, 3], &[1, 0, 9][..]));
    let mask = view.array("visible_mask").expect("there").npy().expect("numbers");
    assert_eq!((mask.shape, &mask.bytes[..4]), (vec![2, 3, 4], &[1, 0, 1, 0][..]));
}

#[test]
fn objects_may_be_left_out() {
    let ids = |id: u16| numbers("<u2", &[1], id.to_le_bytes().to_vec());
    let script = Script::answering(&[("share", floats(&[0.5])), ("ids", ids(7))]);
    let products = script.annotate("share = { form = \"float per object\" }", "").expect("answers");
    let share = [(InstanceId(7), Value::Float(0.5))].into_iter().collect();
    assert_eq!(products.value("share").expect("put"), Value::PerInstance(share));
    let script = Script::answering(&[("share", floats(&[0.5])), ("ids", ids(3))]);
    let error = script.annotate("share = { form = \"float per object\" }", "").map(drop).expect_err("refused");
    assert!(error.to_string().contains("no object of the view"), "{error}");
}

#[test]
fn wrong_answers_are_named() {
    let heat =
        "share = { form = \"float per object\" }, heat = { form = \"image\", dtype = \"float32\", channels = 2 }";
    let image = |descr, shape: &[usize], size: usize| numbers(descr, shape, vec![0; size]);
    let good = || ("share", floats(&[0.5, 0.5]));
    for (arrays, says) in [
        (vec![good()], "the answer has no array `heat`"),
        (
            vec![good(), ("heat", image("<f4", &[3, 4, 3], 144))],
            "float32 of shape (3, 4, 3); float32 of shape (3, 4, 2) is expected",
        ),
        (vec![good(), ("heat", image("<f8", &[3, 4, 2], 192))], "it is float64 of shape (3, 4, 2); float32"),
        (
            vec![("share", floats(&[0.5])), ("heat", image("<f4", &[3, 4, 2], 96))],
            "of shape (2,) is expected, of 2 objects",
        ),
        (
            vec![good(), ("heat", image("<f4", &[3, 4, 2], 96)), ("more", floats(&[]))],
            "the array `more` belongs to no product",
        ),
        (vec![good(), ("heat", image("<f4", &[3, 4, 2], 95))], "and 95 bytes follow"),
        (vec![good(), ("heat", Array::text("hot"))], "it is text of shape (); float32 of shape (3, 4, 2) is expected"),
        (vec![("syntable_error", Array::text("no model in this folder"))], "no model in this folder"),
        (vec![("syntable_errors", Array::text("no"))], "`syntable_errors` means nothing"),
    ] {
        let script = Script::answering(&arrays);
        let error = script.annotate(heat, "").map(drop).expect_err(says);
        let text = error.to_string();
        assert!(text.contains(says) && text.contains("program.sh") && error.is_permanent(), "{text}");
    }
    let pickled = b"SYN1\x04\0\0\0abcd";
    for (bytes, says) in [
        (&pickled[..], "not a readable NumPy archive"),
        (b"loading model...\n", r#"its output begins with "loading ", and an answer with "SYN1""#),
        (b"ok\n", r#"begins with "ok\n""#),
        (b"SYN2\0\0\0\0", "version 2"),
        (b"SYN1\xff\xff\xff\xff", "4294967295 bytes"),
    ] {
        let script = Script::new("cat empty view; cat > messages");
        write(script.at("view"), bytes).expect("writable");
        let text = script.annotate(heat, "").map(drop).expect_err(says).to_string();
        assert!(text.contains(says), "{text}");
    }
}

#[test]
fn an_answer_belongs_to_its_message() {
    let share = "share = { form = \"float per object\" }";
    // Without numbers, the second view would get the second answer to the first view.
    let script = Script::new("cat empty view view; cat > messages");
    script.answer("view", 1, &[("share", floats(&[0.5, 0.5]))]);
    let annotator = script.annotator(share, "");
    annotate(&*annotator, &Serial, &Collected::default()).expect("an answer");
    let error = annotate(&*annotator, &Serial, &Collected::default()).map(drop).expect_err("shifted").to_string();
    assert!(error.contains("it answers another message: `syntable_number` is not 2"), "{error}");
    let script = Script::new("cat empty view; cat > messages");
    script.archive("view", &npz::encode([("share", &floats(&[0.5, 0.5]))], false).expect("an archive"));
    let error = script.annotate(share, "").map(drop).expect_err("without a number").to_string();
    assert!(error.contains("no array `syntable_number`"), "{error}");
    script.archive("view", &npz::encode([("share", &floats(&[0.5, 0.5]))], true).expect("an archive"));
    let error = script.annotate(share, "").map(drop).expect_err("compressed").to_string();
    assert!(error.contains("the archive is compressed"), "{error}");
}

#[test]
fn fields_and_products_are_told_apart() {
    let number = |value: i64| numbers("<i8", &[], value.to_le_bytes().to_vec());
    let script = Script::answering(&[("note_a", number(1)), ("note_count", number(2)), ("note_count_b", number(3))]);
    let provides = "note = { form = \"dict\" }, note_count = { form = \"int\" }, note_count_b = { form = \"int\" }";
    let products = script.annotate(provides, "").expect("answers");
    assert_eq!(products.value("note").expect("put"), Value::record([("a", Value::Int(1))]));
    assert_eq!(products.value("note_count").expect("put"), Value::Int(2));
    assert_eq!(products.value("note_count_b").expect("put"), Value::Int(3));
}

#[test]
fn a_program_that_ends_is_started_again() {
    let share = "share = { form = \"float per object\" }";
    let dies = "cat empty; head -c 20 > part; echo 'no memory' >&2; kill -9 $$";
    // The first process dies.
    let script = Script::new(&format!("if [ ! -e once ]; then touch once; {dies}; fi; cat empty view; cat > messages"));
    script.answer("view", 1, &[("share", floats(&[0.5, 0.5]))]);
    let log = Collected::default();
    annotate(&*script.annotator(share, ""), &Serial, &log).expect("the second process answers");
    let warnings = log.warnings();
    assert_eq!(warnings.len(), 1);
    let text = warnings[0].to_string();
    assert!(text.contains("it ended by signal 9 without an answer; it printed: no memory"), "{text}");
    // All processes die.
    let script = Script::new(&format!("echo start >> starts; {dies}"));
    let error = script.annotate(share, "restarts = 2").map(drop).expect_err("no answer").to_string();
    assert!(error.contains("signal 9"), "{error}");
    assert_eq!(std::fs::read_to_string(script.at("starts")).expect("kept").lines().count(), 3);
    // A failure that does not come from chance is reported as it is.
    let script = Script::new("echo 'ModuleNotFoundError: numpy' >&2; exit 1");
    let error = script.annotate(share, "restarts = 0").map(drop).expect_err("no answer").to_string();
    assert!(error.contains("its start") && error.contains("with status 1") && error.contains("numpy"), "{error}");
}

#[test]
fn a_program_that_hangs_is_killed() {
    // Its child, too, holds the pipe.
    let script = Script::new("cat empty; sleep 1000 & echo $! > child; sleep 1000");
    let start = Instant::now();
    let share = "share = { form = \"float per object\" }";
    let error = script.annotate(share, "answer_s = 0.3\nrestarts = 0").map(drop).expect_err("no answer").to_string();
    assert!(error.contains("no answer within 0.3 s") && error.contains("program.answer_s"), "{error}");
    assert!(start.elapsed() < Duration::from_secs(20));
    assert_ends(&script.at("child"));
}

#[test]
fn what_a_program_starts_ends_with_it() {
    let share = "share = { form = \"float per object\" }";
    let leaves = "sleep 1000 > nothing 2>&1 & echo $! > child";
    let script = Script::new(&format!("{leaves}; cat empty view; cat > messages"));
    script.answer("view", 1, &[("share", floats(&[0.5, 0.5]))]);
    script.annotate(share, "").expect("an answer");
    assert_ends(&script.at("child"));
    let script = Script::new(&format!("{leaves}; exit 1"));
    script.annotate(share, "restarts = 0").map(drop).expect_err("no answer");
    assert_ends(&script.at("child"));
}

/// Waits for the end of the process whose number a file has.
fn assert_ends(number: &Path) {
    let number = std::fs::read_to_string(number).expect("started");
    let is_there = || {
        let status = std::fs::read_to_string(format!("/proc/{}/stat", number.trim()));
        // A process that has ended and was not waited for is a zombie.
        status.is_ok_and(|status| !status.contains(") Z "))
    };
    let start = Instant::now();
    while cfg!(target_os = "linux") && is_there() {
        assert!(start.elapsed() < Duration::from_secs(20), "process {number} still runs");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_stop_ends_the_wait() {
    struct Stopped;
    impl Workers for Stopped {
        fn threads(&self) -> usize {
            1
        }
        fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
            (0..jobs).for_each(job);
        }
        fn check_stop(&self) {
            std::panic::panic_any("stopped");
        }
    }
    let script = Script::new("cat empty; sleep 1000");
    let annotator = script.annotator("share = { form = \"float per object\" }", "");
    let start = Instant::now();
    let work = std::panic::AssertUnwindSafe(|| annotate(&*annotator, &Stopped, &Collected::default()).map(drop));
    assert!(std::panic::catch_unwind(work).is_err());
    assert!(start.elapsed() < Duration::from_secs(20));
}

#[test]
fn a_program_that_is_no_program_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("darkness.py");
    write(&file, "print()").expect("writable");
    let share = "share = { form = \"float per object\" }";
    let fails = |more: &str| {
        let failed = annotate(&*annotator(&file, share, more), &Serial, &Collected::default());
        failed.map(drop).expect_err("not started").to_string()
    };
    assert!(fails("").contains("permission denied") && fails("").contains("program.interpreter"));
    let error = fails("interpreter = [\"no-such-interpreter\"]");
    assert!(error.contains("`no-such-interpreter` cannot be started"), "{error}");
}

#[test]
fn contradictions_in_options_are_refused() {
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Annotate, "exec").expect("registered");
    for (options, key, says) in [
        ("reads = [\"rgb\"]\nprovides = { Dark = { form = \"int\" } }", "provides.Dark", "lower-case"),
        ("reads = [\"rgb\"]\nprovides = { rgb = { form = \"int\" } }", "provides.rgb", "another name"),
        ("reads = [\"rgb\"]\nprovides = { dark = { form = \"image\" } }", "provides.dark", "dtype"),
        ("reads = [\"rgb\"]\nprovides = { ids = { form = \"int\" } }", "provides", "messages have themselves"),
        ("reads = [\"rgb (canvas x)\"]\nprovides = { dark = { form = \"int\" } }", "reads[0]", "no product"),
    ] {
        let error = entry.construct_str(&format!("{options}\n[program]\nfile = \"x\"\n")).map(drop).expect_err(says);
        let text = format!("{error:?}");
        assert!(text.contains(key) && text.contains(says), "{text}");
    }
}
