//! Reads JSON Lines of products.

use super::record::{JsonlRecord, KEYS, VIEWS};
use serde::de::IgnoredAny;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_formats::decode::{self, FileContent};
use syntable_formats::json;
use syntable_formats::read::{self, Faults};
use syntable_formats::samples::{self, Contents, Latest, SampleFields, SampleReader};
use syntable_model::limits::TEXT_BYTES;
use syntable_model::mirror::DatasetFile;
use syntable_model::prelude::*;
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::rule;

syntable_model::register_format!(
    Format::new(
        "jsonl",
        "JSON Lines of views or scenes, as the writer `jsonl` has them: products under their names.",
        |root| file_of(root).is_some_and(|path| starts_as_one(&path)),
        open,
    )
    .generic()
);

/// A line parsed only for the names of its products.
type JsonlHead = JsonlRecord<BTreeMap<String, IgnoredAny>>;

/// The file that a path refers to: the path, or the only file of a folder.
fn file_of(path: &Path) -> Option<PathBuf> {
    let is_one = |path: &Path| path.extension().is_some_and(|it| it == "jsonl") && path.is_file();
    if is_one(path) {
        return Some(path.to_owned());
    }
    let is_hidden = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    let mut entries = read::entries(path).into_iter().filter(|path| !is_hidden(path));
    let first = entries.next()?;
    (is_one(&first) && entries.next().is_none()).then_some(first)
}

/// Whether the first line is a record of a scene or a view.
fn starts_as_one(path: &Path) -> bool {
    let first = DatasetFile::open(path).ok().and_then(|file| {
        let mut line = Vec::new();
        BufReader::new(file).take(TEXT_BYTES.most).read_until(b'\n', &mut line).ok()?;
        decode::check_json(&line).ok()?;
        serde_json::from_slice::<JsonlHead>(&line).ok()
    });
    first.is_some_and(|head| head.scene.is_some() && (head.view.is_some() || head.views.is_some()))
}

/// Position of a view: its line, and its index in the line of a scene.
#[derive(Clone, Copy)]
struct ViewPlace {
    line: LineSpan,
    of_scene: Option<usize>,
}

#[derive(Clone, Copy, PartialEq)]
struct LineSpan {
    number: usize,
    at: u64,
    length: u64,
}

struct JsonlSource {
    path: PathBuf,
    /// The scene of each image, and the position of the image.
    places: Vec<(u32, ViewPlace)>,
    /// Lines with products of scenes only.
    scenes: BTreeMap<u32, LineSpan>,
    /// The most recently read lines: a line of a scene contains many views.
    latest: Latest<LineSpan, SampleFields>,
}

fn open(source: &Source) -> Result<Opened> {
    let path = source.path.as_path();
    let file = file_of(path).ok_or_else(|| {
        let help = "name the file, such as jsonl.jsonl";
        Error::new("one file of JSON Lines was expected").in_file(path).help(help)
    })?;
    if file != path {
        read::check_inside(&source.folder(path)?, [&file])?;
    }
    let name = read::name_of(&file);
    let (contents, lines) = JsonlSource::index(file)?;
    Ok(samples::open(name, contents, Box::new(lines)))
}

impl JsonlSource {
    fn index(path: PathBuf) -> Result<(Contents, Self)> {
        let fail = |error: std::io::Error| Error::io(&path, &error);
        let mut reader = BufReader::new(decode::open(&path)?);
        let (mut views, mut scenes) = (BTreeMap::<(u32, u32), ViewPlace>::new(), BTreeMap::new());
        let (mut faults, mut fields) = (Faults::default(), BTreeSet::new());
        let (mut at, mut text) = (0, Vec::new());
        for number in 1.. {
            text.clear();
            let length = reader.by_ref().take(TEXT_BYTES.most).read_until(b'\n', &mut text).map_err(fail)? as u64;
            if length == 0 {
                break;
            }
            let line = LineSpan { number, at, length };
            at += length;
            let place = || format!("line {number}");
            if length == TEXT_BYTES.most && text.last() != Some(&b'\n') {
                let rest = reader.skip_until(b'\n').map_err(fail)? as u64;
                at += rest;
                let error = TEXT_BYTES.refuse(length + rest).at_line(number).in_file(&path);
                faults.lost(rule::READABLE, place(), format!("{error}: the line is not read"));
                continue;
            }
            let parse = || serde_json::from_slice::<JsonlHead>(&text).map_err(|error| json::located(&error, None, &[]));
            let head = match decode::check_json(&text).and_then(|()| parse()) {
                Ok(head) => head,
                Err(error) => {
                    let error = error.at_line(number).in_file(&path);
                    faults.lost(rule::READABLE, place(), format!("{error}: the line is not read"));
                    continue;
                }
            };
            // If a line lacks a product that another line has, the error is reported when the product is read.
            let of_views = head.views.iter().flatten().flat_map(|view| view.products.keys());
            if head.scene.is_some() {
                fields.extend(head.products.keys().chain(of_views).cloned());
            }
            let found: Vec<(u32, Option<usize>)> = match (head.scene, head.view, head.views) {
                (Some(_), Some(view), _) => vec![(view, None)],
                (Some(_), None, Some(views)) => {
                    views.iter().enumerate().map(|(of_scene, it)| (it.view, Some(of_scene))).collect()
                }
                (Some(scene), None, None) => {
                    scenes.insert(scene, line);
                    continue;
                }
                // Products of the dataset.
                (None, ..) => continue,
            };
            for (view, of_scene) in found {
                let key = (head.scene.unwrap_or_default(), view);
                if let Some(first) = views.get(&key) {
                    let message = format!(
                        "view {view} of scene {} is in line {}, too; that one counts",
                        key.0, first.line.number
                    );
                    faults.lost(rule::UNIQUE_VIEWS, place(), message);
                    continue;
                }
                views.insert(key, ViewPlace { line, of_scene });
            }
        }
        let image = |&(scene, view): &(u32, u32)| read::image((scene, view), format!("scene {scene}, view {view}"));
        let images = views.keys().map(image).collect();
        let places: Vec<(u32, ViewPlace)> = views.into_iter().map(|((scene, _), place)| (scene, place)).collect();
        let contents = Contents { images, fields, faults, ..Contents::default() };
        Ok((contents, Self { path, places, scenes, latest: Latest::default() }))
    }

    /// The fields of a view, from its line, its entry in the line, and its scene.
    fn sample(&self, image: usize) -> Result<SampleFields> {
        let (scene, place) = self.places[image];
        let line = match place.of_scene {
            None => Arc::new(self.line(place.line)?),
            Some(_) => self.latest.get(place.line, || self.line(place.line))?,
        };
        let mut fields = SampleFields::clone(&line);
        if let Some(scene) = self.scenes.get(&scene) {
            fields.extend(self.line(*scene)?);
        }
        let views = fields.remove(VIEWS);
        if let (Some(of_scene), Some(Value::List(mut views))) = (place.of_scene, views)
            && let Value::Record(own) = views.swap_remove(of_scene)
        {
            fields.extend(own);
        }
        fields.retain(|name, _| !KEYS.contains(&name.as_str()));
        Ok(fields)
    }

    fn line(&self, line: LineSpan) -> Result<SampleFields> {
        let fail = |error: std::io::Error| Error::io(&self.path, &error);
        let mut file = DatasetFile::open(&self.path).map_err(fail)?;
        let mut bytes = vec![0; line.length as usize];
        file.seek(SeekFrom::Start(line.at)).and_then(|_| file.read_exact(&mut bytes)).map_err(fail)?;
        let content = FileContent::new(bytes, self.path.clone());
        match content.json().map_err(|error| error.at_line(line.number))? {
            Value::Record(fields) => Ok(fields.into_iter().collect()),
            _ => Err(content.refuse("a line is no record").at_line(line.number)),
        }
    }
}

impl SampleReader for JsonlSource {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        let mut fields = self.sample(image)?;
        fields.retain(|name, _| wanted.contains(name.as_str()));
        Ok(fields)
    }
}
