//! Makes a recipe of components whose tables were built.

use crate::component::{Component, table};
use crate::one_of::OneOf;
use crate::own_code::OwnCode;
use crate::plan::of_tables::plan;
use crate::plan::{Implied, Plan};
use crate::recipe::Recipe;
use crate::resolved::{self, ResolvedComponent, ResolvedStage};
use crate::shared_pools::{SharedPool, SharedPools};
use crate::tables::alternatives::SHARED;
use crate::tables::dataset::{Dataset, DatasetTable, Lock, LockTable};
use crate::tables::loader::Loader;
use crate::tables::mixture::ComponentTree;
use crate::tables::noise;
use crate::tables::placers;
use crate::tables::pool::Pool;
use crate::tables::rig::Rig;
use crate::tables::stages::{Built, BuiltStage};
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::origin::PREFIX;
use crate::text::source::{NOWHERE, SET, Sources, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::registry::{Slot, Stage};
use syntable_model::stage::{CameraModel, LightSampler, Placer, Renderer, Scenes, Settler, ViewSampler, Writer};

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
        // A mistake at the same place in every component is about a part that all share, such as a writer.
        let is_of_all = |one: &DiagnosticBuilder| {
            built.len() > 1 && *one.span() != NOWHERE && built.iter().all(|(_, all)| all.contains(one))
        };
        let mut of_components = Vec::new();
        for (index, (Self { id, header, .. }, own)) in built.iter().enumerate() {
            let of = |diagnostic: &DiagnosticBuilder, id: &str| in_mixture(diagnostic, id, header, loader.sources);
            for diagnostic in own {
                if id.is_empty() {
                    of_components.push(diagnostic.clone());
                } else if !is_of_all(diagnostic) {
                    let mut diagnostic = of(diagnostic, id);
                    diagnostic.name_component(id);
                    of_components.push(diagnostic);
                } else if index == 0 {
                    let is_in_recipe = loader.sources.is_same_file(diagnostic.span(), header);
                    let diagnostic = of(diagnostic, "<id>");
                    of_components.push(if is_in_recipe { diagnostic } else { diagnostic.help(IN_ALL) });
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

/// A diagnostic about a component whose table is at `header`. A missing section is missing there. Remedies name the tables
/// of the component, unless the mistake is in a recipe of the user that the component extends.
fn in_mixture(diagnostic: &DiagnosticBuilder, id: &str, header: &Span, sources: &Sources) -> DiagnosticBuilder {
    let mut diagnostic = diagnostic.clone();
    if diagnostic.marks[0].0 == NOWHERE {
        diagnostic.marks[0].0 = header.clone();
    }
    let is_fixed = |name: &str| name == SET || name.starts_with(PREFIX);
    let found = sources.file_of(diagnostic.span());
    if !sources.is_same_file(diagnostic.span(), header) && !found.is_some_and(|file| is_fixed(file.name())) {
        return diagnostic;
    }
    for text in diagnostic.help.iter_mut().chain(diagnostic.marks.iter_mut().map(|(_, label)| label)) {
        for slot in Slot::ALL.into_iter().filter(|slot| *slot != SHARED) {
            let (own, name) = (table(id, slot.name()), slot.name());
            for end in ["]", "."] {
                *text = text.replace(&format!("[{name}{end}"), &format!("[{own}{end}"));
            }
        }
    }
    diagnostic
}

/// A note on a mistake in a recipe that all components extend.
const IN_ALL: &str = "found in all components of the mixture";

/// The pools, renderers, writers and files that the components of a recipe share.
#[derive(Default)]
struct Shared {
    pools: SharedPools,
    renderers: Vec<(Described, Arc<dyn Renderer>)>,
    write: Vec<(String, Box<dyn Writer<Scenes>>)>,
    files: Vec<(String, PathBuf)>,
    choices: Vec<String>,
    undecided: Vec<String>,
    code: Vec<OwnCode>,
}

/// The kind and the options of a stage.
type Described = (&'static str, toml::Table);

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
    let Shared { pools, mut write, mut files, mut choices, mut undecided, mut code, .. } = shared;
    for several in [&mut choices, &mut undecided] {
        let mut seen = BTreeSet::new();
        several.retain(|text| seen.insert(text.clone()));
    }
    let mut seen = BTreeSet::new();
    code.retain(|code| seen.insert(code.clone()));
    let mut seen = BTreeSet::new();
    files.retain(|(option, _)| seen.insert(option.clone()));
    write.sort_by(|(a, _), (b, _)| a.cmp(b));
    let assets = assets(pools, &mut components);
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
        mirrors: Vec::new(),
        checks: Vec::new(),
        folder: None,
        choices,
        undecided,
        code,
    })
}

/// The pools by name. Tells components the names of their pools.
fn assets(pools: SharedPools, components: &mut [(f64, Box<Component>)]) -> BTreeMap<String, Pool> {
    let mut all = BTreeMap::new();
    for (name, SharedPool { id, users, pool, .. }) in pools.named() {
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
        let (plan, rig) = (plan?, Rig::of(&built.views.rig).ok()?);
        // A resolved recipe names the stages that run with their defaults, too.
        let mut resolved: Vec<ResolvedStage> = plan.implied.iter().map(implied).collect();
        self.add_notes(&id, &built);
        let (mut stages, mut pools) = (SceneStages::default(), built.pools);
        for mut stage in built.stages {
            resolved.push(resolved_stage(&stage));
            stages.take(&mut stage)?;
            match stage.stage.take() {
                Some(Stage::Assets(source)) => self.pools.add((index, &id), &stage, source, &mut pools)?,
                Some(Stage::Render(renderer)) => {
                    stages.render = Some(self.renderer((stage.entry.kind, stage.options), renderer));
                }
                Some(Stage::WriteScenes(writer)) if index == 0 => self.write.push((stage.id, writer)),
                // Producers are in the plan.
                _ => {}
            }
        }
        let component = Component {
            id,
            pools: BTreeMap::new(),
            place: stages.place,
            settle: stages.settle?,
            camera: stages.camera?,
            resolution: stages.resolution,
            views: stages.views?,
            conditions: built.views.conditions,
            rig,
            lights: stages.lights,
            render: stages.render?,
            plan,
            draws: built.draws,
            labeled_pools: stages.labeled_pools,
        };
        Some((component, resolved))
    }

    /// Adds the files, the code and the chosen kinds of a component.
    fn add_notes(&mut self, component: &str, built: &Built) {
        let is_shared = |option: &str| option.starts_with(&SHARED.stage_name(""));
        self.files.extend(built.files.iter().map(|(option, path)| {
            let option = if is_shared(option) { option.clone() } else { table(component, option) };
            (option, path.clone())
        }));
        self.choices.extend_from_slice(&built.choices);
        self.undecided.extend(built.undecided.iter().map(|stage| table(component, stage)));
        self.code.extend_from_slice(&built.code);
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

/// The stages of a component that make its scenes.
#[derive(Default)]
struct SceneStages {
    place: Vec<(String, OneOf<dyn Placer>)>,
    settle: Option<OneOf<dyn Settler>>,
    camera: Option<Box<dyn CameraModel>>,
    resolution: Option<[u32; 2]>,
    views: Option<Box<dyn ViewSampler>>,
    lights: Vec<(String, OneOf<dyn LightSampler>)>,
    render: Option<Arc<dyn Renderer>>,
    labeled_pools: BTreeSet<String>,
}

impl SceneStages {
    /// Takes a stage out of its table if only this component has it.
    fn take(&mut self, stage: &mut BuiltStage) -> Option<()> {
        match stage.slot {
            Slot::Place => {
                let placers = alternatives(stage, |stage| match stage {
                    Stage::Place(placer) => Some(placer),
                    _ => None,
                })?;
                if placers.all().any(Placer::places_objects) {
                    self.labeled_pools.append(&mut stage.object_pools);
                }
                self.place.push((stage.id.clone(), placers));
            }
            Slot::Settle => {
                self.settle = alternatives(stage, |stage| match stage {
                    Stage::Settle(settler) => Some(settler),
                    _ => None,
                });
            }
            Slot::Lights => {
                let samplers = alternatives(stage, |stage| match stage {
                    Stage::Lights(sampler) => Some(sampler),
                    _ => None,
                })?;
                self.lights.push((stage.id.clone(), samplers));
            }
            Slot::Camera => {
                self.resolution = stage.options.get("resolution").cloned().and_then(|value| value.try_into().ok());
                self.camera = match stage.stage.take() {
                    Some(Stage::Camera(model)) => Some(model),
                    _ => None,
                };
            }
            Slot::Views => {
                self.views = match stage.stage.take() {
                    Some(Stage::Views(sampler)) => Some(sampler),
                    _ => None,
                };
            }
            _ => {}
        }
        Some(())
    }
}

/// A stage of the resolved recipe.
fn resolved_stage(stage: &BuiltStage) -> ResolvedStage {
    let plugin = |stage: &BuiltStage| (stage.entry.crate_name, stage.entry.crate_version);
    ResolvedStage {
        slot: stage.slot,
        id: stage.id.clone(),
        kind: stage.alternatives.is_empty().then_some(stage.entry.kind),
        options: stage.options.clone(),
        plugins: stage.all().map(plugin).collect(),
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
