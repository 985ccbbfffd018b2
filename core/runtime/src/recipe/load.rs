//! Loads a recipe: all texts, all tables, all mistakes.

use super::check::Checker;
use super::code::Code;
use super::dataset::{Dataset, DatasetTable, LockTable};
use super::diagnostic::{Diagnostic, Draft, Report, Severity};
use super::extend::{self, Damage};
use super::lock::{self, ResolvedStage};
use super::overrides::Overrides;
use super::plan::plan;
use super::schema::Schemas;
use super::source::{NOWHERE, Sources, Span};
use super::stages::{Built, Loader};
use super::suggest::{did_you_mean, listing};
use super::{Recipe, Source};
use crate::plan::{Implied, Plan};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::registry::{Registry, Slot, Stage};
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Keys of a recipe that are no slots.
const OTHERS: [&str; 5] = ["dataset", "extends", "remove", "set", "lock"];

/// Loads a recipe.
///
/// Gives the recipe and its warnings, or everything that is wrong with it.
pub fn load(registry: &Registry, source: Source, overrides: &Overrides) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    let mut sources = Sources::default();
    let mut drafts = Vec::new();
    let graph = extend::gather(source, overrides, &mut sources, &mut drafts);
    let incomplete = !drafts.is_empty();
    let (mut tree, mut damage) = graph.merge(&mut drafts);
    damage.lossy |= incomplete;

    let schemas = Schemas::of(registry);
    unknown_sections(&tree, &mut drafts);
    let dataset = dataset(&mut tree, &schemas, &mut drafts);
    let lock = lock_table(&mut tree, &schemas, &mut drafts);
    let loader = Loader { registry, schemas: &schemas, overrides, sources: &sources };
    let mut built = loader.build(&mut tree, &mut drafts);
    let plan = plan(registry, &mut built, &mut drafts);
    if let Some(lock) = &lock {
        drafts.extend(lock_mismatches(&lock.0, &lock.1, registry));
    }
    let views = views_per_scene(dataset.as_ref(), &built, &mut drafts);

    let diagnostics = finish(&sources, drafts, &damage);
    if diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        return Err(Report { diagnostics });
    }
    let dataset = dataset.map(|(_, table)| DatasetTable { views_per_scene: views, ..table });
    match dataset.and_then(|dataset| assemble(dataset, built, plan?, lock.map(|lock| lock.0).unwrap_or_default())) {
        Some(recipe) => Ok((recipe, diagnostics)),
        None => {
            // Only a text that was lost to a syntax error leaves a recipe without a part and without an error of its own.
            let draft = Draft::error(Code::MissingSection, NOWHERE, "the recipe is not complete");
            Err(Report { diagnostics: vec![sources.diagnostic(draft)] })
        }
    }
}

fn unknown_sections(tree: &DeTable, drafts: &mut Vec<Draft>) {
    let known = || Slot::ALL.into_iter().map(Slot::name).chain(OTHERS);
    for key in tree.keys() {
        let name = key.get_ref().as_ref();
        if !known().any(|known| known == name) {
            drafts.push(
                Draft::error(Code::UnknownKey, key.span(), format!("a recipe has no section `{name}`"))
                    .label(did_you_mean(name, known()))
                    .help(format!("its sections are {}", listing(known()))),
            );
        }
    }
}

/// Takes `[dataset]` out of the tree, with its place.
fn dataset(tree: &mut DeTable, schemas: &Schemas, drafts: &mut Vec<Draft>) -> Option<(DatasetSpans, DatasetTable)> {
    let Some(value) = tree.remove("dataset") else {
        drafts.push(
            Draft::error(Code::MissingSection, NOWHERE, "a recipe needs `[dataset]`")
                .help("add, for instance: [dataset] with scenes = 10 and views_per_scene = 5"),
        );
        return None;
    };
    let span = value.span();
    let views = value.get_ref().as_table().and_then(|table| table.get("views_per_scene")).map(Spanned::span);
    let table = plain::<DatasetTable>("dataset", value, &schemas.dataset, schemas, drafts)?;
    Some((DatasetSpans { header: span, views }, table))
}

struct DatasetSpans {
    header: Span,
    views: Option<Span>,
}

fn lock_table(tree: &mut DeTable, schemas: &Schemas, drafts: &mut Vec<Draft>) -> Option<(LockTable, Span)> {
    let value = tree.remove("lock")?;
    let span = value.span();
    plain(OTHERS[4], value, &schemas.lock, schemas, drafts).map(|table| (table, span))
}

/// A section that is no stage.
fn plain<'a, T: Deserialize<'a>>(
    name: &str,
    value: Spanned<DeValue<'a>>,
    schema: &serde_json::Value,
    schemas: &Schemas,
    drafts: &mut Vec<Draft>,
) -> Option<T> {
    let span = value.span();
    let DeValue::Table(table) = value.get_ref() else {
        let found = super::check::found(value.get_ref());
        drafts.push(
            Draft::error(Code::WrongType, span, format!("`{name}` must be a table"))
                .label(format!("this is {found}"))
                .help(format!("write [{name}] and its options below")),
        );
        return None;
    };
    let found = Checker { definitions: &schemas.definitions }.options(name, table, &span, schema);
    if !found.drafts.is_empty() {
        drafts.extend(found.drafts);
        return None;
    }
    T::deserialize(ValueDeserializer::from(value))
        .map_err(|error| {
            drafts.push(Draft::error(Code::InvalidValue, error.span().unwrap_or(span), error.message()));
        })
        .ok()
}

fn lock_mismatches(lock: &LockTable, span: &Span, registry: &Registry) -> Vec<Draft> {
    let mut drafts = Vec::new();
    let mut warn = |what: &str, recorded: &str, present: Option<&str>| {
        if recorded.is_empty() || present == Some(recorded) {
            return;
        }
        let present = present.map_or("not linked into this program".to_owned(), |version| format!("{version} here"));
        let message = format!("the recipe was resolved with {what} {recorded}, which is {present}");
        drafts.push(
            Draft::warning(Code::LockMismatch, span.clone(), message)
                .help("the dataset may differ from the one that was made then; remove [lock] to accept that"),
        );
    };
    warn("syntable", &lock.syntable, Some(env!("CARGO_PKG_VERSION")));
    for (name, version) in &lock.plugins {
        let entry = registry.entries().iter().find(|entry| entry.crate_name == name);
        warn(name, version, entry.map(|entry| entry.crate_version));
    }
    drafts
}

/// The number of views: what `[dataset]` says, or what the views list.
fn views_per_scene(
    dataset: Option<&(DatasetSpans, DatasetTable)>,
    built: &Built,
    drafts: &mut Vec<Draft>,
) -> Option<u32> {
    let (spans, dataset) = dataset?;
    let views = built.stages.iter().find_map(|stage| match &stage.stage {
        Some(Stage::Views(views)) => Some(views),
        _ => None,
    });
    match (dataset.views_per_scene, views.map(|views| views.count())) {
        (Some(wanted), Some(Some(listed))) if wanted > listed => {
            let span = spans.views.clone().unwrap_or(spans.header.clone());
            drafts.push(
                Draft::error(
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
            drafts.push(
                Draft::error(Code::MissingKey, spans.header.clone(), "`dataset` needs `views_per_scene`")
                    .label("add `views_per_scene = …`")
                    .help("views_per_scene: number of views of each scene"),
            );
            None
        }
        (wanted, listed) => wanted.or(listed.flatten()),
    }
}

/// Diagnostics in reading order, without repeats and echoes of syntax errors.
fn finish(sources: &Sources, mut drafts: Vec<Draft>, damage: &Damage) -> Vec<Diagnostic> {
    let line =
        |span: &Span| sources.file_of(span).map(|file| (file.start(), file.line_column(span.start - file.start()).0));
    let broken: BTreeSet<_> =
        drafts.iter().filter(|draft| draft.code == Code::Syntax).filter_map(|draft| line(draft.span())).collect();
    drafts.retain(|draft| {
        let echo = draft.code != Code::Syntax
            && draft.code != Code::DuplicateKey
            && (line(draft.span()).is_some_and(|line| broken.contains(&line))
                || damage.adrift.iter().any(|adrift| adrift.contains(&draft.span().start)));
        let proves_nothing = damage.lossy
            && matches!(
                draft.code,
                Code::MissingKey | Code::MissingSection | Code::UnknownPool | Code::UnusedPool | Code::BadOverride
            );
        !echo && !proves_nothing
    });
    // A pool may be unused only because of another mistake.
    if drafts.iter().any(|draft| draft.severity == Severity::Error) {
        drafts.retain(|draft| draft.code != Code::UnusedPool);
    }
    // Missing sections, which are nowhere, come last; the recipe itself comes before what it extends.
    drafts.sort_by_key(|draft| {
        let span = draft.span();
        (*span == NOWHERE, span.start, span.end, draft.code)
    });
    let mut diagnostics: Vec<Diagnostic> = drafts.into_iter().map(|draft| sources.diagnostic(draft)).collect();
    diagnostics.dedup();
    diagnostics
}

fn assemble(dataset: DatasetTable, built: Built, plan: Plan, lock: LockTable) -> Option<Recipe> {
    let dataset_options = toml::Table::try_from(&dataset).ok()?;
    let (mut assets, mut place, mut lights) = (BTreeMap::new(), Vec::new(), Vec::new());
    let mut write = Vec::new();
    let (mut settle, mut camera, mut views, mut render) = (None, None, None, None);
    // A resolved recipe names the stages that run with their defaults, too.
    let mut resolved: Vec<ResolvedStage> = plan.implied.iter().map(implied).collect();
    let mut pools = built.pools;
    for stage in built.stages {
        match stage.stage {
            Some(Stage::Assets(source)) => {
                let options = pools.remove(&stage.id)?;
                assets.insert(stage.id.clone(), super::Pool { kind: stage.entry.kind.to_owned(), source, options });
            }
            Some(Stage::Place(placer)) => place.push((stage.id.clone(), placer)),
            Some(Stage::Settle(settler)) => settle = Some(settler),
            Some(Stage::Camera(model)) => camera = Some(model),
            Some(Stage::Views(sampler)) => views = Some(sampler),
            Some(Stage::Lights(sampler)) => lights.push((stage.id.clone(), sampler)),
            Some(Stage::Render(renderer)) => render = Some(renderer),
            Some(Stage::Write(writer)) => write.push((stage.id.clone(), writer)),
            // Producers are in the plan.
            _ => {}
        }
        resolved.push(ResolvedStage {
            slot: stage.slot,
            id: stage.id,
            kind: stage.entry.kind,
            options: stage.options,
            plugin: (stage.entry.crate_name, stage.entry.crate_version),
        });
    }
    write.sort_by(|(a, _), (b, _)| a.cmp(b));
    Some(Recipe {
        resolved: lock::write(&dataset_options, &resolved, &lock.assets),
        dataset: Dataset {
            name: dataset.name,
            seed: dataset.seed,
            scenes: dataset.scenes,
            views_per_scene: dataset.views_per_scene?,
            max_attempts: dataset.max_attempts,
            on_bad_asset: dataset.on_bad_asset,
        },
        assets,
        place,
        settle: settle?,
        camera: camera?,
        views: views?,
        lights,
        render: render?,
        write,
        plan,
        locked: lock.assets,
    })
}

/// A stage that runs without being in the recipe.
fn implied((stage, Implied { entry, options }): &(String, Implied)) -> ResolvedStage {
    ResolvedStage {
        slot: entry.slot,
        id: stage.split_once('.').map_or(entry.kind, |(_, id)| id).to_owned(),
        kind: entry.kind,
        options: options.clone(),
        plugin: (entry.crate_name, entry.crate_version),
    }
}
