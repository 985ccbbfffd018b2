//! Checks that the steps of `[[place]]` go together. One step sets each part that a scene has once, before the steps
//! that need it. Some step places objects, and a step sets every support that a stage names.

use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::suggest::{did_you_mean, listing};
use syntable_model::registry::{Slot, Stage};
use syntable_model::stage::{Part, PartUse, Placer};

/// A step of `[[place]]`.
struct Step<'s, 'l> {
    stage: &'s BuiltStage<'l>,
    /// How it uses the parts of the scene; none if it does not declare them.
    parts: Option<Vec<PartUse>>,
    places_objects: bool,
}

impl Step<'_, '_> {
    fn sets(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().flatten().filter_map(|part| match part {
            PartUse::Sets(part) => Some(part),
            PartUse::Needs(_) => None,
        })
    }

    fn needs(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().flatten().filter_map(|part| match part {
            PartUse::Needs(part) => Some(part),
            PartUse::Sets(_) => None,
        })
    }
}

/// Reports parts that two steps set, steps that need a part that no earlier step sets, names of supports that no step
/// sets, and recipes without objects.
pub(crate) fn check(built: &Built) -> Vec<DiagnosticBuilder> {
    let step = |stage| Step::of(stage);
    let steps: Vec<Step> = built.stages.iter().filter_map(step).collect();
    let mut diagnostics = duplicates(&steps);
    // A step that could not be read may set a part.
    if built.failed.contains(&Slot::Place) {
        return diagnostics;
    }
    diagnostics.extend(unmet_needs(&steps));
    diagnostics.extend(unknown_supports(&steps, &built.stages));
    match steps.last() {
        Some(last) if diagnostics.is_empty() && !steps.iter().any(|step| step.places_objects) => {
            vec![
                DiagnosticBuilder::error(
                    Code::Placers,
                    last.stage.header.clone(),
                    "no step of [[place]] places objects",
                )
                .label("the last step")
                .help("a scene needs an annotated object: add a step [[place]] kind = \"drop_box\""),
            ]
        }
        _ => diagnostics,
    }
}

impl<'s, 'l> Step<'s, 'l> {
    fn of(stage: &'s BuiltStage<'l>) -> Option<Self> {
        let Some(Stage::Place(placer)) = &stage.stage else { return None };
        let placer: &dyn Placer = &**placer;
        Some(Self { stage, parts: placer.parts(), places_objects: placer.places_objects() })
    }
}

/// Parts that two steps set.
fn duplicates(steps: &[Step]) -> Vec<DiagnosticBuilder> {
    let mut diagnostics = Vec::new();
    for (index, second) in steps.iter().enumerate() {
        for part in second.sets() {
            let Some(first) = steps[..index].iter().find(|first| first.sets().any(|other| other == part)) else {
                continue;
            };
            let name = described(part);
            let help = match part {
                Part::Support(_) => "keep one of them, or give one of the supports another name",
                _ => "keep one of them",
            };
            let message =
                format!("steps `{}` and `{}` of [[place]] both set the {name}", first.stage.id, second.stage.id);
            diagnostics.push(
                DiagnosticBuilder::error(Code::Placers, second.stage.header.clone(), message)
                    .label("sets it again")
                    .also(first.stage.header.clone(), "sets it first")
                    .help(help),
            );
        }
    }
    diagnostics
}

/// For each part, the first step that needs it before a step sets it.
fn unmet_needs(steps: &[Step]) -> Vec<DiagnosticBuilder> {
    // A step that does not declare its parts may set the part.
    let stated = steps.iter().position(|step| step.parts.is_none()).map_or(steps, |index| &steps[..index]);
    let mut reported: Vec<&Part> = Vec::new();
    let mut diagnostics = Vec::new();
    for (index, step) in stated.iter().enumerate() {
        for part in step.needs() {
            let is_set = |by: &[Step]| by.iter().any(|step| step.sets().any(|set| meets(set, part)));
            if is_set(&stated[..index]) || reported.contains(&part) {
                continue;
            }
            reported.push(part);
            let later = steps[index..].iter().find(|step| step.sets().any(|set| meets(set, part)));
            diagnostics.push(unmet(step, part, later.map(|step| step.stage), steps));
        }
    }
    diagnostics
}

fn unmet(step: &Step, part: &Part, later: Option<&BuiltStage>, steps: &[Step]) -> DiagnosticBuilder {
    let id = &step.stage.id;
    let named = |name: &String| step.stage.supports.iter().find(|(text, _)| text == name).map(|(_, span)| span);
    let span = match part {
        Part::Support(name) => named(name).unwrap_or(&step.stage.header),
        _ => &step.stage.header,
    };
    let name = described(part);
    if let Some(later) = later {
        let message = format!("step `{id}` of [[place]] needs the {name} that step `{}` sets after it", later.id);
        return DiagnosticBuilder::error(Code::Placers, span.clone(), message)
            .also(later.header.clone(), format!("sets the {name}"))
            .help(format!("move `{}` before `{id}`", later.id));
    }
    let message = match part {
        Part::Support(_) => format!("step `{id}` of [[place]] needs the {name}, and no step sets it"),
        _ => format!("step `{id}` of [[place]] needs a {name}, and no step sets one"),
    };
    let diagnostic = DiagnosticBuilder::error(Code::Placers, span.clone(), message);
    let names = supports(steps);
    match part {
        Part::Support(name) if !names.is_empty() => diagnostic
            .label(did_you_mean(name, names.iter().copied()))
            .help(format!("supports of the scene: {}", listing(names))),
        Part::Floor => diagnostic.help("add a step [[place]] kind = \"room\" before it"),
        _ => diagnostic.help("add a step [[place]] kind = \"table\" before it"),
    }
}

/// Names of supports in other slots than `[[place]]` that no step sets.
fn unknown_supports(steps: &[Step], stages: &[BuiltStage]) -> Vec<DiagnosticBuilder> {
    if steps.iter().any(|step| step.parts.is_none()) {
        return Vec::new();
    }
    let names = supports(steps);
    let stages = stages.iter().filter(|stage| stage.slot != Slot::Place);
    let named = stages.flat_map(|stage| &stage.supports);
    let unknown = named.filter(|(name, _)| !names.contains(&name.as_str()));
    let diagnostic = |(name, span): &(String, crate::text::source::Span)| {
        let message = format!("no step of [[place]] sets a support `{name}`");
        let diagnostic = DiagnosticBuilder::error(Code::Placers, span.clone(), message);
        match names.is_empty() {
            true => diagnostic.help("add a step [[place]] kind = \"table\""),
            false => diagnostic
                .label(did_you_mean(name, names.iter().copied()))
                .help(format!("supports of the scene: {}", listing(names.iter().copied()))),
        }
    };
    unknown.map(diagnostic).collect()
}

/// Names of all supports that steps set.
fn supports<'s>(steps: &'s [Step]) -> Vec<&'s str> {
    let of_step = |step: &'s Step| {
        step.sets().filter_map(|part| match part {
            Part::Support(name) => Some(name.as_str()),
            _ => None,
        })
    };
    steps.iter().flat_map(of_step).collect()
}

/// Whether a part that a step sets is one that another step needs.
fn meets(set: &Part, needed: &Part) -> bool {
    set == needed || matches!((set, needed), (Part::Support(_), Part::MainSupport))
}

/// A part, for messages.
fn described(part: &Part) -> String {
    match part {
        Part::Floor => "floor".to_owned(),
        Part::Support(name) => format!("support `{name}`"),
        _ => "support".to_owned(),
    }
}
