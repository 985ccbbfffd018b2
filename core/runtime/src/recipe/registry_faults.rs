//! House rules of registered kinds, for tests: every plugin's kinds are held to them by looping over the registry.

use super::check::Checker;
use super::schema::{Schemas, class_of};
use serde_json::Value as Json;
use syntable_model::names::REFERENCE;
use syntable_model::registry::{Entry, Registry, Slot};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Words that name a quantity, and the suffixes of its unit.
const QUANTITIES: [(&[&str], &[&str]); 9] = [
    (&["duration", "time", "timeout", "interval", "step"], &["_s", "_ms"]),
    (
        &[
            "radius",
            "height",
            "width",
            "length",
            "thickness",
            "clearance",
            "offset",
            "distance",
            "extent",
            "margin",
            "gap",
            "penetration",
            "displacement",
            "altitude",
            "diameter",
            "aperture",
            "wavelength",
        ],
        &["_m", "_mm", "_px", "_nm"],
    ),
    (&["angle", "rotation", "roll", "pitch", "yaw", "elevation", "azimuth", "tilt", "latitude", "fov"], &["_deg"]),
    (&["temperature"], &["_k"]),
    (&["illuminance"], &["_lx"]),
    (&["luminance"], &["_nits"]),
    (&["mass", "weight"], &["_kg"]),
    (&["density"], &["_kg_m3"]),
    (&["speed", "velocity"], &["_m_s", "_deg_s", "_rad_s"]),
];

/// All that is wrong with the kinds of a registry, one line each; none if all is well.
pub fn registry_faults(registry: &Registry) -> Vec<String> {
    let schemas = Schemas::of(registry);
    registry.entries().iter().flat_map(|entry| of_entry(entry, &schemas)).collect()
}

fn of_entry(entry: &Entry, schemas: &Schemas) -> Vec<String> {
    let mut faults = Vec::new();
    let place = format!("{}.{} of {}", entry.slot, entry.kind, entry.crate_name);
    let mut fault = |message: String| faults.push(format!("{place}: {message}"));
    let Some(schema) = schemas.kind(entry.slot, entry.kind) else {
        fault("has no schema".into());
        return faults;
    };
    if !is_snake_case(entry.kind) {
        fault("the kind is not snake_case".into());
    }
    if text(schema, "description").is_none() {
        fault("the kind has no doc comment".into());
    }
    if schema.get("additionalProperties") != Some(&Json::Bool(false)) {
        fault("unknown options are accepted; add #[serde(deny_unknown_fields)]".into());
    }
    let checker = Checker { definitions: &schemas.definitions };
    options(schema, "", &checker, entry.slot, schemas, &mut fault);
    if entry.slot == Slot::Assets && class_of(entry).is_none() {
        fault("the example does not build".into());
    }
    match entry.construct_str(entry.example) {
        Err(error) => fault(format!("the example does not build: {error:?}")),
        Ok(constructed) => {
            for line in breaches(&checker, entry, entry.example, schema) {
                fault(format!("the schema refuses the example: {line}"));
            }
            let written = constructed.options.to_string();
            for line in breaches(&checker, entry, &written, schema) {
                fault(format!("the schema refuses the example with its defaults: {line}"));
            }
            match entry.construct_str(&written) {
                Ok(again) if again.options == constructed.options => {}
                Ok(_) => fault("the example changes when it is written and read".into()),
                Err(error) => fault(format!("the example cannot be read back: {error:?}")),
            }
        }
    }
    if entry.construct_str("no_such_option = 1").is_ok() {
        fault("an unknown option is accepted; add #[serde(deny_unknown_fields)]".into());
    }
    if let Ok(default) = entry.construct_str("") {
        for reference in references(&checker, entry, &default.options.to_string(), schema) {
            if reference.what == "path" {
                fault(format!("a path has the default \"{}\"; make the option required or optional", reference.text));
            }
        }
    }
    faults
}

/// Options of a table, and of the tables inside.
fn options(
    schema: &Json,
    prefix: &str,
    checker: &Checker,
    slot: Slot,
    schemas: &Schemas,
    fault: &mut dyn FnMut(String),
) {
    let pool = schemas.pool["properties"].as_object();
    for (name, option) in schema.get("properties").and_then(Json::as_object).into_iter().flatten() {
        if slot == Slot::Assets && prefix.is_empty() && pool.is_some_and(|pool| pool.get(name) == Some(option)) {
            continue;
        }
        if slot == Slot::Assets && prefix.is_empty() && pool.is_some_and(|pool| pool.contains_key(name)) {
            let type_of = |option: &Json| resolved(option, checker).get("type").cloned();
            if pool.and_then(|pool| type_of(&pool[name])) != type_of(option) {
                fault(format!("`{name}` is an option of every pool, of another type; call it otherwise"));
            }
        }
        let whole = format!("{prefix}{name}");
        let reserved =
            name == "kind" || (name == "id" && slot == Slot::Place) || (name == "id" && slot == Slot::Lights);
        if reserved && prefix.is_empty() {
            fault(format!("`{name}` is the recipe's own key; call it otherwise"));
        }
        if !is_snake_case(name) {
            fault(format!("option `{whole}` is not snake_case"));
        }
        if text(option, "description").is_none() {
            fault(format!("option `{whole}` has no doc comment"));
        }
        let target = resolved(option, checker);
        if let Some(suffixes) = wanted_suffixes(name).filter(|_| is_numeric(target, checker))
            && !suffixes.iter().any(|suffix| name.ends_with(suffix))
        {
            fault(format!("option `{whole}` has a dimension; end its name in {}", suffixes.join(" or ")));
        }
        if target.get("properties").is_some() && text(target, REFERENCE).is_none() && !is_distribution(target) {
            options(target, &format!("{whole}."), checker, slot, schemas, fault);
        }
    }
}

fn resolved<'s>(option: &'s Json, checker: &Checker<'s>) -> &'s Json {
    let option = checker.target(option);
    match option.get("allOf").and_then(Json::as_array).map(Vec::as_slice) {
        Some([one]) => checker.target(one),
        _ => option,
    }
}

/// Numbers, distributions of numbers, and arrays of them.
fn is_numeric(schema: &Json, checker: &Checker) -> bool {
    let is = |name: &str| match schema.get("type") {
        Some(Json::String(one)) => one == name,
        Some(Json::Array(several)) => several.iter().any(|other| other == name),
        _ => false,
    };
    if is("array") {
        return match schema.get("items") {
            Some(Json::Array(each)) => each.iter().all(|item| is_numeric(resolved(item, checker), checker)),
            Some(all) => is_numeric(resolved(all, checker), checker),
            None => false,
        };
    }
    is("number") || (is("integer") && is("object"))
}

/// A number or a table that says how to draw one.
fn is_distribution(schema: &Json) -> bool {
    schema.get("type").is_some_and(Json::is_array)
}

/// Suffixes for a name whose last word, units apart, is a quantity.
fn wanted_suffixes(name: &str) -> Option<&'static [&'static str]> {
    let words: Vec<&str> = name.split('_').collect();
    QUANTITIES
        .iter()
        .find(|(quantities, suffixes)| {
            let bare = suffixes.iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name);
            let last = bare.rsplit('_').next().unwrap_or(bare);
            quantities.contains(&last) && !words.contains(&"per")
        })
        .map(|(_, suffixes)| *suffixes)
}

fn is_snake_case(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.contains("__")
        && !name.ends_with('_')
}

fn text<'s>(schema: &'s Json, key: &str) -> Option<&'s str> {
    schema.get(key).and_then(Json::as_str).filter(|text| !text.trim().is_empty())
}

fn breaches(checker: &Checker, entry: &Entry, body: &str, schema: &Json) -> Vec<String> {
    match DeTable::parse(body) {
        Ok(table) => {
            let found = checker.options(entry.kind, table.get_ref(), &(0..0), schema);
            found.drafts.into_iter().map(|draft| draft.message).collect()
        }
        Err(error) => vec![error.message().to_owned()],
    }
}

fn references(checker: &Checker, entry: &Entry, body: &str, schema: &Json) -> Vec<super::check::Reference> {
    let table = DeTable::parse(body).unwrap_or_else(|_| Spanned::new(0..0, DeTable::new()));
    let value = DeValue::Table(table.into_inner());
    match &value {
        DeValue::Table(table) => checker.options(entry.kind, table, &(0..0), schema).references,
        _ => Vec::new(),
    }
}
