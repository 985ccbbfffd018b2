//! Loads a recipe: reads all texts, builds all tables, reports all mistakes.

use crate::merge::inherit::{self, Damage};
use crate::merge::overrides::Overrides;
use crate::merge::renamed::{RENAMED, RenamedNames};
use crate::merge::variables::{self, PathRules};
use crate::plan::of_tables::{part, plan};
use crate::plan::{Implied, Plan};
use crate::recipe::Recipe;
use crate::resolved::{self, ResolvedStage};
use crate::schema::kinds::Schemas;
use crate::tables::check;
use crate::tables::dataset::{Dataset, DatasetTable, Lock, LockTable};
use crate::tables::loader::Loader;
use crate::tables::placers;
use crate::tables::pool::{Pool, PoolOptions};
use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::Code;
use crate::text::diagnostic::{Diagnostic, DiagnosticBuilder, Severity};
use crate::text::origin::Source;
use crate::text::report::Report;
use crate::text::source::{NOWHERE, Sources, Span};
use crate::text::suggest::{did_you_mean, listing, synonym};
use crate::writer_paths::{bad_paths, unready};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_model::error::Error;
use syntable_model::registry::{Registry, Shape, Slot, Stage};
use syntable_model::stage::{AssetSource, DatasetInfo, Scenes, Writer};
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Keys of a recipe that are not slots.
const OTHERS: [&str; 5] = ["dataset", "extends", "remove", "set", "lock"];

/// Loads a recipe.
///
/// Returns the recipe and its warnings, or all its mistakes.
pub fn load(registry: &Registry, source: Source, overrides: &Overrides) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    load_with(registry, source, overrides, &RENAMED)
}

/// A recipe that was checked.
pub struct Checked {
    /// The recipe and its warnings, or all its mistakes.
    pub recipe: Result<(Recipe, Vec<Diagnostic>), Report>,
    /// The pools of a recipe with mistakes, as far as they have none themselves.
    pub pools: BTreeMap<String, Pool>,
}

/// Loads a recipe, and asks its stages for mistakes that only a run would find: files that they need, and their paths.
pub fn checked(registry: &Registry, source: Source, overrides: &Overrides) -> Checked {
    let mut pools = BTreeMap::new();
    let recipe = load_parts(registry, source, overrides, &RENAMED, Some(&mut pools));
    Checked { recipe, pools }
}

/// Loads a recipe, given the names that have changed.
pub(crate) fn load_with(
    registry: &Registry,
    source: Source,
    overrides: &Overrides,
    renamed: &RenamedNames,
) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    load_parts(registry, source, overrides, renamed, None)
}

/// Loads a recipe. With a place for the pools of one with mistakes, stages are asked for what they need.
fn load_parts(
    registry: &Registry,
    source: Source,
    overrides: &Overrides,
    renamed: &RenamedNames,
    pools: Option<&mut BTreeMap<String, Pool>>,
) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    let sources = Sources::default();
    let mut diagnostics = Vec::new();
    let folder = source.path.as_deref().and_then(Path::parent).map(Path::to_owned);
    let schemas = Schemas::of(registry);
    let graph = inherit::gather(source, overrides, &sources, &schemas, &mut diagnostics);
    let incomplete = !diagnostics.is_empty();
    let (mut tree, mut damage) = graph.merge(&mut diagnostics);
    damage.keys_lost |= incomplete;

    diagnostics.extend(schemas.faults.iter().map(|fault| {
        DiagnosticBuilder::error(Code::Plugin, NOWHERE, fault.as_str())
            .help("ask the plugin's authors to mend it, or leave the plugin out of your binary")
    }));
    unknown_sections(&tree, &schemas, &mut diagnostics);
    let dataset = dataset(&mut tree, &schemas, renamed, &mut diagnostics);
    let lock = lock_table(&mut tree, &schemas, &mut diagnostics);
    let paths = PathRules {
        home: variables::join(&overrides.current_folder, &folder.as_deref().unwrap_or(Path::new("")).to_string_lossy()),
        resolved: lock.is_some(),
    };
    let loader = Loader { registry, schemas: &schemas, overrides, sources: &sources, renamed, paths };
    let mut built = loader.build(&mut tree, &mut diagnostics);
    diagnostics.extend(placers::check(&built));
    let plan = plan(registry, &mut built, &overrides.wanted, &mut diagnostics);
    if let Some(lock) = &lock {
        diagnostics.extend(lock_mismatches(&lock.0, &lock.1, registry));
    }
    let views = views_per_scene(dataset.as_ref(), &built, &mut diagnostics);

    if pools.is_some() {
        diagnostics.extend(needs(dataset.as_ref().map(|(_, table)| table), &built, plan.as_ref()));
    }
    let diagnostics = finish(&sources, diagnostics, &damage);
    if diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        if let Some(pools) = pools {
            for mut stage in built.stages.into_iter().filter(|stage| stage.found) {
                if let Some(Stage::Assets(source)) = stage.stage.take()
                    && let Some(pool) = pool(&stage, source, &mut built.pools)
                {
                    pools.insert(stage.id, pool);
                }
            }
        }
        return Err(Report { diagnostics, other: None });
    }
    let dataset = dataset.map(|(_, table)| DatasetTable { views_per_scene: views, ..table });
    match dataset.and_then(|dataset| assemble(dataset, built, plan?, lock.map(|lock| lock.0).unwrap_or_default())) {
        Some(recipe) => Ok((Recipe { folder, checks: registry.checks().to_vec(), ..recipe }, diagnostics)),
        None => {
            // A part can be missing without an error of its own only if a syntax error lost it.
            let diagnostic = DiagnosticBuilder::error(Code::MissingSection, NOWHERE, "the recipe is not complete");
            Err(Report { diagnostics: vec![diagnostic.build(&sources)], other: None })
        }
    }
}

/// What the stages that were built need and is not there, and paths of files that do not go together.
fn needs(dataset: Option<&DatasetTable>, built: &Built, plan: Option<&Plan>) -> Vec<DiagnosticBuilder> {
    let sound: Vec<&BuiltStage> = built.stages.iter().filter(|stage| stage.found).collect();
    let writers: Vec<(&str, &dyn Writer<Scenes>)> = (sound.iter())
        .filter_map(|stage| match &stage.stage {
            Some(Stage::WriteScenes(writer)) => Some((stage.id.as_str(), &**writer)),
            _ => None,
        })
        .collect();
    let mut mistakes: Vec<(String, Error)> =
        plan.into_iter().flat_map(Plan::missing).map(|(stage, error)| (stage.to_owned(), error)).collect();
    // A mistake in [dataset] is none of paths.
    let info = DatasetInfo {
        name: dataset.map_or("dataset", |table| &table.name).to_owned(),
        seed: dataset.map_or(0, |table| table.seed),
        scenes: dataset.map_or(1, |table| table.scenes),
        views_per_scene: dataset.and_then(|table| table.views_per_scene).unwrap_or(1),
        recipe: String::new(),
        program: String::new(),
        classes: Vec::new(),
        own_categories: Vec::new(),
        label_surface: syntable_model::stage::LabelSurface::First,
    };
    let of_writers = (writers.iter().filter_map(|writer| unready(*writer)))
        .chain(bad_paths(&info, &writers, plan))
        .map(|(id, error)| (format!("write.{id}"), error));
    mistakes.extend(of_writers);
    let diagnostic = |(stage, error): (String, Error)| {
        let header = sound.iter().find(|other| part(other) == stage).map_or(NOWHERE, |stage| stage.header.clone());
        let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, header, error.without_help());
        error.help_text().into_iter().fold(diagnostic, |diagnostic, help| diagnostic.help(help))
    };
    mistakes.into_iter().map(diagnostic).collect()
}

/// The pool of a source of assets that was built.
fn pool(
    stage: &BuiltStage,
    mut source: Box<dyn AssetSource>,
    options: &mut BTreeMap<String, PoolOptions>,
) -> Option<Pool> {
    let options = options.remove(&stage.id)?;
    source.limit(options.limits);
    Some(Pool { kind: stage.entry.kind.to_owned(), source, options })
}

fn unknown_sections(tree: &DeTable, schemas: &Schemas, diagnostics: &mut Vec<DiagnosticBuilder>) {
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

/// Where an option belongs that stands outside of all sections, if one section has it or means it.
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
fn dataset(
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
            .label("the dataset's folder has this name, unless --out names another")
            .help("leave out slashes, and choose the folder with --out")
    })
}

struct DatasetSpans {
    header: Span,
    views: Option<Span>,
}

fn lock_table(
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

fn lock_mismatches(lock: &LockTable, span: &Span, registry: &Registry) -> Vec<DiagnosticBuilder> {
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

/// The number of views: from `[dataset]`, or from the list of views.
fn views_per_scene(
    dataset: Option<&(DatasetSpans, DatasetTable)>,
    built: &Built,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<u32> {
    let (spans, dataset) = dataset?;
    let views = built.stages.iter().find_map(|stage| match &stage.stage {
        Some(Stage::Views(views)) => Some(views),
        _ => None,
    });
    match (dataset.views_per_scene, views.map(|views| views.count())) {
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

/// Sorts diagnostics into reading order and drops repeats and consequences of syntax errors.
fn finish(sources: &Sources, mut diagnostics: Vec<DiagnosticBuilder>, damage: &Damage) -> Vec<Diagnostic> {
    let line =
        |span: &Span| sources.file_of(span).map(|file| (file.start(), file.line_column(span.start - file.start()).0));
    let broken: BTreeSet<_> = diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.code == Code::Syntax)
        .filter_map(|diagnostic| line(diagnostic.span()))
        .collect();
    diagnostics.retain(|diagnostic| {
        let echo = diagnostic.code != Code::Syntax
            && diagnostic.code != Code::DuplicateKey
            && (line(diagnostic.span()).is_some_and(|line| broken.contains(&line))
                || damage.misread.iter().any(|misread| misread.contains(&diagnostic.span().start)));
        let proves_nothing = damage.keys_lost
            && matches!(
                diagnostic.code,
                Code::MissingKey
                    | Code::MissingSection
                    | Code::UnknownPool
                    | Code::UnusedPool
                    | Code::BadOverride
                    | Code::Placers
            );
        !echo && !proves_nothing
    });
    // A pool may be unused only because of another mistake.
    if diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        diagnostics.retain(|diagnostic| diagnostic.code != Code::UnusedPool);
    }
    // Missing sections, which are nowhere, come last; the recipe itself comes before what it extends.
    diagnostics.sort_by_key(|diagnostic| {
        let span = diagnostic.span();
        (*span == NOWHERE, span.start, span.end, diagnostic.code)
    });
    let mut diagnostics: Vec<Diagnostic> =
        diagnostics.into_iter().map(|diagnostic| diagnostic.build(&sources)).collect();
    diagnostics.dedup();
    diagnostics
}

fn assemble(dataset: DatasetTable, built: Built, plan: Plan, lock: LockTable) -> Option<Recipe> {
    let dataset_options = toml::Table::try_from(&dataset).ok()?;
    let (mut assets, mut place, mut lights) = (BTreeMap::new(), Vec::new(), Vec::new());
    let (mut write, mut labeled_pools) = (Vec::new(), BTreeSet::new());
    let (mut settle, mut camera, mut views, mut render) = (None, None, None, None);
    // A resolved recipe names the stages that run with their defaults, too.
    let mut stages: Vec<ResolvedStage> = plan.implied.iter().map(implied).collect();
    let mut pools = built.pools;
    let (files, draws, libraries) = (built.files, built.draws, built.libraries);
    let (choices, undecided) = (built.choices, built.undecided);
    let lock = Lock::from(lock);
    for mut stage in built.stages {
        match stage.stage.take() {
            Some(Stage::Assets(source)) => {
                assets.insert(stage.id.clone(), pool(&stage, source, &mut pools)?);
            }
            Some(Stage::Place(placer)) => {
                if placer.places_objects() {
                    labeled_pools.append(&mut stage.object_pools);
                }
                place.push((stage.id.clone(), placer));
            }
            Some(Stage::Settle(settler)) => settle = Some(settler),
            Some(Stage::Camera(model)) => camera = Some(model),
            Some(Stage::Views(sampler)) => views = Some(sampler),
            Some(Stage::Lights(sampler)) => lights.push((stage.id.clone(), sampler)),
            Some(Stage::Render(renderer)) => render = Some(renderer),
            Some(Stage::WriteScenes(writer)) => write.push((stage.id.clone(), writer)),
            // Producers are in the plan.
            _ => {}
        }
        stages.push(ResolvedStage {
            slot: stage.slot,
            id: stage.id,
            kind: stage.entry.kind,
            options: stage.options,
            plugin: (stage.entry.crate_name, stage.entry.crate_version),
        });
    }
    write.sort_by(|(a, _), (b, _)| a.cmp(b));
    Some(Recipe {
        resolved: resolved::write(&dataset_options, &stages, &lock),
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
        lock,
        files,
        draws,
        checks: Vec::new(),
        labeled_pools,
        folder: None,
        choices,
        undecided,
        libraries,
    })
}

/// A stage that runs without being in the recipe.
fn implied((stage, Implied { entry, options, .. }): &(String, Implied)) -> ResolvedStage {
    ResolvedStage {
        slot: entry.slot,
        id: stage.split_once('.').map_or(entry.kind, |(_, id)| id).to_owned(),
        kind: entry.kind,
        options: options.clone(),
        plugin: (entry.crate_name, entry.crate_version),
    }
}
