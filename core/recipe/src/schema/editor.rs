//! The schema of recipes in the form that editors' TOML servers complete, hover and validate with.
//!
//! It accepts what [`schema`](crate::schema::kinds()) accepts. The servers of taplo and tombi shape it:
//!
//! - taplo completes without end under an `allOf`. So `{ description, allOf: [$ref] }`, which is how an option of a named
//!   type is written, becomes that type with the option's own words.
//! - taplo looks up the content of an array one level too deep: at `[[place]]` it asks for the items of an item. So the
//!   items of a recipe's arrays state that their own items are the same. The keyword has no effect on tables and
//!   strings.
//! - Names of products are listed with their meanings, and any other name is accepted as well: rendered products have a framing,
//!   and a stage can provide more with other options.
//! - tombi shows nothing for an integer where a number is asked for, unless integers are listed, too.
//! - Limits of a distribution are limits of the numbers in its lists.
//! - tombi completes from those members of an `anyOf` that accept the table as it stands, half-written. So `anyOf` lists a
//!   draft of each kind, a definition that asks for nothing; the chain of `if` refers to the kinds themselves.
//! - Servers mark missing sections in line 1 of every recipe that is being written. Only `check` requires them.

use crate::plan::available;
use crate::schema::kinds::schema;
use crate::schema::shared::{DEFINITIONS, for_each_part, share};
use serde_json::{Map, Value as Json, json};
use syntable_model::registry::{Registry, Shape, Slot};
use syntable_toml_schema::REFERENCE;

/// Keywords that limit a number.
const LIMITS: [&str; 4] = ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"];

/// The JSON Schema of recipes for editors. Equal registries give equal schemas, key order included.
pub fn editor_schema(registry: &Registry) -> Json {
    let mut schema = schema(registry);
    let definitions = schema["definitions"].as_object().cloned().unwrap_or_default();
    let products: Vec<Json> = available(registry)
        .into_iter()
        .map(|(key, _)| {
            let (name, meaning) = (key.to_string(), key.summary());
            // taplo shows the `main` words of every product, and the `constValue` words of the product that is written.
            let docs = json!({ "docs": { "main": "", "constValue": meaning } });
            json!({ "const": name, "description": meaning, "x-taplo": docs })
        })
        .collect();
    let editor = Editor { definitions: &definitions, products: &products };
    editor.rewrite(&mut schema);
    for slot in Slot::ALL.into_iter().filter(|slot| slot.shape() == Shape::List) {
        let same = json!({ "$ref": format!("{DEFINITIONS}{slot}") });
        schema["definitions"][slot.name()]["items"] = same;
    }
    list_drafts(&mut schema);
    shorten(&mut schema);
    share(&mut schema);
    drop_unused(&mut schema);
    schema
}

/// The schema for editors as it is committed and printed: a line per definition. The definitions are under `$defs`, the
/// keyword of later drafts, which all servers read: thousands of references are shorter.
pub fn schema_text(registry: &Registry) -> String {
    let mut schema = editor_schema(registry);
    let definitions = schema["definitions"].take();
    let line = |(name, value): (&String, &Json)| format!("{}: {value}", Json::from(name.as_str()));
    let lines = |object: &Json| object.as_object().into_iter().flatten().map(line).collect::<Vec<_>>().join(",\n");
    let definitions = format!("\"$defs\": {{\n{}\n}}", lines(&definitions));
    let keywords = lines(&schema).replacen("\"definitions\": null", &definitions, 1);
    format!("{{\n{keywords}\n}}\n").replace(DEFINITIONS, "#/$defs/")
}

/// Leaves out parts that editors do not need: all but the first paragraph of a kind's description, examples, the sizes of
/// numbers, marks for the recipe's loader, and the sections that a recipe lacks until its last line is written.
fn shorten(schema: &mut Json) {
    if let Some(whole) = schema["else"].as_object_mut() {
        whole.shift_remove("required");
    }
    for definition in schema["definitions"].as_object_mut().into_iter().flat_map(Map::values_mut) {
        if let Some(Json::String(text)) = definition.get_mut("description") {
            text.truncate(text.find("\n\n").unwrap_or(text.len()));
        }
    }
    drop_marks(schema);
}

fn drop_marks(schema: &mut Json) {
    if let Some(schema) = schema.as_object_mut() {
        schema.retain(|keyword, _| !["examples", "format", REFERENCE].contains(&keyword.as_str()));
    }
    for_each_part(schema, &mut drop_marks);
}

/// Replaces the kinds under `anyOf` of every slot by drafts of them: tables of the kind that may lack any option and have
/// any other. The last member accepts every table, and is `true`: of a schema in braces, tombi would show the text beside the
/// text of the kind.
fn list_drafts(schema: &mut Json) {
    let definitions = schema["definitions"].clone();
    for slot in Slot::ALL {
        let Some(forms) = schema["definitions"][slot.name()]["anyOf"].as_array_mut() else { continue };
        for form in forms.iter_mut() {
            let Some(name) = form["$ref"].as_str().and_then(|target| target.strip_prefix(DEFINITIONS)) else {
                *form = true.into();
                continue;
            };
            let properties = &definitions[name]["properties"];
            let mut draft = json!({ "type": "object", "properties": properties, "additionalProperties": true });
            if properties["kind"].get("const").is_none() {
                // Alternatives, whose table names no kind.
                draft["not"] = json!({ "type": "object", "required": ["kind"], "additionalProperties": true });
            }
            *form = draft;
        }
    }
}

/// Removes definitions without references.
fn drop_unused(schema: &mut Json) {
    loop {
        let text = schema.to_string();
        let Some(definitions) = schema["definitions"].as_object_mut() else { return };
        let before = definitions.len();
        let used = |name: &str| ['"', '/'].iter().any(|end| text.contains(&format!("{DEFINITIONS}{name}{end}")));
        definitions.retain(|name, _| used(name));
        if definitions.len() == before {
            return;
        }
    }
}

struct Editor<'s> {
    definitions: &'s Map<String, Json>,
    /// One schema per product that the program can make.
    products: &'s [Json],
}

impl Editor<'_> {
    fn rewrite(&self, schema: &mut Json) {
        match schema {
            Json::Object(object) => {
                describe_form(object);
                self.inline(object);
                if object.get(REFERENCE).and_then(Json::as_str) == Some("product") {
                    self.name_products(object);
                }
                match object.get_mut("type") {
                    Some(Json::Array(types)) if types.contains(&"number".into()) => types.push("integer".into()),
                    Some(one) if one == "number" => *one = json!(["number", "integer"]),
                    _ => {}
                }
                object.values_mut().for_each(|value| self.rewrite(value));
            }
            Json::Array(items) => items.iter_mut().for_each(|item| self.rewrite(item)),
            _ => {}
        }
    }

    /// Replaces an `allOf` of one schema by this schema, or by what it refers to; the schema's own keywords win.
    fn inline(&self, schema: &mut Map<String, Json>) {
        let Some([only]) = schema.get("allOf").and_then(Json::as_array).map(Vec::as_slice) else { return };
        let target = match only["$ref"].as_str() {
            Some(target) => target.strip_prefix(DEFINITIONS).and_then(|name| self.definitions.get(name)),
            None => Some(only),
        };
        let Some(mut target) = target.and_then(Json::as_object).cloned() else { return };
        schema.shift_remove("allOf");
        for form in target.get_mut("properties").and_then(Json::as_object_mut).into_iter().flat_map(Map::values_mut) {
            limit(form, schema);
        }
        target.append(schema);
        *schema = target;
        self.inline(schema);
    }

    fn name_products(&self, schema: &mut Map<String, Json>) {
        let any_of = if schema.contains_key("default") {
            // An option with its own words. The list of the names is long, and stands only once.
            vec![json!({ "$ref": "#/definitions/ProductName" })]
        } else {
            self.products.iter().cloned().chain([true.into()]).collect()
        };
        schema.insert("anyOf".into(), any_of.into());
        schema.insert("items".into(), json!({ "$ref": "#/definitions/ProductName" }));
    }
}

/// The only option of a form, such as `{ illuminance_lx = 500 }`, means what the form means.
fn describe_form(form: &mut Map<String, Json>) {
    let Some(meaning) = form.get("description").cloned() else { return };
    let properties =
        form.get_mut("properties").and_then(Json::as_object_mut).filter(|properties| properties.len() == 1);
    for option in properties.into_iter().flat_map(Map::values_mut).filter_map(Json::as_object_mut) {
        option.entry("description").or_insert_with(|| meaning.clone());
    }
}

/// Gives the numbers of a form of a distribution the limits of the option.
fn limit(form: &mut Json, option: &Map<String, Json>) {
    let limits = || LIMITS.iter().filter_map(|key| Some(((*key).to_owned(), option.get(*key)?.clone())));
    let is_number = |schema: &Json| matches!(schema["type"].as_str(), Some("number" | "integer"));
    if is_number(&form["items"]) {
        form["items"].as_object_mut().into_iter().for_each(|items| items.extend(limits()));
    }
}
