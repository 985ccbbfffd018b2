//! Splits of a pool into training, validation and test assets.

use crate::tables::asset_names::{names_of_list, of_key, warn_of_unknown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;
use syntable_model::context::Log;
use syntable_model::digest::Hasher;
use syntable_model::error::{ConfigError, Error, Result};
use syntable_model::names::AssetPath;

/// One part of a split of a pool into training, validation and test assets.
///
/// The sizes of the parts are fractions, counts or lists of names; the remaining assets are for training. Pools with
/// the same split but different parts share no asset.
///
/// Fractions: the part of an asset depends on its name and the seed alone, so it does not change when assets are added or
/// removed; the parts of a small pool can be far from the fractions. Counts are exact: they count the assets that `include`,
/// `exclude` and the lists of the pool leave, in a random order of the seed, so all recipes of a split need the same ones.
/// Lists name the assets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// The part to keep.
    pub part: SplitPart,
    /// Approximate fraction of the assets for validation; 0.1 if the split has neither counts nor lists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub val_fraction: Option<f64>,
    /// Approximate fraction of the assets for the final test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub test_fraction: Option<f64>,
    /// Number of assets for validation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub val_count: Option<u32>,
    /// Number of assets for the final test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test_count: Option<u32>,
    /// Text file of the names of the assets for validation, one per line; `#` starts a comment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub val_list: Option<AssetPath>,
    /// Text file of the names of the assets for the final test, one per line; `#` starts a comment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub test_list: Option<AssetPath>,
    /// Seed of fractions and counts.
    #[serde(default)]
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    pub seed: u64,
}

/// Fraction of the assets for validation, if a split gives neither it nor counts nor lists.
const DEFAULT_VAL_FRACTION: f64 = 0.1;

/// A part with fewer assets raises a warning: scores on so few shapes are scores of these shapes.
pub(crate) const SMALL_PART: usize = 5;

/// A part of a split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SplitPart {
    /// For training.
    Train,
    /// For validation.
    Val,
    /// For the final test.
    Test,
}

impl fmt::Display for SplitPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Train => "train",
            Self::Val => "val",
            Self::Test => "test",
        })
    }
}

/// How a split gives the sizes of its parts.
pub(crate) enum SplitSizes<'s> {
    Fractions { val: f64, test: f64 },
    Counts { val: usize, test: usize },
    Lists { val: Option<&'s AssetPath>, test: Option<&'s AssetPath> },
}

impl Split {
    /// The sizes, which are all fractions, all counts or all lists.
    pub(crate) fn sizes(&self) -> std::result::Result<SplitSizes<'_>, ConfigError> {
        let given = [
            ("val_fraction", self.val_fraction.is_some()),
            ("test_fraction", self.test_fraction.is_some()),
            ("val_count", self.val_count.is_some()),
            ("test_count", self.test_count.is_some()),
            ("val_list", self.val_list.is_some()),
            ("test_list", self.test_list.is_some()),
        ];
        let given: Vec<&str> = given.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect();
        let way = |name: &str| name.split_once('_').map(|(_, way)| way.to_owned());
        if let Some(other) = given.iter().find(|name| way(name) != way(given[0])) {
            let message = format!("`{}` and `{other}` give sizes in two ways", given[0]);
            return Err(ConfigError::new(format!("split.{other}"), message)
                .help("give fractions, counts or lists for both parts"));
        }
        Ok(match given.first().and_then(|name| way(name)).as_deref() {
            Some("count") => {
                let count = |count: Option<u32>| count.unwrap_or(0) as usize;
                SplitSizes::Counts { val: count(self.val_count), test: count(self.test_count) }
            }
            Some("list") => SplitSizes::Lists { val: self.val_list.as_ref(), test: self.test_list.as_ref() },
            _ => {
                let [val, test] =
                    [self.val_fraction.unwrap_or(DEFAULT_VAL_FRACTION), self.test_fraction.unwrap_or(0.0)];
                if val + test > 1.0 {
                    let message = format!("`val_fraction` {val} and `test_fraction` {test} add up to more than 1");
                    let refused = ConfigError::new("split", message);
                    return Err(match self.val_fraction {
                        Some(_) => refused,
                        None => refused.help(format!("`val_fraction` is {DEFAULT_VAL_FRACTION} unless it is given")),
                    });
                }
                SplitSizes::Fractions { val, test }
            }
        })
    }

    /// States the fractions that hold, so that a resolved recipe has them.
    pub(crate) fn state_defaults(&mut self) {
        if let Ok(SplitSizes::Fractions { val, test }) = self.sizes() {
            (self.val_fraction, self.test_fraction) = (Some(val), Some(test));
        }
    }

    /// A number of the name and the seed, uniform over all 64-bit numbers.
    fn hash(&self, name: &str) -> u64 {
        Hasher::new("split").bytes(&self.seed.to_le_bytes()).text(name).finish().short()
    }

    /// The part of each name. Reads the lists, and warns of names that they alone have.
    pub(crate) fn parts(&self, names: &[&str], log: &dyn Log) -> Result<Vec<SplitPart>> {
        match self.sizes().map_err(of_key)? {
            SplitSizes::Fractions { val, test } => {
                let part = |name: &&str| match (self.hash(name) >> 11) as f64 / (1_u64 << 53) as f64 {
                    at if at < test => SplitPart::Test,
                    at if at < test + val => SplitPart::Val,
                    _ => SplitPart::Train,
                };
                Ok(names.iter().map(part).collect())
            }
            SplitSizes::Counts { val, test } => {
                if val.saturating_add(test) > names.len() {
                    let message = format!(
                        "split: {val} assets for validation and {test} for the test are needed, but the pool has {}",
                        names.len()
                    );
                    return Err(Error::new(message).help("lower `val_count` or `test_count`, or select more assets"));
                }
                let mut order: Vec<usize> = (0..names.len()).collect();
                order.sort_by_key(|&index| (self.hash(names[index]), names[index]));
                let mut parts = vec![SplitPart::Train; names.len()];
                order.iter().take(test).for_each(|&index| parts[index] = SplitPart::Test);
                order.iter().skip(test).take(val).for_each(|&index| parts[index] = SplitPart::Val);
                Ok(parts)
            }
            SplitSizes::Lists { val, test } => {
                let read = |key: &str, list: Option<&AssetPath>| -> Result<BTreeSet<String>> {
                    let Some(list) = list else { return Ok(BTreeSet::new()) };
                    let listed = names_of_list(list)?;
                    let known: BTreeSet<&str> = names.iter().copied().collect();
                    warn_of_unknown(&format!("split.{key}"), list, &listed, &known, names, log);
                    Ok(listed)
                };
                let (val, test) = (read("val_list", val)?, read("test_list", test)?);
                if let Some(twice) = val.intersection(&test).next() {
                    let message = format!("split: `{twice}` is in `val_list` and in `test_list`");
                    return Err(Error::new(message).help("an asset is of one part: take it out of one list"));
                }
                let part = |name: &&str| match () {
                    () if test.contains(*name) => SplitPart::Test,
                    () if val.contains(*name) => SplitPart::Val,
                    () => SplitPart::Train,
                };
                Ok(names.iter().map(part).collect())
            }
        }
    }
}

/// Number of assets of each part of a split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartSizes {
    /// The part that the pool keeps.
    pub part: SplitPart,
    /// Number of assets for training, validation and the test.
    pub sizes: [usize; 3],
}

impl PartSizes {
    /// Number of assets of the part that the pool keeps.
    pub fn kept(&self) -> usize {
        self.sizes[self.part as usize]
    }
}

impl fmt::Display for PartSizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [train, val, test] = self.sizes;
        let (kept, all) = (self.kept(), train + val + test);
        write!(f, "{kept} of {all} assets, part `{}` (train {train}, val {val}, test {test})", self.part)
    }
}
