//! Lists the assets of a recipe with the probability of drawing each.

use super::AssetStore;
use super::open_pool::OpenPool;
use serde::ser::{Serialize, SerializeMap, SerializeStruct, Serializer};
use std::collections::BTreeMap;
use syntable_model::scene::{AssetClass, AssetRef, CatalogEntry};
use syntable_recipe::SplitPart;

/// An asset of a pool, as its catalog knows it. Serialized, it is the record of `syntable list assets RECIPE --json`:
/// `pool`, `name`, `class`, `category`, `obj_id`, `part`, `license`, and `draws`, a table of probabilities by option.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedAsset {
    /// Pool and name.
    pub asset: AssetRef,
    /// Class of the pool's assets.
    pub class: AssetClass,
    /// Category.
    pub category: String,
    /// Number of an object in every dataset of the recipe; none of materials and environment maps.
    pub obj_id: Option<u32>,
    /// The part that the asset belongs to; none if the pool has no split.
    pub part: Option<SplitPart>,
    /// License as the pool or its source states it; none if neither does.
    pub license: Option<String>,
    /// The options that can draw the asset, in the order of the recipe. Empty if the recipe draws from another part of
    /// the split.
    pub draws: Vec<Chance>,
}

/// Probability that an option draws an asset.
#[derive(Debug, Clone, PartialEq)]
pub struct Chance {
    /// The option, such as `place[2].from`.
    pub option: String,
    /// Probability that one draw of the option takes the asset, in (0, 1]. The probabilities of an option sum to 1 over
    /// all assets.
    pub probability: f64,
}

impl Serialize for ListedAsset {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut record = serializer.serialize_struct("asset", 8)?;
        record.serialize_field("pool", &self.asset.pool)?;
        record.serialize_field("name", &self.asset.name)?;
        record.serialize_field("class", &self.class)?;
        record.serialize_field("category", &self.category)?;
        record.serialize_field("obj_id", &self.obj_id)?;
        record.serialize_field("part", &self.part)?;
        record.serialize_field("license", &self.license)?;
        record.serialize_field("draws", &ByOption(&self.draws))?;
        record.end()
    }
}

struct ByOption<'c>(&'c [Chance]);

impl Serialize for ByOption<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_map(Some(self.0.len()))?;
        self.0.iter().try_for_each(|chance| table.serialize_entry(&chance.option, &chance.probability))?;
        table.end()
    }
}

impl AssetStore<'_> {
    /// The assets of all pools, sorted by pool and name, including the assets in other parts of splits. Loads nothing.
    pub fn listing(&self) -> Vec<ListedAsset> {
        let chances = self.chances();
        self.pools.iter().flat_map(|(id, pool)| pool.listing(id, chances.get(*id).map_or(&[], Vec::as_slice))).collect()
    }

    /// The probability of one asset for each option that draws from a pool, by pool. The assets of a pool are equally
    /// likely.
    fn chances(&self) -> BTreeMap<String, Vec<Chance>> {
        let size = |pool: &str| self.pools.get(pool).map_or(0, |pool| pool.selection.entries.len());
        let mut chances: BTreeMap<String, Vec<Chance>> = BTreeMap::new();
        for component in &self.components {
            let name = |pool: &str| component.pools.get(pool).map_or_else(|| pool.to_owned(), String::clone);
            for draw in &component.draws {
                for (pool, probability) in draw.pools.probabilities(|pool| size(&name(pool))) {
                    let option = component.table(&draw.option);
                    chances.entry(name(&pool)).or_default().push(Chance { option, probability });
                }
            }
        }
        chances
    }
}

impl OpenPool<'_> {
    /// The assets of the pool `id`, by name. `chances` apply to each asset that can be drawn.
    fn listing(&self, id: &str, chances: &[Chance]) -> Vec<ListedAsset> {
        let license = self.options.license.as_deref().or(self.source.license());
        let asset = |entry: &CatalogEntry, part, draws: &[Chance]| ListedAsset {
            asset: AssetRef { pool: id.to_owned(), name: entry.name.clone() },
            class: self.source.class(),
            category: entry.category.clone(),
            obj_id: entry.obj_id,
            part,
            license: license.map(str::to_owned),
            draws: draws.to_vec(),
        };
        let own = self.options.split.as_ref().map(|split| split.part);
        let drawn = self.selection.entries.iter().map(|entry| asset(entry, own, chances));
        let others = self.selection.other_parts.iter().map(|(entry, part)| asset(entry, Some(*part), &[]));
        let mut listing: Vec<ListedAsset> = drawn.chain(others).collect();
        listing.sort_by(|a, b| a.asset.cmp(&b.asset));
        listing
    }
}
