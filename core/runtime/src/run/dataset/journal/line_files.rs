//! Lines in files of their own: one line that a worker has just written, or all lines of a thousand scenes.
//!
//! Workers cannot append to one file together. When a worker finds the lines of scenes 3000 to 3999, it writes them into
//! one file, which must be new, and removes the others. A line beside the file of its thousand came later, and
//! counts.

use crate::run::dataset::foreign::read_bounded;
use crate::run::dataset::layout;
use crate::run::dataset::requests;
use std::collections::BTreeMap;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::limits::RUN_LIST_BYTES;
use syntable_model::store::{Kind, StoreFolder};

/// Scenes of a joined file.
pub(super) const JOINED: u32 = 1000;

/// The files with lines of a dataset.
#[derive(Debug, Default)]
pub struct LineFiles {
    /// Scenes with a file of their own, by thousand.
    lines: BTreeMap<u32, Vec<u32>>,
    /// Thousands with a file.
    joined: Vec<u32>,
}

impl LineFiles {
    /// Lists the files. Folders, and files with names that the program does not write, are left out.
    pub fn of(dataset: &StoreFolder) -> Result<Self> {
        let (mut files, folder) = (Self::default(), layout::lines());
        let number = |name: &str, end: &str, path: fn(u32) -> DatasetPath| {
            let number: u32 = name.strip_suffix(end)?.parse().ok()?;
            (path(number).as_str() == format!("{folder}/{name}")).then_some(number)
        };
        for (name, kind) in dataset.list(&folder)? {
            if kind == Kind::Folder {
                continue;
            }
            if let Some(scene) = number(&name, ".json", layout::line) {
                files.lines.entry(scene / JOINED).or_default().push(scene);
            } else if let Some(thousand) = number(&name, ".jsonl", layout::lines_of_thousand) {
                files.joined.push(thousand);
            }
        }
        files.lines.values_mut().for_each(|scenes| scenes.sort_unstable());
        files.joined.sort_unstable();
        Ok(files)
    }

    /// Whether no line has a file of its own.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty() && self.joined.is_empty()
    }

    /// Whether a scene has a line in a file.
    pub fn has(&self, scene: u32) -> bool {
        let thousand = scene / JOINED;
        let is_line = || self.lines.get(&thousand).is_some_and(|scenes| scenes.binary_search(&scene).is_ok());
        self.joined.binary_search(&thousand).is_ok() || is_line()
    }

    /// The files: first the joined ones, which are older.
    pub(super) fn paths(&self) -> impl Iterator<Item = DatasetPath> {
        let lines = self.lines.values().flatten().copied().map(layout::line);
        self.joined.iter().copied().map(layout::lines_of_thousand).chain(lines)
    }

    /// Joins the lines of each thousand that has all of them. A line that another worker has replaced meanwhile stays.
    pub(super) fn join(&self, dataset: &StoreFolder) -> Result<()> {
        let is_whole = |(thousand, scenes): &(&u32, &Vec<u32>)| {
            scenes.len() == JOINED as usize && self.joined.binary_search(thousand).is_err()
        };
        for (&thousand, scenes) in self.lines.iter().filter(is_whole) {
            let paths: Vec<DatasetPath> = scenes.iter().copied().map(layout::line).collect();
            let read: Option<Vec<Vec<u8>>> = requests::read(dataset, &paths, &RUN_LIST_BYTES)?.into_iter().collect();
            // Another worker joins them at this moment.
            let Some(lines) = read else { continue };
            if dataset.write_new(&layout::lines_of_thousand(thousand), &lines.concat())? {
                requests::each(dataset, paths.len(), &|number| {
                    let present = read_bounded(dataset, &paths[number], &RUN_LIST_BYTES)?;
                    if present.as_ref() == Some(&lines[number]) { dataset.remove(&paths[number]) } else { Ok(()) }
                })?;
            }
        }
        Ok(())
    }
}
