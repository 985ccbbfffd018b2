//! Annotation files whose records stay in the file. Memory holds only their positions.
//!
//! A file is read once from end to end, record by record, and then again image by image. Memory therefore holds eight
//! bytes per record, plus the data that a reader keeps, whatever the size of the file.

use crate::coco::{Category, CocoInfo};
use crate::json::{CountingReader, before, located};
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};
use std::cell::Cell;
use std::fmt;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::files::replacement;
use syntable_model::limits::RECORD_BYTES;
use syntable_model::mirror::DatasetFile;

/// The byte order mark that some editors put before UTF-8.
pub(crate) const MARK: [u8; 3] = [0xef, 0xbb, 0xbf];
/// Number of bytes of a file that an error inspects.
const SHOWN: u64 = 16;

/// Maximum number of unread sections whose names are kept.
const UNREAD: usize = 16;

/// A list of records of an annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RecordSection {
    /// `images`.
    Images,
    /// `annotations`.
    Annotations,
    /// `scenes`, in SynTable's own form.
    Scenes,
}

impl RecordSection {
    const ALL: [Self; 3] = [Self::Images, Self::Annotations, Self::Scenes];

    /// Its name in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Images => "images",
            Self::Annotations => "annotations",
            Self::Scenes => crate::syntable::SCENES,
        }
    }
}

/// A record of a file that is being opened.
#[derive(Debug)]
pub enum IndexedRecord<I, A, S> {
    /// Of `images`.
    Image(I),
    /// Of `annotations`.
    Annotation(A),
    /// Of `scenes`.
    Scene(S),
}

/// An annotation file whose records are not in memory.
#[derive(Debug)]
pub struct Indexed {
    path: PathBuf,
    /// Name and origin of the dataset.
    pub info: CocoInfo,
    /// Categories that annotations refer to.
    pub categories: Option<Vec<Category>>,
    /// Names of the first unread sections, such as `licenses`.
    pub unread: Vec<String>,
    /// For each section, the earliest start of its first record and the end of each record, bytes.
    ends: [Vec<u64>; 3],
}

impl Indexed {
    /// Opens a file with images, annotations and scenes of these types, and calls `each` with every record. An error
    /// names the line and the field.
    pub fn open<I, A, S>(path: impl AsRef<Path>, each: &mut dyn FnMut(IndexedRecord<I, A, S>)) -> Result<Self>
    where
        I: DeserializeOwned,
        A: DeserializeOwned,
        S: DeserializeOwned,
    {
        let path = path.as_ref();
        let fail = |error: io::Error| Error::io(path, &error);
        let mut file = BufReader::new(DatasetFile::open(path).map_err(fail)?);
        let (at, until) = (Cell::new(0), Cell::new(u64::MAX));
        let start = file.fill_buf().map_err(fail)?;
        if let Some(error) = replacement(start) {
            return Err(error.in_file(path));
        }
        if start.starts_with(&MARK) {
            file.consume(MARK.len());
            at.set(MARK.len() as u64);
        }
        let mut index = Self {
            path: path.to_owned(),
            info: CocoInfo::default(),
            categories: None,
            unread: Vec::new(),
            ends: Default::default(),
        };
        let mut json = serde_json::Deserializer::from_reader(CountingReader { from: file, at: &at, until: &until });
        let mut track = serde_path_to_error::Track::new();
        let whole = FileSeed { at: &at, until: &until, index: &mut index, each };
        let fail = |error: serde_json::Error, field: Option<String>| match error.io_error_kind() {
            Some(io::ErrorKind::FileTooLarge) => {
                let place = field.map_or(String::new(), |field| format!("`{field}`: "));
                let what = format!("{place}a record has more than the limit of {} bytes", RECORD_BYTES.most);
                Error::new(what).help(RECORD_BYTES.remedy).at_line(error.line()).in_file(path)
            }
            Some(kind) if kind != io::ErrorKind::UnexpectedEof => Error::io(path, &error.into()),
            _ => located(&error, field.as_deref(), &text_from(path, before(at.get()))).in_file(path),
        };
        let read = whole.deserialize(serde_path_to_error::Deserializer::new(&mut json, &mut track));
        if let Err(error) = read {
            let field = track.path().to_string();
            return Err(fail(error, (field != ".").then_some(field)));
        }
        json.end().map_err(|error| fail(error, None))?;
        Ok(index)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of records of a section.
    pub fn len(&self, section: RecordSection) -> usize {
        self.ends[section as usize].len().saturating_sub(1)
    }

    /// Whether a section has no record.
    pub fn is_empty(&self, section: RecordSection) -> bool {
        self.len(section) == 0
    }

    /// Reads records of a section by their numbers, from 0.
    pub fn records<T: DeserializeOwned>(&self, section: RecordSection, numbers: &[u32]) -> Result<Vec<T>> {
        let fail = |error: &io::Error| Error::io(&self.path, error);
        let mut file = DatasetFile::open(&self.path).map_err(|error| fail(&error))?;
        let ends = &self.ends[section as usize];
        let mut records = Vec::with_capacity(numbers.len());
        // Neighbors in the file are read together.
        for run in numbers.chunk_by(|one, next| one.checked_add(1) == Some(*next)) {
            let [first, last] = [run[0] as usize, run[run.len() - 1] as usize];
            let (Some(&start), Some(&end)) = (ends.get(first), ends.get(last + 1)) else {
                return Err(Error::new(format!("`{}[{last}]` does not exist", section.name())).in_file(&self.path));
            };
            let mut bytes = vec![0; (end - start) as usize];
            file.seek(SeekFrom::Start(start))
                .and_then(|_| file.read_exact(&mut bytes))
                .map_err(|error| fail(&error))?;
            for number in first..=last {
                let of = |end: u64| (end - start) as usize;
                records.push(self.record(section, number, &bytes[of(ends[number])..of(ends[number + 1])])?);
            }
        }
        Ok(records)
    }

    /// Parses a record, with a comma before it.
    fn record<T: DeserializeOwned>(&self, section: RecordSection, number: usize, bytes: &[u8]) -> Result<T> {
        let is_before = |byte: &u8| byte.is_ascii_whitespace() || *byte == b',';
        let start = bytes.iter().position(|byte| !is_before(byte)).unwrap_or(bytes.len());
        let mut json = serde_json::Deserializer::from_slice(&bytes[start..]);
        serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let path = error.path().to_string();
            let field = if path == "." { String::new() } else { format!(".{path}") };
            Error::new(format!("`{}[{number}]{field}`: {}", section.name(), error.inner()))
                .in_file(&self.path)
                .help("leave the file alone while it is read")
        })
    }
}

/// Some bytes of a file from an offset on, for an error; empty if they cannot be read.
fn text_from(path: &Path, place: u64) -> Vec<u8> {
    let mut text = Vec::new();
    let read = DatasetFile::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(place))?;
        file.take(SHOWN).read_to_end(&mut text)
    });
    read.map_or_else(|_| Vec::new(), |_| text)
}

/// Reads a file: an object with sections.
struct FileSeed<'w, I, A, S> {
    at: &'w Cell<u64>,
    /// Offset where the parser must stop.
    until: &'w Cell<u64>,
    index: &'w mut Indexed,
    each: &'w mut dyn FnMut(IndexedRecord<I, A, S>),
}

impl<'de, I, A, S> DeserializeSeed<'de> for FileSeed<'_, I, A, S>
where
    I: DeserializeOwned,
    A: DeserializeOwned,
    S: DeserializeOwned,
{
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de, I, A, S> Visitor<'de> for FileSeed<'_, I, A, S>
where
    I: DeserializeOwned,
    A: DeserializeOwned,
    S: DeserializeOwned,
{
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an annotation file: an object with `images` and `annotations`")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<(), M::Error> {
        let Self { at, until, index, each } = self;
        while let Some(key) = map.next_key::<String>()? {
            let Some(section) = RecordSection::ALL.into_iter().find(|section| section.name() == key) else {
                match key.as_str() {
                    "info" => index.info = map.next_value::<Option<CocoInfo>>()?.unwrap_or_default(),
                    "categories" => index.categories = map.next_value()?,
                    _ => {
                        map.next_value::<IgnoredAny>()?;
                        if index.unread.len() < UNREAD {
                            index.unread.push(key);
                        }
                    }
                }
                continue;
            };
            let ends = &mut index.ends[section as usize];
            if !ends.is_empty() {
                return Err(M::Error::duplicate_field(section.name()));
            }
            match section {
                RecordSection::Images => {
                    map.next_value_seed(ListSeed::of([at, until], ends, |it| each(IndexedRecord::Image(it))))?
                }
                RecordSection::Annotations => {
                    map.next_value_seed(ListSeed::of([at, until], ends, |it| each(IndexedRecord::Annotation(it))))?
                }
                RecordSection::Scenes => {
                    map.next_value_seed(ListSeed::of([at, until], ends, |it| each(IndexedRecord::Scene(it))))?
                }
            }
        }
        let needed = [RecordSection::Images, RecordSection::Annotations];
        match needed.into_iter().find(|section| index.ends[*section as usize].is_empty()) {
            Some(section) => Err(M::Error::missing_field(section.name())),
            None => Ok(()),
        }
    }
}

/// Reads a list of records, and the offset where each ends.
struct ListSeed<'l, T, F> {
    at: &'l Cell<u64>,
    until: &'l Cell<u64>,
    ends: &'l mut Vec<u64>,
    each: F,
    of: PhantomData<T>,
}

impl<'l, T, F: FnMut(T)> ListSeed<'l, T, F> {
    fn of([at, until]: [&'l Cell<u64>; 2], ends: &'l mut Vec<u64>, each: F) -> Self {
        Self { at, until, ends, each, of: PhantomData }
    }
}

impl<'de, T: DeserializeOwned, F: FnMut(T)> DeserializeSeed<'de> for ListSeed<'_, T, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: DeserializeOwned, F: FnMut(T)> Visitor<'de> for ListSeed<'_, T, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of records")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error> {
        let bound = || self.until.set(self.at.get().saturating_add(RECORD_BYTES.most));
        self.ends.push(self.at.get());
        bound();
        while let Some(record) = list.next_element()? {
            self.ends.push(self.at.get());
            (self.each)(record);
            bound();
        }
        self.until.set(u64::MAX);
        Ok(())
    }
}
