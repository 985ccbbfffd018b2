//! Access to files inside an asset's folder only.
//!
//! Assets name other files: an OBJ its material library, a material its images, a glTF its buffers. Such names are
//! untrusted, and often come from another machine. This module resolves every name. For an absolute path, or a name
//! that leaves the folder by `..`, only the last parts are used, inside the folder. Network addresses are refused. The
//! file system follows links, and links that lead outside are refused. A refused file is never opened.

use crate::limits::Budget;
use crate::scan::{is_dir, list, metadata};
use crate::text::shorten;
use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use syntable_model::error::{Error, Result};
use syntable_model::files::replacement;
use syntable_model::limits::LIST_BYTES;
use syntable_model::mirror::DatasetFile;
use syntable_model::stage::AssetLimits;

/// Maximum number of trailing parts of a path to look for inside the root.
const MAX_PARTS: usize = 16;

/// A resolved name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResolvedName {
    /// An existing file or folder of the root.
    pub path: PathBuf,
    /// A warning if the name differs from the name in the file; without file and line.
    pub note: Option<Error>,
}

impl ResolvedName {
    /// The path, after a warning if its name differs.
    pub fn noted(self, warn: impl FnOnce(Error)) -> PathBuf {
        if let Some(note) = self.note {
            warn(note);
        }
        self.path
    }
}

/// A folder that an asset may read from.
#[derive(Debug, Clone)]
pub struct AssetRoot {
    /// Path as the user wrote it, for messages.
    shown: PathBuf,
    /// Path with links resolved.
    canonical: PathBuf,
    /// Budget that all copies of this root share.
    budget: Arc<Budget>,
    /// The files that all copies of this root have read.
    read: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl AssetRoot {
    /// Opens a folder. The error distinguishes a missing folder from a file.
    pub fn open(folder: &Path) -> Result<Self> {
        let canonical = match fs::canonicalize(folder) {
            Ok(canonical) => canonical,
            Err(error) if is_absence(&error) => {
                return Err(Error::new("no such folder")
                    .in_file(folder)
                    .help("check `root`; a relative path starts from the recipe's folder"));
            }
            Err(error) => return Err(Error::io(folder, &error)),
        };
        if !is_dir(&canonical)? {
            return Err(Error::new("not a folder").in_file(folder).help("`root` must name a folder of assets"));
        }
        Ok(Self { shown: folder.to_owned(), canonical, budget: Arc::default(), read: Arc::default() })
    }

    /// The same folder, for one asset with these limits. Without this, default limits apply.
    pub fn within(self, limits: AssetLimits) -> Self {
        Self { budget: Arc::new(Budget::new(limits)), ..self }
    }

    /// The remaining budget. Readers ask it before they allocate.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Reads a whole file of the asset: regular, not empty, within its limits. Errors name the file.
    pub fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let bytes = read(path, &|bytes| self.budget.bytes(bytes))?;
        self.read.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned());
        Ok(bytes)
    }

    /// The files that this root and its copies have read, in order of their paths.
    pub fn files_read(&self) -> Vec<PathBuf> {
        self.read.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// The folder, as the user wrote it.
    pub fn folder(&self) -> &Path {
        &self.shown
    }

    /// Resolves a name from a file in folder `from`, a path relative to this root.
    ///
    /// Returns an existing file or folder, or `None` if nothing has that name. An error refuses the name. Names often
    /// come from another machine. After the name as written, these are tried, with a note: backslashes as separators,
    /// the last parts of an absolute path or of a path that leaves the root, the base name alone, and other letter
    /// case. Every result is below the root.
    pub fn find(&self, from: &Path, name: &str) -> Result<Option<ResolvedName>> {
        let shown = shorten(name);
        let refusal =
            |why: &str| Error::new(format!("`{shown}` {why}")).help("an asset may name only files of its own folder");
        let refuse = |why: &str| Err(refusal(why));
        if name.is_empty() || name.contains('\0') {
            return Err(refusal("is not a file name"));
        }
        if has_scheme(name) {
            return Err(refusal("is a network address, which is never opened"));
        }
        let portable = name.replace('\\', "/");
        let absolute = portable.starts_with('/') || has_drive(&portable);
        let mut refused = None;
        if !absolute {
            // A backslash may also be part of a name, for instance if a Unix program unpacked a Windows archive.
            let written = [Some(name), Some(portable.as_str()).filter(|portable| *portable != name)];
            for spelling in written.into_iter().flatten() {
                match self.resolve(&from.join(spelling), &refuse) {
                    Ok(Some(path)) => return Ok(Some(ResolvedName { path, note: None })),
                    Ok(None) => {}
                    Err(error) => refused = Some(error),
                }
            }
        }
        let path = if has_drive(&portable) { &portable[2..] } else { &portable };
        let parts: Vec<&str> = path.split('/').filter(|part| !matches!(*part, "" | "." | "..")).collect();
        for first in parts.len().saturating_sub(MAX_PARTS)..parts.len() {
            // The name as written was tried before; now the letter case may differ.
            if let Some(path) = self.in_any_case(from, &parts[first..])? {
                let instead = path.strip_prefix(&self.shown).unwrap_or(&path).display();
                let note = Error::new(format!("`{shown}` is missing; reading `{instead}`"))
                    .help("correct the name in the file, because other programs may not find it");
                return Ok(Some(ResolvedName { path, note: Some(note) }));
            }
        }
        refused.map_or(Ok(None), Err)
    }

    /// An existing path in folder `from` with these parts in any letter case; the first of several.
    fn in_any_case(&self, from: &Path, parts: &[&str]) -> Result<Option<PathBuf>> {
        let refuse = |_: &str| Ok(None);
        let mut inside = from.to_owned();
        for part in parts {
            let exact = inside.join(part);
            if self.resolve(&exact, &refuse)?.is_some() {
                inside = exact;
                continue;
            }
            let Some(folder) = self.resolve(&inside, &refuse)? else { return Ok(None) };
            if !is_dir(&folder)? {
                return Ok(None);
            }
            let listing = list(&folder)?;
            let wanted = part.to_lowercase();
            let mut names = listing.files.iter().chain(&listing.folders);
            match names.find(|name| name.to_lowercase() == wanted) {
                Some(name) => inside.push(name),
                None => return Ok(None),
            }
        }
        self.resolve(&inside, &refuse)
    }

    /// The path of a file or folder of this root that the program itself found, relative to the root. Names must match
    /// exactly; links are followed as in [`find`](Self::find).
    pub fn locate(&self, inside: &Path) -> Result<PathBuf> {
        let help = "name a folder as `root` that contains the files behind links, too";
        let refuse = |why: &str| Err(Error::new(why).in_file(self.shown.join(inside)).help(help));
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

/// Reads a whole file that belongs to no asset: regular, not empty, at most [`LIST_BYTES`]. Errors name the file.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    read(path, &|bytes| LIST_BYTES.check(bytes))
}

fn read(path: &Path, allow: &dyn Fn(u64) -> Result<()>) -> Result<Vec<u8>> {
    let wrong = |message: String| Err(Error::new(message).in_file(path));
    let io = |error: std::io::Error| {
        if is_absence(&error) { Error::new("no such file").in_file(path) } else { Error::io(path, &error) }
    };
    // The kind is checked before opening, because opening a pipe would wait forever.
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return wrong("is a directory, not a file".into());
    }
    if !metadata.is_file() {
        return wrong("is not a regular file".into());
    }
    let file = DatasetFile::open(path).map_err(io)?;
    let size = file.size().map_err(io)?;
    if size == 0 {
        return wrong("the file is empty".into());
    }
    allow(size).map_err(|error| error.in_file(path))?;
    let mut bytes = Vec::with_capacity(size as usize);
    file.take(size).read_to_end(&mut bytes).map_err(io)?;
    match replacement(&bytes) {
        Some(error) => Err(error.in_file(path)),
        None => Ok(bytes),
    }
}

/// Whether a file or folder exists. A failing device or network is an error, because the asset would otherwise be
/// omitted silently.
pub fn exists(path: &Path) -> Result<bool> {
    metadata(path).map(|metadata| metadata.is_some())
}

fn is_absence(error: &std::io::Error) -> bool {
    matches!(error.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory)
}

/// Whether a name begins with a drive letter, such as `C:`.
fn has_drive(name: &str) -> bool {
    matches!(name.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

/// Whether a name begins with a scheme, such as `http:`. One letter is a drive.
fn has_scheme(name: &str) -> bool {
    name.split_once(':').is_some_and(|(scheme, _)| {
        scheme.len() > 1
            && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
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
        fs::create_dir_all(root_folder.join("a/Maps")).expect("folder");
        fs::write(root_folder.join("a/Maps/Red.PNG"), "x").expect("file");
        // Expected path, and whether a note reports a different name.
        let check = |from: &str, name: &str, want: Result<Option<(&str, bool)>, &str>| match (
            root.find(Path::new(from), name),
            want,
        ) {
            (Ok(got), Ok(want)) => {
                let got = got.map(|found| (found.path, found.note.is_some()));
                assert_eq!(got, want.map(|(path, noted)| (root_folder.join(path), noted)), "{name}");
            }
            (Err(got), Err(want)) => assert!(got.to_string().contains(want), "{name}: {got}"),
            (got, want) => panic!("{name}: got {got:?}, want {want:?}"),
        };
        check("a/b", "in.png", Ok(Some(("a/b/in.png", false))));
        check("a", "./b/../b/in.png", Ok(Some(("a/b/in.png", false))));
        check("a/b", "../b/in.png", Ok(Some(("a/b/in.png", false))));
        check("a", "b\\in.png", Ok(Some(("a/b/in.png", false))));
        check("a/b", "..\\b\\in.png", Ok(Some(("a/b/in.png", false))));
        // The image is not at the path in the name.
        for name in [
            "C:\\Users\\me\\in.png",
            "c:in.png",
            "/home/me/in.png",
            "\\\\server\\share\\in.png",
            "tex\\in.png",
            "tex/in.png",
            "../../../../in.png",
            "IN.png",
        ] {
            check("a/b", name, Ok(Some(("a/b/in.png", true))));
        }
        check("a", "D:\\x\\b\\in.png", Ok(Some(("a/b/in.png", true))));
        check("a", "maps\\RED.png", Ok(Some(("a/Maps/Red.PNG", true))));
        check("a", "/old/MAPS/red.png", Ok(Some(("a/Maps/Red.PNG", true))));
        check("a/b", "none.png", Ok(None));
        check("a/b", "in.png/deeper", Ok(None));
        check("", "C:\\out.png", Ok(None));
        check("", "/etc/passwd", Ok(None));
        check("a/b", "../../../out.png", Err("leaves the asset's folder"));
        check("", "../out.png", Err("leaves the asset's folder"));
        check("", "..\\out.png", Err("leaves the asset's folder"));
        check("", "https://example.invalid/x.png", Err("address"));
        check("", "file:///etc/passwd", Err("address"));
        check("", "", Err("not a file name"));
        let long = format!("https://{}", "x".repeat(1 << 20));
        assert!(root.find(Path::new(""), &long).expect_err("an address").to_string().len() < 300);
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
