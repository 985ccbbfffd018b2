//! Runs the stages of a plan. Each stage gets the products that it reads, and must make all products that it declares.

use crate::run::making::attempt::{keep, provided};
use crate::run::making::losses::{Losses, StageLog};
use crate::run::making::times::Times;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::context::{FrameContext, ImageContext, SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::{Framing, KeyId, Products};
use syntable_model::random::Stream;
use syntable_model::stage::ViewProducts;
use syntable_recipe::plan::{Plan, PlannedStage, Producer};

/// Runs all producers of a view. Adds the data that they omit to `losses`.
pub fn annotate(
    times: &Times,
    losses: &Losses,
    plan: &Plan,
    cx: &ViewContext,
    sensing: &BTreeMap<String, Stream>,
    products: &mut Products,
) -> Result<()> {
    for stage in &plan.per_view {
        let log = StageLog { log: cx.log, losses, stage: &stage.stage };
        let cx = &cx.with_log(&log);
        let run = |lent: &mut Products| match &*stage.producer {
            Producer::Denoiser(denoiser) => denoiser.denoise(cx, lent),
            Producer::Sensor(sensor) => sensor.sense(cx, &sensing[&stage.stage], lent),
            Producer::Image(annotator) => annotator.annotate(cx, lent),
            Producer::View(annotator) => annotator.annotate(cx, lent),
            Producer::Frame(_) | Producer::Scene(_) | Producer::Dataset(_) => {
                unreachable!("the plan sorts producers by scope")
            }
        };
        let made = lend(times, stage, products, run)?;
        keep(plan, made, products)?;
        stage.of_parts.iter().try_for_each(|&of| run_of_part(times, stage, run, of, products))?;
    }
    Ok(())
}

/// Runs a stage that replaces products on the image of a part of the scene.
fn run_of_part(
    times: &Times,
    stage: &PlannedStage,
    run: impl FnOnce(&mut Products) -> Result<()>,
    framing: Framing,
    products: &mut Products,
) -> Result<()> {
    let own = |key: &KeyId| key.framed(framing);
    let mut of_image = products.only(&stage.reads.iter().map(own).collect::<Vec<_>>());
    for key in &stage.reads {
        of_image.rename(own(key), *key)?;
    }
    let replaced: Vec<KeyId> = stage.replaces.iter().filter(|it| it.of_parts).map(|it| it.product).collect();
    let mut made = lend(times, stage, &of_image, run)?.only(&replaced);
    replaced.iter().try_for_each(|key| made.rename(*key, own(key)))?;
    products.extend(made)
}

/// Runs all producers for an image from a dataset: annotators that need only products.
pub fn annotate_image(
    times: &Times,
    losses: &Losses,
    plan: &Plan,
    cx: &ImageContext,
    products: &mut Products,
) -> Result<()> {
    for stage in &plan.per_view {
        let Producer::Image(annotator) = &*stage.producer else {
            unreachable!("the plan of a conversion has no other producers")
        };
        let log = StageLog { log: cx.log, losses, stage: &stage.stage };
        let made = lend(times, stage, products, |lent| annotator.annotate(&cx.with_log(&log), lent))?;
        keep(plan, made, products)?;
    }
    Ok(())
}

/// Applies all checks to a view.
pub fn check(checks: &[Arc<dyn LabelCheck>], products: &Products) -> Result<()> {
    let of = |check: &Arc<dyn LabelCheck>| -> Result<Option<String>> {
        let faults: Vec<String> = check.run(products)?.iter().map(ToString::to_string).collect();
        Ok((!faults.is_empty()).then(|| format!("{}: {}", check.name(), faults.join("; "))))
    };
    let faults: Vec<String> = checks.iter().filter_map(|check| of(check).transpose()).collect::<Result<_>>()?;
    if faults.is_empty() { Ok(()) } else { Err(Error::contradiction(faults.join("\n"))) }
}

/// Runs an annotator of the scene.
pub fn run_in_scene(
    times: &Times,
    losses: &Losses,
    stage: &PlannedStage,
    cx: &SceneContext,
    views: &[ViewProducts],
    products: &mut Products,
) -> Result<()> {
    let Producer::Scene(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
    let log = StageLog { log: cx.log, losses, stage: &stage.stage };
    let made = lend(times, stage, products, |lent| annotator.annotate(&cx.with_log(&log), views, lent))?;
    products.extend(made)
}

/// Runs an annotator of one moment of a scene.
pub fn run_in_frame(
    times: &Times,
    losses: &Losses,
    stage: &PlannedStage,
    cx: &FrameContext,
    products: &mut Products,
) -> Result<()> {
    let Producer::Frame(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
    let log = StageLog { log: cx.log, losses, stage: &stage.stage };
    let made = lend(times, stage, products, |lent| annotator.annotate(&cx.with_log(&log), lent))?;
    products.extend(made)
}

/// Gives a producer the products that it reads, and returns the products that it made.
///
/// # Errors
/// If the producer fails, or makes other products than it declares.
pub fn lend(
    times: &Times,
    stage: &PlannedStage,
    products: &Products,
    make: impl FnOnce(&mut Products) -> Result<()>,
) -> Result<Products> {
    let lent = products.only(&stage.reads);
    let mut filled = lent.clone();
    times.of(&stage.stage, || make(&mut filled))?;
    let made = filled.without(&lent);
    provided(&stage.provides, &made).map_err(|error| error.context(&stage.stage))?;
    Ok(made)
}
