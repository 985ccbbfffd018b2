//! Products of datasets that were read: those that a dataset has, and those that annotators derive from them.

use super::scene::annotate;
use super::times::Times;
use crate::plan::{self, Candidate, Fault, Implied, Plan, Producer};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use syntable_model::context::{DatasetContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products};
use syntable_model::reader::DatasetReader;
use syntable_model::registry::Registry;
use syntable_model::scene::{Scene, SceneId, View};
use syntable_model::stage::{Annotator, Input, ProductGroup};

/// How products that somebody reads come from what a dataset has.
pub struct Derived {
    pub(super) plan: Plan,
    /// Products that their readers can do without, and that neither are there nor follow from what is; sorted.
    pub lacking: BTreeSet<String>,
}

impl Derived {
    /// Plans what readers want, each by its name. An error says which product cannot be had.
    pub fn resolve(
        registry: &Registry,
        dataset: &dyn DatasetReader,
        readers: impl IntoIterator<Item = (String, Vec<Input>)>,
    ) -> Result<Self> {
        let offers = dataset.offers();
        let parts: Vec<(String, Part)> =
            plan::registered(registry).into_iter().flat_map(|candidate| parts_of(candidate, &offers)).collect();
        let has = can_be_had(&offers, &parts);
        let (mut wants, mut lacking) = (Vec::new(), BTreeSet::new());
        for (id, reads) in readers {
            let (without, reads): (Vec<Input>, Vec<Input>) =
                reads.into_iter().partition(|input| input.is_optional && !has.contains(&input.product));
            lacking.extend(without.into_iter().map(|input| input.product));
            wants.push((id, reads));
        }
        let candidate = |(stage, part): (String, Part)| {
            let implied = part.implied.clone();
            Candidate { stage, producer: Producer::View(Box::new(part)), implied }
        };
        let implied = parts.into_iter().map(candidate).collect();
        let plan = plan::resolve(offers.clone(), Vec::new(), implied, &wants).map_err(|errors| {
            let of = |error: &plan::PlanError| match error.fault {
                Fault::Unknown => format!("{} reads `{}`, which the dataset does not have", error.stage, error.product),
                _ => error.message.clone(),
            };
            let messages: Vec<String> = errors.iter().map(of).collect();
            let has: Vec<String> = offers.iter().map(|key| format!("`{}`", key.name)).collect();
            Error::new(messages.join("; ")).help(format!("the dataset has {}", has.join(", "))).of_request()
        })?;
        Ok(Self { plan, lacking })
    }

    /// Names of the products that are read or derived.
    pub fn products(&self) -> BTreeSet<String> {
        self.plan.entries.iter().map(|entry| entry.key.name.to_string()).collect()
    }

    /// The products of an image.
    pub fn read(&self, cx: &DatasetContext, dataset: &dyn DatasetReader, image: usize) -> Result<(View, Products)> {
        let scene = Scene::unknown(SceneId(dataset.images()[image].scene.0));
        let (view, mut products) = dataset.read(image, &self.plan.rendered)?;
        annotate(&Times::default(), &self.plan, &cx.scene(&scene).view(&view), &BTreeMap::new(), &mut products)?;
        Ok((view, products))
    }
}

/// A group of products that an annotator provides.
struct Part {
    annotator: Arc<dyn Annotator>,
    implied: Option<Implied>,
    group: ProductGroup,
}

impl Annotator for Part {
    fn reads(&self) -> Vec<KeyId> {
        self.group.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.group.provides.clone()
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        // To the annotator, the rest of what it reads is not there.
        let lent = products.only(&self.annotator.reads().iter().map(|key| key.name).collect::<Vec<_>>());
        let mut filled = lent.clone();
        self.annotator.annotate(cx, &mut filled)?;
        products.extend(filled.without(&lent))
    }
}

/// The groups of an annotator that needs nothing but products, but for those that a dataset has itself.
fn parts_of(candidate: Candidate, offers: &[KeyId]) -> Vec<(String, Part)> {
    let Producer::View(annotator) = candidate.producer else { return Vec::new() };
    if !annotator.is_of_products() {
        return Vec::new();
    }
    let annotator: Arc<dyn Annotator> = annotator.into();
    let groups = annotator.groups();
    let is_whole = groups.len() == 1;
    let is_new = |group: &ProductGroup| !group.provides.iter().any(|key| offers.iter().any(|it| it.name == key.name));
    let part = |group: ProductGroup| {
        let names: Vec<String> = group.provides.iter().map(|key| key.name.to_string()).collect();
        let stage = &candidate.stage;
        let stage = if is_whole { stage.clone() } else { format!("{stage} ({})", names.join(", ")) };
        (stage, Part { annotator: Arc::clone(&annotator), implied: candidate.implied.clone(), group })
    };
    groups.into_iter().filter(is_new).map(part).collect()
}

/// Names of the products that a dataset has, or that follow from them.
fn can_be_had(offers: &[KeyId], parts: &[(String, Part)]) -> BTreeSet<String> {
    let name = |key: &KeyId| key.name.to_string();
    let mut has: BTreeSet<String> = offers.iter().map(name).collect();
    loop {
        let groups = parts.iter().map(|(_, part)| &part.group);
        let made = groups.filter(|group| group.reads.iter().all(|key| has.contains(&name(key))));
        let new: Vec<String> =
            made.flat_map(|group| &group.provides).map(name).filter(|it| !has.contains(it)).collect();
        if new.is_empty() {
            return has;
        }
        has.extend(new);
    }
}
