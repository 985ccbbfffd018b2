//! Folders of datasets that are read.

use crate::error::{Error, Result};
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

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
    pub fn open(root: &Path, reach: Reach) -> Result<Self> {
        let own = if root.as_os_str().is_empty() { Path::new(".") } else { root };
        let real = own.canonicalize().map_err(|error| Error::io(root, &error).of_request())?;
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
    pub fn file(&self, name: impl AsRef<Path>) -> Result<PathBuf> {
        let name = name.as_ref();
        if self.reach == Reach::Anywhere {
            return Ok(self.root.join(&self.at).join(name));
        }
        let refuse = |why: &str| {
            Err(Error::new(format!("`{}` {why}", name.display()))
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
            Err(error) => Err(Error::io(path, &error)),
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
