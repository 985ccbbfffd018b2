//! The families of household objects: one function per family, from random streams to a solid with materials and mass.

mod bags;
mod cutlery;
mod flat;
mod folded;
mod food;
mod glass;
mod home;
mod packaging;
mod tools;
mod vessel;

pub(crate) use bags::Crumple;

use crate::material::{MaterialCache, MaterialFamily, Photograph, PrintedSheet, SrgbColor, SurfaceFinish, hsv};
use crate::shape::SolidShape;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Material, Texture};

/// A family of household objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectFamily {
    /// Apples.
    Apple,
    /// Carrier bags of paper or film, standing, crumpled.
    Bag,
    /// Play balls.
    Ball,
    /// Bananas.
    Banana,
    /// Wooden toy blocks: cubes, bars, cylinders, prisms, stars, arches.
    Block,
    /// Closed books, lying.
    Book,
    /// Bottles of drink, sauce or soap; some of glass.
    Bottle,
    /// Bowls.
    Bowl,
    /// Cartons with printed sides.
    Box,
    /// Tins and drink cans.
    Can,
    /// Drink cartons with a gable top.
    Carton,
    /// Cups without a handle.
    Cup,
    /// Table forks.
    Fork,
    /// Drinking glasses: tumblers and wine glasses.
    Glass,
    /// Hammers.
    Hammer,
    /// Jars with a lid.
    Jar,
    /// Table knives.
    Knife,
    /// Magazines, lying.
    Magazine,
    /// Felt-tip markers.
    Marker,
    /// Mugs with a handle.
    Mug,
    /// Cardboard boxes with open flaps.
    OpenBox,
    /// Frying pans.
    Pan,
    /// Plates.
    Plate,
    /// Pouches of film with sealed ends, standing or pillow-shaped.
    Pouch,
    /// Remote controls.
    Remote,
    /// Screwdrivers.
    Screwdriver,
    /// Kitchen sponges.
    Sponge,
    /// Table spoons and tea spoons.
    Spoon,
    /// Rolls of adhesive tape.
    Tape,
    /// Towels and cloths, folded or crumpled.
    Towel,
    /// Tubes of paste or cream.
    Tube,
    /// Open-end wrenches.
    Wrench,
}

impl ObjectFamily {
    /// All families, sorted by name.
    pub const ALL: [Self; 32] = [
        Self::Apple,
        Self::Bag,
        Self::Ball,
        Self::Banana,
        Self::Block,
        Self::Book,
        Self::Bottle,
        Self::Bowl,
        Self::Box,
        Self::Can,
        Self::Carton,
        Self::Cup,
        Self::Fork,
        Self::Glass,
        Self::Hammer,
        Self::Jar,
        Self::Knife,
        Self::Magazine,
        Self::Marker,
        Self::Mug,
        Self::OpenBox,
        Self::Pan,
        Self::Plate,
        Self::Pouch,
        Self::Remote,
        Self::Screwdriver,
        Self::Sponge,
        Self::Spoon,
        Self::Tape,
        Self::Towel,
        Self::Tube,
        Self::Wrench,
    ];

    /// Name of the family in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Apple => "apple",
            Self::Bag => "bag",
            Self::Ball => "ball",
            Self::Banana => "banana",
            Self::Block => "block",
            Self::Book => "book",
            Self::Bottle => "bottle",
            Self::Bowl => "bowl",
            Self::Box => "box",
            Self::Can => "can",
            Self::Carton => "carton",
            Self::Cup => "cup",
            Self::Fork => "fork",
            Self::Glass => "glass",
            Self::Hammer => "hammer",
            Self::Jar => "jar",
            Self::Knife => "knife",
            Self::Magazine => "magazine",
            Self::Marker => "marker",
            Self::Mug => "mug",
            Self::OpenBox => "open_box",
            Self::Pan => "pan",
            Self::Plate => "plate",
            Self::Pouch => "pouch",
            Self::Remote => "remote",
            Self::Screwdriver => "screwdriver",
            Self::Sponge => "sponge",
            Self::Spoon => "spoon",
            Self::Tape => "tape",
            Self::Towel => "towel",
            Self::Tube => "tube",
            Self::Wrench => "wrench",
        }
    }

    /// Models one variant. Prints show crops of the photographs, or illustrations without any.
    pub fn model(self, stream: &Stream, materials: &MaterialCache, photographs: &[Photograph]) -> HouseholdModel {
        let (form, appearance) = (stream.child("form"), stream.child("paint"));
        let draw = &mut FamilyContext { form, appearance, materials, photographs };
        match self {
            Self::Apple => food::apple(draw),
            Self::Bag => bags::carrier_bag(draw),
            Self::Ball => home::ball(draw),
            Self::Banana => food::banana(draw),
            Self::Block => home::block(draw),
            Self::Book => home::book(draw),
            Self::Bottle => packaging::bottle(draw),
            Self::Bowl => vessel::bowl(draw),
            Self::Box => packaging::carton(draw),
            Self::Can => packaging::can(draw),
            Self::Carton => folded::drink_carton(draw),
            Self::Cup => vessel::cup(draw),
            Self::Fork => cutlery::fork(draw),
            Self::Glass => glass::drinking_glass(draw),
            Self::Hammer => tools::hammer(draw),
            Self::Jar => packaging::jar(draw),
            Self::Knife => cutlery::knife(draw),
            Self::Magazine => flat::magazine(draw),
            Self::Marker => tools::marker(draw),
            Self::Mug => vessel::mug(draw),
            Self::OpenBox => folded::open_box(draw),
            Self::Pan => vessel::pan(draw),
            Self::Plate => vessel::plate(draw),
            Self::Pouch => bags::pouch(draw),
            Self::Remote => home::remote(draw),
            Self::Screwdriver => tools::screwdriver(draw),
            Self::Sponge => home::sponge(draw),
            Self::Spoon => cutlery::spoon(draw),
            Self::Tape => tools::tape(draw),
            Self::Towel => flat::towel(draw),
            Self::Tube => packaging::tube(draw),
            Self::Wrench => tools::wrench(draw),
        }
    }
}

/// A modeled object.
pub struct HouseholdModel {
    /// Its solid, upright, z up.
    pub shape: SolidShape,
    /// Materials by slot.
    pub materials: Vec<Arc<Material>>,
    /// Mass, kg, spread over the closed surfaces of the shape in proportion to their volumes and densities.
    pub mass_kg: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Maximum angle between faces with smooth normals, degrees.
    pub crease_deg: f64,
}

impl HouseholdModel {
    fn new(shape: SolidShape, materials: Vec<Arc<Material>>, mass_kg: f64) -> Self {
        Self { shape, materials, mass_kg, friction: 0.5, crease_deg: 38.0 }
    }

    fn friction(self, friction: f64) -> Self {
        Self { friction, ..self }
    }
}

/// The random streams and materials that a family draws from.
struct FamilyContext<'a> {
    /// Sizes and shapes.
    form: Stream,
    /// Colors and prints.
    appearance: Stream,
    materials: &'a MaterialCache,
    photographs: &'a [Photograph],
}

impl FamilyContext<'_> {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.form.uniform(low, high)
    }

    /// A random variant, one of six, of a material family.
    fn material(&mut self, family: MaterialFamily) -> Arc<Material> {
        let variant = self.appearance.below(6) as u32;
        self.materials.get(family, variant)
    }

    fn metal(&mut self) -> Arc<Material> {
        let family = if self.appearance.chance(0.5) { MaterialFamily::Metal } else { MaterialFamily::BrushedMetal };
        self.material(family)
    }

    /// Steel or silver, polished.
    fn polished(&mut self, name: &str) -> Arc<Material> {
        let tone = self.appearance.uniform(0.7, 0.92);
        let gloss = self.appearance.uniform(0.08, 0.3);
        Arc::new(SurfaceFinish::plain(hsv(0.12, self.appearance.uniform(0.0, 0.06), tone), gloss, 1.0).named(name))
    }

    /// Plastic of a color.
    fn plastic_of(&mut self, name: &str, color: SrgbColor) -> Arc<Material> {
        let detail = self.material(MaterialFamily::Plastic);
        Arc::new(SurfaceFinish::plain(color, self.appearance.uniform(0.2, 0.55), 0.0).detailed(&detail).named(name))
    }

    fn printed(&mut self, texture: Arc<Texture>, gloss: [f64; 2]) -> Arc<Material> {
        Arc::new(SurfaceFinish::printed(texture, self.appearance.uniform(gloss[0], gloss[1])).named("print"))
    }

    /// A print with its own relief; a third of them have a clearcoat.
    fn sheet(&mut self, sheet: &PrintedSheet) -> Arc<Material> {
        let coat = self.appearance.chance(0.33).then(|| self.appearance.uniform(0.06, 0.25));
        Arc::new(sheet.material("print", coat))
    }

    fn plain(&mut self, name: &str, color: SrgbColor, roughness: f64) -> Arc<Material> {
        Arc::new(SurfaceFinish::plain(color, roughness, 0.0).named(name))
    }
}

/// Densities, kg/m³.
mod density {
    pub const STEEL: f64 = 7850.0;
    pub const CERAMIC: f64 = 2350.0;
    pub const GLASS: f64 = 2500.0;
    pub const PLASTIC: f64 = 1050.0;
    pub const RUBBER: f64 = 1150.0;
    pub const WOOD: f64 = 680.0;
    pub const PAPER: f64 = 750.0;
}

/// An ellipse of `n` points, counter-clockwise, for sections.
fn ellipse(a: f64, b: f64, n: usize) -> Vec<[f64; 2]> {
    (0..n)
        .map(|i| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
            [a * cos, b * sin]
        })
        .collect()
}
