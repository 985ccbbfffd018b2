//! The products of one view, scene or dataset.

use super::{Key, KeyId, Name, Product, Stored as InFile, Value};
use crate::error::{Error, Result};
use std::any::Any;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

/// A write-once store of products. Copies share what they hold.
#[derive(Clone, Default)]
pub struct Products {
    stored: BTreeMap<Name, Stored>,
    declared: Option<Vec<String>>,
}

#[derive(Clone)]
struct Stored {
    key: KeyId,
    product: Arc<dyn AnyProduct>,
}

pub trait AnyProduct: Any + Send + Sync {
    fn encode(&self) -> Value;
}

impl<T: Product> AnyProduct for T {
    fn encode(&self) -> Value {
        Product::encode(self)
    }
}

impl Products {
    /// A store without products.
    pub fn new() -> Self {
        Self::default()
    }

    /// Stores a product. It must not be there yet.
    pub fn put<T: Product>(&mut self, key: Key<T>, product: T) -> Result<()> {
        self.store(Stored { key: key.id(), product: Arc::new(product) })
    }

    /// Stores the product that a file has. The error says that it is of another type.
    pub fn put_stored(&mut self, key: KeyId, stored: InFile<'_>) -> Result<()> {
        let value = stored.of_form(&key.form());
        let decoded = value.as_deref().and_then(|value| (key.decode)(InFile { value, ..stored }));
        let product = decoded.ok_or_else(|| Error::new(format!("`{}` is not {}", key.name, key.kind_of_value())))?;
        self.store(Stored { key, product })
    }

    /// A product. The error says whether it is missing, undeclared, or of another type.
    pub fn get<T: Product>(&self, key: Key<T>) -> Result<&T> {
        let stored = self.stored(&key.id.name)?;
        (&*stored.product as &dyn Any).downcast_ref().ok_or_else(|| {
            Error::new(format!("product `{}` is {}, not {}", key.name(), stored.key.type_name(), key.id().type_name()))
        })
    }

    /// The same of a product that need not be there, as an [optional input](crate::stage::Input::optional).
    pub fn optional<T: Product>(&self, key: Key<T>) -> Result<Option<&T>> {
        if self.contains(&key.id.name) || self.is_undeclared(key.name()) { self.get(key).map(Some) } else { Ok(None) }
    }

    /// The generic encoding of a product, by name.
    pub fn value<N: Display + ?Sized>(&self, name: &N) -> Result<Value>
    where
        Name: PartialEq<N>,
    {
        Ok(self.stored(name)?.product.encode())
    }

    /// The key of a product, by name.
    pub fn key<N: ?Sized>(&self, name: &N) -> Option<KeyId>
    where
        Name: PartialEq<N>,
    {
        self.find(name).map(|stored| stored.key)
    }

    /// Whether a product is there.
    pub fn contains<N: ?Sized>(&self, name: &N) -> bool
    where
        Name: PartialEq<N>,
    {
        self.find(name).is_some()
    }

    /// The keys of all products that are there, by name.
    pub fn keys(&self) -> Vec<KeyId> {
        self.stored.values().map(|stored| stored.key).collect()
    }

    /// The products of some names, and no others: what a stage is lent, so that what it declares is all it can read.
    pub fn only<N: Display>(&self, names: &[N]) -> Self
    where
        Name: PartialEq<N>,
    {
        let declared = names.iter().map(N::to_string).collect();
        let stored = self.stored.iter().filter(|(name, _)| names.iter().any(|other| **name == *other));
        Self { stored: stored.map(|(name, stored)| (*name, stored.clone())).collect(), declared: Some(declared) }
    }

    /// Takes over the products of another store that are not here yet, and refuses those that are.
    pub fn extend(&mut self, other: Self) -> Result<()> {
        other.stored.into_values().try_for_each(|stored| self.store(stored))
    }

    /// Takes a product out of this store, under another key of the same type.
    pub fn rename(&mut self, from: KeyId, to: KeyId) -> Result<()> {
        if let Some(stored) = self.stored.remove(&from.name) {
            self.store(Stored { key: to, ..stored })?;
        }
        Ok(())
    }

    /// Removes the products that another store holds too: what is left was put since `lent` was copied.
    pub fn without(mut self, lent: &Self) -> Self {
        self.stored.retain(|name, _| !lent.stored.contains_key(name));
        self
    }

    fn store(&mut self, stored: Stored) -> Result<()> {
        let name = stored.key.name;
        match self.stored.insert(name, stored) {
            None => Ok(()),
            Some(_) => Err(Error::new(format!("product `{name}` was made twice"))),
        }
    }

    fn find<N: ?Sized>(&self, name: &N) -> Option<&Stored>
    where
        Name: PartialEq<N>,
    {
        self.stored.iter().find(|(other, _)| **other == *name).map(|(_, stored)| stored)
    }

    fn is_undeclared(&self, name: &str) -> bool {
        self.declared.as_ref().is_some_and(|declared| !declared.iter().any(|other| other == name))
    }

    fn stored<N: Display + ?Sized>(&self, name: &N) -> Result<&Stored>
    where
        Name: PartialEq<N>,
    {
        self.find(name).ok_or_else(|| {
            let name = name.to_string();
            let error = if self.is_undeclared(&name) {
                Error::new(format!("product `{name}` is read but not declared"))
            } else {
                Error::new(format!("product `{name}` has not been made"))
            };
            error.help("name it in `reads()` of the stage that needs it")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::PerInstance;

    const A: Key<PerInstance<u32>> = Key::view("a", "a test");
    const WRONG_A: Key<PerInstance<f64>> = Key::view("a", "a test of another type");
    const B: Key<PerInstance<u32>> = Key::scene("b", "a test of a scene");

    #[test]
    fn products_are_written_once_and_typed() {
        let mut products = Products::new();
        products.put(B, PerInstance::default()).expect("first");
        products.put(A, PerInstance::default()).expect("first");
        let twice = products.put(A, PerInstance::default()).expect_err("second");
        assert!(twice.to_string().contains("made twice") && twice.is_permanent());
        assert!(products.get(A).is_ok() && products.get(B).is_ok());
        let error = products.get(WRONG_A).expect_err("type").to_string();
        assert_eq!(error, "product `a` is PerInstance<u32>, not PerInstance<f64>");
        assert_eq!(products.keys().iter().map(|key| key.name).collect::<Vec<_>>(), ["a", "b"]);
    }

    #[test]
    fn a_stage_can_read_what_it_declares_and_what_it_puts() {
        let mut products = Products::new();
        products.put(A, PerInstance::default()).expect("first");
        let lent = products.only(&["b"]);
        assert!(lent.get(A).expect_err("not lent").to_string().contains("not declared"));
        assert!(lent.get(B).expect_err("missing").to_string().contains("has not been made"));
        assert!(lent.optional(A).expect_err("not lent").to_string().contains("not declared"));
        assert!(lent.optional(B).expect("lent").is_none());
        assert!(products.optional(A).expect("there").is_some());
        let mut filled = lent.clone();
        filled.put(B, PerInstance::default()).expect("first");
        assert!(filled.get(B).is_ok());
        products.extend(filled.without(&lent)).expect("new");
        assert!(products.get(A).is_ok() && products.get(B).is_ok());
    }
}
