//! Turns what the validator of options finds into diagnostics: codes, labels, suggestions and new names of options.

use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::fix::Change;
use crate::text::source::Span;
use crate::text::suggest::{did_you_mean, listing, nearest};
use serde_json::Value as Json;
use std::collections::BTreeSet;
use syntable_model::registry::RecipeValue;
use syntable_toml_schema::{
    Finding, Outcome, Problem, Reference, Step, TomlNode, TomlType, Validator, spanned_members,
};
use toml::de::DeTable;

/// Old and new paths of options of one table.
pub(crate) type Renamed<'r> = &'r [(&'r str, &'r str)];

/// The result of a check of one table.
#[derive(Debug, Default)]
pub(crate) struct Checked {
    pub diagnostics: Vec<DiagnosticBuilder>,
    pub references: Vec<Reference>,
    /// Options of the table that are wrong, or that have a mistake inside.
    pub wrong: BTreeSet<String>,
    /// Options under old names: the path and the new path of each.
    pub renamed: Vec<(Vec<Step>, String)>,
}

/// Checks a table of options. `owner` names it in messages; `header` is where missing keys are reported.
pub(crate) fn options(
    validator: Validator,
    owner: &str,
    table: &DeTable,
    header: &Span,
    schema: &Json,
    renamed: &[Renamed],
) -> Checked {
    let Outcome { findings, references } = validator.table(owner, spanned_members(table), header.clone(), schema);
    let wrong = findings.iter().filter_map(|finding| match finding.path.first() {
        Some(Step::Key(key)) => Some(key.clone()),
        _ => None,
    });
    let wrong = wrong.collect();
    let new_name = |path: &[Step]| {
        let old = dotted(path);
        renamed.iter().flat_map(|table| table.iter()).find(|(from, _)| *from == old).map(|(_, to)| *to)
    };
    // A misspelled or renamed key is one mistake, not also a missing one.
    let meant: BTreeSet<String> = findings
        .iter()
        .filter_map(|finding| match &finding.problem {
            Problem::UnknownKey { key, known, .. } => match new_name(&finding.path) {
                Some(new) => Some(new.to_owned()),
                None => {
                    let near = nearest(key, known.iter().map(String::as_str))?;
                    let parents = &finding.path[..finding.path.len() - 1];
                    Some(dotted(&[parents, &[Step::Key(near.to_owned())]].concat()))
                }
            },
            _ => None,
        })
        .collect();
    let old_names = findings.iter().filter(|finding| matches!(finding.problem, Problem::UnknownKey { .. }));
    let renamed = old_names.filter_map(|finding| Some((finding.path.clone(), new_name(&finding.path)?.to_owned())));
    let renamed = renamed.collect();
    let diagnostics = findings
        .into_iter()
        .filter(|finding| {
            !matches!(finding.problem, Problem::MissingKey { .. }) || !meant.contains(&dotted(&finding.path))
        })
        .map(|finding| match (&finding.problem, new_name(&finding.path)) {
            (Problem::UnknownKey { .. }, Some(new)) => renamed_key(owner, finding.span, &dotted(&finding.path), new),
            _ => diagnostic(finding),
        })
        .collect();
    Checked { diagnostics, references, wrong, renamed }
}

/// The diagnostic for a key that has another name now.
pub(crate) fn renamed_key(owner: &str, span: Span, old: &str, new: &str) -> DiagnosticBuilder {
    // The label marks the last word of the old path: in the same table the new word is enough.
    let beside = old.rsplit_once('.').and_then(|(table, _)| new.strip_prefix(table)?.strip_prefix('.'));
    let diagnostic =
        DiagnosticBuilder::error(Code::Renamed, span, format!("`{old}` of `{owner}` is called `{new}` now"))
            .label(format!("write `{}`", beside.unwrap_or(new)));
    match (old.rsplit_once('.'), beside) {
        // The new option is in another table.
        (Some(_), None) => diagnostic,
        (words, beside) => diagnostic.change(Change::Word {
            old: words.map_or(old, |(_, word)| word).to_owned(),
            new: beside.unwrap_or(new).to_owned(),
        }),
    }
}

/// The keys of a path, without indices of arrays.
fn dotted(path: &[Step]) -> String {
    let keys = path.iter().filter_map(|step| match step {
        Step::Key(key) => Some(key.as_str()),
        Step::Index(_) => None,
    });
    keys.collect::<Vec<_>>().join(".")
}

fn diagnostic(finding: Finding) -> DiagnosticBuilder {
    let error = |code| DiagnosticBuilder::error(code, finding.span, finding.message);
    let names = |names: &[String]| listing(names.iter().map(String::as_str));
    match finding.problem {
        Problem::WrongType { key: Some(key), text, .. } if !text.is_empty() => {
            error(Code::WrongType).label(format!("write `{{ {key} = {text} }}`"))
        }
        Problem::WrongType { length: Some(2), found: TomlType::String, text, .. } if size_of(&text).is_some() => {
            let [width, height] = size_of(&text).unwrap_or_default();
            error(Code::WrongType).label(format!("write [{width}, {height}]"))
        }
        Problem::WrongType { length: Some(length), found, text, .. } if found != TomlType::Array => {
            error(Code::WrongType).label(array_label(length, found, &text))
        }
        Problem::WrongType { wanted, found, text, .. } => {
            error(Code::WrongType).label(type_label(wanted, found, &text))
        }
        Problem::OutOfRange { allowed } => error(Code::OutOfRange).label(allowed),
        Problem::UnknownChoice { text, choices, forms } => {
            let diagnostic = error(Code::UnknownChoice)
                .label(did_you_mean(&text, choices.iter().map(String::as_str)))
                .help(format!("one of {}", names(&choices)));
            if forms.is_empty() {
                diagnostic
            } else {
                diagnostic.help(format!("or a table with one of {}", names(&forms)))
            }
        }
        Problem::Repeated { first } => error(Code::InvalidValue).also(first, "first here"),
        Problem::UnknownKey { key, known, form } => error(Code::UnknownKey)
            .label(did_you_mean(&key, known.iter().map(String::as_str)))
            .help(match (known.is_empty(), form) {
                (true, _) => "it has no options".to_owned(),
                (false, true) => format!("one of {}", names(&known)),
                (false, false) => format!("its options are {}", names(&known)),
            }),
        Problem::MissingKey { key, meaning, choices } => {
            let diagnostic = error(Code::MissingKey).label(format!("add `{key} = …`"));
            match meaning {
                Some(meaning) => diagnostic.help(format!("{key}: {meaning}")),
                None if choices.is_empty() => diagnostic,
                None => diagnostic.help(format!("one of {}", names(&choices))),
            }
        }
        Problem::NotOneForm { forms } if forms.is_empty() => error(Code::InvalidValue),
        Problem::NotOneForm { forms } => error(Code::InvalidValue).help(format!("one of {}", names(&forms))),
    }
}

/// Describes a value of the wrong type. Explains how to write it if the value shows that.
fn type_label(wanted: Option<TomlType>, found: TomlType, text: &str) -> String {
    let this = match found {
        TomlType::Boolean => format!("this is {text}"),
        other => format!("this is {}", other.with_article()),
    };
    match (wanted, found) {
        (Some(TomlType::Integer), TomlType::Float) => {
            let whole = text.parse::<f64>().ok().filter(|number| number.fract() == 0.0 && number.abs() < 1e15);
            whole.map_or(this, |number| format!("write {number}"))
        }
        (Some(TomlType::String), TomlType::Datetime | TomlType::Integer | TomlType::Float | TomlType::Boolean) => {
            format!("{this}; put it in quotes")
        }
        (Some(TomlType::Integer | TomlType::Float), TomlType::String) if text.trim().parse::<f64>().is_ok() => {
            format!("{this}; write it without quotes")
        }
        (Some(TomlType::Integer | TomlType::Float), TomlType::String) if is_number_with_unit(text) => {
            format!("{this}; write a bare number, in the unit that the option's name states")
        }
        (Some(TomlType::Integer | TomlType::Float), TomlType::Table) => {
            format!("{this}; write one number, since this option is not random")
        }
        (Some(TomlType::String), TomlType::Array) => format!("{this}; write one string, without `[ ]`"),
        (Some(TomlType::Boolean), TomlType::String) if text == "true" || text == "false" => {
            format!("{this}; write it without quotes")
        }
        (Some(TomlType::Integer | TomlType::Float), TomlType::Array) if only_element(text).is_some() => {
            format!("{this}; write {}", only_element(text).unwrap_or_default())
        }
        (Some(TomlType::Array), _) => format!("{this}; put it in `[ ]` for an array of one"),
        _ => this,
    }
}

/// Describes a value that should be an array of some length, and shows how to write the array.
fn array_label(length: u64, found: TomlType, text: &str) -> String {
    let this = format!("this is {}", found.with_article());
    match found {
        TomlType::Integer | TomlType::Float if (2..=4).contains(&length) => {
            format!("{this}; write {length} of them, such as [{}]", vec![text; length as usize].join(", "))
        }
        _ => format!("{this}; write {length} values in `[ ]`"),
    }
}

/// Whether a text is a number and a unit, such as `5 s` or `30deg`.
fn is_number_with_unit(text: &str) -> bool {
    let number = text.trim_end_matches(|letter: char| letter.is_alphabetic() || letter == '°').trim();
    number.len() < text.trim().len() && number.parse::<f64>().is_ok()
}

/// The element of an array of one number, such as `[3]`.
fn only_element(text: &str) -> Option<&str> {
    text.strip_prefix('[')?.strip_suffix(']').map(str::trim).filter(|inner| !inner.is_empty() && !inner.contains(','))
}

/// Width and height in a text such as `640x480`.
fn size_of(text: &str) -> Option<[u32; 2]> {
    let (width, height) = text.split_once(['x', 'X', '×'])?;
    let number = |text: &str| text.trim().parse().ok();
    Some([number(width)?, number(height)?])
}

/// The type of a parsed value, with its article.
pub(crate) fn type_of(value: &RecipeValue) -> &'static str {
    value.view().of_type().with_article()
}
