//! Options that every pool of assets has, whatever its source: which assets it holds, and how objects are scaled,
//! centered and weighed.

use crate::tables::asset_names::{class_of, names_of, names_of_list, of_key, patterns, warn_of_unknown};
use crate::tables::ids::ObjectIds;
use crate::tables::split::{PartSizes, SMALL_PART, Split, SplitPart};
use crate::text::suggest::did_you_mean;
use glob::Pattern;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::Log;
use syntable_model::error::{ConfigError, Error, Result};
use syntable_model::files::read_small;
use syntable_model::length_unit::LengthUnit;
use syntable_model::names::AssetPath;
use syntable_model::scene::{AssetClass, CatalogEntry};
use syntable_model::stage::{AssetLimits, AssetSource};
use syntable_toml_schema::{DisplayPath, Step};

/// A pool of assets: `[assets.<id>]`.
pub struct Pool {
    /// The kind of its source.
    pub kind: String,
    /// Its table in the recipe: `assets.objects`, or `mixture.tables.assets.objects`.
    pub table: String,
    /// Lists and loads assets.
    pub source: Box<dyn AssetSource>,
    /// Selects and transforms them.
    pub options: PoolOptions,
}

/// Options of every `[assets.<id>]` table, in addition to the options of its kind. No kind may have an option of the
/// same name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PoolOptions {
    /// Patterns of names to keep: `*` matches any characters, `?` one, `[ab]` one of several. Empty keeps all.
    pub include: Vec<String>,
    /// Patterns of names to leave out.
    pub exclude: Vec<String>,
    /// Text file of names to keep, one per line; `#` starts a comment.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub include_list: Option<AssetPath>,
    /// Text file of names to leave out, one per line; `#` starts a comment.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub exclude_list: Option<AssetPath>,
    /// Keeps one part of a random split into training, validation and test assets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<Split>,
    /// Classes of the objects: patterns of names by class, such as `{ mug = ["*mug*", "*cup*"], bowl = ["*bowl*"] }`. A
    /// class becomes the category of its objects, with an id of its own in annotation files. An object of no class keeps
    /// the category that its source gives, and is an `object` there; an object of two classes is an error.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub classes: BTreeMap<String, Vec<String>>,
    /// License of the assets, as an SPDX expression or name. It replaces the license that the source reads from its files.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub license: Option<String>,
    /// Unit of what the source takes for meters. If it is left out, a folder of meshes warns of objects that are longer than
    /// 2 m or shorter than 5 mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<LengthUnit>,
    /// Scale of the objects: a factor, or `{ longest_side_m = 0.2 }`.
    pub scale: Scale,
    /// Origin of the objects.
    pub center: Center,
    /// Mass of the objects: `{ kg = 0.3 }` each, or `{ density_kg_m3 = 800 }` times the volume of the mesh. Default:
    /// the mass from the source; where the source knows it, it grows with the cube of `scale`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<Mass>,
    /// TOML file with facts on single objects: a table per name or category with `mass_kg`, `density_kg_m3`, `friction` or
    /// `restitution`, such as `["024_bowl"]` and below it `mass_kg = 0.147`. It goes before `mass`, and a name before its category.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub properties: Option<AssetPath>,
    /// Numbers of the objects (`obj_id` of BOP) by exact name, such as `{ "024_bowl" = 24 }`, or a TOML or JSON file of such a
    /// table. `.syntable/catalogs/<pool>.json` of a dataset is such a file, too. An object that is not in the table keeps the
    /// number that its source states; without one it is an error. By default, objects have the numbers that the source
    /// states, or their places in the whole pool.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ids: Option<ObjectIds>,
    /// Number of the first object; all objects of the pool are numbered from it in the order of their names, before anything
    /// is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub first_id: Option<u32>,
    /// Leaves out models of several disconnected parts.
    pub single_part_only: bool,
    /// Limits of one asset; one that would take more is left out as a bad one.
    #[serde(skip_serializing_if = "is_default")]
    pub limits: AssetLimits,
}

fn is_default(limits: &AssetLimits) -> bool {
    *limits == AssetLimits::default()
}

impl Default for PoolOptions {
    fn default() -> Self {
        Self {
            include: Vec::new(),
            exclude: Vec::new(),
            include_list: None,
            exclude_list: None,
            split: None,
            classes: BTreeMap::new(),
            license: None,
            units: None,
            scale: Scale::Factor(1.0),
            center: Center::Bounds,
            mass: None,
            properties: None,
            ids: None,
            first_id: None,
            single_part_only: false,
            limits: AssetLimits::default(),
        }
    }
}

/// Scale of the objects of a pool.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
#[schemars(rename = "ObjectScale")]
pub enum Scale {
    /// A factor; 0.001 converts millimeters to meters.
    Factor(#[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e6))] f64),
    /// Each object is scaled to a size.
    Size {
        /// Length of the longest side of each object's bounding box, meters.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1000))]
        longest_side_m: f64,
    },
}

impl Scale {
    /// Whether it states the size, which then does not depend on the file.
    pub fn is_size(self) -> bool {
        matches!(self, Self::Size { .. })
    }

    /// The factor for an object whose bounding box has a longest side of that length, meters.
    pub fn factor(self, longest_m: f64) -> f64 {
        match self {
            Self::Factor(factor) => factor,
            Self::Size { longest_side_m } => longest_side_m / longest_m,
        }
    }
}

/// Mass of the objects of a pool.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "ObjectMass")]
pub enum Mass {
    /// Mass of each object, kg.
    Kg(#[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e5))] f64),
    /// Density, kg/m³: mass is density times the volume of the mesh.
    DensityKgM3(#[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e5))] f64),
}

/// Known properties of an object: one table of the file that `properties` names.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectProperties {
    /// Mass at the size that the pool gives the object, kg.
    pub mass_kg: Option<f64>,
    /// Density, kg/m³, over the volume of the mesh; only without `mass_kg`.
    pub density_kg_m3: Option<f64>,
    /// Coulomb friction coefficient.
    pub friction: Option<f64>,
    /// Coefficient of restitution.
    pub restitution: Option<f64>,
}

impl ObjectProperties {
    /// These properties. Where they are silent, others hold, such as the properties of the category.
    pub fn or(self, other: Self) -> Self {
        let states_mass = self.mass_kg.is_some() || self.density_kg_m3.is_some();
        Self {
            mass_kg: if states_mass { self.mass_kg } else { other.mass_kg },
            density_kg_m3: if states_mass { self.density_kg_m3 } else { other.density_kg_m3 },
            friction: self.friction.or(other.friction),
            restitution: self.restitution.or(other.restitution),
        }
    }

    /// The key of a value that makes no sense, and why.
    fn invalid(&self) -> Option<(&'static str, String)> {
        let above_0 = |key, value: Option<f64>, high: f64| {
            let value = value.filter(|value| !(*value > 0.0 && *value <= high))?;
            Some((key, format!("{value} is not above 0 and at most {high}")))
        };
        let from_0 = |key, value: Option<f64>, high: f64| {
            let value = value.filter(|value| !(0.0..=high).contains(value))?;
            Some((key, format!("{value} is not within 0 and {high}")))
        };
        let both = self.mass_kg.is_some() && self.density_kg_m3.is_some();
        above_0("mass_kg", self.mass_kg, 1e5)
            .or_else(|| above_0("density_kg_m3", self.density_kg_m3, 1e5))
            .or_else(|| from_0("friction", self.friction, 10.0))
            .or_else(|| from_0("restitution", self.restitution, 1.0))
            .or_else(|| both.then(|| ("density_kg_m3", "`mass_kg` says the mass already".to_owned())))
    }
}

/// Origin of an object.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Center {
    /// The center of the axis-aligned bounding box.
    #[default]
    Bounds,
    /// The center of the bounding box's bottom.
    Bottom,
    /// The origin of the file.
    None,
}

/// The entries of a source that a pool takes.
#[derive(Debug, Default)]
pub struct Selection {
    /// The assets that stages draw from, in the order of the source.
    pub entries: Vec<CatalogEntry>,
    /// The other parts of the split, in the order of the source; empty without a split.
    pub other_parts: Vec<(CatalogEntry, SplitPart)>,
}

impl PoolOptions {
    /// Options that apply to objects alone, not to materials or environment maps.
    pub const FOR_OBJECTS: [&'static str; 9] =
        ["classes", "units", "scale", "center", "mass", "properties", "ids", "first_id", "single_part_only"];

    /// States the defaults that depend on other options.
    pub(crate) fn state_defaults(&mut self) {
        if let Some(split) = &mut self.split {
            split.state_defaults();
        }
    }

    /// Whether an option applies to assets of a class.
    pub fn applies(option: &str, class: AssetClass) -> bool {
        class == AssetClass::Object || !Self::FOR_OBJECTS.contains(&option)
    }

    /// The factor for an object whose bounding box has a longest side of that length in the file: unit and scale.
    pub fn factor(&self, longest: f64) -> f64 {
        let meters = self.units.map_or(1.0, LengthUnit::meters);
        meters * self.scale.factor(longest * meters)
    }

    /// Refuses options that contradict each other.
    pub(crate) fn validate(&self) -> std::result::Result<(), ConfigError> {
        patterns("include", &self.include)?;
        patterns("exclude", &self.exclude)?;
        self.class_patterns()?;
        if let (Some(_), Some(_)) = (&self.ids, self.first_id) {
            return Err(ConfigError::new("first_id", "`ids` numbers the objects already").help("remove one of them"));
        }
        if let (Some(_), Scale::Size { .. }) = (self.units, self.scale) {
            return Err(ConfigError::new("units", "`longest_side_m` sets the size whatever the unit")
                .help("remove `units`, or give `scale` as a factor"));
        }
        self.split.as_ref().map_or(Ok(()), |split| split.sizes().map(drop))
    }

    /// The tables of the file of properties, by name or category. Warns of names that the source does not have.
    pub fn properties(&self, entries: &[CatalogEntry], log: &dyn Log) -> Result<BTreeMap<String, ObjectProperties>> {
        let Some(file) = &self.properties else { return Ok(BTreeMap::new()) };
        let bytes = read_small(file.path()).map_err(|error| Error::io(file.path(), &error))?;
        let help = "write a table per object: [\"024_bowl\"] and below it mass_kg = 0.147";
        let text = String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to() as u64;
            Error::new("the table of properties is not UTF-8 text").in_file(file.path()).at_byte(at)
        })?;
        let table: BTreeMap<String, ObjectProperties> = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            Error::new(format!("line {line}: {}", error.message())).in_file(file.path()).help(help)
        })?;
        for (name, properties) in &table {
            if let Some((key, problem)) = properties.invalid() {
                return Err(Error::new(format!("`{name}`: `{key}`: {problem}")).in_file(file.path()));
            }
        }
        let classes = self.classes.keys().map(String::as_str);
        let named = entries.iter().flat_map(|entry| [entry.name.as_str(), entry.category.as_str()]);
        let known: BTreeSet<&str> = named.chain(classes).collect();
        let unknown: Vec<&str> = table.keys().map(String::as_str).filter(|name| !known.contains(name)).collect();
        if !unknown.is_empty() {
            log.warn(
                &Error::new(format!("the pool has no asset and no category of these names: {}", unknown.join(", ")))
                    .in_file(file.path())
                    .help(names_of(entries)),
            );
        }
        Ok(table)
    }

    /// Warns of patterns and of names of lists that no asset of the source has: they select or leave out nothing.
    pub fn warn_of_unmatched(&self, entries: &[CatalogEntry], log: &dyn Log) -> Result<()> {
        // A source without assets is a separate mistake.
        if entries.is_empty() {
            return Ok(());
        }
        let known: BTreeSet<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
        for (key, list) in [("include", &self.include), ("exclude", &self.exclude)] {
            let compiled = patterns(key, list).map_err(of_key)?;
            for ((index, text), pattern) in list.iter().enumerate().zip(compiled) {
                if !known.iter().any(|name| pattern.matches(name)) {
                    let near = did_you_mean(text, known.iter().copied());
                    let near = if near.is_empty() { near } else { near + " " };
                    log.warn(
                        &Error::new(format!("{key}[{index}] = \"{text}\" matches no asset"))
                            .help(format!("{near}patterns match whole names; {}", names_of(entries))),
                    );
                }
            }
        }
        for (key, list) in [("include_list", &self.include_list), ("exclude_list", &self.exclude_list)] {
            let Some(list) = list else { continue };
            let names: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
            warn_of_unknown(key, list, &names_of_list(list)?, &known, &names, log);
        }
        Ok(())
    }

    /// The entries of a source that the pool takes, in their order. Reads the lists, and warns of small parts of a
    /// split.
    pub fn select(&self, entries: Vec<CatalogEntry>, log: &dyn Log) -> Result<Selection> {
        let read = |list: &Option<AssetPath>| list.as_ref().map(names_of_list).transpose();
        let (wanted, unwanted) = (read(&self.include_list)?, read(&self.exclude_list)?);
        let compiled =
            || Ok((patterns("include", &self.include)?, patterns("exclude", &self.exclude)?, self.class_patterns()?));
        let (include, exclude, classes) = compiled().map_err(of_key)?;
        let keep = |name: &str| {
            let any = |patterns: &[Pattern]| patterns.iter().any(|pattern| pattern.matches(name));
            (include.is_empty() || any(&include))
                && !any(&exclude)
                && wanted.as_ref().is_none_or(|list| list.contains(name))
                && !unwanted.as_ref().is_some_and(|list| list.contains(name))
        };
        let kept = entries.into_iter().filter(|entry| keep(&entry.name));
        let kept = kept.map(|entry| {
            let class = class_of(&classes, &entry.name)?.map(str::to_owned);
            Ok(CatalogEntry { category: class.unwrap_or(entry.category), ..entry })
        });
        let kept = kept.collect::<Result<Vec<CatalogEntry>>>()?;
        let Some(split) = &self.split else { return Ok(Selection { entries: kept, other_parts: Vec::new() }) };
        let names: Vec<&str> = kept.iter().map(|entry| entry.name.as_str()).collect();
        let parts = split.parts(&names, log)?;
        let mut selection = Selection::default();
        for (entry, part) in kept.into_iter().zip(parts) {
            if part == split.part {
                selection.entries.push(entry);
            } else {
                selection.other_parts.push((entry, part));
            }
        }
        if let Some(sizes) = self.part_sizes(&selection)
            && (1..SMALL_PART).contains(&sizes.kept())
        {
            let few = format!("{sizes}: fewer than {SMALL_PART}");
            log.warn(&Error::new(few).help(
                "scores on so few shapes say little of unseen objects: set `val_count` and `test_count`, or name the \
                 assets in `val_list` and `test_list`; `syntable list assets RECIPE` shows the parts",
            ));
        }
        Ok(selection)
    }

    /// Number of assets of each part; none without a split.
    pub fn part_sizes(&self, selection: &Selection) -> Option<PartSizes> {
        let part = self.split.as_ref()?.part;
        let mut sizes = [0; 3];
        sizes[part as usize] = selection.entries.len();
        selection.other_parts.iter().for_each(|(_, part)| sizes[*part as usize] += 1);
        Some(PartSizes { part, sizes })
    }

    /// The patterns of each class.
    fn class_patterns(&self) -> std::result::Result<Vec<(&str, Vec<Pattern>)>, ConfigError> {
        let mut classes = Vec::new();
        for (class, list) in &self.classes {
            let key = format!("classes.{}", DisplayPath(&[Step::Key(class.clone())]));
            if class.trim().is_empty() {
                return Err(ConfigError::new(key, "a class needs a name"));
            }
            classes.push((class.as_str(), patterns(&key, list)?));
        }
        Ok(classes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    /// Matches by trying everything, to compare with.
    fn brute(pattern: &[u8], name: &[u8]) -> bool {
        match (pattern.first(), name.first()) {
            (None, None) => true,
            (Some(b'*'), _) => brute(&pattern[1..], name) || (!name.is_empty() && brute(pattern, &name[1..])),
            (Some(b'?'), Some(_)) => brute(&pattern[1..], &name[1..]),
            (Some(p), Some(n)) if p == n => brute(&pattern[1..], &name[1..]),
            _ => false,
        }
    }

    fn matches(pattern: &str, name: &str) -> bool {
        patterns("include", &[pattern.to_owned()]).expect("a pattern")[0].matches(name)
    }

    #[test]
    fn patterns_match_as_by_trying_everything() {
        let mut stream = syntable_model::random::Stream::root(4);
        let mut word = |letters: &[u8]| -> String {
            let length = stream.below(7);
            (0..length).map(|_| char::from(letters[stream.below(letters.len() as u64) as usize])).collect()
        };
        let mut hits = 0;
        for _ in 0..5_000 {
            let (pattern, name) = (word(b"ab./*?"), word(b"ab./"));
            let expected = brute(pattern.as_bytes(), name.as_bytes());
            assert_eq!(matches(&pattern, &name), expected, "{pattern} on {name}");
            hits += u32::from(expected);
        }
        assert!(hits > 100, "the patterns must match now and then: {hits}");
        assert!(matches("Überseeische*", "Überseeische_Tasse") && matches("T*sse", "Tässe"));
        assert!(matches("T?sse", "Tasse") && matches("T?sse", "Tässe"), "one character");
        assert!(matches("mug_[12]", "mug_2") && matches("a[*]", "a*"));
    }

    #[test]
    fn a_broken_pattern_is_named() {
        let options = PoolOptions { exclude: vec!["a".into(), "mug_[1".into()], ..Default::default() };
        let invalid = options.validate().expect_err("the bracket is not closed");
        assert_eq!(invalid.key, "exclude[1]");
        assert!(invalid.message.contains("mug_[1"), "{}", invalid.message);
    }

    fn entries(names: impl IntoIterator<Item = String>) -> Vec<CatalogEntry> {
        names.into_iter().map(|name| CatalogEntry::new(name, "")).collect()
    }

    fn split(part: SplitPart) -> Split {
        Split {
            part,
            val_fraction: None,
            test_fraction: None,
            val_count: None,
            test_count: None,
            val_list: None,
            test_list: None,
            seed: 0,
        }
    }

    /// The selection, and the warnings.
    fn selected(options: PoolOptions, names: impl IntoIterator<Item = String>) -> (Selection, Vec<String>) {
        let log = Collected::default();
        options.validate().expect("sound");
        let selection = options.select(entries(names), &log).expect("sound");
        (selection, log.warnings().iter().map(ToString::to_string).collect())
    }

    #[test]
    fn counts_are_exact_and_lists_are_what_they_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let list = folder.path().join("val.txt");
        std::fs::write(&list, "mug_03\nmug_07\nno_such\n").expect("written");
        let names = || (0..12).map(|i| format!("mug_{i:02}"));
        let kept = |split: Split| {
            let (selection, warnings) = selected(PoolOptions { split: Some(split), ..Default::default() }, names());
            (selection.entries.into_iter().map(|entry| entry.name).collect::<Vec<_>>(), warnings)
        };
        for seed in 0..20 {
            let of = |part| kept(Split { val_count: Some(5), test_count: Some(2), seed, ..split(part) });
            let parts = [SplitPart::Train, SplitPart::Val, SplitPart::Test].map(of);
            assert_eq!(parts.each_ref().map(|(names, _)| names.len()), [5, 5, 2], "seed {seed}");
            let mut all: Vec<&String> = parts.iter().flat_map(|(names, _)| names).collect();
            all.sort();
            assert_eq!(all.into_iter().cloned().collect::<Vec<_>>(), names().collect::<Vec<_>>());
            assert_eq!(parts.each_ref().map(|(_, warnings)| warnings.len()), [0, 0, 1]);
            let want = "2 of 12 assets, part `test` (train 5, val 5, test 2): fewer than 5";
            assert!(parts[2].1[0].starts_with(want), "{}", parts[2].1[0]);
        }
        let val = || Split { val_list: Some(AssetPath(list.clone())), ..split(SplitPart::Val) };
        let (listed, warnings) = kept(val());
        assert_eq!(listed, ["mug_03", "mug_07"]);
        assert!(warnings[0].contains("split.val_list: the pool has no asset of these names: no_such"), "{warnings:?}");
        let (rest, _) = kept(Split { part: SplitPart::Train, ..val() });
        assert!(rest.len() == 10 && !rest.contains(&"mug_03".to_owned()));
        // Contradictory options are refused.
        let refused = |split: Split| {
            let options = PoolOptions { split: Some(split), ..Default::default() };
            let log = Collected::default();
            let invalid = options.validate().map_err(|invalid| invalid.message);
            invalid
                .and_then(|()| options.select(entries(names()), &log).map_err(|error| error.to_string()))
                .expect_err("")
        };
        let mixed = refused(Split { val_count: Some(3), ..val() });
        assert_eq!(mixed, "`val_count` and `val_list` give sizes in two ways");
        let many = refused(Split { val_count: Some(9), test_count: Some(4), ..split(SplitPart::Val) });
        assert!(many.contains("9 assets for validation and 4 for the test are needed, but the pool has 12"), "{many}");
        let twice = refused(Split { test_list: Some(AssetPath(list.clone())), ..val() });
        assert!(twice.contains("`mug_03` is in `val_list` and in `test_list`"), "{twice}");
    }

    #[test]
    fn parts_of_a_split_cover_the_pool_and_are_disjoint() {
        let names: Vec<String> = (0..4000).map(|i| format!("mug_{i:04}")).collect();
        let select = |part, seed| {
            let split = Split { val_fraction: Some(0.2), test_fraction: Some(0.1), seed, ..split(part) };
            selected(PoolOptions { split: Some(split), ..Default::default() }, names.clone()).0.entries
        };
        let parts = [SplitPart::Train, SplitPart::Val, SplitPart::Test].map(|part| select(part, 0));
        let mut all: Vec<String> = parts.iter().flatten().map(|entry| entry.name.clone()).collect();
        all.sort();
        assert_eq!(all, names);
        // Binomial: five standard deviations are at most 5·√(4000·0.7·0.3) ≈ 145.
        for (part, expected) in parts.iter().zip([2800_usize, 800, 400]) {
            assert!(part.len().abs_diff(expected) < 145, "{} of {expected}", part.len());
        }
        assert_ne!(select(SplitPart::Val, 0), select(SplitPart::Val, 1));
    }

    #[test]
    fn lists_and_patterns_select() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let list = folder.path().join("names.txt");
        std::fs::write(&list, "\u{feff}# bad ones\nmug_1 # two handles\n\n  can_2\r\n").expect("written");
        let options = PoolOptions {
            include: vec!["mug_*".into(), "can_?".into()],
            exclude: vec!["*_3".into()],
            exclude_list: Some(AssetPath(list)),
            ..Default::default()
        };
        let names = ["mug_1", "mug_2", "mug_3", "can_1", "can_2", "can_10", "box_1"].map(str::to_owned);
        let kept: Vec<String> = selected(options, names).0.entries.into_iter().map(|entry| entry.name).collect();
        assert_eq!(kept, ["mug_2", "can_1"]);
    }

    #[test]
    fn classes_are_the_categories_of_what_their_patterns_match() {
        let classes = |list: &[(&str, &[&str])]| {
            let classes =
                list.iter().map(|(class, of)| ((*class).to_owned(), of.iter().map(|&p| p.to_owned()).collect()));
            PoolOptions { classes: classes.collect(), ..Default::default() }
        };
        let given = || {
            let entry = |name: &str| CatalogEntry::new(name, "source");
            ["blue_mug", "cup", "soup_bowl", "spoon"].map(entry).to_vec()
        };
        let options = classes(&[("mug", &["*mug*", "cup"]), ("bowl", &["*bowl"]), ("unseen", &["zebra"])]);
        let log = Collected::default();
        let selection = options.select(given(), &log).expect("sound");
        let categories: Vec<String> = selection.entries.into_iter().map(|entry| entry.category).collect();
        assert_eq!(categories, ["mug", "mug", "bowl", "source"]);
        let twice =
            classes(&[("dish", &["*"]), ("mug", &["*mug*"])]).select(given(), &log).expect_err("ambiguous").to_string();
        let want = "`blue_mug` is of two classes: `*` of `dish` and `*mug*` of `mug` match it";
        assert!(twice.starts_with(want), "{twice}");
        // Two patterns of one class do not conflict.
        assert!(classes(&[("mug", &["*mug*", "blue*"])]).select(given(), &log).is_ok());
        let invalid = classes(&[("a b", &["ok", "[1"])]).validate().expect_err("the bracket is not closed");
        assert_eq!(invalid.key, "classes.\"a b\"[1]");
        let invalid = classes(&[(" ", &["ok"])]).validate().expect_err("no name");
        assert!(invalid.message.contains("needs a name"), "{}", invalid.message);
    }

    #[test]
    fn units_multiply_the_scale() {
        let options = |units, scale| PoolOptions { units, scale, ..Default::default() };
        assert_eq!(options(None, Scale::Factor(2.0)).factor(5.0), 2.0);
        assert_eq!(options(Some(LengthUnit::Cm), Scale::Factor(2.0)).factor(5.0), 0.02);
        assert!((options(Some(LengthUnit::Ft), Scale::Factor(1.0)).factor(1.0) - 12.0 * 0.0254).abs() < 1e-12);
        let size = Scale::Size { longest_side_m: 0.5 };
        assert_eq!(options(None, size).factor(5.0), 0.1);
        assert_eq!(options(Some(LengthUnit::Mm), size).validate().expect_err("contradict").key, "units");
    }

    #[test]
    fn a_table_of_properties_is_checked() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("properties.toml");
        let options = PoolOptions { properties: Some(AssetPath(file.clone())), ..Default::default() };
        let read = |text: &str| {
            std::fs::write(&file, text).expect("written");
            let log = Collected::default();
            let table = options.properties(&entries(["024_bowl".to_owned()]), &log);
            (table, log.warnings().iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        let (table, warnings) = read("[024_bowl]\nmass_kg = 0.147\nfriction = 0.4\n[mug]\ndensity_kg_m3 = 900\n");
        let table = table.expect("sound");
        assert_eq!((table["024_bowl"].mass_kg, table["024_bowl"].friction), (Some(0.147), Some(0.4)));
        assert_eq!(table["mug"].density_kg_m3, Some(900.0));
        assert!(
            warnings.len() == 1 && warnings[0].contains("of these names: mug (") && warnings[0].contains("`024_bowl`"),
            "{warnings:?}"
        );
        for (text, wanted) in [
            ("[024_bowl]\nmass_kg = -1", "mass_kg"),
            ("[024_bowl]\nmass_kg = nan", "mass_kg"),
            ("[024_bowl]\nfriction = 11", "friction"),
            ("[024_bowl]\nmass_kg = 1\ndensity_kg_m3 = 1", "density_kg_m3"),
            ("\n[024_bowl]\nmas_kg = 1", "mas_kg"),
            ("024_bowl = 1", "line 1"),
        ] {
            let error = read(text).0.expect_err(text).to_string();
            assert!(error.contains(wanted) && error.contains("properties.toml"), "{text}: {error}");
        }
    }

    #[test]
    fn a_missing_list_is_named() {
        let options = PoolOptions { include_list: Some(AssetPath("/no/such/list.txt".into())), ..Default::default() };
        let error = options.select(Vec::new(), &Collected::default()).expect_err("no such file").to_string();
        assert!(error.contains("/no/such/list.txt"), "{error}");
    }
}
