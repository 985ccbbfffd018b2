//! Plans what a recipe computes, with errors that point into the recipe.

use crate::plan::{Candidate, Offers, Plan, PlanError, PlanFault, Producer, registered, resolve};
use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::{Code, OF_PLUGIN};
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, Span};
use crate::text::suggest::{did_you_mean, listing};
use std::collections::BTreeSet;
use syntable_model::product::KeyId;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::stage::{Input, InputNeed};

/// Name of the caller of the library in messages about the products that it wants.
const CALLER: &str = "the caller";

/// Plans the built stages and takes their producers. If the plan fails, or the recipe has no renderer, it reports all
/// mistakes that can be known and returns no plan. `wanted` products are planned in addition to the products that
/// writers read.
pub(crate) fn plan(
    registry: &Registry,
    built: &mut Built,
    wanted: &[Input],
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Option<Plan> {
    let own = built.stages.iter().find_map(|stage| match &stage.stage {
        Some(Stage::Render(renderer)) => Some(renderer.offers()),
        _ => None,
    });
    let elsewhere = offered_by_others(registry);
    // Without its own renderer, a recipe may name what any renderer offers.
    let offers = own.clone().unwrap_or_else(|| elsewhere.iter().map(|(key, _)| *key).collect());
    let mut writers: Vec<(String, Vec<Input>)> = built
        .stages
        .iter()
        .filter_map(|stage| match &stage.stage {
            Some(Stage::WriteScenes(writer)) => {
                let mut reads = writer.reads();
                reads.retain(|input| input.need != InputNeed::IfStored);
                Some((part(stage), reads))
            }
            _ => None,
        })
        .collect();
    if !wanted.is_empty() {
        writers.push((CALLER.to_owned(), wanted.to_vec()));
    }
    let mut explicit = Vec::new();
    for stage in &mut built.stages {
        match stage.stage.take().map(Producer::of) {
            Some(Ok(producer)) => explicit.push(Candidate { stage: part(stage), producer, implied: None }),
            Some(Err(other)) => stage.stage = Some(other),
            None => {}
        }
    }
    match resolve(Offers::Rendered(offers), explicit, registered(registry), &writers) {
        Ok(plan) => {
            // Writers that could not be built may read products that the others do not read.
            let idle = plan.idle.iter().filter(|_| !built.failed.contains(&Slot::Write));
            diagnostics.extend(idle.filter_map(|idle| {
                let stage = built.stages.iter().find(|stage| part(stage) == idle.stage)?;
                // A section that the recipe leaves out has its default kind, which may be idle.
                if stage.header == NOWHERE {
                    return None;
                }
                let names: Vec<&str> = idle.provides.iter().map(|key| key.product).collect();
                let message = format!("{} is not computed: no writer reads what it provides", idle.stage);
                let help = format!("include {} in a [write.<id>] table", names.join(" or "));
                Some(DiagnosticBuilder::warning(Code::IdleStage, stage.header.clone(), message).help(help))
            }));
            own.map(|_| plan)
        }
        Err(mut errors) => {
            // A product is not unknown if a stage that could not be built would have provided it.
            let lost = of_failed(registry, built);
            errors.retain(|error| error.fault != PlanFault::Unknown || !lost.contains(&error.product));
            diagnostics.extend(errors.iter().map(|error| diagnostic(error, built, &elsewhere)));
            None
        }
    }
}

/// The name of a stage in messages: `render`, `write.png`.
pub(crate) fn part(stage: &BuiltStage) -> String {
    stage.slot.stage_name(&stage.id)
}

/// Products that some kind of a slot provides, for slots with a stage that could not be built.
fn of_failed(registry: &Registry, built: &Built) -> BTreeSet<String> {
    let makers = built.failed.iter().filter(|slot| matches!(slot, Slot::Denoise | Slot::Sensor | Slot::Annotate));
    let mut products = BTreeSet::new();
    for entry in makers.flat_map(|&slot| registry.of_slot(slot)) {
        for text in ["", entry.example] {
            let Ok(Ok(producer)) = entry.construct_str(text).map(|constructed| Producer::of(constructed.stage)) else {
                continue;
            };
            let originals = producer.replaces().into_iter().map(|replacement| replacement.original);
            products.extend(producer.provides().into_iter().chain(originals).map(|key| key.to_string()));
        }
    }
    products
}

/// Products of all registered renderers, with the renderer's kind.
fn offered_by_others(registry: &Registry) -> Vec<(KeyId, &'static str)> {
    let mut offers: Vec<(KeyId, &'static str)> = Vec::new();
    for entry in registry.of_slot(Slot::Render) {
        for text in ["", entry.example] {
            let Ok(Stage::Render(renderer)) = entry.construct_str(text).map(|constructed| constructed.stage) else {
                continue;
            };
            for key in renderer.offers() {
                if !offers.iter().any(|(other, _)| other.product_id() == key.product_id()) {
                    offers.push((key, entry.kind));
                }
            }
        }
    }
    offers
}

fn diagnostic(error: &PlanError, built: &Built, elsewhere: &[(KeyId, &'static str)]) -> DiagnosticBuilder {
    let stage = built.stages.iter().find(|stage| part(stage) == error.stage);
    let said: Option<Span> = stage
        .and_then(|stage| stage.products.iter().find(|(name, _)| *name == error.product).map(|(_, span)| span.clone()));
    let span = said.clone().or_else(|| stage.map(|stage| stage.header.clone())).unwrap_or(NOWHERE);
    let default = || match (&error.option, stage) {
        (Some(option), Some(stage)) => format!("`{}` has it as the default of `{option}`", stage.entry.kind),
        _ => format!("{} reads it", error.stage),
    };
    let code = match error.fault {
        PlanFault::Unknown => {
            let diagnostic =
                DiagnosticBuilder::error(Code::UnknownProduct, span, format!("unknown product `{}`", error.product));
            let known: Vec<&str> = error.known.iter().map(String::as_str).collect();
            let diagnostic = diagnostic.label(match said {
                Some(_) => did_you_mean(&error.product, known.iter().copied()),
                None => default(),
            });
            // The product is known, and its framing is wrong.
            if error.product.split_once(" (").is_some_and(|(base, _)| error.known.iter().any(|known| known == base)) {
                return diagnostic.help(error.help.clone());
            }
            // A product that a caller of the library asks for has no line in the recipe, so no label.
            let near =
                if error.stage == CALLER { did_you_mean(&error.product, known.iter().copied()) } else { String::new() };
            return match elsewhere.iter().find(|(key, _)| key.is(&error.product)) {
                Some((_, kind)) => {
                    diagnostic.label(format!("offered by the renderer `{kind}`, which this recipe does not use"))
                }
                None if !near.is_empty() => diagnostic.help(format!("{near} `syntable list products` lists all")),
                None => diagnostic
                    .help(format!(
                        "provided by linked plugins: {} (syntable list products)",
                        listing(known.into_iter())
                    ))
                    .help(OF_PLUGIN),
            };
        }
        PlanFault::NotStorable => Code::NotStorable,
        PlanFault::Ambiguous | PlanFault::Cycle | PlanFault::WrongType | PlanFault::TooEarly => Code::Plan,
    };
    // If stages of the recipe cannot go together, the mistake is at these stages, not at the stage that asks for the
    // product.
    let mut involved: Vec<Span> = Vec::new();
    for stage in error.involved.iter().filter_map(|name| built.stages.iter().find(|stage| part(stage) == *name)) {
        if stage.header != NOWHERE && !involved.contains(&stage.header) {
            involved.push(stage.header.clone());
        }
    }
    if let [first, others @ ..] = involved.as_slice() {
        let diagnostic = DiagnosticBuilder::error(code, first.clone(), error.message.clone());
        let diagnostic = others.iter().fold(diagnostic, |diagnostic, span| diagnostic.also(span.clone(), ""));
        return diagnostic.help(format!("{} reads it", error.stage)).help(error.help.clone());
    }
    let diagnostic = DiagnosticBuilder::error(code, span, error.message.clone());
    let diagnostic = if said.is_some() || error.option.is_none() { diagnostic } else { diagnostic.label(default()) };
    diagnostic.help(error.help.clone())
}
