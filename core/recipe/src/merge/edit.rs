//! Changes a tree by paths: `place.objects.count`, `lights[0].count`.

use crate::tables::alternatives::ONE_OF;
use crate::tables::check;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::key_path;
use crate::text::source::Span;
use crate::text::suggest::{did_you_mean, listing};
use std::collections::BTreeSet;
use std::ops::Range;
use syntable_model::registry::RecipeValue;
use syntable_toml_schema::{DisplayPath, Step};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Puts a value at a path; missing tables along it are created.
pub(crate) fn set<'a>(
    root: &mut DeTable<'a>,
    steps: &[(Step, Span)],
    value: RecipeValue<'a>,
) -> Result<(), DiagnosticBuilder> {
    let Some(((last, span), parents)) = steps.split_last() else { return Ok(()) };
    let mut position = Position::Table(root);
    for (done, (step, span)) in parents.iter().enumerate() {
        let make = matches!(steps[done + 1].0, Step::Key(_));
        position = position.enter(step, span, &steps[..done], make)?;
    }
    match (position, last) {
        (Position::Table(table), Step::Key(key)) => {
            table.remove(key.as_str());
            table.insert(Spanned::new(span.clone(), key.clone().into()), value);
        }
        (Position::Array(items), step) => *element(items, step, span, parents)? = value,
        (position, _) => return Err(position.no_way(span, parents)),
    }
    Ok(())
}

/// Removes the value at a path.
pub(crate) fn remove(root: &mut DeTable, path: &str, span: &Span) -> Result<(), DiagnosticBuilder> {
    // The string may hold escapes, so steps have no bytes of their own: mistakes mark the whole string.
    let steps: Vec<(Step, Span)> =
        read_path(path, span.start)?.into_iter().map(|(step, _)| (step, span.clone())).collect();
    let Some(((last, _), parents)) = steps.split_last() else { return Ok(()) };
    match (Position::of_path(root, parents)?, last) {
        (Position::Table(table), Step::Key(key)) => match table.remove(key.as_str()) {
            Some(_) => Ok(()),
            None => Err(absent(span, &steps, key, table)),
        },
        (Position::Array(items), step) => {
            let at = index_of(items, step, span, parents)?;
            let all = std::mem::replace(items, DeArray::new());
            *items = all.into_iter().enumerate().filter(|(i, _)| *i != at).map(|(_, item)| item).collect();
            Ok(())
        }
        (position, _) => Err(position.no_way(span, parents)),
    }
}

/// A position on a path through a tree.
pub(crate) enum Position<'t, 'a> {
    /// A table.
    Table(&'t mut DeTable<'a>),
    /// An array.
    Array(&'t mut DeArray<'a>),
    /// A value with nothing inside, by its type in words.
    Scalar(&'static str),
}

impl<'t, 'a> Position<'t, 'a> {
    fn of(value: &'t mut RecipeValue<'a>) -> Self {
        let kind = check::type_of(value);
        match value.get_mut() {
            DeValue::Table(table) => Self::Table(table),
            DeValue::Array(items) => Self::Array(items),
            _ => Self::Scalar(kind),
        }
    }

    /// The position at the end of a path that exists.
    pub fn of_path(root: &'t mut DeTable<'a>, steps: &[(Step, Span)]) -> Result<Self, DiagnosticBuilder> {
        let mut position = Self::Table(root);
        for (done, (step, span)) in steps.iter().enumerate() {
            position = position.enter(step, span, &steps[..done], false)?;
        }
        Ok(position)
    }

    /// Takes one step. `parents` holds the steps before it; `make` adds a table that is missing.
    fn enter(self, step: &Step, span: &Span, parents: &[(Step, Span)], make: bool) -> Result<Self, DiagnosticBuilder> {
        match (self, step) {
            (Self::Table(table), Step::Key(key)) => {
                if !make && !table.contains_key(key.as_str()) {
                    let steps: Vec<(Step, Span)> =
                        parents.iter().cloned().chain([(step.clone(), span.clone())]).collect();
                    return Err(absent(span, &steps, key, table));
                }
                let made = || Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
                Ok(Self::of(table.entry(Spanned::new(span.clone(), key.clone().into())).or_insert_with(made)))
            }
            (Self::Array(items), step) => element(items, step, span, parents).map(Self::of),
            (position, _) => Err(position.no_way(span, parents)),
        }
    }

    /// The diagnostic for a step that leads nowhere from here.
    fn no_way(&self, span: &Span, parents: &[(Step, Span)]) -> DiagnosticBuilder {
        match self {
            Self::Table(_) => cannot(span, parents, "is a table, not an array; name a key of it"),
            Self::Array(_) => cannot(span, parents, "is an array; name an element of it"),
            Self::Scalar(kind) => cannot(span, parents, &format!("is {kind}, and has no keys")),
        }
    }
}

/// The element of an array that a step names.
fn element<'t, 'a>(
    items: &'t mut DeArray<'a>,
    step: &Step,
    span: &Span,
    parents: &[(Step, Span)],
) -> Result<&'t mut RecipeValue<'a>, DiagnosticBuilder> {
    let at = index_of(items, step, span, parents)?;
    items.get_mut(at).ok_or_else(|| cannot(span, parents, "is empty"))
}

/// Parses the path of an option; `at` is the offset of its first byte.
pub(crate) fn read_path(path: &str, at: usize) -> Result<Vec<(Step, Span)>, DiagnosticBuilder> {
    let shift = |range: Range<usize>| range.start + at..range.end + at;
    match key_path::parse(path) {
        Ok(steps) => Ok(steps.into_iter().map(|(step, range)| (step, shift(range))).collect()),
        Err((message, range)) => Err(DiagnosticBuilder::error(
            Code::BadOverride,
            shift(range),
            format!("`{path}` is not the path of an option"),
        )
        .label(message)
        .help("paths look like `render.samples_per_pixel`, `lights[0].count` or `place.objects.count`")),
    }
}

/// The ids of the stages of a list: `id` where given, else the kind or `one_of`, with `_2`, `_3` … appended on repeats.
pub(crate) fn list_ids(items: &DeArray) -> Vec<String> {
    let text = |item: &RecipeValue, key: &str| {
        let value = item.get_ref().as_table().and_then(|table| table.get(key));
        value.and_then(|value| value.get_ref().as_str().map(str::to_owned))
    };
    let mut taken: BTreeSet<String> = items.iter().filter_map(|item| text(item, "id")).collect();
    items
        .iter()
        .map(|item| {
            text(item, "id").unwrap_or_else(|| {
                let has = |key: &str| item.get_ref().as_table().is_some_and(|table| table.contains_key(key));
                let one_of = || has(ONE_OF).then(|| ONE_OF.to_owned());
                let kind = text(item, "kind").or_else(one_of).unwrap_or_default();
                let mut numbered = std::iter::once(kind.clone()).chain((2..).map(|n: u64| format!("{kind}_{n}")));
                let id = numbered.find(|id| !taken.contains(id)).expect("there are more numbers than stages");
                taken.insert(id.clone());
                id
            })
        })
        .collect()
}

/// A path with the elements of lists by index, so that each place has one.
pub(crate) fn by_index(tree: &DeTable, steps: &[(Step, Span)]) -> Vec<Step> {
    let mut place: Vec<Step> = steps.iter().map(|(step, _)| step.clone()).collect();
    let Some(Step::Key(first)) = place.first() else { return place };
    let mut value = tree.get(first.as_str());
    for step in &mut place[1..] {
        value = match (value.map(Spanned::get_ref), &*step) {
            (Some(DeValue::Table(table)), Step::Key(key)) => table.get(key.as_str()),
            (Some(DeValue::Array(items)), Step::Index(index)) => items.get(*index),
            (Some(DeValue::Array(items)), Step::Key(id)) => {
                match list_ids(items).iter().position(|other| other == id) {
                    Some(index) => {
                        *step = Step::Index(index);
                        items.get(index)
                    }
                    None => None,
                }
            }
            _ => None,
        };
    }
    place
}

/// The index of a step in an array: the index itself, or the index of the stage with this id.
fn index_of(items: &DeArray, step: &Step, span: &Span, parents: &[(Step, Span)]) -> Result<usize, DiagnosticBuilder> {
    match step {
        Step::Index(index) if *index < items.len() => Ok(*index),
        Step::Index(_) if items.is_empty() => Err(cannot(span, parents, "is empty")),
        Step::Index(_) => {
            let plural = if items.len() == 1 { "" } else { "s" };
            let message = format!("has {} element{plural}; the last is [{}]", items.len(), items.len() - 1);
            Err(cannot(span, parents, &message))
        }
        Step::Key(key) => {
            let all_tables = items.iter().all(|item| item.get_ref().is_table());
            let ids = if all_tables { list_ids(items) } else { Vec::new() };
            ids.iter().position(|id| id == key).ok_or_else(|| {
                let names: Vec<&str> = ids.iter().map(String::as_str).filter(|id| !id.is_empty()).collect();
                let diagnostic = cannot(span, parents, &format!("has no element `{key}`"))
                    .label(did_you_mean(key, names.iter().copied()));
                if names.is_empty() {
                    diagnostic.help("name its elements by index: [0], [1], …")
                } else {
                    diagnostic.help(format!("its elements are {}; or name one by index: [0]", listing(names)))
                }
            })
        }
    }
}

fn cannot(span: &Span, parents: &[(Step, Span)], message: &str) -> DiagnosticBuilder {
    DiagnosticBuilder::error(Code::BadOverride, span.clone(), format!("`{}` {message}", display(parents)))
}

fn absent(span: &Span, steps: &[(Step, Span)], key: &str, table: &DeTable) -> DiagnosticBuilder {
    let keys: Vec<&str> = table.keys().map(|key| key.get_ref().as_ref()).collect();
    let path = display(steps);
    DiagnosticBuilder::error(Code::BadOverride, span.clone(), format!("`{path}` does not exist"))
        .label(did_you_mean(key, keys.iter().copied()))
        .help(format!("its table has {}", listing(keys)))
}

pub(crate) fn display(steps: &[(Step, Span)]) -> String {
    let steps: Vec<Step> = steps.iter().map(|(step, _)| step.clone()).collect();
    DisplayPath(&steps).to_string()
}
