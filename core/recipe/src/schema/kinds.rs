//! The JSON Schema of recipes, from the registry.
//!
//! Draft-07. The definition of each kind is closed and knows `kind` itself. A stage table is the definition named after
//! its slot. It has the kinds twice: editors complete and hover from the list in `anyOf`, and a chain of
//! `if`/`then`/`else` on `kind` validates, so that a mistake is reported for the intended kind. In keyed slots every
//! kind is also a property name, so that typing `[write.` completes.
//!
//! A recipe that extends another recipe may leave out what it inherits. So requirements are separate, under an `if` on
//! `extends`, and the definitions of kinds require nothing at their top level; a table without `kind` may have the
//! options of all kinds of its slot. Schemas that only add a requirement state `additionalProperties: true`, because
//! strict editors would otherwise take them for closed.
//!
//! [`editor_schema`](crate::editor_schema) brings this schema into the form that editors read.

use crate::tables::alternatives::{MAX_WEIGHT, MIXTURE, OF_MIXTURE, ONE_OF, WEIGHT, has_alternatives};
use crate::tables::conditions::ViewOptions;
use crate::tables::dataset::{DatasetTable, LockTable};
use crate::tables::pool::PoolOptions;
use schemars::JsonSchema;
use serde_json::{Map, Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::registry::{Entry, Registry, Shape, Slot, Stage};
use syntable_model::scene::AssetClass;
use syntable_model::words::first_sentence;
use syntable_toml_schema::{SchemaBuilder, Validator, unsupported};

/// Pattern of ids, which name folders and random streams.
pub(crate) const ID_PATTERN: &str = "^[A-Za-z0-9_-]+$";

/// Schemas of everything that a recipe may hold.
pub(crate) struct Schemas {
    /// The targets of `$ref`.
    pub definitions: Map<String, Json>,
    /// `[dataset]`.
    pub dataset: Json,
    /// `[lock]`.
    pub lock: Json,
    /// Options of every pool, for any class of assets.
    pub pool: Json,
    /// Options of every `[views]` table.
    pub views: Json,
    /// All kinds.
    pub kinds: Vec<KindSchema>,
    /// Why plugins cannot be used, one line each.
    pub faults: Vec<String>,
}

/// The schema of one kind's table, without `kind`.
pub(crate) struct KindSchema {
    pub slot: Slot,
    pub kind: &'static str,
    /// Class of the assets that the kind gives, if it gives assets.
    pub class: Option<AssetClass>,
    /// Options of the kind. A source of assets also has the options of pools of its class, and a view sampler the options
    /// of views.
    pub options: Json,
}

impl Schemas {
    /// Collects the schemas of every kind of a registry.
    pub fn of(registry: &Registry) -> Self {
        let mut builder = SchemaBuilder::default();
        let dataset = builder.add(DatasetTable::json_schema);
        let lock = builder.add(LockTable::json_schema);
        let pool = builder.add(PoolOptions::json_schema);
        let views = builder.add(ViewOptions::json_schema);
        let mut faults = Vec::new();
        let mut kinds: Vec<KindSchema> = registry
            .entries()
            .iter()
            .map(|entry| {
                let options = builder.add(|generator| entry.schema(generator));
                KindSchema { slot: entry.slot, kind: entry.kind, class: class_of(entry), options }
            })
            .collect();
        let definitions = builder.definitions();
        for (kind, entry) in kinds.iter_mut().zip(registry.entries()) {
            let mut fault = |message: String| {
                faults.push(format!("`{}.{}` of the crate {}: {message}", entry.slot, entry.kind, entry.crate_name));
            };
            for keyword in unsupported(&kind.options, &definitions) {
                fault(format!("its schema has {keyword}"));
            }
            let (shared, of) = match kind.slot {
                Slot::Assets => (&pool, "pool"),
                Slot::Views => (&views, "[views] table"),
                _ => continue,
            };
            for name in add_shared_options(&mut kind.options, shared, kind.class) {
                fault(format!("its option `{name}` is an option of every {of} already"));
            }
        }
        Self { definitions, dataset, lock, pool, views, kinds, faults }
    }

    /// The validator of these schemas.
    pub fn validator(&self) -> Validator<'_> {
        Validator { definitions: &self.definitions }
    }

    /// Whether an option belongs to the pool rather than to its source.
    pub fn is_pool_option(&self, name: &str) -> bool {
        self.pool["properties"].get(name).is_some()
    }

    /// Whether an option belongs to all tables of a slot rather than to a kind.
    pub fn is_shared_option(&self, slot: Slot, name: &str) -> bool {
        match slot {
            Slot::Assets => self.is_pool_option(name),
            Slot::Views => self.views["properties"].get(name).is_some(),
            _ => false,
        }
    }

    /// The schema of a kind.
    pub fn kind(&self, slot: Slot, kind: &str) -> Option<&KindSchema> {
        self.kinds.iter().find(|schema| schema.slot == slot && schema.kind == kind)
    }
}

/// Adds the options that all tables of a slot share to the options of a kind; of pools, the options for a class. Returns
/// the names that both have.
fn add_shared_options(options: &mut Json, shared: &Json, class: Option<AssetClass>) -> Vec<String> {
    let Some(properties) = object_at(options, "properties") else { return Vec::new() };
    let mut both = Vec::new();
    for (name, option) in shared["properties"].as_object().into_iter().flatten() {
        if properties.contains_key(name) {
            both.push(name.clone());
        } else if class.is_none_or(|class| PoolOptions::applies(name, class)) {
            properties.insert(name.clone(), option.clone());
        }
    }
    both
}

/// The object under a key, created if it is missing.
fn object_at<'j>(schema: &'j mut Json, key: &str) -> Option<&'j mut Map<String, Json>> {
    schema.as_object_mut()?.entry(key).or_insert_with(|| json!({})).as_object_mut()
}

/// The class of assets that a kind of source gives, found from its example.
fn class_of(entry: &Entry) -> Option<AssetClass> {
    if entry.slot != Slot::Assets {
        return None;
    }
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
        let Some(kind) = schemas.kind(entry.slot, entry.kind) else { continue };
        definitions.insert(definition_name(entry), definition(entry, &kind.options));
    }
    for slot in Slot::ALL {
        definitions.insert(slot.name().into(), stage_schema(registry, &schemas, slot));
        if has_alternatives(slot) {
            add_alternatives(registry, &schemas, slot, &mut definitions);
        }
    }
    let mut properties = Map::new();
    properties
        .insert("dataset".into(), without_required(described(&schemas.dataset, "Name, seed and size of the dataset.")));
    for slot in Slot::ALL {
        properties.insert(slot.name().into(), section_schema(registry, slot));
    }
    let paths = |description: &str| {
        json!({
            "description": description, "type": ["string", "array"], "items": { "type": "string" }
        })
    };
    properties.insert(
        "extends".into(),
        paths(
            "Recipe, or recipes, that this one adds to and overrides: relative paths start from this file's folder, and \
             `builtin:quickstart` is a recipe of the program.",
        ),
    );
    properties
        .insert("remove".into(), paths("Inherited values to remove, such as \"write.npy\" or \"place.objects\"."));
    properties.insert(
        "set".into(),
        json!({
            "description": "Values by path, such as \"place.objects.count\" = 5; for changes deep inside an extended recipe.",
            "type": "object", "additionalProperties": true
        }),
    );
    definitions.insert(COMPONENT.into(), component_schema(&properties));
    properties.insert(
        MIXTURE.into(),
        json!({
            "description": "Recipes that make the scenes of one dataset. Each scene draws one of them by weight.",
            "type": "object",
            "additionalProperties": { "$ref": format!("#/definitions/{COMPONENT}") }
        }),
    );
    properties.insert(
        "lock".into(),
        described(&schemas.lock, "Versions and digests that a resolved recipe was made with; written by the program."),
    );
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "SynTable recipe",
        "description": "Declares a synthetic dataset for unseen-object amodal instance segmentation.",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "if": open(json!({ "anyOf": [open(json!({ "required": ["extends"] })), open(json!({ "required": [MIXTURE] }))] })),
        "then": { "additionalProperties": true },
        "else": whole(registry, &schemas),
        "definitions": definitions
    })
}

/// A component of a mixture, given the sections of a recipe.
fn component_schema(sections: &Map<String, Json>) -> Json {
    let mut properties = Map::new();
    properties.insert(WEIGHT.into(), weight_schema("Relative probability that this component makes a scene."));
    let own = sections.iter().filter(|(name, _)| !OF_MIXTURE.contains(&name.as_str()));
    properties.extend(own.map(|(name, section)| (name.clone(), section.clone())));
    json!({
        "description": "A recipe without `[dataset]` and writers, most often by `extends`.",
        "type": "object", "additionalProperties": false, "properties": properties
    })
}

/// The weight of a component or an alternative.
fn weight_schema(description: &str) -> Json {
    json!({ "description": description, "type": "number", "minimum": 0, "maximum": MAX_WEIGHT, "default": 1 })
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

/// Name of the definition of a component of a mixture.
const COMPONENT: &str = "component";

/// The closed definition of one kind, with `kind` and `id`.
fn definition(entry: &Entry, options: &Json) -> Json {
    let mut definition = without_required(options.clone());
    let mut properties = Map::new();
    let meaning = first_sentence(options["description"].as_str().unwrap_or_default());
    let meaning = format!("`{}`: {meaning}.", entry.kind);
    properties.insert("kind".into(), json!({ "description": meaning, "type": "string", "const": entry.kind }));
    if entry.slot.shape() == Shape::List {
        properties.insert("id".into(), id_schema());
    }
    if let Some(own) = object_at(&mut definition, "properties") {
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
        "description": "Seeds the step's random stream; the kind by default, with _2, _3 … appended on repeats.",
        "type": "string", "pattern": ID_PATTERN
    })
}

/// A reference to the definition of a kind.
fn kind_reference(entry: &Entry) -> Json {
    json!({ "$ref": format!("#/definitions/{}", definition_name(entry)) })
}

/// A table of any kind of a slot.
fn stage_schema(registry: &Registry, schemas: &Schemas, slot: Slot) -> Json {
    let kinds: Vec<&str> = registry.of_slot(slot).map(|entry| entry.kind).collect();
    let mut any_of: Vec<Json> = registry.of_slot(slot).map(kind_reference).collect();
    any_of.push(open(json!({})));
    let word = json!({ "description": "The kind of stage.", "type": "string", "enum": kinds });
    let unknown = json!({
        "if": open(json!({ "required": ["kind"] })),
        "then": open(json!({ "properties": { "kind": word } })),
        "else": inherited(registry, schemas, slot)
    });
    let mut judge = by_kind(registry.of_slot(slot).map(|entry| (entry.kind, kind_reference(entry))).collect(), unknown);
    if has_alternatives(slot) {
        let of = json!({ "$ref": format!("#/definitions/{slot}.{ONE_OF}") });
        any_of.insert(any_of.len() - 1, of.clone());
        judge = json!({ "if": open(json!({ "required": [ONE_OF] })), "then": of, "else": open(judge) });
    }
    let mut stage = json!({ "description": slot.doc(), "anyOf": any_of });
    if let (Some(stage), Json::Object(open)) = (stage.as_object_mut(), open(judge)) {
        stage.extend(open);
    }
    stage
}

/// Adds the definitions of a stage with alternatives, and of the alternatives of each kind.
fn add_alternatives(registry: &Registry, schemas: &Schemas, slot: Slot, definitions: &mut Map<String, Json>) {
    let name = |entry: &Entry| format!("{slot}.{ONE_OF}.{}", entry.kind);
    let reference = |entry: &Entry| json!({ "$ref": format!("#/definitions/{}", name(entry)) });
    for entry in registry.of_slot(slot) {
        let Some(kind) = schemas.kind(slot, entry.kind) else { continue };
        let mut alternative = definition(entry, &kind.options);
        if let Some(properties) = object_at(&mut alternative, "properties") {
            properties.shift_remove("id");
            let meaning = "Weight of the alternative: it is drawn in proportion to it.";
            properties.insert(WEIGHT.into(), weight_schema(meaning));
        }
        if let (Some(object), Some(required)) = (alternative.as_object_mut(), kind.options.get("required")) {
            object.insert("required".into(), required.clone());
        }
        definitions.insert(name(entry), alternative);
    }
    let kinds: Vec<&str> = registry.of_slot(slot).map(|entry| entry.kind).collect();
    let word = json!({ "description": "The kind of stage.", "type": "string", "enum": kinds });
    let mut needs_kind = open(json!({ "properties": { "kind": word } }));
    if let Some(object) = needs_kind.as_object_mut().filter(|_| !slot.has_default_kind()) {
        object.insert("required".into(), json!(["kind"]));
    }
    let mut any_of: Vec<Json> = registry.of_slot(slot).map(reference).collect();
    any_of.push(open(json!({})));
    let mut item = json!({ "description": slot.doc(), "anyOf": any_of });
    let judge = by_kind(registry.of_slot(slot).map(|entry| (entry.kind, reference(entry))).collect(), needs_kind);
    if let (Some(item), Json::Object(open)) = (item.as_object_mut(), open(judge)) {
        item.extend(open);
    }
    let mut properties = Map::new();
    if slot.shape() == Shape::List {
        properties.insert("id".into(), id_schema());
    }
    properties.insert(
        ONE_OF.into(),
        json!({
            "description": "Alternatives: a scene takes one of them, or a view if they are lights of views.",
            "type": "array", "minItems": 1, "items": item
        }),
    );
    definitions.insert(
        format!("{slot}.{ONE_OF}"),
        json!({ "type": "object", "properties": properties, "required": [ONE_OF], "additionalProperties": false }),
    );
}

/// A requirement for a table that may have any other options.
fn open(mut demand: Json) -> Json {
    if let Some(object) = demand.as_object_mut() {
        object.insert("type".into(), "object".into());
        object.insert("additionalProperties".into(), true.into());
    }
    demand
}

/// Chooses a schema by `kind`: a chain of `if`, `then` and `else` that ends in `otherwise`.
fn by_kind(branches: Vec<(&str, Json)>, otherwise: Json) -> Json {
    branches.into_iter().rev().fold(otherwise, |rest, (kind, then)| {
        let of_kind = json!({ "properties": { "kind": { "const": kind } }, "required": ["kind"] });
        json!({ "if": open(of_kind), "then": then, "else": open(rest) })
    })
}

/// A table that inherits its kind: it may have the options of all kinds of its slot.
fn inherited(registry: &Registry, schemas: &Schemas, slot: Slot) -> Json {
    let mut forms: BTreeMap<&str, Vec<(&Json, Json)>> = BTreeMap::new();
    for entry in registry.of_slot(slot) {
        let options = schemas.kind(slot, entry.kind).and_then(|kind| kind.options["properties"].as_object());
        for (name, option) in options.into_iter().flatten() {
            let known = forms.entry(name).or_default();
            if !known.iter().any(|(other, _)| *other == option) {
                let target = format!("#/definitions/{}/properties/{name}", definition_name(entry));
                known.push((option, json!({ "$ref": target })));
            }
        }
    }
    let mut properties = Map::new();
    if slot.shape() == Shape::List {
        properties.insert("id".into(), id_schema());
    }
    for (name, forms) in forms {
        let mut forms: Vec<Json> = forms.into_iter().map(|(_, reference)| reference).collect();
        let option = if forms.len() == 1 { forms.remove(0) } else { json!({ "anyOf": forms }) };
        properties.insert(name.to_owned(), option);
    }
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

/// The section of a slot.
fn section_schema(registry: &Registry, slot: Slot) -> Json {
    let stage = json!({ "$ref": format!("#/definitions/{slot}") });
    match slot.shape() {
        Shape::One => stage,
        Shape::List => json!({ "description": slot.doc(), "type": "array", "items": stage }),
        _ => {
            let known: Map<String, Json> =
                registry.of_slot(slot).map(|entry| (entry.kind.to_owned(), kind_reference(entry))).collect();
            let other = other_than(&known.keys().map(String::as_str).collect::<Vec<_>>());
            json!({
                "description": slot.doc(), "type": "object", "propertyNames": { "pattern": ID_PATTERN },
                "properties": known, "patternProperties": { other: stage }
            })
        }
    }
}

/// A pattern of all texts except some words of letters, digits and `_`. With `additionalProperties` instead, taplo
/// would complete the options of every kind in the table of one.
fn other_than(words: &[&str]) -> String {
    format!("^(?:{})", other_endings(&words.iter().copied().collect()))
}

/// The texts that are no ending of a word, after the letters that these endings have in common.
fn other_endings(endings: &BTreeSet<&str>) -> String {
    let mut next: BTreeMap<char, BTreeSet<&str>> = BTreeMap::new();
    for ending in endings {
        let mut letters = ending.chars();
        if let Some(first) = letters.next() {
            next.entry(first).or_default().insert(letters.as_str());
        }
    }
    if next.is_empty() {
        return ".".to_owned();
    }
    let mut forms = Vec::new();
    if !endings.contains("") {
        forms.push("$".to_owned());
    }
    forms.push(format!("[^{}]", next.keys().collect::<String>()));
    forms.extend(next.iter().map(|(letter, endings)| format!("{letter}(?:{})", other_endings(endings))));
    forms.join("|")
}

/// Requirements of a recipe that extends no other recipe.
fn whole(registry: &Registry, schemas: &Schemas) -> Json {
    let mut properties = Map::new();
    properties
        .insert("dataset".into(), json!({ "required": schemas.dataset["required"], "additionalProperties": true }));
    properties.insert("place".into(), json!({ "minItems": 1 }));
    properties.insert("write".into(), json!({ "minProperties": 1, "additionalProperties": true }));
    let required = |entry: &Entry| {
        let kind = schemas.kind(entry.slot, entry.kind)?;
        kind.options.get("required").cloned().filter(|keys| keys.as_array().is_some_and(|keys| !keys.is_empty()))
    };
    for slot in Slot::ALL {
        let demands = registry
            .of_slot(slot)
            .filter_map(|entry| Some((entry.kind, open(json!({ "required": required(entry)? })))));
        let demands: Vec<(&str, Json)> = demands.collect();
        let needs_kind = match (slot.has_default_kind(), has_alternatives(slot)) {
            (true, _) => json!({}),
            (false, true) => json!({
                "if": open(json!({ "required": [ONE_OF] })),
                "then": open(json!({})),
                "else": open(json!({ "required": ["kind"] }))
            }),
            (false, false) => json!({ "required": ["kind"] }),
        };
        let stage = by_kind(demands, open(needs_kind));
        let constraint = match slot.shape() {
            Shape::One => stage,
            Shape::List => json!({ "items": stage }),
            _ => {
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
