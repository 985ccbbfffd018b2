//! The names that users know, for paths that they never wrote.

use parking_lot::RwLock;
use std::path::{Path, PathBuf};

/// Folders of the program's own, with the names that messages show.
static SHOWN: RwLock<Vec<(PathBuf, String)>> = RwLock::new(Vec::new());

/// The path for a message. A path in a mirror is shown as the URL of its file.
pub fn shown(path: &Path) -> PathBuf {
    let known = SHOWN.read();
    let of = |(folder, name): &(PathBuf, String)| {
        let inside = path.strip_prefix(folder).ok()?.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
        Some(PathBuf::from(if inside.is_empty() { name.clone() } else { format!("{name}/{inside}") }))
    };
    known.iter().find_map(of).unwrap_or_else(|| path.to_owned())
}

/// Shows the paths in a folder under a name, until [`forget`] of the folder.
pub(crate) fn show(folder: &Path, name: &str) {
    SHOWN.write().push((folder.to_owned(), name.to_owned()));
}

/// Shows the paths in a folder as they are.
pub(crate) fn forget(folder: &Path) {
    SHOWN.write().retain(|(known, _)| known != folder);
}
