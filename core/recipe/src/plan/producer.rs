//! Stages that make products from products.

use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::product::{Framing, KeyId, Scope};
use syntable_model::registry::{Entry, Registry, Slot, Stage};
use syntable_model::stage::{
    DatasetAnnotator, Denoiser, FrameAnnotator, ImageAnnotator, Replacement, SceneAnnotator, Sensor, ViewAnnotator,
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
    /// Framings of parts of the scene. The stage runs once more for each.
    pub of_parts: BTreeSet<Framing>,
}

impl PlannedStage {
    /// Pairs of keys: a product that the stage replaces, and the key under which the original is kept.
    pub(super) fn replaced(&self) -> impl Iterator<Item = [KeyId; 2]> {
        self.replaces.iter().flat_map(|it| {
            let of_parts = self.of_parts.iter().filter(|_| it.of_parts);
            let framings = std::iter::once(it.product.framing).chain(of_parts.copied());
            framings.map(|framing| [it.product, it.original].map(|key| key.framed(framing)))
        })
    }
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
