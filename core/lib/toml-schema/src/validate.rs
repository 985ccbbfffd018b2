//! The validator: one table against its schema.

use crate::finding::{Finding, Outcome, Problem, Reference};
use crate::keyword_values::{array_length, choices, constant, constant_key, form_keys, sole_key, sole_type, types};
use crate::value::{DisplayPath, Member, Step, TomlNode, TomlType, TomlView, spanned_members};
use crate::words::{first_sentence, listing};
use crate::{KEY_REFERENCE, REFERENCE};
use serde_json::{Map, Value as Json};
use std::ops::Range;
use toml::de::DeTable;

/// Validates tables against schemas.
#[derive(Debug, Clone, Copy)]
pub struct Validator<'s> {
    /// The targets of `$ref`.
    pub definitions: &'s Map<String, Json>,
}

/// The value under validation: its path, and the name of the table that the path starts from.
#[derive(Clone, Copy)]
struct At<'p> {
    owner: &'p str,
    path: &'p [Step],
}

impl At<'_> {
    fn key(&self, key: &str) -> Vec<Step> {
        [self.path, &[Step::Key(key.to_owned())]].concat()
    }

    fn index(&self, index: usize) -> Vec<Step> {
        [self.path, &[Step::Index(index)]].concat()
    }

    /// Name of the value in messages.
    fn name(&self) -> String {
        if self.path.is_empty() { self.owner.to_owned() } else { DisplayPath(self.path).to_string() }
    }

    /// Name of the table that the value is.
    fn table(&self) -> String {
        match self.path {
            [] => self.owner.to_owned(),
            path => format!("{}.{}", self.owner, DisplayPath(path)),
        }
    }
}

impl<'s> Validator<'s> {
    /// Validates a table of options. `owner` names it in messages; missing keys are reported at `header`.
    pub fn table<N: TomlNode>(
        &self,
        owner: &str,
        members: Vec<Member<N>>,
        header: Range<usize>,
        schema: &'s Json,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        self.members(&members, header, schema, At { owner, path: &[] }, &mut outcome);
        outcome
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

    fn value<N: TomlNode>(&self, value: &N, schema: &'s Json, at: At, outcome: &mut Outcome) {
        let schema = self.target(schema);
        for part in schema.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            self.value(value, part, at, outcome);
        }
        for union in ["oneOf", "anyOf"] {
            if let Some(branches) = schema.get(union).and_then(Json::as_array) {
                self.union(value, branches, at, outcome);
            }
        }
        let view = value.view();
        let before = outcome.findings.len();
        self.scalar(&view, value.span(), schema, at, outcome);
        if let Some(finding) = outcome.findings.get_mut(before) {
            if let Problem::WrongType { key, length, .. } = &mut finding.problem {
                *key = self.key_of_form(value, std::iter::once(schema), at);
                *length = array_length(schema).filter(|_| types(schema) == ["array"]);
            }
            return;
        }
        match view {
            TomlView::Table(members) => self.members(&members, value.span(), schema, at, outcome),
            TomlView::Array(items) => self.array(items, value.span(), schema, at, outcome),
            TomlView::String(text) => {
                if let Some(what) = schema.get(REFERENCE).and_then(Json::as_str) {
                    outcome.references.push(Reference {
                        what: what.to_owned(),
                        text: text.to_owned(),
                        span: value.span(),
                        path: at.path.to_vec(),
                    });
                }
            }
            _ => {}
        }
    }

    /// Checks type, choices and limits of one value.
    fn scalar<N: TomlNode>(
        &self,
        view: &TomlView<N>,
        span: Range<usize>,
        schema: &'s Json,
        at: At,
        outcome: &mut Outcome,
    ) {
        let name = at.name();
        let types = types(schema);
        let of_type = types.is_empty() || types.iter().any(|kind| view.of_type().is(kind));
        if !of_type || (choices(schema).is_some() && view.of_type() != TomlType::String) {
            return outcome.findings.push(wrong_type(
                view,
                span,
                &self.expected(schema),
                sole_type(schema),
                at.path,
                &name,
            ));
        }
        match view {
            TomlView::String(text) => {
                if let Some(choices) = choices(schema).filter(|choices| !choices.contains(text)) {
                    return outcome.findings.push(unknown_choice(at.path, &name, text, span, &choices, &[]));
                }
                let length = text.chars().count() as u64;
                let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
                if let Some(least) = limit("minLength").filter(|least| length < *least) {
                    let (message, allowed) = match least {
                        1 => (format!("`{name}` must not be empty"), String::new()),
                        _ => (format!("`{name}` has {length} characters"), format!("at least {least}")),
                    };
                    outcome.push(at.path, span, message, Problem::OutOfRange { allowed });
                } else if let Some(most) = limit("maxLength").filter(|most| length > *most) {
                    let message = format!("`{name}` has {length} characters");
                    outcome.push(at.path, span, message, Problem::OutOfRange { allowed: format!("at most {most}") });
                }
            }
            TomlView::Integer(text, None) => {
                let allowed = format!("64-bit integers end at {}", i64::MAX);
                outcome.push(at.path, span, format!("`{name}` cannot be {text}"), Problem::OutOfRange { allowed });
            }
            TomlView::Integer(_, Some(value)) => {
                self.limits(&value.to_string(), *value as f64, span, schema, at, outcome);
            }
            TomlView::Float(text, value) => self.limits(text, *value, span, schema, at, outcome),
            _ => {}
        }
    }

    fn limits(&self, text: &str, number: f64, span: Range<usize>, schema: &Json, at: At, outcome: &mut Outcome) {
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
        let allowed = if !number.is_finite() {
            "a finite number is needed".to_owned()
        } else if let Some(least) = least.filter(|least| number < *least) {
            format!("at least {least}")
        } else if let Some(most) = most.filter(|most| number > *most) {
            format!("at most {most}")
        } else if let Some(low) = limit("exclusiveMinimum").filter(|low| number <= *low) {
            format!("above {low}")
        } else if let Some(high) = limit("exclusiveMaximum").filter(|high| number >= *high) {
            format!("below {high}")
        } else if let Some(step) = limit("multipleOf").filter(|step| (number / step).fract() != 0.0) {
            format!("a multiple of {step}")
        } else {
            return;
        };
        outcome.push(at.path, span, format!("`{}` cannot be {text}", at.name()), Problem::OutOfRange { allowed });
    }

    fn array<N: TomlNode>(&self, items: &[N], span: Range<usize>, schema: &'s Json, at: At, outcome: &mut Outcome) {
        let name = at.name();
        let count = items.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        let (least, most) = (limit("minItems").unwrap_or(0), limit("maxItems").unwrap_or(u64::MAX));
        if count < least || count > most {
            let allowed = match (least, most) {
                (least, most) if least == most => format!("exactly {least}"),
                (least, _) if count < least => format!("at least {least}"),
                _ => format!("at most {most}"),
            };
            let message = match count {
                0 => format!("`{name}` must not be empty"),
                1 => format!("`{name}` has 1 element"),
                _ => format!("`{name}` has {count} elements"),
            };
            outcome.push(at.path, span, message, Problem::OutOfRange { allowed });
        }
        let unique = schema.get("uniqueItems").and_then(Json::as_bool).unwrap_or(false);
        let mut seen: Vec<(&str, Range<usize>)> = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let path = at.index(index);
            let inner = At { owner: at.owner, path: &path };
            let schema = match schema.get("items") {
                Some(Json::Array(each)) => each.get(index).or(schema.get("additionalItems")),
                all => all,
            };
            if let Some(schema) = schema {
                self.value(item, schema, inner, outcome);
            }
            if let (true, TomlView::String(text)) = (unique, item.view()) {
                match seen.iter().find(|(other, _)| *other == text) {
                    Some((_, first)) => {
                        let problem = Problem::Repeated { first: first.clone() };
                        outcome.push(&path, item.span(), format!("`{name}` names `{text}` twice"), problem);
                    }
                    None => seen.push((text, item.span())),
                }
            }
        }
    }

    fn members<N: TomlNode>(
        &self,
        members: &[Member<N>],
        header: Range<usize>,
        schema: &'s Json,
        at: At,
        outcome: &mut Outcome,
    ) {
        let properties = schema.get("properties").and_then(Json::as_object);
        let open = schema.get("additionalProperties");
        let known = || properties.into_iter().flat_map(|properties| properties.keys().map(String::as_str));
        let keys = schema.get(KEY_REFERENCE).and_then(Json::as_str);
        for member in members {
            let path = at.key(member.key);
            outcome.references.extend(keys.map(|what| Reference {
                what: what.to_owned(),
                text: member.key.to_owned(),
                span: member.key_span.clone(),
                path: path.clone(),
            }));
            let inner = At { owner: at.owner, path: &path };
            if let Some(schema) = properties.and_then(|properties| properties.get(member.key)) {
                self.value(member.value, schema, inner, outcome);
            } else if let Some(schema) = open.filter(|schema| schema.is_object()) {
                self.value(member.value, schema, inner, outcome);
            } else if open == Some(&Json::Bool(false)) {
                // A table whose schema does not mention keys is checked by the union around it.
                let message = format!("`{}` has no option `{}`", at.table(), member.key);
                let known = known().map(str::to_owned).collect();
                let problem = Problem::UnknownKey { key: member.key.to_owned(), known, form: false };
                outcome.push(&path, member.key_span.clone(), message, problem);
            }
        }
        for key in schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str) {
            if !members.iter().any(|member| member.key == key) {
                let option = properties.and_then(|properties| properties.get(key));
                let meaning = option.and_then(|option| self.meaning(option));
                let problem = Problem::MissingKey { key: key.to_owned(), meaning, choices: Vec::new() };
                outcome.push(&at.key(key), header.clone(), format!("`{}` needs `{key}`", at.table()), problem);
            }
        }
        let count = members.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        let (least, most) = (limit("minProperties").unwrap_or(0), limit("maxProperties").unwrap_or(u64::MAX));
        if count >= least && count <= most {
            return;
        }
        let table = at.table();
        let (message, problem) = match (least, most, count) {
            (1, 1, _) => {
                let problem = Problem::NotOneForm { forms: known().map(str::to_owned).collect() };
                (format!("`{table}` needs exactly one key"), problem)
            }
            (_, _, 0) => (format!("`{table}` must not be empty"), Problem::OutOfRange { allowed: String::new() }),
            _ if count < least => {
                (format!("`{table}` has {count} keys"), Problem::OutOfRange { allowed: format!("at least {least}") })
            }
            _ => (format!("`{table}` has {count} keys"), Problem::OutOfRange { allowed: format!("at most {most}") }),
        };
        outcome.push(at.path, header, message, problem);
    }

    /// Validates a value that may have one of several forms: picks the intended form, and reports its mistakes.
    fn union<N: TomlNode>(&self, value: &N, branches: &'s [Json], at: At, outcome: &mut Outcome) {
        let mut trials: Vec<(&'s Json, Outcome)> = Vec::new();
        for branch in branches {
            let mut trial = Outcome::default();
            self.value(value, branch, at, &mut trial);
            if trial.findings.is_empty() {
                outcome.references.extend(trial.references);
                return;
            }
            trials.push((self.target(branch), trial));
        }
        let view = value.view();
        let judged = match &view {
            TomlView::String(text) => self.word(text, value.span(), &trials, at, outcome),
            TomlView::Table(members) => self.form(members, value.span(), &mut trials, at, outcome),
            _ => false,
        };
        if judged {
            return;
        }
        // Otherwise, the form of the same type with the fewest mistakes is intended.
        let of_type = |branch: &Json| {
            let types = types(branch);
            types.is_empty() || types.iter().any(|kind| view.of_type().is(kind))
        };
        let nearest = trials
            .iter()
            .enumerate()
            .filter(|(_, (branch, _))| of_type(branch))
            .min_by_key(|(_, (_, trial))| trial.findings.len())
            .map(|(index, _)| index);
        match nearest {
            Some(index) => outcome.findings.extend(trials.swap_remove(index).1.findings),
            None => {
                let mut forms: Vec<String> = Vec::new();
                for (branch, _) in trials.iter().filter(|(branch, _)| sole_key(branch).is_none()) {
                    let form = self.expected(branch);
                    if !forms.contains(&form) {
                        forms.push(form);
                    }
                }
                let tags: Vec<&str> = trials.iter().filter_map(|(branch, _)| sole_key(branch)).collect();
                if !tags.is_empty() {
                    forms.push(format!("a table with one of {}", listing(tags)));
                }
                let expected = forms.join(" or ");
                let mut finding = wrong_type(&view, value.span(), &expected, None, at.path, &at.name());
                if let Problem::WrongType { key, .. } = &mut finding.problem {
                    *key = self.key_of_form(value, trials.iter().map(|(branch, _)| *branch), at);
                }
                outcome.findings.push(finding);
            }
        }
    }

    /// The key of a table form whose value may be this one.
    fn key_of_form<N: TomlNode>(
        &self,
        value: &N,
        mut branches: impl Iterator<Item = &'s Json>,
        at: At,
    ) -> Option<String> {
        branches.find_map(|branch| {
            let takes = |key: &&str| {
                let mut trial = Outcome::default();
                self.value(value, &branch["properties"][*key], at, &mut trial);
                trial.findings.is_empty()
            };
            form_keys(branch).into_iter().find(takes).map(str::to_owned)
        })
    }

    /// Reports a string that fits no form, if some form is a choice of words.
    fn word(
        &self,
        text: &str,
        span: Range<usize>,
        trials: &[(&'s Json, Outcome)],
        at: At,
        outcome: &mut Outcome,
    ) -> bool {
        let words: Vec<&str> = trials.iter().flat_map(|(branch, _)| choices(branch).unwrap_or_default()).collect();
        if words.is_empty() {
            return false;
        }
        let forms: Vec<&str> = trials.iter().flat_map(|(branch, _)| form_keys(branch)).collect();
        outcome.findings.push(unknown_choice(at.path, &at.name(), text, span, &words, &forms));
        true
    }

    /// Reports a table that fits no form, if a key or a constant distinguishes the forms.
    fn form<N: TomlNode>(
        &self,
        members: &[Member<N>],
        span: Range<usize>,
        trials: &mut Vec<(&'s Json, Outcome)>,
        at: At,
        outcome: &mut Outcome,
    ) -> bool {
        let owned = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let given = |key: &str| members.iter().find(|member| member.key == key);
        let name = at.name();
        let branches: Vec<&'s Json> = trials.iter().map(|(branch, _)| *branch).collect();
        let mut take = |index: usize, outcome: &mut Outcome| {
            let (_, meant) = trials.swap_remove(index);
            outcome.findings.extend(meant.findings);
            outcome.references.extend(meant.references);
        };
        // `{ of_table = … }`: the key selects the form.
        let tags: Vec<&str> = branches.iter().filter_map(|branch| sole_key(branch)).collect();
        let chosen: Vec<&str> = tags.iter().copied().filter(|tag| given(tag).is_some()).collect();
        if chosen.len() > 1 {
            let message = format!("`{name}` takes only one of {}", listing(chosen));
            outcome.push(at.path, span, message, Problem::NotOneForm { forms: Vec::new() });
            return true;
        }
        if let Some(index) = branches.iter().position(|branch| sole_key(branch).is_some_and(|tag| given(tag).is_some()))
        {
            take(index, outcome);
            return true;
        }
        if !tags.is_empty() {
            for member in members {
                let message = format!("`{name}` has no form `{}`", member.key);
                let problem = Problem::UnknownKey { key: member.key.to_owned(), known: owned(&tags), form: true };
                outcome.push(&at.key(member.key), member.key_span.clone(), message, problem);
            }
            if members.is_empty() {
                let message = format!("`{name}` needs exactly one key");
                outcome.push(at.path, span, message, Problem::NotOneForm { forms: owned(&tags) });
            }
            return true;
        }
        // `{ type = "a", … }`: a constant selects the form.
        let Some(tag) = branches.iter().find_map(|branch| constant_key(branch)) else { return false };
        let words: Vec<&str> = branches.iter().filter_map(|branch| constant(branch, tag)).collect();
        let Some(member) = given(tag) else {
            let problem = Problem::MissingKey { key: tag.to_owned(), meaning: None, choices: owned(&words) };
            outcome.push(&at.key(tag), span, format!("`{}` needs `{tag}`", at.table()), problem);
            return true;
        };
        let path = at.key(tag);
        let name = DisplayPath(&path).to_string();
        match member.value.view() {
            TomlView::String(text) => match branches.iter().position(|branch| constant(branch, tag) == Some(text)) {
                Some(index) => take(index, outcome),
                None => outcome.findings.push(unknown_choice(&path, &name, text, member.value.span(), &words, &[])),
            },
            view => {
                let expected = format!("one of {}", listing(words));
                outcome.findings.push(wrong_type(&view, member.value.span(), &expected, None, &path, &name));
            }
        }
        true
    }

    /// The first sentence of a description.
    fn meaning(&self, schema: &'s Json) -> Option<String> {
        let all_of = schema.get("allOf").and_then(Json::as_array).and_then(|parts| parts.first());
        let own = |schema: &Json| schema.get("description").and_then(Json::as_str).map(str::to_owned);
        own(schema)
            .or_else(|| own(self.target(schema)))
            .or_else(|| own(self.target(all_of?)))
            .map(|text| first_sentence(&text))
    }

    /// The values that a schema accepts, in words.
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
                        true if schema.get(KEY_REFERENCE).is_some() => "a table of weights".to_owned(),
                        true => "a table".to_owned(),
                        false if one => format!("a table with one of {}", listing(keys)),
                        false => format!("a table of {}", listing(keys)),
                    }
                }
                "array" => match array_length(schema) {
                    Some(length) => format!("an array of {length}"),
                    None => "an array".to_owned(),
                },
                "string" => "a string".to_owned(),
                "integer" => "an integer".to_owned(),
                "number" => "a number".to_owned(),
                "boolean" => "a boolean".to_owned(),
                other => other.to_owned(),
            })
            .collect();
        if forms.is_empty() { "of another form".to_owned() } else { forms.join(" or ") }
    }
}

fn wrong_type<N: TomlNode>(
    view: &TomlView<N>,
    span: Range<usize>,
    expected: &str,
    wanted: Option<TomlType>,
    path: &[Step],
    name: &str,
) -> Finding {
    let problem = Problem::WrongType { wanted, found: view.of_type(), text: view.text(), key: None, length: None };
    Finding { path: path.to_vec(), span, message: format!("`{name}` must be {expected}"), problem }
}

fn unknown_choice(
    path: &[Step],
    name: &str,
    text: &str,
    span: Range<usize>,
    choices: &[&str],
    forms: &[&str],
) -> Finding {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let problem = Problem::UnknownChoice { text: text.to_owned(), choices: owned(choices), forms: owned(forms) };
    Finding { path: path.to_vec(), span, message: format!("`{name}` cannot be \"{text}\""), problem }
}

/// The mistakes in the text of a table of options, in the order of the text. `owner` names the table in messages.
///
/// # Errors
/// If the text is not TOML.
pub fn check(
    owner: &str,
    schema: &Json,
    definitions: &Map<String, Json>,
    text: &str,
) -> Result<Vec<Finding>, toml::de::Error> {
    let table = DeTable::parse(text)?;
    Ok(Validator { definitions }.table(owner, spanned_members(table.get_ref()), table.span(), schema).findings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keywords::unsupported;
    use crate::value::plain_members;
    use serde_json::json;

    fn messages(schema: &Json, text: &str) -> Vec<String> {
        let definitions = Map::new();
        let validator = Validator { definitions: &definitions };
        let table = DeTable::parse(text).expect("TOML");
        let spanned = validator.table("owner", spanned_members(table.get_ref()), table.span(), schema);
        let plain: toml::Table = toml::from_str(text).expect("TOML");
        let plain = validator.table("owner", plain_members(&plain), 0..0, schema);
        let of = |outcome: &Outcome| -> Vec<(Vec<Step>, Problem)> {
            let without_spans = |finding: &Finding| match &finding.problem {
                Problem::Repeated { .. } => Problem::Repeated { first: 0..0 },
                other => other.clone(),
            };
            outcome.findings.iter().map(|finding| (finding.path.clone(), without_spans(finding))).collect()
        };
        assert_eq!(of(&spanned), of(&plain), "{text}");
        for finding in &spanned.findings {
            assert!(finding.span.end <= text.len(), "{finding:?}");
        }
        spanned.findings.iter().map(|finding| format!("{}: {}", DisplayPath(&finding.path), finding.message)).collect()
    }

    #[test]
    fn a_table_that_takes_the_value_is_named() {
        let pair = json!({ "type": "array", "items": { "type": "integer" }, "minItems": 2, "maxItems": 2 });
        let number = json!({ "type": "number" });
        let forms = json!({ "type": ["integer", "object"], "maxProperties": 1,
                            "properties": { "scale": number, "integers": pair } });
        let union = json!({ "anyOf": [{ "type": "integer" }, { "type": "object", "required": ["integers"],
                                      "properties": { "integers": pair } }] });
        for (schema, text, wanted) in [
            (&forms, "[12, 24]", Some("integers")),
            (&union, "[12, 24]", Some("integers")),
            (&forms, "1.5", Some("scale")),
            (&forms, "[12, 24, 36]", None),
            (&forms, "'a'", None),
        ] {
            let schema = json!({ "properties": { "x": schema } });
            let found = check("owner", &schema, &Map::new(), &format!("x = {text}")).expect("TOML");
            let Problem::WrongType { key, text: shown, .. } = &found[0].problem else { panic!("{found:?}") };
            assert_eq!(key.as_deref(), wanted, "{text}");
            assert!(wanted.is_none() || shown == text, "{shown}");
        }
    }

    #[test]
    fn every_keyword_refuses_at_its_limit() {
        let cases = [
            (json!({ "minimum": 2 }), "2", "1.9", "`x` cannot be 1.9"),
            (json!({ "maximum": 2 }), "2.0", "3", "`x` cannot be 3"),
            (json!({ "exclusiveMinimum": 0 }), "1e-9", "0", "`x` cannot be 0"),
            (json!({ "exclusiveMaximum": 1 }), "0.9", "1.0", "`x` cannot be 1.0"),
            (json!({ "multipleOf": 4 }), "8", "6", "`x` cannot be 6"),
            (json!({ "format": "uint32" }), "4294967295", "4294967296", "`x` cannot be 4294967296"),
            (json!({ "type": "number" }), "1", "nan", "`x` cannot be nan"),
            (json!({ "type": "integer" }), "1", "1.0", "`x` must be an integer"),
            (json!({ "type": "string" }), "''", "1", "`x` must be a string"),
            (json!({ "type": "boolean" }), "true", "'true'", "`x` must be a boolean"),
            (json!({ "type": ["integer", "array"] }), "[]", "'a'", "`x` must be an integer or an array"),
            (json!({ "minLength": 1 }), "'é'", "''", "`x` must not be empty"),
            (json!({ "maxLength": 2 }), "'éé'", "'abc'", "`x` has 3 characters"),
            (json!({ "enum": ["a", "b"] }), "'b'", "'c'", "`x` cannot be \"c\""),
            (json!({ "const": "a" }), "'a'", "'c'", "`x` cannot be \"c\""),
            (json!({ "minItems": 1 }), "[1]", "[]", "`x` must not be empty"),
            (json!({ "maxItems": 1 }), "[1]", "[1, 2]", "`x` has 2 elements"),
            (json!({ "uniqueItems": true }), "['a', 'b']", "['a', 'a']", "`x` names `a` twice"),
            (json!({ "items": { "type": "string" } }), "['a']", "[1]", "`x[0]` must be a string"),
            (
                json!({ "items": [{}], "additionalItems": { "type": "string" } }),
                "[1, 'a']",
                "[1, 2]",
                "`x[1]` must be a string",
            ),
            (json!({ "additionalProperties": false }), "{}", "{ a = 1 }", "`owner.x` has no option `a`"),
            (
                json!({ "additionalProperties": { "type": "string" } }),
                "{ a = 'b' }",
                "{ a = 1 }",
                "`x.a` must be a string",
            ),
            (json!({ "required": ["a"] }), "{ a = 1 }", "{}", "`owner.x` needs `a`"),
            (json!({ "minProperties": 1 }), "{ a = 1 }", "{}", "`owner.x` must not be empty"),
            (json!({ "maxProperties": 1 }), "{ a = 1 }", "{ a = 1, b = 2 }", "`owner.x` has 2 keys"),
            (json!({ "allOf": [{ "type": "string" }] }), "'a'", "1", "`x` must be a string"),
            (
                json!({ "oneOf": [{ "type": "string" }, { "type": "array" }] }),
                "[]",
                "1",
                "`x` must be a string or an array",
            ),
            (
                json!({ "anyOf": [{ "type": "integer", "minimum": 3 }, { "type": "string" }] }),
                "3",
                "2",
                "`x` cannot be 2",
            ),
        ];
        for (schema, good, bad, message) in cases {
            let table = json!({ "properties": { "x": schema } });
            assert_eq!(unsupported(&table, &Map::new()), Vec::<String>::new(), "{schema}");
            assert_eq!(messages(&table, &format!("x = {good}")), Vec::<String>::new(), "{schema}");
            let found = messages(&table, &format!("x = {bad}"));
            assert_eq!(found.len(), 1, "{schema}: {found:?}");
            assert!(found[0].ends_with(&format!(": {message}")), "{schema}: {found:?}");
        }
    }

    #[test]
    fn the_form_that_was_meant_is_judged() {
        let form = |key: &str| {
            json!({
                "type": "object", "required": [key], "additionalProperties": false,
                "properties": { key: { "type": "number", "maximum": 1 } }
            })
        };
        let tagged = |word: &str| {
            json!({
                "type": "object", "required": ["type"], "additionalProperties": false,
                "properties": { "type": { "const": word }, word: { "type": "number" } }
            })
        };
        let either = json!({
            "type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
            "properties": { "auto": { "type": "object" }, "stops": { "type": "number" } }
        });
        let schema = json!({ "properties": {
            "x": { "oneOf": [{ "enum": ["all"], "type": "string" }, form("fraction"), form("disk")] },
            "y": { "oneOf": [tagged("below"), tagged("above")] },
            "z": { "oneOf": [{ "enum": ["auto"], "type": "string" }, either] }
        } });
        let check = |text: &str, expected: &[&str]| assert_eq!(messages(&schema, text), expected, "{text}");
        check("x = { fraction = 2 }", &["x.fraction: `x.fraction` cannot be 2"]);
        check("x = { fractions = 2 }", &["x.fractions: `x` has no form `fractions`"]);
        check("x = { fraction = 1, disk = 1 }", &["x: `x` takes only one of `fraction`, `disk`"]);
        check("x = {}", &["x: `x` needs exactly one key"]);
        check("x = 'every'", &["x: `x` cannot be \"every\""]);
        check("x = 1", &["x: `x` must be \"all\" or a table with one of `fraction`, `disk`"]);
        check("y = { type = 'below', below = 'a' }", &["y.below: `y.below` must be a number"]);
        check("y = { type = 'beside' }", &["y.type: `y.type` cannot be \"beside\""]);
        check("y = { type = 1 }", &["y.type: `y.type` must be one of `below`, `above`"]);
        check("y = { below = 1 }", &["y.type: `owner.y` needs `type`"]);
        let help = |text: &str| {
            let (table, definitions) = (DeTable::parse(text).expect("TOML"), Map::new());
            let validator = Validator { definitions: &definitions };
            let outcome = validator.table("owner", spanned_members(table.get_ref()), table.span(), &schema);
            outcome.findings.into_iter().next().expect("a mistake").help()
        };
        let choices = "one of `all`, or a table with one of `fraction`, `disk`";
        assert_eq!(help("x = 'every'").as_deref(), Some(choices));
        assert_eq!(help("z = 'none'").as_deref(), Some("one of `auto`, or a table with one of `auto`, `stops`"));
        assert_eq!(help("x = { fractions = 2 }").as_deref(), Some("one of `fraction`, `disk`"));
        assert_eq!(help("x = {}").as_deref(), Some("one of `fraction`, `disk`"));
        assert_eq!(help("y = { type = 'beside' }").as_deref(), Some("one of `below`, `above`"));
    }

    #[test]
    fn keywords_that_nobody_checks_are_listed() {
        let definitions = json!({ "Inner": { "items": { "pattern": "a" } } });
        let schema = json!({
            "type": "object", "if": {}, "x-note": 1,
            "properties": { "a": { "$ref": "#/definitions/Inner" }, "b": { "const": 3 }, "c": { "format": "uri" } }
        });
        let faults = unsupported(&schema, definitions.as_object().expect("an object"));
        let keywords: Vec<&str> = faults.iter().filter_map(|fault| fault.split('`').nth(1)).collect();
        assert_eq!(keywords, ["if", "pattern", "const", "format"], "{faults:?}");
        assert!(faults[1].ends_with("at `a`"), "{faults:?}");
    }
}
