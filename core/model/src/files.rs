//! Reading files that a recipe names, and the paths of files in datasets.

use crate::error;
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::fmt;
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::ops::Deref;
use std::path::{Component, Path, PathBuf};

/// Largest file that [`read_small`] reads, bytes.
const LARGEST: u64 = crate::limits::SMALL_FILE_BYTES.most;

/// Reads a recipe, a list or a template. Refuses files above 64 MiB, and anything but a regular file: a device or a
/// FIFO may never end.
pub fn read_small(path: &Path) -> Result<Vec<u8>> {
    let refuse = |message: &str| Err(Error::new(ErrorKind::InvalidInput, message));
    // Checked before opening, because opening a FIFO waits for a writer.
    let kind = std::fs::metadata(path)?;
    if kind.is_dir() {
        return refuse("it is a folder");
    }
    if !kind.is_file() {
        return refuse("it is not a regular file");
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return refuse("it has more than 64 MiB");
    }
    Ok(bytes)
}

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

/// First bytes of a file that Git LFS leaves where it has not fetched the content.
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";
/// Bytes at the start of a file that may precede the tag of an HTML page.
const HTML_START: usize = 512;

/// The error of a file that replaces the real one: a pointer of Git LFS, or a page that a server sent instead of a download.
/// None for other content.
pub fn replacement(bytes: &[u8]) -> Option<error::Error> {
    if bytes.starts_with(LFS_POINTER) {
        let error = error::Error::new("a pointer of Git LFS, not the file itself");
        return Some(error.help("fetch the files of the repository: run `git lfs pull` in its folder"));
    }
    let start = &bytes[..bytes.len().min(HTML_START)];
    let text = String::from_utf8_lossy(start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start)).to_ascii_lowercase();
    let text = text.trim_start();
    let is_html = text.starts_with("<!doctype html") || text.starts_with("<html");
    is_html.then(|| {
        let error = error::Error::new("an HTML page, not the file itself");
        error.help("download the file again: the server sent a page instead, such as a login or an error")
    })
}

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

/// How far the names and links in a dataset that is read may reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reach {
    /// Files in the dataset's own folder, also through links that stay in it.
    #[default]
    Inside,
    /// All files: the user trusts the dataset.
    Anywhere,
}

/// A folder of a dataset that is read. Names of files are relative to it.
///
/// Links may lead to the folder itself, because the user named it. From there on, names and links may not lead out,
/// unless [`Reach`] allows it.
#[derive(Debug, Clone)]
pub struct DatasetFolder {
    /// The folder that nothing may lead out of, as the user wrote it.
    root: PathBuf,
    /// The same folder, with links resolved.
    real: PathBuf,
    /// The base of names, relative to `root`.
    at: PathBuf,
    reach: Reach,
}

impl DatasetFolder {
    /// A folder that nothing may lead out of.
    ///
    /// # Errors
    /// If it cannot be found.
    pub fn open(root: &Path, reach: Reach) -> error::Result<Self> {
        let own = if root.as_os_str().is_empty() { Path::new(".") } else { root };
        let real = own.canonicalize().map_err(|error| error::Error::io(root, &error).of_request())?;
        Ok(Self { root: root.to_owned(), real, at: PathBuf::new(), reach })
    }

    /// The same for names relative to the folder `name` inside. `name` is not looked up before a file is.
    pub fn inner(&self, name: impl AsRef<Path>) -> Self {
        Self { at: self.at.join(name), ..self.clone() }
    }

    /// The folder that names are relative to.
    pub fn path(&self) -> PathBuf {
        if self.at.as_os_str().is_empty() { self.root.clone() } else { self.root.join(&self.at) }
    }

    /// The path of a file or folder of this name, which need not exist.
    ///
    /// # Errors
    /// If the name is absolute, or `..` or a link leads out of the dataset's folder.
    pub fn file(&self, name: impl AsRef<Path>) -> error::Result<PathBuf> {
        let name = name.as_ref();
        if self.reach == Reach::Anywhere {
            return Ok(self.root.join(&self.at).join(name));
        }
        let refuse = |why: &str| {
            Err(error::Error::new(format!("`{}` {why}", name.display()))
                .in_file(&self.root)
                .help(
                    "a dataset may name files of its own folder only; if you trust this one, `options.trust_paths` reads files outside",
                )
                .of_request())
        };
        if name.as_os_str().as_encoded_bytes().contains(&0) {
            return refuse("is no name of a file");
        }
        let mut inside = PathBuf::new();
        for component in self.at.components().chain(name.components()) {
            match component {
                Component::Normal(part) => inside.push(part),
                Component::CurDir => {}
                Component::ParentDir if inside.pop() => {}
                Component::ParentDir => return refuse("leads out of the dataset's folder"),
                Component::RootDir | Component::Prefix(_) => return refuse("is an absolute path"),
            }
        }
        let path = self.root.join(&inside);
        match self.real.join(&inside).canonicalize() {
            Ok(real) if real.starts_with(&self.real) => Ok(path),
            Ok(_) => refuse("leads out of the dataset's folder through a link"),
            // Opening the path reports the error.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(path),
            Err(error) => Err(error::Error::io(path, &error)),
        }
    }

    /// Whether a regular file of this name exists and may be read.
    pub fn has(&self, name: impl AsRef<Path>) -> bool {
        self.file(name).is_ok_and(|path| path.is_file())
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

    #[cfg(unix)]
    #[test]
    fn what_is_read_stays_in_the_folder() {
        use std::os::unix::fs::symlink;
        let above = std::env::temp_dir().join(format!("syntable-reach-{}", std::process::id()));
        let root = above.join("data");
        std::fs::create_dir_all(root.join("images/train")).expect("writable");
        std::fs::create_dir_all(above.join("other")).expect("writable");
        for file in ["out.png", "other/x.png", "data/a.png", "data/images/train/b.png"] {
            std::fs::write(above.join(file), "x").expect("writable");
        }
        symlink("../out.png", root.join("last.png")).expect("linked");
        symlink("../other", root.join("first")).expect("linked");
        symlink("../../other", root.join("images/middle")).expect("linked");
        symlink("../a.png", root.join("images/fine.png")).expect("linked");
        symlink("images/train", root.join("val")).expect("linked");
        symlink(&root, above.join("named")).expect("linked");
        let absolute = above.join("out.png");
        for shown in [root.clone(), above.join("named")] {
            let folder = DatasetFolder::open(&shown, Reach::Inside).expect("there");
            let images = folder.inner("images");
            for name in ["../out.png", "images/../../out.png", "last.png", "first/x.png", "images/middle/x.png", "a\0"]
            {
                let message = folder.file(name).expect_err(name).to_string();
                assert!(message.contains("options.trust_paths") && !folder.has(name), "{message}");
            }
            assert!(folder.file(&absolute).is_err() && images.file("../../out.png").is_err());
            assert!(folder.inner("..").file("out.png").is_err());
            for name in ["fine.png", "train/b.png", "../a.png", "./train/../fine.png", "../val/b.png"] {
                assert!(images.has(name), "{name}");
            }
            // A missing file is reported when it is opened.
            assert!(images.file("none/x.png").is_ok() && images.file("fine.png/x").is_ok());
        }
        let trusted = DatasetFolder::open(&root, Reach::Anywhere).expect("there");
        assert!(trusted.has("../out.png") && trusted.has(&absolute) && trusted.has("first/x.png"));
        std::fs::remove_dir_all(&above).expect("removable");
    }
}
