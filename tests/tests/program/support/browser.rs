//! Pages in headless Chromium.

use super::{root, skip, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Possible names of the browser's program.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// The browser; `CHROMIUM` selects another browser.
pub fn program() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    let found = NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    named.or_else(|| found.into_iter().find(|path| path.is_file()))
}

/// A page to open: its address, and the body of an async function that is run in it.
pub fn job(url: &str, script: &str) -> Value {
    json!({ "url": url, "script": script })
}

/// The address of a file.
pub fn address(file: &Path) -> String {
    format!("file://{}", file.display())
}

/// Opens pages, and returns the results of their scripts. No page may log messages in the console. None without a
/// browser.
pub fn look(jobs: &[Value]) -> Option<Vec<Value>> {
    let Some(program) = program() else {
        skip("chromium");
        return None;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let list = folder.path().join("jobs.json");
    std::fs::write(&list, Value::from(jobs.to_vec()).to_string()).expect("writable");
    let script = root().join("tests/browser.py");
    let output = Command::new("python3").arg(script).arg(program).arg(&list).output().expect("python3 starts");
    assert!(output.status.success(), "{}", text(&output));
    let results: Vec<Value> = serde_json::from_slice(&output.stdout).expect("JSON");
    for (job, result) in jobs.iter().zip(&results) {
        assert_eq!(result["errors"], json!([]), "{}", job["url"]);
    }
    Some(results.into_iter().map(|mut result| result["value"].take()).collect())
}
