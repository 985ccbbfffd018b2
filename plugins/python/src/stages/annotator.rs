//! Annotators and sensors in Python: functions from products of a view to other products of it.

use crate::sample::Sample;
use crate::stages::call::with_python;
use crate::stages::kind::Kind;
use crate::stages::product::{Declared, named};
use crate::stages::scene::bodies;
use crate::values;
use pyo3::prelude::*;
use std::sync::Arc;
use syntable_model::context::{ImageContext, ViewContext};
use syntable_model::error::Result;
use syntable_model::intern::intern;
use syntable_model::product::{KeyId, Products, Stored};
use syntable_model::random::Stream;
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::Scene;
use syntable_model::stage::{ImageAnnotator, Replacement, Sensor, ViewAnnotator};

/// A function in Python with its options.
#[derive(Clone)]
struct Annotator {
    stage: Arc<str>,
    reads: Vec<KeyId>,
    provides: Vec<KeyId>,
    replaces: Vec<Replacement>,
    /// From the view, the seed of its random numbers, its size, the bodies and the options to the values of all products.
    call: Arc<Py<PyAny>>,
    options: Option<Arc<Py<PyAny>>>,
}

/// Registers an annotator. If it takes the scene, it cannot serve datasets that are read.
#[pyfunction]
pub fn add_annotator(
    kind: Kind,
    call: Py<PyAny>,
    reads: Vec<String>,
    provides: Vec<Declared>,
    takes_scene: bool,
) -> PyResult<()> {
    let annotator = Annotator::new(kind.stage(Slot::Annotate), call, &reads, &provides)?;
    kind.add(Slot::Annotate, move |options| {
        let annotator = annotator.with(options);
        if takes_scene { Stage::AnnotateView(annotator) } else { Stage::AnnotateImage(annotator) }
    })
}

/// Registers a sensor. `replaces` are pairs: a product that it provides instead of other stages, and the name under which it reads
/// theirs.
#[pyfunction]
pub fn add_sensor(
    kind: Kind,
    call: Py<PyAny>,
    reads: Vec<String>,
    provides: Vec<Declared>,
    replaces: Vec<(String, String)>,
) -> PyResult<()> {
    let mut sensor = Annotator::new(kind.stage(Slot::Sensor), call, &reads, &provides)?;
    for (product, name) in replaces {
        let product = named(&[product])?[0];
        let mut original = product;
        original.product = intern(&name);
        sensor.reads.push(original);
        sensor.replaces.push(Replacement { product, original, of_parts: false });
    }
    kind.add(Slot::Sensor, move |options| Stage::Sensor(sensor.with(options)))
}

impl Annotator {
    fn new(stage: String, call: Py<PyAny>, reads: &[String], provides: &[Declared]) -> PyResult<Self> {
        Ok(Self {
            stage: stage.into(),
            reads: named(reads)?,
            provides: provides.iter().map(Declared::key).collect::<PyResult<_>>()?,
            replaces: Vec::new(),
            call: Arc::new(call),
            options: None,
        })
    }

    fn with(&self, options: Arc<Py<PyAny>>) -> Box<Self> {
        Box::new(Self { options: Some(options), ..self.clone() })
    }

    /// Seed of the random numbers for a view.
    fn seed(&self, cx: &ImageContext) -> u64 {
        let stream = Stream::root(cx.dataset.seed).child(&cx.dataset.name).child(&self.stage);
        stream.at(cx.scene_id.0.into()).at(cx.view_id.0.into()).seed()
    }

    fn provide(&self, cx: &ImageContext, scene: Option<&Scene>, seed: u64, products: &mut Products) -> Result<()> {
        cx.workers.check_stop();
        let lent = products.only(&self.reads);
        let made = with_python(|py| {
            let view = Sample::lent(cx.scene_id, cx.view_id, lent);
            let bodies = scene.map(|scene| bodies(py, scene.bodies())).transpose()?;
            let [width, height] = cx.size;
            let options = self.options.as_ref().map(|options| options.bind(py));
            let values = self.call.call1(py, (view, seed, (height, width), bodies, options))?;
            let values = values.extract::<Vec<Bound<'_, PyAny>>>(py)?;
            values.iter().map(values::of_python).collect::<PyResult<Vec<_>>>()
        })?;
        for (key, value) in self.provides.iter().zip(&made) {
            products.put_stored(*key, Stored { value, ids: &[], missing: f64::NAN })?;
        }
        Ok(())
    }
}

impl ImageAnnotator for Annotator {
    fn reads(&self) -> Vec<KeyId> {
        self.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.provides.clone()
    }

    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()> {
        self.provide(cx, None, self.seed(cx), products)
    }
}

impl ViewAnnotator for Annotator {
    fn reads(&self) -> Vec<KeyId> {
        self.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.provides.clone()
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        self.provide(cx, Some(cx.scene), self.seed(cx), products)
    }
}

impl Sensor for Annotator {
    fn reads(&self) -> Vec<KeyId> {
        self.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.provides.clone()
    }

    fn replaces(&self) -> Vec<Replacement> {
        self.replaces.clone()
    }

    fn sense(&self, cx: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()> {
        self.provide(cx, None, stream.seed(), products)
    }
}
