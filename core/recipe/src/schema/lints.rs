//! House rules for registered kinds: documentation, names, units, limits, examples and schemas.
//!
//! Tests run [`lints`] over a registry, the program's own as well as a plugin's.

use crate::schema::kinds::Schemas;
use crate::tables::alternatives::{ONE_OF, has_alternatives};
use serde_json::Value as Json;
use syntable_model::registry::{ConstructError, Entry, Registry, Shape};
use syntable_toml_schema::{DisplayPath, Outcome, plain_members};

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

/// Checks all kinds of a registry. Returns one line per breach; none if all is well.
pub fn lints(registry: &Registry) -> Vec<String> {
    let schemas = Schemas::of(registry);
    let kinds = registry.entries().iter().flat_map(|entry| of_entry(entry, &schemas));
    schemas.faults.iter().cloned().chain(kinds).collect()
}

fn of_entry(entry: &Entry, schemas: &Schemas) -> Vec<String> {
    let mut faults = Vec::new();
    let place = format!("`{}.{}` of the crate {}", entry.slot, entry.kind, entry.crate_name);
    let mut fault = |message: String| faults.push(format!("{place}: {message}"));
    let Some(kind) = schemas.kind(entry.slot, entry.kind) else {
        fault("it has no schema".into());
        return faults;
    };
    if !is_snake_case(entry.kind) {
        fault("the kind is not snake_case".into());
    }
    if text(&kind.options, "description").is_none() {
        fault("the kind has no doc comment".into());
    }
    if kind.options.get("additionalProperties") != Some(&Json::Bool(false)) {
        fault("unknown options are accepted; add #[serde(deny_unknown_fields)]".into());
    }
    let mut walk = Walk { schemas, seen: Vec::new(), faults: Vec::new() };
    for (name, option) in properties(&kind.options) {
        if schemas.is_shared_option(entry.slot, name) {
            continue;
        }
        let is_key = match name.as_str() {
            "kind" => true,
            "id" => entry.slot.shape() == Shape::List,
            ONE_OF => has_alternatives(entry.slot),
            _ => false,
        };
        if is_key {
            fault(format!("`{name}` is a key of the recipe itself; call the option otherwise"));
        }
        walk.option(name, name, option, false);
        if is_distribution(resolve(option, schemas))
            && option.get("maximum").is_none()
            && let Some(message) = refuses_large(entry, name)
        {
            fault(format!("option `{name}` has limits that its schema does not state: {message}"));
        }
    }
    walk.faults.into_iter().for_each(&mut fault);
    example(entry, &kind.options, schemas, &mut fault);
    for (old, new) in entry.renamed {
        if find(&kind.options, old, schemas).is_some() {
            fault(format!("the renamed option `{old}` is still there"));
        }
        if find(&kind.options, new, schemas).is_none() {
            fault(format!("`{old}` was renamed to `{new}`, which is no option"));
        }
    }
    faults
}

/// Why a kind refuses a distribution that is always very large, if it does so for the option's sake.
fn refuses_large(entry: &Entry, option: &str) -> Option<String> {
    let mut table: toml::Table = toml::from_str(entry.example).ok()?;
    table.insert(option.to_owned(), i64::MAX.into());
    match entry.construct_str(&table.to_string()) {
        Err(ConstructError::Invalid(invalid)) if invalid.key == option => Some(invalid.message),
        _ => None,
    }
}

/// Checks that the example builds, that it survives writing and reading, and that no path has a default.
fn example(entry: &Entry, schema: &Json, schemas: &Schemas, fault: &mut impl FnMut(String)) {
    let validate = |options: &toml::Table| schemas.validator().table(entry.kind, plain_members(options), 0..0, schema);
    match entry.construct_str(entry.example) {
        Err(error) => fault(format!("the example does not build: {error:?}")),
        Ok(constructed) => {
            let Outcome { findings, .. } = validate(&constructed.options);
            for finding in findings {
                let path = DisplayPath(&finding.path);
                fault(format!("the schema refuses the example with its defaults: {path}: {}", finding.message));
            }
            match entry.construct_str(&constructed.options.to_string()) {
                Ok(again) if again.options == constructed.options => {}
                Ok(_) => fault("the example changes when it is written and read".into()),
                Err(error) => fault(format!("the example cannot be read back: {error:?}")),
            }
        }
    }
    if entry.construct_str(&format!("no_such_option = 1\n{}", entry.example)).is_ok() {
        fault("an unknown option is accepted; add #[serde(deny_unknown_fields)]".into());
    }
    if let Ok(default) = entry.construct_str("") {
        for reference in validate(&default.options).references.iter().filter(|reference| reference.what == "path") {
            fault(format!("a path has the default \"{}\"; make the option required or optional", reference.text));
        }
    }
}

/// Visits options, and the options inside them, once per definition.
struct Walk<'s> {
    schemas: &'s Schemas,
    seen: Vec<&'s str>,
    faults: Vec<String>,
}

impl<'s> Walk<'s> {
    fn option(&mut self, path: &str, name: &str, option: &'s Json, documented: bool) {
        if !is_snake_case(name) {
            self.faults.push(format!("option `{path}` is not snake_case"));
        }
        if !documented && text(option, "description").is_none() && text(option, "const").is_none() {
            self.faults.push(format!("option `{path}` has no doc comment"));
        }
        let numeric = self.is_numeric(option);
        if let Some(suffixes) = wanted_suffixes(name).filter(|_| numeric)
            && !suffixes.iter().any(|suffix| name.ends_with(suffix))
        {
            self.faults.push(format!("option `{path}` has a dimension; end its name in {}", suffixes.join(" or ")));
        }
        if is_unlimited(self.resolve(option)) {
            self.faults.push(format!("option `{path}` is a number without limits; state its range in the schema"));
        }
        self.inside(path, option);
    }

    /// Visits the options inside a value: of tables, of alternatives, of elements.
    fn inside(&mut self, path: &str, schema: &'s Json) {
        if let Some(target) = schema.get("$ref").and_then(Json::as_str) {
            let name = target.trim_start_matches("#/definitions/");
            // A distribution is one value with several spellings, documented as a whole.
            if self.seen.contains(&name) || is_distribution(self.resolve(schema)) {
                return;
            }
            self.seen.push(name);
        }
        let target = self.schemas.validator().target(schema);
        if is_distribution(target) {
            return;
        }
        // The table of an enum's variant has one key, and the variant's documentation.
        let variant = properties(target).count() == 1 && text(target, "description").is_some();
        for (name, option) in properties(target) {
            let path = format!("{path}.{name}");
            self.option(&path, name, option, variant);
        }
        for keyword in ["allOf", "anyOf", "oneOf", "items"] {
            for part in target.get(keyword).and_then(Json::as_array).into_iter().flatten() {
                self.inside(path, part);
            }
        }
        for keyword in ["items", "additionalProperties"] {
            if let Some(part) = target.get(keyword).filter(|part| part.is_object()) {
                self.inside(path, part);
            }
        }
    }

    /// Follows `$ref`, and `allOf` of one.
    fn resolve(&self, option: &'s Json) -> &'s Json {
        resolve(option, self.schemas)
    }

    /// Whether an option is a number, a distribution of numbers, or an array of them.
    fn is_numeric(&self, option: &'s Json) -> bool {
        let schema = self.resolve(option);
        let is = |name: &str| match schema.get("type") {
            Some(Json::String(one)) => one == name,
            Some(Json::Array(several)) => several.iter().any(|other| other == name),
            _ => false,
        };
        if is("array") {
            return match schema.get("items") {
                Some(Json::Array(each)) => each.iter().all(|item| self.is_numeric(item)),
                Some(all) => self.is_numeric(all),
                None => false,
            };
        }
        is("number") || (is("integer") && is("object"))
    }
}

fn resolve<'s>(option: &'s Json, schemas: &'s Schemas) -> &'s Json {
    let option = schemas.validator().target(option);
    match option.get("allOf").and_then(Json::as_array).map(Vec::as_slice) {
        Some([one]) => schemas.validator().target(one),
        _ => option,
    }
}

/// The option at a dotted path, through tables, elements and alternatives.
fn find<'s>(schema: &'s Json, path: &str, schemas: &'s Schemas) -> Option<&'s Json> {
    let schema = schemas.validator().target(schema);
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    if let Some(option) = schema.get("properties").and_then(|properties| properties.get(name)) {
        return match rest {
            Some(rest) => find(option, rest, schemas),
            None => Some(option),
        };
    }
    let lists = ["allOf", "anyOf", "oneOf"].into_iter().filter_map(|keyword| schema.get(keyword)?.as_array());
    let parts = lists.flatten().chain(["items", "additionalProperties"].into_iter().filter_map(|key| schema.get(key)));
    parts.filter(|part| part.is_object()).find_map(|part| find(part, path, schemas))
}

fn properties(schema: &Json) -> impl Iterator<Item = (&String, &Json)> {
    schema.get("properties").and_then(Json::as_object).into_iter().flatten()
}

/// Whether a schema is a single number without a limit of its own. Unsigned integers have the limit 0.
fn is_unlimited(schema: &Json) -> bool {
    let limits = ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "enum", "const"];
    matches!(schema.get("type").and_then(Json::as_str), Some("number" | "integer"))
        && !limits.iter().any(|limit| schema.get(limit).is_some())
}

/// Whether a schema is a number or a table that describes how to draw one.
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
