//! Loads a recipe: reads all texts, builds all tables, reports all mistakes.

use crate::merge::graph::{self, Damage};
use crate::merge::overrides::Overrides;
use crate::merge::renamed::{RENAMED, RenamedNames};
use crate::merge::variables::{self, PathRules};
use crate::one_of::OneOf;
use crate::plan::of_tables::{part, plan};
use crate::plan::{Implied, Plan};
use crate::recipe::Recipe;
use crate::resolved::{self, ResolvedStage};
use crate::schema::kinds::Schemas;
use crate::tables::dataset::{Dataset, DatasetTable, Lock, LockTable};
use crate::tables::loader::Loader;
use crate::tables::noise;
use crate::tables::placers;
use crate::tables::pool::{Pool, PoolOptions};
use crate::tables::rig::Rig;
use crate::tables::sections;
use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::Code;
use crate::text::diagnostic::{Diagnostic, DiagnosticBuilder, Severity};
use crate::text::origin::Source;
use crate::text::report::Report;
use crate::text::source::{NOWHERE, Sources, Span};
use crate::writer_paths::{bad_paths, unready};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::stage::{AssetSource, DatasetInfo, Placer, Scenes, Writer};

/// Loads a recipe. Returns it with its warnings.
///
/// # Errors
/// With all mistakes at once.
pub fn load(registry: &Registry, source: Source, overrides: &Overrides) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    load_with(registry, source, overrides, &RENAMED)
}

/// A recipe that was checked.
pub struct Checked {
    /// The recipe and its warnings, or all its mistakes.
    pub recipe: Result<(Recipe, Vec<Diagnostic>), Report>,
    /// The pools of a recipe with mistakes. Pools that have mistakes themselves are left out.
    pub pools: BTreeMap<String, Pool>,
}

/// Loads a recipe, and asks its stages for mistakes that only a run would find: files that they need, and their paths.
pub fn checked(registry: &Registry, source: Source, overrides: &Overrides) -> Checked {
    let mut read = ReadRecipe::read(registry, source, overrides, &RENAMED);
    read.add_needs();
    match read.finish(registry) {
        Ok(recipe) => Checked { recipe: Ok(recipe), pools: BTreeMap::new() },
        Err(BrokenRecipe { report, pools }) => Checked { recipe: Err(report), pools },
    }
}

/// Loads a recipe, given the names that have changed.
pub(crate) fn load_with(
    registry: &Registry,
    source: Source,
    overrides: &Overrides,
    renamed: &RenamedNames,
) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    ReadRecipe::read(registry, source, overrides, renamed).finish(registry).map_err(|broken| broken.report)
}

/// A recipe with mistakes, and its pools without mistakes.
struct BrokenRecipe {
    report: Report,
    pools: BTreeMap<String, Pool>,
}

/// A recipe whose texts were read: what could be built, and every mistake so far.
struct ReadRecipe<'r> {
    sources: Sources,
    folder: Option<PathBuf>,
    /// `[dataset]`, with the number of views that it or `[views]` states.
    dataset: Option<DatasetTable>,
    lock: LockTable,
    built: Built<'r>,
    plan: Option<Plan>,
    diagnostics: Vec<DiagnosticBuilder>,
    /// Damage by syntax errors and missing bases.
    damage: Damage,
}

impl<'r> ReadRecipe<'r> {
    fn read(registry: &'r Registry, source: Source, overrides: &Overrides, renamed: &RenamedNames) -> Self {
        let sources = Sources::default();
        let mut diagnostics = Vec::new();
        let folder = source.path.as_deref().and_then(Path::parent).map(Path::to_owned);
        let schemas = Schemas::of(registry);
        let graph = graph::gather(source, overrides, &sources, &schemas, &mut diagnostics);
        let incomplete = !diagnostics.is_empty();
        let (mut tree, mut damage) = graph.merge(&mut diagnostics);
        damage.keys_lost |= incomplete;

        diagnostics.extend(schemas.faults.iter().map(|fault| {
            DiagnosticBuilder::error(Code::Plugin, NOWHERE, fault.as_str())
                .help("ask the plugin's authors to mend it, or leave the plugin out of your binary")
        }));
        sections::unknown(&tree, &schemas, &mut diagnostics);
        let dataset = sections::dataset(&mut tree, &schemas, renamed, &mut diagnostics);
        let lock = sections::lock(&mut tree, &schemas, &mut diagnostics);
        let home = folder.as_deref().unwrap_or(Path::new(""));
        let paths = PathRules {
            home: variables::join(&overrides.current_folder, &home.to_string_lossy()),
            resolved: lock.is_some(),
        };
        let loader = Loader { registry, schemas: &schemas, overrides, sources: &sources, renamed, paths };
        let mut built = loader.build(&mut tree, &mut diagnostics);
        diagnostics.extend(placers::check(&built));
        let plan = plan(registry, &mut built, &overrides.wanted, &mut diagnostics);
        diagnostics.extend(plan.as_ref().and_then(|plan| noise::check(&built, plan)));
        if let Some((lock, span)) = &lock {
            diagnostics.extend(sections::lock_mismatches(lock, span, registry));
        }
        let dataset = dataset.map(|(spans, table)| {
            let views_per_scene = sections::views_per_scene(&spans, &table, &built, &mut diagnostics);
            DatasetTable { views_per_scene, ..table }
        });
        let lock = lock.map(|(lock, _)| lock).unwrap_or_default();
        Self { sources, folder, dataset, lock, built, plan, diagnostics, damage }
    }

    /// The recipe with its warnings, or its mistakes.
    fn finish(mut self, registry: &Registry) -> Result<(Recipe, Vec<Diagnostic>), BrokenRecipe> {
        let diagnostics = in_reading_order(&self.sources, std::mem::take(&mut self.diagnostics), &self.damage);
        if diagnostics.iter().any(Diagnostic::is_error) {
            return Err(BrokenRecipe { report: Report { diagnostics, other: None }, pools: self.pools() });
        }
        let Self { sources, folder, dataset, lock, built, plan, .. } = self;
        match dataset.and_then(|dataset| assemble(dataset, built, plan?, lock)) {
            Some(recipe) => Ok((Recipe { folder, checks: registry.checks().to_vec(), ..recipe }, diagnostics)),
            None => {
                // A part can be missing without an error of its own only if a syntax error lost it.
                let diagnostic = DiagnosticBuilder::error(Code::MissingSection, NOWHERE, "the recipe is not complete");
                let report = Report { diagnostics: vec![diagnostic.build(&sources)], other: None };
                Err(BrokenRecipe { report, pools: BTreeMap::new() })
            }
        }
    }

    /// The pools that could be built.
    fn pools(self) -> BTreeMap<String, Pool> {
        let Built { stages, pools: mut options, .. } = self.built;
        let found = stages.into_iter().filter(|stage| stage.found);
        let pools = found.filter_map(|mut stage| match stage.stage.take() {
            Some(Stage::Assets(source)) => pool(&stage, source, &mut options).map(|pool| (stage.id, pool)),
            _ => None,
        });
        pools.collect()
    }

    /// Reports what the built stages lack, and paths of files that clash.
    fn add_needs(&mut self) {
        let sound: Vec<&BuiltStage> = self.built.stages.iter().filter(|stage| stage.found).collect();
        let writers: Vec<(&str, &dyn Writer<Scenes>)> = (sound.iter())
            .filter_map(|stage| match &stage.stage {
                Some(Stage::WriteScenes(writer)) => Some((stage.id.as_str(), &**writer)),
                _ => None,
            })
            .collect();
        let mut mistakes: Vec<(String, Error)> =
            self.plan.iter().flat_map(Plan::missing).map(|(stage, error)| (stage.to_owned(), error)).collect();
        // Paths do not depend on mistakes in [dataset].
        let info = DatasetInfo {
            name: self.dataset.as_ref().map_or("dataset", |table| &table.name).to_owned(),
            seed: self.dataset.as_ref().map_or(0, |table| table.seed),
            scenes: self.dataset.as_ref().map_or(1, |table| table.scenes),
            views_per_scene: self.dataset.as_ref().and_then(|table| table.views_per_scene).unwrap_or(1),
            ..DatasetInfo::default()
        };
        let of_writers = (writers.iter().filter_map(|writer| unready(*writer)))
            .chain(bad_paths(&info, &writers, self.plan.as_ref()))
            .map(|(id, error)| (format!("write.{id}"), error));
        mistakes.extend(of_writers);
        let diagnostic = |(stage, error): (String, Error)| {
            let header = sound.iter().find(|other| part(other) == stage).map_or(NOWHERE, |stage| stage.header.clone());
            let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, header, error.without_help());
            error.help_text().into_iter().fold(diagnostic, |diagnostic, help| diagnostic.help(help))
        };
        let found: Vec<DiagnosticBuilder> = mistakes.into_iter().map(diagnostic).collect();
        self.diagnostics.extend(found);
    }
}

/// Sorts diagnostics into reading order and drops repeats and consequences of syntax errors.
fn in_reading_order(sources: &Sources, mut diagnostics: Vec<DiagnosticBuilder>, damage: &Damage) -> Vec<Diagnostic> {
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
    // Missing sections have no place and come last. The recipe itself comes before the recipes that it extends.
    diagnostics.sort_by_key(|diagnostic| {
        let span = diagnostic.span();
        (*span == NOWHERE, span.start, span.end, diagnostic.code)
    });
    let mut diagnostics: Vec<Diagnostic> =
        diagnostics.into_iter().map(|diagnostic| diagnostic.build(sources)).collect();
    diagnostics.dedup();
    diagnostics
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

fn assemble(dataset: DatasetTable, built: Built, plan: Plan, lock: LockTable) -> Option<Recipe> {
    let dataset_options = toml::Table::try_from(&dataset).ok()?;
    let (mut assets, mut place, mut lights) = (BTreeMap::new(), Vec::new(), Vec::new());
    let (mut write, mut labeled_pools) = (Vec::new(), BTreeSet::new());
    let (mut settle, mut camera, mut views, mut render) = (None, None, None, None);
    // A resolved recipe names the stages that run with their defaults, too.
    let mut stages: Vec<ResolvedStage> = plan.implied.iter().map(implied).collect();
    let mut pools = built.pools;
    let (files, draws, libraries) = (built.files, built.draws, built.libraries);
    let rig = Rig::of(&built.views.rig).ok()?;
    let (choices, undecided, conditions) = (built.choices, built.undecided, built.views.conditions);
    let lock = Lock::from(lock);
    for mut stage in built.stages {
        let plugin = |stage: &BuiltStage| (stage.entry.crate_name, stage.entry.crate_version);
        let plugins = stage.all().map(plugin).collect();
        let kind = stage.alternatives.is_empty().then_some(stage.entry.kind);
        match stage.slot {
            Slot::Place => {
                let placers = alternatives(&mut stage, |stage| match stage {
                    Stage::Place(placer) => Some(placer),
                    _ => None,
                })?;
                if placers.all().any(Placer::places_objects) {
                    labeled_pools.append(&mut stage.object_pools);
                }
                place.push((stage.id.clone(), placers));
            }
            Slot::Settle => {
                settle = alternatives(&mut stage, |stage| match stage {
                    Stage::Settle(settler) => Some(settler),
                    _ => None,
                });
            }
            Slot::Lights => {
                let samplers = alternatives(&mut stage, |stage| match stage {
                    Stage::Lights(sampler) => Some(sampler),
                    _ => None,
                })?;
                lights.push((stage.id.clone(), samplers));
            }
            _ => {}
        }
        match stage.stage.take() {
            Some(Stage::Assets(source)) => {
                assets.insert(stage.id.clone(), pool(&stage, source, &mut pools)?);
            }
            Some(Stage::Camera(model)) => camera = Some(model),
            Some(Stage::Views(sampler)) => views = Some(sampler),
            Some(Stage::Lights(sampler)) => lights.push((stage.id.clone(), OneOf::only(sampler))),
            Some(Stage::Render(renderer)) => render = Some(renderer),
            Some(Stage::WriteScenes(writer)) => write.push((stage.id.clone(), writer)),
            // Producers are in the plan.
            _ => {}
        }
        stages.push(ResolvedStage { slot: stage.slot, id: stage.id, kind, options: stage.options, plugins });
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
        conditions,
        rig,
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

/// A stage with its alternatives, if it has any.
fn alternatives<T: ?Sized>(stage: &mut BuiltStage, of: fn(Stage) -> Option<Box<T>>) -> Option<OneOf<T>> {
    if stage.alternatives.is_empty() {
        return of(stage.stage.take()?).map(OneOf::only);
    }
    let all = std::mem::take(&mut stage.alternatives).into_iter();
    let all = all.map(|(weight, mut stage)| Some((weight, of(stage.stage.take()?)?))).collect::<Option<_>>()?;
    Some(OneOf::weighted(all))
}

/// A stage that runs although the recipe does not have it.
fn implied((stage, Implied { entry, options, .. }): &(String, Implied)) -> ResolvedStage {
    ResolvedStage {
        slot: entry.slot,
        id: stage.split_once('.').map_or(entry.kind, |(_, id)| id).to_owned(),
        kind: Some(entry.kind),
        options: options.clone(),
        plugins: vec![(entry.crate_name, entry.crate_version)],
    }
}
