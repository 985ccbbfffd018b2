//! A furnishing under construction.

use super::solids::{bar, boxed, rounded};
use super::tones;
use crate::family::HouseholdModel;
use crate::material::{MaterialCache, MaterialFamily, Photograph, PrintedSheet, SrgbColor, SurfaceFinish, linear};
use crate::shape::{SlotMapping, SolidShape, rounded_box};
use std::sync::Arc;
use syntable_model::geometry::Point3;
use syntable_model::random::Stream;
use syntable_model::scene::{Color, Material, Region, Sheen, SupportArea, Texture};

/// Variants of each material family that furnishings choose from.
const SURFACES: u64 = 6;

/// A furnishing under construction: its solids, its materials, and where it carries objects.
pub struct Piece<'a> {
    /// Random numbers of the form.
    pub form: Stream,
    /// Random numbers of colors and prints.
    pub paint: Stream,
    /// Photographs that wall art and screens show; none without a folder.
    pub photographs: &'a [Photograph],
    cache: &'a MaterialCache,
    materials: Vec<Arc<Material>>,
    shape: SolidShape,
    areas: Vec<SupportArea>,
}

impl<'a> Piece<'a> {
    /// An empty furnishing.
    pub fn new(stream: &Stream, cache: &'a MaterialCache, photographs: &'a [Photograph]) -> Self {
        Self {
            form: stream.child("form"),
            paint: stream.child("paint"),
            photographs,
            cache,
            materials: Vec::new(),
            shape: SolidShape::default(),
            areas: Vec::new(),
        }
    }

    /// Draws a length of the form.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.form.uniform(low, high)
    }

    /// Adds a material and returns its slot.
    pub fn add(&mut self, material: impl Into<Arc<Material>>) -> u16 {
        self.materials.push(material.into());
        (self.materials.len() - 1) as u16
    }

    fn cached(&mut self, family: MaterialFamily) -> Arc<Material> {
        self.cache.get(family, self.paint.below(SURFACES) as u32)
    }

    /// Adds a material of one of some families.
    pub fn surface(&mut self, families: &[MaterialFamily]) -> u16 {
        let family = self.paint.pick(families).copied().unwrap_or(MaterialFamily::Plastic);
        let material = self.cached(family);
        self.add(material)
    }

    /// Adds a material of one color with the relief of a family.
    pub fn tinted(&mut self, family: MaterialFamily, color: SrgbColor, roughness: f64) -> u16 {
        let detail = self.cached(family);
        let mut finish = SurfaceFinish::plain(color, roughness, 0.0).detailed(&detail);
        finish.tile_m = detail.tile_m;
        self.add(finish.named(family.name()))
    }

    /// Adds a smooth material of one color.
    pub fn plain(&mut self, name: &str, color: SrgbColor, roughness: f64) -> u16 {
        self.add(SurfaceFinish::plain(color, roughness, 0.0).named(name))
    }

    /// Adds a metal: steel, brass, black or white paint.
    pub fn metal(&mut self) -> u16 {
        let roughness = self.paint.uniform(0.12, 0.45);
        let (color, metallic) = tones::metal(&mut self.paint);
        self.add(SurfaceFinish::plain(color, roughness, metallic).named("metal"))
    }

    /// Adds a cloth: of one color with a weave, or a patterned one.
    pub fn cloth(&mut self) -> u16 {
        use MaterialFamily::{Fabric, Knit, Velvet};
        if self.paint.chance(0.2) {
            return self.surface(&[Fabric, Fabric, Velvet, Knit]);
        }
        let color = tones::cloth(&mut self.paint);
        self.cloth_of(color, &[Fabric, Fabric, Velvet, Knit])
    }

    /// Adds a cloth of a color with the weave of one of some families.
    pub fn cloth_of(&mut self, color: SrgbColor, families: &[MaterialFamily]) -> u16 {
        let family = self.paint.pick(families).copied().unwrap_or(MaterialFamily::Fabric);
        let detail = self.cached(family);
        let mut finish = SurfaceFinish::plain(color, self.paint.uniform(0.8, 1.0), 0.0).detailed(&detail);
        finish.tile_m = detail.tile_m;
        let mut material = finish.named("cloth");
        let strength = self.paint.uniform(0.1, 0.4) as f32;
        let tint = linear(color).map(|channel| (0.5 + 0.5 * channel) * strength);
        material.sheen = Some(Sheen {
            color: Color::constant(tint),
            roughness: syntable_model::scene::Scalar::constant(self.paint.uniform(0.35, 0.7) as f32),
        });
        self.add(material.with_digest())
    }

    /// Adds wood: grained, or painted.
    pub fn wood(&mut self, painted: f64) -> u16 {
        if !self.paint.chance(painted) {
            return self.surface(&[MaterialFamily::Timber]);
        }
        let color = tones::paint(&mut self.paint);
        let roughness = self.paint.uniform(0.3, 0.65);
        self.tinted(MaterialFamily::PaintedWall, color, roughness)
    }

    /// Adds a print that shows its sheet once.
    pub fn print(&mut self, sheet: &PrintedSheet, coat: Option<f64>) -> u16 {
        self.add(sheet.material("print", coat))
    }

    /// Adds an image that shows once, of some roughness.
    pub fn image(&mut self, texture: Arc<Texture>, roughness: f64) -> u16 {
        self.add(SurfaceFinish::printed(texture, roughness).named("print"))
    }

    /// Adds a surface that emits light: a color or a texture, and its radiance in nits at white.
    pub fn emissive(&mut self, base: SrgbColor, roughness: f64, light: Color) -> u16 {
        let mut material = SurfaceFinish::plain(base, roughness, 0.0).named("light");
        material.emission = light;
        self.add(material.with_digest())
    }

    /// Makes the material of a slot emit light too.
    pub fn lit(&mut self, slot: u16, light: Color) -> u16 {
        let mut material = Material::clone(&self.materials[usize::from(slot)]);
        material.emission = light;
        self.materials[usize::from(slot)] = Arc::new(material.with_digest());
        slot
    }

    /// Adds a solid with the texture in meters along its longest edge.
    pub fn join(&mut self, slot: u16, solid: SolidShape) {
        let (tile, grain) = (f64::from(self.materials[usize::from(slot)].tile_m), solid.bounds().size().iamax());
        self.keep(solid.box_mapped(tile, grain));
    }

    /// Adds a solid with its own texture coordinates. Its slots are the furnishing's.
    pub fn keep(&mut self, solid: SolidShape) {
        self.shape = std::mem::take(&mut self.shape).and(solid);
    }

    /// A board between two corners, its edges a little round.
    pub fn board(&mut self, slot: u16, low: [f64; 3], high: [f64; 3]) {
        self.block(slot, low, high, 0.0025);
    }

    /// A block between two corners with edges of some radius.
    pub fn block(&mut self, slot: u16, low: [f64; 3], high: [f64; 3], round: f64) {
        let block = rounded(low, high, round, |_| SlotMapping::fit(slot));
        self.join(slot, block);
    }

    /// A sheet or plate that shows a print on its front; its other sides have another material.
    pub fn panel(&mut self, [front, rest]: [u16; 2], low: [f64; 3], high: [f64; 3]) {
        let side = |side| if side == 2 { SlotMapping::fit(front) } else { SlotMapping::tile(rest, 0.5) };
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let round = (0.2 * size[1]).min(0.002);
        self.keep(rounded_box(size, round, 1, side).translated(middle[0], middle[1], middle[2]));
    }

    /// A round bar between two points.
    pub fn bar(&mut self, slot: u16, from: [f64; 3], to: [f64; 3], radii: [f64; 2]) {
        self.join(slot, bar(SlotMapping::fit(slot), Point3::from(from), Point3::from(to), radii));
    }

    /// Adds many small solids that share one box as their collision part.
    pub fn cluster(&mut self, solid: SolidShape) {
        self.keep(boxed(solid));
    }

    /// Adds what a function adds, turned about z and then moved.
    pub fn placed(&mut self, at: [f64; 3], yaw_deg: f64, add: impl FnOnce(&mut Self)) {
        let before = std::mem::take(&mut self.shape);
        add(self);
        let added = std::mem::take(&mut self.shape).rotated(2, yaw_deg).translated(at[0], at[1], at[2]);
        self.shape = before.and(added);
    }

    /// Objects may lie on a rectangle of half extents around a point.
    pub fn carries(&mut self, center: [f64; 3], half: [f64; 2]) {
        let surface = Region::rectangle(center, half.map(|x| 2.0 * x));
        self.areas.push(SupportArea { surface, clear_height_m: None, walls: None });
    }

    /// The edge of one tile of a material, meters.
    pub fn tile_m(&self, slot: u16) -> f64 {
        f64::from(self.materials[usize::from(slot)].tile_m)
    }

    /// The finished furnishing.
    pub fn finish(self) -> (HouseholdModel, Vec<SupportArea>) {
        // Furnishings are hollow or soft: a tenth of the mass of solid wood.
        let mass_kg = 60.0 * self.shape.moments().total;
        let Self { shape, materials, areas, .. } = self;
        (HouseholdModel { shape, materials, mass_kg, friction: 0.5, crease_deg: 38.0 }, areas)
    }
}
