//! The description of a dataset, `data.yaml`. The reader supports YAML lists, maps and single-line strings.

use super::record::LabelShape;
use crate::coco::MaskChoice;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::decode;
use syntable_formats::read::KnownMasks;
use syntable_model::prelude::*;

/// Key of the names.
const NAMES: &str = "names";

/// Key of the number of keypoints in poses.
const POSES: &str = "kpt_shape";
/// Key of the task, which Ultralytics writes into its models.
const TASK: &str = "task";

/// Keys of the images for training and for validation.
const SPLITS: [&str; 2] = ["train", "val"];
/// Key of the kind of masks that polygons outline, which Ultralytics does not read.
const MASKS: &str = "masks";
/// Value for visible masks, which is the default.
const VISIBLE: &str = "visible";
/// Value for amodal masks.
const AMODAL: &str = "amodal";

/// The text of the file of a dataset with a folder of images. It states the `task` of boxes, which lines alone do not tell in a
/// dataset without objects. Names are quoted as in JSON, which YAML reads.
pub fn text(images: &str, task: Option<LabelShape>, masks: MaskChoice, dataset: &DatasetInfo) -> String {
    let quoted = |text: &str| serde_json::Value::from(text).to_string();
    let mut text: String = SPLITS.map(|split| format!("{split}: {}\n", quoted(images))).concat();
    if task == Some(LabelShape::Boxes) {
        text += &format!("{TASK}: detect\n");
    }
    if masks == MaskChoice::Amodal {
        text += &format!("{MASKS}: {AMODAL}\n");
    }
    text += &format!("{NAMES}:\n");
    for (class, (_, name)) in dataset.categories().enumerate() {
        text += &format!("  {class}: {}\n", quoted(name));
    }
    text
}

/// Reads the text of a file.
fn content(path: &Path) -> Result<String> {
    decode::text(path).map_err(|error| match path.is_file() {
        true => error.of_request(),
        false => error.help("put the description of the dataset in its place, or remove it").of_request(),
    })
}

/// The masks that polygons outline: visible masks, unless the file states amodal masks.
pub fn masks(path: &Path) -> Result<KnownMasks> {
    let text = content(path)?;
    match value_of(&text, MASKS) {
        None => Ok(KnownMasks::Visible),
        Some((_, masks)) if masks == VISIBLE => Ok(KnownMasks::Visible),
        Some((_, masks)) if masks == AMODAL => Ok(KnownMasks::Amodal),
        Some((number, masks)) => Err(Error::new(format!("`{MASKS}` is `{masks}`"))
            .in_file(path)
            .at_line(number)
            .help(format!("write {VISIBLE} or {AMODAL}"))),
    }
}

/// The value of a key of the file, and its line number.
fn value_of(text: &str, key: &str) -> Option<(usize, String)> {
    (1..).zip(text.lines()).find_map(|(number, line)| {
        let (found, value) = uncommented(line).split_once(':')?;
        let is_it = !found.starts_with(char::is_whitespace) && scalar(found)? == key;
        is_it.then(|| (number, scalar(value).unwrap_or_default()))
    })
}

/// The shape of lines, if the file states it.
pub fn shape(path: &Path) -> Result<Option<LabelShape>> {
    let text = content(path)?;
    let Some((number, task)) = value_of(&text, TASK) else {
        return Ok(value_of(&text, POSES).map(|_| LabelShape::Poses));
    };
    match task.as_str() {
        "segment" => Ok(Some(LabelShape::Polygons)),
        "detect" => Ok(Some(LabelShape::Boxes)),
        "obb" => Ok(Some(LabelShape::RotatedBoxes)),
        "pose" => Ok(Some(LabelShape::Poses)),
        _ => Err(Error::new(format!("`{TASK}` is `{task}`"))
            .in_file(path)
            .at_line(number)
            .help("write segment, detect, obb or pose")),
    }
}

/// The names of classes by their numbers.
pub fn names(path: &Path) -> Result<BTreeMap<u64, String>> {
    let text = content(path)?;
    let refuse = |number: usize, what: &str| {
        Error::new(format!("`{NAMES}` cannot be read: {what}"))
            .in_file(path)
            .at_line(number)
            .help("write a list of names, or a map such as `0: mug`, a line each")
    };
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !uncommented(line).trim().is_empty());
    let found = lines.by_ref().find_map(|(number, line)| {
        let (key, rest) = uncommented(line).split_once(':')?;
        (scalar(key)? == NAMES && !key.starts_with(char::is_whitespace)).then(|| (number, rest.trim().to_owned()))
    });
    let Some((number, inline)) = found else { return Err(refuse(1, "it is missing")) };
    let mut names = BTreeMap::new();
    let mut add = |number: usize, entry: &str, is_list: bool| {
        let (class, name) = if is_list {
            (Some(names.len() as u64), entry)
        } else {
            let (class, name) =
                entry.split_once(':').ok_or_else(|| refuse(number, &format!("`{entry}` has no `:`")))?;
            (scalar(class).and_then(|class| class.parse().ok()), name)
        };
        let class = class.ok_or_else(|| refuse(number, &format!("`{entry}` does not begin with a number")))?;
        let name = scalar(name).ok_or_else(|| refuse(number, &format!("`{name}` is no name")))?;
        match names.insert(class, name) {
            None => Ok(()),
            Some(_) => Err(refuse(number, &format!("class {class} occurs twice"))),
        }
    };
    if !inline.is_empty() {
        let bare = |open, close| inline.strip_prefix(open)?.strip_suffix(close);
        let (entries, is_list) = match (bare('[', ']'), bare('{', '}')) {
            (Some(list), _) => (list, true),
            (_, Some(map)) => (map, false),
            _ => return Err(refuse(number, &format!("`{inline}` is no list and no map of one line"))),
        };
        for entry in split(entries).into_iter().filter(|entry| !entry.trim().is_empty()) {
            add(number, entry, is_list)?;
        }
        return Ok(names);
    }
    for (number, line) in lines {
        let entry = uncommented(line);
        match entry.trim_start().strip_prefix("- ") {
            Some(name) => add(number, name, true)?,
            // The next key of the file ends the list.
            None if !entry.starts_with(char::is_whitespace) => break,
            None => add(number, entry, false)?,
        }
    }
    Ok(names)
}

/// A line without its comment.
fn uncommented(line: &str) -> &str {
    let mut quote = None;
    let mut before = ' ';
    for (at, c) in line.char_indices() {
        match quote {
            Some(open) if c == open && !(open == '"' && before == '\\') => quote = None,
            None if (c == '"' || c == '\'') && " [{,:-".contains(before) => quote = Some(c),
            None if c == '#' && before.is_whitespace() => return &line[..at],
            _ => {}
        }
        before = c;
    }
    line
}

/// The entries of a single-line list. Commas in quotes are part of names.
fn split(list: &str) -> Vec<&str> {
    let (mut entries, mut start, mut quote, mut before) = (Vec::new(), 0, None, ' ');
    for (at, c) in list.char_indices() {
        match quote {
            Some(open) if c == open && before != '\\' => quote = None,
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == ',' => {
                entries.push(&list[start..at]);
                start = at + 1;
            }
            _ => {}
        }
        before = c;
    }
    entries.push(&list[start..]);
    entries
}

/// A string, quoted or not.
fn scalar(text: &str) -> Option<String> {
    let text = text.trim();
    if text.starts_with('"') {
        return serde_json::from_str(text).ok();
    }
    if let Some(quoted) = text.strip_prefix('\'') {
        return Some(quoted.strip_suffix('\'')?.replace("''", "'"));
    }
    (!text.is_empty()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn read(text: &str) -> Result<Vec<(u64, String)>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("data.yaml");
        fs::write(&path, text).expect("writable");
        names(&path).map(|names| names.into_iter().collect()).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn names_are_lists_or_maps() {
        let want = Ok(vec![(0, "a mug".to_owned()), (1, "b: \"c\", d".to_owned())]);
        for text in [
            "path: .\nnames:\n  0: a mug # comment\n  1: \"b: \\\"c\\\", d\"\nnc: 2\n",
            "names:\n- 'a mug'\n- 'b: \"c\", d'\ntrain: images\n",
            "# names: no\nnc: 2\nnames: ['a mug', 'b: \"c\", d']\n",
            "names: {0: a mug, 1: 'b: \"c\", d'}",
            "names:\n\n    - a mug\n    # none\n    - \"b: \\\"c\\\", d\"\n",
        ] {
            assert_eq!(read(text), want, "{text}");
        }
        assert_eq!(read("names:\n  3: it's\n"), Ok(vec![(3, "it's".to_owned())]));
    }

    #[test]
    fn what_is_no_name_is_refused() {
        for (text, says) in [
            ("nc: 1\n", "missing"),
            ("names: mug\n", "no list and no map"),
            ("names:\n  a: b\n", "does not begin with a number"),
            ("names:\n  0: a\n  0: b\n", "twice"),
            ("names:\n  0\n", "has no `:`"),
            ("names: [\"a]\n", "is no name"),
        ] {
            let message = read(text).expect_err(text);
            assert!(message.contains(says), "{text}: {message}");
        }
    }

    #[test]
    fn names_are_valid_yaml() {
        let dataset = DatasetInfo { classes: vec!["a: \"b\"".to_owned()], ..syntable_testing::scenes::dataset() };
        assert_eq!([1, 2].map(|category| dataset.category(category).expect("there").0), [0, 1]);
        let want = "train: \"images/val\"\nval: \"images/val\"\nnames:\n  0: \"object\"\n  1: \"a: \\\"b\\\"\"\n";
        assert_eq!(super::text("images/val", None, MaskChoice::Visible, &dataset), want);
        let amodal = super::text("images/val", None, MaskChoice::Amodal, &dataset);
        assert_eq!(amodal, want.replace("names:", "masks: amodal\nnames:"));
    }
}
