//! Alternatives of a stage: tables under `one_of`, each with the kind and the options of a stage of the slot, and a weight.

use crate::tables::alternatives::{MAX_WEIGHT, ONE_OF, WEIGHT};
use crate::tables::check;
use crate::tables::loader::Loader;
use crate::tables::references::PoolNames;
use crate::tables::slot_tables::StageTable;
use crate::tables::stages::{Built, BuiltStage};
use crate::text::code::Code;
use crate::text::diagnostic::{DiagnosticBuilder, Severity};
use crate::text::source::Span;
use serde::Deserialize;
use std::collections::BTreeSet;
use syntable_model::registry::{RecipeValue, Stage};
use toml::de::{DeArray, DeValue, ValueDeserializer};

impl<'r> Loader<'_, 'r> {
    /// Builds the alternatives of a stage, and makes them one stage; false if any could not be built.
    pub fn one_of(
        &self,
        given: StageTable,
        value: RecipeValue,
        built: &mut Built<'r>,
        names: &mut PoolNames,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> bool {
        let before = diagnostics.len();
        let error = |code, span: Span, message: String| DiagnosticBuilder::error(code, span, message);
        diagnostics.extend(given.bad_id());
        if given.is_alternative {
            let message = "an alternative cannot have alternatives".to_owned();
            diagnostics.push(error(Code::UnknownKey, value.span(), message));
        }
        for (key, other) in &given.table {
            let message = format!("`{}` beside `{ONE_OF}`", key.get_ref());
            let diagnostic = error(Code::UnknownKey, key.span().start..other.span().end, message);
            diagnostics.push(diagnostic.label("kinds and options belong to the alternatives"));
        }
        let (span, found) = (value.span(), check::type_of(&value));
        let items = match value.into_inner() {
            DeValue::Array(items) if !items.is_empty() => items,
            DeValue::Array(_) => {
                let message = format!("`{ONE_OF}` needs an alternative");
                diagnostics.push(error(Code::InvalidValue, span, message));
                DeArray::new()
            }
            _ => {
                let message = format!("`{ONE_OF}` must be an array of tables");
                diagnostics.push(error(Code::WrongType, span, message).label(format!("this is {found}")));
                DeArray::new()
            }
        };
        if diagnostics.len() > before {
            names.unread = true;
            return false;
        }
        let first = built.stages.len();
        let mut weights = Vec::new();
        for (index, item) in items.into_iter().enumerate() {
            let (header, found) = (item.span(), check::type_of(&item));
            let DeValue::Table(mut table) = item.into_inner() else {
                let diagnostic = error(Code::WrongType, header, "an alternative must be a table".to_owned());
                diagnostics.push(diagnostic.label(format!("this is {found}")));
                continue;
            };
            weights.extend(table.remove(WEIGHT).map_or(Some(1.0), |weight| weight_of(&weight, diagnostics)));
            let (slot, id) = (given.slot, format!("{}.{ONE_OF}[{index}]", given.id));
            self.stage(
                StageTable { slot, id, id_span: None, header, table, is_alternative: true },
                built,
                names,
                diagnostics,
            );
        }
        if diagnostics[before..].iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
            built.stages.truncate(first);
            return false;
        }
        if weights.iter().all(|weight| *weight == 0.0) {
            let message = "no alternative has a weight above 0".to_owned();
            diagnostics.push(error(Code::InvalidValue, given.header, message));
            built.stages.truncate(first);
            return false;
        }
        let alternatives: Vec<(f64, BuiltStage)> = weights.into_iter().zip(built.stages.drain(first..)).collect();
        if let Some(diagnostic) = unequal_lights(&alternatives) {
            diagnostics.push(diagnostic);
            return false;
        }
        built.stages.extend(joined(given, alternatives));
        true
    }
}

/// The weight of an alternative or a component.
pub(crate) fn weight_of(weight: &RecipeValue, diagnostics: &mut Vec<DiagnosticBuilder>) -> Option<f64> {
    let number = f64::deserialize(ValueDeserializer::from(weight.clone())).ok();
    let number = number.filter(|number| (0.0..=MAX_WEIGHT).contains(number));
    if number.is_none() {
        let message = format!("`weight` must be a number from 0 to {MAX_WEIGHT:e}");
        diagnostics.push(DiagnosticBuilder::error(Code::InvalidValue, weight.span(), message));
    }
    number
}

/// Refuses lights of a view together with lights of a scene: the choice is made once for either.
fn unequal_lights(alternatives: &[(f64, BuiltStage)]) -> Option<DiagnosticBuilder> {
    let once = |stage: &BuiltStage| match &stage.stage {
        Some(Stage::Lights(sampler)) => Some(sampler.once_per_scene()),
        _ => None,
    };
    let (_, first) = alternatives.first()?;
    let (_, other) = alternatives.iter().find(|(_, stage)| once(stage) != once(first))?;
    let message = "some alternatives give lights once per scene, and others once per view";
    let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, other.header.clone(), message);
    Some(diagnostic.label("differs from the first").help("set the same `per` in all alternatives"))
}

/// One stage of several alternatives.
fn joined<'r>(given: StageTable, alternatives: Vec<(f64, BuiltStage<'r>)>) -> Option<BuiltStage<'r>> {
    let entry = alternatives.first()?.1.entry;
    let table = |(weight, stage): &(f64, BuiltStage)| {
        let mut table = toml::Table::new();
        table.insert(WEIGHT.to_owned(), (*weight).into());
        table.insert("kind".to_owned(), stage.entry.kind.into());
        table.extend(stage.options.clone());
        toml::Value::Table(table)
    };
    let options =
        toml::Table::from_iter([(ONE_OF.to_owned(), alternatives.iter().map(table).collect::<Vec<_>>().into())]);
    let stages = || alternatives.iter().map(|(_, stage)| stage);
    let places_objects = |stage: &&BuiltStage| match &stage.stage {
        Some(Stage::Place(placer)) => placer.places_objects(),
        _ => false,
    };
    let object_pools: BTreeSet<String> =
        stages().filter(places_objects).flat_map(|stage| stage.object_pools.clone()).collect();
    Some(BuiltStage {
        slot: given.slot,
        id: given.id,
        entry,
        stage: None,
        options,
        header: given.header,
        products: stages().flat_map(|stage| stage.products.clone()).collect(),
        supports: stages().flat_map(|stage| stage.supports.clone()).collect(),
        object_pools,
        found: stages().all(|stage| stage.found),
        alternatives,
    })
}
