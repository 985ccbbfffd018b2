//! The journal of a dataset: one line for every scene that is done. Only what is in the journal exists.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};

/// What is known of a scene that is done.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct SceneRecord {
    /// Number of the scene.
    pub scene: u32,
    /// The attempt that counts, from 0.
    pub attempt: u32,
    /// How many views were written; 0 if the scene failed.
    pub views: u32,
    /// How many objects lie on the table.
    pub objects: u32,
    /// What went wrong, one entry an attempt that failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<String>,
    /// Digests of all assets in the scene, by `pool/name`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub assets: BTreeMap<String, String>,
}

impl SceneRecord {
    /// Whether all attempts failed.
    pub fn failed(&self) -> bool {
        self.views == 0
    }
}

/// The journal file, appended to while a run works.
pub struct Journal {
    path: PathBuf,
    file: File,
    records: BTreeMap<u32, SceneRecord>,
}

impl Journal {
    /// Opens a journal, or starts one. A last line that was cut short counts as not written.
    pub fn open(path: &Path) -> Result<Self> {
        let fail = |error: std::io::Error| Error::io(path, &error);
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(fail(error)),
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut records = BTreeMap::new();
        for (number, line) in text[..whole].lines().enumerate() {
            let record: SceneRecord = serde_json::from_str(line).map_err(|error| {
                Error::new(format!("not a journal line: {error}"))
                    .in_file(path)
                    .at_line(number + 1)
                    .help("the dataset is damaged; start it anew with --overwrite")
            })?;
            records.insert(record.scene, record);
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
        if whole < text.len() {
            file.set_len(whole as u64).map_err(fail)?;
        }
        Ok(Self { path: path.to_owned(), file, records })
    }

    /// The scenes that are done, ascending.
    pub fn records(&self) -> &BTreeMap<u32, SceneRecord> {
        &self.records
    }

    /// Writes a record down for good.
    pub fn append(&mut self, record: SceneRecord) -> Result<()> {
        let fail = |error: std::io::Error| Error::io(&self.path, &error);
        let mut line = serde_json::to_string(&record).expect("a record is plain data");
        line.push('\n');
        let length = self.file.metadata().map_err(fail)?.len();
        if let Err(error) = self.file.write_all(line.as_bytes()).and_then(|()| self.file.sync_data()) {
            // Half a line must not stay in front of the next one.
            let _ = self.file.set_len(length);
            return Err(fail(error));
        }
        self.records.insert(record.scene, record);
        Ok(())
    }

    /// Forgets the scenes that failed, so that they are tried again.
    pub fn forget_failed(&mut self) -> Result<()> {
        self.records.retain(|_, record| !record.failed());
        self.rewrite()
    }

    /// Rewrites the file in scene order, whole or not at all, so that it does not tell in which order scenes ended.
    pub fn rewrite(&mut self) -> Result<()> {
        let fail = |error: std::io::Error| Error::io(&self.path, &error);
        let part = self.path.with_extension("jsonl.part");
        let mut file = File::create(&part).map_err(fail)?;
        for record in self.records.values() {
            let line = serde_json::to_string(record).expect("a record is plain data");
            writeln!(file, "{line}").map_err(fail)?;
        }
        file.sync_all().map_err(fail)?;
        fs::rename(&part, &self.path).map_err(fail)?;
        self.file = OpenOptions::new().append(true).open(&self.path).map_err(fail)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(scene: u32) -> SceneRecord {
        SceneRecord { scene, attempt: 0, views: 2, objects: 3, errors: Vec::new(), assets: BTreeMap::new() }
    }

    #[test]
    fn a_cut_line_counts_as_not_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        let mut journal = Journal::open(&path).expect("new");
        journal.append(record(4)).expect("written");
        journal.append(record(1)).expect("written");
        drop(journal);
        let whole = fs::read(&path).expect("there");
        for cut in 0..whole.len() {
            fs::write(&path, &whole[..cut]).expect("writable");
            let mut journal = Journal::open(&path).expect("readable");
            let lines = whole[..cut].iter().filter(|&&byte| byte == b'\n').count();
            assert_eq!(journal.records().len(), lines, "cut at {cut}");
            journal.append(record(7)).expect("written");
            assert_eq!(Journal::open(&path).expect("readable").records().len(), lines + 1);
        }
    }

    #[test]
    fn the_rewritten_file_does_not_tell_the_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, order: [u32; 3]| {
            let mut journal = Journal::open(&folder.path().join(name)).expect("new");
            order.into_iter().for_each(|scene| journal.append(record(scene)).expect("written"));
            journal.rewrite().expect("written");
            journal.append(record(9)).expect("goes on");
            fs::read(folder.path().join(name)).expect("there")
        };
        assert_eq!(write("a", [0, 1, 2]), write("b", [2, 0, 1]));
    }

    #[test]
    fn damage_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        fs::write(&path, "{\"scene\":0}\n").expect("writable");
        let error = Journal::open(&path).err().expect("damaged").to_string();
        assert!(error.contains("journal.jsonl:1: not a journal line"), "{error}");
    }
}
