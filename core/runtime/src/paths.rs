//! Paths of people, as they may be compared.

use std::path::{Path, PathBuf};

/// A path without links and detours, as far as it exists.
pub(crate) fn whole(path: &Path) -> PathBuf {
    let of = |folder: &Path| {
        let inside = path.strip_prefix(folder).ok()?;
        Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }.canonicalize().ok()?.join(inside))
    };
    path.ancestors().find_map(of).unwrap_or_else(|| path.to_owned())
}
