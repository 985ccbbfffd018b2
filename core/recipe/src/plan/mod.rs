//! The one resolver: who provides which product, and what has to be computed for the writers of a recipe.
//!
//! A product is provided by the renderer, by a stage of the recipe, or else by the one registered sensor or annotator
//! that provides it with its default options. A stage may replace a product; then everyone else reads the new one, and
//! the original keeps a key of its own. Gaps, ambiguities, cycles and products that a writer cannot store are errors
//! before anything runs. `check`, `plan`, `list` and `run` all ask here.

pub(crate) mod memory;
pub(crate) mod of_tables;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::product::standard::COVERAGE;
use syntable_model::product::{KeyId, MAX_CANVAS, MAX_SUBPIXELS, Name, RenderParameters, Scope};
use syntable_model::registry::{Entry, Registry, Slot, Stage};
use syntable_model::stage::{
    DatasetAnnotator, Denoiser, ImageAnnotator, Input, Renderer, Replacement, SceneAnnotator, Scenes, Sensor,
    ViewAnnotator, Writer,
};

/// A stage that makes products from products.
pub enum Producer {
    /// Runs once per view, on what was rendered.
    Denoiser(Box<dyn Denoiser>),
    /// Runs once per view, with random numbers.
    Sensor(Box<dyn Sensor>),
    /// Runs once per view, and sees its products alone.
    Image(Box<dyn ImageAnnotator>),
    /// Runs once per view.
    View(Box<dyn ViewAnnotator>),
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
            Self::Scene(stage) => stage.provides(),
            Self::Dataset(stage) => stage.provides(),
        }
    }

    /// The products among them that it replaces.
    pub fn replaces(&self) -> Vec<Replacement> {
        match self {
            Self::Denoiser(stage) => stage.replaces(),
            Self::Sensor(stage) => stage.replaces(),
            Self::Image(_) | Self::View(_) | Self::Scene(_) | Self::Dataset(_) => Vec::new(),
        }
    }

    /// How often it runs.
    pub fn scope(&self) -> Scope {
        match self {
            Self::Denoiser(_) | Self::Sensor(_) | Self::Image(_) | Self::View(_) => Scope::View,
            Self::Scene(_) => Scope::Scene,
            Self::Dataset(_) => Scope::Dataset,
        }
    }
}

/// A producer that could run.
pub struct Candidate {
    /// Its table: `denoise`, `sensor.<id>` or `annotate.<id>`.
    pub stage: String,
    /// What would run.
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
    /// What runs.
    pub producer: Arc<Producer>,
    /// The products that it reads.
    pub reads: Vec<KeyId>,
    /// The products that it must provide.
    pub provides: Vec<KeyId>,
    /// The products that it replaces.
    pub replaces: Vec<Replacement>,
    /// Parameters of rendering of objects by themselves that it runs with once more each.
    pub of_objects: BTreeSet<RenderParameters>,
}

impl PlannedStage {
    /// What others make under the first key is kept under the second, for each product that the stage replaces.
    fn replaced(&self) -> impl Iterator<Item = [KeyId; 2]> {
        self.replaces.iter().flat_map(|it| {
            let of_objects = self.of_objects.iter().filter(|_| it.of_objects);
            let parameters = std::iter::once(it.product.name.parameters).chain(of_objects.copied());
            parameters.map(|of| [it.product, it.original].map(|key| key.with(of)))
        })
    }
}

/// Who provides a product.
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
    /// Who computes it.
    pub provider: Provider,
    /// The stages that read it, such as `write.png`.
    pub wanted_by: Vec<String>,
}

/// What a run computes, in order.
#[derive(Clone, Default)]
pub struct Plan {
    /// Products that the renderer makes for every view, under the renderer's own names.
    pub rendered: Vec<KeyId>,
    /// What is made under the first key of a pair is kept under the second, because a stage replaces it.
    pub replaced: Vec<[KeyId; 2]>,
    /// The denoiser, if the renderer runs it.
    pub denoiser: Option<PlannedStage>,
    /// Annotators of the scene that run before the views.
    pub before_views: Vec<PlannedStage>,
    /// Producers that run once per view.
    pub per_view: Vec<PlannedStage>,
    /// Annotators of the scene that read products of the views.
    pub after_views: Vec<PlannedStage>,
    /// Annotators of the dataset.
    pub per_dataset: Vec<PlannedStage>,
    /// Everything that is computed, each product after those that it is made from.
    pub entries: Vec<PlanEntry>,
    /// Producers that run without being in the recipe.
    pub implied: Vec<(String, Implied)>,
    /// Stages of the recipe that nobody needs.
    pub idle: Vec<Idle>,
}

/// A stage of the recipe that is not computed, because nobody reads what it provides.
#[derive(Debug, Clone)]
pub struct Idle {
    /// Its table.
    pub stage: String,
    /// What it would provide.
    pub provides: Vec<KeyId>,
}

/// Why a recipe cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanError {
    /// What is wrong.
    pub fault: Fault,
    /// The table of the stage that asks, such as `write.png`.
    pub stage: String,
    /// The option of that stage that names the product, if one does.
    pub option: Option<String>,
    /// The product in question.
    pub product: String,
    /// The names of all products that could be provided, if this one is unknown.
    pub known: Vec<String>,
    /// The tables of the stages that cannot go together.
    pub involved: Vec<String>,
    /// What is wrong, in words.
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
pub enum Fault {
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
    /// A stage reads what is known only later.
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
    let mut add = |key: KeyId, provider: String| match found.iter_mut().find(|(other, _)| other.name == key.name) {
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
    found.sort_by_key(|(key, _)| key.name);
    found
}

/// Plans what the writers read: `offers` are the renderer's products, `explicit` the producers of the recipe, `implied`
/// the [registered] ones. All errors are given at once.
pub fn resolve(
    offers: Vec<KeyId>,
    explicit: Vec<Candidate>,
    implied: Vec<Candidate>,
    writers: &[(String, Vec<Input>)],
) -> Result<Plan, Vec<PlanError>> {
    // What the recipe sets up replaces the defaults of every kind that provides the same.
    let taken: BTreeSet<Name> = explicit.iter().flat_map(|it| it.producer.provides()).map(|key| key.name).collect();
    let free = |it: &Candidate| !it.producer.provides().iter().any(|key| taken.contains(&key.name));
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
                let message = format!("{stage} cannot store `{}`: {reason}", key.name);
                let help = format!("`{}` is a value of the kind: {}", key.name, key.kind_of_value());
                resolver.fail(Fault::NotStorable, &asker, &input.product, message, help);
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
            [
                entry.key.name.to_string(),
                entry.provider.to_string(),
                entry.key.scope.to_string(),
                entry.wanted_by.join(", "),
            ]
        }));
        let mut out = table(&rows);
        let _ = writeln!(out, "\nrender: {}", renderer.cost());
        out
    }

    /// All producers that run.
    pub fn stages(&self) -> impl Iterator<Item = &PlannedStage> {
        self.before_views.iter().chain(&self.per_view).chain(&self.after_views).chain(&self.per_dataset)
    }

    /// The same, to be replaced by what is the same.
    pub(crate) fn stages_mut(&mut self) -> impl Iterator<Item = &mut PlannedStage> {
        let of_views = self.before_views.iter_mut().chain(&mut self.per_view).chain(&mut self.after_views);
        of_views.chain(&mut self.per_dataset)
    }

    /// The products that a writer reads.
    pub fn read_by(&self, writer: &dyn Writer<Scenes>) -> Vec<KeyId> {
        let key = |input: Input| self.entries.iter().map(|entry| entry.key).find(|key| key.name == *input.product);
        writer.reads().into_iter().filter_map(key).collect()
    }

    /// The stages that lack a file that they need, without running any of them.
    pub fn missing(&self) -> Vec<(&str, Error)> {
        let missing = |stage: &'_ PlannedStage| match &*stage.producer {
            Producer::Denoiser(denoiser) => denoiser.found().err().map(|error| error.context(&stage.stage)),
            _ => None,
        };
        self.per_view.iter().filter_map(|stage| Some((stage.stage.as_str(), missing(stage)?))).collect()
    }

    /// Asks the stages whether what they need from outside the program is there. Loads native libraries.
    pub fn ready(&self) -> Result<(), Error> {
        for stage in &self.per_view {
            if let Producer::Denoiser(denoiser) = &*stage.producer {
                denoiser.ready().map_err(|error| error.context(&stage.stage))?;
            }
        }
        Ok(())
    }

    /// The part of the plan that computes some products, for a scene that has the others already. Annotators of the dataset
    /// are in it only `with_records`, with all that they read: what is recorded of a scene is recorded at once.
    pub fn part<'n>(&self, products: impl IntoIterator<Item = &'n str>, with_records: bool) -> Self {
        let mut needed: BTreeSet<Name> = BTreeSet::new();
        let known = |name: &str| self.entries.iter().find(|entry| entry.key.name == *name).map(|entry| entry.key.name);
        let mut open: Vec<Name> = products.into_iter().filter_map(known).collect();
        if with_records {
            open.extend(self.per_dataset.iter().flat_map(|stage| &stage.reads).map(|key| key.name));
        }
        while let Some(name) = open.pop() {
            let Some(entry) = self.entries.iter().find(|entry| entry.key.name == name) else { continue };
            // What covers the dataset is made from records at its end.
            if entry.key.scope != Scope::Dataset && needed.insert(name) {
                let provider = self.stages().find(|stage| entry.provider.is(&stage.stage));
                let reads = provider.into_iter().flat_map(|stage| &stage.reads);
                open.extend(reads.clone().map(|key| key.name));
                if name.parameters.objects.is_some() {
                    open.push(COVERAGE.id().name);
                    open.extend(reads.map(|key| key.with(name.parameters).name));
                }
            }
        }
        let is_needed = |entry: &&PlanEntry| needed.contains(&entry.key.name);
        let entries: Vec<PlanEntry> = self.entries.iter().filter(is_needed).cloned().collect();
        let running = |stages: &[PlannedStage]| -> Vec<PlannedStage> {
            let runs = |stage: &&PlannedStage| entries.iter().any(|entry| entry.provider.is(&stage.stage));
            let of_needed = |stage: &PlannedStage| {
                let replaces = |of: &RenderParameters| {
                    stage.replaces.iter().any(|it| it.of_objects && needed.contains(&it.product.with(*of).name))
                };
                let of_objects = stage.of_objects.iter().copied().filter(replaces).collect();
                PlannedStage { of_objects, ..stage.clone() }
            };
            stages.iter().filter(runs).map(of_needed).collect()
        };
        let rendered = |key: &&KeyId| {
            let replaced = self.replaced.iter().find(|[product, _]| *product == **key);
            let original = replaced.map_or(**key, |[_, original]| *original);
            needed.contains(&original.name)
        };
        Self {
            rendered: self.rendered.iter().filter(rendered).copied().collect(),
            denoiser: None,
            replaced: self.replaced.iter().filter(|[_, original]| needed.contains(&original.name)).copied().collect(),
            before_views: running(&self.before_views),
            per_view: running(&self.per_view),
            after_views: running(&self.after_views),
            per_dataset: if with_records { self.per_dataset.clone() } else { Vec::new() },
            implied: Vec::new(),
            idle: Vec::new(),
            entries,
        }
    }

    /// The plan where the renderer runs the denoiser, if it can: then it is asked for what the denoiser provides, and for
    /// what others read of what the denoiser reads.
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

    /// The rendered products by the [framing](RenderParameters::framing) that they are wanted in, each as a product of the
    /// image: the renderer is asked for one after the other, and for the image first.
    pub fn by_framing(&self) -> BTreeMap<RenderParameters, Vec<KeyId>> {
        let mut framings: BTreeMap<RenderParameters, Vec<KeyId>> = BTreeMap::new();
        for key in &self.rendered {
            let parameters = key.name.parameters;
            let of_image = RenderParameters { before_support: parameters.before_support, ..RenderParameters::IMAGE };
            framings.entry(parameters.framing()).or_default().push(key.with(of_image));
        }
        framings
    }

    /// Products of a scope that the annotators of the dataset read: they are recorded for every scene.
    pub fn recorded(&self, scope: Scope) -> Vec<KeyId> {
        let mut keys: Vec<KeyId> = self.per_dataset.iter().flat_map(|stage| stage.reads.iter().copied()).collect();
        keys.retain(|key| key.scope == scope);
        keys.sort_by_key(|key| key.name);
        keys.dedup_by_key(|key| key.name);
        keys
    }
}

/// Columns aligned by their widest cell.
pub fn table<const N: usize>(rows: &[[String; N]]) -> String {
    table_within(rows, None)
}

/// The same in lines of at most `width` characters, as far as words allow: wide columns go on below.
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

/// Who wants a product.
struct Asker<'a> {
    stage: &'a str,
    option: Option<&'a str>,
}

struct Resolver {
    offers: Vec<KeyId>,
    candidates: Vec<Option<Candidate>>,
    /// What the candidates read and provide, and when they run.
    notes: Vec<Note>,
    /// Index of the candidate that replaces a product, and the replacement.
    replacements: Vec<(usize, Replacement)>,
    entries: Vec<PlanEntry>,
    errors: Vec<PlanError>,
}

struct Note {
    stage: String,
    reads: Vec<KeyId>,
    provides: Vec<KeyId>,
    /// What it replaces, whether it is in the recipe or not: of that it is no source.
    replaces: Vec<Replacement>,
    scope: Scope,
    after_views: bool,
    explicit: bool,
    /// Whether a crate of this workspace registers it.
    stock: bool,
}

impl Resolver {
    fn new(offers: Vec<KeyId>, candidates: Vec<Candidate>) -> Self {
        let notes = candidates
            .iter()
            .map(|candidate| Note {
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
        Self { offers, candidates, notes, replacements, entries: Vec::new(), errors: Vec::new() }
    }

    fn entry(&self, name: Name) -> Option<&PlanEntry> {
        self.entries.iter().find(|entry| entry.key.name == name)
    }

    /// The name of a product as a recipe writes it, if anything provides it or it is an original.
    fn parsed(&self, text: &str) -> Option<Name> {
        let originals = self.replacements.iter().map(|(_, it)| &it.original);
        let provided = self.notes.iter().flat_map(|note| &note.provides);
        let exact = provided.chain(originals).map(|key| key.name).find(|name| *name == *text);
        exact.or_else(|| {
            let mut framed =
                self.offers.iter().chain(self.replacements.iter().flat_map(|(_, it)| [&it.product, &it.original]));
            framed.find_map(|key| key.parse(text)).map(|key| key.name)
        })
    }

    /// Plans a product that a writer names. Gives its key, if something provides it.
    fn want_named(&mut self, text: &str, by: &Asker) -> Option<KeyId> {
        match self.parsed(text) {
            Some(name) => {
                self.want(name, by, &mut Vec::new());
                self.entry(name).map(|entry| entry.key)
            }
            None => {
                self.unknown(text, by);
                None
            }
        }
    }

    /// Plans a product, and first all that its provider reads. `path` holds the candidates on the way here.
    fn want(&mut self, name: Name, by: &Asker, path: &mut Vec<usize>) {
        if let Some(entry) = self.entries.iter_mut().find(|entry| entry.key.name == name) {
            if !entry.wanted_by.iter().any(|other| other == by.stage) {
                entry.wanted_by.push(by.stage.to_owned());
            }
            return;
        }
        if let Some((index, replacement)) = self.replacement_of_objects(name) {
            let parameters = name.parameters;
            return match replacement.original.with(parameters) {
                original if original.name == name => {
                    self.source(replacement.product.with(parameters).name, original, by, path);
                }
                _ => self.provide_of_objects(index, replacement, parameters, by, path),
            };
        }
        let replacers: Vec<usize> =
            self.replacements.iter().filter(|(_, it)| it.product.name == name).map(|&(i, _)| i).collect();
        match (replacers.as_slice(), self.replacements.iter().find(|(_, it)| it.original.name == name).copied()) {
            (&[index], _) if self.has_source(name) => self.provide(index, name, by, path),
            (&[_, _, ..], _) => self.ambiguous(&replacers, Clash::Replacers, name, by),
            (_, Some((_, replacement))) => self.source(replacement.product.name, replacement.original, by, path),
            _ => self.provided(name, by, path),
        }
    }

    /// The stage that replaces a product of objects by themselves, by the name of the product or of its original.
    fn replacement_of_objects(&self, name: Name) -> Option<(usize, Replacement)> {
        name.parameters.objects?;
        let is_of = |it: &Replacement| [it.product, it.original].iter().any(|key| key.name.base == name.base);
        self.replacements.iter().copied().find(|(_, it)| it.of_objects && is_of(it))
    }

    /// Plans a product of objects by themselves that a stage replaces: it runs on them as on the image, with the same guides.
    fn provide_of_objects(
        &mut self,
        index: usize,
        replacement: Replacement,
        parameters: RenderParameters,
        by: &Asker,
        path: &mut Vec<usize>,
    ) {
        let (stage, reads) = (self.notes[index].stage.clone(), self.notes[index].reads.clone());
        let asker = Asker { stage: &stage, option: None };
        self.want(replacement.product.name, by, path);
        for read in reads {
            self.want(read.with(parameters).name, &asker, path);
        }
        let key = replacement.product.with(parameters);
        self.entries.push(PlanEntry { key, provider: Provider::Stage(stage), wanted_by: vec![by.stage.to_owned()] });
    }

    /// The product of that name that the renderer offers, with the parameters of the name.
    fn offered(&self, name: Name) -> Option<KeyId> {
        self.offers.iter().find_map(|key| key.under(name))
    }

    /// Whether a product is made by somebody who does not replace it.
    fn has_source(&self, name: Name) -> bool {
        self.offered(name).is_some() || !self.sources(name).is_empty()
    }

    /// The candidates that make a product anew.
    fn sources(&self, name: Name) -> Vec<usize> {
        let replaces = |i: usize| self.notes[i].replaces.iter().any(|it| it.product.name == name);
        let provides = |i: usize| self.notes[i].provides.iter().any(|key| key.name == name);
        let all: Vec<usize> = (0..self.notes.len()).filter(|&i| provides(i) && !replaces(i)).collect();
        if all.iter().any(|&i| self.notes[i].explicit) {
            return all;
        }
        // A plugin that is linked changes nothing in recipes that do not mention it: what the renderer offers and what
        // the stock plugins provide stays as it was.
        if self.offered(name).is_some() {
            return Vec::new();
        }
        match all.iter().copied().filter(|&i| self.notes[i].stock).collect::<Vec<_>>() {
            stock if stock.len() == 1 => stock,
            _ => all,
        }
    }

    /// Plans the original of a replaced product, which is kept under another key.
    fn source(&mut self, name: Name, original: KeyId, by: &Asker, path: &mut Vec<usize>) {
        let before = self.entries.len();
        self.provided(name, by, path);
        if let Some(entry) = self.entries[before..].iter_mut().find(|entry| entry.key.name == name) {
            entry.key = original;
        }
    }

    fn provided(&mut self, name: Name, by: &Asker, path: &mut Vec<usize>) {
        let offered = self.offered(name);
        let sources = self.sources(name);
        match (offered, sources.as_slice()) {
            (Some(key), []) => {
                if key.name.parameters.objects.is_some() {
                    // It says where the objects are.
                    self.want(COVERAGE.id().name, &Asker { stage: Slot::Render.name(), option: None }, path);
                }
                self.entries.push(PlanEntry { key, provider: Provider::Renderer, wanted_by: vec![by.stage.into()] });
            }
            (None, &[index]) => self.provide(index, name, by, path),
            (None, []) => self.unknown(&name.to_string(), by),
            (_, several) => self.ambiguous(several, Clash::Providers, name, by),
        }
    }

    fn provide(&mut self, index: usize, name: Name, by: &Asker, path: &mut Vec<usize>) {
        if path.contains(&index) {
            let chain: Vec<String> = path.iter().chain([&index]).map(|&i| self.notes[i].stage.clone()).collect();
            let message = format!("stages need each other's products: {}", chain.join(" → "));
            let help = "take one of them out of the recipe".to_owned();
            return self.fail(Fault::Cycle, by, &name.to_string(), message, help).involve(chain);
        }
        let (stage, reads, scope) =
            (self.notes[index].stage.clone(), self.notes[index].reads.clone(), self.notes[index].scope);
        path.push(index);
        let asker = Asker { stage: &stage, option: None };
        for read in reads {
            self.want(read.name, &asker, path);
            self.check_read(index, &read, scope, &asker);
        }
        path.pop();
        if let Some(&key) = self.notes[index].provides.iter().find(|key| key.name == name)
            && self.entry(name).is_none()
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
        let Some(entry) = self.entries.iter().find(|entry| entry.key.name == read.name).cloned() else { return };
        if entry.key.type_id() != read.type_id() {
            let (theirs, ours) = (entry.key.type_name(), read.type_name());
            let message =
                format!("{} reads `{}` as {ours}, but {} provides {theirs}", by.stage, read.name, entry.provider);
            let help =
                "one of the two plugins defines the product wrongly: keys of one name must have one type".to_owned();
            self.fail(Fault::WrongType, by, &read.name.to_string(), message, help);
        }
        let late = self.notes.iter().any(|note| entry.provider.is(&note.stage) && note.after_views);
        match (scope, entry.key.scope) {
            (Scope::Scene, Scope::View) => self.notes[index].after_views = true,
            (Scope::Scene, Scope::Scene) if late => self.notes[index].after_views = true,
            (Scope::View, Scope::Scene) if late => self.too_early(read, by, "after the views of a scene"),
            (Scope::View | Scope::Scene, Scope::Dataset) => self.too_early(read, by, "when all scenes are done"),
            _ => {}
        }
    }

    fn too_early(&mut self, read: &KeyId, by: &Asker, when: &str) {
        let message = format!("{} reads `{}`, which is known only {when}", by.stage, read.name);
        let help = "let an annotator of the scene or the dataset read it, or a writer".to_owned();
        self.fail(Fault::TooEarly, by, &read.name.to_string(), message, help);
    }

    fn ambiguous(&mut self, candidates: &[usize], clash: Clash, name: Name, by: &Asker) {
        let mut names: Vec<String> = candidates.iter().map(|&i| self.notes[i].stage.clone()).collect();
        let with_renderer = clash == Clash::Providers && self.offered(name).is_some();
        names.extend(with_renderer.then(|| Provider::Renderer.to_string()));
        let what = match clash {
            Clash::Providers => "has several providers",
            Clash::Replacers => "is replaced by several stages",
        };
        let message = format!("product `{name}` {what}: {}", names.join(", "));
        let explicit = candidates.iter().filter(|&&i| self.notes[i].explicit);
        let tables: Vec<String> = explicit.map(|&i| format!("[{}]", self.notes[i].stage)).collect();
        let help = match tables.as_slice() {
            [] => "name the one you want in a [sensor.<id>] or [annotate.<id>] table".to_owned(),
            several if with_renderer => {
                format!("remove {} from the recipe: the renderer makes `{name}`", several.join(" and "))
            }
            [first, second] => format!("remove {first} or {second} from the recipe"),
            several => format!("keep one of {} in the recipe and remove the others", several.join(", ")),
        };
        self.fail(Fault::Ambiguous, by, &name.to_string(), message, help).involve(names);
    }

    fn unknown(&mut self, name: &str, by: &Asker) {
        let mut known: Vec<&str> = self.offers.iter().map(|key| key.name.base).collect();
        known.extend(self.notes.iter().flat_map(|note| &note.provides).map(|key| key.name.base));
        known.extend(self.replacements.iter().map(|(_, it)| it.original.name.base));
        known.sort_unstable();
        known.dedup();
        let message = format!("{} reads product `{name}`, which nothing provides", by.stage);
        let known = known.into_iter().map(str::to_owned).collect();
        let rendered =
            self.offers.iter().any(|key| name.split_once(" (").is_some_and(|(base, _)| key.name.base == base));
        let help = match rendered {
            true => out_of_range(name).unwrap_or_else(|| {
                format!(
                    "a rendered product may have `(canvas 3)`, up to {MAX_CANVAS}, `(subpixels 2)`, up to {MAX_SUBPIXELS}, \
                     `(next view)`, and coverage `(before support)`, joined by commas; or, with one value per pixel, `(objects \
                     alone)` or `(objects in scene)`"
                )
            }),
            false => "`syntable list products` shows all products of the linked plugins".to_owned(),
        };
        self.fail(Fault::Unknown, by, name, message, help);
        if let Some(error) = self.errors.iter_mut().find(|error| error.product == name && error.fault == Fault::Unknown)
        {
            error.known = known;
        }
    }

    /// Reports an error, once.
    fn fail(&mut self, fault: Fault, by: &Asker, product: &str, message: String, help: String) -> &mut PlanError {
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
        let runs = |index: usize| self.entries.iter().any(|entry| entry.provider.is(&self.notes[index].stage));
        let active: Vec<Replacement> = self.replacements.iter().filter(|(i, _)| runs(*i)).map(|(_, it)| *it).collect();
        let rendered = self.entries.iter().filter(|entry| entry.provider == Provider::Renderer);
        let rendered_as = |key: KeyId| {
            let parameters = key.name.parameters;
            let replacement = active.iter().find(|it| it.original.with(parameters) == key);
            replacement.map_or(key, |it| it.product.with(parameters))
        };
        plan.rendered = rendered.map(|entry| rendered_as(entry.key)).collect();
        // Entries are in dependency order, so the first entry of a producer is when it has to run.
        for entry in &self.entries {
            let Some(index) = self.notes.iter().position(|note| entry.provider.is(&note.stage)) else { continue };
            let Some(candidate) = self.candidates[index].take() else { continue };
            let note = &self.notes[index];
            let (reads, provides) = (note.reads.clone(), note.provides.clone());
            let producer = Arc::new(candidate.producer);
            let of_stage = self.entries.iter().filter(|other| other.provider == entry.provider);
            let of_objects =
                of_stage.map(|entry| entry.key.name.parameters).filter(|of| of.objects.is_some()).collect();
            let (stage, replaces) = (candidate.stage.clone(), producer.replaces());
            let planned = PlannedStage { stage, producer, reads, provides, replaces, of_objects };
            plan.implied.extend(candidate.implied.map(|implied| (candidate.stage, implied)));
            match (note.scope, note.after_views) {
                (Scope::View, _) => plan.per_view.push(planned),
                (Scope::Scene, false) => plan.before_views.push(planned),
                (Scope::Scene, true) => plan.after_views.push(planned),
                // A stage runs at the scope of its trait: there is no other.
                _ => plan.per_dataset.push(planned),
            }
        }
        plan.replaced = plan.per_view.iter().flat_map(PlannedStage::replaced).collect();
        // A denoiser that replaces nothing leaves images as they are, as the recipe says.
        let is_missed = |note: &Note, left: &Candidate| {
            !matches!(left.producer, Producer::Denoiser(_)) || !note.replaces.is_empty()
        };
        let idle =
            self.notes.into_iter().zip(&self.candidates).filter(|(note, left)| {
                note.explicit && left.as_ref().is_some_and(|candidate| is_missed(note, candidate))
            });
        plan.idle = idle.map(|(note, _)| Idle { stage: note.stage, provides: note.provides }).collect();
        plan.entries = self.entries;
        Ok(plan)
    }
}

/// The limit that a parameter in the name of a rendered product is beyond.
fn out_of_range(name: &str) -> Option<String> {
    let words = name.split_once(" (")?.1.strip_suffix(')')?.split(", ");
    words.filter_map(|word| word.split_once(' ')).find_map(|(parameter, number)| {
        let number: u32 = number.parse().ok()?;
        match parameter {
            "canvas" if number.is_multiple_of(2) || !(3..=MAX_CANVAS).contains(&number) => {
                Some(format!("`canvas {number}` is out of range: a canvas is an odd number from 3 to {MAX_CANVAS}"))
            }
            "subpixels" if !(2..=MAX_SUBPIXELS).contains(&number) => {
                Some(format!("`subpixels {number}` is out of range: they are 2 to {MAX_SUBPIXELS}"))
            }
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests;
