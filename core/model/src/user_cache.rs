//! The folder of what may be deleted at any time.

use std::path::PathBuf;

/// The user's cache: `$SYNTABLE_CACHE`, else `$XDG_CACHE_HOME/syntable`, else `~/.cache/syntable`. None without any of these
/// variables, because other users can read and write a folder for temporary files.
pub fn user_cache() -> Option<PathBuf> {
    let var = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    var("SYNTABLE_CACHE")
        .or_else(|| Some(var("XDG_CACHE_HOME")?.join("syntable")))
        .or_else(|| Some(var("HOME")?.join(".cache/syntable")))
}
