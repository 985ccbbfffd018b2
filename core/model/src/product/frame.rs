//! The products of one view, or of one scene.

use super::{Key, KeyId, Product, Value};
use crate::error::{Error, Result};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A write-once store of products. A view's frame sees its scene's products too.
#[derive(Default)]
pub struct Frame {
    products: BTreeMap<&'static str, Slot>,
    scene: Option<Arc<Frame>>,
    readable: Option<Vec<&'static str>>,
}

struct Slot {
    key: KeyId,
    product: Arc<dyn AnyProduct>,
}

trait AnyProduct: Any + Send + Sync {
    fn encode(&self) -> Value;
}

impl<T: Product> AnyProduct for T {
    fn encode(&self) -> Value {
        Product::encode(self)
    }
}

impl Frame {
    /// An empty frame of a scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty frame of a view, through which the scene's products are visible.
    pub fn of_view(scene: Arc<Frame>) -> Self {
        Self { scene: Some(scene), ..Self::default() }
    }

    /// Stores a product. It must not be there yet.
    pub fn put<T: Product>(&mut self, key: Key<T>, product: T) -> Result<()> {
        let slot = Slot { key: key.id(), product: Arc::new(product) };
        match self.products.insert(key.name(), slot) {
            None => Ok(()),
            Some(_) => Err(Error::new(format!("product `{}` was made twice", key.name()))),
        }
    }

    /// Gives a product another key of the same type, under which it must not be there yet.
    pub fn rename<T: Product>(&mut self, from: Key<T>, to: Key<T>) -> Result<()> {
        self.get(from)?;
        if self.products.contains_key(to.name()) {
            return Err(Error::new(format!("product `{}` was made twice", to.name())));
        }
        if let Some(slot) = self.products.remove(from.name()) {
            self.products.insert(to.name(), Slot { key: to.id(), ..slot });
        }
        Ok(())
    }

    /// A product. The error says whether it is missing, undeclared, or of another type.
    pub fn get<T: Product>(&self, key: Key<T>) -> Result<&T> {
        let slot = self.slot(key.name())?;
        (&*slot.product as &dyn Any).downcast_ref().ok_or_else(|| {
            Error::new(format!("product `{}` is {}, not {}", key.name(), slot.key.type_name(), key.id().type_name()))
        })
    }

    /// The generic encoding of a product, by name.
    pub fn value(&self, name: &str) -> Result<Value> {
        Ok(self.slot(name)?.product.encode())
    }

    /// Whether a product is there.
    pub fn contains(&self, name: &str) -> bool {
        self.products.contains_key(name) || self.scene.as_ref().is_some_and(|scene| scene.contains(name))
    }

    /// The keys of all products that are there, by name.
    pub fn keys(&self) -> Vec<KeyId> {
        let mut keys: BTreeMap<_, _> =
            self.scene.iter().flat_map(|scene| scene.keys()).map(|key| (key.name, key)).collect();
        keys.extend(self.products.values().map(|slot| (slot.key.name, slot.key)));
        keys.into_values().collect()
    }

    /// Limits reading to some products until [`unguard`](Self::unguard), so that what a stage declares to read is
    /// what it reads.
    pub fn guard(&mut self, readable: &[KeyId]) {
        self.readable = Some(readable.iter().map(|key| key.name).collect());
    }

    /// Lifts the limit.
    pub fn unguard(&mut self) {
        self.readable = None;
    }

    fn slot(&self, name: &str) -> Result<&Slot> {
        if let Some(readable) = &self.readable
            && !readable.contains(&name)
        {
            return Err(Error::new(format!("product `{name}` is read but not declared"))
                .help("name it in the annotator's `reads()`"));
        }
        self.find(name).ok_or_else(|| {
            Error::new(format!("product `{name}` has not been made"))
                .help("name it in `reads()` of the annotator or writer that needs it")
        })
    }

    fn find(&self, name: &str) -> Option<&Slot> {
        self.products.get(name).or_else(|| self.scene.as_ref()?.find(name))
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
        let mut scene = Frame::new();
        scene.put(B, PerInstance::default()).expect("first");
        let mut frame = Frame::of_view(Arc::new(scene));
        frame.put(A, PerInstance::default()).expect("first");
        assert!(frame.put(A, PerInstance::default()).expect_err("second").to_string().contains("made twice"));
        assert!(frame.get(A).is_ok() && frame.get(B).is_ok());
        let error = frame.get(WRONG_A).expect_err("type").to_string();
        assert_eq!(error, "product `a` is PerInstance<u32>, not PerInstance<f64>");
        assert_eq!(frame.keys().iter().map(|key| key.name).collect::<Vec<_>>(), ["a", "b"]);
    }

    #[test]
    fn a_guarded_frame_gives_what_was_declared() {
        let mut frame = Frame::new();
        frame.put(A, PerInstance::default()).expect("first");
        frame.guard(&[B.id()]);
        assert!(frame.get(A).expect_err("guarded").to_string().contains("not declared"));
        frame.unguard();
        assert!(frame.get(A).is_ok());
    }
}
