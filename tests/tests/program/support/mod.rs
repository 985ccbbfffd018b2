//! Shared code of the whole-program tests: the binary, small recipes, comparing folders.
#![allow(dead_code, reason = "each test file uses a part")]

pub mod browser;
pub mod bucket;
pub mod gallery;
pub mod language_server;
pub mod samples;
pub mod served;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use syntable_model::error::Result;
use syntable_model::reader::OpenDataset;
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_runtime::validate::{Validated, validate};
use syntable_runtime::workers::Pool;
pub use syntable_testing::folder::files;

/// Root of the checkout.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the checkout is there")
}

/// Asset folders for tests: the small folder of the checkout and, if it exists, a larger folder, named by
/// `SYNTABLE_ASSETS` or in `shared/assets` next to the checkout.
pub fn assets() -> Vec<PathBuf> {
    let larger = std::env::var_os("SYNTABLE_ASSETS").map_or_else(|| root().join("../shared/assets"), PathBuf::from);
    let mut folders = vec![root().join("tests/fixtures/assets")];
    folders.extend(Some(larger).filter(|folder| folder.join("gso").is_dir()));
    folders
}

use syntable_testing::takes::registry;
pub use syntable_testing::tools::skip;

/// Checks a dataset of the writer `syntable` with an independent reader.
pub fn check_dataset(dataset: &Path, more: &[&str]) {
    let works = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    if !works(Command::new("python3").args(["-c", "import numpy, pycocotools, PIL"])) {
        return skip("python3 with numpy, pycocotools and pillow");
    }
    let script = root().join("tests/check_dataset.py");
    let output = Command::new("python3").arg(script).arg(dataset).args(more).output().expect("starts");
    assert!(output.status.success(), "{}", text(&output));
}

/// The program, without arguments. Cached results go to a folder that all tests share.
pub fn syntable() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_syntable-under-test"));
    command.env("SYNTABLE_CACHE", root().join("target/test-cache")).current_dir(root());
    command
}

/// `syntable convert` of a dataset with some writers, into a folder.
pub fn convert(from: &Path, to: &str, out: &Path) -> Command {
    let mut convert = syntable();
    convert.arg("convert").arg(from).args(["--to", to, "--out"]).arg(out);
    convert
}

/// Runs a command that must succeed. Returns its standard output.
pub fn ok(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{command:?}\n{}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs a command that creates a dataset. Returns its standard output. It must succeed, or end with exit code 3 because
/// formats of polygons fill the holes of masks.
pub fn made(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    let said = text(&output);
    let mut losses = said.lines().filter(|line| line.starts_with("warning: write."));
    let are_holes =
        said.contains("data are written incompletely by") && losses.all(|it| it.contains("have holes in their"));
    assert!(output.status.success() || output.status.code() == Some(3) && are_holes, "{command:?}\n{said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs a command that must fail with an exit code. Returns its standard error.
pub fn fails(command: &mut Command, code: i32) -> String {
    let output = command.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(code), "{command:?}\n{}", text(&output));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Both outputs of a program.
pub fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Arguments that make any recipe small.
pub const SMALL: [&str; 8] = [
    "--set",
    "camera.resolution=[64, 48]",
    "--set",
    "render.samples_per_pixel=2",
    "--set",
    "place[2].count={ integers = [2, 5] }",
    "--set",
    "settle.duration_s=2.0",
];

/// `syntable run` of the quickstart recipe, small, into a folder.
pub fn small_run(out: &Path, more: &[&str]) -> Command {
    let mut command = syntable();
    command.args(["run", "recipes/quickstart.toml", "--out"]).arg(out).args(SMALL).args(more);
    command
}

/// Checks that two folders contain the same files, byte for byte.
pub fn assert_same(left: &Path, right: &Path) {
    let (a, b) = (files(left), files(right));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b), "{} and {} hold different files", left.display(), right.display());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs between {} and {}", left.display(), right.display());
    }
}

/// Creates the dataset of [`small_dataset_run`].
pub fn small_dataset(out: &Path, more: &[&str]) {
    made(&mut small_dataset_run(out, more));
}

/// A run of the quickstart recipe with eight objects per scene, small and noisy images, and the given settings.
pub fn small_dataset_run(out: &Path, more: &[&str]) -> Command {
    let mut run = syntable();
    run.args(["run", "builtin:quickstart", "--out"]).arg(out);
    let small = [
        "dataset.seed=7",
        "camera.resolution=[160, 120]",
        "render.samples_per_pixel=1",
        "denoise.kind=\"none\"",
        "place[2].count=8",
    ];
    for set in small.iter().chain(more) {
        run.args(["--set", set]);
    }
    run
}

/// Reads all images of a dataset, and runs every check.
pub fn checked(dataset: &OpenDataset) -> Result<Validated> {
    let pool = Pool::new(2)?;
    let work = ImageWork { workers: &pool, reporter: &Quiet, stop: &Stop::default() };
    validate(dataset, registry().checks(), &work)
}
