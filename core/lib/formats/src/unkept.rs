//! Fields of annotation files that readers ignore, so that a conversion loses them.

use crate::Extra;
use serde_json::Value as Json;
use std::collections::BTreeMap;
use syntable_model::left_out::LeftOut;

/// Maximum number of fields that are counted by name, per kind of record.
const NAMED: usize = 32;

/// Records of one kind, counted by their unread fields with non-empty values.
///
/// A field with the origin of a record, such as an address, a date or an id, is information. Any other field may be a
/// label, such as keypoints or an attribute.
#[derive(Debug)]
pub struct Unkept {
    /// Name of the records, in the plural.
    records: &'static str,
    /// Names of fields that are read, or derived from fields that are read.
    read: &'static [&'static str],
    all: usize,
    labels: BTreeMap<String, usize>,
    /// Records with labels beyond the first [`NAMED`] names.
    more: usize,
    information: BTreeMap<String, usize>,
}

impl Unkept {
    /// Starts with no records.
    pub fn new(records: &'static str, read: &'static [&'static str]) -> Self {
        Self { records, read, all: 0, labels: BTreeMap::new(), more: 0, information: BTreeMap::new() }
    }

    /// Counts a record by the fields that its type does not know.
    pub fn add(&mut self, fields: &Extra) {
        self.all += 1;
        let mut has_more = false;
        let unread = fields.iter().filter(|(name, value)| !self.read.contains(&name.as_str()) && says(value));
        for name in unread.map(|(name, _)| name) {
            let counts = if is_information(name) { &mut self.information } else { &mut self.labels };
            if counts.len() < NAMED || counts.contains_key(name) {
                *counts.entry(name.clone()).or_default() += 1;
            } else {
                has_more = true;
            }
        }
        self.more += usize::from(has_more);
    }

    /// Counts a known field of the last added record that no product holds.
    pub fn add_information(&mut self, name: &str, is_there: bool) {
        if is_there {
            *self.information.entry(name.to_owned()).or_default() += 1;
        }
    }

    /// All fields: `` `synset` of 3 categories``.
    pub fn all(&self) -> Vec<String> {
        let all = self.labels.iter().chain(&self.information);
        all.map(|(name, count)| format!("`{name}` of {count} {}", self.records)).collect()
    }

    /// Fields that may be labels, with the numbers of their records.
    pub fn labels(&self) -> Vec<LeftOut> {
        let of = |count: usize, what: String| LeftOut::new(count, self.all, what);
        let named = self
            .labels
            .iter()
            .map(|(name, count)| of(*count, format!("{} have `{name}`, which is not kept", self.records)));
        let more = of(self.more, format!("{} have other fields, which are not kept", self.records));
        named.chain((self.more > 0).then_some(more)).collect()
    }

    /// Fields of information: `` `license` of 3 images``.
    pub fn information(&self) -> Vec<String> {
        self.information.iter().map(|(name, count)| format!("`{name}` of {count} {}", self.records)).collect()
    }
}

/// The note about unread information; none if the list is empty.
pub fn note(information: &[String]) -> Option<String> {
    (!information.is_empty()).then(|| format!("information beside labels is not kept: {}", information.join(", ")))
}

/// Whether a value may be a label. Tools write zeros, `false`, and empty texts and lists for objects without labels.
fn says(value: &Json) -> bool {
    match value {
        Json::Null => false,
        Json::Bool(flag) => *flag,
        Json::Number(number) => number.as_f64() != Some(0.0),
        Json::String(text) => !text.is_empty(),
        Json::Array(values) => values.iter().any(says),
        Json::Object(fields) => fields.values().any(says),
    }
}

/// Whether a field states the origin of a record, not its content. The track of an object is a label.
fn is_information(name: &str) -> bool {
    const NAMES: [&str; 13] = [
        "author",
        "color",
        "creator",
        "date",
        "file_name",
        "filename",
        "height",
        "id",
        "license",
        "name",
        "path",
        "url",
        "width",
    ];
    const ENDS: [&str; 7] = ["_id", "_url", "_path", "_date", "_file", "_file_name", "_filename"];
    let name = name.to_lowercase();
    let is_named = NAMES.contains(&name.as_str()) || name.starts_with("date_");
    !name.contains("track") && (is_named || ENDS.iter().any(|end| name.ends_with(end)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn fields_that_say_something_are_counted_by_name() {
        let mut unkept = Unkept::new("annotations", &["visible_mask"]);
        for record in [
            json!({ "visible_mask": "x", "keypoints": [1, 2, 2], "attributes": { "occluded": false } }),
            json!({ "keypoints": [0, 0, 0], "caption": "", "attributes": { "occluded": true }, "person_id": 7 }),
            json!({ "keypoints": [3, 4, 1], "track_id": 3, "coco_url": "there" }),
        ] {
            unkept.add(record.as_object().expect("an object"));
        }
        let labels: Vec<String> = unkept.labels().iter().map(ToString::to_string).collect();
        assert_eq!(
            labels,
            [
                "1 of 3 annotations have `attributes`, which is not kept",
                "2 of 3 annotations have `keypoints`, which is not kept",
                "1 of 3 annotations have `track_id`, which is not kept",
            ]
        );
        assert_eq!(unkept.information(), ["`coco_url` of 1 annotations", "`person_id` of 1 annotations"]);
    }

    /// Every record of a file may have a new name.
    #[test]
    fn names_beyond_some_are_counted_together() {
        let mut unkept = Unkept::new("regions", &[]);
        (0..100).for_each(|number| unkept.add(&Extra::from_iter([(format!("a{number:03}"), json!(1))])));
        let labels = unkept.labels();
        assert_eq!((labels.len(), labels.last().map(|it| it.count)), (NAMED + 1, Some(100 - NAMED as u64)));
    }
}
