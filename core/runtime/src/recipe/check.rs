//! Checks values against their JSON Schema, with spans and suggestions, and collects what texts refer to.
//!
//! A stage's own deserialisation stops at its first mistake and knows no limits. So every table is first held against
//! the schema of its options, which finds all mistakes at once; the deserialisation then adds only what a schema cannot
//! say. The schema is the one that `syntable schema` prints, so editors and program agree.

use super::code::Code;
use super::diagnostic::Draft;
use super::key_path::{Shown, Step};
use super::source::Span;
use super::suggest::{did_you_mean, listing, nearest};
use serde_json::{Map, Value as Json};
use syntable_model::names::REFERENCE;
use syntable_model::registry::RecipeValue;
use toml::de::{DeTable, DeValue};

/// A text that names something, as its schema says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reference {
    /// What it names: `path`, `product`, `pool:object`, `pool:material`.
    pub what: String,
    /// The text.
    pub text: String,
    /// Its place.
    pub span: Span,
    /// The way to it from the stage's table.
    pub path: Vec<Step>,
}

/// What a check found.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub drafts: Vec<Draft>,
    pub references: Vec<Reference>,
}

/// Schemas that others refer to by `$ref`.
#[derive(Clone, Copy)]
pub(crate) struct Checker<'s> {
    pub definitions: &'s Map<String, Json>,
}

/// Where the check is: the way from the table of options, and what to call that table.
#[derive(Clone, Copy)]
struct At<'p> {
    owner: &'p str,
    path: &'p [Step],
}

impl At<'_> {
    fn key(&self, key: &str) -> Vec<Step> {
        let mut path = self.path.to_vec();
        path.push(Step::Key(key.to_owned()));
        path
    }

    fn index(&self, index: usize) -> Vec<Step> {
        let mut path = self.path.to_vec();
        path.push(Step::Index(index));
        path
    }

    /// What to call the value.
    fn name(&self) -> String {
        if self.path.is_empty() { self.owner.to_owned() } else { Shown(self.path).to_string() }
    }

    /// What to call the table that the value is.
    fn table(&self) -> String {
        match self.path {
            [] => self.owner.to_owned(),
            path => format!("{}.{}", self.owner, Shown(path)),
        }
    }
}

impl<'s> Checker<'s> {
    /// Checks a table of options. `owner` is what to call it; `header` is where to tell of missing keys.
    pub fn options(&self, owner: &str, table: &DeTable, header: &Span, schema: &'s Json) -> Found {
        let mut found = Found::default();
        let at = At { owner, path: &[] };
        self.table(table, header, schema, at, &mut found);
        found
    }

    /// Follows `$ref`.
    pub fn target(&self, mut schema: &'s Json) -> &'s Json {
        while let Some(target) = schema.get("$ref").and_then(Json::as_str) {
            let name = target.trim_start_matches("#/definitions/");
            match self.definitions.get(name) {
                Some(definition) => schema = definition,
                None => break,
            }
        }
        schema
    }

    fn value(&self, value: &RecipeValue, schema: &'s Json, at: At, found: &mut Found) {
        let schema = self.target(schema);
        for part in schema.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            self.value(value, part, at, found);
        }
        for union in ["oneOf", "anyOf"] {
            if let Some(branches) = schema.get(union).and_then(Json::as_array) {
                self.union(value, branches, at, found);
            }
        }
        let before = found.drafts.len();
        self.scalar(value, schema, at, found);
        if found.drafts.len() > before {
            return;
        }
        match value.get_ref() {
            DeValue::Table(table) => self.table(table, &value.span(), schema, at, found),
            DeValue::Array(items) => self.array(items, &value.span(), schema, at, found),
            DeValue::String(text) => {
                if let Some(what) = schema.get(REFERENCE).and_then(Json::as_str) {
                    found.references.push(Reference {
                        what: what.to_owned(),
                        text: text.clone().into_owned(),
                        span: value.span(),
                        path: at.path.to_vec(),
                    });
                }
            }
            _ => {}
        }
    }

    /// Type, choices and limits of one value.
    fn scalar(&self, value: &RecipeValue, schema: &'s Json, at: At, found: &mut Found) {
        let (span, name) = (value.span(), at.name());
        let types = types(schema);
        if !types.is_empty() && !types.iter().any(|kind| is_type(value.get_ref(), kind)) {
            found.drafts.push(self.wrong_type(value, &self.expected(schema), &name));
            return;
        }
        if let (DeValue::String(text), Some(choices)) = (value.get_ref(), choices(schema))
            && !choices.contains(&text.as_ref())
        {
            found.drafts.push(unknown_choice(&name, text, &span, &choices));
            return;
        }
        match value.get_ref() {
            DeValue::Integer(_) | DeValue::Float(_) => self.limits(value, schema, &name, found),
            DeValue::String(text) => {
                let length = text.chars().count() as u64;
                let least = schema.get("minLength").and_then(Json::as_u64).unwrap_or(0);
                if length < least {
                    let message = format!("`{name}` must not be empty");
                    let message = if least == 1 { message } else { format!("`{name}` has less than {least} letters") };
                    found.drafts.push(Draft::error(Code::OutOfRange, span.clone(), message));
                }
                if let Some(most) = schema.get("maxLength").and_then(Json::as_u64)
                    && length > most
                {
                    found.drafts.push(
                        Draft::error(Code::OutOfRange, span, format!("`{name}` has {length} letters"))
                            .label(format!("at most {most}")),
                    );
                }
            }
            _ => {}
        }
    }

    fn wrong_type(&self, value: &RecipeValue, expected: &str, name: &str) -> Draft {
        let draft = Draft::error(Code::WrongType, value.span(), format!("`{name}` must be {expected}"));
        match (value.get_ref(), expected) {
            (DeValue::Float(number), "a whole number") => {
                let whole =
                    number.as_str().parse::<f64>().ok().filter(|number| number.fract() == 0.0 && number.abs() < 1e15);
                draft.label(whole.map_or_else(|| found(value.get_ref()).to_owned(), |number| format!("write {number}")))
            }
            (DeValue::Datetime(_), "a text") => draft.label("this is a date; put it in quotes"),
            (DeValue::Integer(_) | DeValue::Float(_) | DeValue::Boolean(_), "a text") => {
                draft.label(format!("{}; put it in quotes", sentence(value.get_ref())))
            }
            (DeValue::String(text), "a number" | "a whole number") if text.trim().parse::<f64>().is_ok() => {
                draft.label("this is a text; write it without quotes")
            }
            (DeValue::String(text), "true or false") if text == "true" || text == "false" => {
                draft.label("this is a text; write it without quotes")
            }
            (DeValue::Table(_), "an array") => draft.label("this is a table; put it in `[ ]` for an array of one"),
            (other, "an array") => draft.label(format!("{}; put it in `[ ]` for an array of one", sentence(other))),
            (other, _) => draft.label(sentence(other)),
        }
    }

    fn limits(&self, value: &RecipeValue, schema: &Json, name: &str, found: &mut Found) {
        let refuse = |text: &str, label: String, found: &mut Found| {
            found
                .drafts
                .push(Draft::error(Code::OutOfRange, value.span(), format!("`{name}` cannot be {text}")).label(label));
        };
        let (text, number) = match value.get_ref() {
            DeValue::Integer(integer) => {
                let Ok(number) = i64::from_str_radix(integer.as_str(), integer.radix()) else {
                    return refuse(integer.as_str(), format!("whole numbers go to {}", i64::MAX), found);
                };
                (number.to_string(), number as f64)
            }
            DeValue::Float(float) => {
                let number: f64 = float.as_str().parse().unwrap_or(f64::NAN);
                if !number.is_finite() {
                    return refuse(float.as_str(), "a finite number is wanted".into(), found);
                }
                (float.as_str().to_owned(), number)
            }
            _ => return,
        };
        let limit = |key: &str| schema.get(key).and_then(Json::as_f64);
        let format_limit = |low: bool| {
            let (least, most) = match schema.get("format").and_then(Json::as_str)? {
                "int32" => (f64::from(i32::MIN), f64::from(i32::MAX)),
                "uint32" => (0.0, f64::from(u32::MAX)),
                _ => return None,
            };
            Some(if low { least } else { most })
        };
        let least = limit("minimum").into_iter().chain(format_limit(true)).reduce(f64::max);
        let most = limit("maximum").into_iter().chain(format_limit(false)).reduce(f64::min);
        if let Some(least) = least.filter(|least| number < *least) {
            refuse(&text, format!("at least {least}"), found);
        } else if let Some(most) = most.filter(|most| number > *most) {
            refuse(&text, format!("at most {most}"), found);
        } else if let Some(low) = limit("exclusiveMinimum").filter(|low| number <= *low) {
            refuse(&text, format!("above {low}"), found);
        } else if let Some(high) = limit("exclusiveMaximum").filter(|high| number >= *high) {
            refuse(&text, format!("below {high}"), found);
        } else if let Some(step) = limit("multipleOf").filter(|step| (number / step).fract() != 0.0) {
            refuse(&text, format!("a multiple of {step}"), found);
        }
    }

    fn array(&self, items: &[RecipeValue], span: &Span, schema: &'s Json, at: At, found: &mut Found) {
        let name = at.name();
        let count = items.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        let (least, most) = (limit("minItems").unwrap_or(0), limit("maxItems").unwrap_or(u64::MAX));
        if count < least || count > most {
            let elements = |n: u64| format!("{n} element{}", if n == 1 { "" } else { "s" });
            let label = match (least, most) {
                (least, most) if least == most => format!("exactly {least}"),
                (least, _) if count < least => format!("at least {least}"),
                _ => format!("at most {most}"),
            };
            let message = match count {
                0 => format!("`{name}` must not be empty"),
                _ => format!("`{name}` has {}", elements(count)),
            };
            found.drafts.push(Draft::error(Code::OutOfRange, span.clone(), message).label(label));
        }
        let unique = schema.get("uniqueItems").and_then(Json::as_bool).unwrap_or(false);
        for (index, item) in items.iter().enumerate() {
            let path = at.index(index);
            let inner = At { owner: at.owner, path: &path };
            let schema = match schema.get("items") {
                Some(Json::Array(each)) => each.get(index).or(schema.get("additionalItems")),
                all => all,
            };
            if let Some(schema) = schema {
                self.value(item, schema, inner, found);
            }
            let text = item.get_ref().as_str();
            if unique
                && text.is_some()
                && let Some(first) = items[..index].iter().find(|other| other.get_ref().as_str() == text)
            {
                let message = format!("`{name}` names `{}` twice", text.unwrap_or_default());
                found
                    .drafts
                    .push(Draft::error(Code::InvalidValue, item.span(), message).also(first.span(), "first here"));
            }
        }
    }

    fn table(&self, table: &DeTable, header: &Span, schema: &'s Json, at: At, found: &mut Found) {
        let properties = schema.get("properties").and_then(Json::as_object);
        let open = schema.get("additionalProperties");
        let known = || properties.into_iter().flat_map(|properties| properties.keys().map(String::as_str));
        // Every key of a table whose schema speaks of no keys at all is judged elsewhere.
        let closed = open == Some(&Json::Bool(false));
        let mut meant: Vec<&str> = Vec::new();
        for (key, value) in table.iter() {
            let name = key.get_ref().as_ref();
            let path = at.key(name);
            let inner = At { owner: at.owner, path: &path };
            if let Some(schema) = properties.and_then(|properties| properties.get(name)) {
                self.value(value, schema, inner, found);
            } else if let Some(schema) = open.filter(|schema| schema.is_object()) {
                self.value(value, schema, inner, found);
            } else if closed {
                meant.extend(nearest(name, known()));
                let draft =
                    Draft::error(Code::UnknownKey, key.span(), format!("`{}` has no option `{name}`", at.table()))
                        .label(did_you_mean(name, known()));
                found.drafts.push(draft.help(match known().next() {
                    Some(_) => format!("its options are {}", listing(known())),
                    None => "it has no options".to_owned(),
                }));
            }
        }
        for name in schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str) {
            // A misspelt key is one mistake, not also a missing one.
            if !table.contains_key(name) && !meant.contains(&name) {
                let option = properties.and_then(|properties| properties.get(name));
                let mut draft =
                    Draft::error(Code::MissingKey, header.clone(), format!("`{}` needs `{name}`", at.table()))
                        .label(format!("add `{name} = …`"));
                if let Some(meaning) = option.and_then(|option| self.meaning(option)) {
                    draft = draft.help(format!("{name}: {meaning}"));
                }
                found.drafts.push(draft);
            }
        }
        let count = table.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        if (limit("maxProperties"), limit("minProperties")) == (Some(1), Some(1)) && count != 1 {
            let draft =
                Draft::error(Code::InvalidValue, header.clone(), format!("`{}` needs exactly one key", at.table()));
            found.drafts.push(draft.help(format!("one of {}", listing(known()))));
        } else if limit("minProperties").is_some_and(|least| count < least) {
            found.drafts.push(Draft::error(
                Code::OutOfRange,
                header.clone(),
                format!("`{}` must not be empty", at.table()),
            ));
        }
    }

    /// A value that may have one of several forms: takes the form that it was meant to have, and tells its mistakes.
    fn union(&self, value: &RecipeValue, branches: &'s [Json], at: At, found: &mut Found) {
        let mut trials: Vec<(&'s Json, Found)> = Vec::new();
        for branch in branches {
            let mut trial = Found::default();
            self.value(value, branch, at, &mut trial);
            if trial.drafts.is_empty() {
                found.references.extend(trial.references);
                return;
            }
            trials.push((self.target(branch), trial));
        }
        let name = at.name();
        if let DeValue::String(text) = value.get_ref() {
            let words: Vec<&str> = trials.iter().flat_map(|(branch, _)| choices(branch).unwrap_or_default()).collect();
            if !words.is_empty() {
                let mut draft = unknown_choice(&name, text, &value.span(), &words);
                let tables: Vec<&str> = trials.iter().filter_map(|(branch, _)| sole_key(branch)).collect();
                if !tables.is_empty() {
                    draft = draft.help(format!("or a table with one of {}", listing(tables)));
                }
                found.drafts.push(draft);
                return;
            }
        }
        if let DeValue::Table(table) = value.get_ref() {
            // `{ of_table = … }`: the key says which form is meant.
            let tags: Vec<&str> = trials.iter().filter_map(|(branch, _)| sole_key(branch)).collect();
            let given: Vec<&str> = tags.iter().copied().filter(|tag| table.contains_key(*tag)).collect();
            if given.len() > 1 {
                let message = format!("`{name}` takes only one of {}", listing(given));
                found.drafts.push(Draft::error(Code::InvalidValue, value.span(), message));
                return;
            }
            if let Some(at) =
                trials.iter().position(|(branch, _)| sole_key(branch).is_some_and(|tag| table.contains_key(tag)))
            {
                let (_, meant) = trials.swap_remove(at);
                found.drafts.extend(meant.drafts);
                found.references.extend(meant.references);
                return;
            }
            if !tags.is_empty() {
                for (key, _) in table.iter() {
                    let key_name = key.get_ref().as_ref();
                    let message = format!("`{name}` has no form `{key_name}`");
                    found.drafts.push(
                        Draft::error(Code::UnknownKey, key.span(), message)
                            .label(did_you_mean(key_name, tags.iter().copied()))
                            .help(format!("one of {}", listing(tags.iter().copied()))),
                    );
                }
                if table.is_empty() {
                    let message = format!("`{name}` needs exactly one key");
                    let draft = Draft::error(Code::InvalidValue, value.span(), message);
                    found.drafts.push(draft.help(format!("one of {}", listing(tags))));
                }
                return;
            }
            // `{ type = "a", … }`: a constant says which form is meant.
            if let Some(tag) = trials.iter().find_map(|(branch, _)| constant_key(branch)) {
                let words: Vec<&str> = trials.iter().filter_map(|(branch, _)| constant(branch, tag)).collect();
                match table.get(tag).map(|given| (given, given.get_ref().as_str())) {
                    Some((given, Some(text))) => {
                        if let Some(at) = trials.iter().position(|(branch, _)| constant(branch, tag) == Some(text)) {
                            let (_, meant) = trials.swap_remove(at);
                            found.drafts.extend(meant.drafts);
                            found.references.extend(meant.references);
                        } else {
                            let path = at.key(tag);
                            found.drafts.push(unknown_choice(&Shown(&path).to_string(), text, &given.span(), &words));
                        }
                    }
                    Some((given, None)) => {
                        found.drafts.push(self.wrong_type(given, &format!("one of {}", listing(words)), tag));
                    }
                    None => found.drafts.push(
                        Draft::error(Code::MissingKey, value.span(), format!("`{}` needs `{tag}`", at.table()))
                            .label(format!("add `{tag} = …`"))
                            .help(format!("one of {}", listing(words))),
                    ),
                }
                return;
            }
        }
        // Otherwise the form of the same type with the fewest mistakes is meant.
        let of_type = |branch: &Json| {
            let types = types(branch);
            types.is_empty() || types.iter().any(|kind| is_type(value.get_ref(), kind))
        };
        let nearest = trials
            .iter()
            .enumerate()
            .filter(|(_, (branch, _))| of_type(branch))
            .min_by_key(|(_, (_, trial))| trial.drafts.len())
            .map(|(index, _)| index);
        match nearest {
            Some(index) => found.drafts.extend(trials.swap_remove(index).1.drafts),
            None => {
                let mut forms: Vec<String> = Vec::new();
                let tags: Vec<&str> = trials.iter().filter_map(|(branch, _)| sole_key(branch)).collect();
                for (branch, _) in trials.iter().filter(|(branch, _)| sole_key(branch).is_none()) {
                    let form = self.expected(branch);
                    if !forms.contains(&form) {
                        forms.push(form);
                    }
                }
                if !tags.is_empty() {
                    forms.push(format!("a table with one of {}", listing(tags)));
                }
                found.drafts.push(self.wrong_type(value, &forms.join(" or "), &name));
            }
        }
    }

    /// The first sentence of a description.
    fn meaning(&self, schema: &'s Json) -> Option<String> {
        let all_of = schema.get("allOf").and_then(Json::as_array).and_then(|parts| parts.first());
        let own = |schema: &Json| schema.get("description").and_then(Json::as_str).map(str::to_owned);
        own(schema).or_else(|| own(self.target(schema))).or_else(|| own(self.target(all_of?))).map(|text| {
            let text = text.replace('\n', " ");
            text.split(". ").next().unwrap_or(&text).trim_end_matches('.').to_owned()
        })
    }

    /// What a schema wants, in words.
    fn expected(&self, schema: &'s Json) -> String {
        let schema = self.target(schema);
        if let Some(words) = choices(schema) {
            return match words.as_slice() {
                [word] => format!("\"{word}\""),
                _ => format!("one of {}", listing(words)),
            };
        }
        match schema.get(REFERENCE).and_then(Json::as_str) {
            Some("path") => return "a path in quotes".into(),
            Some("product") => return "the name of a product in quotes".into(),
            Some(_) => return "the name of a pool in quotes".into(),
            None => {}
        }
        let forms: Vec<String> = types(schema)
            .iter()
            .map(|kind| match *kind {
                "object" => {
                    let keys: Vec<&str> = schema
                        .get("properties")
                        .and_then(Json::as_object)
                        .into_iter()
                        .flat_map(|properties| properties.keys().map(String::as_str))
                        .collect();
                    let one = schema.get("maxProperties").and_then(Json::as_u64) == Some(1) || keys.len() == 1;
                    match keys.is_empty() {
                        true => "a table".to_owned(),
                        false if one => format!("a table with one of {}", listing(keys)),
                        false => format!("a table of {}", listing(keys)),
                    }
                }
                "array" => match (schema.get("minItems"), schema.get("maxItems")) {
                    (Some(least), Some(most)) if least == most => format!("an array of {least}"),
                    _ => "an array".to_owned(),
                },
                "string" => "a text".to_owned(),
                "integer" => "a whole number".to_owned(),
                "number" => "a number".to_owned(),
                "boolean" => "true or false".to_owned(),
                other => other.to_owned(),
            })
            .collect();
        if forms.is_empty() { "something else".to_owned() } else { forms.join(" or ") }
    }
}

/// What a value is, with an article.
pub(crate) fn found(value: &DeValue) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number with a fraction",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}

fn sentence(value: &DeValue) -> String {
    match value {
        DeValue::Boolean(value) => format!("this is {value}"),
        other => format!("this is {}", found(other)),
    }
}

fn unknown_choice(name: &str, text: &str, span: &Span, choices: &[&str]) -> Draft {
    Draft::error(Code::UnknownChoice, span.clone(), format!("`{name}` cannot be \"{text}\""))
        .label(did_you_mean(text, choices.iter().copied()))
        .help(format!("one of {}", listing(choices.iter().copied())))
}

/// The types that a schema allows; none if it does not say.
fn types(schema: &Json) -> Vec<&str> {
    match schema.get("type") {
        Some(Json::String(one)) => vec![one],
        Some(Json::Array(several)) => several.iter().filter_map(Json::as_str).collect(),
        _ => Vec::new(),
    }
}

fn is_type(value: &DeValue, name: &str) -> bool {
    match value {
        DeValue::String(_) => name == "string",
        DeValue::Integer(_) => name == "integer" || name == "number",
        DeValue::Float(_) => name == "number",
        DeValue::Boolean(_) => name == "boolean",
        DeValue::Datetime(_) => false,
        DeValue::Array(_) => name == "array",
        DeValue::Table(_) => name == "object",
    }
}

/// The texts that a schema allows, if it lists them.
fn choices(schema: &Json) -> Option<Vec<&str>> {
    let listed = schema.get("enum").and_then(Json::as_array);
    listed
        .map(|words| words.iter().filter_map(Json::as_str).collect())
        .or_else(|| Some(vec![schema.get("const")?.as_str()?]))
}

/// The key of a table form that has exactly one, such as `of_table`.
fn sole_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    let required = schema.get("required")?.as_array()?;
    match (properties.len(), required.as_slice()) {
        (1, [Json::String(key)]) if constant(schema, key).is_none() => Some(key),
        _ => None,
    }
}

/// A key of a table form whose value is one constant.
fn constant_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    properties.keys().map(String::as_str).find(|key| constant(schema, key).is_some())
}

fn constant<'j>(schema: &'j Json, key: &str) -> Option<&'j str> {
    let option = schema.get("properties")?.get(key)?;
    match choices(option)?.as_slice() {
        [word] => Some(word),
        _ => None,
    }
}
