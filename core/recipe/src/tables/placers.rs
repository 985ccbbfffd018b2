//! Checks that the steps of `[[place]]` go together. One step sets each part that a scene has once, before the steps
//! that need it. Some step places objects, and a step sets every support that a stage names. No step varies the sizes of objects
//! for a writer that takes them from the assets.

use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::suggest::{did_you_mean, listing};
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::is_in_group;
use syntable_model::stage::{Part, PartUse, Placer};

/// A step of `[[place]]`.
struct Step<'s, 'l> {
    stage: &'s BuiltStage<'l>,
    /// Whether it declares how it uses the parts of the scene.
    is_declared: bool,
    /// The parts that it sets in every scene.
    sets: Vec<Part>,
    /// The parts that only some of its alternatives set.
    may_set: Vec<Part>,
    needs: Vec<Part>,
    places_objects: bool,
    resizes_objects: bool,
}

impl Step<'_, '_> {
    /// The parts that it sets, in every scene or in some.
    fn sets_at_all(&self) -> impl Iterator<Item = &Part> {
        self.sets.iter().chain(&self.may_set)
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
    diagnostics.extend(unmet_by_stages(&steps, &built.stages));
    diagnostics.extend(unknown_supports(&steps, &built.stages));
    diagnostics.extend(lost_sizes(&steps, &built.stages));
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
        let placer = |stage: &'s BuiltStage<'l>| match &stage.stage {
            Some(Stage::Place(placer)) => Some(&**placer),
            _ => None,
        };
        let placers: Vec<&dyn Placer> = stage.all().filter_map(placer).collect();
        if placers.is_empty() {
            return None;
        }
        let declared: Vec<Option<Vec<PartUse>>> = placers.iter().map(|placer| placer.parts()).collect();
        let set_by = |uses: &Option<Vec<PartUse>>| -> Vec<Part> {
            let part = |part: &PartUse| match part {
                PartUse::Sets(part) => Some(part.clone()),
                PartUse::Needs(_) => None,
            };
            uses.iter().flatten().filter_map(part).collect()
        };
        let mut all: Vec<Part> = Vec::new();
        declared.iter().flat_map(set_by).for_each(|part| {
            if !all.contains(&part) {
                all.push(part);
            }
        });
        let (mut sets, may_set): (Vec<Part>, Vec<Part>) =
            all.into_iter().partition(|part| declared.iter().all(|uses| set_by(uses).contains(part)));
        let is_support = |part: &Part| matches!(part, Part::Support(_));
        if !sets.iter().any(is_support) && declared.iter().all(|uses| set_by(uses).iter().any(is_support)) {
            // Each alternative sets a support, of a name of its own.
            sets.push(Part::MainSupport);
        }
        let need = |part: &PartUse| match part {
            PartUse::Needs(part) => Some(part.clone()),
            PartUse::Sets(_) => None,
        };
        Some(Self {
            stage,
            is_declared: declared.iter().all(Option::is_some),
            sets,
            may_set,
            needs: declared.iter().flatten().flatten().filter_map(need).collect(),
            places_objects: placers.iter().any(|placer| placer.places_objects()),
            resizes_objects: placers.iter().any(|placer| placer.resizes_objects()),
        })
    }
}

/// Writers that take the sizes of objects from their assets, if steps vary the sizes.
fn lost_sizes(steps: &[Step], stages: &[BuiltStage]) -> Vec<DiagnosticBuilder> {
    let steps: Vec<&BuiltStage> = steps.iter().filter(|step| step.resizes_objects).map(|step| step.stage).collect();
    let names: Vec<String> = steps.iter().map(|step| format!("`{}`", step.id)).collect();
    let (who, them) = match names.as_slice() {
        [] => return Vec::new(),
        [only] => (format!("step {only} of [[place]] varies"), "the step"),
        _ => (format!("steps {} of [[place]] vary", names.join(" and ")), "the steps"),
    };
    let is_refused = |stage: &&BuiltStage| match &stage.stage {
        Some(Stage::WriteScenes(writer)) => writer.needs_sizes_of_assets(),
        _ => false,
    };
    let refusal = |stage: &BuiltStage| {
        let message = format!(
            "`write.{}` describes each object by its asset and a pose, without a size, and {who} the sizes of objects",
            stage.id
        );
        let refusal = DiagnosticBuilder::error(Code::NotStorable, stage.header.clone(), message)
            .label("has no place for a size")
            .help(format!("remove `scale` from {them}, or write the dataset in another format"));
        steps.iter().fold(refusal, |refusal, step| refusal.also(step.header.clone(), "sets `scale`"))
    };
    stages.iter().filter(is_refused).map(refusal).collect()
}

/// Parts that two steps set.
fn duplicates(steps: &[Step]) -> Vec<DiagnosticBuilder> {
    let mut diagnostics = Vec::new();
    for (index, second) in steps.iter().enumerate() {
        for part in second.sets_at_all().filter(|part| **part != Part::MainSupport) {
            let Some(first) = steps[..index].iter().find(|first| first.sets_at_all().any(|other| other == part)) else {
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
    let stated = steps.iter().position(|step| !step.is_declared).map_or(steps, |index| &steps[..index]);
    let mut reported: Vec<&Part> = Vec::new();
    let mut diagnostics = Vec::new();
    for (index, step) in stated.iter().enumerate() {
        for part in &step.needs {
            let is_set = |by: &[Step]| by.iter().any(|step| step.sets.iter().any(|set| meets(set, part)));
            if is_set(&stated[..index]) || reported.contains(&part) {
                continue;
            }
            reported.push(part);
            let later = steps[index..].iter().find(|step| step.sets_at_all().any(|set| meets(set, part)));
            let partly = stated[..index].iter().find(|step| step.may_set.iter().any(|set| meets(set, part)));
            if let Some(partly) = partly {
                diagnostics.push(only_sometimes(step, part, partly));
                continue;
            }
            diagnostics.push(unmet(step, part, later.map(|step| step.stage), steps));
        }
    }
    diagnostics
}

/// The diagnostic for a part that only some alternatives of an earlier step set.
fn only_sometimes(step: &Step, part: &Part, partly: &Step) -> DiagnosticBuilder {
    let (id, name, other) = (&step.stage.id, described(part), &partly.stage.id);
    let message = format!("step `{id}` of [[place]] needs the {name}, which only some alternatives of `{other}` set");
    DiagnosticBuilder::error(Code::Placers, step.stage.header.clone(), message)
        .also(partly.stage.header.clone(), "sets it in some scenes")
        .help("let all alternatives set it: give their supports the same name")
}

fn unmet(step: &Step, part: &Part, later: Option<&BuiltStage>, steps: &[Step]) -> DiagnosticBuilder {
    let id = &step.stage.id;
    let named = |name: &String| step.stage.supports.iter().find(|(text, _)| text == name).map(|(_, span)| span);
    let span = match part {
        Part::Support(name) => named(name).unwrap_or(&step.stage.header),
        _ => &step.stage.header,
    };
    let name = described(part);
    if later.is_some_and(|later| later.id == *id) {
        let message = format!("step `{id}` of [[place]] needs the {name}, which it sets itself");
        return DiagnosticBuilder::error(Code::Placers, span.clone(), message)
            .help("name a support of an earlier step");
    }
    if let Some(later) = later {
        let message = format!("step `{id}` of [[place]] needs the {name} that step `{}` sets after it", later.id);
        return DiagnosticBuilder::error(Code::Placers, span.clone(), message)
            .also(later.header.clone(), format!("sets the {name}"))
            .help(format!("move `{}` before `{id}`", later.id));
    }
    let message = match part {
        Part::Support(_) => format!("step `{id}` of [[place]] needs the {name}, and no step sets it"),
        Part::Walls | Part::RecordedCameras => {
            format!("step `{id}` of [[place]] needs the {name}, and no step sets them")
        }
        _ => format!("step `{id}` of [[place]] needs a {name}, and no step sets one"),
    };
    let diagnostic = DiagnosticBuilder::error(Code::Placers, span.clone(), message);
    let names = supports(steps);
    match part {
        Part::Support(name) if !names.is_empty() => diagnostic
            .label(did_you_mean(name, names.iter().copied()))
            .help(format!("supports of the scene: {}", listing(names))),
        Part::Floor => diagnostic.help("add a step [[place]] kind = \"room\" before it"),
        Part::Walls => diagnostic.help("add a step [[place]] kind = \"room\" with walls before it"),
        _ => diagnostic.help("add a step [[place]] kind = \"table\" before it"),
    }
}

/// For each part that no step sets in every scene, the first view, camera, light or sensor that needs it.
fn unmet_by_stages(steps: &[Step], stages: &[BuiltStage]) -> Vec<DiagnosticBuilder> {
    if steps.iter().any(|step| !step.is_declared) {
        return Vec::new();
    }
    let needs = |stage: &Stage| match stage {
        Stage::Views(views) => views.needs(),
        Stage::Camera(camera) => camera.needs(),
        Stage::Lights(lights) => lights.needs(),
        Stage::Sensor(sensor) => sensor.needs(),
        _ => None,
    };
    let mut reported: Vec<Part> = Vec::new();
    let unmet = |stage: &BuiltStage| {
        let part = stage.all().filter_map(|built| needs(built.stage.as_ref()?)).find(|part| {
            let sets = |step: &Step| step.sets.iter().any(|set| meets(set, part));
            // A step that needs the part, too, has been reported.
            !steps.iter().any(|step| sets(step) || step.needs.contains(part)) && !reported.contains(part)
        })?;
        reported.push(part.clone());
        let (stage_name, name) = (stage.slot.stage_name(&stage.id), described(&part));
        let message = match part {
            Part::MainSupport => {
                format!("`{stage_name}` needs a {name}, and no step of [[place]] sets one in every scene")
            }
            _ => format!("`{stage_name}` needs the {name}, and no step of [[place]] sets them in every scene"),
        };
        let help = match part {
            Part::MainSupport => "add a step [[place]] kind = \"table\", or give a `room` a `support`",
            Part::Walls => "add a step [[place]] kind = \"room\" with walls, or choose another kind of light",
            Part::RecordedCameras => "add a step [[place]] kind = \"recorded\", or choose another kind or option",
            _ => "add a step that sets it",
        };
        Some(DiagnosticBuilder::error(Code::Placers, stage.header.clone(), message).help(help))
    };
    stages.iter().filter_map(unmet).collect()
}

/// Names of supports in other slots than `[[place]]` that no step sets.
fn unknown_supports(steps: &[Step], stages: &[BuiltStage]) -> Vec<DiagnosticBuilder> {
    if steps.iter().any(|step| !step.is_declared) {
        return Vec::new();
    }
    let names = supports(steps);
    let stages = stages.iter().filter(|stage| stage.slot != Slot::Place);
    let named = stages.flat_map(|stage| &stage.supports);
    let unknown = named.filter(|(name, _)| !names.iter().any(|set| may_name(name, set)));
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
        step.sets_at_all().filter_map(|part| match part {
            Part::Support(name) => Some(name.as_str()),
            _ => None,
        })
    };
    let mut names: Vec<&str> = Vec::new();
    for name in steps.iter().flat_map(of_step) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Whether a part that a step sets is one that another step needs.
fn meets(set: &Part, needed: &Part) -> bool {
    match (set, needed) {
        (Part::Support(_), Part::MainSupport) => true,
        (Part::Support(set), Part::Support(needed)) => may_name(needed, set),
        _ => set == needed,
    }
}

/// Whether a name in a recipe can mean supports that a step sets: one of them, or a group of them.
fn may_name(name: &str, set: &str) -> bool {
    is_in_group(set, name) || is_in_group(name, set)
}

/// A part, for messages.
fn described(part: &Part) -> String {
    match part {
        Part::Floor => "floor".to_owned(),
        Part::Walls => "walls of a room".to_owned(),
        Part::RecordedCameras => "cameras of a recorded scene".to_owned(),
        Part::Support(name) => format!("support `{name}`"),
        _ => "support".to_owned(),
    }
}
