//! Checks of output files against the inputs of a verb.

use crate::Exit;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_runtime::paths::{lies_in, run_above, whole};

/// An output file of a verb.
#[derive(Clone, Copy)]
pub struct OutputFile<'a> {
    /// The flag that names it.
    pub option: &'a str,
    /// Its path; `None` if it is not wanted.
    pub path: Option<&'a PathBuf>,
    /// The first bytes of every file that the verb writes with this flag; empty if it may replace any file.
    pub start: &'a [u8],
}

impl OutputFile<'_> {
    /// Whether another program wrote the existing file. Devices and empty files are never foreign.
    fn is_foreign(&self, path: &Path) -> bool {
        if !path.is_file() {
            return false;
        }
        let mut start = Vec::new();
        let read = File::open(path).and_then(|file| file.take(self.start.len() as u64).read_to_end(&mut start));
        read.is_ok() && !start.is_empty() && start != self.start
    }
}

/// Refuses output files that would replace an input, another output, a file of a run or, without `overwrite`, a file that
/// the verb did not write. `inputs` are files, and folders that must not receive files.
pub fn check_outputs(outputs: &[OutputFile], inputs: &[&Path], overwrite: bool) -> Result<(), Exit> {
    let there: Vec<(&OutputFile, &str, &Path)> =
        outputs.iter().filter_map(|it| it.path.map(|path| (it, it.option, path.as_path()))).collect();
    for (number, &(_, option, path)) in there.iter().enumerate() {
        let own = whole(path);
        let refuse = |what: String| {
            let error = Error::new(format!("{option} would {what}")).in_file(path);
            Err(Exit::wrong(error.help(format!("name another file with {option}"))))
        };
        if let Some((_, other, _)) = there[..number].iter().find(|(_, _, other)| whole(other) == own) {
            return refuse(format!("overwrite the file of {other}"));
        }
        if let Some(run) = own.parent().and_then(run_above) {
            return refuse(format!("write into the folder of a run, {}", run.display()));
        }
        for input in inputs {
            if lies_in(path, input) {
                let is_file = input.is_file();
                return refuse(if is_file {
                    "overwrite an input of the command".to_owned()
                } else {
                    format!("write into {}, an input of the command", input.display())
                });
            }
        }
    }
    for &(output, option, path) in &there {
        if !overwrite && output.is_foreign(path) {
            let error = Error::new(format!("{option} would replace a file that this verb did not write")).in_file(path);
            return Err(Exit::wrong(error.help(format!("name another file with {option}, or add --overwrite"))));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::registry::Registry;
    use syntable_recipe::message::Message;
    use syntable_runtime::paths::dataset_folder;
    use syntable_runtime::run::dataset::layout::journal_path;

    #[test]
    fn what_a_command_reads_is_not_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("data")).expect("made");
        std::fs::write(at("data/labels.json"), "{}").expect("written");
        std::fs::write(at("pred.json"), "[]").expect("written");
        std::fs::create_dir_all(at("run/.syntable")).expect("made");
        std::fs::write(journal_path(&at("run")), "").expect("written");
        let (data, predictions) = (at("data"), at("pred.json"));
        let inputs = [data.as_path(), predictions.as_path()];
        let check = |outputs: &[(&str, Option<&PathBuf>)], overwrite: bool| {
            let output = |&(option, path)| OutputFile { option, path, start: b"image," };
            match check_outputs(&outputs.iter().map(output).collect::<Vec<_>>(), &inputs, overwrite) {
                Ok(()) => String::new(),
                Err(exit) => {
                    assert_eq!(exit.code, 2);
                    let text = |message: &Message| match message {
                        Message::Error(error) => error.to_string(),
                        _ => String::new(),
                    };
                    exit.messages.iter().map(text).collect()
                }
            }
        };
        let said = |outputs: &[(&str, Option<&PathBuf>)]| check(outputs, false);
        let (fine, other) = (at("scores.json"), at("data/../scores.json"));
        assert_eq!(said(&[("--save", Some(&fine)), ("--csv", None)]), "");
        for (path, says) in [
            (at("data/labels.json"), "--save would write into"),
            (at("data/new.json"), "--save would write into"),
            (at("data/../pred.json"), "--save would overwrite an input of the command"),
            (at("run/annotation_final.json"), "--save would write into the folder of a run"),
            (at("run/images/sheet.png"), "--save would write into the folder of a run"),
        ] {
            let message = said(&[("--save", Some(&path))]);
            assert!(message.contains(says) && message.contains("another file"), "{message}");
        }
        // Without a format that detects a dataset, each path stays as it is.
        for named in ["data", "data/labels.json"] {
            assert_eq!(whole(&dataset_folder(&Registry::default(), &at(named))), whole(&at(named)), "{named}");
        }
        let message = said(&[("--csv", Some(&fine)), ("--save", Some(&other))]);
        assert!(message.contains("overwrite the file of --csv"), "{message}");
        // A file of the same kind or an empty file is replaced, other files only on request.
        for (content, refused) in [("image,f\n", false), ("", false), ("notes", true), ("imag", true)] {
            std::fs::write(&fine, content).expect("written");
            let message = said(&[("--csv", Some(&fine))]);
            assert_eq!(message.contains("did not write") && message.contains("--overwrite"), refused, "{content}");
            assert_eq!(check(&[("--csv", Some(&fine))], true), "");
        }
    }
}
