//! Datasets and assets that are read from a bucket: the same answers as from a folder, whatever the network does.

use crate::support::bucket::{Bucket, url};
use crate::support::{SMALL, assert_same, convert, fails, ok, small_dataset, syntable, text};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use syntable_testing::folder::files;
use tempfile::TempDir;

/// A dataset in a folder, and a bucket with the same files.
struct Case {
    folder: TempDir,
    bucket: Bucket,
}

impl Case {
    /// A dataset of a run with a writer of each kind of file.
    fn new() -> Self {
        let case = Self { folder: tempfile::tempdir().expect("a folder"), bucket: Bucket::start() };
        small_dataset(&case.local("mine"), &["dataset.scenes=2"]);
        case.upload("mine");
        case
    }

    fn local(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Puts a folder into the bucket.
    fn upload(&self, name: &str) {
        upload(&self.local(name), &self.bucket.stored(name));
    }

    fn cache(&self) -> PathBuf {
        self.local("cache")
    }

    fn syntable(&self, arguments: &[&str]) -> Command {
        let mut command = self.bucket.syntable(arguments);
        command.env("SYNTABLE_CACHE", self.cache());
        command
    }

    /// Runs a verb on a folder, then on its URL. The answers and the exit codes must be equal except for the name. Returns
    /// the answer for the URL.
    fn same_answer(&self, before: &[&str], name: &str, after: &[&str]) -> String {
        let [path, url] = [self.local(name).to_string_lossy().into_owned(), url(name)];
        let answer = |at: &str| -> Output {
            self.syntable(&[before, &[at], after].concat()).output().expect("the program starts")
        };
        let (local, remote) = (answer(&path), answer(&url));
        let said = text(&remote);
        // Tables align their columns with the names.
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&text(&local).replace(&path, &url)), words(&said), "{before:?} {name} {after:?}");
        assert_eq!(local.status.code(), remote.status.code(), "{said}");
        assert!(!said.contains(&*self.cache().to_string_lossy()), "{said}");
        said
    }

    /// The downloads since the last call.
    fn gets(&self) -> Vec<String> {
        let requests = self.bucket.requests().into_iter();
        requests.filter(|request| request.starts_with("GET") && !request.contains('?')).collect()
    }
}

/// Copies all files of a folder, the times of runs included.
fn upload(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("writable");
    for entry in fs::read_dir(from).expect("readable") {
        let (path, to) = {
            let entry = entry.expect("readable");
            (entry.path(), to.join(entry.file_name()))
        };
        match path.is_dir() {
            true => upload(&path, &to),
            false => drop(fs::copy(path, to).expect("copied")),
        }
    }
}

#[test]
fn a_conversion_goes_to_a_bucket_and_pages_stay_here() {
    let case = Case::new();
    let convert = |from: &str, to: &str| case.syntable(&["convert", from, "--to", "coco", "--out", to]);
    let local = case.local("mine").to_string_lossy().into_owned();
    let here = case.local("coco");
    ok(&mut convert(&local, &here.to_string_lossy()));
    ok(&mut convert(&url("mine"), &url("coco/")));
    assert_same(&here, &case.bucket.stored("coco"));
    let again = fails(&mut convert(&url("mine"), &url("coco")), 2);
    assert!(again.contains(&url("coco")) && again.contains("empty"), "{again}");
    // A folder `s3:` would be of no use.
    let (work, pages, sheet) = (case.local("work"), url("pages"), url("pages.png"));
    fs::create_dir(&work).expect("writable");
    for command in [
        vec!["report", &local, "--out", &pages],
        vec!["stats", &local, "--csv", &pages],
        vec!["new", "recipe", &pages],
        vec!["preview", "builtin:quickstart", "--out", &sheet],
    ] {
        let output = case.syntable(&command).current_dir(&work).output().expect("starts");
        let said = text(&output);
        assert!(output.status.code() == Some(2) && said.contains("not to URLs") && said.contains(&pages), "{said}");
    }
    assert_eq!(fs::read_dir(&work).expect("readable").count(), 0);
}

#[test]
fn verbs_answer_for_a_url_as_for_a_folder() {
    let case = Case::new();
    for verb in ["validate", "stats"] {
        for format in [&[][..], &["--json"]] {
            let said = case.same_answer(&[verb], "mine", format);
            assert!(said.contains("images"), "{said}");
        }
    }
    // A file of a dataset, whose images are beside it.
    case.same_answer(&["stats", "--json"], "mine/annotation_final.json", &[]);
    // Two datasets. One is on this machine.
    let [path, remote] = [case.local("mine"), PathBuf::from(url("mine"))];
    let both = ok(case.syntable(&["stats", "--json"]).arg(&path).arg(&remote));
    let both: serde_json::Value = serde_json::from_str(&both).expect("JSON");
    assert_eq!(both["datasets"][0]["images"], both["datasets"][1]["images"]);
    // Pages.
    for (dataset, out) in [(&path, "of-folder"), (&remote, "of-url")] {
        let made = case.syntable(&["report"]).arg(dataset).arg("--out").arg(case.local(out)).output().expect("starts");
        assert!(made.status.success(), "{}", text(&made));
    }
    assert_same(&case.local("of-folder"), &case.local("of-url"));
    // Without `--out`, pages are made in the current folder.
    let mut here = case.syntable(&["report", &url("mine")]);
    let said = here.current_dir(case.folder.path()).output().expect("starts");
    assert!(case.local("mine-report/index.html").is_file(), "{}", text(&said));
}

#[test]
fn datasets_of_all_formats_convert_from_a_url() {
    let case = Case::new();
    for to in ["webdataset", "parquet", "npz", "hdf5", "jsonl", "coco", "yolo", "bop"] {
        let made = convert(&case.local("mine"), to, &case.local(to)).output().expect("starts");
        assert!(matches!(made.status.code(), Some(0 | 3)), "{}", text(&made));
        case.upload(to);
        let again = |from: &str, out: &str| {
            let out = case.local(out);
            // These lack labels that other formats store.
            let target = if ["hdf5", "jsonl"].contains(&to) { to } else { "syntable" };
            let mut command = case.syntable(&["convert", from, "--to", target, "--out"]);
            let output = command.arg(out).output().expect("starts");
            (output.status.code(), text(&output))
        };
        let local = case.local(to).to_string_lossy().into_owned();
        let [one, other] = [again(&local, &format!("{to}-0")), again(&url(to), &format!("{to}-1"))];
        assert_eq!(one.0, other.0, "{}", other.1);
        assert!(matches!(other.0, Some(0 | 3)), "{}", other.1);
        assert_same(&case.local(&format!("{to}-0")), &case.local(&format!("{to}-1")));
    }
}

#[test]
fn files_are_downloaded_once_whatever_the_network_does() {
    let case = Case::new();
    let stats = || case.syntable(&["stats", "--json", &url("mine")]);
    case.bucket.requests();
    let first = ok(&mut stats());
    let files = files(&case.local("mine")).len();
    let gets = case.gets();
    assert!(gets.len() > 8 && gets.len() <= files, "{files} files: {gets:?}");
    fs::remove_dir_all(case.cache()).expect("deletable");
    case.bucket.disturb(3, 40);
    let said = (0..10).find_map(|_| {
        let output = stats().output().expect("starts");
        let said = text(&output);
        assert!(output.status.success() || output.status.code() == Some(1) && said.contains("s3://"), "{said}");
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    });
    assert_eq!(said.as_deref(), Some(first.as_str()));
    // A file that changed in the store is downloaded again.
    let image = case
        .bucket
        .files("mine")
        .into_keys()
        .find(|name| name.ends_with(".png") && name.contains("rgb"))
        .expect("an image");
    fs::write(case.bucket.stored("mine").join(&image), b"no image").expect("writable");
    let output = stats().output().expect("starts");
    let said = text(&output);
    assert!(!output.status.success() && said.contains(&format!("{}/{image}", url("mine"))), "{said}");
    let names = fs::read_dir(case.cache().join("remote/names")).expect("a folder").count();
    assert_eq!(names, 0, "a process removes its names");
}

#[test]
fn a_url_without_a_dataset_is_refused() {
    let case = Case { folder: tempfile::tempdir().expect("a folder"), bucket: Bucket::start() };
    for verb in ["stats", "validate", "report"] {
        let error = fails(&mut case.syntable(&[verb, &url("none")]), 2);
        assert!(error.contains(&format!("{}: no such folder or file", url("none"))), "{error}");
    }
    fs::create_dir_all(case.bucket.stored("odd")).expect("writable");
    fs::write(case.bucket.stored("odd/notes.txt"), "x").expect("writable");
    let error = fails(&mut case.syntable(&["stats", &url("odd")]), 2);
    assert!(error.contains(&format!("{}: unrecognized dataset format", url("odd"))), "{error}");
    let error = fails(syntable().args(["stats", "ftp://host/x"]), 2);
    assert!(error.contains("`ftp`"), "{error}");
    let error = fails(case.syntable(&["stats", &url("odd")]).env("SYNTABLE_CACHE_GB", "many"), 2);
    assert!(error.contains("SYNTABLE_CACHE_GB is `many`"), "{error}");
}

/// A cube as OBJ, meters.
fn cube(size: f64) -> String {
    let corner = |number: usize| {
        let [x, y, z] = [number & 1, number >> 1 & 1, number >> 2].map(|side| side as f64 * size);
        format!("v {x} {y} {z}\n")
    };
    let faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"];
    (0..8).map(corner).chain(faces.map(|face| format!("f {face}\n"))).collect()
}

#[test]
fn assets_come_from_a_bucket() {
    let case = Case { folder: tempfile::tempdir().expect("a folder"), bucket: Bucket::start() };
    let things = case.local("assets/things");
    fs::create_dir_all(&things).expect("writable");
    for (name, size) in [("one.obj", 0.1), ("two.obj", 0.12), ("three.obj", 0.14)] {
        fs::write(things.join(name), cube(size)).expect("writable");
    }
    case.upload("assets");
    let recipe = case.local("my.toml");
    let text_of =
        "extends = \"builtin:quickstart\"\n[assets.objects]\nkind = \"mesh_folder\"\nroot = \"${ASSETS}/things\"\n";
    fs::write(&recipe, text_of).expect("writable");
    let run = |assets: &str, out: &str, more: &[&str]| {
        let mut command = case.syntable(&["run"]);
        command.arg(&recipe).arg("--out").arg(case.local(out)).args(SMALL).args(more).env("ASSETS", assets);
        command
    };
    let local = case.local("assets").to_string_lossy().into_owned();
    ok(&mut run(&local, "of-folder", &[]));
    case.bucket.requests();
    ok(&mut run(&url("assets"), "of-url", &[]));
    assert_same(&case.local("of-folder"), &case.local("of-url"));
    let gets = case.gets();
    assert_eq!(gets.iter().collect::<BTreeSet<_>>().len(), gets.len(), "each object is downloaded once: {gets:?}");
    // A dataset continues with its assets on this machine, and the other way round.
    ok(&mut run(&local, "of-url", &["--set", "dataset.scenes=3"]));
    ok(&mut run(&url("assets"), "of-folder", &["--set", "dataset.scenes=3"]));
    assert_same(&case.local("of-folder"), &case.local("of-url"));
    // Objects are pinned by their content.
    for name in ["one.obj", "two.obj", "three.obj"] {
        fs::write(case.bucket.stored("assets/things").join(name), cube(0.2)).expect("writable");
    }
    let error = fails(&mut run(&url("assets"), "of-url", &["--set", "dataset.scenes=40"]), 2);
    assert!(error.contains("objects/") && error.contains("changed"), "{error}");
    // Mistakes name the URL and the line; a network that is down is none.
    let error = fails(&mut run(&url("nothing"), "none", &[]), 2);
    assert!(
        error.contains("s3://lab/nothing/things: no such folder or file") && error.contains("my.toml:4"),
        "{error}"
    );
    case.bucket.carry(Some(0));
    let error = fails(&mut run(&url("assets"), "none", &[]), 1);
    assert!(error.contains("s3://lab/assets/things"), "{error}");
    assert!(!case.local("none").exists(), "nothing was begun");
}
