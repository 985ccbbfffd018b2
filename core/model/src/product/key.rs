//! Typed names of products.

use super::product_trait::AnyProduct;
use super::{Form, Framing, Lighting, Product, ProductId, ProductRef, ScenePart, Stored, Value};
use crate::intern::intern;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::any::{TypeId, type_name};
use std::fmt;
use std::marker::PhantomData;
use std::sync::{Arc, LazyLock};

/// How often a product is made, from seldom to often. Scopes may be added: a writer refuses a product whose scope it does not
/// know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Scope {
    /// Once per dataset, after all scenes.
    Dataset,
    /// Once per scene.
    Scene,
    /// Once per moment of a scene. All views at this moment share the product.
    Frame,
    /// Once per view.
    View,
}

impl Scope {
    /// Whether each view comes with a product of this scope: its own product, or the product of its moment. Writers
    /// store both alike.
    pub fn comes_with_view(self) -> bool {
        matches!(self, Self::Frame | Self::View)
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Dataset => "dataset",
            Self::Scene => "scene",
            Self::Frame => "frame",
            Self::View => "view",
        })
    }
}

/// The meaning of a product's numbers, beyond their type. A writer that does not know the product shows it by its meaning.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Semantic {
    /// A color: floats are linear Rec. 709, 8-bit integers are sRGB-encoded.
    Color,
    /// A distance along the optical axis. 0 or infinite in pixels without a surface.
    Depth,
    /// A unit vector of the camera frame (x right, y down, z forward). Zero in pixels without a surface.
    Normal,
    /// Ids; 0 means none.
    Label,
    /// Pixels inside or outside of a region.
    Mask,
    /// Anything else: numbers, records, text.
    #[default]
    Data,
}

impl fmt::Display for Semantic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Color => "color",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Label => "label map",
            Self::Mask => "mask",
            Self::Data => "data",
        })
    }
}

/// The key of a product of type `T`: a constant, best declared with [`products!`](crate::products).
///
/// ```
/// use syntable_model::product::{Key, PerInstance};
/// syntable_model::products! {
///     /// Visible pixels per instance.
///     pub const VISIBLE_AREA: Key<PerInstance<u32>> = view("visible_area").unit("px");
/// }
/// assert_eq!(VISIBLE_AREA.id().doc(), "Visible pixels per instance.");
/// ```
pub struct Key<T> {
    pub(super) id: KeyId,
    of: PhantomData<fn() -> T>,
}

/// A key without its type: the product, its framing, scope and meaning, and the type's identity.
#[derive(Clone, Copy)]
pub struct KeyId {
    /// Name of the product in recipes and files, snake_case, unique among all plugins.
    pub product: &'static str,
    /// How a rendered product is framed. All other products have [`Framing::IMAGE`].
    pub framing: Framing,
    /// How often it is made.
    pub scope: Scope,
    /// The meaning of its numbers.
    pub semantic: Semantic,
    /// Unit of its numbers, such as `m` or `nit`; empty if they have none.
    pub unit: &'static str,
    doc: &'static str,
    type_id: fn() -> TypeId,
    type_name: fn() -> &'static str,
    form: fn() -> Form,
    is_decoded: fn() -> bool,
    pub(super) decode: fn(Stored<'_>) -> Option<Arc<dyn AnyProduct>>,
}

impl<T: Product> Key<T> {
    /// A product of each view.
    pub const fn view(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::View, doc)
    }

    /// A product of each moment of a scene that has a view.
    pub const fn frame(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::Frame, doc)
    }

    /// A product of each scene.
    pub const fn scene(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::Scene, doc)
    }

    /// A product of the dataset.
    pub const fn dataset(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Scope::Dataset, doc)
    }

    const fn new(name: &'static str, scope: Scope, doc: &'static str) -> Self {
        let id = KeyId {
            product: name,
            framing: Framing::IMAGE,
            scope,
            semantic: Semantic::Data,
            unit: "",
            doc,
            type_id: TypeId::of::<T>,
            type_name: type_name::<T>,
            form: T::form,
            is_decoded: T::is_decoded,
            decode: |stored| T::decode(stored).map(|product| Arc::new(product) as Arc<dyn AnyProduct>),
        };
        Self { id, of: PhantomData }
    }

    /// Sets the meaning of the numbers. Without it, it is [`Semantic::Data`].
    pub const fn semantic(mut self, semantic: Semantic) -> Self {
        self.id.semantic = semantic;
        self
    }

    /// Sets the unit of the numbers.
    pub const fn unit(mut self, unit: &'static str) -> Self {
        self.id.unit = unit;
        self
    }

    /// Sets the form of the encoding, if the type leaves it open: `view("camera").form(|| Form::Record)`.
    pub const fn form(mut self, form: fn() -> Form) -> Self {
        self.id.form = form;
        self
    }

    /// The key without its type.
    pub const fn id(&self) -> KeyId {
        self.id
    }

    /// The name of the product, without framing.
    pub const fn name(&self) -> &'static str {
        self.id.product
    }

    /// The rendered product with another framing.
    pub const fn framed(self, framing: Framing) -> Self {
        Self { id: self.id.framed(framing), of: PhantomData }
    }

    /// The rendered product on a larger canvas; see [`Framing::canvas`].
    pub const fn on_canvas(self, canvas: u32) -> Self {
        self.framed(self.id.framing.on_canvas(canvas))
    }

    /// The rendered product with several pixels per pixel of the image; see [`Framing::subpixels`].
    pub const fn in_subpixels(self, subpixels: u32) -> Self {
        self.framed(self.id.framing.in_subpixels(subpixels))
    }

    /// The rendered product as the camera of the next view sees the scene at that view's moment.
    pub const fn of_next_view(self) -> Self {
        self.framed(self.id.framing.of_next_view())
    }

    /// The rendered product of each object alone; see [`Framing::objects`].
    pub const fn of_objects(self, lighting: Lighting) -> Self {
        self.framed(Framing::of_objects(lighting))
    }

    /// The rendered product of a part of the scene; see [`Framing::part`].
    pub const fn of_part(self, part: ScenePart) -> Self {
        self.framed(Framing::of_part(part))
    }
}

impl<T> Clone for Key<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Key<T> {}

impl KeyId {
    /// Identity of the product: its name and framing.
    pub const fn product_id(&self) -> ProductId {
        ProductId { product: self.product, framing: self.framing }
    }

    /// The product with another framing.
    pub const fn framed(self, framing: Framing) -> Self {
        Self { framing, ..self }
    }

    /// The key of this product for an identity. `None` if the identity names another product, or if this product cannot
    /// be framed so: only images are of parts of a scene.
    pub fn of(&self, id: ProductId) -> Option<Self> {
        self.framed_as(id.product, id.framing)
    }

    /// The key of this product for the text of a recipe, such as `coverage (canvas 3)`. `None` as in [`of`](Self::of).
    pub fn parse(&self, text: &str) -> Option<Self> {
        let (product, framing) = text.parts()?;
        self.framed_as(product, framing)
    }

    /// The key of a product for the text of a recipe: of a linked crate, or else of [any type](Self::is_of_any_type). None for
    /// a text that is no name of a product.
    pub fn named(text: &str) -> Option<Self> {
        let (product, framing) = text.parts()?;
        let of_crate = linked().iter().find_map(|key| key.framed_as(product, framing));
        let of_any_type = || Key::<AnyType>::view(intern(product), "").framed(framing).id();
        Some(of_crate.unwrap_or_else(of_any_type))
    }

    /// Whether a stage that reads the product takes any type, because it names products only while the program runs.
    pub fn is_of_any_type(&self) -> bool {
        self.type_id() == TypeId::of::<AnyType>()
    }

    fn framed_as(&self, product: &str, framing: Framing) -> Option<Self> {
        let can_be = framing.part().is_none() || matches!(self.form(), Form::Image { .. });
        (product == self.product && can_be).then(|| self.framed(framing))
    }

    /// Whether a text of a recipe or a file means exactly this product, framing included.
    pub fn is(&self, text: &str) -> bool {
        text.parts() == self.parts()
    }

    /// Meaning, frame and special values, in sentences. Links to other keys read as their names.
    pub fn doc(&self) -> String {
        let mut out = String::new();
        let mut rest = self.doc.trim();
        while let Some((before, after)) = rest.split_once("[`") {
            let Some((link, after)) = after.split_once("`]") else { break };
            out += before;
            out += &format!("`{}`", link.to_lowercase());
            rest = after;
        }
        (out + rest).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// First sentence of [`doc`](Self::doc), without its full stop.
    pub fn summary(&self) -> String {
        crate::words::first_sentence(&self.doc())
    }

    /// Identity of the product's type.
    pub fn type_id(&self) -> TypeId {
        (self.type_id)()
    }

    /// The form of the product's encoding.
    pub fn form(&self) -> Form {
        (self.form)()
    }

    /// Whether products of this type can be read from files; see [`Product::decode`].
    pub fn is_decoded(&self) -> bool {
        (self.is_decoded)()
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

    /// The kind of its value, for messages: `f32 image of 3 channels (normal)`.
    pub fn kind_of_value(&self) -> String {
        match self.semantic {
            Semantic::Data => self.form().to_string(),
            semantic => format!("{} ({semantic})", self.form()),
        }
    }
}

impl ProductRef for KeyId {
    fn parts(&self) -> Option<(&str, Framing)> {
        Some((self.product, self.framing))
    }
}

impl PartialEq for KeyId {
    fn eq(&self, other: &Self) -> bool {
        self.product_id() == other.product_id() && self.scope == other.scope && self.type_id() == other.type_id()
    }
}
impl Eq for KeyId {}

/// As in recipes: `coverage (canvas 3)`.
impl fmt::Display for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.product_id().fmt(f)
    }
}

impl fmt::Debug for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}: {}", self.type_name())
    }
}

/// The type of a product that may have any type.
enum AnyType {}

impl Product for AnyType {
    fn encode(&self) -> Value {
        match *self {}
    }
}

/// A key that [`products!`](crate::products) defines in a crate that is linked.
pub struct LinkedKey(pub KeyId);

inventory::collect!(LinkedKey);

/// The keys of all linked crates, by name; one of each name.
pub fn linked() -> &'static [KeyId] {
    static LINKED: LazyLock<Vec<KeyId>> = LazyLock::new(|| {
        let mut keys: Vec<KeyId> = inventory::iter::<LinkedKey>.into_iter().map(|key| key.0).collect();
        keys.sort_by_key(|key| (key.product_id(), key.type_name()));
        keys.dedup_by_key(|key| key.product_id());
        keys
    });
    &LINKED
}

/// Defines keys of products. The doc comment is the meaning that `syntable list products` and the reference show.
#[macro_export]
macro_rules! products {
    ($(
        $(#[doc = $doc:literal])+
        $vis:vis const $name:ident: Key<$type:ty> = $scope:ident($key:literal) $(.$method:ident($argument:expr))*;
    )+) => {$(
        $(#[doc = $doc])+
        $vis const $name: $crate::product::Key<$type> =
            $crate::product::Key::$scope($key, concat!($($doc, "\n"),+))$(.$method($argument))*;
        $crate::inventory::submit! { $crate::product::LinkedKey($name.id()) }
    )+};
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::{PerInstance, Plane};

    products! {
        /// Light, see [`OTHER`]: in
        /// two lines of Rec. 709. More.
        const LIGHT: Key<Plane<[f32; 3]>> = view("light").semantic(Semantic::Color).unit("nit");
        /// Pixels.
        const AREA: Key<PerInstance<u32>> = view("area");
    }

    #[test]
    fn the_doc_comment_is_the_meaning() {
        let key = LIGHT.id();
        assert_eq!(key.doc(), "Light, see `other`: in two lines of Rec. 709. More.");
        assert_eq!(key.summary(), "Light, see `other`: in two lines of Rec. 709");
        assert_eq!(key.kind_of_value(), "f32 image of 3 channels (color)");
        assert_eq!((key.unit, key.scope), ("nit", Scope::View));
        assert_eq!(key.type_name(), "Plane<[f32; 3]>");
    }

    #[test]
    fn a_text_gives_the_key_with_its_framing() {
        let key = LIGHT.id();
        for framed in [LIGHT, LIGHT.on_canvas(3).of_next_view(), LIGHT.of_objects(Lighting::Alone)] {
            let text = framed.id().to_string();
            assert!(framed.id().is(&text) && key.parse(&text) == Some(framed.id()), "{text}");
            assert_eq!(key.is(&text), framed.id() == key);
        }
        for wrong in ["lights", "lightly", "light (canvas 2)", "light (canvas 3", "dark (canvas 3)"] {
            assert!(key.parse(wrong).is_none() && !key.is(wrong), "{wrong}");
        }
        // Only images can show single objects.
        assert!(AREA.id().parse("area (canvas 3)").is_some() && AREA.id().parse("area (objects alone)").is_none());
    }
}
