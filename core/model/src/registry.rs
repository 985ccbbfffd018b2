//! Registration of stages: a plugin registers each of its configuration types.
//!
//! [`register!`](crate::register) submits a constant [`Entry`] at link time; [`Registry::linked`] collects, sorts and
//! checks them. Every function of the program takes `&Registry`, so that tests build theirs by hand, and programs add kinds
//! with state of their own ([`Registry::with`]).

use crate::check::{Check, LabelCheck};
use crate::error::ConfigError;
use crate::intern::intern;
use crate::linked::Linked;
use crate::reader::{DatasetFormat, Format};
use crate::stage::{
    AssetSource, CameraModel, DatasetAnnotator, Denoiser, FrameAnnotator, ImageAnnotator, LightSampler, Placer,
    Renderer, SceneAnnotator, Scenes, Sensor, Settler, ViewAnnotator, ViewSampler, Writer,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use syntable_toml_schema::{SchemaBuilder, SpannedValue, Validator, spanned_members, unsupported};
use toml::de::DeValue;

/// The options of one kind of stage, as a recipe gives them.
///
/// The type's doc comment describes the kind, the fields' doc comments describe the options, schemars attributes such
/// as `range` state limits: help, JSON Schema, range checks and the reference in the book all come from there.
pub trait Config: Serialize + DeserializeOwned + JsonSchema {
    /// The trait of the stage that it builds, such as `dyn ImageAnnotator`.
    type Stage: ?Sized + InSlot;
    /// The kind's name in recipes: a snake_case noun.
    const KIND: &'static str;
    /// Body of a recipe table with this kind's usual options, valid TOML, for help and tests.
    const EXAMPLE: &'static str;
    /// Options that had another name, as (old, new) paths such as `("camera.fov", "camera.fov_deg")`. A recipe
    /// that uses the old name gets an error that names the new one.
    const RENAMED: &'static [(&'static str, &'static str)] = &[];
    /// For a kind that represents other kinds of its slot and has the options that all of them have: chooses one of
    /// them for this machine. Called when a run begins, but never by `check` or `plan`, for which the kind builds a
    /// stage like any other. The resolved recipe names the chosen kind.
    const CHOOSE: Option<Choose> = None;
    /// Builds the stage. Checks rules that ranges cannot express. Does no input or output, so that `check` is quick.
    fn build(self) -> Result<Box<Self::Stage>, ConfigError>;
}

/// Chooses a kind among the kinds of a registry; see [`Config::CHOOSE`]. The error names the part that the user asked
/// for and this machine lacks.
pub type Choose = fn(&Registry) -> crate::error::Result<Choice>;

/// A kind that replaces another kind on this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// The kind, of the same slot.
    pub kind: &'static str,
    /// The reason, for users, such as the devices that were found or the library that is missing.
    pub reason: String,
}

/// How often a slot occurs in a recipe. Shapes may be added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// One table.
    One,
    /// An array of tables, in order.
    List,
    /// Tables by id. The id is the kind unless the table has a `kind`.
    Keyed,
}

/// A place in the pipeline that stages can take: one row of the table of slots.
#[derive(Debug, Clone, Copy)]
pub struct SlotSpec {
    /// Key in recipes.
    pub name: &'static str,
    /// The task of its stages.
    pub doc: &'static str,
    /// How often it occurs.
    pub shape: Shape,
    /// Kinds that a recipe without the section gets, if they are registered.
    pub default_kinds: &'static [&'static str],
    /// Whether a recipe may leave it out.
    pub optional: bool,
}

macro_rules! slots {
    ($(
        $slot:ident = $name:literal, $shape:ident, $need:ident, default $default:expr,
        $doc:literal: $($variant:ident($stage:path)),+;
    )+) => {
        /// The places in the pipeline that a stage can take, in pipeline order.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[non_exhaustive]
        pub enum Slot {
            $(#[doc = concat!("`", $name, "`: ", $doc)] $slot),+
        }

        impl Slot {
            /// All slots, in pipeline order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$slot),+];

            /// Its row in the table of slots.
            pub const fn spec(self) -> SlotSpec {
                match self {
                    $(Self::$slot => SlotSpec {
                        name: $name,
                        doc: $doc,
                        shape: Shape::$shape,
                        default_kinds: &$default,
                        optional: slots!(@optional $need),
                    }),+
                }
            }
        }

        /// A stage of any slot.
        #[non_exhaustive]
        pub enum Stage {
            $($(#[doc = concat!("A stage of `", $name, "`.")] $variant(Box<dyn $stage>)),+),+
        }

        impl Stage {
            /// The slot that it takes.
            pub fn slot(&self) -> Slot {
                match self {
                    $($(Self::$variant(_) => Slot::$slot),+),+
                }
            }
        }

        $($(
            impl InSlot for dyn $stage {
                const SLOT: Slot = Slot::$slot;
                fn into_stage(self: Box<Self>) -> Stage {
                    Stage::$variant(self)
                }
            }
        )+)+
    };
    (@optional optional) => { true };
    (@optional required) => { false };
}

slots! {
    Assets = "assets", Keyed, optional, default [],
        "Pools of objects, materials and environment maps, drawn from by name.": Assets(AssetSource);
    Place = "place", List, required, default [],
        "Puts bodies into the scene; steps run in order.": Place(Placer);
    Settle = "settle", One, required, default ["rapier"],
        "Lets the bodies come to rest.": Settle(Settler);
    Camera = "camera", One, required, default ["pinhole"],
        "Intrinsics, lens and exposure.": Camera(CameraModel);
    Views = "views", One, required, default ["hemisphere_shell"],
        "Camera poses, one per view.": Views(ViewSampler);
    Lights = "lights", List, optional, default ["ceiling_light", "sphere_lights"],
        "Lights, sampled per view or once for all views of a scene.": Lights(LightSampler);
    Render = "render", One, required, default ["cpu_path"],
        "Renders images and per-pixel labels.": Render(Renderer);
    Denoise = "denoise", One, optional, default ["none"],
        "Removes sampling noise from rendered images.": Denoise(Denoiser);
    Sensor = "sensor", Keyed, optional, default [],
        "Simulates camera effects on rendered images; a table is needed only to set options.": Sensor(Sensor);
    Annotate = "annotate", Keyed, optional, default [],
        "Provides annotations; a table is needed only to set options.":
        AnnotateImage(ImageAnnotator), AnnotateView(ViewAnnotator), AnnotateFrame(FrameAnnotator),
        AnnotateScene(SceneAnnotator), AnnotateDataset(DatasetAnnotator);
    Write = "write", Keyed, required, default [],
        "Writes files; only products that writers include are computed.": Write(Writer), WriteScenes(Writer<Scenes>);
}

impl Slot {
    /// Its key in recipes.
    pub const fn name(self) -> &'static str {
        self.spec().name
    }

    /// The task of its stages.
    pub const fn doc(self) -> &'static str {
        self.spec().doc
    }

    /// How often it occurs.
    pub const fn shape(self) -> Shape {
        self.spec().shape
    }

    /// Whether a table of it may leave out `kind`, and then has the default kind. A table of an optional slot names the stage that
    /// the recipe adds.
    pub fn has_default_kind(self) -> bool {
        let SlotSpec { shape, default_kinds, optional, .. } = self.spec();
        shape == Shape::One && !default_kinds.is_empty() && !optional
    }

    /// Name of one of its stages in messages and random streams: `render`, `place.objects`, `write.png`.
    pub fn stage_name(self, id: &str) -> String {
        match self.shape() {
            Shape::One => self.name().to_owned(),
            Shape::List | Shape::Keyed => format!("{self}.{id}"),
        }
    }

    /// Header of the table of one of its stages in a recipe: `[render]`, `[[place]]`, `[write.png]`.
    pub fn header(self, id: &str) -> String {
        match self.shape() {
            Shape::One => format!("[{self}]"),
            Shape::List => format!("[[{self}]]"),
            Shape::Keyed => format!("[{self}.{id}]"),
        }
    }
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Stage {
    /// The stage as a run uses it: a writer of images becomes a writer of scenes.
    pub fn of_scenes(self) -> Self {
        match self {
            Self::Write(writer) => Self::WriteScenes(writer.of_scenes()),
            other => other,
        }
    }
}

/// A stage trait and the slot that its stages take.
pub trait InSlot {
    /// The slot.
    const SLOT: Slot;
    /// Erases the trait.
    fn into_stage(self: Box<Self>) -> Stage;
}

/// A spanned value of a recipe, as the TOML parser gives it.
pub type RecipeValue<'a> = SpannedValue<'a>;

/// A stage, and its options with every default filled in.
pub struct Constructed {
    /// The stage.
    pub stage: Stage,
    /// The options, without `kind`.
    pub options: toml::Table,
}

/// Why a stage could not be constructed from a table.
#[derive(Debug)]
pub enum ConstructError {
    /// The table does not have the form of the options; the error carries its span.
    Form(toml::de::Error),
    /// The options are refused.
    Invalid(ConfigError),
}

/// One registered kind of stage.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The slot that it takes.
    pub slot: Slot,
    /// Its name in recipes.
    pub kind: &'static str,
    /// Crate that registered it.
    pub crate_name: &'static str,
    /// Version of that crate.
    pub crate_version: &'static str,
    /// Body of a table with its usual options.
    pub example: &'static str,
    /// Options that had another name: (old, new).
    pub renamed: &'static [(&'static str, &'static str)],
    /// Chooses the kind that replaces it on this machine; see [`Config::CHOOSE`].
    pub choose: Option<Choose>,
    factory: Factory,
}

/// Builds stages of one kind. A program that adds a kind at run time implements it for a value with state of its own.
pub trait StageFactory: Send + Sync {
    /// JSON Schema of the options, without `kind`. A kind without options has none, by default.
    fn schema(&self, generator: &mut SchemaGenerator) -> Schema {
        NoOptions::json_schema(generator)
    }
    /// Builds a stage from its options, which the schema accepts.
    ///
    /// # Errors
    /// If the options do not have the form that the factory reads, or contradict each other.
    fn construct(&self, options: RecipeValue<'_>) -> Result<Constructed, ConstructError>;
}

/// Options of a kind that has none.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct NoOptions {}

/// How an entry builds its stages.
#[derive(Clone)]
enum Factory {
    /// Functions of a crate, which are known when the program is built.
    Linked {
        schema: fn(&mut SchemaGenerator) -> Schema,
        construct: fn(RecipeValue<'_>) -> Result<Constructed, ConstructError>,
    },
    /// A value of the program.
    Added(Arc<dyn StageFactory>),
}

impl fmt::Debug for Factory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linked { .. } => "Linked",
            Self::Added(_) => "Added",
        })
    }
}

/// A factory of stages without options: a function that captures what it needs.
struct Plain<F>(F);

impl<F: Fn() -> Stage + Send + Sync> StageFactory for Plain<F> {
    fn construct(&self, options: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        NoOptions::deserialize(toml::de::ValueDeserializer::from(options)).map_err(ConstructError::Form)?;
        Ok(Constructed { stage: (self.0)(), options: toml::Table::new() })
    }
}

/// Names of crates whose kinds a program ships with. If several kinds provide a product, the resolver takes the kind of
/// these crates, so that a recipe means the same whether a further crate is linked or not. A crate that links all of
/// them registers the list.
pub struct StockCrates(pub &'static [&'static str]);

inventory::collect!(StockCrates);

impl Entry {
    /// The entry of a configuration type; used by [`register!`](crate::register).
    pub const fn of<C: Config>(crate_name: &'static str, crate_version: &'static str) -> Self {
        Self {
            slot: <C::Stage as InSlot>::SLOT,
            kind: C::KIND,
            crate_name,
            crate_version,
            example: C::EXAMPLE,
            renamed: C::RENAMED,
            choose: C::CHOOSE,
            factory: Factory::Linked { schema: C::json_schema, construct: construct::<C> },
        }
    }

    /// A kind that a program adds at run time. Messages name `owner` where they name the crate of other kinds.
    pub fn added(slot: Slot, kind: &str, owner: &str, factory: Arc<dyn StageFactory>) -> Self {
        Self {
            slot,
            kind: intern(kind),
            crate_name: intern(owner),
            crate_version: env!("CARGO_PKG_VERSION"),
            example: "",
            renamed: &[],
            choose: None,
            factory: Factory::Added(factory),
        }
    }

    /// A kind without options that a program adds at run time: `make` builds its stage, and may capture state.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use syntable_model::prelude::*;
    /// use syntable_model::registry::{Entry, Registry, Slot};
    ///
    /// const COUNT: Key<Value> = Key::view("view_count", "Number of views so far.");
    ///
    /// struct Count(Arc<std::sync::atomic::AtomicU32>);
    ///
    /// impl ImageAnnotator for Count {
    ///     fn reads(&self) -> Vec<KeyId> {
    ///         vec![]
    ///     }
    ///     fn provides(&self) -> Vec<KeyId> {
    ///         vec![COUNT.id()]
    ///     }
    ///     fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
    ///         products.put(COUNT, Value::from(self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed)))
    ///     }
    /// }
    ///
    /// let views = Arc::default();
    /// let entry = Entry::plain("count", "my program", move || Box::new(Count(Arc::clone(&views))) as Box<dyn ImageAnnotator>);
    /// let registry = Registry::default().with(entry).expect("no other kind has the name");
    /// assert!(registry.find(Slot::Annotate, "count").is_some());
    /// ```
    pub fn plain<S: InSlot + ?Sized + 'static>(
        kind: &str,
        owner: &str,
        make: impl Fn() -> Box<S> + Send + Sync + 'static,
    ) -> Self {
        Self::added(S::SLOT, kind, owner, Arc::new(Plain(move || make().into_stage())))
    }

    /// JSON Schema of the options, without `kind`; types that it names are added to the generator's definitions.
    pub fn schema(&self, generator: &mut SchemaGenerator) -> Schema {
        match &self.factory {
            Factory::Linked { schema, .. } => schema(generator),
            Factory::Added(factory) => factory.schema(generator),
        }
    }

    /// Builds the stage from a table without `kind`. Refuses what the schema refuses.
    pub fn construct(&self, table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        check_schema(self, &table).map_err(ConstructError::Invalid)?;
        self.construct_validated(table)
    }

    /// Builds the stage from a table without `kind` that was found valid against the schema already.
    pub fn construct_validated(&self, table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        match &self.factory {
            Factory::Linked { construct, .. } => construct(table),
            Factory::Added(factory) => factory.construct(table),
        }
    }

    /// Builds the stage from TOML text, for tests and defaults.
    pub fn construct_str(&self, text: &str) -> Result<Constructed, ConstructError> {
        let table = toml::de::DeTable::parse(text).map_err(ConstructError::Form)?;
        let span = table.span();
        self.construct(toml::Spanned::new(span, toml::de::DeValue::Table(table.into_inner())))
    }
}

/// Refuses a table that the schema of a kind refuses, naming the first mistake.
fn check_schema(entry: &Entry, table: &RecipeValue) -> Result<(), ConfigError> {
    let kind = entry.kind;
    let mut builder = SchemaBuilder::default();
    let schema = builder.add(|generator| entry.schema(generator));
    let definitions = builder.definitions();
    if let Some(fault) = unsupported(&schema, &definitions).into_iter().next() {
        return Err(ConfigError::new("", format!("the schema of `{kind}` has {fault}")));
    }
    let DeValue::Table(members) = table.get_ref() else {
        return Err(ConfigError::new("", format!("`{kind}` must be a table")));
    };
    let outcome = Validator { definitions: &definitions }.table(kind, spanned_members(members), table.span(), &schema);
    outcome.findings.into_iter().next().map_or(Ok(()), |finding| Err(finding.into()))
}

fn construct<C: Config>(table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
    let config = C::deserialize(toml::de::ValueDeserializer::from(table)).map_err(ConstructError::Form)?;
    let options = toml::Table::try_from(&config).map_err(|error| {
        ConstructError::Invalid(ConfigError::new("", format!("the options cannot be written back: {error}")))
    })?;
    let stage = config.build().map_err(ConstructError::Invalid)?.into_stage();
    Ok(Constructed { stage, options })
}

inventory::collect!(Linked<Entry>);

/// All that crates add to a program: kinds of stages, checks of labels, and formats of datasets.
#[derive(Clone, Default)]
pub struct Registry {
    entries: Vec<Entry>,
    checks: Vec<Arc<dyn LabelCheck>>,
    formats: Vec<Arc<dyn DatasetFormat>>,
    stock: BTreeSet<&'static str>,
}

impl Registry {
    /// Everything registered by crates that are linked into this program and named in its source.
    ///
    /// # Errors
    /// If two crates register one name.
    pub fn linked() -> Result<Self, String> {
        let stock = inventory::iter::<StockCrates>.into_iter().flat_map(|crates| crates.0).copied();
        Self::new(Linked::<Entry>::rows().cloned())?
            .with_stock(stock)
            .with_checks(inventory::iter::<Check>.into_iter().map(|check| Arc::new(*check) as _))?
            .with_formats(Linked::<Format>::rows().map(|format| Arc::new(*format) as _))
    }

    /// A registry of some kinds, without checks and formats.
    ///
    /// # Errors
    /// If two crates register one kind of a slot.
    pub fn new(entries: impl IntoIterator<Item = Entry>) -> Result<Self, String> {
        let mut entries: Vec<Entry> = entries.into_iter().collect();
        entries.sort_by_key(|entry| (entry.slot, entry.kind));
        for pair in entries.windows(2) {
            if (pair[0].slot, pair[0].kind) == (pair[1].slot, pair[1].kind) {
                return Err(format!(
                    "two crates register `{}` for `{}`: {} and {}; link one of them only",
                    pair[0].kind, pair[0].slot, pair[0].crate_name, pair[1].crate_name
                ));
            }
        }
        Ok(Self { entries, ..Self::default() })
    }

    /// The same registry with one more kind.
    ///
    /// # Errors
    /// If it has the kind already.
    pub fn with(self, entry: Entry) -> Result<Self, String> {
        let entries = self.entries.into_iter().chain([entry]);
        Ok(Self { entries: Self::new(entries)?.entries, ..Self { entries: Vec::new(), ..self } })
    }

    /// The same registry, with names of crates that the program ships with.
    pub fn with_stock(mut self, crates: impl IntoIterator<Item = &'static str>) -> Self {
        self.stock.extend(crates);
        self
    }

    /// Whether a kind belongs to a crate that the program ships with, by the whole name of the crate.
    pub fn is_stock(&self, entry: &Entry) -> bool {
        self.stock.contains(entry.crate_name)
    }

    /// The same registry with more checks.
    ///
    /// # Errors
    /// If two checks have one name.
    pub fn with_checks(mut self, checks: impl IntoIterator<Item = Arc<dyn LabelCheck>>) -> Result<Self, String> {
        self.checks.extend(checks);
        self.checks.sort_by_key(|check| check.name());
        match self.checks.windows(2).find(|pair| pair[0].name() == pair[1].name()) {
            Some(pair) => Err(format!("two crates register the check `{}`; link one of them only", pair[0].name())),
            None => Ok(self),
        }
    }

    /// The same registry with more formats.
    ///
    /// # Errors
    /// If two formats have one name.
    pub fn with_formats(mut self, formats: impl IntoIterator<Item = Arc<dyn DatasetFormat>>) -> Result<Self, String> {
        self.formats.extend(formats);
        self.formats.sort_by_key(|format| format.name());
        match self.formats.windows(2).find(|pair| pair[0].name() == pair[1].name()) {
            Some(pair) => Err(format!(
                "two crates register the format `{}`: {} and {}; link one of them only",
                pair[0].name(),
                pair[0].owner(),
                pair[1].owner()
            )),
            None => Ok(self),
        }
    }

    /// All checks of labels, by name.
    pub fn checks(&self) -> &[Arc<dyn LabelCheck>] {
        &self.checks
    }

    /// All formats of datasets that can be read, by name.
    pub fn formats(&self) -> &[Arc<dyn DatasetFormat>] {
        &self.formats
    }

    /// All entries, sorted by slot and kind.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The entries of a slot, sorted by kind.
    pub fn of_slot(&self, slot: Slot) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.slot == slot)
    }

    /// The entry of a kind.
    pub fn find(&self, slot: Slot, kind: &str) -> Option<&Entry> {
        self.of_slot(slot).find(|entry| entry.kind == kind)
    }
}

/// Implements [`Config`](crate::registry::Config) for options that are the stage itself and need no check beyond their
/// schema: the type, the trait of the stage, the kind, and the usual options if it has any.
///
/// ```
/// use syntable_model::prelude::*;
///
/// /// Gives every view a number.
/// #[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields, default)]
/// struct Numbers {
///     /// The number of the first view.
///     first: u32,
/// }
///
/// config!(Numbers => dyn ImageAnnotator, "numbers", "first = 1");
/// # impl ImageAnnotator for Numbers {
/// #     fn reads(&self) -> Vec<KeyId> { vec![] }
/// #     fn provides(&self) -> Vec<KeyId> { vec![] }
/// #     fn annotate(&self, _: &ImageContext, _: &mut Products) -> Result<()> { Ok(()) }
/// # }
/// assert_eq!(Numbers::KIND, "numbers");
/// ```
#[macro_export]
macro_rules! config {
    ($config:ty => $stage:ty, $kind:literal) => {
        $crate::config!($config => $stage, $kind, "");
    };
    ($config:ty => $stage:ty, $kind:literal, $example:expr $(,)?) => {
        impl $crate::registry::Config for $config {
            type Stage = $stage;
            const KIND: &'static str = $kind;
            const EXAMPLE: &'static str = $example;
            fn build(self) -> ::std::result::Result<Box<$stage>, $crate::error::ConfigError> {
                Ok(Box::new(self))
            }
        }
    };
}

/// Registers configuration types, so that recipes can name their kinds.
///
/// A crate is linked only if the program names it: `use my_plugin as _;` in its `main.rs`.
#[macro_export]
macro_rules! register {
    ($($config:ty),+ $(,)?) => {$(
        $crate::link!($crate::registry::Entry::of::<$config>(env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")));
    )+};
}
