//! How stages become known: a plugin registers each of its configuration types.
//!
//! [`register!`](crate::register) submits a constant [`Entry`] at link time; [`Registry::linked`] collects, sorts and
//! checks them. Every function of the program takes `&Registry`, so that tests can build theirs by hand.

use crate::error::Invalid;
use crate::product::KeyId;
use crate::product::standard::{DENOISER, RADIANCE_NOISY};
use crate::stage::{
    Annotator, AssetSource, CameraModel, Denoiser, LightSampler, Placer, Renderer, Sensor, Settler, ViewSampler, Writer,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;

/// The options of one kind of stage, as a recipe gives them.
///
/// The type's doc comment describes the kind, the fields' doc comments describe the options, schemars attributes such
/// as `range` state limits: help, JSON Schema, range checks and the reference in the book all come from there.
pub trait Config: Serialize + DeserializeOwned + JsonSchema {
    /// The trait of the stage that it builds, such as `dyn Annotator`.
    type Stage: ?Sized + InSlot;
    /// The kind's name in recipes: a snake_case noun.
    const KIND: &'static str;
    /// Body of a recipe table with this kind's usual options, valid TOML, for help and tests.
    const EXAMPLE: &'static str;
    /// Options that had another name, as (old, new) paths such as `("clamp_nits", "max_indirect_luminance")`. A recipe
    /// that uses the old name gets an error that names the new one.
    const RENAMED: &'static [(&'static str, &'static str)] = &[];
    /// Sets options that were left out and whose defaults depend on others, and drops those that others override. The
    /// resolved recipe shows the result.
    fn completed(self) -> Self {
        self
    }
    /// Builds the stage. Checks what ranges cannot say. Does no input or output, so that `check` is quick.
    fn build(self) -> Result<Box<Self::Stage>, Invalid>;
}

/// The places in the pipeline that a stage can take; named as in recipes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Slot {
    /// `[assets.<pool>]`
    Assets,
    /// `[[place]]`
    Place,
    /// `[settle]`
    Settle,
    /// `[camera]`
    Camera,
    /// `[views]`
    Views,
    /// `[[lights]]`
    Lights,
    /// `[render]`
    Render,
    /// `[denoise]`
    Denoise,
    /// `[sensor.<id>]`
    Sensor,
    /// `[annotate.<id>]`
    Annotate,
    /// `[write.<id>]`
    Write,
}

/// How often a slot occurs in a recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// One table.
    One,
    /// An array of tables, in order.
    List,
    /// Tables by id; the id is the kind unless `kind` says otherwise.
    Keyed,
}

impl Slot {
    /// All slots, in pipeline order.
    pub const ALL: [Self; 11] = [
        Self::Assets,
        Self::Place,
        Self::Settle,
        Self::Camera,
        Self::Views,
        Self::Lights,
        Self::Render,
        Self::Denoise,
        Self::Sensor,
        Self::Annotate,
        Self::Write,
    ];

    /// Its key in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Assets => "assets",
            Self::Place => "place",
            Self::Settle => "settle",
            Self::Camera => "camera",
            Self::Views => "views",
            Self::Lights => "lights",
            Self::Render => "render",
            Self::Denoise => "denoise",
            Self::Sensor => "sensor",
            Self::Annotate => "annotate",
            Self::Write => "write",
        }
    }

    /// What its stages do.
    pub fn doc(self) -> &'static str {
        match self {
            Self::Assets => "Pools of objects, materials and environment maps, drawn from by name.",
            Self::Place => "Puts bodies into the scene; steps run in order.",
            Self::Settle => "Lets the bodies come to rest.",
            Self::Camera => "Intrinsics, lens and exposure.",
            Self::Views => "Where the camera stands, anew for every view.",
            Self::Lights => "Lights, anew for every view or once for all views of a scene.",
            Self::Render => "Makes pictures and per-pixel labels.",
            Self::Denoise => "Takes sampling noise out of pictures; left out, nothing is denoised.",
            Self::Sensor => {
                "Makes what a real camera would give of a perfect picture; a table is needed only to set options."
            }
            Self::Annotate => "Makes annotations; a table is needed only to set options.",
            Self::Write => "Writes files; what a writer includes is what gets computed.",
        }
    }

    /// How often it occurs.
    pub fn shape(self) -> Shape {
        match self {
            Self::Assets | Self::Sensor | Self::Annotate | Self::Write => Shape::Keyed,
            Self::Place | Self::Lights => Shape::List,
            Self::Settle | Self::Camera | Self::Views | Self::Render | Self::Denoise => Shape::One,
        }
    }
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A stage of any slot.
pub enum Stage {
    /// Of `[assets.<pool>]`.
    Assets(Box<dyn AssetSource>),
    /// Of `[[place]]`.
    Place(Box<dyn Placer>),
    /// Of `[settle]`.
    Settle(Box<dyn Settler>),
    /// Of `[camera]`.
    Camera(Box<dyn CameraModel>),
    /// Of `[views]`.
    Views(Box<dyn ViewSampler>),
    /// Of `[[lights]]`.
    Lights(Box<dyn LightSampler>),
    /// Of `[render]`.
    Render(Box<dyn Renderer>),
    /// Of `[denoise]`.
    Denoise(Box<dyn Denoiser>),
    /// Of `[sensor.<id>]`.
    Sensor(Box<dyn Sensor>),
    /// Of `[annotate.<id>]`.
    Annotate(Box<dyn Annotator>),
    /// Of `[write.<id>]`.
    Write(Box<dyn Writer>),
}

impl Stage {
    /// The products that it can make, if it makes products.
    pub fn provides(&self) -> Vec<KeyId> {
        match self {
            Self::Render(renderer) => renderer.offers(),
            Self::Denoise(_) => vec![RADIANCE_NOISY.id(), DENOISER.id()],
            Self::Sensor(sensor) => sensor.provides(),
            Self::Annotate(annotator) => annotator.provides(),
            _ => Vec::new(),
        }
    }
}

/// A stage trait and the slot that its stages take.
pub trait InSlot {
    /// The slot.
    const SLOT: Slot;
    /// Forgets the trait.
    fn into_stage(self: Box<Self>) -> Stage;
}

macro_rules! in_slot {
    ($($stage:ident => $slot:ident),* $(,)?) => {$(
        impl InSlot for dyn $stage {
            const SLOT: Slot = Slot::$slot;
            fn into_stage(self: Box<Self>) -> Stage {
                Stage::$slot(self)
            }
        }
    )*};
}
in_slot! {
    AssetSource => Assets, Placer => Place, Settler => Settle, CameraModel => Camera, ViewSampler => Views,
    LightSampler => Lights, Renderer => Render, Denoiser => Denoise, Sensor => Sensor, Annotator => Annotate,
    Writer => Write,
}

/// A spanned value of a recipe, as the TOML parser gives it.
pub type RecipeValue<'a> = toml::Spanned<toml::de::DeValue<'a>>;

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
    Invalid(Invalid),
}

/// One registered kind of stage.
#[derive(Debug, Clone, Copy)]
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
    schema: fn(&mut SchemaGenerator) -> Schema,
    construct: fn(RecipeValue<'_>) -> Result<Constructed, ConstructError>,
}

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
            schema: C::json_schema,
            construct: construct::<C>,
        }
    }

    /// JSON Schema of the options, without `kind`; types that it names are added to the generator's definitions.
    pub fn schema(&self, generator: &mut SchemaGenerator) -> Schema {
        (self.schema)(generator)
    }

    /// Builds the stage from a table without `kind`. Refuses what the schema refuses.
    pub fn construct(&self, table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        crate::options::check(self.kind, self.schema, &table).map_err(ConstructError::Invalid)?;
        self.construct_validated(table)
    }

    /// Builds the stage from a table without `kind` that was found valid against the schema already.
    pub fn construct_validated(&self, table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        (self.construct)(table)
    }

    /// Builds the stage from TOML text, for tests and defaults.
    pub fn construct_str(&self, text: &str) -> Result<Constructed, ConstructError> {
        let table = toml::de::DeTable::parse(text).map_err(ConstructError::Form)?;
        let span = table.span();
        self.construct(toml::Spanned::new(span, toml::de::DeValue::Table(table.into_inner())))
    }
}

fn construct<C: Config>(table: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
    let config = C::deserialize(toml::de::ValueDeserializer::from(table)).map_err(ConstructError::Form)?.completed();
    let options = toml::Table::try_from(&config).map_err(|error| {
        ConstructError::Invalid(Invalid::new("", format!("the options cannot be written back: {error}")))
    })?;
    let stage = config.build().map_err(ConstructError::Invalid)?.into_stage();
    Ok(Constructed { stage, options })
}

inventory::collect!(Entry);

/// All kinds of stages that a program knows.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    entries: Vec<Entry>,
}

impl Registry {
    /// The kinds of all crates that are linked into this program and named in its source.
    pub fn linked() -> Result<Self, String> {
        Self::new(inventory::iter::<Entry>.into_iter().copied())
    }

    /// A registry of some entries. Two of one slot and kind are an error that names both crates.
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
        Ok(Self { entries })
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

/// Registers configuration types, so that recipes can name their kinds.
///
/// A crate is linked only if the program names it: `use my_plugin as _;` in its `main.rs`.
#[macro_export]
macro_rules! register {
    ($($config:ty),+ $(,)?) => {$(
        $crate::inventory::submit! {
            $crate::registry::Entry::of::<$config>(env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))
        }
    )+};
}
