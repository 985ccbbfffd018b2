//! The JSON Schema of recipes, from the registry.
//!
//! Draft-07, in the shape that editors' TOML servers are precise with: a stage table is an open object with an enum on
//! `kind` and one `if`/`then` a kind, and the definition of each kind is closed and knows `kind` itself. In keyed slots
//! every kind is also a property name, so that typing `[write.` completes.
//!
//! A recipe that extends another one may leave out what it inherits. So what is required stands apart, under an `if` on
//! `extends`, and the definitions of kinds require nothing at their top level. Schemas that only add a demand say
//! `additionalProperties: true`, or strict editors would take them for closed.

use super::dataset::{DatasetTable, LockTable};
use super::pool::PoolOptions;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::registry::{Entry, Registry, Shape, Slot, Stage};
use syntable_model::scene::AssetClass;

/// The pattern of ids: they name folders and random streams.
pub(crate) const ID_PATTERN: &str = "^[A-Za-z0-9_-]+$";

/// Schemas of everything that a recipe may hold.
pub(crate) struct Schemas {
    /// What `$ref` refers to.
    pub definitions: Map<String, Json>,
    /// `[dataset]`.
    pub dataset: Json,
    /// `[lock]`.
    pub lock: Json,
    /// Options of every pool.
    pub pool: Json,
    /// Options of pools that a kind of source has itself, and which are its own affair then.
    own_pool_options: BTreeMap<&'static str, BTreeSet<String>>,
    /// Options of each kind, without `kind`; those of pools are among the sources' own.
    pub kinds: Vec<(Slot, &'static str, Json)>,
}

impl Schemas {
    /// Asks every kind of a registry for its schema.
    pub fn of(registry: &Registry) -> Self {
        let mut generator = SchemaSettings::draft07().into_generator();
        let dataset = options_of::<DatasetTable>(&mut generator);
        let lock = options_of::<LockTable>(&mut generator);
        let pool = options_of::<PoolOptions>(&mut generator);
        let mut own_pool_options = BTreeMap::new();
        let kinds = registry
            .entries()
            .iter()
            .map(|entry| {
                let mut options = entry.schema(&mut generator);
                transform(&mut generator, &mut options);
                let mut options = options.to_value();
                toml_only(&mut options);
                if entry.slot == Slot::Assets {
                    own_pool_options.insert(entry.kind, add_pool_options(&mut options, &pool));
                }
                (entry.slot, entry.kind, options)
            })
            .collect();
        let mut definitions = generator.take_definitions(true);
        definitions.values_mut().for_each(toml_only);
        definitions.sort_keys();
        Self { definitions, dataset, lock, pool, own_pool_options, kinds }
    }

    /// The options that the pool takes of a table of this kind of source, and not the source.
    pub fn pool_options(&self, kind: &str) -> impl Iterator<Item = &str> {
        let own = self.own_pool_options.get(kind);
        let all = self.pool["properties"].as_object().into_iter().flat_map(|properties| properties.keys());
        all.map(String::as_str).filter(move |name| !own.is_some_and(|own| own.contains(*name)))
    }

    /// The schema of a kind's options.
    pub fn kind(&self, slot: Slot, kind: &str) -> Option<&Json> {
        self.kinds.iter().find(|(s, k, _)| *s == slot && *k == kind).map(|(_, _, schema)| schema)
    }
}

fn options_of<T: JsonSchema>(generator: &mut SchemaGenerator) -> Json {
    let mut schema = T::json_schema(generator);
    transform(generator, &mut schema);
    let mut schema = schema.to_value();
    toml_only(&mut schema);
    schema
}

fn transform(generator: &mut SchemaGenerator, schema: &mut schemars::Schema) {
    for transform in generator.transforms_mut() {
        transform.transform(schema);
    }
}

/// Brings a schema into the form that suits TOML and its editors: no `null`, and one `enum` for a choice of words.
fn toml_only(schema: &mut Json) {
    match schema {
        Json::Object(object) => {
            if object.get("default") == Some(&Json::Null) {
                object.shift_remove("default");
            }
            if let Some(Json::Array(types)) = object.get_mut("type") {
                types.retain(|name| name != "null");
                if let [one] = types.as_slice() {
                    let one = one.clone();
                    object.insert("type".into(), one);
                }
            }
            for union in ["anyOf", "oneOf"] {
                if let Some(Json::Array(branches)) = object.get_mut(union) {
                    branches.retain(|branch| branch.get("type").and_then(Json::as_str) != Some("null"));
                    if branches.len() == 1 {
                        let branches = object.shift_remove(union).unwrap_or_default();
                        object.insert("allOf".into(), branches);
                    }
                }
            }
            merge_words(object);
            object.values_mut().for_each(toml_only);
        }
        Json::Array(items) => items.iter_mut().for_each(toml_only),
        _ => {}
    }
}

/// Turns a union of constant words into one `enum`: a wrong word is then told of precisely. What the words mean goes
/// into the description.
fn merge_words(schema: &mut Map<String, Json>) {
    let Some(branches) = schema.get("oneOf").and_then(Json::as_array) else { return };
    let (mut words, mut meanings) = (Vec::new(), Vec::new());
    for branch in branches {
        let of_branch: Vec<Json> = match (branch.get("const"), branch.get("enum").and_then(Json::as_array)) {
            (Some(word), None) => vec![word.clone()],
            (None, Some(several)) => several.clone(),
            _ => return,
        };
        for word in of_branch {
            let Some(text) = word.as_str() else { return };
            if let Some(meaning) = branch.get("description").and_then(Json::as_str) {
                meanings.push(format!("- `{text}`: {meaning}"));
            }
            words.push(word);
        }
    }
    let description = schema.get("description").and_then(Json::as_str).unwrap_or_default();
    let description = format!("{description}\n\n{}", meanings.join("\n"));
    schema.shift_remove("oneOf");
    schema.insert("type".into(), "string".into());
    schema.insert("enum".into(), words.into());
    schema.insert("description".into(), description.trim().into());
}

/// Adds the options of pools to those of a source. Gives the names that the source has itself, which are left alone.
fn add_pool_options(options: &mut Json, pool: &Json) -> BTreeSet<String> {
    let mut own = BTreeSet::new();
    let Some(properties) = object_at(options, "properties") else { return own };
    for (name, option) in pool["properties"].as_object().into_iter().flatten() {
        if properties.contains_key(name) {
            own.insert(name.clone());
        } else {
            properties.insert(name.clone(), option.clone());
        }
    }
    own
}

/// The object under a key, made if need be.
fn object_at<'j>(schema: &'j mut Json, key: &str) -> Option<&'j mut Map<String, Json>> {
    schema.as_object_mut()?.entry(key).or_insert_with(|| json!({})).as_object_mut()
}

/// The class of assets that a kind of source gives, as its example says.
pub(crate) fn class_of(entry: &Entry) -> Option<AssetClass> {
    match entry.construct_str(entry.example).ok()?.stage {
        Stage::Assets(source) => Some(source.class()),
        _ => None,
    }
}

/// The JSON Schema of recipes for all kinds of a registry. Equal registries give equal schemas, key order included.
pub fn schema(registry: &Registry) -> Json {
    let mut schemas = Schemas::of(registry);
    let mut definitions = std::mem::take(&mut schemas.definitions);
    for entry in registry.entries() {
        let Some(options) = schemas.kind(entry.slot, entry.kind) else { continue };
        definitions.insert(definition_name(entry), definition(entry, options, &schemas));
    }
    let mut properties = Map::new();
    properties.insert(
        "dataset".into(),
        without_required(described(&schemas.dataset, "What the dataset is called and how large it is.")),
    );
    for slot in Slot::ALL {
        properties.insert(slot.name().into(), slot_schema(registry, slot));
    }
    let paths = |description: &str| {
        json!({
            "description": description, "type": ["string", "array"], "items": { "type": "string" }
        })
    };
    properties.insert(
        "extends".into(),
        paths("Recipe, or recipes, that this one adds to and overrides; paths count from this file."),
    );
    properties
        .insert("remove".into(), paths("Inherited values to take away, such as \"write.npy\" or \"place.objects\"."));
    properties.insert(
        "set".into(),
        json!({
            "description": "Values to put at paths, such as \"place.objects.count\" = 5; for changes deep inside an extended recipe.",
            "type": "object", "additionalProperties": true
        }),
    );
    properties.insert(
        "lock".into(),
        described(&schemas.lock, "What a resolved recipe was made with; written by the program."),
    );
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "SynTable recipe",
        "description": "Declares a synthetic dataset for unseen-object amodal instance segmentation.",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "if": { "required": ["extends"], "additionalProperties": true },
        "then": { "additionalProperties": true },
        "else": whole(registry, &schemas),
        "definitions": definitions
    })
}

/// The schema as it is committed and printed: indented, ending in a newline.
pub fn schema_text(registry: &Registry) -> String {
    format!("{:#}\n", schema(registry))
}

fn definition_name(entry: &Entry) -> String {
    format!("{}.{}", entry.slot, entry.kind)
}

fn described(schema: &Json, description: &str) -> Json {
    let mut schema = schema.clone();
    if let Some(object) = schema.as_object_mut() {
        object.insert("description".into(), description.into());
    }
    schema
}

fn without_required(mut schema: Json) -> Json {
    if let Some(object) = schema.as_object_mut() {
        object.shift_remove("required");
    }
    schema
}

/// The closed definition of one kind, which knows `kind` and `id`.
fn definition(entry: &Entry, options: &Json, schemas: &Schemas) -> Json {
    let mut definition = without_required(options.clone());
    let class = (entry.slot == Slot::Assets).then(|| class_of(entry)).flatten();
    let of_pool = |option: &str| schemas.pool_options(entry.kind).any(|name| name == option);
    let mut properties = Map::new();
    properties
        .insert("kind".into(), json!({ "description": "The kind of stage.", "type": "string", "const": entry.kind }));
    if entry.slot.shape() == Shape::List {
        properties.insert("id".into(), id_schema());
    }
    if let Some(own) = object_at(&mut definition, "properties") {
        own.retain(|option, _| class.is_none_or(|class| !of_pool(option) || PoolOptions::applies(option, class)));
        properties.append(own);
        *own = properties;
    }
    if let (Ok(example), Some(object)) = (toml::from_str::<toml::Table>(entry.example), definition.as_object_mut()) {
        let mut table = Map::from_iter([("kind".to_owned(), Json::from(entry.kind))]);
        if let Ok(Json::Object(options)) = serde_json::to_value(example) {
            table.extend(options);
        }
        object.insert("examples".into(), json!([table]));
    }
    definition
}

fn id_schema() -> Json {
    json!({
        "description": "Names the step's random numbers; the kind by default, with _2, _3 … appended on repeats.",
        "type": "string", "pattern": ID_PATTERN
    })
}

fn slot_schema(registry: &Registry, slot: Slot) -> Json {
    let kinds: Vec<&str> = registry.of_slot(slot).map(|entry| entry.kind).collect();
    let branches: Vec<Json> = registry
        .of_slot(slot)
        .map(|entry| {
            json!({
                "if": { "properties": { "kind": { "const": entry.kind } }, "required": ["kind"] },
                "then": { "$ref": format!("#/definitions/{}", definition_name(entry)) }
            })
        })
        .collect();
    let mut properties = Map::new();
    properties.insert("kind".into(), json!({ "description": "The kind of stage.", "type": "string", "enum": kinds }));
    if slot.shape() == Shape::List {
        properties.insert("id".into(), id_schema());
    }
    let mut stage = json!({
        "description": slot.doc(), "type": "object", "properties": properties, "additionalProperties": true
    });
    if !branches.is_empty() {
        stage["allOf"] = branches.into();
    }
    match slot.shape() {
        Shape::One => stage,
        Shape::List => json!({ "description": slot.doc(), "type": "array", "items": stage }),
        Shape::Keyed => {
            let known: Map<String, Json> = registry
                .of_slot(slot)
                .map(|entry| {
                    (entry.kind.to_owned(), json!({ "$ref": format!("#/definitions/{}", definition_name(entry)) }))
                })
                .collect();
            json!({
                "description": slot.doc(), "type": "object", "propertyNames": { "pattern": ID_PATTERN },
                "properties": known, "additionalProperties": stage
            })
        }
    }
}

/// What a recipe that extends no other one must have.
fn whole(registry: &Registry, schemas: &Schemas) -> Json {
    let mut properties = Map::new();
    properties
        .insert("dataset".into(), json!({ "required": schemas.dataset["required"], "additionalProperties": true }));
    properties.insert("place".into(), json!({ "minItems": 1 }));
    properties.insert("write".into(), json!({ "minProperties": 1, "additionalProperties": true }));
    let required = |entry: &Entry| {
        let schema = schemas.kind(entry.slot, entry.kind)?;
        schema.get("required").cloned().filter(|keys| keys.as_array().is_some_and(|keys| !keys.is_empty()))
    };
    for slot in Slot::ALL {
        let branches: Vec<Json> = registry
            .of_slot(slot)
            .filter_map(|entry| {
                Some(json!({
                    "if": { "properties": { "kind": { "const": entry.kind } }, "required": ["kind"] },
                    "then": { "required": required(entry)?, "additionalProperties": true }
                }))
            })
            .collect();
        let mut stage = json!({ "required": ["kind"], "additionalProperties": true });
        if !branches.is_empty() {
            stage["allOf"] = branches.into();
        }
        let constraint = match slot.shape() {
            Shape::One => stage,
            Shape::List => json!({ "items": stage }),
            Shape::Keyed => {
                let known: Map<String, Json> = registry
                    .of_slot(slot)
                    .map(|entry| {
                        let mut needs = json!({ "additionalProperties": true });
                        needs.as_object_mut().into_iter().for_each(|needs| {
                            needs.extend(required(entry).map(|keys| ("required".to_owned(), keys)));
                        });
                        (entry.kind.to_owned(), needs)
                    })
                    .collect();
                json!({ "properties": known, "additionalProperties": stage })
            }
        };
        match properties.get_mut(slot.name()) {
            Some(Json::Object(object)) => object.extend(constraint.as_object().cloned().unwrap_or_default()),
            _ => {
                properties.insert(slot.name().into(), constraint);
            }
        }
    }
    json!({ "required": ["dataset", "place", "write"], "properties": properties, "additionalProperties": true })
}
