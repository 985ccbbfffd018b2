//! Agreement of the components of a mixture on the products that go into the files of the dataset.

use crate::assemble::BuiltComponent;
use crate::plan::Plan;
use crate::plan::of_tables::part;
use crate::tables::alternatives::MIXTURE;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use syntable_model::product::KeyId;
use syntable_model::registry::Stage;

/// Compares the components of a mixture with its first one.
pub(crate) fn check(components: &[BuiltComponent]) -> Vec<DiagnosticBuilder> {
    let Some((first, others)) = components.split_first() else { return Vec::new() };
    let pairs = others.iter().filter_map(|other| Some([(first, first.plan.as_ref()?), (other, other.plan.as_ref()?)]));
    pairs.flat_map(|pair| inputs(pair).into_iter().chain(annotators(pair))).collect()
}

type Planned<'c, 'r> = (&'c BuiltComponent<'r>, &'c Plan);

/// The inputs of writers, which must be the same products of the same type.
fn inputs([(one, plan), (other, others)]: [Planned; 2]) -> Vec<DiagnosticBuilder> {
    let mut found = Vec::new();
    for stage in &one.built.stages {
        let Some(Stage::WriteScenes(writer)) = &stage.stage else { continue };
        for input in writer.reads() {
            let [key, its] = [plan, others].map(|plan| plan.named(&input.product));
            let is_same = |a: &KeyId, b: &KeyId| a == b && (a.semantic, a.unit) == (b.semantic, b.unit);
            let what = match (&key, &its) {
                (None, None) => continue,
                (Some(a), Some(b)) if is_same(a, b) => continue,
                (Some(_), None) => format!("which `{}` provides and `{}` does not", one.id, other.id),
                (None, Some(_)) => format!("which `{}` provides and `{}` does not", other.id, one.id),
                (Some(_), Some(_)) => {
                    format!("which `{}` and `{}` provide with different types, meanings or units", one.id, other.id)
                }
            };
            let message = format!("{} reads `{}`, {what}", part(stage), input.product);
            let diagnostic = DiagnosticBuilder::error(Code::Plan, stage.header.clone(), message);
            found
                .push(diagnostic.help("give both components the renderer, sensors and annotators that the files need"));
        }
    }
    found
}

/// Annotators of the dataset, which run once for all components.
fn annotators([(one, plan), (other, others)]: [Planned; 2]) -> Vec<DiagnosticBuilder> {
    let names = |plan: &Plan| plan.per_dataset.iter().map(|stage| stage.stage.clone()).collect::<Vec<_>>();
    let mut all = names(plan);
    all.extend(names(others).into_iter().filter(|name| !names(plan).contains(name)));
    let mut found = Vec::new();
    for name in all {
        let of = |component: &BuiltComponent, plan: &Plan| {
            let keys = plan.per_dataset.iter().find(|stage| stage.stage == name).map(|stage| stage.reads.clone());
            (keys, component.options(plan, &name))
        };
        if of(one, plan) == of(other, others) {
            continue;
        }
        let header = other.built.stages.iter().find(|stage| part(stage) == name).map(|stage| stage.header.clone());
        let message = format!("`{}` and `{}` differ in [{name}], which describes the whole dataset", one.id, other.id);
        let diagnostic = DiagnosticBuilder::error(Code::Plan, header.unwrap_or_else(|| other.header.clone()), message);
        found.push(diagnostic.help(format!("give [{MIXTURE}.{}.{name}] the same options in all components", one.id)));
    }
    found
}
