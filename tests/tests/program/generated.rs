//! Files generated from the registry: the schema, the book's reference, the help texts. This test compares them with
//! fresh ones; `UPDATE=1 cargo test --release --package syntable-tests --test program generated` updates them.

use crate::support::{gallery, root, samples};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use syntable_cli as cli;
use syntable_mesh::format::{ImageDecoder, ImageFormats, MeshFormats};
use syntable_model::product::KeyId;
use syntable_model::registry::{Entry, Registry, Shape, Slot, Stage};
use syntable_model::scene::AssetClass;
use syntable_model::words::first_sentence;
use syntable_program as _;
use syntable_recipe::plan::Producer;
use syntable_recipe::{Code, Overrides, Source};
use syntable_runtime::run;

/// All generated files: path from the root of the checkout, and content.
fn generated() -> BTreeMap<String, String> {
    let registry = Registry::linked().expect("no clash");
    let schema = syntable_recipe::schema(&registry);
    let reference = Reference::of(&schema);
    let journal = schemars::generate::SchemaSettings::draft07()
        .into_generator()
        .into_root_schema_for::<run::dataset::journal::JournalLine>();
    let journal = serde_json::to_string_pretty(&journal).expect("plain data");
    let log =
        schemars::generate::SchemaSettings::draft07().into_generator().into_root_schema_for::<run::progress::LogLine>();
    let log = serde_json::to_string_pretty(&log).expect("plain data");
    let mut files = BTreeMap::from([
        ("schemas/log.schema.json".to_owned(), log + "\n"),
        ("schemas/recipe.schema.json".to_owned(), syntable_recipe::schema_text(&registry)),
        ("schemas/journal.schema.json".to_owned(), journal + "\n"),
        ("book/src/reference/recipe.md".to_owned(), reference.recipe_page()),
        ("book/src/reference/values.md".to_owned(), reference.values_page()),
        ("book/src/reference/formats.md".to_owned(), formats()),
        ("book/src/reference/products.md".to_owned(), products(&registry)),
        ("book/src/reference/command-line.md".to_owned(), command_line()),
        ("book/src/reference/diagnostics.md".to_owned(), diagnostics(&registry)),
    ]);
    for slot in Slot::ALL {
        files.insert(format!("book/src/reference/{slot}.md"), reference.slot_page(&registry, slot));
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
        "stale: {}; refresh with UPDATE=1 cargo test --release --package syntable-tests --test program generated",
        stale.join(", ")
    );
}

const MADE: &str = "<!-- Made from the registry: UPDATE=1 cargo test --release --package syntable-tests --test program generated -->\n\n";

/// Definitions of values that at least this many kinds share are on a separate page.
const SHARED: usize = 4;

/// The recipe's schema as pages.
struct Reference<'s> {
    schema: &'s Value,
    definitions: &'s Map<String, Value>,
    /// Names of the definitions on the page of values.
    shared: BTreeSet<&'s str>,
}

/// A table of options, and the words that are listed below it.
#[derive(Default)]
struct Options {
    rows: Vec<[String; 4]>,
    words: Vec<(String, Vec<String>)>,
}

impl<'s> Reference<'s> {
    fn of(schema: &'s Value) -> Self {
        let definitions = schema["definitions"].as_object().expect("a schema with definitions");
        let mut uses: BTreeMap<&str, usize> = BTreeMap::new();
        for (_, kind) in definitions.iter().filter(|(name, _)| name.contains('.')) {
            let text = kind.to_string();
            for name in definitions.keys() {
                *uses.entry(name).or_default() += usize::from(text.contains(&format!("\"#/definitions/{name}\"")));
            }
        }
        let compound = |name: &str| {
            let definition = &definitions[name];
            definition["properties"].is_object() || definition["oneOf"].is_array() || definition["anyOf"].is_array()
        };
        uses.retain(|name, count| !name.contains('.') && *count >= SHARED && compound(name));
        Self { schema, definitions, shared: uses.into_keys().collect() }
    }

    /// The definition behind `$ref` and one-element `allOf`, with its name.
    fn resolve<'a>(&'a self, mut schema: &'a Value) -> (Option<&'a str>, &'a Value) {
        let mut name = None;
        loop {
            if let Some(target) = schema["$ref"].as_str().and_then(|target| target.strip_prefix("#/definitions/")) {
                (name, schema) = (Some(target), &self.definitions[target]);
            } else if let Some([only]) = schema["allOf"].as_array().map(Vec::as_slice) {
                schema = only;
            } else {
                return (name, schema);
            }
        }
    }

    /// The possible values, in a few words.
    fn value(&self, schema: &Value) -> String {
        let (name, target) = self.resolve(schema);
        if let Some(name) = name.filter(|name| self.shared.contains(name)) {
            return format!("[{}](values.md#{})", spaced(name), spaced(name).replace(' ', "-"));
        }
        match target["x-syntable-ref"].as_str() {
            Some("path") => return "path".to_owned(),
            Some("product") => return "[product](products.md)".to_owned(),
            Some(pool) if pool.starts_with("pool:") => {
                let class = pool.trim_start_matches("pool:");
                return format!("pool of {class}{}", if class == "environment" { " maps" } else { "s" });
            }
            _ => {}
        }
        if let Some(words) = target["enum"].as_array() {
            return match words.len() {
                0..=6 => list(words.iter().map(|word| format!("`{}`", toml_like(word))), "or"),
                _ => "one word of those below".to_owned(),
            };
        }
        if let Some(word) = target.get("const") {
            return format!("`{}`", toml_like(word));
        }
        if let Some([one, _, weights]) = target["anyOf"].as_array().map(Vec::as_slice)
            && weights["x-syntable-key-ref"].is_string()
        {
            let pool = self.value(one).replacen("pool", "[pools](../scenes.md#pools-and-weights)", 1);
            return format!("{pool}: one, a list or weights");
        }
        if let Some(branches) = target["oneOf"].as_array().or(target["anyOf"].as_array()) {
            let mut forms: Vec<String> = branches.iter().map(|branch| self.form(branch)).collect();
            forms.dedup();
            return list(forms.into_iter(), "or");
        }
        let types: Vec<&str> = match &target["type"] {
            Value::String(name) => vec![name],
            Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
            _ => vec!["any value"],
        };
        list(types.into_iter().map(|name| self.of_type(name, target)), "or")
    }

    fn of_type(&self, name: &str, schema: &Value) -> String {
        match name {
            "array" => {
                let each = match &schema["items"] {
                    Value::Array(items) => list(items.iter().map(|item| self.value(item)), "and"),
                    item => self.value(item),
                };
                match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                    (Some(least), Some(most)) if least == most => format!("list of {least}: {each}"),
                    (Some(least), _) if least > 0 => format!("list, at least {least}: {each}"),
                    _ => format!("list of: {each}"),
                }
            }
            "object" if schema["properties"].is_object() => self.form(schema),
            "object" => "table".to_owned(),
            "integer" => format!("integer{}", range(schema)),
            "number" => format!("number{}", range(schema)),
            "boolean" => "`true` or `false`".to_owned(),
            "string" => "text".to_owned(),
            other => other.to_owned(),
        }
    }

    /// A branch of a union or a table: `{ distance_m }`.
    fn form(&self, branch: &Value) -> String {
        let (_, target) = self.resolve(branch);
        let Some(properties) = target["properties"].as_object() else { return self.value(branch) };
        let one = target["maxProperties"] == json!(1);
        let fields: Vec<String> = properties
            .iter()
            .map(|(key, field)| match self.resolve(field).1.get("const") {
                Some(word) => format!("{key} = {}", toml_like(word)),
                None => key.clone(),
            })
            .collect();
        if one {
            return list(fields.iter().map(|field| format!("`{{ {field} }}`")), "or");
        }
        if fields.len() > 4 {
            return "table".to_owned();
        }
        format!("`{{ {} }}`", fields.join(", "))
    }

    /// Adds a row for an option, and rows for its nested options.
    fn option(&self, path: &str, option: &Value, required: bool, only: &str, depth: usize, out: &mut Options) {
        let (name, target) = self.resolve(option);
        let default = match option.get("default").or(target.get("default")) {
            _ if required => "required".to_owned(),
            None => "none".to_owned(),
            Some(default) => format!("`{}`", toml_like(default)),
        };
        let own = text(option);
        let meaning = if own.is_empty() { text(target) } else { own };
        let (mut meaning, listed) = words(&meaning);
        let (_, of_target) = words(&text(target));
        let mut listed = if listed.is_empty() { of_target } else { listed };
        if let Some(branches) = target["oneOf"].as_array() {
            let described =
                |branch: &Value| branch.get("const").map(|word| format!("`{}`: {}", toml_like(word), text(branch)));
            listed.extend(branches.iter().filter_map(described));
        }
        if listed.iter().map(String::len).sum::<usize>() <= 160 && !listed.is_empty() {
            meaning = format!("{} {}", meaning.trim(), std::mem::take(&mut listed).join(" "));
        }
        if !listed.is_empty() {
            out.words.push((path.to_owned(), listed));
        }
        let value = self.value(option);
        out.rows.push([format!("`{path}`"), value, default, format!("{only}{}", meaning.trim())]);
        if depth == 0 || name.is_some_and(|name| self.shared.contains(name)) {
            return;
        }
        self.inside(path, target, depth - 1, out);
    }

    /// Adds rows for the options nested in a value.
    fn inside(&self, path: &str, schema: &Value, depth: usize, out: &mut Options) {
        let (name, target) = self.resolve(schema);
        if name.is_some_and(|name| self.shared.contains(name)) {
            return;
        }
        if let Some(item) = target.get("items").filter(|item| item.is_object()) {
            return self.inside(&format!("{path}[]"), item, depth, out);
        }
        if let Some(value) = target.get("additionalProperties").filter(|value| value.is_object()) {
            let inner = format!("{path}.<name>");
            return self.inside(&inner, value, depth, out);
        }
        for branch in target["oneOf"].as_array().or(target["anyOf"].as_array()).into_iter().flatten() {
            self.table(path, self.resolve(branch).1, depth, out);
        }
        self.table(path, target, depth, out);
    }

    /// Adds rows for the fields of a table. The rows of a variant state the variant.
    fn table(&self, path: &str, schema: &Value, depth: usize, out: &mut Options) {
        let Some(properties) = schema["properties"].as_object() else { return };
        let required = names(&schema["required"]);
        let is_tag = |field: &Value| self.resolve(field).1.get("const").is_some();
        let tag = properties.iter().find(|(_, field)| is_tag(field));
        let only = tag.map_or(String::new(), |(key, field)| {
            format!("With `{key} = {}`: ", toml_like(&self.resolve(field).1["const"]))
        });
        for (key, field) in properties.iter().filter(|(_, field)| !is_tag(field)) {
            let mut field = field.clone();
            // In a variant with one field, the field has the description of the variant.
            if properties.len() == 1 && text(&field).is_empty() && !text(schema).is_empty() {
                field["description"] = schema["description"].clone();
            }
            let sole = properties.len() == 1 || schema["maxProperties"] == json!(1);
            let needed = !sole && required.contains(&key.as_str());
            let row = out.rows.len();
            self.option(&format!("{path}.{key}"), &field, needed, &only, depth, out);
            // One of several forms is neither present by default nor optional.
            if sole && out.rows[row][2] == "none" {
                out.rows[row][2].clear();
            }
        }
    }

    /// A table of the options of a schema; `except` selects options to skip.
    fn options(&self, schema: &Value, required: &[&str], except: &dyn Fn(&str) -> bool) -> String {
        let mut options = Options::default();
        for (name, option) in schema["properties"].as_object().into_iter().flatten() {
            if !except(name) {
                self.option(name, option, required.contains(&name.as_str()), "", 5, &mut options);
            }
        }
        options.render()
    }

    fn slot_page(&self, registry: &Registry, slot: Slot) -> String {
        let mut page = format!("{MADE}# {}\n\n{}\n\n", header(slot), slot.doc());
        page += match slot.shape() {
            Shape::One => "One table. `kind` chooses among the kinds below.\n",
            Shape::List => {
                "An array of tables, in order. `kind` chooses among the kinds below; `id` names the step and seeds its \
                 random numbers (default: the kind).\n"
            }
            _ => {
                "Tables by id. The id is the kind, unless `kind` says otherwise: then the id can be any word that is \
                 not a kind.\n"
            }
        };
        page += &match slot.spec().default_kinds {
            [] => String::new(),
            kinds => format!("\nDefault: {}.\n", list(kinds.iter().map(|kind| format!("`{kind}`")), "and")),
        };
        let entries: Vec<&Entry> = registry.of_slot(slot).collect();
        page += "\n| kind | what it does |\n|---|---|\n";
        for entry in &entries {
            let summary = text(&self.definitions[&format!("{slot}.{}", entry.kind)]);
            let _ = writeln!(page, "| [`{}`](#{}) | {} |", entry.kind, entry.kind, cell(&first_sentence(&summary)));
        }
        if slot == Slot::Assets {
            page += "\nEvery pool has the options of [all pools](recipe.md#options-of-all-pools), too.\n";
        }
        for entry in entries {
            page += &self.kind_section(entry);
        }
        page
    }

    fn kind_section(&self, entry: &Entry) -> String {
        let schema = &self.definitions[&format!("{}.{}", entry.slot, entry.kind)];
        let mut generator = schemars::generate::SchemaSettings::draft07().into_generator();
        let own = Value::from(entry.schema(&mut generator));
        let required = names(&own["required"]);
        // Moves the headings of a description one level below the kind's heading.
        let description = schema["description"].as_str().unwrap_or_default().trim().replace("\n# ", "\n### ");
        let mut section = format!("\n## `{}`\n\n{description}\n", entry.kind);
        section += &shown(entry);
        let output = output(entry);
        if !output.is_empty() {
            let _ = write!(section, "\n{output}\n");
        }
        let own_option = |name: &str| own["properties"].get(name).is_some();
        let options = self.options(schema, &required, &|name| !own_option(name));
        section += "\n### Options\n";
        section += if options.is_empty() { "\nNone.\n" } else { &options };
        let header = match entry.slot.shape() {
            Shape::Keyed => entry.slot.header(entry.kind),
            _ => format!("{}\nkind = \"{}\"", entry.slot.header(entry.kind), entry.kind),
        };
        let example = format!("{header}\n{}", entry.example.trim());
        let _ = write!(section, "\n### Example\n\n```toml\n{}\n```\n", example.trim());
        // The files of `exec` come from a program, and a machine may lack its tools.
        if entry.slot == Slot::Write && entry.kind != "exec" {
            section += "\n### Sample output\n\nThe files of the example below for a scene with two objects and one view of 64 × 48 \
                        pixels. “…” marks omissions.\n\n";
            section += &samples::of(&example);
        }
        let _ = write!(section, "\nFrom `{}`.\n", entry.crate_name);
        section
    }

    fn recipe_page(&self) -> String {
        let mut page = format!(
            "{MADE}# The recipe file\n\nA recipe is a TOML file: `[dataset]`, a section for each slot of the pipeline, and \
             a few keys that take from other recipes. Unknown keys are errors. `${{NAME}}` in a path is replaced by the \
             environment variable; relative paths start from the folder of the recipe that has them.\n\n## `[dataset]`\n"
        );
        let properties = &self.schema["properties"];
        let required = names(&self.schema["else"]["properties"]["dataset"]["required"]);
        page += &self.options(&properties["dataset"], &required, &|_| false);
        page += "\n## Slots\n\nSections in pipeline order. A recipe without a section gets the default; those that are \
                 required have none.\n\n| section | what it does | default |\n|---|---|---|\n";
        for slot in Slot::ALL {
            let spec = slot.spec();
            let default = match spec.default_kinds {
                [] if spec.optional => "nothing".to_owned(),
                [] => "required".to_owned(),
                kinds => list(kinds.iter().map(|kind| format!("`{kind}`")), "and"),
            };
            let _ = writeln!(page, "| [{}]({slot}.md) | {} | {default} |", header(slot), spec.doc);
        }
        let _ = write!(
            page,
            "\n## `[mixture.<id>]`\n\n{} A component has a weight, the keys of the next section except `lock`, and all slots except \
             `write`: [Mixtures of recipes](../scenes.md#mixtures-of-recipes).\n",
            text(&properties["mixture"])
        );
        page += &self.options(&self.definitions["component"], &[], &|name| name != "weight");
        page += "\n## Inheritance and overrides\n\n| key | value | meaning |\n|---|---|---|\n";
        for key in ["extends", "remove", "set", "lock"] {
            let value = match key {
                "set" => "table of values by path".to_owned(),
                "lock" => "table".to_owned(),
                _ => "text or list of texts".to_owned(),
            };
            let _ = writeln!(page, "| `{key}` | {value} | {} |", cell(&text(&properties[key])));
        }
        page += "\nTables are merged key by key. A recipe that gives a list replaces the inherited one; so it is with all \
                 steps of `[[place]]` and of `[[lights]]`. `[set]` and `remove` reach one step by its id. `[set]` applies \
                 after the merge, `--set` on the command line after that:\n\n\
                 ```toml\nextends = \"recipes/quickstart.toml\"\nremove = [\"write.contact_sheet\"]\n\n\
                 [render]\nsamples_per_pixel = 64\n\n[set]\n\"place.objects.count\" = 5\n```\n";
        page += "\n`[lock]` has these keys:\n";
        page += &self.options(&properties["lock"], &[], &|_| false);
        page += "\n## Options of all pools\n\nEvery `[assets.<id>]` table has these options, in addition to the options of its kind. \
                 Options of scale, center, mass and parts apply to objects alone.\n";
        let pool = &self.definitions["assets.mesh_folder"];
        let own = ["kind", "root", "up"];
        let pool_option = |name: &str| {
            let everywhere = |entry: &str| self.definitions[entry]["properties"].get(name).is_some();
            everywhere("assets.household") && everywhere("assets.mesh_folder") && !own.contains(&name)
        };
        page += &self.options(pool, &[], &|name| !pool_option(name));
        page
    }

    fn values_page(&self) -> String {
        let mut page = format!(
            "{MADE}# Shared values\n\nForms of values that many options take. A random value is drawn again for \
             each scene, view or body, as the option says.\n"
        );
        for &name in &self.shared {
            let definition = &self.definitions[name];
            let _ = write!(page, "\n## {}\n\n", capital(&spaced(name)));
            let _ = write!(page, "{}\n\nWritten as {}.\n", definition["description"].as_str().unwrap_or("").trim(), {
                let unnamed = Self { schema: self.schema, definitions: self.definitions, shared: BTreeSet::new() };
                unnamed.value(definition)
            });
            let mut options = Options::default();
            self.inside("", definition, 5, &mut options);
            for row in &mut options.rows {
                row[0] = row[0].replacen("`.", "`", 1);
                assert!(!row[3].is_empty(), "{} of `{name}` has no description", row[0]);
            }
            page += &options.render();
        }
        page
    }
}

impl Options {
    fn render(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let mut out = "\n| option | value | default | meaning |\n|---|---|---|---|\n".to_owned();
        for row in &self.rows {
            let _ = writeln!(out, "| {} |", row.each_ref().map(|text| cell(text)).join(" | "));
        }
        for (path, words) in &self.words {
            let _ = write!(out, "\n`{path}` is one of\n\n- {}\n", words.join("\n- "));
        }
        out
    }
}

/// The image of a kind in the gallery, and the tables for the kind in the recipes of this image.
fn shown(entry: &Entry) -> String {
    const SOURCES: &str = "https://github.com/syntable/syntable/blob/main/book/gallery";
    let (slot, kind) = (entry.slot, entry.kind);
    let (mut captions, mut excerpts, mut links) = (Vec::new(), Vec::new(), Vec::new());
    for path in gallery::recipes(slot, kind) {
        let recipe = fs::read_to_string(&path).expect("readable");
        let name = path.file_name().expect("named").to_string_lossy();
        let caption = gallery::caption(&recipe);
        excerpts.push(format!("```toml\n# {caption}\n{}\n```", gallery::excerpt(&recipe, entry)));
        captions.push(caption);
        links.push(format!("[`{name}`]({SOURCES}/{slot}/{name})"));
    }
    if links.is_empty() {
        return String::new();
    }
    format!(
        "\n![{kind}: {}](../images/reference/{})\n\n{}\n\nRendered from {}.\n",
        captions.join(" "),
        gallery::image_name(slot, kind),
        excerpts.join("\n\n"),
        list(links.into_iter(), "and")
    )
}

/// The products that a stage provides and reads.
fn output(entry: &Entry) -> String {
    let stage =
        entry.construct_str("").or_else(|_| entry.construct_str(entry.example)).expect("the example builds").stage;
    let keys = |keys: Vec<KeyId>| list(keys.into_iter().map(|key| format!("`{key}`")), "and");
    match Producer::of(stage.of_scenes()) {
        Ok(producer) => {
            let mut line = format!("**Provides** {} per {}", keys(producer.provides()), producer.scope());
            if !producer.reads().is_empty() {
                let _ = write!(line, ", from {}", keys(producer.reads()));
            }
            for replacement in producer.replaces() {
                let (product, original) = (replacement.product, replacement.original);
                let _ = write!(line, "; replaces `{product}`, and the original is kept as `{original}`");
            }
            line + "."
        }
        Err(Stage::Render(renderer)) => {
            format!("**Offers** {} per view. Only those that are read are rendered.", keys(renderer.offers()))
        }
        Err(Stage::WriteScenes(writer)) => {
            let read: Vec<String> = writer.reads().into_iter().map(|input| format!("`{}`", input.product)).collect();
            format!("**Reads** {} by default.", list(read.into_iter(), "and"))
        }
        Err(Stage::Assets(source)) => match source.class() {
            AssetClass::Environment => "**Gives** environment maps.".to_owned(),
            class => format!("**Gives** {class}s."),
        },
        Err(_) => String::new(),
    }
}

fn header(slot: Slot) -> String {
    format!("`{}`", slot.header("<id>"))
}

fn text(schema: &Value) -> String {
    schema["description"].as_str().unwrap_or_default().trim().to_owned()
}

fn names(list: &Value) -> Vec<&str> {
    list.as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// Splits a description into its text and its list of words.
fn words(description: &str) -> (String, Vec<String>) {
    match description.split_once("- `") {
        Some((before, list)) if before.is_empty() || before.ends_with("\n") => {
            let items = list.split("\n- `").map(|item| format!("`{}", item.replace('\n', " ").trim()));
            (before.trim().to_owned(), items.collect())
        }
        _ => (description.to_owned(), Vec::new()),
    }
}

fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// `a, b or c`.
fn list(items: impl Iterator<Item = String>, conjunction: &str) -> String {
    let items: Vec<String> = items.collect();
    match &items[..] {
        [] => "nothing".to_owned(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} {conjunction} {last}", first.join(", ")),
    }
}

/// `ViewRadius` as `view radius`, and the two distributions by their names in prose.
fn spaced(name: &str) -> String {
    match name {
        "Dist" => return "random number".to_owned(),
        "IntDist" => return "random integer".to_owned(),
        _ => {}
    }
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push(' ');
        }
        out.extend(c.to_lowercase());
    }
    out
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// The limits of a number.
fn range(schema: &Value) -> String {
    let plain = |limit: &Value| limit.to_string().trim_end_matches(".0").to_owned();
    let limit = |key: &str| schema.get(key).filter(|limit| limit.is_number()).map(plain);
    let low =
        limit("minimum").map(|low| format!("≥ {low}")).or(limit("exclusiveMinimum").map(|low| format!("> {low}")));
    let high =
        limit("maximum").map(|high| format!("≤ {high}")).or(limit("exclusiveMaximum").map(|high| format!("< {high}")));
    match (limit("minimum"), limit("maximum"), low, high) {
        (Some(low), Some(high), _, _) => format!(" {low} to {high}"),
        (_, _, None, None) => String::new(),
        (_, _, low, high) => format!(" {}", [low, high].into_iter().flatten().collect::<Vec<_>>().join(", ")),
    }
}

/// A JSON value in TOML syntax on one line.
fn toml_like(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<String> = fields
                .iter()
                .filter(|(_, value)| !value.is_null())
                .map(|(key, value)| format!("{key} = {}", toml_like(value)))
                .collect();
            if fields.is_empty() { "{}".to_owned() } else { format!("{{ {} }}", fields.join(", ")) }
        }
        Value::Array(items) => format!("[{}]", items.iter().map(toml_like).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

fn products(registry: &Registry) -> String {
    let mut page = format!(
        "{MADE}# Products\n\nProducts that writers can `include`. Only included products and their inputs are \
         computed. The kind of value decides which writers can store it: `syntable check` refuses the others before \
         anything is rendered.\n\n| product | kind of value | unit | per | provider |\n|---|---|---|---|---|\n"
    );
    let products = cli::products(registry);
    for (key, provider) in &products {
        let (name, kind) = (key, key.kind_of_value());
        let unit = if key.unit.is_empty() { "" } else { key.unit };
        let _ = writeln!(page, "| [`{name}`](#{name}) | {kind} | {unit} | {} | {provider} |", key.scope);
    }
    for (key, _) in &products {
        let _ = write!(page, "\n## `{key}`\n\n{}\n", key.doc());
    }
    page
}

fn formats() -> String {
    let registry = Registry::linked().expect("no clash");
    let mut page = format!(
        "{MADE}# File formats\n\nMeshes, textures and environment maps that pools read. Of one asset in several formats \
         the first in these lists is read. A crate can [add a format](../plugins.md#a-mesh-or-image-format).\n\n\
         | format | holds | extensions | crate |\n|---|---|---|---|\n"
    );
    let extensions = |list: &[&str]| list.iter().map(|e| format!("`.{e}`")).collect::<Vec<_>>().join(" ");
    for format in MeshFormats::linked().expect("no clash").iter() {
        let _ =
            writeln!(page, "| {} | meshes | {} | {} |", format.name, extensions(format.extensions), format.crate_name);
    }
    for format in ImageFormats::linked().expect("no clash").iter() {
        let holds = match format.decode {
            ImageDecoder::Texture(_) => "textures",
            ImageDecoder::Radiance(_) => "environment maps",
        };
        let _ =
            writeln!(page, "| {} | {holds} | {} | {} |", format.name, extensions(format.extensions), format.crate_name);
    }
    page += "\n## Datasets\n\nFormats that [`convert` and `validate`](../interchange.md) read.\n\n\
             | format | what it is | crate |\n|---|---|---|\n";
    for format in registry.formats() {
        let _ = writeln!(page, "| {} | {} | {} |", format.name(), format.doc(), format.owner());
    }
    page += "\n## Checks\n\nChecks of each view by `validate` and by every run.\n\n| check | what holds |\n|---|---|\n";
    for check in registry.checks() {
        let _ = writeln!(page, "| {} | {} |", check.name(), check.doc());
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

/// The recipe of a code in `tests/fixtures/diagnostics`, as a user in the root of the checkout would write it.
fn fixture(name: &str) -> Option<String> {
    let path = root().join("tests/fixtures/diagnostics").join(name);
    Some(fs::read_to_string(path).ok()?.replace("../../../", ""))
}

/// The diagnostics for a recipe `my.toml`: codes, and the text.
fn diagnosed(registry: &Registry, text: &str) -> (Vec<Code>, String) {
    let overrides = Overrides {
        exists: &|_| true,
        opens_urls: false,
        set: Vec::new(),
        variable: &|name| (name == "HOME").then(|| "/home/me".to_owned()),
        read: &|path: &Path| fs::read_to_string(root().join(path)),
        current_folder: "".into(),
        choose: false,
        wanted: Vec::new(),
    };
    let found = match syntable_recipe::load(registry, Source::file("my.toml", text), &overrides) {
        Ok((_, warnings)) => warnings,
        Err(report) => report.diagnostics,
    };
    (found.iter().map(|it| it.code).collect(), found.iter().map(|it| it.render(false)).collect::<Vec<_>>().join("\n"))
}

#[test]
fn recipes_of_the_diagnostics_fail_and_are_mended() {
    let registry = Registry::linked().expect("no clash");
    let mut seen = 0;
    for &code in Code::ALL {
        let Some(failing) = fixture(&format!("{code}.toml")) else { continue };
        let mended = fixture(&format!("{code}.fixed.toml")).expect("a mended recipe beside the failing one");
        let (codes, said) = diagnosed(&registry, &failing);
        assert!(!codes.is_empty() && codes.iter().all(|&other| other == code), "{code}.toml\n{said}");
        let (codes, said) = diagnosed(&registry, &mended);
        assert!(codes.is_empty(), "{code}.fixed.toml\n{said}");
        seen += 1;
    }
    assert!(seen >= 20, "{seen} of {} codes have recipes", Code::ALL.len());
}

fn diagnostics(registry: &Registry) -> String {
    let mut page = format!(
        "{MADE}# Diagnostics\n\nEvery message about a recipe has a code. All mistakes of a recipe are shown at once. \
         Each example is a recipe `my.toml`, what `syntable check my.toml` says, and the recipe mended.\n"
    );
    for &code in Code::ALL {
        let (title, why, help) = (code.title(), code.explain(), code.help_text());
        let _ = write!(page, "\n## {code}: {title}\n\n{why}\n\n**Help.** {help}\n");
        let recipes = fixture(&format!("{code}.toml")).zip(fixture(&format!("{code}.fixed.toml")));
        if let Some((failing, mended)) = recipes {
            let (_, said) = diagnosed(registry, &failing);
            let _ = write!(
                page,
                "\n```toml\n{}\n```\n\n```text\n{}\n```\n\nMended:\n\n```toml\n{}\n```\n",
                failing.trim(),
                said.trim_end(),
                mended.trim()
            );
        }
    }
    page
}
