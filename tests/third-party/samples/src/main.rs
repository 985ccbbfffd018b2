//! SynTable as a library: samples in memory from an annotator with state, scores of predictions with a custom metric,
//! and a report.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use syntable::evaluation::Convention;
use syntable::evaluation::image::ImagePair;
use syntable::evaluation::measure::{Measure, Measurement, MetricKind};
use syntable::model::prelude::*;
use syntable::model::product::standard::VISIBLE_MASK;
use syntable::model::registry::Entry;
use syntable::report::make::{ReportOptions, make};
use syntable::{DatasetSource, DiskCache, EvaluateOptions, GenerateOptions, Pool, Quiet, RecipeRequest, Registry};
use syntable::{ImageWork, RunOptions, Stop, evaluate, generate, run, workers};

const AREA: Key<Value> = Key::view("total_area", "Pixels of all objects together.");

/// Sums areas, and counts the views for the program that created it.
struct TotalArea(Arc<AtomicU32>);

impl ImageAnnotator for TotalArea {
    fn reads(&self) -> Vec<KeyId> {
        vec![VISIBLE_MASK.id()]
    }
    fn provides(&self) -> Vec<KeyId> {
        vec![AREA.id()]
    }
    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let area: u32 = products.get(VISIBLE_MASK)?.iter().map(|(_, mask)| mask.area()).sum();
        products.put(AREA, Value::from(area))
    }
}

/// Share of labeled objects with fewer visible pixels than a given number.
#[derive(Clone, Copy)]
struct SmallObjects(u32);

impl MetricKind for SmallObjects {
    fn name(&self) -> &str {
        "small_objects"
    }
    fn doc(&self) -> &str {
        "Share of labeled objects that are small."
    }
    fn build(&self, _: Convention) -> Measurement {
        Measurement::of(*self)
    }
    fn owner(&self) -> &str {
        "samples"
    }
}

impl Measure for SmallObjects {
    type Tally = [usize; 2];
    fn names(&self) -> Vec<String> {
        vec!["small_objects".into()]
    }
    fn tally(&self, pair: &ImagePair) -> [usize; 2] {
        let small = pair.labels.iter().filter(|label| label.visible.area() < self.0);
        [small.count(), pair.labels.len()]
    }
    fn values(&self, images: &[&[usize; 2]]) -> Vec<Option<f64>> {
        let [small, all] = [0, 1].map(|of| images.iter().map(|tally| tally[of]).sum::<usize>());
        vec![(all > 0).then(|| small as f64 / all as f64)]
    }
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let out = PathBuf::from(std::env::args().nth(1).ok_or("name a folder for the dataset")?);
    let views = Arc::<AtomicU32>::default();
    let counted = Arc::clone(&views);
    let entry = Entry::plain("total_area", "samples", move || -> Box<dyn ImageAnnotator> {
        Box::new(TotalArea(Arc::clone(&counted)))
    });
    let registry = Registry::linked()?.with(entry)?;
    let request =
        RecipeRequest::new("builtin:quickstart").set("dataset.scenes", "1").set("camera.resolution", "[96, 72]");
    let recipe = request.load(&registry, &["total_area"], &Quiet)?;
    let options = GenerateOptions { products: vec!["total_area".into()], ..GenerateOptions::default() };
    generate(&recipe, &options, &Quiet, &mut |sample| {
        println!("view {}: {:?}", sample.view.id.0, sample.products.get(AREA)?);
        Ok(())
    })?;
    println!("views annotated: {}", views.load(Ordering::Relaxed));
    run(&recipe, &RunOptions::new(out.join("data"), workers::available(), DiskCache::of_user()), &Quiet)?;
    let (pool, stop) = (Pool::new(workers::available())?, Stop::default());
    let work = ImageWork { workers: &pool, reporter: &Quiet, stop: &stop };
    let data = || DatasetSource::new(out.join("data"));
    let more_metrics: Vec<Arc<dyn MetricKind>> = vec![Arc::new(SmallObjects(u32::MAX))];
    let options = EvaluateOptions { more_metrics, ..EvaluateOptions::new(data(), data()) };
    let scores = evaluate(&registry, &options, &work)?;
    println!("small objects: {:?}", scores.score("small_objects"));
    println!("amodal F: {:?}", scores.score("amodal_overlap_f"));
    println!("report: {}", make(&registry, &ReportOptions::new(data()), &work)?.index.display());
    Ok(())
}
