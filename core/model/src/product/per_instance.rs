//! Values of the annotated instances.

use crate::scene::InstanceId;
use std::collections::BTreeMap;

/// A value for each annotated instance, in id order.
#[derive(Debug, Clone, PartialEq)]
pub struct PerInstance<T>(pub BTreeMap<InstanceId, T>);

impl<T> Default for PerInstance<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> FromIterator<(InstanceId, T)> for PerInstance<T> {
    fn from_iter<I: IntoIterator<Item = (InstanceId, T)>>(items: I) -> Self {
        Self(items.into_iter().collect())
    }
}

impl<T> PerInstance<T> {
    /// The value of an instance.
    pub fn get(&self, id: InstanceId) -> Option<&T> {
        self.0.get(&id)
    }

    /// Ids and values, in id order.
    pub fn iter(&self) -> impl Iterator<Item = (InstanceId, &T)> {
        self.0.iter().map(|(&id, value)| (id, value))
    }

    /// The same instances with other values.
    pub fn map<U>(&self, mut f: impl FnMut(InstanceId, &T) -> U) -> PerInstance<U> {
        self.iter().map(|(id, value)| (id, f(id, value))).collect()
    }
}
