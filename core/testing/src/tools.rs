//! Tests that need an external tool: a Python module, a graphics adapter, a language server.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Prints that a test is skipped because a tool is missing, even if the test harness captures output. If
/// `SYNTABLE_REQUIRE_TOOLS` is 1 or `all`, as in CI, the test fails instead.
pub fn skip(what: &str) {
    skip_unless_required(what, &["1", "all"]);
}

/// Like [`skip`], for a tool that takes minutes to install: only `all`, as in the nightly checks, requires it.
pub fn skip_slow_tool(what: &str) {
    skip_unless_required(what, &["all"]);
}

fn skip_unless_required(what: &str, required: &[&str]) {
    let is_required = std::env::var("SYNTABLE_REQUIRE_TOOLS").is_ok_and(|value| required.contains(&value.as_str()));
    assert!(!is_required, "{what} is missing, and SYNTABLE_REQUIRE_TOOLS is set");
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    let _ = writeln!(std::io::stderr(), "skipped: {name}: {what} is missing");
}

/// Returns `there`, and calls [`skip`] if it is false.
pub fn is_there(there: bool, what: &str) -> bool {
    if !there {
        skip(what);
    }
    there
}

/// Runs a script that needs NumPy, pycocotools and Pillow; returns false if they are not installed. Panics if the
/// script fails.
pub fn python(script: &Path, arguments: &[&str]) -> bool {
    static HERE: OnceLock<bool> = OnceLock::new();
    python_with("numpy, pycocotools, PIL", &HERE, script, arguments)
}

/// Runs a script that needs some modules; returns false if they are not installed, which `here` remembers. Panics if
/// the script fails.
pub fn python_with(modules: &str, here: &OnceLock<bool>, script: &Path, arguments: &[&str]) -> bool {
    let here = *here.get_or_init(|| {
        let output = Command::new("python3").args(["-c", &format!("import {modules}")]).output();
        output.is_ok_and(|output| output.status.success())
    });
    if !is_there(here, &format!("python3 with {modules}")) {
        return false;
    }
    let output = Command::new("python3").arg(script).args(arguments).output().expect("python3 starts");
    let printed = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success(), "{} {arguments:?}\n{}{}", script.display(), printed[0], printed[1]);
    eprint!("{}", printed[0]);
    true
}

/// A script in the folder `tests` of the tested crate; cargo runs tests in the folder of their crate.
pub fn own_script(name: &str) -> PathBuf {
    Path::new("tests").join(name)
}

/// A script in the folder `tests` of the repository.
pub fn shared_script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests").join(name)
}
