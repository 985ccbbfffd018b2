//! Components: the makers of scenes. A mixture of recipes has several, any other recipe has one.

use crate::one_of::OneOf;
use crate::plan::Plan;
use crate::tables::alternatives::MIXTURE;
use crate::tables::conditions::ViewConditions;
use crate::tables::references::Draw;
use crate::tables::rig::Rig;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use syntable_model::registry::Slot;
use syntable_model::stage::{CameraModel, LightSampler, Placer, Renderer, Settler, ViewSampler};

/// The stages that make a scene and its products.
pub struct Component {
    /// Its name in the mixture; empty in a recipe that is no mixture.
    pub id: String,
    /// Names of its pools in the recipe, by the names that its options use. Components share a pool if they describe it
    /// alike.
    pub pools: BTreeMap<String, String>,
    /// The placers with their ids, in the order in which they run.
    pub place: Vec<(String, OneOf<dyn Placer>)>,
    /// The settler.
    pub settle: OneOf<dyn Settler>,
    /// The camera.
    pub camera: Box<dyn CameraModel>,
    /// Width and height of the images, px, if the camera states them.
    pub resolution: Option<[u32; 2]>,
    /// The view sampler.
    pub views: Box<dyn ViewSampler>,
    /// Conditions that the poses of the view sampler must meet.
    pub conditions: Option<ViewConditions>,
    /// The cameras of each pose of the view sampler.
    pub rig: Rig,
    /// The light samplers with their ids, in the recipe's order.
    pub lights: Vec<(String, OneOf<dyn LightSampler>)>,
    /// The renderer. Components share a renderer if they describe it alike.
    pub render: Arc<dyn Renderer>,
    /// The products to compute for the writers, with the denoiser, the sensors and the annotators. Components agree on the
    /// products that writers and annotators of the dataset read.
    pub plan: Plan,
    /// Options of stages that name pools, in the order of the slots.
    pub draws: Vec<Draw>,
    /// Pools from which placers draw objects that labels describe, by their names in the recipe.
    pub labeled_pools: BTreeSet<String>,
}

impl Component {
    /// The table of a stage in the recipe: `place.objects`, or `mixture.tables.place.objects`.
    pub fn table(&self, stage: &str) -> String {
        table(&self.id, stage)
    }
}

/// The table of a stage of a component in the recipe.
pub(crate) fn table(component: &str, stage: &str) -> String {
    if component.is_empty() { stage.to_owned() } else { format!("{MIXTURE}.{component}.{stage}") }
}

/// The component in a key of a recipe, and the component's own key: `tables` and `sensor.rgb` in
/// `mixture.tables.sensor.rgb`. A key outside of components has an empty component.
pub fn split_key(key: &str) -> (&str, &str) {
    let in_mixture = || key.strip_prefix(MIXTURE)?.strip_prefix('.')?.split_once('.');
    in_mixture().unwrap_or(("", key))
}

/// Name in the recipe of a component's pool that differs from the pools of other components with the same id.
pub fn pool_name(component: &str, id: &str) -> String {
    if component.is_empty() { id.to_owned() } else { format!("{component}.{id}") }
}

/// The component and the id in the name of a pool. The component is empty if all components with this id share the pool.
pub fn split_pool_name(name: &str) -> (&str, &str) {
    name.split_once('.').unwrap_or(("", name))
}

/// The table of a pool, given its name in the recipe: `assets.objects`, or `mixture.tables.assets.objects`.
pub fn pool_table(name: &str) -> String {
    let (component, id) = split_pool_name(name);
    table(component, &Slot::Assets.stage_name(id))
}

/// The components in the table of a resolved recipe, by name; the recipe itself, without a name, if it is no mixture.
pub fn components_of(resolved: &toml::Table) -> Vec<(&str, &toml::Table)> {
    match resolved.get(MIXTURE).and_then(toml::Value::as_table) {
        Some(mixture) => mixture.iter().filter_map(|(id, table)| Some((id.as_str(), table.as_table()?))).collect(),
        None => vec![("", resolved)],
    }
}
