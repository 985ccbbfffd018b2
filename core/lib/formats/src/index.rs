//! Annotation files whose records stay in the file. Memory holds only their positions.
//!
//! A file is read once from end to end, record by record, and then again image by image. Memory therefore holds eight
//! bytes per record, plus the data that a reader keeps, whatever the size of the file.
//!
//! The parser reads sections byte by byte from a [`Window`] of the file, except for records: these are parsed as slices of
//! the window, which takes a third of the time. Only the parser of a wrong record tracks fields, for the error.

use crate::coco::{Category, CocoInfo};
use crate::json::{before, located, place_in};
use crate::window::{Window, WindowReader};
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, Visitor};
use std::cell::RefCell;
use std::fmt;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::marker::PhantomData;
use std::ops::Range;
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
        let mut window = Window::new(DatasetFile::open(path).map_err(fail)?);
        window.fill(1).map_err(fail)?;
        if let Some(error) = replacement(window.rest()) {
            return Err(error.in_file(path));
        }
        if window.rest().starts_with(&MARK) {
            window.consume(MARK.len());
        }
        let (window, failure, unseen) = (RefCell::new(window), RefCell::new(None), RefCell::default());
        let mut index = Self {
            path: path.to_owned(),
            info: CocoInfo::default(),
            categories: None,
            unread: Vec::new(),
            ends: Default::default(),
        };
        let mut json = serde_json::Deserializer::from_reader(WindowReader(&window));
        let mut track = serde_path_to_error::Track::new();
        let whole = FileSeed { window: &window, failure: &failure, unseen: &unseen, index: &mut index, each };
        let fail = |error: serde_json::Error, field: Option<String>| match (failure.take(), error.io_error_kind()) {
            (Some(failure), _) => failure.in_file(path),
            (None, Some(kind)) if kind != io::ErrorKind::UnexpectedEof => Error::io(path, &error.into()),
            _ => {
                let text = text_from(path, before(window.borrow().at()));
                let lines: usize = unseen.borrow().iter().map(|bytes| line_breaks(path, bytes)).sum();
                located(&error, field.as_deref(), &text).at_line(error.line() + lines).in_file(path)
            }
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
        let json = || serde_json::Deserializer::from_slice(&bytes[start..]);
        // Only an error needs the field, and tracking fields takes time.
        T::deserialize(&mut json()).or_else(|_| serde_path_to_error::deserialize(&mut json())).map_err(|error| {
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

/// Number of line breaks in a part of a file, for an error; 0 if it cannot be read.
fn line_breaks(path: &Path, bytes: &Range<u64>) -> usize {
    let opened = DatasetFile::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(bytes.start))?;
        Ok(BufReader::new(file.take(bytes.end - bytes.start)).bytes())
    });
    opened.map_or(0, |bytes| bytes.map_while(io::Result::ok).filter(|byte| *byte == b'\n').count())
}

/// Reads a file: an object with sections.
struct FileSeed<'w, I, A, S> {
    window: &'w RefCell<Window>,
    /// The error of a record, which the parser does not know.
    failure: &'w RefCell<Option<Error>>,
    /// The bytes that the parser of the file has not seen, since records were read from them.
    unseen: &'w RefCell<Vec<Range<u64>>>,
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
        let Self { window, failure, unseen, index, each } = self;
        let path = index.path.clone();
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
            let of = SectionSource { path: &path, section, window, failure, unseen };
            match section {
                RecordSection::Images => {
                    map.next_value_seed(ListSeed::of(of, ends, |it| each(IndexedRecord::Image(it))))?
                }
                RecordSection::Annotations => {
                    map.next_value_seed(ListSeed::of(of, ends, |it| each(IndexedRecord::Annotation(it))))?
                }
                RecordSection::Scenes => {
                    map.next_value_seed(ListSeed::of(of, ends, |it| each(IndexedRecord::Scene(it))))?
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

/// Where the records of a section are read, and where their error goes.
#[derive(Clone, Copy)]
struct SectionSource<'l> {
    path: &'l Path,
    section: RecordSection,
    window: &'l RefCell<Window>,
    failure: &'l RefCell<Option<Error>>,
    unseen: &'l RefCell<Vec<Range<u64>>>,
}

/// Reads a list of records, and the offset where each ends.
struct ListSeed<'l, T, F> {
    from: SectionSource<'l>,
    ends: &'l mut Vec<u64>,
    each: F,
    of: PhantomData<T>,
}

impl<'l, T: DeserializeOwned, F: FnMut(T)> ListSeed<'l, T, F> {
    fn of(from: SectionSource<'l>, ends: &'l mut Vec<u64>, each: F) -> Self {
        Self { from, ends, each, of: PhantomData }
    }

    /// Reads the list after its bracket.
    fn read(&mut self, window: &mut Window) -> Result<()> {
        self.ends.push(window.at());
        loop {
            let most = RECORD_BYTES.most as usize;
            let is_first = self.ends.len() == 1;
            let start = window.at();
            let mut next = window.next_byte().map_err(|error| self.unreadable(&error))?;
            if !is_first && next == Some(b',') {
                window.consume(1);
                next = window.next_byte().map_err(|error| self.unreadable(&error))?;
                if next == Some(b']') {
                    return Err(self.misplaced(window, "trailing comma"));
                }
            } else if !is_first && next.is_some_and(|byte| byte != b']') {
                return Err(self.misplaced(window, "expected `,` or `]`"));
            }
            match next {
                None => return Err(self.misplaced(window, "EOF while parsing a list")),
                Some(b']') => {
                    window.consume(1);
                    return Ok(());
                }
                Some(_) => {}
            }
            let space = (window.at() - start) as usize;
            let record = self.record(window, most.saturating_sub(space).max(1))?;
            self.ends.push(window.at());
            (self.each)(record);
        }
    }

    /// Reads a record of at most `most` bytes.
    fn record(&self, window: &mut Window, most: usize) -> Result<T> {
        loop {
            let text = window.up_to(most);
            let mut records = serde_json::Deserializer::from_slice(text).into_iter();
            let (read, length) = (records.next(), records.byte_offset());
            let has_all = window.is_at_end() || text.len() == most;
            match read {
                // A number at the end of the window may go on behind it, and a cut escape or word is any error, not only an end.
                Some(Ok(record)) if has_all || length < text.len() => {
                    window.consume(length);
                    return Ok(record);
                }
                Some(Err(error)) if has_all => return Err(self.wrong(window, text, &error)),
                _ => {
                    let count = 2 * text.len().max(1);
                    window.fill(count.min(most)).map_err(|error| self.unreadable(&error))?;
                }
            }
        }
    }

    fn unreadable(&self, error: &io::Error) -> Error {
        Error::io(self.from.path, error)
    }

    fn line_at(&self, place: u64) -> usize {
        1 + line_breaks(self.from.path, &(0..place))
    }

    /// The error of the next byte of a list.
    fn misplaced(&self, window: &Window, what: &str) -> Error {
        let line = self.line_at(window.at());
        Error::new(format!("`{}`: {what}", self.from.section.name())).at_line(line)
    }

    /// The error of a record at the start of a text, with its line and field.
    fn wrong(&self, window: &Window, text: &[u8], error: &serde_json::Error) -> Error {
        let mut json = serde_json::Deserializer::from_slice(text);
        let path = serde_path_to_error::deserialize::<_, T>(&mut json).err().map(|error| error.path().to_string());
        let inner = path.filter(|path| path != ".").unwrap_or_default();
        let dot = if inner.is_empty() || inner.starts_with('[') { "" } else { "." };
        let field = format!("{}[{}]{dot}{inner}", self.from.section.name(), self.ends.len() - 1);
        let place = place_in(text, error);
        let line = self.line_at(window.at() + place as u64);
        if error.is_eof() && !window.is_at_end() {
            let what = format!("`{field}`: a record has more than the limit of {} bytes", RECORD_BYTES.most);
            return Error::new(what).help(RECORD_BYTES.remedy).at_line(line);
        }
        located(error, Some(&field), &text[before(place as u64) as usize..]).at_line(line)
    }
}

impl<'de, T: DeserializeOwned, F: FnMut(T)> DeserializeSeed<'de> for ListSeed<'_, T, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(mut self, deserializer: D) -> Result<(), D::Error> {
        let SectionSource { window, failure, unseen, .. } = self.from;
        let mut list = window.borrow_mut();
        let start = list.at();
        let read = match list.next_byte() {
            Ok(Some(b'[')) => {
                list.consume(1);
                self.read(&mut list)
            }
            // The parser, which has read no byte of the value, knows the error.
            Ok(_) => {
                unseen.borrow_mut().push(start..list.at());
                drop(list);
                return deserializer.deserialize_seq(self);
            }
            Err(error) => Err(self.unreadable(&error)),
        };
        unseen.borrow_mut().push(start..list.at());
        read.map_err(|error| {
            let text = error.message().to_owned();
            failure.replace(Some(error));
            D::Error::custom(text)
        })
    }
}

impl<'de, T, F> Visitor<'de> for ListSeed<'_, T, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of records")
    }
}
