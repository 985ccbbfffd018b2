//! Finds the parts of a recipe that have not changed since an earlier one, so that stages and their data in memory are
//! kept.

use crate::component::{Component, components_of, table};
use crate::recipe::Recipe;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::registry::{Shape, Slot};

/// Digests of the stages of a recipe, by slot and table as errors name them: `render`, `mixture.tables.place.objects`. Equal
/// digests mean the same kind, the same options, and the same content of the files that options name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parts(Vec<(Slot, String, Digest)>);

impl Parts {
    /// The parts of a recipe: component by component, slot by slot in the order in which stages run. An error means that a
    /// file cannot be read.
    pub fn of(recipe: &Recipe) -> Result<Self> {
        let (resolved, files) = (recipe.resolved.parse::<toml::Table>().unwrap_or_default(), recipe.file_digests()?);
        let digest = |part: &str, options: &toml::Value| {
            let prefix = format!("{part}.");
            let own = files.iter().filter(|(option, _)| option.starts_with(&prefix));
            let hasher = Hasher::new("stage of a recipe").text(&options.to_string());
            own.fold(hasher, |hasher, (option, digest)| hasher.text(option).text(digest)).finish()
        };
        let mut parts = Vec::new();
        let mut add = |component: &str, tables: &toml::Table| {
            for (slot, stage, options) in stages(tables) {
                let part = table(component, &stage);
                let digest = digest(&part, options);
                parts.push((slot, part, digest));
            }
        };
        components_of(&resolved).into_iter().for_each(|(id, tables)| add(id, tables));
        Ok(Self(parts))
    }

    /// Adds the parts of some slots of a component to a digest, with their names and in their order.
    pub fn hash(&self, hasher: Hasher, component: &Component, slots: &[Slot]) -> Hasher {
        let is_own = |slot: Slot, part: &str| {
            let first = component.table(slot.name());
            part.strip_prefix(&first).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let parts = self.0.iter().filter(|(slot, part, _)| slots.contains(slot) && is_own(*slot, part));
        parts.fold(hasher, |hasher, (_, part, digest)| hasher.text(part).digest(*digest))
    }

    /// The digest of a part.
    pub fn get(&self, part: &str) -> Option<Digest> {
        self.0.iter().find(|(_, other, _)| other == part).map(|(.., digest)| *digest)
    }

    /// Whether both have a part, and it is the same.
    pub fn agree(&self, other: &Self, part: &str) -> bool {
        self.get(part).is_some_and(|digest| other.get(part) == Some(digest))
    }
}

/// The stages in the tables of a resolved recipe or of one of its components, with their names and options.
fn stages(tables: &toml::Table) -> Vec<(Slot, String, &toml::Value)> {
    let mut all = Vec::new();
    for slot in Slot::ALL {
        let Some(value) = tables.get(slot.name()) else { continue };
        match (slot.shape(), value) {
            (Shape::Keyed, toml::Value::Table(stages)) => {
                all.extend(stages.iter().map(|(id, options)| (slot, format!("{slot}.{id}"), options)));
            }
            (Shape::List, toml::Value::Array(stages)) => all.extend(stages.iter().map(|options| {
                let id = options.get("id").and_then(toml::Value::as_str);
                (slot, id.map_or_else(|| slot.name().to_owned(), |id| format!("{slot}.{id}")), options)
            })),
            _ => all.push((slot, slot.name().to_owned(), value)),
        }
    }
    all
}

impl Recipe {
    /// Takes the stages of an earlier recipe that are the same in both, given by their tables. A stage never changes after it
    /// was built, but it keeps data that it loaded and computed.
    pub fn keep_stages(&mut self, earlier: Self, is_same: impl Fn(&str) -> bool) {
        for (name, pool) in earlier.assets {
            if let Some(own) = self.assets.get_mut(&name).filter(|own| own.table == pool.table && is_same(&own.table)) {
                *own = pool;
            }
        }
        let mut earlier: BTreeMap<String, Component> =
            earlier.components.into_all().map(|component| (component.id.clone(), component)).collect();
        for component in self.components.all_mut() {
            if let Some(earlier) = earlier.remove(&component.id) {
                let id = component.id.clone();
                component.keep_stages(earlier, |stage| is_same(&table(&id, stage)));
            }
        }
    }
}

impl Component {
    /// Takes the stages of the same component in an earlier recipe that are the same in both.
    fn keep_stages(&mut self, earlier: Self, is_same: impl Fn(&str) -> bool) {
        fn listed<T>(own: &mut [(String, T)], earlier: Vec<(String, T)>, is_same: impl Fn(&str) -> bool) {
            for (id, stage) in earlier.into_iter().filter(|(id, _)| is_same(id)) {
                if let Some((_, own)) = own.iter_mut().find(|(other, _)| *other == id) {
                    *own = stage;
                }
            }
        }
        let in_slot = |slot: Slot| {
            let is_same = &is_same;
            move |id: &str| is_same(&format!("{slot}.{id}"))
        };
        listed(&mut self.place, earlier.place, in_slot(Slot::Place));
        listed(&mut self.lights, earlier.lights, in_slot(Slot::Lights));
        let one = |slot: Slot| is_same(slot.name());
        if one(Slot::Settle) {
            self.settle = earlier.settle;
        }
        if one(Slot::Camera) {
            self.camera = earlier.camera;
        }
        if one(Slot::Views) {
            self.views = earlier.views;
        }
        if one(Slot::Render) {
            self.render = earlier.render;
        }
        let before: BTreeMap<String, _> = (earlier.plan.stages())
            .filter(|stage| is_same(&stage.stage))
            .map(|stage| (stage.stage.clone(), Arc::clone(&stage.producer)))
            .collect();
        for stage in self.plan.stages_mut() {
            if let Some(producer) = before.get(&stage.stage) {
                stage.producer = Arc::clone(producer);
            }
        }
    }
}
