//! The finished scenes of a journal in memory. A dataset may have millions: a scene takes 40 bytes, and what many lines
//! have in common is kept once.

use crate::run::dataset::journal::entry::{JournalEntry, SceneOutcome};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::sync::Arc;
use syntable_model::digest::Digest;

/// Digests of assets by `pool/name`.
pub type AssetDigests = BTreeMap<String, String>;

/// The finished scenes of a journal, ascending, and the assets that were drawn for them.
#[derive(Debug, Clone, Default)]
pub struct Entries {
    scenes: BTreeMap<u32, Packed>,
    forms: Forms,
    remarks: Remarks,
    assets: AssetDigests,
}

/// A scene: the parts of its line that differ from scene to scene, and the places of the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Packed {
    attempt: u32,
    views: u32,
    objects: u32,
    manifest: Digest,
    form: u32,
    remark: u32,
}

/// Fields that many lines have in common.
#[derive(Debug, Clone)]
struct Form {
    failed: bool,
    writers: Vec<String>,
    recorded: Vec<String>,
    component: String,
}

/// Forms in the order of their first line, and their numbers by their text.
#[derive(Debug, Clone, Default)]
struct Forms {
    all: Vec<Form>,
    numbers: HashMap<Box<str>, u32>,
}

/// All other fields of lines as JSON, each text once.
#[derive(Debug, Clone, Default)]
struct Remarks {
    all: Vec<Arc<str>>,
    numbers: HashMap<Arc<str>, u32>,
}

/// A finished scene.
#[derive(Clone, Copy)]
pub struct SceneLine<'e> {
    /// Number of the scene.
    pub scene: u32,
    packed: Packed,
    form: &'e Form,
    remark: &'e str,
}

impl<'e> SceneLine<'e> {
    /// Whether all attempts failed.
    pub fn failed(&self) -> bool {
        self.form.failed
    }

    /// Number of views in the dataset.
    pub fn views(&self) -> u32 {
        self.packed.views
    }

    /// The attempt, from 0.
    pub fn attempt(&self) -> u32 {
        self.packed.attempt
    }

    /// The component of a mixture that made the scene; empty if the recipe is no mixture.
    pub fn component(&self) -> &'e str {
        &self.form.component
    }

    /// Ids of the writers that wrote the scene.
    pub fn writers(&self) -> &'e [String] {
        &self.form.writers
    }

    /// Products that were recorded of the scene.
    pub fn recorded(&self) -> &'e [String] {
        &self.form.recorded
    }

    /// Digest of the scene's manifest, if it has one.
    pub fn manifest(&self) -> Option<Digest> {
        (!self.form.failed).then_some(self.packed.manifest)
    }

    /// Whether the line states an anomaly, an error, a draw or omitted data.
    pub fn has_remarks(&self) -> bool {
        self.remark != NO_REMARK
    }

    /// The whole line, without assets.
    pub fn entry(&self) -> JournalEntry {
        let Form { failed, writers, recorded, component } = self.form;
        let Packed { attempt, views, objects, manifest, .. } = self.packed;
        let outcome = match failed {
            true => SceneOutcome::Failed,
            false => {
                SceneOutcome::Made { views, objects, writers: writers.clone(), recorded: recorded.clone(), manifest }
            }
        };
        let plain = JournalEntry { component: component.clone(), ..JournalEntry::new(self.scene, attempt, outcome) };
        match self.remark {
            NO_REMARK => plain,
            text => serde_json::from_str::<Remark>(text).expect("it was read before").applied_to(plain),
        }
    }
}

/// The remark of a line without any.
const NO_REMARK: &str = "{}";

impl Entries {
    /// Number of scenes.
    pub fn len(&self) -> usize {
        self.scenes.len()
    }

    /// Whether no scene is finished.
    pub fn is_empty(&self) -> bool {
        self.scenes.is_empty()
    }

    /// Whether a scene is finished.
    pub fn contains(&self, scene: u32) -> bool {
        self.scenes.contains_key(&scene)
    }

    /// A finished scene.
    pub fn get(&self, scene: u32) -> Option<SceneLine<'_>> {
        self.scenes.get(&scene).map(|packed| self.line(scene, *packed))
    }

    /// The finished scenes, ascending.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = SceneLine<'_>> {
        self.scenes.iter().map(|(&scene, packed)| self.line(scene, *packed))
    }

    /// The scenes that did not fail, ascending.
    pub fn made(&self) -> impl DoubleEndedIterator<Item = SceneLine<'_>> {
        self.iter().filter(|line| !line.failed())
    }

    /// The numbers of the finished scenes, ascending.
    pub fn scenes(&self) -> impl Iterator<Item = u32> {
        self.scenes.keys().copied()
    }

    /// Digests of all assets that were drawn for the scenes; `bad` for an unusable asset.
    pub fn assets(&self) -> &AssetDigests {
        &self.assets
    }

    /// Whether the line of a scene is this one. Assets do not count.
    pub fn has(&self, entry: &JournalEntry) -> bool {
        let same = |line: SceneLine| line.entry() == JournalEntry { assets: AssetDigests::new(), ..entry.clone() };
        self.get(entry.scene).is_some_and(same)
    }

    /// Adds the line of a scene, or replaces it.
    pub fn insert(&mut self, entry: &JournalEntry) {
        let packed = self.pack(entry);
        self.scenes.insert(entry.scene, packed);
        self.add_assets(&entry.assets);
    }

    /// Removes the line of a scene. Its assets stay. Returns whether it existed.
    pub fn remove(&mut self, scene: u32) -> bool {
        self.scenes.remove(&scene).is_some()
    }

    /// Removes the failed scenes.
    pub fn remove_failed(&mut self) {
        let Self { scenes, forms, .. } = self;
        scenes.retain(|_, packed| !forms.all[packed.form as usize].failed);
    }

    /// Adds digests of assets.
    pub fn add_assets(&mut self, assets: &AssetDigests) {
        self.assets.extend(self.unknown(assets));
    }

    /// The digests that are not known yet.
    pub fn unknown(&self, assets: &AssetDigests) -> AssetDigests {
        let is_new = |(name, digest): &(&String, &String)| self.assets.get(*name) != Some(*digest);
        assets.iter().filter(is_new).map(|(name, digest)| (name.clone(), digest.clone())).collect()
    }

    /// Replaces each line that has one of some writers.
    pub fn change(&mut self, is_changed: impl Fn(SceneLine) -> bool, change: impl Fn(&JournalEntry) -> JournalEntry) {
        let lines: Vec<JournalEntry> = self.iter().filter(|line| is_changed(*line)).map(|line| line.entry()).collect();
        lines.iter().for_each(|entry| self.insert(&change(entry)));
    }

    fn line(&self, scene: u32, packed: Packed) -> SceneLine<'_> {
        let (form, remark) = (&self.forms.all[packed.form as usize], &self.remarks.all[packed.remark as usize]);
        SceneLine { scene, packed, form, remark }
    }

    fn pack(&mut self, entry: &JournalEntry) -> Packed {
        let (failed, component) = (entry.failed(), entry.component.clone());
        let form = Form { failed, writers: entry.writers().to_vec(), recorded: entry.recorded().to_vec(), component };
        let json = |list: &[String]| serde_json::to_string(list).expect("texts");
        let key = RawForm {
            outcome: if failed { "failed" } else { "made" },
            writers: &json(&form.writers),
            recorded: &json(&form.recorded),
            component: &serde_json::to_string(&form.component).expect("a text"),
        };
        let (mut text, remark) = (String::new(), serde_json::to_string(&Remark::of(entry)).expect("plain data"));
        key.write(&mut text);
        let objects = match entry.outcome {
            SceneOutcome::Made { objects, .. } => objects,
            SceneOutcome::Failed => 0,
        };
        Packed {
            attempt: entry.attempt,
            views: entry.views(),
            objects,
            manifest: entry.manifest().unwrap_or_else(no_manifest),
            form: self.forms.number(&text, || form),
            remark: self.remarks.number(&remark),
        }
    }
}

fn no_manifest() -> Digest {
    Digest::of(&[])
}

impl<'e> FromIterator<&'e JournalEntry> for Entries {
    fn from_iter<I: IntoIterator<Item = &'e JournalEntry>>(lines: I) -> Self {
        let mut entries = Self::default();
        lines.into_iter().for_each(|entry| entries.insert(entry));
        entries
    }
}

impl Forms {
    fn number(&mut self, text: &str, form: impl FnOnce() -> Form) -> u32 {
        if let Some(&number) = self.numbers.get(text) {
            return number;
        }
        let number = self.all.len() as u32;
        self.all.push(form());
        self.numbers.insert(text.into(), number);
        number
    }
}

impl Remarks {
    fn number(&mut self, text: &str) -> u32 {
        if let Some(&number) = self.numbers.get(text) {
            return number;
        }
        let (number, text) = (self.all.len() as u32, Arc::<str>::from(text));
        self.all.push(text.clone());
        self.numbers.insert(text, number);
        number
    }
}

/// Declares the fields of a line that most lines lack: as they are in a remark, and as text.
macro_rules! remarks {
    ($($field:ident: $type:ty),* $(,)?) => {
        /// All fields of a line that most lines lack.
        #[derive(Default, Serialize, Deserialize)]
        #[serde(default)]
        struct Remark<'e> {
            $(
                #[serde(skip_serializing_if = "is_default")]
                $field: Cow<'e, $type>,
            )*
        }

        impl<'e> Remark<'e> {
            fn of(entry: &'e JournalEntry) -> Self {
                Self { $($field: Cow::Borrowed(&entry.$field),)* }
            }

            fn applied_to(self, entry: JournalEntry) -> JournalEntry {
                JournalEntry { $($field: self.$field.into_owned(),)* ..entry }
            }
        }

        /// A line whose fields are not parsed, if they are likely to equal the fields of other lines.
        #[derive(Deserialize)]
        struct RawLine<'l> {
            scene: Option<u32>,
            attempt: Option<u32>,
            outcome: Option<&'l str>,
            views: Option<u32>,
            objects: Option<u32>,
            manifest: Option<Digest>,
            #[serde(borrow)]
            writers: Option<&'l RawValue>,
            #[serde(borrow)]
            recorded: Option<&'l RawValue>,
            #[serde(borrow)]
            component: Option<&'l RawValue>,
            #[serde(borrow)]
            assets: Option<&'l RawValue>,
            $(
                #[serde(borrow)]
                $field: Option<&'l RawValue>,
            )*
        }

        impl RawLine<'_> {
            /// Writes the remark, as `serde_json` writes it.
            fn write_remark(&self, text: &mut String) {
                text.push('{');
                $(
                    if let Some(value) = self.$field {
                        let comma = if text.len() > 1 { "," } else { "" };
                        let _ = write!(text, concat!("{}\"", stringify!($field), "\":{}"), comma, value.get());
                    }
                )*
                text.push('}');
            }
        }
    };
}

remarks! {
    notices: std::collections::BTreeSet<crate::run::dataset::journal::notice::Notice>,
    odd_views: BTreeMap<crate::run::dataset::journal::notice::Notice, Vec<u32>>,
    poses: crate::run::dataset::draws::PoseDraws,
    choices: BTreeMap<String, Vec<u32>>,
    left_out: Vec<crate::run::dataset::loss::Loss>,
    stale: bool,
    errors: Vec<String>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The text of a form.
struct RawForm<'l> {
    outcome: &'l str,
    writers: &'l str,
    recorded: &'l str,
    component: &'l str,
}

impl RawForm<'_> {
    fn write(&self, text: &mut String) {
        let Self { outcome, writers, recorded, component } = self;
        let _ = write!(text, "{outcome} {writers} {recorded} {component}");
    }
}

fn text<'l>(value: Option<&'l RawValue>, missing: &'static str) -> &'l str {
    value.map_or(missing, RawValue::get)
}

/// Collects the lines of a journal. Of several lines of a scene, the last one counts.
#[derive(Default)]
pub struct EntriesBuilder {
    lines: Vec<(u32, Packed)>,
    entries: Entries,
    form: String,
    remark: String,
}

impl EntriesBuilder {
    /// Adds a line. Returns its scene; `None` for a line of assets.
    pub fn add(&mut self, line: &[u8]) -> serde_json::Result<Option<u32>> {
        let Some((scene, packed)) = self.known(line) else { return self.add_parsed(line) };
        self.lines.push((scene, packed));
        Ok(Some(scene))
    }

    /// Reads a line whose form was parsed before, in another line, and that has no assets.
    fn known(&mut self, line: &[u8]) -> Option<(u32, Packed)> {
        let raw: RawLine = serde_json::from_slice(line).ok().filter(|raw: &RawLine| raw.assets.is_none())?;
        let form = RawForm {
            outcome: raw.outcome?,
            writers: text(raw.writers, "[]"),
            recorded: text(raw.recorded, "[]"),
            component: text(raw.component, "\"\""),
        };
        self.form.clear();
        form.write(&mut self.form);
        let form = *self.entries.forms.numbers.get(self.form.as_str())?;
        self.remark.clear();
        raw.write_remark(&mut self.remark);
        let remark = match self.entries.remarks.numbers.get(self.remark.as_str()) {
            Some(&number) => number,
            None => {
                serde_json::from_str::<Remark>(&self.remark).ok()?;
                self.entries.remarks.number(&self.remark)
            }
        };
        let (views, objects, manifest) = match self.entries.forms.all[form as usize].failed {
            true => (0, 0, no_manifest()),
            false => (raw.views?, raw.objects?, raw.manifest?),
        };
        Some((raw.scene?, Packed { attempt: raw.attempt?, views, objects, manifest, form, remark }))
    }

    fn add_parsed(&mut self, line: &[u8]) -> serde_json::Result<Option<u32>> {
        match parse(line)? {
            JournalLine::Assets { assets } => {
                self.entries.add_assets(&assets);
                Ok(None)
            }
            JournalLine::Scene(entry) => {
                let packed = self.entries.pack(&entry);
                self.lines.push((entry.scene, packed));
                self.entries.add_assets(&entry.assets);
                Ok(Some(entry.scene))
            }
        }
    }

    /// The collected scenes.
    pub fn build(self) -> Entries {
        let Self { mut lines, mut entries, .. } = self;
        // Stable: the last of equal scenes replaces the others. A sorted list makes a compact tree.
        lines.sort_by_key(|(scene, _)| *scene);
        entries.scenes = lines.into_iter().collect();
        entries
    }
}

/// A line of the journal.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum JournalLine {
    /// A finished scene.
    Scene(Box<JournalEntry>),
    /// The first line, which a run writes when it sorts the journal.
    Assets {
        /// Digests of all assets that were drawn for the scenes, by `pool/name`; `bad` for an unusable asset.
        assets: AssetDigests,
    },
}

/// Parses a line.
pub fn parse(line: &[u8]) -> serde_json::Result<JournalLine> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct OnlyAssets {
        assets: AssetDigests,
    }
    if let Ok(OnlyAssets { assets }) = serde_json::from_slice(line) {
        return Ok(JournalLine::Assets { assets });
    }
    serde_json::from_slice(line).map(|entry| JournalLine::Scene(Box::new(entry)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::draws::{Condition, PoseDraws};
    use crate::run::dataset::journal::Notice;
    use crate::run::dataset::loss::Loss;
    use std::collections::BTreeSet;

    /// Lines with each field, and with combinations of them.
    fn lines() -> Vec<JournalEntry> {
        let made = |scene: u32, writers: &[&str], recorded: &[&str]| {
            let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
            let (views, objects, manifest) = (scene % 7, 3 * scene, Digest::of(&scene.to_le_bytes()));
            let (writers, recorded) = (list(writers), list(recorded));
            JournalEntry::new(scene, scene % 3, SceneOutcome::Made { views, objects, writers, recorded, manifest })
        };
        let each = |scene: u32| {
            let plain = made(scene, &["coco", "png \"2\""], if scene.is_multiple_of(2) { &["masks"] } else { &[] });
            match scene % 10 {
                0 => JournalEntry { notices: BTreeSet::from([Notice::Black, Notice::Unlit]), ..plain },
                1 => JournalEntry { odd_views: BTreeMap::from([(Notice::White, vec![scene, scene + 1])]), ..plain },
                2 => {
                    let refused = BTreeMap::from([(Condition::Clearance, scene)]);
                    JournalEntry { poses: PoseDraws { drawn: 9 * scene, refused, unmet: vec![1] }, ..plain }
                }
                3 => JournalEntry { choices: BTreeMap::from([("lights[0]".to_owned(), vec![scene % 4; 5])]), ..plain },
                4 => JournalEntry { component: "bins \u{fc}".to_owned(), ..plain },
                5 => {
                    let (stage, what) = ("write.yolo".to_owned(), "objects lost a part".to_owned());
                    let left_out = vec![Loss { stage, what, count: scene.into(), of: 9, images: 1, help: None }];
                    JournalEntry { left_out, ..plain }
                }
                6 => {
                    let errors = vec![format!("a \"quoted\" reason\n{scene}"), "b".to_owned()];
                    JournalEntry { errors, ..JournalEntry::new(scene, 2, SceneOutcome::Failed) }
                }
                7 => JournalEntry { stale: true, component: "tables".to_owned(), ..plain },
                8 => made(scene, &[], &[]),
                _ => plain,
            }
        };
        (0..200).map(each).collect()
    }

    #[test]
    fn lines_come_back_as_they_were() {
        let lines = lines();
        let mut read = EntriesBuilder::default();
        for entry in &lines {
            let text = serde_json::to_string(entry).expect("plain data");
            assert_eq!(read.add(text.as_bytes()).expect("readable"), Some(entry.scene), "{text}");
        }
        for entries in [read.build(), lines.iter().collect()] {
            assert_eq!(entries.iter().map(|line| line.entry()).collect::<Vec<_>>(), lines);
            for (line, entry) in entries.iter().zip(&lines) {
                let same = (line.failed(), line.views(), line.writers(), line.recorded(), line.manifest());
                let own = (entry.failed(), entry.views(), entry.writers(), entry.recorded(), entry.manifest());
                assert_eq!(same, own);
                assert!(entries.has(entry) && line.has_remarks() == (entry.scene % 10 != 4 && entry.scene % 10 < 8));
            }
        }
    }

    /// A line that resembles an earlier one is read by another way. Both find the same faults.
    #[test]
    fn a_damaged_line_is_refused_wherever_it_stands() {
        let good = serde_json::to_string(&lines()[2]).expect("plain data");
        let mut refused = 0;
        for place in 0..good.len() {
            for bit in [1, 4, 16, 128] {
                let mut bad = good.clone().into_bytes();
                bad[place] ^= bit;
                let alone = EntriesBuilder::default().add(&bad);
                let mut after = EntriesBuilder::default();
                after.add(good.as_bytes()).expect("readable");
                let second = after.add(&bad);
                assert_eq!(alone.is_ok(), second.is_ok(), "{}", String::from_utf8_lossy(&bad));
                refused += u32::from(alone.is_err());
                if let (Ok(_), Ok(Some(scene)), Ok(JournalLine::Scene(entry))) = (&alone, &second, parse(&bad)) {
                    assert_eq!(after.build().get(*scene).map(|line| line.entry()), Some(*entry));
                }
            }
        }
        assert!(refused > 500, "{refused}");
    }

    #[test]
    fn assets_are_kept_once() {
        let digests = |names: &[&str]| names.iter().map(|name| ((*name).to_owned(), "00".to_owned())).collect();
        let mut read = EntriesBuilder::default();
        let [first, second] = [0, 9].map(|scene: usize| lines()[scene].clone());
        let first = JournalEntry { assets: digests(&["mugs/a", "mugs/b"]), ..first };
        for line in [
            serde_json::to_string(&JournalLine::Assets { assets: digests(&["mugs/c"]) }),
            serde_json::to_string(&first),
            serde_json::to_string(&JournalEntry { assets: digests(&["mugs/b", "mugs/d"]), ..second }),
        ] {
            read.add(line.expect("plain data").as_bytes()).expect("readable");
        }
        let entries = read.build();
        assert_eq!((entries.len(), entries.assets()), (2, &digests(&["mugs/a", "mugs/b", "mugs/c", "mugs/d"])));
        assert!(entries.has(&first));
        assert_eq!(entries.unknown(&digests(&["mugs/a", "mugs/e"])), digests(&["mugs/e"]));
    }
}
