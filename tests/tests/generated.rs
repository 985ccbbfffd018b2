//! Files that are made from the registry: the schema, the book's reference, the help texts. This test compares them
//! with fresh ones; `UPDATE=1 cargo test --release --package syntable-tests --test generated` refreshes them.

mod support;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use support::root;
use syntable_model::product::Scope;
use syntable_model::registry::{Entry, Registry, Shape, Slot};
use syntable_runtime::recipe::{self, Code};
use syntable_runtime::{cli, run};
use syntable_standard as _;

/// All generated files: path from the root of the checkout, and content.
fn generated() -> BTreeMap<String, String> {
    let registry = Registry::linked().expect("no clash");
    let schema = serde_json::to_string_pretty(&recipe::schema(&registry)).expect("plain data");
    let journal = schemars::generate::SchemaSettings::draft07()
        .into_generator()
        .into_root_schema_for::<run::journal::SceneRecord>();
    let journal = serde_json::to_string_pretty(&journal).expect("plain data");
    let log =
        schemars::generate::SchemaSettings::draft07().into_generator().into_root_schema_for::<run::progress::LogLine>();
    let log = serde_json::to_string_pretty(&log).expect("plain data");
    let mut files = BTreeMap::from([
        ("schemas/log.schema.json".to_owned(), log + "\n"),
        ("schemas/recipe.schema.json".to_owned(), schema + "\n"),
        ("schemas/journal.schema.json".to_owned(), journal + "\n"),
        ("book/src/reference/products.md".to_owned(), products(&registry)),
        ("book/src/reference/command-line.md".to_owned(), command_line()),
        ("book/src/reference/diagnostics.md".to_owned(), diagnostics()),
    ]);
    for slot in Slot::ALL {
        files.insert(format!("book/src/reference/{slot}.md"), slot_page(&registry, slot));
    }
    files
}

#[test]
fn generated_files_are_fresh() {
    let mut stale = Vec::new();
    for (path, content) in generated() {
        let full = root().join(&path);
        if fs::read_to_string(&full).ok().as_deref() == Some(content.as_str()) {
            continue;
        }
        if std::env::var_os("UPDATE").is_some() {
            fs::create_dir_all(full.parent().expect("in a folder")).expect("writable");
            fs::write(&full, content).expect("writable");
        } else {
            stale.push(path);
        }
    }
    assert!(
        stale.is_empty(),
        "stale: {}; refresh with UPDATE=1 cargo test --release --package syntable-tests --test generated",
        stale.join(", ")
    );
}

const MADE: &str =
    "<!-- Made from the registry: UPDATE=1 cargo test --release --package syntable-tests --test generated -->\n\n";

fn slot_page(registry: &Registry, slot: Slot) -> String {
    let header = match slot.shape() {
        Shape::One => format!("`[{slot}]`"),
        Shape::List => format!("`[[{slot}]]`"),
        Shape::Keyed => format!("`[{slot}.<id>]`"),
    };
    let mut page = format!("{MADE}# {header}\n\n{}\n\n", slot.doc());
    page += match slot.shape() {
        Shape::One => "One table. `kind` chooses among the kinds below.\n",
        Shape::List => {
            "An array of tables, in order. `kind` chooses among the kinds below; `id` names the step, which is what its \
             random numbers hang on (default: the kind).\n"
        }
        Shape::Keyed => {
            "Tables by id. The id is the kind, unless `kind` says otherwise: then the id can be any word that is not a kind.\n"
        }
    };
    for entry in registry.of_slot(slot) {
        page += &kind_section(entry);
    }
    page
}

fn kind_section(entry: &Entry) -> String {
    let mut generator = schemars::generate::SchemaSettings::draft07().into_generator();
    let schema = Value::from(entry.schema(&mut generator));
    let definitions: Map<String, Value> = generator.take_definitions(true);
    let mut section = format!("\n## `{}`\n\n{}\n", entry.kind, doc(&schema));
    let options = schema["properties"].as_object().cloned().unwrap_or_default();
    if !options.is_empty() {
        section += "\n| option | type | default | meaning |\n|---|---|---|---|\n";
    }
    let required: Vec<&str> = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    for (name, option) in &options {
        let default = match option.get("default") {
            _ if required.contains(&name.as_str()) => "required".to_owned(),
            None | Some(Value::Null) => "none".to_owned(),
            Some(default) => format!("`{}`", toml_like(default)),
        };
        let meaning = match doc(option) {
            text if text.is_empty() => doc(&resolve(option, &definitions)),
            text => text,
        };
        let kind = type_of(option, &definitions);
        let cell = |text: &str| text.replace('\n', " ").replace('|', "\\|");
        let _ = writeln!(section, "| `{name}` | {} | {} | {} |", cell(&kind), cell(&default), cell(&meaning));
    }
    let header = match entry.slot.shape() {
        Shape::One => format!("[{}]\nkind = \"{}\"", entry.slot, entry.kind),
        Shape::List => format!("[[{}]]\nkind = \"{}\"", entry.slot, entry.kind),
        Shape::Keyed => format!("[{}.{}]", entry.slot, entry.kind),
    };
    let _ = write!(section, "\n```toml\n{header}\n{}\n```\n\nFrom `{}`.\n", entry.example.trim(), entry.crate_name);
    section
}

fn doc(schema: &Value) -> String {
    schema["description"].as_str().unwrap_or_default().trim().to_owned()
}

/// What a reference or a one-element `allOf` stands for.
fn resolve(schema: &Value, definitions: &Map<String, Value>) -> Value {
    if let Some(name) = schema["$ref"].as_str().and_then(|reference| reference.rsplit('/').next()) {
        return definitions.get(name).cloned().unwrap_or_default();
    }
    match schema["allOf"].as_array().map(Vec::as_slice) {
        Some([only]) => resolve(only, definitions),
        _ => schema.clone(),
    }
}

fn type_of(schema: &Value, definitions: &Map<String, Value>) -> String {
    let schema = resolve(schema, definitions);
    if let Some(constant) = schema.get("const") {
        return format!("`{}`", toml_like(constant));
    }
    if let Some(values) = schema["enum"].as_array() {
        return values
            .iter()
            .filter(|v| !v.is_null())
            .map(|v| format!("`{}`", toml_like(v)))
            .collect::<Vec<_>>()
            .join(" or ");
    }
    if let Some(choices) = schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
        let mut names: Vec<String> = choices
            .iter()
            .filter(|choice| choice["type"] != "null")
            .map(|choice| type_of(choice, definitions))
            .collect();
        names.dedup();
        return names.join(" or ");
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => names.iter().filter_map(Value::as_str).filter(|name| *name != "null").collect(),
        _ => vec!["any"],
    };
    let range = match (&schema["minimum"], &schema["maximum"]) {
        (Value::Null, Value::Null) => String::new(),
        (low, Value::Null) => format!(" ≥ {low}"),
        (Value::Null, high) => format!(" ≤ {high}"),
        (low, high) => format!(" {low}–{high}"),
    };
    let names: Vec<String> = types
        .into_iter()
        .map(|name| match name {
            "array" => format!("list of {}", type_of(&schema["items"], definitions)),
            "object" => match schema["properties"].as_object() {
                Some(fields) => {
                    format!("table of {}", fields.keys().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", "))
                }
                None => "table".to_owned(),
            },
            "integer" => format!("whole number{range}"),
            "number" => format!("number{range}"),
            "boolean" => "true or false".to_owned(),
            "string" => "text".to_owned(),
            other => other.to_owned(),
        })
        .collect();
    names.join(" or ")
}

/// A JSON value as TOML would have it in one line.
fn toml_like(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<String> = fields
                .iter()
                .filter(|(_, value)| !value.is_null())
                .map(|(key, value)| format!("{key} = {}", toml_like(value)))
                .collect();
            format!("{{ {} }}", fields.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(toml_like).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

fn products(registry: &Registry) -> String {
    let mut page = format!(
        "{MADE}# Products\n\nWhat writers can `include`. Naming a product is what computes it; one that nobody names costs nothing.\n\n\
         | product | type | per | provider | meaning |\n|---|---|---|---|---|\n"
    );
    for (key, provider) in cli::products(registry) {
        let per = if key.scope == Scope::Scene { "scene" } else { "view" };
        let _ = writeln!(page, "| `{}` | `{}` | {per} | {provider} | {} |", key.name, key.type_name(), key.doc());
    }
    page
}

fn command_line() -> String {
    let mut page = format!("{MADE}# Command line\n");
    for (name, help) in cli::help_pages() {
        let _ = write!(page, "\n## `{name}`\n\n```text\n{}\n```\n", help.trim_end());
    }
    page
}

fn diagnostics() -> String {
    let mut page = format!(
        "{MADE}# Diagnostics\n\nEvery message about a recipe has a code. All mistakes of a recipe are shown at once.\n"
    );
    for code in Code::ALL {
        let (title, why, way_out) = (code.title(), code.explain(), code.help_text());
        let _ = write!(page, "\n## {}: {title}\n\n{why}\n\n**Way out.** {way_out}\n", code.text());
    }
    page
}
