//! Shared by the fuzz targets of readers: an input becomes a file in memory, which the program inspects as
//! `syntable check --asset` does.

use std::path::PathBuf;
use syntable_assets as _;
use syntable_model::context::Collected;

/// A folder of this process, in memory where the system has such a place.
fn folder() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let base = if memory.is_dir() { memory } else { std::env::temp_dir() };
    base.join(format!("syntable-fuzz-{}", std::process::id()))
}

/// Writes files, and inspects the first one. What the inspection says is of no matter: it must return.
pub fn inspect(files: &[(&str, &[u8])]) {
    let folder = folder();
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, bytes) in files {
        std::fs::write(folder.join(name), bytes).expect("a file");
    }
    let _ = syntable_model::inspect::inspect(&folder.join(files[0].0), &Collected::default());
}
