//! Whether the steps of `[[place]]` go together: what a scene has once is set by one step, before those that need it, and
//! some step places objects.

use super::code::Code;
use super::diagnostic::DiagnosticBuilder;
use super::stages::{Built, BuiltStage};
use syntable_model::registry::{Slot, Stage};
use syntable_model::stage::{PartUse, Placer};

/// A part that a scene has once.
struct Part {
    name: &'static str,
    use_of: fn(&dyn Placer) -> PartUse,
    /// Kind of placer that sets it, for messages.
    setter: &'static str,
}

const PARTS: [Part; 2] = [
    Part { name: "tabletop", use_of: |placer| placer.tabletop(), setter: "table" },
    Part { name: "floor", use_of: |placer| placer.floor(), setter: "room" },
];

/// Reports steps that set what another one sets, steps that need what no earlier one sets, and recipes without objects.
pub(crate) fn check(built: &Built) -> Vec<DiagnosticBuilder> {
    let steps: Vec<(&BuiltStage, &dyn Placer)> = built
        .stages
        .iter()
        .filter_map(|stage| match &stage.stage {
            Some(Stage::Place(placer)) => Some((stage, &**placer)),
            _ => None,
        })
        .collect();
    let is_complete = !built.failed.contains(&Slot::Place);
    let diagnostics: Vec<DiagnosticBuilder> =
        PARTS.iter().flat_map(|part| of_part(part, &steps, is_complete)).collect();
    match steps.last() {
        Some((last, _))
            if is_complete && diagnostics.is_empty() && !steps.iter().any(|(_, placer)| placer.places_objects()) =>
        {
            vec![
                DiagnosticBuilder::error(Code::Placers, last.header.clone(), "no step of [[place]] places objects")
                    .label("the last step")
                    .help("a scene needs an annotated object: add a step [[place]] kind = \"drop_box\""),
            ]
        }
        _ => diagnostics,
    }
}

fn of_part(part: &Part, steps: &[(&BuiltStage, &dyn Placer)], is_complete: bool) -> Vec<DiagnosticBuilder> {
    let Part { name, use_of, setter: kind } = part;
    let of_use = |wanted| move |(_, placer): &&(_, &dyn Placer)| use_of(*placer) == wanted;
    let mut setters = steps.iter().filter(of_use(PartUse::Sets)).map(|(stage, _)| *stage);
    let first = setters.next();
    let mut diagnostics: Vec<DiagnosticBuilder> = Vec::new();
    if let Some(first) = first {
        diagnostics.extend(setters.map(|second| {
            let message = format!("steps `{}` and `{}` of [[place]] both set the {name}", first.id, second.id);
            DiagnosticBuilder::error(Code::Placers, second.header.clone(), message)
                .label("sets it again")
                .also(first.header.clone(), "sets it first")
                .help("keep one of them")
        }));
    }
    // What sets the part may be a step that does not say so, or one that could not be read.
    let stated = steps.iter().take_while(|(_, placer)| use_of(*placer) != PartUse::Unstated);
    let mut earlier = stated.take_while(|(_, placer)| use_of(*placer) != PartUse::Sets);
    if let Some((needs, _)) = earlier.find(of_use(PartUse::Needs)).filter(|_| is_complete) {
        let span = needs.header.clone();
        diagnostics.push(match first {
            Some(first) => {
                let message =
                    format!("step `{}` of [[place]] needs the {name} that step `{}` sets after it", needs.id, first.id);
                DiagnosticBuilder::error(Code::Placers, span, message)
                    .also(first.header.clone(), format!("sets the {name}"))
                    .help(format!("move `{}` before `{}`", first.id, needs.id))
            }
            None => {
                let message = format!("step `{}` of [[place]] needs a {name}, and no step sets one", needs.id);
                DiagnosticBuilder::error(Code::Placers, span, message)
                    .help(format!("add a step [[place]] kind = \"{kind}\" before it"))
            }
        });
    }
    diagnostics
}
