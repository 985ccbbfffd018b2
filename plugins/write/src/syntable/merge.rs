//! The annotation file, from the scenes' shards.
//!
//! A shard has a line `["image", annotations, record]` for every view, followed by that many lines
//! `["annotation", record]`. Records are copied as text; only the released form, which is indented, is parsed.

use super::record::DATE;
use super::{Compat, SynTable};
use crate::files::shard;
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::io::Write;
use syntable_model::prelude::*;

/// Writes the annotation file.
pub fn annotations(config: &SynTable, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    let path = config.path(&config.annotation_file);
    let released = config.compat == Compat::Release;
    let skip_empty = config.skip_empty_images || released;
    finish.write(&path, |out| {
        let mut file = JsonFile { out, path: &path, released, first: true };
        file.put("{")?;
        file.section("info", &info(dataset, released))?;
        file.section("licenses", &json!([{ "id": 1, "name": "licences of the assets", "url": "" }]))?;
        file.section("categories", &json!([{ "id": 1, "name": "object", "supercategory": "shape" }]))?;
        file.begin("images")?;
        lines(finish, |line| match line {
            Line::Image { annotations, record } => {
                let copies = if released { annotations } else { usize::from(annotations > 0 || !skip_empty) };
                (0..copies).try_for_each(|_| file.record(record))
            }
            Line::Annotation { .. } => Ok(()),
        })?;
        file.end(",")?;
        file.begin("annotations")?;
        let mut id = 0_u64;
        lines(finish, |line| match line {
            Line::Image { .. } => Ok(()),
            Line::Annotation { fields } => {
                id += 1;
                file.record(&format!("{{\"id\":{id},{fields}"))
            }
        })?;
        file.end("")?;
        file.put("\n}\n")
    })
}

fn info(dataset: &DatasetInfo, released: bool) -> Json {
    json!({
        "description": dataset.name,
        "url": "nil",
        "version": "0.1.0",
        "year": if released { 2022 } else { 1970 },
        "contributor": dataset.program,
        "date_created": DATE,
    })
}

/// A line of a shard.
enum Line<'a> {
    Image {
        annotations: usize,
        record: &'a str,
    },
    /// What follows the brace of the record.
    Annotation {
        fields: &'a str,
    },
}

fn lines(finish: &Finish, mut each: impl FnMut(Line) -> Result<()>) -> Result<()> {
    shard::for_each_line(finish, |scene, line| {
        let line = parse(line).ok_or_else(|| {
            Error::new(format!("the shard of scene {} has a line that is not understood", scene.0))
                .help("the dataset is damaged, or of another version; run again with --overwrite")
        })?;
        each(line)
    })
}

fn parse(line: &str) -> Option<Line<'_>> {
    let body = line.strip_prefix('[')?.strip_suffix(']')?;
    if let Some(rest) = body.strip_prefix("\"image\",") {
        let (annotations, record) = rest.split_once(',')?;
        Some(Line::Image { annotations: annotations.parse().ok()?, record })
    } else {
        Some(Line::Annotation { fields: body.strip_prefix("\"annotation\",{")? })
    }
}

/// A JSON file in the making: a record a line, or indented by four as the released program does.
struct JsonFile<'a> {
    out: &'a mut dyn Write,
    path: &'a str,
    released: bool,
    first: bool,
}

impl JsonFile<'_> {
    fn put(&mut self, text: &str) -> Result<()> {
        self.out.write_all(text.as_bytes()).map_err(|error| Error::io(self.path, &error))
    }

    /// A whole section.
    fn section(&mut self, name: &str, value: &Json) -> Result<()> {
        let text = if self.released { indented(value, 1)? } else { value.to_string() };
        self.put(&format!("\n    \"{name}\": {text},"))
    }

    /// Begins a list of records.
    fn begin(&mut self, name: &str) -> Result<()> {
        self.first = true;
        self.put(&format!("\n    \"{name}\": ["))
    }

    /// A record of the list.
    fn record(&mut self, record: &str) -> Result<()> {
        let separator = if std::mem::take(&mut self.first) { "" } else { "," };
        if self.released {
            let value: Json = serde_json::from_str(record).map_err(|error| {
                Error::new(format!("a shard holds a record that is not JSON: {error}"))
                    .help("the dataset is damaged; run again with --overwrite")
            })?;
            self.put(&format!("{separator}\n        {}", indented(&value, 2)?))
        } else {
            self.put(&format!("{separator}\n{record}"))
        }
    }

    /// Ends the list.
    fn end(&mut self, then: &str) -> Result<()> {
        let close = if self.first { "" } else { "\n    " };
        self.put(&format!("{close}]{then}"))
    }
}

/// JSON as Python's `json.dump(…, indent = 4)` writes it at some depth.
fn indented(value: &Json, depth: usize) -> Result<String> {
    let mut text = Vec::new();
    let formatter = serde_json::ser::PrettyFormatter::with_indent(b"    ");
    value
        .serialize(&mut serde_json::Serializer::with_formatter(&mut text, formatter))
        .map_err(|error| Error::new(format!("not to be written as JSON: {error}")))?;
    // Line ends inside texts are escaped, so that every line end is one of the formatter.
    let text = String::from_utf8(text).map_err(|error| Error::new(error.to_string()))?;
    Ok(text.replace('\n', &format!("\n{}", "    ".repeat(depth))))
}
