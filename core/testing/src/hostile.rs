//! Datasets with links to foreign files, or with pipes instead of files.

use crate::takes::registry;
use std::fs;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::reader::Source;

/// Reads all images of a dataset. Returns the number of readable images, and the errors of the others. If the dataset
/// cannot be opened, its error is the only one.
pub fn read_all(source: &Source, kind: &str) -> (usize, Vec<Error>) {
    let read = match registry().open_dataset(source, Some(kind)) {
        Ok((_, read)) => read,
        Err(error) => return (0, vec![error]),
    };
    let images = 0..read.images.len();
    let errors: Vec<Error> = images.filter_map(|image| read.read(image, &read.offers).err()).collect();
    (read.images.len() - errors.len(), errors)
}

/// Asserts that the reader of a format opens no files behind links that lead out of the dataset in `root`, unless the
/// dataset is trusted: first with links to images, then with links to all files. Changes the dataset.
pub fn links_lead_nowhere_else(root: &Path, kind: &str) {
    let outside = tempfile_beside(root);
    let source = || Source::new(root);
    let (all, errors) = read_all(&source(), kind);
    assert!(all > 2 && errors.is_empty(), "{kind}: {errors:?}");
    let is_image = |path: &Path| path.extension().is_some_and(|it| it == "png" || it == "jpg");
    for (what, is_one) in [("images", &is_image as &dyn Fn(&Path) -> bool), ("files", &|_: &Path| true)] {
        let before = fs::read_dir(&outside).expect("readable").count();
        link_out(root, root, &outside, is_one);
        if fs::read_dir(&outside).expect("readable").count() == before {
            continue;
        }
        let (read, errors) = read_all(&source(), kind);
        assert!(read == 0 && !errors.is_empty(), "{kind}: {read} read by links of {what}");
        for error in errors {
            let text = error.to_string();
            assert!(text.contains("through a link") && text.contains("options.trust_paths"), "{kind}: {what}: {text}");
        }
        let (read, errors) = read_all(&source().trusting(true), kind);
        assert!(read == all && errors.is_empty(), "{kind}: {what}: trusted, {read} of {all}: {errors:?}");
    }
    // A link within the dataset counts as the file.
    let store = root.join(".store");
    fs::rename(&outside, &store).expect("movable");
    relink(root, &outside, &store);
    let (read, errors) = read_all(&source(), kind);
    assert!(read == all && errors.is_empty(), "{kind}: links within: {errors:?}");
}

/// Maximum time to read a small dataset. A slower reader waits for a pipe.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(60);

/// Asserts that a reader never waits for a pipe, whichever file of a dataset it replaces.
pub fn pipes_are_not_waited_for(root: &Path, kind: &str) {
    let mut files = Vec::new();
    each_file(root, &mut |path| files.push(path.to_owned()));
    files.sort();
    let mut seen = std::collections::BTreeSet::new();
    for path in files {
        // Tries one file for each name of a folder and each extension.
        let folder = path.parent().and_then(Path::file_name).map(ToOwned::to_owned);
        if !seen.insert((folder, path.extension().map(ToOwned::to_owned))) {
            continue;
        }
        let aside = root.with_extension("aside");
        fs::rename(&path, &aside).expect("movable");
        let made = std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo");
        assert!(made.success());
        let (done, waits) = std::sync::mpsc::channel();
        let (source, own) = (Source::new(root), kind.to_owned());
        std::thread::spawn(move || drop((read_all(&source, &own), done.send(()))));
        assert!(waits.recv_timeout(PATIENCE).is_ok(), "{kind}: it waits for the pipe {}", path.display());
        fs::remove_file(&path).expect("removable");
        fs::rename(&aside, &path).expect("movable");
    }
}

/// Creates an empty folder next to another folder.
fn tempfile_beside(root: &Path) -> PathBuf {
    let outside = root.with_extension("outside");
    fs::create_dir(&outside).expect("new");
    outside
}

fn each_file(folder: &Path, each: &mut dyn FnMut(&Path)) {
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        let kind = fs::symlink_metadata(&path).expect("there").file_type();
        if kind.is_dir() {
            each_file(&path, each);
        } else {
            each(&path);
        }
    }
}

/// Moves files outside, and replaces them by links.
fn link_out(root: &Path, folder: &Path, outside: &Path, is_one: &dyn Fn(&Path) -> bool) {
    let mut files = Vec::new();
    each_file(folder, &mut |path| files.push(path.to_owned()));
    let own = files
        .into_iter()
        .filter(|path| is_one(path) && !path.is_symlink() && !path.starts_with(root.join(".syntable")));
    for path in own {
        let inside = path.strip_prefix(root).expect("below").to_string_lossy().replace('/', "_");
        let to = outside.join(inside);
        fs::rename(&path, &to).expect("movable");
        std::os::unix::fs::symlink(&to, &path).expect("linked");
    }
}

/// Redirects links from files of one folder to the same files in another folder.
fn relink(root: &Path, before: &Path, now: &Path) {
    each_file(root, &mut |path| {
        if let Some(name) = fs::read_link(path).ok().and_then(|to| Some(to.strip_prefix(before).ok()?.to_owned())) {
            fs::remove_file(path).expect("removable");
            std::os::unix::fs::symlink(now.join(name), path).expect("linked");
        }
    });
}
