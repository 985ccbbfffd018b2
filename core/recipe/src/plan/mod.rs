//! The resolver: the provider of each product, and the products that the writers of a recipe need.
//!
//! The renderer or a stage of the recipe provides a product, or else the one registered sensor or annotator that provides it
//! with its default options. A stage may replace a product: all other stages then read the new one, and the original keeps a
//! key of its own. Gaps, ambiguities, cycles and products that a writer cannot store are errors before anything runs. `check`,
//! `plan`, `list` and `run` all use this resolver.
//!
//! Writers name products by text. [`Resolver::parsed`] turns each text into a [`ProductId`] once; from there on, products are
//! compared by their identities.

pub(crate) mod memory;
pub(crate) mod of_tables;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::product::standard::COVERAGE;
use syntable_model::product::{Framing, FramingError, KeyId, ProductId, Scope, parse_product};
use syntable_model::registry::{Entry, Registry, Slot, Stage};
use syntable_model::stage::{
    DatasetAnnotator, Denoiser, FrameAnnotator, ImageAnnotator, Input, Renderer, Replacement, SceneAnnotator, Scenes,
    Sensor, ViewAnnotator, Writer,
};

/// A stage that makes products from products.
pub enum Producer {
    /// Runs once per view, on rendered products.
    Denoiser(Box<dyn Denoiser>),
    /// Runs once per view, with random numbers.
    Sensor(Box<dyn Sensor>),
    /// Runs once per view, and gets only products.
    Image(Box<dyn ImageAnnotator>),
    /// Runs once per view.
    View(Box<dyn ViewAnnotator>),
    /// Runs once per moment of a scene, before its views.
    Frame(Box<dyn FrameAnnotator>),
    /// Runs once per scene, before the views or after them.
    Scene(Box<dyn SceneAnnotator>),
    /// Runs once per dataset.
    Dataset(Box<dyn DatasetAnnotator>),
}

impl Producer {
    /// The stage as a producer, or the stage itself if it provides nothing to others.
    pub fn of(stage: Stage) -> Result<Self, Stage> {
        match stage {
            Stage::Denoise(stage) => Ok(Self::Denoiser(stage)),
            Stage::Sensor(stage) => Ok(Self::Sensor(stage)),
            Stage::AnnotateImage(stage) => Ok(Self::Image(stage)),
            Stage::AnnotateView(stage) => Ok(Self::View(stage)),
            Stage::AnnotateFrame(stage) => Ok(Self::Frame(stage)),
            Stage::AnnotateScene(stage) => Ok(Self::Scene(stage)),
            Stage::AnnotateDataset(stage) => Ok(Self::Dataset(stage)),
            other => Err(other),
        }
    }

    /// The products that it reads.
    pub fn reads(&self) -> Vec<KeyId> {
        match self {
            Self::Denoiser(stage) => stage.reads(),
            Self::Sensor(stage) => stage.reads(),
            Self::Image(stage) => stage.reads(),
            Self::View(stage) => stage.reads(),
            Self::Frame(stage) => stage.reads(),
            Self::Scene(stage) => stage.reads(),
            Self::Dataset(stage) => stage.reads(),
        }
    }

    /// The products that it provides.
    pub fn provides(&self) -> Vec<KeyId> {
        match self {
            Self::Denoiser(stage) => stage.provides(),
            Self::Sensor(stage) => stage.provides(),
            Self::Image(stage) => stage.provides(),
            Self::View(stage) => stage.provides(),
            Self::Frame(stage) => stage.provides(),
            Self::Scene(stage) => stage.provides(),
            Self::Dataset(stage) => stage.provides(),
        }
    }

    /// The products among them that it replaces.
    pub fn replaces(&self) -> Vec<Replacement> {
        match self {
            Self::Denoiser(stage) => stage.replaces(),
            Self::Sensor(stage) => stage.replaces(),
            Self::Image(_) | Self::View(_) | Self::Frame(_) | Self::Scene(_) | Self::Dataset(_) => Vec::new(),
        }
    }

    /// How often it runs.
    pub fn scope(&self) -> Scope {
        match self {
            Self::Denoiser(_) | Self::Sensor(_) | Self::Image(_) | Self::View(_) => Scope::View,
            Self::Frame(_) => Scope::Frame,
            Self::Scene(_) => Scope::Scene,
            Self::Dataset(_) => Scope::Dataset,
        }
    }
}

/// A producer that could run.
pub struct Candidate {
    /// Its table: `denoise`, `sensor.<id>` or `annotate.<id>`.
    pub stage: String,
    /// The stage itself.
    pub producer: Producer,
    /// Its registration and default options, if the recipe does not have it.
    pub implied: Option<Implied>,
}

/// A registered kind with its default options.
#[derive(Clone)]
pub struct Implied {
    /// The kind.
    pub entry: Entry,
    /// The options, all at their defaults.
    pub options: toml::Table,
    /// Whether it belongs to a crate that the program ships with.
    pub is_stock: bool,
}

/// A producer that runs.
#[derive(Clone)]
pub struct PlannedStage {
    /// Its table: `denoise`, `sensor.<id>` or `annotate.<id>`.
    pub stage: String,
    /// The stage itself.
    pub producer: Arc<Producer>,
    /// The products that it reads.
    pub reads: Vec<KeyId>,
    /// The products that it must provide.
    pub provides: Vec<KeyId>,
    /// The products that it replaces.
    pub replaces: Vec<Replacement>,
    /// Framings of single objects. The stage runs once more for each.
    pub of_objects: BTreeSet<Framing>,
}

impl PlannedStage {
    /// Pairs of keys: a product that the stage replaces, and the key under which the original is kept.
    fn replaced(&self) -> impl Iterator<Item = [KeyId; 2]> {
        self.replaces.iter().flat_map(|it| {
            let of_objects = self.of_objects.iter().filter(|_| it.of_objects);
            let framings = std::iter::once(it.product.framing).chain(of_objects.copied());
            framings.map(|framing| [it.product, it.original].map(|key| key.framed(framing)))
        })
    }
}

/// The provider of a product.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Provider {
    /// The renderer.
    Renderer,
    /// A stage by its table: `denoise`, `sensor.<id>` or `annotate.<id>`.
    Stage(String),
}

impl Provider {
    fn is(&self, stage: &str) -> bool {
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

/// Why a recipe cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanError {
    /// The kind of mistake.
    pub fault: PlanFault,
    /// The table of the stage that reads the product, such as `write.png`.
    pub stage: String,
    /// The option of that stage that names the product, if one does.
    pub option: Option<String>,
    /// The product, as the stage names it.
    pub product: String,
    /// The names of all available products, if this one is unknown.
    pub known: Vec<String>,
    /// The tables of the stages that cannot go together.
    pub involved: Vec<String>,
    /// The message.
    pub message: String,
    /// A help message.
    pub help: String,
}

impl PlanError {
    fn involve(&mut self, stages: Vec<String>) {
        self.involved = stages;
    }
}

/// The ways in which a plan fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanFault {
    /// Nothing provides the product.
    Unknown,
    /// Several stages provide or replace the product.
    Ambiguous,
    /// Stages need each other's products.
    Cycle,
    /// A stage reads the product as another type.
    WrongType,
    /// A writer cannot store the product.
    NotStorable,
    /// A stage reads a product that is made later.
    TooEarly,
}

/// The registered sensors and annotators, with their default options.
pub fn registered(registry: &Registry) -> Vec<Candidate> {
    let entries = registry.of_slot(Slot::Sensor).chain(registry.of_slot(Slot::Annotate));
    entries
        .filter_map(|entry| {
            let constructed = entry.construct_str("").ok()?;
            let producer = Producer::of(constructed.stage).ok()?;
            let is_stock = registry.is_stock(entry);
            let implied = Some(Implied { entry: entry.clone(), options: constructed.options, is_stock });
            Some(Candidate { stage: format!("{}.{}", entry.slot, entry.kind), producer, implied })
        })
        .collect()
}

/// All products that the linked plugins can make with default options, by name, each with its providers.
pub fn available(registry: &Registry) -> Vec<(KeyId, Vec<String>)> {
    let mut found: Vec<(KeyId, Vec<String>)> = Vec::new();
    let mut add =
        |key: KeyId, provider: String| match found.iter_mut().find(|(other, _)| other.product_id() == key.product_id())
        {
            Some((_, providers)) => providers.push(provider),
            None => found.push((key, vec![provider])),
        };
    for entry in registry.entries() {
        let provider = || format!("{}.{}", entry.slot, entry.kind);
        match entry.construct_str("").map(|constructed| Producer::of(constructed.stage)) {
            Ok(Ok(producer)) => {
                let originals = producer.replaces().into_iter().map(|replacement| replacement.original);
                producer.provides().into_iter().chain(originals).for_each(|key| add(key, provider()));
            }
            Ok(Err(Stage::Render(renderer))) => renderer.offers().into_iter().for_each(|key| add(key, provider())),
            _ => {}
        }
    }
    found.sort_by_key(|(key, _)| key.product_id());
    found
}

/// Plans what the writers read. `offers` are the renderer's products, `explicit` the producers of the recipe, and `implied` the
/// [registered] ones.
///
/// # Errors
/// All mistakes at once.
pub fn resolve(
    offers: Vec<KeyId>,
    explicit: Vec<Candidate>,
    implied: Vec<Candidate>,
    writers: &[(String, Vec<Input>)],
) -> Result<Plan, Vec<PlanError>> {
    // A stage of the recipe replaces the defaults of all kinds that provide one of its products.
    let provided = explicit.iter().flat_map(|it| it.producer.provides());
    let taken: BTreeSet<ProductId> = provided.map(|key| key.product_id()).collect();
    let free = |it: &Candidate| !it.producer.provides().iter().any(|key| taken.contains(&key.product_id()));
    let mut candidates = explicit;
    candidates.extend(implied.into_iter().filter(free).collect::<Vec<_>>());
    let mut resolver = Resolver::new(offers, candidates);
    for (id, inputs) in writers {
        let stage = format!("write.{id}");
        for input in inputs {
            let asker = Asker { stage: &stage, option: input.option.as_deref() };
            if let Some(key) = resolver.want_named(&input.product, &asker)
                && let Err(reason) = input.accepts.check(&key)
            {
                let message = format!("{stage} cannot store `{key}`: {reason}");
                let help = format!("`{key}` is a value of the kind: {}", key.kind_of_value());
                resolver.fail(PlanFault::NotStorable, &asker, &input.product, message, help);
            }
        }
    }
    resolver.finish()
}

impl Plan {
    /// The plan as a table for people.
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

    /// The products that a writer reads.
    pub fn read_by(&self, writer: &dyn Writer<Scenes>) -> Vec<KeyId> {
        writer.reads().into_iter().filter_map(|input| self.named(&input.product)).collect()
    }

    /// The stages that lack a file that they need, without running any of them.
    pub fn missing(&self) -> Vec<(&str, Error)> {
        let missing = |stage: &'_ PlannedStage| match &*stage.producer {
            Producer::Denoiser(denoiser) => denoiser.found().err().map(|error| error.context(&stage.stage)),
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
                    stage.replaces.iter().any(|it| it.of_objects && is_needed(it.product))
                };
                let of_objects = stage.of_objects.iter().copied().filter(replaces).collect();
                PlannedStage { of_objects, ..stage.clone() }
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

/// Columns aligned by their widest cell.
pub fn table<const N: usize>(rows: &[[String; N]]) -> String {
    table_within(rows, None)
}

/// The same in lines of at most `width` characters, unless a word is longer. The text of wide columns is wrapped.
pub fn table_within<const N: usize>(rows: &[[String; N]], width: Option<usize>) -> String {
    const GAP: usize = 2;
    let longest = |i: usize, split: fn(&str) -> Vec<&str>| {
        let parts = rows.iter().flat_map(|row| split(&row[i]));
        parts.map(|part| part.chars().count()).max().unwrap_or(0)
    };
    let mut widths: [usize; N] = std::array::from_fn(|i| longest(i, |cell| vec![cell]));
    let words: [usize; N] = std::array::from_fn(|i| longest(i, |cell| cell.split(' ').collect()));
    let room = width.unwrap_or(usize::MAX).saturating_sub(GAP * (N - 1));
    while widths.iter().sum::<usize>() > room {
        let widest = (0..N).filter(|&i| widths[i] > words[i]).max_by_key(|&i| widths[i]);
        match widest {
            Some(i) => widths[i] -= 1,
            None => break,
        }
    }
    let mut out = String::new();
    for row in rows {
        let cells: [Vec<String>; N] = std::array::from_fn(|i| wrapped(&row[i], widths[i]));
        for line in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let parts: Vec<String> = (cells.iter().zip(widths))
                .map(|(cell, width)| format!("{:width$}", cell.get(line).map_or("", String::as_str)))
                .collect();
            let _ = writeln!(out, "{}", parts.join("  ").trim_end());
        }
    }
    out
}

/// Lines of at most `width` characters, or of one longer word.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let used = lines.last().map_or(0, |line| line.chars().count());
        if used > 0 && used + 1 + word.chars().count() > width {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

/// How stages clash over a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clash {
    /// Several provide it.
    Providers,
    /// Several replace it.
    Replacers,
}

/// The stage that reads a product.
struct Asker<'a> {
    stage: &'a str,
    option: Option<&'a str>,
}

struct Resolver {
    offers: Vec<KeyId>,
    candidates: Vec<Option<Candidate>>,
    /// The inputs and outputs of the candidates, and when they run.
    traits: Vec<CandidateTraits>,
    /// Index of the candidate that replaces a product, and the replacement.
    replacements: Vec<(usize, Replacement)>,
    entries: Vec<PlanEntry>,
    errors: Vec<PlanError>,
}

struct CandidateTraits {
    stage: String,
    reads: Vec<KeyId>,
    provides: Vec<KeyId>,
    /// What it replaces, even if it is not in the recipe. It is no source of these products.
    replaces: Vec<Replacement>,
    scope: Scope,
    after_views: bool,
    explicit: bool,
    /// Whether a crate of this workspace registers it.
    stock: bool,
}

impl Resolver {
    fn new(offers: Vec<KeyId>, candidates: Vec<Candidate>) -> Self {
        let traits = candidates
            .iter()
            .map(|candidate| CandidateTraits {
                stage: candidate.stage.clone(),
                reads: candidate.producer.reads(),
                provides: candidate.producer.provides(),
                replaces: candidate.producer.replaces(),
                scope: candidate.producer.scope(),
                after_views: false,
                explicit: candidate.implied.is_none(),
                stock: candidate.implied.as_ref().is_some_and(|implied| implied.is_stock),
            })
            .collect();
        let active = candidates.iter().enumerate().filter(|(_, candidate)| candidate.implied.is_none());
        let replacements = active
            .flat_map(|(i, candidate)| candidate.producer.replaces().into_iter().map(move |it| (i, it)))
            .collect();
        let candidates = candidates.into_iter().map(Some).collect();
        Self { offers, candidates, traits, replacements, entries: Vec::new(), errors: Vec::new() }
    }

    fn entry(&self, id: ProductId) -> Option<&PlanEntry> {
        self.entries.iter().find(|entry| entry.key.product_id() == id)
    }

    /// The product that a text of the recipe means, if a stage provides it, the renderer offers it, or it is an original.
    fn parsed(&self, text: &str) -> Option<ProductId> {
        let originals = self.replacements.iter().map(|(_, it)| &it.original);
        let provided = self.traits.iter().flat_map(|note| &note.provides);
        let exact = provided.chain(originals).find(|key| key.is(text)).map(KeyId::product_id);
        exact.or_else(|| {
            let mut framed =
                self.offers.iter().chain(self.replacements.iter().flat_map(|(_, it)| [&it.product, &it.original]));
            framed.find_map(|key| key.parse(text)).map(|key| key.product_id())
        })
    }

    /// Plans a product that a writer names. Gives its key, if something provides it.
    fn want_named(&mut self, text: &str, by: &Asker) -> Option<KeyId> {
        match self.parsed(text) {
            Some(id) => {
                self.want(id, by, &mut Vec::new());
                self.entry(id).map(|entry| entry.key)
            }
            None => {
                self.unknown(text, by);
                None
            }
        }
    }

    /// Plans a product, and first all that its provider reads. `path` holds the candidates on the way here.
    fn want(&mut self, id: ProductId, by: &Asker, path: &mut Vec<usize>) {
        if let Some(entry) = self.entries.iter_mut().find(|entry| entry.key.product_id() == id) {
            if !entry.wanted_by.iter().any(|other| other == by.stage) {
                entry.wanted_by.push(by.stage.to_owned());
            }
            return;
        }
        if let Some((index, replacement)) = self.replacement_of_objects(id) {
            return match replacement.original.framed(id.framing) {
                original if original.product_id() == id => {
                    self.source(replacement.product.framed(id.framing).product_id(), original, by, path);
                }
                _ => self.provide_of_objects(index, replacement, id.framing, by, path),
            };
        }
        let replacers: Vec<usize> =
            self.replacements.iter().filter(|(_, it)| it.product.product_id() == id).map(|&(i, _)| i).collect();
        match (replacers.as_slice(), self.replacements.iter().find(|(_, it)| it.original.product_id() == id).copied()) {
            (&[index], _) if self.has_source(id) => self.provide(index, id, by, path),
            (&[_, _, ..], _) => self.ambiguous(&replacers, Clash::Replacers, id, by),
            (_, Some((_, replacement))) => {
                self.source(replacement.product.product_id(), replacement.original, by, path)
            }
            _ => self.provided(id, by, path),
        }
    }

    /// The stage that replaces a product of single objects, given the product or its original.
    fn replacement_of_objects(&self, id: ProductId) -> Option<(usize, Replacement)> {
        id.framing.objects()?;
        let is_of = |it: &Replacement| [it.product, it.original].iter().any(|key| key.product == id.product);
        self.replacements.iter().copied().find(|(_, it)| it.of_objects && is_of(it))
    }

    /// Plans a product of single objects that a stage replaces. The stage runs on them as on the image, with the same guides.
    fn provide_of_objects(
        &mut self,
        index: usize,
        replacement: Replacement,
        framing: Framing,
        by: &Asker,
        path: &mut Vec<usize>,
    ) {
        let (stage, reads) = (self.traits[index].stage.clone(), self.traits[index].reads.clone());
        let asker = Asker { stage: &stage, option: None };
        self.want(replacement.product.product_id(), by, path);
        for read in reads {
            self.want(read.framed(framing).product_id(), &asker, path);
        }
        let key = replacement.product.framed(framing);
        self.entries.push(PlanEntry { key, provider: Provider::Stage(stage), wanted_by: vec![by.stage.to_owned()] });
    }

    /// The product, if the renderer offers it in this framing.
    fn offered(&self, id: ProductId) -> Option<KeyId> {
        self.offers.iter().find_map(|key| key.of(id))
    }

    /// Whether the renderer or a stage makes a product without replacing it.
    fn has_source(&self, id: ProductId) -> bool {
        self.offered(id).is_some() || !self.sources(id).is_empty()
    }

    /// The candidates that make a product without replacing it.
    fn sources(&self, id: ProductId) -> Vec<usize> {
        let replaces = |i: usize| self.traits[i].replaces.iter().any(|it| it.product.product_id() == id);
        let provides = |i: usize| self.traits[i].provides.iter().any(|key| key.product_id() == id);
        let all: Vec<usize> = (0..self.traits.len()).filter(|&i| provides(i) && !replaces(i)).collect();
        if all.iter().any(|&i| self.traits[i].explicit) {
            return all;
        }
        // A plugin that is linked changes nothing in recipes that do not mention it: what the renderer offers and what
        // the stock plugins provide stays as it was.
        if self.offered(id).is_some() {
            return Vec::new();
        }
        match all.iter().copied().filter(|&i| self.traits[i].stock).collect::<Vec<_>>() {
            stock if stock.len() == 1 => stock,
            _ => all,
        }
    }

    /// Plans the original of a replaced product, which is kept under another key.
    fn source(&mut self, id: ProductId, original: KeyId, by: &Asker, path: &mut Vec<usize>) {
        let before = self.entries.len();
        self.provided(id, by, path);
        if let Some(entry) = self.entries[before..].iter_mut().find(|entry| entry.key.product_id() == id) {
            entry.key = original;
        }
    }

    fn provided(&mut self, id: ProductId, by: &Asker, path: &mut Vec<usize>) {
        let offered = self.offered(id);
        let sources = self.sources(id);
        match (offered, sources.as_slice()) {
            (Some(key), []) => {
                if key.framing.objects().is_some() {
                    // The coverage of the image gives the windows of the objects.
                    self.want(COVERAGE.id().product_id(), &Asker { stage: Slot::Render.name(), option: None }, path);
                }
                self.entries.push(PlanEntry { key, provider: Provider::Renderer, wanted_by: vec![by.stage.into()] });
            }
            (None, &[index]) => self.provide(index, id, by, path),
            (None, []) => self.unknown(&id.to_string(), by),
            (_, several) => self.ambiguous(several, Clash::Providers, id, by),
        }
    }

    fn provide(&mut self, index: usize, id: ProductId, by: &Asker, path: &mut Vec<usize>) {
        if path.contains(&index) {
            let chain: Vec<String> = path.iter().chain([&index]).map(|&i| self.traits[i].stage.clone()).collect();
            let message = format!("stages need each other's products: {}", chain.join(" → "));
            let help = "take one of them out of the recipe".to_owned();
            return self.fail(PlanFault::Cycle, by, &id.to_string(), message, help).involve(chain);
        }
        let (stage, reads, scope) =
            (self.traits[index].stage.clone(), self.traits[index].reads.clone(), self.traits[index].scope);
        path.push(index);
        let asker = Asker { stage: &stage, option: None };
        for read in reads {
            self.want(read.product_id(), &asker, path);
            self.check_read(index, &read, scope, &asker);
        }
        path.pop();
        if let Some(&key) = self.traits[index].provides.iter().find(|key| key.product_id() == id)
            && self.entry(id).is_none()
        {
            self.entries.push(PlanEntry {
                key,
                provider: Provider::Stage(stage),
                wanted_by: vec![by.stage.to_owned()],
            });
        }
    }

    /// Checks the type of a product that a producer reads, and that it is known in time.
    fn check_read(&mut self, index: usize, read: &KeyId, scope: Scope, by: &Asker) {
        let Some(entry) = self.entry(read.product_id()).cloned() else { return };
        if entry.key.type_id() != read.type_id() {
            let (theirs, ours) = (entry.key.type_name(), read.type_name());
            let message = format!("{} reads `{read}` as {ours}, but {} provides {theirs}", by.stage, entry.provider);
            let help =
                "one of the two plugins defines the product wrongly: keys of one name must have one type".to_owned();
            self.fail(PlanFault::WrongType, by, &read.to_string(), message, help);
        }
        let is_late = self.traits.iter().any(|note| entry.provider.is(&note.stage) && note.after_views);
        match (scope, entry.key.scope) {
            (Scope::Dataset, _) => {}
            (_, Scope::Dataset) => self.too_early(read, by, "after all scenes"),
            // An annotator of the scene collects the products of its frames and views.
            (Scope::Scene, of) if of > Scope::Scene || is_late => self.traits[index].after_views = true,
            (own, of) if own < of => self.too_early(read, by, &format!("in each {of}")),
            _ if is_late => self.too_early(read, by, "after the views of a scene"),
            _ => {}
        }
    }

    fn too_early(&mut self, read: &KeyId, by: &Asker, when: &str) {
        let message = format!("{} reads `{read}`, which is known only {when}", by.stage);
        let help = "read it in an annotator that runs later, or in a writer".to_owned();
        self.fail(PlanFault::TooEarly, by, &read.to_string(), message, help);
    }

    fn ambiguous(&mut self, candidates: &[usize], clash: Clash, id: ProductId, by: &Asker) {
        let mut names: Vec<String> = candidates.iter().map(|&i| self.traits[i].stage.clone()).collect();
        let with_renderer = clash == Clash::Providers && self.offered(id).is_some();
        names.extend(with_renderer.then(|| Provider::Renderer.to_string()));
        let what = match clash {
            Clash::Providers => "has several providers",
            Clash::Replacers => "is replaced by several stages",
        };
        let message = format!("product `{id}` {what}: {}", names.join(", "));
        let explicit = candidates.iter().filter(|&&i| self.traits[i].explicit);
        let tables: Vec<String> = explicit.map(|&i| format!("[{}]", self.traits[i].stage)).collect();
        let help = match tables.as_slice() {
            [] => "name the one you want in a [sensor.<id>] or [annotate.<id>] table".to_owned(),
            several if with_renderer => {
                format!("remove {} from the recipe: the renderer makes `{id}`", several.join(" and "))
            }
            [first, second] => format!("remove {first} or {second} from the recipe"),
            several => format!("keep one of {} in the recipe and remove the others", several.join(", ")),
        };
        self.fail(PlanFault::Ambiguous, by, &id.to_string(), message, help).involve(names);
    }

    fn unknown(&mut self, name: &str, by: &Asker) {
        let mut known: Vec<&str> = self.offers.iter().map(|key| key.product).collect();
        known.extend(self.traits.iter().flat_map(|note| &note.provides).map(|key| key.product));
        known.extend(self.replacements.iter().map(|(_, it)| it.original.product));
        known.sort_unstable();
        known.dedup();
        let message = format!("{} reads product `{name}`, which nothing provides", by.stage);
        let is_offered = |product: &str| self.offers.iter().any(|key| key.product == product);
        let help = match name.split_once(" (") {
            Some((product, _)) if is_offered(product) => {
                // Words that are a framing are none of this product.
                parse_product(name).err().unwrap_or(FramingError::Words).to_string()
            }
            Some((product, _)) if known.contains(&product) => {
                format!("`{product}` is not a rendered product: write it without parentheses")
            }
            _ => "`syntable list products` shows all products of the linked plugins".to_owned(),
        };
        self.fail(PlanFault::Unknown, by, name, message, help);
        if let Some(error) =
            self.errors.iter_mut().find(|error| error.product == name && error.fault == PlanFault::Unknown)
        {
            error.known = known.into_iter().map(str::to_owned).collect();
        }
    }

    /// Reports an error, once.
    fn fail(&mut self, fault: PlanFault, by: &Asker, product: &str, message: String, help: String) -> &mut PlanError {
        let same = |error: &PlanError| (error.fault, &*error.stage, &error.message) == (fault, by.stage, &message);
        let index = self.errors.iter().position(same).unwrap_or_else(|| {
            self.errors.push(PlanError {
                fault,
                stage: by.stage.to_owned(),
                option: by.option.map(str::to_owned),
                product: product.to_owned(),
                known: Vec::new(),
                involved: Vec::new(),
                message,
                help,
            });
            self.errors.len() - 1
        });
        &mut self.errors[index]
    }

    fn finish(mut self) -> Result<Plan, Vec<PlanError>> {
        if !self.errors.is_empty() {
            return Err(self.errors);
        }
        let mut plan = Plan::default();
        let runs = |index: usize| self.entries.iter().any(|entry| entry.provider.is(&self.traits[index].stage));
        let active: Vec<Replacement> = self.replacements.iter().filter(|(i, _)| runs(*i)).map(|(_, it)| *it).collect();
        let rendered = self.entries.iter().filter(|entry| entry.provider == Provider::Renderer);
        let rendered_as = |key: KeyId| {
            let replacement = active.iter().find(|it| it.original.framed(key.framing) == key);
            replacement.map_or(key, |it| it.product.framed(key.framing))
        };
        plan.rendered = rendered.map(|entry| rendered_as(entry.key)).collect();
        // Entries are in dependency order, so a producer has to run at its first entry.
        for entry in &self.entries {
            let Some(index) = self.traits.iter().position(|note| entry.provider.is(&note.stage)) else { continue };
            let Some(candidate) = self.candidates[index].take() else { continue };
            let note = &self.traits[index];
            let (reads, provides) = (note.reads.clone(), note.provides.clone());
            let producer = Arc::new(candidate.producer);
            let of_stage = self.entries.iter().filter(|other| other.provider == entry.provider);
            let framings = of_stage.map(|entry| entry.key.framing);
            let of_objects = framings.filter(|framing| framing.objects().is_some()).collect();
            let (stage, replaces) = (candidate.stage.clone(), producer.replaces());
            let planned = PlannedStage { stage, producer, reads, provides, replaces, of_objects };
            plan.implied.extend(candidate.implied.map(|implied| (candidate.stage, implied)));
            match (note.scope, note.after_views) {
                (Scope::View, _) => plan.per_view.push(planned),
                (Scope::Frame, _) => plan.per_frame.push(planned),
                (Scope::Scene, false) => plan.before_views.push(planned),
                (Scope::Scene, true) => plan.after_views.push(planned),
                // The only scope of a trait that is left.
                _ => plan.per_dataset.push(planned),
            }
        }
        plan.replaced = plan.per_view.iter().flat_map(PlannedStage::replaced).collect();
        // The recipe asks for a denoiser that replaces nothing to keep images as they are. It is not idle.
        let is_missed = |note: &CandidateTraits, left: &Candidate| {
            !matches!(left.producer, Producer::Denoiser(_)) || !note.replaces.is_empty()
        };
        let idle =
            self.traits.into_iter().zip(&self.candidates).filter(|(note, left)| {
                note.explicit && left.as_ref().is_some_and(|candidate| is_missed(note, candidate))
            });
        plan.idle = idle.map(|(note, _)| Idle { stage: note.stage, provides: note.provides }).collect();
        plan.entries = self.entries;
        Ok(plan)
    }
}

#[cfg(test)]
mod tests;
