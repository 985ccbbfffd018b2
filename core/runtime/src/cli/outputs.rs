//! Files that verbs write beside what they read.

use super::Exit;
use crate::paths::whole;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result as ModelResult};

/// Refuses files that would take the place of what a command reads, or of each other. `outputs` are files with the options
/// that name them; `inputs` are files, and folders in which nothing is to be written.
pub fn check_outputs(outputs: &[(&str, Option<&PathBuf>)], inputs: &[&Path]) -> Result<(), Exit> {
    let there: Vec<(&str, &Path)> =
        outputs.iter().filter_map(|(option, path)| path.map(|path| (*option, path.as_path()))).collect();
    for (number, &(option, path)) in there.iter().enumerate() {
        let own = whole(path);
        let refuse = |what: String| {
            let error = Error::new(format!("{option} would {what}")).in_file(path);
            Err(Exit::wrong(error.help(format!("name another file with {option}")).permanent()))
        };
        if let Some((other, _)) = there[..number].iter().find(|(_, other)| whole(other) == own) {
            return refuse(format!("overwrite what {other} writes"));
        }
        for input in inputs {
            if lies_in(path, input) {
                let is_file = input.is_file();
                return refuse(if is_file {
                    "overwrite what the command reads".to_owned()
                } else {
                    format!("write into {}, which the command reads", input.display())
                });
            }
        }
    }
    Ok(())
}

/// The folder of a dataset, which may be named by its annotation file: the nearest one that looks like a dataset by itself, of the
/// two in which the file may be. A file that lies among others stands for itself.
pub fn dataset_folder(path: &Path) -> PathBuf {
    if !path.is_file() {
        return path.to_owned();
    }
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let formats = syntable_model::reader::linked();
    let is_dataset = |folder: &&Path| formats.iter().any(|format| (format.detect)(folder));
    let found = absolute.ancestors().skip(1).take(2).find(is_dataset);
    found.map_or_else(|| path.to_owned(), Path::to_owned)
}

/// Writes a file that is whole at any moment: beside its place, which it takes then.
///
/// # Errors
/// If it cannot be written. Unless the disk is full, the path is at fault.
pub fn write_whole(path: &Path, bytes: &[u8]) -> ModelResult<()> {
    let failed = |error: std::io::Error| {
        let failed = Error::io(path, &error);
        if error.kind() == ErrorKind::StorageFull { failed } else { failed.help("name another file").of_request() }
    };
    let there = std::fs::metadata(path).ok();
    // A device or a pipe takes what is written, and so does what a link leads to that has no file yet: nothing takes their place.
    let is_stream = ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder))
        || there.as_ref().is_some_and(|there| !there.is_file() && !there.is_dir())
        || there.is_none() && path.is_symlink();
    if is_stream {
        return std::fs::write(path, bytes).map_err(failed);
    }
    if there.as_ref().is_some_and(|there| there.permissions().readonly()) {
        return Err(Error::new("it is read-only").in_file(path).help("name another file").of_request());
    }
    // What a link leads to is replaced, and not the link.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut part = path.file_name().unwrap_or_default().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(part);
    let permit = || there.as_ref().map_or(Ok(()), |there| std::fs::set_permissions(&part, there.permissions()));
    let written = std::fs::write(&part, bytes).and_then(|()| permit()).and_then(|()| std::fs::rename(&part, &path));
    written.map_err(|error| {
        let _ = std::fs::remove_file(&part);
        failed(error)
    })
}

/// Whether a path is a folder or file, or lies in it, links and detours aside; either may not be there yet.
pub fn lies_in(path: &Path, folder: &Path) -> bool {
    whole(path).starts_with(whole(folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Message;

    #[test]
    fn a_file_takes_the_place_of_another_one_and_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("a.json");
        write_whole(&out, b"one").and_then(|()| write_whole(&out, b"two")).expect("writable");
        assert_eq!(std::fs::read(&out).expect("readable"), b"two");
        assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 1);
        // A folder that is not there, and one in the file's place: the request is at fault.
        std::fs::create_dir(folder.path().join("b")).expect("made");
        for path in ["none/a.json", "b"] {
            let error = write_whole(&folder.path().join(path), b"x").expect_err("it is no file");
            assert!(error.is_permanent() && error.to_string().contains(path), "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let mode = |name: &str| std::fs::metadata(at(name)).expect("there").permissions().mode() & 0o777;
        for target in ["there", "to come"] {
            symlink(at(target), at(&format!("link to {target}"))).expect("linked");
        }
        write_whole(&at("there"), b"one").expect("writable");
        std::fs::set_permissions(at("there"), PermissionsExt::from_mode(0o600)).expect("permitted");
        for target in ["there", "to come"] {
            write_whole(&at(&format!("link to {target}")), b"two").expect("writable");
            assert!(at(&format!("link to {target}")).is_symlink(), "{target}");
            assert_eq!(std::fs::read(at(target)).expect("readable"), b"two");
        }
        assert_eq!(mode("there"), 0o600);
        std::fs::set_permissions(at("there"), PermissionsExt::from_mode(0o400)).expect("permitted");
        let error = write_whole(&at("there"), b"three").expect_err("read-only").to_string();
        assert!(
            error.contains("it is read-only") && std::fs::read(at("there")).expect("readable") == b"two",
            "{error}"
        );
    }

    #[test]
    fn what_a_command_reads_is_not_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("data")).expect("made");
        std::fs::write(at("data/labels.json"), "{}").expect("written");
        std::fs::write(at("pred.json"), "[]").expect("written");
        let (data, predictions) = (at("data"), at("pred.json"));
        let inputs = [data.as_path(), predictions.as_path()];
        let said = |outputs: &[(&str, Option<&PathBuf>)]| match check_outputs(outputs, &inputs) {
            Ok(()) => String::new(),
            Err(exit) => {
                assert_eq!(exit.code, 2);
                let text = |message: &Message| match message {
                    Message::Error(error) => error.to_string(),
                    _ => String::new(),
                };
                exit.messages.iter().map(text).collect()
            }
        };
        let (fine, other) = (at("scores.json"), at("data/../scores.json"));
        assert_eq!(said(&[("--save", Some(&fine)), ("--csv", None)]), "");
        for (path, says) in [
            (at("data/labels.json"), "--save would write into"),
            (at("data/new.json"), "--save would write into"),
            (at("data/../pred.json"), "--save would overwrite what the command reads"),
        ] {
            let message = said(&[("--save", Some(&path))]);
            assert!(message.contains(says) && message.contains("another file"), "{message}");
        }
        // A folder is that of a dataset; a file that is in none stands for itself.
        for named in ["data", "data/labels.json"] {
            assert_eq!(whole(&dataset_folder(&at(named))), whole(&at(named)), "{named}");
        }
        let message = said(&[("--csv", Some(&fine)), ("--save", Some(&other))]);
        assert!(message.contains("overwrite what --csv writes"), "{message}");
    }
}
