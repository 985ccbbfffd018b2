//! Makes a recipe of components whose tables were built.

use crate::component::{Component, table};
use crate::one_of::OneOf;
use crate::plan::of_tables::plan;
use crate::plan::{Implied, Plan};
use crate::recipe::Recipe;
use crate::resolved::{self, ResolvedComponent, ResolvedStage};
use crate::tables::dataset::{Dataset, DatasetTable, Lock, LockTable};
use crate::tables::loader::Loader;
use crate::tables::mixture::ComponentTree;
use crate::tables::noise;
use crate::tables::placers;
use crate::tables::pool::{Pool, PoolOptions};
use crate::tables::rig::Rig;
use crate::tables::stages::{Built, BuiltStage};
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::registry::{Slot, Stage};
use syntable_model::stage::{AssetSource, Placer, Renderer, Scenes, Writer};

/// A component whose stages were built and planned.
pub(crate) struct BuiltComponent<'r> {
    /// Its name in the mixture; empty in a recipe that is no mixture.
    pub id: String,
    pub weight: f64,
    /// Bytes of its table.
    pub header: Span,
    pub built: Built<'r>,
    pub plan: Option<Plan>,
}

impl<'r> BuiltComponent<'r> {
    /// Builds the stages of each component, and plans its products.
    pub fn all(
        loader: &Loader<'_, 'r>,
        components: Vec<ComponentTree>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Vec<Self> {
        let built: Vec<(Self, Vec<DiagnosticBuilder>)> =
            components.into_iter().map(|component| Self::of(loader, component)).collect();
        // A mistake that all components have is about what they share, such as a writer.
        let is_of_all = |one: &DiagnosticBuilder| built.iter().all(|(_, all)| all.contains(one));
        let mut of_components = Vec::new();
        for (index, (Self { id, header, .. }, own)) in built.iter().enumerate() {
            for diagnostic in own {
                if !is_of_all(diagnostic) || id.is_empty() {
                    of_components.push(of_component(diagnostic.clone(), id, header));
                } else if index == 0 {
                    of_components.push(diagnostic.clone());
                }
            }
        }
        diagnostics.append(&mut of_components);
        built.into_iter().map(|(component, _)| component).collect()
    }

    fn of(loader: &Loader<'_, 'r>, mut component: ComponentTree) -> (Self, Vec<DiagnosticBuilder>) {
        let mut diagnostics = Vec::new();
        let mut built = loader.build(&mut component.tree, &mut diagnostics);
        diagnostics.extend(placers::check(&built));
        let plan = plan(loader.registry, &mut built, &loader.overrides.wanted, &mut diagnostics);
        diagnostics.extend(plan.as_ref().and_then(|plan| noise::check(&built, plan)));
        let ComponentTree { id, weight, header, .. } = component;
        (Self { id, weight, header, built, plan }, diagnostics)
    }

    /// The kind and the options of a stage, whether the recipe has its table or not.
    pub fn options(&self, plan: &Plan, name: &str) -> Option<(&'static str, toml::Table)> {
        let own = self.built.stages.iter().find(|stage| stage.slot.stage_name(&stage.id) == name);
        let own = own.map(|stage| (stage.entry.kind, stage.options.clone()));
        let implied = || {
            let (_, Implied { entry, options, .. }) = plan.implied.iter().find(|(stage, _)| stage == name)?;
            Some((entry.kind, options.clone()))
        };
        own.or_else(implied)
    }
}

/// A diagnostic about one component. A missing section is missing at the component's table.
fn of_component(mut diagnostic: DiagnosticBuilder, id: &str, header: &Span) -> DiagnosticBuilder {
    if diagnostic.marks[0].0 == NOWHERE {
        diagnostic.marks[0].0 = header.clone();
    }
    diagnostic.name_component(id);
    diagnostic
}

/// The pool of a source of assets that was built.
pub(crate) fn pool(
    component: &str,
    stage: &BuiltStage,
    mut source: Box<dyn AssetSource>,
    options: &mut BTreeMap<String, PoolOptions>,
) -> Option<Pool> {
    let options = options.remove(&stage.id)?;
    source.limit(options.limits);
    let table = table(component, &Slot::Assets.stage_name(&stage.id));
    Some(Pool { kind: stage.entry.kind.to_owned(), table, source, options })
}

/// The pools, renderers, writers and files that the components of a recipe share.
#[derive(Default)]
struct Shared {
    pools: Vec<SharedPool>,
    renderers: Vec<(Described, Arc<dyn Renderer>)>,
    write: Vec<(String, Box<dyn Writer<Scenes>>)>,
    files: Vec<(String, PathBuf)>,
    choices: Vec<String>,
    undecided: Vec<String>,
    libraries: Vec<String>,
}

/// The kind and the options of a stage.
type Described = (&'static str, toml::Table);

/// A pool, and the components that describe it alike.
struct SharedPool {
    id: String,
    described: Described,
    components: Vec<usize>,
    pool: Pool,
}

/// The recipe of some components: at least one, and all without mistakes.
pub(crate) fn assemble(dataset: DatasetTable, built: Vec<BuiltComponent>, lock: LockTable) -> Option<Recipe> {
    let dataset_options = toml::Table::try_from(&dataset).ok()?;
    let lock = Lock::from(lock);
    let (mut shared, mut components, mut resolved) = (Shared::default(), Vec::new(), Vec::new());
    for component in built {
        let weight = component.weight;
        let (component, stages) = shared.component(components.len(), component)?;
        resolved.push(ResolvedComponent { id: component.id.clone(), weight, stages });
        components.push((weight, Box::new(component)));
    }
    let Shared { pools, mut write, mut files, mut choices, mut undecided, mut libraries, .. } = shared;
    for several in [&mut choices, &mut undecided, &mut libraries] {
        let mut seen = BTreeSet::new();
        several.retain(|text| seen.insert(text.clone()));
    }
    let mut seen = BTreeSet::new();
    files.retain(|(option, _)| seen.insert(option.clone()));
    write.sort_by(|(a, _), (b, _)| a.cmp(b));
    let assets = named(pools, &mut components);
    Some(Recipe {
        resolved: resolved::write(&dataset_options, &resolved, &lock),
        dataset: Dataset {
            name: dataset.name,
            seed: dataset.seed,
            scenes: dataset.scenes,
            views_per_scene: dataset.views_per_scene?,
            max_attempts: dataset.max_attempts,
            on_bad_asset: dataset.on_bad_asset,
        },
        assets,
        components: (!components.is_empty()).then(|| OneOf::weighted(components))?,
        write,
        lock,
        files,
        checks: Vec::new(),
        folder: None,
        choices,
        undecided,
        libraries,
    })
}

/// Gives each pool its name in the recipe. Pools of the same id that differ get the name of a component, too.
fn named(pools: Vec<SharedPool>, components: &mut [(f64, Box<Component>)]) -> BTreeMap<String, Pool> {
    let mut all = BTreeMap::new();
    let ids: Vec<String> = pools.iter().map(|pool| pool.id.clone()).collect();
    for SharedPool { id, components: users, pool, .. } in pools {
        let is_only = ids.iter().filter(|other| **other == id).count() == 1;
        let name = if is_only { id.clone() } else { format!("{}.{id}", components[users[0]].1.id) };
        for user in users {
            let component = &mut components[user].1;
            if component.labeled_pools.remove(&id) {
                component.labeled_pools.insert(name.clone());
            }
            component.pools.insert(id.clone(), name.clone());
        }
        all.insert(name, pool);
    }
    all
}

impl Shared {
    /// The component with this index, and its stages for the resolved recipe.
    fn component(&mut self, index: usize, component: BuiltComponent) -> Option<(Component, Vec<ResolvedStage>)> {
        let BuiltComponent { id, built, plan, .. } = component;
        let plan = plan?;
        let (mut place, mut lights, mut labeled_pools) = (Vec::new(), Vec::new(), BTreeSet::new());
        let (mut settle, mut camera, mut views, mut render, mut resolution) = (None, None, None, None, None);
        // A resolved recipe names the stages that run with their defaults, too.
        let mut stages: Vec<ResolvedStage> = plan.implied.iter().map(implied).collect();
        let mut pools = built.pools;
        let rig = Rig::of(&built.views.rig).ok()?;
        let is_shared = |option: &str| option.starts_with(&Slot::Write.stage_name(""));
        self.files.extend(built.files.into_iter().map(|(option, path)| {
            let option = if is_shared(&option) { option } else { table(&id, &option) };
            (option, path)
        }));
        self.choices.extend(built.choices);
        self.undecided.extend(built.undecided.iter().map(|stage| table(&id, stage)));
        self.libraries.extend(built.libraries);
        for mut stage in built.stages {
            let plugin = |stage: &BuiltStage| (stage.entry.crate_name, stage.entry.crate_version);
            let plugins = stage.all().map(plugin).collect();
            let kind = stage.alternatives.is_empty().then_some(stage.entry.kind);
            let described = (stage.entry.kind, stage.options.clone());
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
                Slot::Camera => {
                    resolution = stage.options.get("resolution").cloned().and_then(|value| value.try_into().ok());
                }
                _ => {}
            }
            match stage.stage.take() {
                Some(Stage::Assets(source)) => {
                    let pool = pool(&id, &stage, source, &mut pools)?;
                    self.add_pool(index, &stage.id, described, pool);
                }
                Some(Stage::Camera(model)) => camera = Some(model),
                Some(Stage::Views(sampler)) => views = Some(sampler),
                Some(Stage::Lights(sampler)) => lights.push((stage.id.clone(), OneOf::only(sampler))),
                Some(Stage::Render(renderer)) => render = Some(self.renderer(described, renderer)),
                Some(Stage::WriteScenes(writer)) if index == 0 => self.write.push((stage.id.clone(), writer)),
                // Producers are in the plan.
                _ => {}
            }
            stages.push(ResolvedStage { slot: stage.slot, id: stage.id, kind, options: stage.options, plugins });
        }
        let component = Component {
            id,
            pools: BTreeMap::new(),
            place,
            settle: settle?,
            camera: camera?,
            resolution,
            views: views?,
            conditions: built.views.conditions,
            rig,
            lights,
            render: render?,
            plan,
            draws: built.draws,
            labeled_pools,
        };
        Some((component, stages))
    }

    /// Adds a pool of a component, unless an earlier component describes the same pool.
    fn add_pool(&mut self, component: usize, id: &str, described: Described, pool: Pool) {
        let is_same = |other: &&mut SharedPool| other.id == id && other.described == described;
        match self.pools.iter_mut().find(is_same) {
            Some(same) => same.components.push(component),
            None => self.pools.push(SharedPool { id: id.to_owned(), described, components: vec![component], pool }),
        }
    }

    /// The renderer of a component, or the renderer of an earlier component that describes it alike.
    fn renderer(&mut self, described: Described, renderer: Box<dyn Renderer>) -> Arc<dyn Renderer> {
        if let Some((_, same)) = self.renderers.iter().find(|(other, _)| *other == described) {
            return Arc::clone(same);
        }
        let renderer: Arc<dyn Renderer> = renderer.into();
        self.renderers.push((described, Arc::clone(&renderer)));
        renderer
    }
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
