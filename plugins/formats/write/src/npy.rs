//! NumPy files of numeric arrays.

use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::{self, Array, NpyArrays};
use syntable_formats::include::{self, Included, IncludedProducts};
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;

const EXTENSION: &str = "npy";
/// Suffix of the file name of instance ids.
const IDS_END: &str = "_ids";

/// Writes numeric arrays as NumPy files.
///
/// # Behavior
///
/// Stores values unchanged: images as `[height, width]` or `[height, width, channels]` in their own type, masks as
/// bool, numbers and lists of numbers as float64, int64 or uint64. A product per instance is one array with the
/// instances along the first axis; masks become `[N, height, width]`. `occlusion_order` is `[N, N]` of bool over the
/// annotated instances in id order: the row's object occludes the column's. The writer `jsonl` stores text and records.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.npy`. A product per instance has its instance ids, u16 in the same order, in
/// `{id}/{product}/{scene:06}_{view:04}_ids.npy`. A product of the scene is `{id}/{product}/{scene:06}.npy`. If
/// category ids are included, `{id}/categories.json` has their names in COCO's form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npy {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
}

impl Default for Npy {
    fn default() -> Self {
        Self { include: ["depth", "instance", "occlusion_order"].into() }
    }
}

impl Config for Npy {
    type Stage = dyn Writer;
    const KIND: &'static str = "npy";
    const EXAMPLE: &'static str = "include = [\"depth\", \"amodal_mask\", \"occlusion_order\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.writer())
    }
}

impl ProductWriter for Npy {
    fn include(&self) -> &Included {
        &self.include
    }

    fn accepts(key: &KeyId) -> Result<(), String> {
        accepts(key, npy::check)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        include::paths(of, EXTENSION, [&[""], &["", IDS_END]])
    }

    fn write(&self, included: &IncludedProducts) -> Result<()> {
        included.try_for_each(|product, key, value| {
            let save =
                |array: Array, end: &str| included.write(product, &format!("{end}.{EXTENSION}"), &array.encode());
            match npy::arrays(product, key, &value, included.shape)? {
                NpyArrays::One(array) => save(array, ""),
                NpyArrays::PerInstance { values, ids } => {
                    save(values, "")?;
                    save(ids, IDS_END)
                }
            }
        })
    }
}

register!(Npy);
