//! Files inside an asset's folder, and nothing outside it.
//!
//! Assets name other files: an OBJ its material library, a material its images, a glTF its buffers. Such names are
//! untrusted. Every name is resolved here: absolute paths, network addresses, backslashes and names that leave
//! the folder by `..` are refused by their text alone; links are followed by the file system and refused if they lead
//! out. A refused file is never opened.

use crate::limits::MAX_FILE_BYTES;
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use syntable_model::error::{Error, Result};

/// A folder that an asset may read from.
#[derive(Debug, Clone)]
pub struct AssetRoot {
    /// As the user wrote it; used in messages.
    shown: PathBuf,
    /// With links resolved.
    canonical: PathBuf,
}

impl AssetRoot {
    /// Opens a folder. The error says that it is missing, or no folder.
    pub fn open(folder: &Path) -> Result<Self> {
        let canonical = match fs::canonicalize(folder) {
            Ok(canonical) => canonical,
            Err(error) if is_absence(&error) => {
                return Err(Error::new("no such folder")
                    .in_file(folder)
                    .help("check `root`; a relative path counts from the recipe's folder"));
            }
            Err(error) => return Err(Error::io(folder, &error)),
        };
        if !is_dir(&canonical)? {
            return Err(Error::new("not a folder").in_file(folder).help("`root` names a folder of assets"));
        }
        Ok(Self { shown: folder.to_owned(), canonical })
    }

    /// The folder, as the user wrote it.
    pub fn folder(&self) -> &Path {
        &self.shown
    }

    /// Resolves a name that was found in a file of folder `from`, a path relative to this root.
    ///
    /// Returns the path of an existing file or folder, or none if there is nothing of that name. An error refuses the
    /// name.
    pub fn find(&self, from: &Path, name: &str) -> Result<Option<PathBuf>> {
        let refuse = |why: &str| {
            Err(Error::new(format!("`{name}` {why}")).help("an asset may name files of its own folder only"))
        };
        if name.is_empty() || name.contains('\0') {
            return refuse("is not a file name");
        }
        if name.contains('\\') {
            return refuse("has backslashes, which are not followed; write `/` between folders");
        }
        if has_scheme(name) {
            return refuse("is an address, which is never opened");
        }
        self.resolve(&from.join(name), &refuse)
    }

    /// The path of a file or folder of this root that the program itself found, relative to it. Names are taken as they
    /// are; links are followed as in [`find`](Self::find).
    pub fn locate(&self, inside: &Path) -> Result<PathBuf> {
        let refuse = |why: &str| Err(Error::new(why).in_file(self.shown.join(inside)));
        self.resolve(inside, &refuse)?.ok_or_else(|| Error::new("no such file").in_file(self.shown.join(inside)))
    }

    fn resolve(&self, wanted: &Path, refuse: &dyn Fn(&str) -> Result<Option<PathBuf>>) -> Result<Option<PathBuf>> {
        let mut inside = PathBuf::new();
        for component in wanted.components() {
            match component {
                Component::Normal(part) => inside.push(part),
                Component::CurDir => {}
                Component::ParentDir if inside.pop() => {}
                Component::ParentDir => return refuse("leaves the asset's folder"),
                Component::RootDir | Component::Prefix(_) => return refuse("is an absolute path"),
            }
        }
        let shown = self.shown.join(&inside);
        match fs::canonicalize(self.canonical.join(&inside)) {
            Ok(canonical) if canonical.starts_with(&self.canonical) => Ok(Some(shown)),
            Ok(_) => refuse("leads out of the asset's folder through a link"),
            Err(error) if is_absence(&error) => Ok(None),
            Err(error) => Err(Error::io(shown, &error)),
        }
    }
}

/// Reads a whole file: regular, not empty, not too large. The error names it.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    let wrong = |message: String| Err(Error::new(message).in_file(path));
    let io = |error: std::io::Error| {
        if is_absence(&error) { Error::new("no such file").in_file(path) } else { Error::io(path, &error) }
    };
    // The kind is looked up before opening: opening a pipe would wait for ever.
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return wrong("is a directory, not a file".into());
    }
    if !metadata.is_file() {
        return wrong("is not a regular file".into());
    }
    match metadata.len() {
        0 => return wrong("the file is empty".into()),
        bytes if bytes > MAX_FILE_BYTES => {
            return wrong(format!("{bytes} bytes are more than the {MAX_FILE_BYTES} that are allowed"));
        }
        _ => {}
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    fs::File::open(path).map_err(io)?.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Whether there is a file or folder. A device or network that fails is an error, not an absence: the asset would be left
/// out in silence.
pub fn exists(path: &Path) -> Result<bool> {
    metadata(path).map(|metadata| metadata.is_some())
}

/// Whether there is a folder, with the same care.
pub fn is_dir(path: &Path) -> Result<bool> {
    metadata(path).map(|metadata| metadata.is_some_and(|metadata| metadata.is_dir()))
}

fn metadata(path: &Path) -> Result<Option<fs::Metadata>> {
    match fs::metadata(path).map_err(|error| Error::io(path, &error)) {
        Ok(metadata) => Ok(Some(metadata)),
        Err(error) if error.is_transient() => Err(error),
        Err(_) => Ok(None),
    }
}

fn is_absence(error: &std::io::Error) -> bool {
    matches!(error.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory)
}

/// Whether a name begins like `http:` or `C:`.
fn has_scheme(name: &str) -> bool {
    name.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        let folder = tempfile::tempdir().expect("temp folder");
        let root_folder = folder.path().join("root");
        fs::create_dir_all(root_folder.join("a/b")).expect("folders");
        fs::write(root_folder.join("a/b/in.png"), "x").expect("file");
        fs::write(folder.path().join("out.png"), "x").expect("file");
        let root = AssetRoot::open(&root_folder).expect("opens");
        let check =
            |from: &str, name: &str, want: Result<Option<&str>, &str>| match (root.find(Path::new(from), name), want) {
                (Ok(got), Ok(want)) => assert_eq!(got, want.map(|path| root_folder.join(path)), "{name}"),
                (Err(got), Err(want)) => assert!(got.to_string().contains(want), "{name}: {got}"),
                (got, want) => panic!("{name}: got {got:?}, want {want:?}"),
            };
        check("a/b", "in.png", Ok(Some("a/b/in.png")));
        check("a", "./b/../b/in.png", Ok(Some("a/b/in.png")));
        check("a/b", "../b/in.png", Ok(Some("a/b/in.png")));
        check("a/b", "none.png", Ok(None));
        check("a/b", "in.png/deeper", Ok(None));
        check("a/b", "../../../out.png", Err("leaves the asset's folder"));
        check("", "../out.png", Err("leaves the asset's folder"));
        check("", "/etc/passwd", Err("is an absolute path"));
        check("", "..\\out.png", Err("backslashes"));
        check("", "C:\\out.png", Err("backslashes"));
        check("", "c:out.png", Err("address"));
        check("", "https://example.invalid/x.png", Err("address"));
        check("", "file:///etc/passwd", Err("address"));
        check("", "", Err("not a file name"));
    }

    #[cfg(unix)]
    #[test]
    fn links_may_not_lead_out() {
        let folder = tempfile::tempdir().expect("temp folder");
        let root_folder = folder.path().join("root");
        fs::create_dir(&root_folder).expect("folder");
        fs::write(folder.path().join("out.png"), "x").expect("file");
        fs::write(root_folder.join("in.png"), "x").expect("file");
        std::os::unix::fs::symlink("../out.png", root_folder.join("leak.png")).expect("link");
        std::os::unix::fs::symlink("in.png", root_folder.join("alias.png")).expect("link");
        let root = AssetRoot::open(&root_folder).expect("opens");
        let error = root.find(Path::new(""), "leak.png").expect_err("leads out");
        assert!(error.to_string().contains("through a link"), "{error}");
        assert!(root.find(Path::new(""), "alias.png").expect("inside").is_some());
    }

    #[test]
    fn odd_files_are_refused() {
        let folder = tempfile::tempdir().expect("temp folder");
        let error = read_file(folder.path()).expect_err("a folder").to_string();
        assert!(error.contains("is a directory"), "{error}");
        let empty = folder.path().join("empty.obj");
        fs::write(&empty, "").expect("file");
        let error = read_file(&empty).expect_err("empty").to_string();
        assert!(error.contains("empty.obj") && error.contains("empty"), "{error}");
        #[cfg(unix)]
        assert!(read_file(Path::new("/dev/zero")).is_err());
    }
}
