//! The products of one view, frame, scene or dataset.

use super::product_trait::AnyProduct;
use super::{Key, KeyId, Product, ProductId, ProductRef, Stored as InFile, Value};
use crate::error::{Error, Result};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A write-once store of products. Copies share the products.
#[derive(Clone, Default)]
pub struct Products {
    stored: BTreeMap<ProductId, StoredProduct>,
    declared: Option<Vec<String>>,
}

#[derive(Clone)]
struct StoredProduct {
    key: KeyId,
    product: Arc<dyn AnyProduct>,
}

impl Products {
    /// A store without products.
    pub fn new() -> Self {
        Self::default()
    }

    /// Stores a product.
    ///
    /// # Errors
    /// If the store has it already.
    pub fn put<T: Product>(&mut self, key: Key<T>, product: T) -> Result<()> {
        self.store(StoredProduct { key: key.id(), product: Arc::new(product) })
    }

    /// Stores a product from the value in a file.
    ///
    /// # Errors
    /// If the value has another type.
    pub fn put_stored(&mut self, key: KeyId, stored: InFile<'_>) -> Result<()> {
        let value = stored.of_form(&key.form());
        let decoded = value.as_deref().and_then(|value| (key.decode)(InFile { value, ..stored }));
        let product = decoded.ok_or_else(|| Error::new(format!("`{key}` is not {}", key.kind_of_value())))?;
        self.store(StoredProduct { key, product })
    }

    /// A product.
    ///
    /// # Errors
    /// If it is missing, undeclared, or of another type.
    pub fn get<T: Product>(&self, key: Key<T>) -> Result<&T> {
        let stored = self.stored(&key.id)?;
        (&*stored.product as &dyn Any).downcast_ref().ok_or_else(|| {
            Error::new(format!("product `{}` is {}, not {}", key.id, stored.key.type_name(), key.id.type_name()))
        })
    }

    /// A product that may be missing, as an [optional input](crate::stage::Input::optional).
    pub fn optional<T: Product>(&self, key: Key<T>) -> Result<Option<&T>> {
        if self.contains(&key.id) || self.is_undeclared(&key.id) { self.get(key).map(Some) } else { Ok(None) }
    }

    /// The generic encoding of a product.
    pub fn value<P: ProductRef + ?Sized>(&self, product: &P) -> Result<Value> {
        Ok(self.stored(product)?.product.encode())
    }

    /// The key of a product, if the store has it.
    pub fn key<P: ProductRef + ?Sized>(&self, product: &P) -> Option<KeyId> {
        self.find(product).map(|stored| stored.key)
    }

    /// Whether the store has a product.
    pub fn contains<P: ProductRef + ?Sized>(&self, product: &P) -> bool {
        self.find(product).is_some()
    }

    /// The keys of all products, by name.
    pub fn keys(&self) -> Vec<KeyId> {
        self.stored.values().map(|stored| stored.key).collect()
    }

    /// A copy with some of the products. Stages get such a copy, so they can read only what they declare.
    pub fn only<P: ProductRef>(&self, products: &[P]) -> Self {
        let of_store = |product: &P| self.find(product).map(|stored| (stored.key.product_id(), stored.clone()));
        Self {
            stored: products.iter().filter_map(of_store).collect(),
            declared: Some(products.iter().map(P::to_string).collect()),
        }
    }

    /// Moves all products of another store into this one. Refuses a product that is here already.
    pub fn extend(&mut self, other: Self) -> Result<()> {
        other.stored.into_values().try_for_each(|stored| self.store(stored))
    }

    /// Moves a product to another key of the same type, if the store has it.
    pub fn rename(&mut self, from: KeyId, to: KeyId) -> Result<()> {
        if let Some(stored) = self.stored.remove(&from.product_id()) {
            self.store(StoredProduct { key: to, ..stored })?;
        }
        Ok(())
    }

    /// Removes the products that another store also has. In a copy of `lent`, the products that were put later remain.
    pub fn without(mut self, lent: &Self) -> Self {
        self.stored.retain(|id, _| !lent.stored.contains_key(id));
        self
    }

    fn store(&mut self, stored: StoredProduct) -> Result<()> {
        let key = stored.key;
        match self.stored.insert(key.product_id(), stored) {
            None => Ok(()),
            Some(_) => Err(Error::new(format!("product `{key}` was made twice"))),
        }
    }

    fn find<P: ProductRef + ?Sized>(&self, product: &P) -> Option<&StoredProduct> {
        let parts = product.parts()?;
        self.stored.iter().find(|(id, _)| (id.product, id.framing) == parts).map(|(_, stored)| stored)
    }

    fn is_undeclared<P: ProductRef + ?Sized>(&self, product: &P) -> bool {
        let is = |other: &String| other.parts().is_some_and(|parts| Some(parts) == product.parts());
        self.declared.as_ref().is_some_and(|declared| !declared.iter().any(is))
    }

    fn stored<P: ProductRef + ?Sized>(&self, product: &P) -> Result<&StoredProduct> {
        self.find(product).ok_or_else(|| {
            let error = if self.is_undeclared(product) {
                Error::new(format!("product `{product}` is read but not declared"))
            } else {
                Error::new(format!("product `{product}` has not been made"))
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
        assert_eq!(products.keys(), [A.id(), B.id()]);
    }

    #[test]
    fn a_stage_can_read_what_it_declares_and_what_it_puts() {
        let mut products = Products::new();
        products.put(A, PerInstance::default()).expect("first");
        let lent = products.only(&["b"]);
        assert!(lent.get(A).expect_err("not lent").to_string().contains("not declared"));
        let canvas = lent.get(B.on_canvas(3)).expect_err("another framing").to_string();
        assert!(canvas.contains("`b (canvas 3)` is read but not declared"), "{canvas}");
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
