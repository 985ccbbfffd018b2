//! Whole annotation files.

use crate::Extra;
use crate::coco::{Category, CocoAnnotation, CocoImage, CocoInfo, License};
use crate::json::{self, CountingReader, before, located};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;
use std::cell::Cell;
use std::io::{Read, Write};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::mirror::DatasetFile;

/// An annotation file in memory: images of type `I`, annotations of type `A`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnnotationDataset<I, A> {
    /// Name and origin of the dataset.
    #[serde(default)]
    pub info: CocoInfo,
    /// Licenses that images refer to.
    #[serde(default)]
    pub licenses: Vec<License>,
    /// Categories that annotations refer to.
    pub categories: Vec<Category>,
    /// Images. SynTable 1 repeats an image for every annotation: the n-th image belongs to the n-th annotation.
    pub images: Vec<I>,
    /// Annotations.
    pub annotations: Vec<A>,
    /// Sections that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

/// A COCO annotation file.
pub type CocoDataset = AnnotationDataset<CocoImage, CocoAnnotation>;

impl<I: DeserializeOwned, A: DeserializeOwned> AnnotationDataset<I, A> {
    /// Reads a file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = DatasetFile::read(path).map_err(|error| Error::io(path, &error))?;
        Self::from_bytes(&text).map_err(|error| error.in_file(path))
    }

    /// Reads JSON. An error names the line and the field.
    pub fn from_reader(mut reader: impl Read) -> Result<Self> {
        let mut text = Vec::new();
        reader.read_to_end(&mut text).map_err(|error| Error::new(error.to_string()))?;
        Self::from_bytes(&text)
    }

    fn from_bytes(text: &[u8]) -> Result<Self> {
        let (at, until) = (Cell::new(0), Cell::new(u64::MAX));
        let from = || text.get(before(at.get()) as usize..).unwrap_or_default();
        let mut parser = serde_json::Deserializer::from_reader(CountingReader { from: text, at: &at, until: &until });
        let dataset = serde_path_to_error::deserialize(&mut parser).map_err(|error| {
            let path = error.path().to_string();
            located(&error.into_inner(), if path == "." { None } else { Some(&path) }, from())
        })?;
        parser.end().map_err(|error| located(&error, None, from()))?;
        Ok(dataset)
    }
}

impl<I: Serialize, A: Serialize> AnnotationDataset<I, A> {
    /// Writes the file. `path` names it in errors.
    pub fn write(&self, out: &mut dyn Write, path: &str, layout: JsonLayout) -> Result<()> {
        let mut file = DatasetWriter::new(out, path, layout)?;
        file.header(&self.info, &self.licenses, &self.categories)?;
        file.images(|images| self.images.iter().try_for_each(|image| images.record(image)))?;
        file.annotations(|annotations| self.annotations.iter().try_for_each(|record| annotations.record(record)))?;
        for (name, section) in &self.extra {
            match section {
                Json::Array(records) if records.iter().all(Json::is_object) => {
                    file.list(name, |list| records.iter().try_for_each(|record| list.record(record)))?;
                }
                section => file.section(name, section)?,
            }
        }
        file.finish()
    }
}

/// Line breaks of an annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JsonLayout {
    /// One record per line.
    Lines,
    /// Indented by four spaces, as Python's `json.dump(…, indent=4)` writes.
    Indented,
}

/// Writes an annotation file record by record, so that memory does not grow with the dataset. Sections come in the
/// order of [`AnnotationDataset`].
pub struct DatasetWriter<'a> {
    out: &'a mut dyn Write,
    path: &'a str,
    layout: JsonLayout,
    /// Whether the next section or record is the first of its kind.
    first: bool,
}

impl<'a> DatasetWriter<'a> {
    /// Starts a file. `path` names it in errors.
    pub fn new(out: &'a mut dyn Write, path: &'a str, layout: JsonLayout) -> Result<Self> {
        let mut file = Self { out, path, layout, first: true };
        file.put("{")?;
        Ok(file)
    }

    /// Writes the sections before the images.
    pub fn header(&mut self, info: &CocoInfo, licenses: &[License], categories: &[Category]) -> Result<()> {
        self.section("info", info)?;
        self.section("licenses", &licenses)?;
        self.section("categories", &categories)
    }

    /// Writes a section of any content.
    pub fn section(&mut self, name: &str, value: &impl Serialize) -> Result<()> {
        let text = self.text(value, 1)?;
        self.begin(name)?;
        self.put(&text)
    }

    /// Writes the images that `fill` adds.
    pub fn images(&mut self, fill: impl FnOnce(&mut JsonRecords) -> Result<()>) -> Result<()> {
        self.list("images", fill)
    }

    /// Writes the annotations that `fill` adds.
    pub fn annotations(&mut self, fill: impl FnOnce(&mut JsonRecords) -> Result<()>) -> Result<()> {
        self.list("annotations", fill)
    }

    /// Ends the file.
    pub fn finish(mut self) -> Result<()> {
        self.put("\n}\n")
    }

    /// Writes a section of records that `fill` adds.
    pub fn list(&mut self, name: &str, fill: impl FnOnce(&mut JsonRecords) -> Result<()>) -> Result<()> {
        self.begin(name)?;
        self.put("[")?;
        let mut records = JsonRecords { file: self, empty: true };
        fill(&mut records)?;
        let close = if records.empty { "]" } else { "\n    ]" };
        self.put(close)
    }

    fn begin(&mut self, name: &str) -> Result<()> {
        let separator = if std::mem::take(&mut self.first) { "" } else { "," };
        let name = self.text(&name, 1)?;
        self.put(&format!("{separator}\n    {name}: "))
    }

    /// The JSON of a value that starts at this depth of indentation.
    fn text(&self, value: &impl Serialize, depth: usize) -> Result<String> {
        let text = match self.layout {
            JsonLayout::Lines => serde_json::to_string(value),
            JsonLayout::Indented => indented(value, depth),
        };
        text.map_err(|error| json::unwritable(error).in_file(self.path))
    }

    fn put(&mut self, text: &str) -> Result<()> {
        self.out.write_all(text.as_bytes()).map_err(|error| Error::io(self.path, &error))
    }
}

/// A list of records that is being written.
pub struct JsonRecords<'w, 'a> {
    file: &'w mut DatasetWriter<'a>,
    empty: bool,
}

impl JsonRecords<'_, '_> {
    /// Adds a record.
    pub fn record(&mut self, record: &impl Serialize) -> Result<()> {
        let text = self.file.text(record, 2)?;
        self.put(&text)
    }

    /// Adds a record that is already JSON text on one line. It is copied, and parsed only to be indented.
    pub fn raw(&mut self, record: &str) -> Result<()> {
        match self.file.layout {
            JsonLayout::Lines => self.put(record),
            JsonLayout::Indented => {
                let record: Json = serde_json::from_str(record)
                    .map_err(|error| Error::new(format!("a record is not JSON: {error}")).in_file(self.file.path))?;
                self.record(&record)
            }
        }
    }

    fn put(&mut self, text: &str) -> Result<()> {
        let separator = if std::mem::take(&mut self.empty) { "" } else { "," };
        let indent = if self.file.layout == JsonLayout::Lines { "" } else { "        " };
        self.file.put(&format!("{separator}\n{indent}{text}"))
    }
}

/// JSON at this depth, formatted like Python's `json.dump(…, indent=4)`.
fn indented(value: &impl Serialize, depth: usize) -> serde_json::Result<String> {
    let mut text = Vec::new();
    let formatter = serde_json::ser::PrettyFormatter::with_indent(b"    ");
    value.serialize(&mut serde_json::Serializer::with_formatter(&mut text, formatter))?;
    // Line breaks inside strings are escaped, so every line break comes from the formatter.
    let text = String::from_utf8(text).map_err(serde::ser::Error::custom)?;
    Ok(text.replace('\n', &format!("\n{}", "    ".repeat(depth))))
}
