//! The sections of a recipe that are not stages.

use crate::merge::renamed::RenamedNames;
use crate::schema::kinds::Schemas;
use crate::tables::alternatives::MIXTURE;
use crate::tables::check;
use crate::tables::dataset::{DatasetTable, LockTable};
use crate::tables::stages::Built;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, Span};
use crate::text::suggest::{did_you_mean, listing, synonym};
use serde::Deserialize;
use std::collections::BTreeSet;
use syntable_model::registry::{Registry, Shape, Slot, Stage};
use syntable_model::stage::ViewSampler;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Keys of a recipe that are not slots.
const OTHERS: [&str; 6] = ["dataset", "extends", "remove", "set", "lock", MIXTURE];

/// Refuses sections that no recipe has.
pub(crate) fn unknown(tree: &DeTable, schemas: &Schemas, diagnostics: &mut Vec<DiagnosticBuilder>) {
    let known = || Slot::ALL.into_iter().map(Slot::name).chain(OTHERS);
    for key in tree.keys() {
        let name = key.get_ref().as_ref();
        if !known().any(|known| known == name) {
            diagnostics.push(
                DiagnosticBuilder::error(Code::UnknownKey, key.span(), format!("a recipe has no section `{name}`"))
                    .label(section_of(name, schemas).unwrap_or_else(|| did_you_mean(name, known())))
                    .help(format!("its sections are {}", listing(known()))),
            );
        }
    }
}

/// The section for an option that is outside of all sections, if one section has it or means it.
fn section_of(name: &str, schemas: &Schemas) -> Option<String> {
    let dataset = ("dataset", &schemas.dataset);
    let kinds = schemas.kinds.iter().filter(|kind| kind.slot.shape() == Shape::One);
    let sections = std::iter::once(dataset).chain(kinds.map(|kind| (kind.slot.name(), &kind.options)));
    let found = sections.filter_map(|(section, options)| {
        let options =
            || options["properties"].as_object().into_iter().flat_map(serde_json::Map::keys).map(String::as_str);
        let option = options().find(|option| *option == name).or_else(|| synonym(name, options()))?;
        Some((section, option.to_owned()))
    });
    let found: BTreeSet<(&str, String)> = found.collect();
    let (section, option) = found.first().filter(|_| found.len() == 1)?;
    Some(format!("write `{option}` under [{section}]"))
}

/// Takes `[dataset]` out of the tree, with its bytes.
pub(crate) fn dataset(
    tree: &mut DeTable,
    schemas: &Schemas,
    renamed: &RenamedNames,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<(DatasetSpans, DatasetTable)> {
    let Some(value) = tree.remove("dataset") else {
        diagnostics.push(
            DiagnosticBuilder::error(Code::MissingSection, NOWHERE, "a recipe needs `[dataset]`")
                .help("add, for instance: [dataset] with scenes = 10 and views_per_scene = 5"),
        );
        return None;
    };
    let span = value.span();
    let option = |name: &str| value.get_ref().as_table().and_then(|table| table.get(name));
    let views = option("views_per_scene").map(Spanned::span);
    let bad_name = option("name").and_then(|name| bad_name(name.get_ref().as_str()?, name.span()));
    let is_bad = bad_name.is_some();
    diagnostics.extend(bad_name);
    let table = plain::<DatasetTable>("dataset", value, &schemas.dataset, schemas, renamed.dataset, diagnostics)?;
    Some((DatasetSpans { header: span, views }, table)).filter(|_| !is_bad)
}

/// The diagnostic for the name of a dataset that no folder can have.
fn bad_name(name: &str, span: Span) -> Option<DiagnosticBuilder> {
    let bad = matches!(name, "." | "..") || name.contains(['/', '\\', '\0']);
    bad.then(|| {
        DiagnosticBuilder::error(Code::InvalidValue, span, format!("`name` cannot be {name:?}"))
            .label("the dataset's folder has this name, unless `options.out` names another")
            .help("leave out slashes, and choose the folder with `options.out`")
    })
}

/// Bytes of `[dataset]`.
pub(crate) struct DatasetSpans {
    header: Span,
    views: Option<Span>,
}

/// Takes `[lock]` out of the tree, with its bytes.
pub(crate) fn lock(
    tree: &mut DeTable,
    schemas: &Schemas,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<(LockTable, Span)> {
    let value = tree.remove("lock")?;
    let span = value.span();
    plain(OTHERS[4], value, &schemas.lock, schemas, &[], diagnostics).map(|table| (table, span))
}

/// Reads a section that is not a stage.
fn plain<'a, T: Deserialize<'a>>(
    name: &str,
    value: Spanned<DeValue<'a>>,
    schema: &serde_json::Value,
    schemas: &Schemas,
    renamed: check::Renamed,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<T> {
    let span = value.span();
    let DeValue::Table(table) = value.get_ref() else {
        let found = check::type_of(&value);
        diagnostics.push(
            DiagnosticBuilder::error(Code::WrongType, span, format!("`{name}` must be a table"))
                .label(format!("this is {found}"))
                .help(format!("write [{name}] and its options below")),
        );
        return None;
    };
    let checked = check::options(schemas.validator(), name, table, &span, schema, &[renamed]);
    if !checked.diagnostics.is_empty() {
        diagnostics.extend(checked.diagnostics);
        return None;
    }
    T::deserialize(ValueDeserializer::from(value))
        .map_err(|error| {
            diagnostics.push(DiagnosticBuilder::error(
                Code::InvalidValue,
                error.span().unwrap_or(span),
                error.message(),
            ));
        })
        .ok()
}

/// Warns of versions other than the versions that resolved the recipe.
pub(crate) fn lock_mismatches(lock: &LockTable, span: &Span, registry: &Registry) -> Vec<DiagnosticBuilder> {
    let mut diagnostics = Vec::new();
    let mut warn = |what: &str, recorded: &str, present: Option<&str>| {
        if recorded.is_empty() || present == Some(recorded) {
            return;
        }
        let present = present.map_or("not linked into this program".to_owned(), |version| format!("{version} here"));
        let message = format!("the recipe was resolved with {what} {recorded}, which is {present}");
        diagnostics.push(
            DiagnosticBuilder::warning(Code::LockMismatch, span.clone(), message)
                .help("the dataset may differ from the one that was made then; remove [lock] to accept that"),
        );
    };
    warn("syntable", &lock.syntable, Some(env!("CARGO_PKG_VERSION")));
    for (name, version) in &lock.plugins {
        let entry = registry.entries().iter().find(|entry| entry.crate_name == name);
        warn(name, version, entry.map(|entry| entry.crate_version));
    }
    diagnostics
}

/// The number of views: from `[dataset]`, or from the lists of views of all components.
pub(crate) fn views_per_scene(
    spans: &DatasetSpans,
    dataset: &DatasetTable,
    components: &[(&str, &Built)],
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<u32> {
    let mut numbers = Vec::new();
    for (id, built) in components {
        let before = diagnostics.len();
        let number = views_of_component(spans, dataset, built, diagnostics);
        diagnostics[before..].iter_mut().for_each(|diagnostic| diagnostic.name_component(id));
        numbers.push(number?);
    }
    let first = *numbers.first()?;
    if let Some(other) = numbers.into_iter().find(|other| *other != first) {
        let message = format!("the components of the mixture list {first} and {other} views");
        let diagnostic = DiagnosticBuilder::error(Code::MissingKey, spans.header.clone(), message);
        diagnostics.push(diagnostic.label("add `views_per_scene = …`, for all components"));
        return None;
    }
    Some(first)
}

fn views_of_component(
    spans: &DatasetSpans,
    dataset: &DatasetTable,
    built: &Built,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<u32> {
    let views = built.stages.iter().find_map(|stage| match &stage.stage {
        Some(Stage::Views(views)) => Some(views),
        _ => None,
    });
    let cameras = built.views.rig.len().max(1) as u32;
    let count = |views: &dyn ViewSampler| views.count().map(|poses| poses.saturating_mul(cameras));
    match (dataset.views_per_scene, views.map(|views| count(&**views))) {
        (Some(wanted), _) if !wanted.is_multiple_of(cameras) => {
            let span = spans.views.clone().unwrap_or(spans.header.clone());
            let (below, above) = (wanted / cameras * cameras, (wanted / cameras + 1) * cameras);
            let help = if below == 0 { format!("write {above}") } else { format!("write {below} or {above}") };
            let message = format!("`views_per_scene` is {wanted}, but each pose of the rig gives {cameras} views");
            diagnostics.push(
                DiagnosticBuilder::error(Code::InvalidValue, span, message)
                    .label(format!("not a multiple of {cameras}"))
                    .help(help),
            );
            None
        }
        (Some(wanted), Some(Some(listed))) if wanted > listed => {
            let span = spans.views.clone().unwrap_or(spans.header.clone());
            diagnostics.push(
                DiagnosticBuilder::error(
                    Code::InvalidValue,
                    span,
                    format!("`views_per_scene` is {wanted}, but `[views]` has {listed}"),
                )
                .label(format!("at most {listed}"))
                .help("leave `views_per_scene` out to take all of them"),
            );
            None
        }
        (None, Some(None)) => {
            diagnostics.push(
                DiagnosticBuilder::error(Code::MissingKey, spans.header.clone(), "`dataset` needs `views_per_scene`")
                    .label("add `views_per_scene = …`")
                    .help("views_per_scene: number of views per scene"),
            );
            None
        }
        (wanted, listed) => wanted.or(listed.flatten()),
    }
}
