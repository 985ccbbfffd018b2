//! The plan of a recipe: the products and stages of a run, in order.

use super::producer::{Implied, PlannedStage, Producer};
use super::table::table;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};
use syntable_model::error::Error;
use syntable_model::product::standard::COVERAGE;
use syntable_model::product::{Framing, KeyId, ProductId, Scope, parse_product};
use syntable_model::registry::Slot;
use syntable_model::stage::{Input, Renderer};

/// The provider of a product.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Provider {
    /// The renderer.
    Renderer,
    /// A stage by its table: `denoise`, `sensor.<id>` or `annotate.<id>`.
    Stage(String),
}

impl Provider {
    pub(super) fn is(&self, stage: &str) -> bool {
        matches!(self, Self::Stage(own) if own == stage)
    }
}

impl fmt::Display for Provider {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Renderer => Slot::Render.name(),
            Self::Stage(stage) => stage,
        })
    }
}

/// A computed product.
#[derive(Debug, Clone)]
pub struct PlanEntry {
    /// The product.
    pub key: KeyId,
    /// Its provider.
    pub provider: Provider,
    /// The stages that read it, such as `write.png`.
    pub wanted_by: Vec<String>,
}

/// The products and stages of a run, in order.
#[derive(Clone, Default)]
pub struct Plan {
    /// Products that the renderer makes for each view, under the keys that the renderer offers.
    pub rendered: Vec<KeyId>,
    /// Pairs of keys: a product that a stage replaces, and the key under which the original is kept.
    pub replaced: Vec<[KeyId; 2]>,
    /// The denoiser, if the renderer runs it.
    pub denoiser: Option<PlannedStage>,
    /// Annotators of the scene that run before the views.
    pub before_views: Vec<PlannedStage>,
    /// Annotators that run once per moment, before its views.
    pub per_frame: Vec<PlannedStage>,
    /// Producers that run once per view.
    pub per_view: Vec<PlannedStage>,
    /// Annotators of the scene that read products of the views or frames.
    pub after_views: Vec<PlannedStage>,
    /// Annotators of the dataset.
    pub per_dataset: Vec<PlannedStage>,
    /// All computed products, each after the products that it is made from.
    pub entries: Vec<PlanEntry>,
    /// Producers that run without being in the recipe.
    pub implied: Vec<(String, Implied)>,
    /// Stages of the recipe that do not run.
    pub idle: Vec<Idle>,
}

/// A stage of the recipe that does not run, because nothing reads its products.
#[derive(Debug, Clone)]
pub struct Idle {
    /// Its table.
    pub stage: String,
    /// The products that it would provide.
    pub provides: Vec<KeyId>,
}

impl Plan {
    /// The plan as a table for users.
    pub fn table(&self, renderer: &dyn Renderer) -> String {
        let mut rows = vec![["product", "provider", "per", "wanted by"].map(str::to_owned)];
        rows.extend(self.entries.iter().map(|entry| {
            [entry.key.to_string(), entry.provider.to_string(), entry.key.scope.to_string(), entry.wanted_by.join(", ")]
        }));
        let mut out = table(&rows);
        let _ = writeln!(out, "\nrender: {}", renderer.cost());
        out
    }

    /// All producers that run.
    pub fn stages(&self) -> impl Iterator<Item = &PlannedStage> {
        let before = self.before_views.iter().chain(&self.per_frame);
        before.chain(&self.per_view).chain(&self.after_views).chain(&self.per_dataset)
    }

    /// All producers that run, mutable: a preview puts equal stages of an earlier recipe into a plan.
    pub(crate) fn stages_mut(&mut self) -> impl Iterator<Item = &mut PlannedStage> {
        let before = self.before_views.iter_mut().chain(&mut self.per_frame);
        before.chain(&mut self.per_view).chain(&mut self.after_views).chain(&mut self.per_dataset)
    }

    /// The entry of a product.
    fn entry(&self, id: ProductId) -> Option<&PlanEntry> {
        self.entries.iter().find(|entry| entry.key.product_id() == id)
    }

    /// The computed product that a text names.
    pub fn named(&self, text: &str) -> Option<KeyId> {
        let (product, framing) = parse_product(text).ok()?;
        let is_meant = |key: &KeyId| key.product == product && key.framing == framing;
        self.entries.iter().map(|entry| entry.key).find(is_meant)
    }

    /// The products that the inputs of a stage name.
    pub fn read_by(&self, inputs: &[Input]) -> Vec<KeyId> {
        inputs.iter().filter_map(|input| self.named(&input.product)).collect()
    }

    /// The stages that lack a file that they need for scenes of some views, without running any of them.
    pub fn missing(&self, views: u32) -> Vec<(&str, Error)> {
        let missing = |stage: &'_ PlannedStage| match &*stage.producer {
            Producer::Denoiser(denoiser) => denoiser.found().err().map(|error| error.context(&stage.stage)),
            Producer::Sensor(sensor) => sensor.found(views).err().map(|error| error.context(&stage.stage)),
            _ => None,
        };
        self.per_view.iter().filter_map(|stage| Some((stage.stage.as_str(), missing(stage)?))).collect()
    }

    /// Checks that the stages find what they need from outside the program. Loads native libraries.
    pub fn ready(&self) -> Result<(), Error> {
        for stage in &self.per_view {
            if let Producer::Denoiser(denoiser) = &*stage.producer {
                denoiser.ready().map_err(|error| error.context(&stage.stage))?;
            }
        }
        Ok(())
    }

    /// The part of the plan that computes some products, for a scene that has the others already. With `with_records`, the part
    /// has all annotators of the dataset and all that they read, because a scene's products are recorded all at once.
    pub fn part<'n>(&self, products: impl IntoIterator<Item = &'n str>, with_records: bool) -> Self {
        let mut needed: BTreeSet<ProductId> = BTreeSet::new();
        let named = products.into_iter().filter_map(|text| self.named(text));
        let mut open: Vec<ProductId> = named.map(|key| key.product_id()).collect();
        if with_records {
            open.extend(self.per_dataset.iter().flat_map(|stage| &stage.reads).map(KeyId::product_id));
        }
        while let Some(id) = open.pop() {
            let Some(entry) = self.entry(id) else { continue };
            // Products of the dataset are made from records at the end of the run.
            if entry.key.scope != Scope::Dataset && needed.insert(id) {
                let provider = self.stages().find(|stage| entry.provider.is(&stage.stage));
                let reads = provider.into_iter().flat_map(|stage| &stage.reads);
                open.extend(reads.clone().map(KeyId::product_id));
                if id.framing.objects().is_some() {
                    open.push(COVERAGE.id().product_id());
                }
                if id.framing.part().is_some() {
                    open.extend(reads.map(|key| key.framed(id.framing).product_id()));
                }
            }
        }
        let is_needed = |entry: &&PlanEntry| needed.contains(&entry.key.product_id());
        let entries: Vec<PlanEntry> = self.entries.iter().filter(is_needed).cloned().collect();
        let running = |stages: &[PlannedStage]| -> Vec<PlannedStage> {
            let runs = |stage: &&PlannedStage| entries.iter().any(|entry| entry.provider.is(&stage.stage));
            let of_needed = |stage: &PlannedStage| {
                let replaces = |framing: &Framing| {
                    let is_needed = |key: KeyId| needed.contains(&key.framed(*framing).product_id());
                    stage.replaces.iter().any(|it| it.of_parts && is_needed(it.product))
                };
                let of_parts = stage.of_parts.iter().copied().filter(replaces).collect();
                PlannedStage { of_parts, ..stage.clone() }
            };
            stages.iter().filter(runs).map(of_needed).collect()
        };
        let rendered = |key: &&KeyId| {
            let replaced = self.replaced.iter().find(|[product, _]| *product == **key);
            let original = replaced.map_or(**key, |[_, original]| *original);
            needed.contains(&original.product_id())
        };
        Self {
            rendered: self.rendered.iter().filter(rendered).copied().collect(),
            denoiser: None,
            replaced: self
                .replaced
                .iter()
                .filter(|[_, original]| needed.contains(&original.product_id()))
                .copied()
                .collect(),
            before_views: running(&self.before_views),
            per_frame: running(&self.per_frame),
            per_view: running(&self.per_view),
            after_views: running(&self.after_views),
            per_dataset: if with_records { self.per_dataset.clone() } else { Vec::new() },
            implied: Vec::new(),
            idle: Vec::new(),
            entries,
        }
    }

    /// The plan for a renderer that may run the denoiser itself. It then gets requests for the products of the denoiser, and for
    /// those inputs of the denoiser that other stages read as well.
    pub fn on(mut self, renderer: &dyn Renderer) -> Self {
        let runs = |stage: &PlannedStage| match &*stage.producer {
            Producer::Denoiser(denoiser) => renderer.denoises(&**denoiser),
            _ => false,
        };
        let Some(at) = self.per_view.iter().position(runs) else { return self };
        let denoiser = self.per_view.remove(at);
        let is_asked = |entry: &&PlanEntry| {
            let others = entry.wanted_by.iter().any(|stage| *stage != denoiser.stage);
            entry.provider.is(&denoiser.stage) || entry.provider == Provider::Renderer && others
        };
        self.rendered = self.entries.iter().filter(is_asked).map(|entry| entry.key).collect();
        self.replaced.retain(|[product, _]| !denoiser.replaced().any(|[own, _]| own == *product));
        self.denoiser = Some(denoiser);
        self
    }

    /// The rendered products by framing, each under the key that the renderer offers. The renderer gets one request per framing,
    /// the image first.
    pub fn by_framing(&self) -> BTreeMap<Framing, Vec<KeyId>> {
        let mut framings: BTreeMap<Framing, Vec<KeyId>> = BTreeMap::new();
        for key in &self.rendered {
            framings.entry(key.framing).or_default().push(key.framed(Framing::IMAGE));
        }
        framings
    }

    /// Products of each view and its moment that annotators of the dataset read. Each scene's record has them.
    pub fn recorded_of_views(&self) -> Vec<KeyId> {
        self.recorded(Scope::comes_with_view)
    }

    /// Products of the scene that annotators of the dataset read. Each scene's record has them.
    pub fn recorded_of_scene(&self) -> Vec<KeyId> {
        self.recorded(|scope| scope == Scope::Scene)
    }

    fn recorded(&self, is_recorded: impl Fn(Scope) -> bool) -> Vec<KeyId> {
        let mut keys: Vec<KeyId> = self.per_dataset.iter().flat_map(|stage| stage.reads.iter().copied()).collect();
        keys.retain(|key| is_recorded(key.scope));
        keys.sort_by_key(KeyId::product_id);
        keys.dedup_by_key(|key| key.product_id());
        keys
    }
}
