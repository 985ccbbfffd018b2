//! Loads a recipe: reads all texts, builds all tables, reports all mistakes.

use crate::agreement;
use crate::assemble::{BuiltComponent, assemble};
use crate::merge::graph::{self, Damage};
use crate::merge::overrides::Overrides;
use crate::merge::renamed::{RENAMED, RenamedNames};
use crate::merge::variables::{self, PathRules};
use crate::plan::of_tables::part;
use crate::recipe::Recipe;
use crate::schema::kinds::Schemas;
use crate::shared_pools::{SharedPool, SharedPools};
use crate::tables::dataset::{DatasetTable, LockTable};
use crate::tables::loader::Loader;
use crate::tables::pool::Pool;
use crate::tables::remote_paths::RemotePaths;
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
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::mirror::Mirror;
use syntable_model::registry::{Registry, Stage};
use syntable_model::stage::{DatasetInfo, Scenes, Writer};

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
    /// Components of the mixture, or the recipe itself.
    components: Vec<BuiltComponent<'r>>,
    diagnostics: Vec<DiagnosticBuilder>,
    /// Damage by syntax errors and missing bases.
    damage: Damage,
    /// Mirrors of the URLs, or why a store does not answer.
    mirrors: Result<Vec<Arc<Mirror>>, Error>,
}

impl<'r> ReadRecipe<'r> {
    fn read(registry: &'r Registry, source: Source, overrides: &Overrides, renamed: &RenamedNames) -> Self {
        let sources = Sources::default();
        let mut diagnostics = Vec::new();
        let folder = source.path.as_deref().and_then(Path::parent).map(Path::to_owned);
        let schemas = Schemas::of(registry);
        let mut graph = graph::gather(source, overrides, &sources, &schemas, &mut diagnostics);
        let incomplete = !diagnostics.is_empty();
        let lines = std::mem::take(&mut graph.of_components);
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
        let remote = RemotePaths::default();
        let loader = Loader { registry, schemas: &schemas, overrides, sources: &sources, renamed, paths, remote };
        let components = loader.components(tree, lines, &mut damage, &mut diagnostics);
        let components = BuiltComponent::all(&loader, components, &mut diagnostics);
        diagnostics.extend(agreement::check(&components));
        if let Some((lock, span)) = &lock {
            diagnostics.extend(sections::lock_mismatches(lock, span, registry));
        }
        let dataset = dataset.map(|(spans, table)| {
            let built: Vec<_> = components.iter().map(|component| (component.id.as_str(), &component.built)).collect();
            let views_per_scene = sections::views_per_scene(&spans, &table, &built, &mut diagnostics);
            DatasetTable { views_per_scene, ..table }
        });
        let lock = lock.map(|(lock, _)| lock).unwrap_or_default();
        let mirrors = loader.remote.finish();
        Self { sources, folder, dataset, lock, components, diagnostics, damage, mirrors }
    }

    /// The recipe with its warnings, or its mistakes.
    fn finish(mut self, registry: &Registry) -> Result<(Recipe, Vec<Diagnostic>), BrokenRecipe> {
        let diagnostics = in_reading_order(&self.sources, std::mem::take(&mut self.diagnostics), &self.damage);
        let failure = self.mirrors.as_ref().err().map(|failure| Box::new(failure.clone()));
        if failure.is_some() || diagnostics.iter().any(Diagnostic::is_error) {
            return Err(BrokenRecipe { report: Report { diagnostics, other: failure }, pools: self.pools() });
        }
        let Self { sources, folder, dataset, lock, components, mirrors, .. } = self;
        let mirrors = mirrors.unwrap_or_default();
        match dataset.and_then(|dataset| assemble(dataset, components, lock)) {
            Some(recipe) => Ok((Recipe { folder, checks: registry.checks().to_vec(), mirrors, ..recipe }, diagnostics)),
            None => {
                // A part can be missing without an error of its own only if a syntax error lost it.
                let diagnostic = DiagnosticBuilder::error(Code::MissingSection, NOWHERE, "the recipe is not complete");
                let report = Report { diagnostics: vec![diagnostic.build(&sources)], other: None };
                Err(BrokenRecipe { report, pools: BTreeMap::new() })
            }
        }
    }

    /// The pools that could be built, by their names in the recipe.
    fn pools(self) -> BTreeMap<String, Pool> {
        let mut pools = SharedPools::default();
        for (index, component) in self.components.into_iter().enumerate() {
            let BuiltComponent { id, built, .. } = component;
            let Built { stages, pools: mut options, .. } = built;
            for mut stage in stages.into_iter().filter(|stage| stage.found) {
                if let Some(Stage::Assets(source)) = stage.stage.take() {
                    pools.add((index, &id), &stage, source, &mut options);
                }
            }
        }
        pools.named().into_iter().map(|(name, SharedPool { pool, .. })| (name, pool)).collect()
    }

    /// Reports what the built stages lack, and paths of files that clash.
    fn add_needs(&mut self) {
        let mut found = Vec::new();
        for component in &self.components {
            found.extend(self.needs(component));
        }
        self.diagnostics.extend(found);
    }

    fn needs(&self, component: &BuiltComponent) -> Vec<DiagnosticBuilder> {
        let BuiltComponent { built, plan, .. } = component;
        let sound: Vec<&BuiltStage> = built.stages.iter().filter(|stage| stage.found).collect();
        let writers: Vec<(&str, &dyn Writer<Scenes>)> = (sound.iter())
            .filter_map(|stage| match &stage.stage {
                Some(Stage::WriteScenes(writer)) => Some((stage.id.as_str(), &**writer)),
                _ => None,
            })
            .collect();
        // Paths do not depend on mistakes in [dataset].
        let info = DatasetInfo {
            name: self.dataset.as_ref().map_or("dataset", |table| &table.name).to_owned(),
            seed: self.dataset.as_ref().map_or(0, |table| table.seed),
            scenes: self.dataset.as_ref().map_or(1, |table| table.scenes),
            views_per_scene: self.dataset.as_ref().and_then(|table| table.views_per_scene).unwrap_or(1),
            ..DatasetInfo::default()
        };
        // A path that does not exist has been reported.
        let is_reported = |name: &str| built.stages.iter().any(|stage| !stage.found && part(stage) == name);
        let missing = plan.iter().flat_map(|plan| plan.missing(info.views_per_scene));
        let missing = missing.filter(|(stage, _)| !is_reported(stage));
        let mut mistakes: Vec<(String, Error)> = missing.map(|(stage, error)| (stage.to_owned(), error)).collect();
        let of_writers = (writers.iter().filter_map(|writer| unready(*writer)))
            .chain(bad_paths(&info, &writers, plan.as_ref()))
            .map(|(id, error)| (format!("write.{id}"), error));
        mistakes.extend(of_writers);
        let diagnostic = |(stage, error): (String, Error)| {
            let header = sound.iter().find(|other| part(other) == stage).map_or(NOWHERE, |stage| stage.header.clone());
            let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, header, error.without_help());
            error.help_text().into_iter().fold(diagnostic, |diagnostic, help| diagnostic.help(help))
        };
        mistakes.into_iter().map(diagnostic).collect()
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
