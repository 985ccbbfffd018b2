//! Schemas of options with several distributions, such as a position.

use schemars::{Schema, SchemaGenerator, json_schema};
use syntable_model::prelude::*;

/// The schema of `count` numbers or distributions within limits.
pub fn dist_list(generator: &mut SchemaGenerator, count: usize, [low, high]: [f64; 2]) -> Schema {
    let mut number = generator.subschema_for::<Dist>();
    number.insert("minimum".to_owned(), low.into());
    number.insert("maximum".to_owned(), high.into());
    json_schema!({ "type": "array", "items": number, "minItems": count, "maxItems": count })
}
