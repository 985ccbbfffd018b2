//! Finds out which structure an annotation file has, by the keys of its first records. Names of files say little: Roboflow
//! calls all of them `_annotations.coco.json`, and amodal files are often called `instances_*.json`.

use crate::index::MARK;
use crate::json::CountingReader;
use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::error::Category;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use syntable_model::mirror::DatasetFile;

/// Number of annotations whose keys are collected: objects that nothing hides often lack the keys of hidden parts.
const ANNOTATIONS: usize = 256;
/// Bytes of a file that are searched for annotations.
const SEARCHED: u64 = 1 << 28;
/// Bytes of a file that are searched for the first section of an annotation file: other JSON files are not read to their ends.
const START: u64 = 1 << 20;
/// Sections of annotation files.
const SECTIONS: [&str; 5] = ["info", "licenses", "categories", "images", "annotations"];
/// Most keys that are kept.
const KEYS: usize = 256;

/// Keys of the first annotations of a file of COCO's family.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecordKeys(BTreeSet<String>);

/// The start of a JSON file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AnnotationStart {
    /// The file has lists of images and annotations.
    Records(RecordKeys),
    /// The file has a list of images and no list of annotations.
    Images,
    /// The file is not an annotation file.
    Other,
    /// The file cannot be read, or is not JSON.
    Unreadable,
}

/// A file as it was when it was read: its length and its time of change.
type Stamp = (u64, SystemTime);

/// The starts of files that were read. Each format asks for the start of each file, and `images` come before `annotations`: in a
/// large file, it takes as long as a good part of the whole.
static KNOWN: Mutex<BTreeMap<PathBuf, (Stamp, AnnotationStart)>> = Mutex::new(BTreeMap::new());
/// Most starts that are kept.
const MOST_KNOWN: usize = 256;
/// Age of a file whose start is kept: a younger one may change again within the same tick of the file system's clock.
const SETTLED: Duration = Duration::from_secs(2);

/// The stamp of a file that has not changed for some time.
fn settled_stamp(file: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(file).ok()?;
    let changed = metadata.modified().ok()?;
    (changed.elapsed().ok()? >= SETTLED).then_some((metadata.len(), changed))
}

impl AnnotationStart {
    /// Reads the start of a file, once as long as the file does not change.
    pub fn of(file: &Path) -> Self {
        let Some(stamp) = settled_stamp(file) else { return Self::read(file) };
        let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, start)) = known().get(&path)
            && *of == stamp
        {
            return start.clone();
        }
        let start = Self::read(file);
        let mut known = known();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(path, (stamp, start.clone()));
        start
    }

    fn read(file: &Path) -> Self {
        let Ok(file) = DatasetFile::open(file) else { return Self::Unreadable };
        let mut text = BufReader::new(file);
        if text.fill_buf().is_ok_and(|start| start.starts_with(&MARK)) {
            text.consume(MARK.len());
        }
        let (mut found, at, until) = (Found::default(), Cell::new(0), Cell::new(START));
        let mut json = serde_json::Deserializer::from_reader(CountingReader { from: text, at: &at, until: &until });
        let end = FileSeed(&mut found, &until).deserialize(&mut json);
        // No section of an annotation file within the first bytes.
        let is_other = until.get() == START && at.get() >= START;
        let is_whole = end.as_ref().map_or_else(|error| error.classify() == Category::Data, |()| true);
        match found {
            // The first annotations are enough; what follows may be damaged.
            Found { has_annotations: true, has_images, keys, .. } if has_images || !keys.is_empty() => {
                Self::Records(RecordKeys(keys))
            }
            Found { has_images: true, .. } if is_whole => Self::Images,
            _ if is_whole || is_other => Self::Other,
            _ => Self::Unreadable,
        }
    }
}

impl RecordKeys {
    /// Whether the file has no annotations.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether an annotation has one of these keys.
    pub fn have_any(&self, keys: &[&str]) -> bool {
        keys.iter().any(|key| self.0.contains(*key))
    }
}

#[derive(Default)]
struct Found {
    has_images: bool,
    has_annotations: bool,
    keys: BTreeSet<String>,
}

/// The content so far, and the number of bytes that may be read.
struct FileSeed<'f>(&'f mut Found, &'f Cell<u64>);

impl<'de> DeserializeSeed<'de> for FileSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for FileSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an annotation file")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<(), M::Error> {
        while let Some(key) = map.next_key::<String>()? {
            if SECTIONS.contains(&key.as_str()) {
                self.1.set(SEARCHED);
            }
            match key.as_str() {
                "annotations" => map.next_value_seed(AnnotationsSeed(self.0))?,
                "images" => {
                    self.0.has_images = true;
                    map.next_value::<IgnoredAny>()?;
                }
                _ => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
}

struct AnnotationsSeed<'f>(&'f mut Found);

impl<'de> DeserializeSeed<'de> for AnnotationsSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for AnnotationsSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of annotations")
    }

    fn visit_seq<S: SeqAccess<'de>>(self, mut list: S) -> Result<(), S::Error> {
        self.0.has_annotations = true;
        for _ in 0..ANNOTATIONS {
            if list.next_element_seed(KeysSeed(&mut self.0.keys))?.is_none() {
                return Ok(());
            }
        }
        Err(S::Error::custom("no further annotation is needed"))
    }
}

struct KeysSeed<'k>(&'k mut BTreeSet<String>);

impl<'de> DeserializeSeed<'de> for KeysSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for KeysSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an annotation")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<(), M::Error> {
        while let Some(key) = map.next_key::<String>()? {
            // A field without a value says nothing.
            if map.next_value::<Option<IgnoredAny>>()?.is_some() && self.0.len() < KEYS {
                self.0.insert(key);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    #[test]
    fn a_file_is_read_once_until_it_changes() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        let start = |key: &str, age_s: u64| {
            let text = format!("{{\"images\": [], \"annotations\": [{{\"{key}\": 1}}]}}");
            std::fs::write(&path, text).expect("written");
            let file = File::options().write(true).open(&path).expect("there");
            file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000 - age_s)).expect("set");
            match AnnotationStart::of(&path) {
                AnnotationStart::Records(keys) => keys.0.into_iter().collect::<Vec<String>>(),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(start("bbox", 9), ["bbox"]);
        assert_eq!(start("area", 8), ["area"]);
        // Of the same length and time, so that nothing tells it from the file before.
        assert_eq!(start("mask", 8), ["area"]);
        assert_eq!(start("masks", 8), ["masks"]);
    }
}
