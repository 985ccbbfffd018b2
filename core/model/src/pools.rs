//! Pools that a stage draws from, as a recipe names them.

use crate::names::{EnvironmentPool, MaterialPool, ObjectPool, PoolName};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use syntable_toml_schema::KEY_REFERENCE;

/// Maximum weight of a pool, and of other choices by weight.
pub const MAX_WEIGHT: f64 = 1e9;

/// Pools to draw assets from: the name of one, a list of names, or a table of weights.
///
/// An asset of a list is uniform over all entries of all its pools, so that a large pool is drawn from more often. With
/// weights, such as `{ gso = 0.5, household = 0.5 }`, the pool is drawn in proportion to its weight, then the asset
/// uniformly within the pool. [`Assets`](crate::context::Assets) draws.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "Form", bound = "P: PoolName")]
pub struct Pools<P>(Choice<P>);

/// Pools of objects.
pub type ObjectPools = Pools<ObjectPool>;
/// Pools of materials.
pub type MaterialPools = Pools<MaterialPool>;
/// Pools of environment maps.
pub type EnvironmentPools = Pools<EnvironmentPool>;

#[derive(Debug, Clone, PartialEq)]
enum Choice<P> {
    One(P),
    All(Vec<P>),
    /// Sorted by name; no weight is negative, and not all are zero.
    Weighted(Vec<(P, f64)>),
}

/// The forms in a recipe.
#[derive(Deserialize)]
#[serde(untagged)]
enum Form {
    One(String),
    All(Vec<String>),
    Weighted(BTreeMap<String, f64>),
}

impl<P: PoolName> Pools<P> {
    /// Pools to draw from by weight. Refuses weights that are negative, above 10⁹ or not finite, and weights that are all
    /// zero.
    pub fn weighted(weights: impl IntoIterator<Item = (P, f64)>) -> Result<Self, String> {
        let mut weights: Vec<(P, f64)> = weights.into_iter().collect();
        weights.sort_by(|(one, _), (other, _)| one.as_str().cmp(other.as_str()));
        if let Some((pool, weight)) = weights.iter().find(|(_, weight)| !(0.0..=MAX_WEIGHT).contains(weight)) {
            return Err(format!("the weight {weight} of `{}` is not within 0 and {MAX_WEIGHT:e}", pool.as_str()));
        }
        if weights.iter().all(|(_, weight)| *weight == 0.0) {
            return Err("no pool has a weight above 0, so nothing can be drawn".to_owned());
        }
        Ok(Self(Choice::Weighted(weights)))
    }

    /// Probability that a draw takes one certain asset of a pool, by pool. `size` gives the number of assets of each pool.
    pub fn probabilities(&self, size: impl Fn(&str) -> usize) -> BTreeMap<String, f64> {
        let groups = self.groups();
        let count = |pools: &[&str]| pools.iter().map(|pool| size(pool)).sum::<usize>();
        let total: f64 = groups.iter().filter(|(_, pools)| count(pools) > 0).map(|(weight, _)| weight).sum();
        let mut probabilities = BTreeMap::new();
        for (weight, pools) in groups.iter().filter(|(_, pools)| count(pools) > 0) {
            let each = weight / total / count(pools) as f64;
            pools.iter().for_each(|pool| *probabilities.entry((*pool).to_owned()).or_default() += each);
        }
        probabilities
    }

    /// Names of the pools.
    pub fn names(&self) -> Vec<&str> {
        self.groups().into_iter().flat_map(|(_, names)| names).collect()
    }

    /// Names of the pools that are drawn from together, in groups, each with its weight. A group is drawn in proportion
    /// to its weight, then an entry uniformly over all entries of its pools. Without weights, all pools form one group.
    pub(crate) fn groups(&self) -> Vec<(f64, Vec<&str>)> {
        match &self.0 {
            Choice::One(pool) => vec![(1.0, vec![pool.as_str()])],
            Choice::All(pools) => vec![(1.0, pools.iter().map(P::as_str).collect())],
            Choice::Weighted(weights) => {
                let drawn = weights.iter().filter(|(_, weight)| *weight > 0.0);
                drawn.map(|(pool, weight)| (*weight, vec![pool.as_str()])).collect()
            }
        }
    }
}

impl<P: PoolName> From<Vec<P>> for Pools<P> {
    fn from(pools: Vec<P>) -> Self {
        Self(Choice::All(pools))
    }
}

impl<P: PoolName> From<&str> for Pools<P> {
    fn from(pool: &str) -> Self {
        Self(Choice::One(pool.to_owned().into()))
    }
}

impl<P: PoolName> TryFrom<Form> for Pools<P> {
    type Error = String;

    fn try_from(form: Form) -> Result<Self, String> {
        match form {
            Form::One(pool) => Ok(Self(Choice::One(pool.into()))),
            Form::All(pools) if pools.is_empty() => Err("the list of pools must not be empty".to_owned()),
            Form::All(pools) => Ok(Self(Choice::All(pools.into_iter().map(P::from).collect()))),
            Form::Weighted(weights) => Self::weighted(weights.into_iter().map(|(pool, weight)| (pool.into(), weight))),
        }
    }
}

impl<P: PoolName> Serialize for Pools<P> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Choice::One(pool) => serializer.serialize_str(pool.as_str()),
            Choice::All(pools) => serializer.collect_seq(pools.iter().map(P::as_str)),
            Choice::Weighted(weights) => {
                serializer.collect_map(weights.iter().map(|(pool, weight)| (pool.as_str(), weight)))
            }
        }
    }
}

impl<P: PoolName> JsonSchema for Pools<P> {
    fn schema_name() -> Cow<'static, str> {
        format!("{}s", P::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let pool = generator.subschema_for::<P>();
        json_schema!({
            "description": "Pools to draw from: the name of one, such as `\"gso\"`; a list of names, drawn uniformly over \
                            all their entries; or weights, such as `{ gso = 0.5, household = 0.5 }`: the pool is drawn by \
                            weight, then the asset uniformly within it.",
            "anyOf": [
                pool,
                { "type": "array", "items": pool, "minItems": 1 },
                {
                    "type": "object", "minProperties": 1, KEY_REFERENCE: P::REFERENCE,
                    "additionalProperties": {
                        "description": "Weight of the pool.", "type": "number", "minimum": 0, "maximum": MAX_WEIGHT
                    }
                }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ObjectPools, String> {
        #[derive(Deserialize)]
        struct Table {
            from: ObjectPools,
        }
        toml::from_str(text).map(|table: Table| table.from).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn every_form_reads_and_writes_back() {
        for (text, json, groups) in [
            ("from = \"a\"", "\"a\"", vec![(1.0, vec!["a"])]),
            ("from = [\"b\", \"a\"]", "[\"b\",\"a\"]", vec![(1.0, vec!["b", "a"])]),
            (
                "from = { b = 2, a = 0.5, c = 0 }",
                "{\"a\":0.5,\"b\":2.0,\"c\":0.0}",
                vec![(0.5, vec!["a"]), (2.0, vec!["b"])],
            ),
        ] {
            let pools = read(text).expect(text);
            assert_eq!(pools.groups(), groups, "{text}");
            assert_eq!(serde_json::to_string(&pools).expect("serializes"), json);
        }
    }

    #[test]
    fn probabilities_match_a_single_draw() {
        let size = |pool: &str| if pool == "a" { 1 } else { 9 };
        let of = |text| read(text).expect("sound").probabilities(size);
        assert_eq!(of("from = \"b\""), BTreeMap::from([("b".to_owned(), 1.0 / 9.0)]));
        assert_eq!(of("from = [\"a\", \"b\"]"), ["a", "b"].map(|pool| (pool.to_owned(), 0.1)).into());
        let weighted = of("from = { a = 1, b = 3 }");
        assert_eq!((weighted["a"], weighted["b"]), (0.25, 0.75 / 9.0));
    }

    #[test]
    fn weights_that_draw_nothing_are_refused() {
        for (text, want) in [
            ("from = { a = -1, b = 2 }", "the weight -1 of `a` is not within 0 and 1e9"),
            ("from = { a = inf }", "the weight inf of `a` is not within 0 and 1e9"),
            ("from = { a = nan }", "the weight NaN of `a` is not within 0 and 1e9"),
            ("from = { a = 0, b = 0.0 }", "no pool has a weight above 0, so nothing can be drawn"),
            ("from = {}", "no pool has a weight above 0, so nothing can be drawn"),
            ("from = []", "the list of pools must not be empty"),
        ] {
            assert_eq!(read(text).expect_err(text), want);
        }
    }
}
