//! The resolver: adds providers until every product has one.

use super::error::{PlanError, PlanFault};
use super::planned::{Idle, Plan, PlanEntry, Provider};
use super::producer::{Candidate, PlannedStage, Producer};
use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::product::standard::COVERAGE;
use syntable_model::product::{Framing, FramingError, KeyId, ProductId, Scope, parse_product};
use syntable_model::registry::Slot;
use syntable_model::stage::{Input, Replacement};

/// Products that come from no stage of the plan.
pub enum Offers {
    /// Products of a renderer, which makes them in any framing.
    Rendered(Vec<KeyId>),
    /// Products of a dataset, as they are.
    Stored(Vec<KeyId>),
}

impl Offers {
    fn keys(&self) -> &[KeyId] {
        match self {
            Self::Rendered(keys) | Self::Stored(keys) => keys,
        }
    }

    /// The offered product with an identity.
    fn find(&self, id: ProductId) -> Option<KeyId> {
        match self {
            Self::Rendered(keys) => keys.iter().find_map(|key| key.of(id)),
            Self::Stored(keys) => keys.iter().find(|key| key.product_id() == id).copied(),
        }
    }

    /// The offered product that a text of a recipe means.
    fn parse(&self, text: &str) -> Option<KeyId> {
        match self {
            Self::Rendered(keys) => keys.iter().find_map(|key| key.parse(text)),
            Self::Stored(keys) => keys.iter().find(|key| key.is(text)).copied(),
        }
    }
}

/// Plans what stages want, each by its whole name: the inputs of writers, and products that a caller wants. `offers` come from
/// no stage, `explicit` are the producers of the recipe, and `implied` the [registered](crate::plan::registered) ones.
///
/// # Errors
/// All mistakes at once.
pub fn resolve(
    offers: Offers,
    explicit: Vec<Candidate>,
    implied: Vec<Candidate>,
    wants: &[(String, Vec<Input>)],
) -> Result<Plan, Vec<PlanError>> {
    // A stage of the recipe replaces the defaults of all kinds that provide one of its products.
    let provided = explicit.iter().flat_map(|it| it.producer.provides());
    let taken: BTreeSet<ProductId> = provided.map(|key| key.product_id()).collect();
    let free = |it: &Candidate| !it.producer.provides().iter().any(|key| taken.contains(&key.product_id()));
    let mut candidates = explicit;
    candidates.extend(implied.into_iter().filter(free).collect::<Vec<_>>());
    let mut resolver = Resolver::new(offers, candidates);
    for (stage, inputs) in wants {
        for input in inputs {
            let asker = Asker { stage, option: input.option.as_deref() };
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
    offers: Offers,
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
    /// The products that it replaces, even if it is not in the recipe. It is not a source of these products.
    replaces: Vec<Replacement>,
    scope: Scope,
    after_views: bool,
    explicit: bool,
    /// Whether it belongs to a crate that the program ships with.
    stock: bool,
}

impl Resolver {
    fn new(offers: Offers, candidates: Vec<Candidate>) -> Self {
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
        let provided = self.traits.iter().flat_map(|traits| &traits.provides);
        let exact = provided.chain(originals).find(|key| key.is(text)).map(KeyId::product_id);
        exact.or_else(|| {
            let mut framed = self.replacements.iter().flat_map(|(_, it)| [&it.product, &it.original]);
            let offered = self.offers.parse(text).or_else(|| framed.find_map(|key| key.parse(text)));
            offered.map(|key| key.product_id())
        })
    }

    /// Plans a product that a writer names. Returns its key, if something provides it.
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
        if let Some((index, replacement)) = self.replacement_of_part(id) {
            return match replacement.original.framed(id.framing) {
                original if original.product_id() == id => {
                    self.source(replacement.product.framed(id.framing).product_id(), original, by, path);
                }
                _ => self.provide_of_part(index, replacement, id.framing, by, path),
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

    /// The stage that replaces a product of a part of the scene, given the product or its original.
    fn replacement_of_part(&self, id: ProductId) -> Option<(usize, Replacement)> {
        id.framing.part()?;
        let is_of = |it: &Replacement| [it.product, it.original].iter().any(|key| key.product == id.product);
        self.replacements.iter().copied().find(|(_, it)| it.of_parts && is_of(it))
    }

    /// Plans a product of a part of the scene that a stage replaces. The stage runs on it as on the image, with the same guides.
    fn provide_of_part(
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
        self.offers.find(id)
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
        // A linked plugin changes nothing in recipes that do not mention it: products that the renderer offers or the
        // stock plugins provide keep their source.
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
        if entry.key.type_id() != read.type_id() && !read.is_of_any_type() {
            let (theirs, ours) = (entry.key.type_name(), read.type_name());
            let message = format!("{} reads `{read}` as {ours}, but {} provides {theirs}", by.stage, entry.provider);
            let help =
                "one of the two plugins defines the product wrongly: keys of one name must have one type".to_owned();
            self.fail(PlanFault::WrongType, by, &read.to_string(), message, help);
        }
        let is_late = self.traits.iter().any(|traits| entry.provider.is(&traits.stage) && traits.after_views);
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
        let mut known: Vec<&str> = self.offers.keys().iter().map(|key| key.product).collect();
        known.extend(self.traits.iter().flat_map(|traits| &traits.provides).map(|key| key.product));
        known.extend(self.replacements.iter().map(|(_, it)| it.original.product));
        known.sort_unstable();
        known.dedup();
        let message = format!("{} reads product `{name}`, which nothing provides", by.stage);
        let is_offered = |product: &str| self.offers.keys().iter().any(|key| key.product == product);
        let help = match name.split_once(" (") {
            Some((product, _)) if is_offered(product) => {
                // The words may be a valid framing that this product does not have.
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
            let Some(index) = self.traits.iter().position(|traits| entry.provider.is(&traits.stage)) else { continue };
            let Some(candidate) = self.candidates[index].take() else { continue };
            let traits = &self.traits[index];
            let (reads, provides) = (traits.reads.clone(), traits.provides.clone());
            let producer = Arc::new(candidate.producer);
            let of_stage = self.entries.iter().filter(|other| other.provider == entry.provider);
            let framings = of_stage.map(|entry| entry.key.framing);
            let of_parts = framings.filter(|framing| framing.part().is_some()).collect();
            let (stage, replaces) = (candidate.stage.clone(), producer.replaces());
            let planned = PlannedStage { stage, producer, reads, provides, replaces, of_parts };
            plan.implied.extend(candidate.implied.map(|implied| (candidate.stage, implied)));
            match (traits.scope, traits.after_views) {
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
        let is_missed = |traits: &CandidateTraits, left: &Candidate| {
            !matches!(left.producer, Producer::Denoiser(_)) || !traits.replaces.is_empty()
        };
        let idle = self.traits.into_iter().zip(&self.candidates).filter(|(traits, left)| {
            traits.explicit && left.as_ref().is_some_and(|candidate| is_missed(traits, candidate))
        });
        plan.idle = idle.map(|(traits, _)| Idle { stage: traits.stage, provides: traits.provides }).collect();
        plan.entries = self.entries;
        Ok(plan)
    }
}
