//! The pools of all components, and their names in the recipe.

use crate::component::{pool_name, table};
use crate::tables::pool::{Pool, PoolOptions};
use crate::tables::stages::BuiltStage;
use std::collections::BTreeMap;
use syntable_model::registry::Slot;
use syntable_model::stage::AssetSource;

/// The pools of all components. Components that describe a pool alike share it.
#[derive(Default)]
pub(crate) struct SharedPools(Vec<SharedPool>);

/// A pool, and the components that describe it alike.
pub(crate) struct SharedPool {
    /// Its id in these components.
    pub id: String,
    /// Their indices.
    pub users: Vec<usize>,
    pub pool: Pool,
    /// Name of the first of them.
    component: String,
    described: (&'static str, toml::Table),
}

impl SharedPools {
    /// Adds a pool of a component, given by its index and its name, unless an earlier component describes the same pool.
    pub fn add(
        &mut self,
        (user, component): (usize, &str),
        stage: &BuiltStage,
        mut source: Box<dyn AssetSource>,
        options: &mut BTreeMap<String, PoolOptions>,
    ) -> Option<()> {
        let options = options.remove(&stage.id)?;
        let (id, described) = (stage.id.clone(), (stage.entry.kind, stage.options.clone()));
        if let Some(same) = self.0.iter_mut().find(|other| other.id == id && other.described == described) {
            same.users.push(user);
            return Some(());
        }
        source.limit(options.limits);
        let table = table(component, &Slot::Assets.stage_name(&id));
        let pool = Pool { kind: stage.entry.kind.to_owned(), table, source, options };
        self.0.push(SharedPool { id, users: vec![user], pool, component: component.to_owned(), described });
        Some(())
    }

    /// The pools by their names in the recipe. Pools that differ but have the same id get the name of a component, too.
    pub fn named(self) -> BTreeMap<String, SharedPool> {
        let ids: Vec<String> = self.0.iter().map(|pool| pool.id.clone()).collect();
        let name = |pool: &SharedPool| match ids.iter().filter(|other| **other == pool.id).count() {
            1 => pool.id.clone(),
            _ => pool_name(&pool.component, &pool.id),
        };
        self.0.into_iter().map(|pool| (name(&pool), pool)).collect()
    }
}
