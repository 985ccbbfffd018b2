//! Paths of files in datasets.

use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// A path within a dataset: relative, with `/` between folders, such as `png/rgb/0_0.png`.
///
/// It has no root, drive, backslash or NUL, and none of its parts is empty, `.` or `..`. Joined to any folder, it
/// therefore names a file or folder below that folder. The code that opens it decides about links on the way. Paths are
/// ordered and serialized as text.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct DatasetPath(String);

/// Longest name of a file or folder that file systems accept, bytes.
const LONGEST_NAME: usize = 255;

/// Names at the top of a dataset that the program keeps for itself: its own folder, and the resolved recipe.
pub const RESERVED: [&str; 2] = [".syntable", "recipe.toml"];

/// Why a text is not a path within a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotInside(String);

/// A text for a message, without control characters.
fn shown(path: &str) -> String {
    let each = path.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() });
    format!("`{}`", each.collect::<String>())
}

impl fmt::Display for NotInside {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NotInside {}

impl DatasetPath {
    /// Checks a text. The error explains why it is not a path within a dataset.
    pub fn new(path: impl Into<String>) -> std::result::Result<Self, NotInside> {
        let path = path.into();
        let refuse = |why: String| Err(NotInside(format!("{} is not a path inside the dataset: {why}", shown(&path))));
        let has_drive = matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic());
        if path.is_empty() {
            return refuse("it is empty".into());
        } else if path.starts_with('/') || has_drive {
            return refuse("it is absolute".into());
        } else if path.contains('\\') {
            return refuse("it has a backslash; folders are separated by `/`".into());
        } else if path.contains('\0') {
            return refuse("it has a NUL character".into());
        } else if path.ends_with('/') {
            return refuse("it is a folder, not a file".into());
        }
        for part in path.split('/') {
            match part {
                "" => return refuse("a part of it is empty".into()),
                "." | ".." => return refuse(format!("`{part}` is a part of it")),
                part if part.len() > LONGEST_NAME => {
                    return refuse(format!(
                        "a name in it is longer than {LONGEST_NAME} bytes, which file systems refuse"
                    ));
                }
                _ => {}
            }
        }
        Ok(Self(path))
    }

    /// The same for a file of a writer. Refuses [`RESERVED`] names, which the program keeps for itself.
    pub fn of_writer(path: impl Into<String>) -> std::result::Result<Self, NotInside> {
        let path = Self::new(path)?;
        match path.is_reserved() {
            true => Err(NotInside(format!("{} is a path that the program keeps for itself", shown(&path)))),
            false => Ok(path),
        }
    }

    /// Whether it is one of [`RESERVED`], or below one.
    pub fn is_reserved(&self) -> bool {
        self.parts().next().is_some_and(|first| RESERVED.contains(&first))
    }

    /// The path as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Names of its folders, from the outermost one, and of the file.
    pub fn parts(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.0.split('/')
    }

    /// The folders that it is in, from the outermost one.
    pub fn folders(&self) -> impl Iterator<Item = &str> {
        self.0.match_indices('/').map(|(end, _)| &self.0[..end])
    }

    /// The path of `inside` if this path is a folder.
    pub fn join(&self, inside: &Self) -> Self {
        Self(format!("{self}/{inside}"))
    }

    /// The path below the folder of a dataset.
    pub fn below(&self, root: &Path) -> PathBuf {
        root.join(&self.0)
    }
}

impl TryFrom<String> for DatasetPath {
    type Error = NotInside;

    fn try_from(path: String) -> std::result::Result<Self, NotInside> {
        Self::new(path)
    }
}

impl From<DatasetPath> for String {
    fn from(path: DatasetPath) -> Self {
        path.0
    }
}

impl Deref for DatasetPath {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl Borrow<str> for DatasetPath {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for DatasetPath {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_within_a_dataset_lead_nowhere_else() {
        let long = format!("a/{}", "b".repeat(256));
        for (path, says) in [
            ("", "empty"),
            ("/a", "absolute"),
            ("C:\\x", "absolute"),
            ("c:x", "absolute"),
            ("a\\..\\b", "backslash"),
            ("a\0b", "NUL"),
            ("a/", "a folder, not a file"),
            ("a//b", "empty"),
            ("..", "`..`"),
            ("../a", "`..`"),
            ("a/../../b", "`..`"),
            ("./a", "`.`"),
            ("a/./b", "`.`"),
            (&long, "longer than 255 bytes"),
        ] {
            let message = DatasetPath::new(path).expect_err(path).to_string();
            assert!(message.contains(says) && message.contains("inside the dataset"), "{message}");
            let json = serde_json::to_string(path).expect("text");
            assert!(serde_json::from_str::<DatasetPath>(&json).is_err(), "{path}");
        }
        for path in ["a", "a/b.png", ".hidden", "...", "a b/ä:c", ".syntable/shards/w/000/000003.jsonl", &long[..257]]
        {
            let read = DatasetPath::new(path).expect(path);
            assert_eq!(serde_json::to_string(&read).expect("text"), serde_json::to_string(path).expect("text"));
            assert!(read.below(Path::new("/d")).starts_with("/d"));
        }
        for path in RESERVED.iter().copied().chain([".syntable/x", "recipe.toml/x"]) {
            assert!(DatasetPath::of_writer(path).expect_err(path).to_string().contains("keeps for itself"));
        }
        assert!(DatasetPath::of_writer("a/recipe.toml").is_ok());
        let path = DatasetPath::new("a/b/c").expect("a path");
        assert_eq!(path.folders().collect::<Vec<_>>(), ["a", "a/b"]);
    }
}
