//! Reads OCID's sequences: `ARID20/floor/top/seq01` and the like.

use crate::label_images::{LabelImage, LabelImages, LabelRules, note_missing, offers};
use std::path::{Path, PathBuf};
use syntable_formats::read::{self, Categories, Faults};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::reader::{DatasetFault, Format, Note, Opened, Source};
use syntable_model::rule;

syntable_model::register_format!(Format::new(
    "ocid",
    "OCID's folders of sequences (`seq*` with `rgb`, `depth` and `label`), or one of the folders in it.",
    |root| !sequences(root, 1).is_empty(),
    open,
));

const COLOR: &str = "rgb";
const DEPTH: &str = "depth";
const LABELS: &str = "label";
/// Start of the names of sequences' folders.
const SEQUENCE: &str = "seq";
/// Folders of scenes on a table, whose table has a label after the floor's label.
const TABLE: &str = "table";
const FLOOR: &str = "floor";
/// Folders between the dataset and its sequences, except the folders of kinds of objects.
const LEVELS: [&str; 7] = ["ARID20", "ARID10", "YCB10", FLOOR, TABLE, "bottom", "top"];
/// The last of them. Folders of kinds of objects may follow.
const LAST_LEVELS: [&str; 2] = ["bottom", "top"];
/// Depth of folders in which sequences are searched.
const LEVELS_DEEP: usize = 6;
/// Most sequences of a dataset. OCID has 96.
const SEQUENCES: usize = 1 << 14;

fn is_named(path: &Path, names: &[&str]) -> bool {
    path.file_name().is_some_and(|name| names.iter().any(|of| name == *of))
}

fn is_sequence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with(SEQUENCE) && [COLOR, LABELS].iter().all(|folder| path.join(folder).is_dir())
}

/// The first sequences below a folder, which may be one, in order.
fn sequences(root: &Path, most: usize) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let root = std::path::absolute(root).unwrap_or_else(|_| root.to_owned());
    search(&root, LEVELS_DEEP, most, &mut found);
    found
}

fn search(folder: &Path, deep: usize, most: usize, found: &mut Vec<PathBuf>) {
    if found.len() >= most {
        return;
    }
    if is_sequence(folder) {
        found.push(folder.to_owned());
        return;
    }
    let leads_on = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        is_named(path, &LEVELS) || name.starts_with(SEQUENCE) || is_named(folder, &LAST_LEVELS)
    };
    let inner = read::entries(folder).into_iter().filter(|path| leads_on(path) && path.is_dir());
    inner.take_while(|_| deep > 0).for_each(|path| search(&path, deep - 1, most, found));
}

/// The largest label of the background and of what objects stand on. None if no folder above is called `floor` or `table`.
fn background(sequence: &Path) -> Option<u16> {
    let mut above = sequence.ancestors().filter(|path| is_named(path, &[FLOOR, TABLE]));
    above.next().map(|path| if is_named(path, &[TABLE]) { 2 } else { 1 })
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.folder(&source.path)?;
    let top = std::path::absolute(&source.path).unwrap_or_else(|_| source.path.clone());
    let found = sequences(&source.path, SEQUENCES);
    if found.is_empty() {
        return Err(Error::new("it has no sequence of OCID: no folder `seq*` with the folders `rgb` and `label`")
            .in_file(&source.path));
    }
    let (mut faults, mut views, mut unsaid) = (Faults::default(), Vec::new(), 0);
    for (scene, sequence) in (0..).zip(&found) {
        let inside = sequence.strip_prefix(&top).unwrap_or(Path::new("")).to_owned();
        let place = background(sequence);
        unsaid += usize::from(place.is_none());
        let stems = |folder: &str| -> Result<Vec<String>> {
            let images = read::entries_with(&root.file(inside.join(folder))?, |end| end == "png")?;
            Ok(images.into_iter().map(|(stem, _)| stem).collect())
        };
        let names = stems(COLOR)?;
        for name in stems(LABELS)?.into_iter().filter(|name| names.binary_search(name).is_err()) {
            let path = |folder: &str| inside.join(folder).join(format!("{name}.png")).display().to_string();
            faults.lost(rule::RECORDS_AGREE, path(LABELS), format!("{} is missing", path(COLOR)));
        }
        for (view, name) in (0..).zip(names) {
            let path = |folder: &str| inside.join(folder).join(format!("{name}.png"));
            let background = place.unwrap_or(1);
            let image = LabelImage { rgb: path(COLOR), depth: path(DEPTH), labels: path(LABELS), background };
            note_missing(&root, &image, &mut faults);
            views.push((image.rgb.display().to_string(), (scene, view), image));
        }
    }
    let (refs, views) = faults.in_order(views, |(name, place, _)| (name, Some(*place)));
    let info = Categories::default().info(read::name_of(&source.path), String::new(), &refs, String::new());
    let images = views.into_iter().map(|(.., image)| image).collect();
    let mut notes = Vec::new();
    if unsaid > 0 {
        let what = "no folder above says `floor` or `table`, so label 1 is what objects stand on, and label 2 is an \
                    object: on OCID's tables it is the table";
        notes.push(Note::caveat(what).of(read::labels_among(&offers())));
    }
    let source = LabelImages { root, images, rules: NoRules };
    Ok(Opened { faults: faults.into_inner(), notes, ..Opened::new(info, refs, offers(), source) })
}

/// OCID states nothing about its labels that could be wrong.
struct NoRules;

impl LabelRules for NoRules {
    fn faults(&self, _: &DatasetFolder, _: &LabelImage, _: &[u16]) -> Vec<DatasetFault> {
        Vec::new()
    }
}
