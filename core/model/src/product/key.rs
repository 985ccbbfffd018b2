//! Typed names of products.

use super::Value;
use std::any::{Any, TypeId, type_name};
use std::fmt;
use std::marker::PhantomData;

/// How often a product is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Scope {
    /// Once a scene.
    Scene,
    /// Once a view.
    View,
}

/// A value that can be a product.
pub trait Product: Any + Send + Sync {
    /// The generic encoding, for writers that do not know the type.
    fn encode(&self) -> Value;
}

/// The name of a product of type `T`. Made as a constant:
///
/// ```
/// use syntable_model::product::{Key, PerInstance};
/// /// Visible pixels per instance, px.
/// pub const VISIBLE_AREA: Key<PerInstance<u32>> = Key::view("visible_area", "visible pixels per instance, px");
/// ```
pub struct Key<T> {
    id: KeyId,
    of: PhantomData<fn() -> T>,
}

/// A key without its type: name, scope, meaning, and the type's identity.
#[derive(Clone, Copy)]
pub struct KeyId {
    /// Name in recipes and files, snake_case, unique among all plugins.
    pub name: &'static str,
    /// How often it is made.
    pub scope: Scope,
    /// Meaning, unit, frame.
    pub doc: &'static str,
    type_id: fn() -> TypeId,
    type_name: fn() -> &'static str,
}

impl<T: Product> Key<T> {
    /// A product of every view.
    pub const fn view(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::View, doc)
    }

    /// A product of every scene.
    pub const fn scene(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::Scene, doc)
    }

    const fn new(name: &'static str, scope: Scope, doc: &'static str) -> Self {
        Self { id: KeyId { name, scope, doc, type_id: TypeId::of::<T>, type_name: type_name::<T> }, of: PhantomData }
    }

    /// The key without its type.
    pub const fn id(&self) -> KeyId {
        self.id
    }

    /// The name.
    pub const fn name(&self) -> &'static str {
        self.id.name
    }
}

impl<T> Clone for Key<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Key<T> {}

impl KeyId {
    /// Identity of the product's type.
    pub fn type_id(&self) -> TypeId {
        (self.type_id)()
    }

    /// Short name of the product's type, without module paths.
    pub fn type_name(&self) -> String {
        let mut out = String::new();
        let mut word = String::new();
        for c in (self.type_name)().chars() {
            match c {
                ':' => word.clear(),
                c if c.is_alphanumeric() || c == '_' => word.push(c),
                c => {
                    out += &word;
                    word.clear();
                    out.push(c);
                }
            }
        }
        out + &word
    }
}

impl PartialEq for KeyId {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.scope == other.scope && self.type_id() == other.type_id()
    }
}
impl Eq for KeyId {}

impl fmt::Debug for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.type_name())
    }
}
