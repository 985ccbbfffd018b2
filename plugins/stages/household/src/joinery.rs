//! Furniture under construction: boards and other solids with the materials of one piece.

use crate::family::HouseholdModel;
use crate::material::{MaterialCache, MaterialFamily, SurfaceFinish, hsv, vivid};
use crate::shape::{SlotMapping, SolidShape, rounded_box};
use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::scene::Material;

/// Texels along the edge of the surfaces of furniture.
pub const TEXELS: usize = 512;

/// Material slot of tops, boards and belts.
pub const TOP: u16 = 0;

/// Material slot of frames.
pub const FRAME: u16 = 1;

/// Material slot of small parts.
pub const TRIM: u16 = 2;

/// A piece of furniture under construction.
pub struct Joinery {
    /// Random numbers of the form.
    pub form: Stream,
    materials: Vec<Arc<Material>>,
    shape: SolidShape,
    /// Radius of the edges of boards of the slot [`TOP`], meters.
    top_round_m: f64,
}

impl Joinery {
    /// A piece with materials drawn from families: of its top, and of its frame. With some probability, both are the same.
    pub fn new(
        stream: &Stream,
        materials: &MaterialCache,
        tops: &[MaterialFamily],
        frames: &[MaterialFamily],
        same: f64,
    ) -> Self {
        let mut appearance = stream.child("paint");
        let mut surface = |families: &[MaterialFamily]| {
            let family = *appearance.pick(families).unwrap_or(&MaterialFamily::Timber);
            materials.get(family, appearance.below(4) as u32)
        };
        let top = surface(tops);
        let frame = surface(frames);
        let frame = if appearance.chance(same) { top.clone() } else { frame };
        let color =
            if appearance.chance(0.7) { hsv(0.0, 0.0, appearance.uniform(0.05, 0.9)) } else { vivid(&mut appearance) };
        let trim = Arc::new(SurfaceFinish::plain(color, 0.35, 0.0).named("trim"));
        let materials = vec![top, frame, trim];
        Self { form: stream.child("form"), materials, shape: SolidShape::default(), top_round_m: 0.004 }
    }

    /// The same with other edges of its top boards.
    pub fn with_top_round(self, top_round_m: f64) -> Self {
        Self { top_round_m, ..self }
    }

    /// Replaces the material of a slot.
    pub fn set_material(&mut self, slot: u16, material: Material) {
        self.materials[usize::from(slot)] = Arc::new(material);
    }

    /// Draws a length of the form.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.form.uniform(low, high)
    }

    /// A board between two corners, its edges a little round.
    pub fn board(&mut self, slot: u16, low: [f64; 3], high: [f64; 3]) {
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let center: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let round: f64 = if slot == TOP { self.top_round_m } else { 0.0025 };
        let thin = size.into_iter().fold(f64::INFINITY, f64::min);
        let board = rounded_box(size, round.min(0.3 * thin), 2, |_| SlotMapping::fit(slot));
        self.join(slot, board.translated(center[0], center[1], center[2]));
    }

    /// Four upright legs at the corners of a rectangle of half sizes.
    pub fn legs(&mut self, slot: u16, [a, b]: [f64; 2], edge: f64, height: f64) {
        for (x, y) in [(-a, -b), (a, -b), (a, b), (-a, b)] {
            self.board(slot, [x - edge / 2.0, y - edge / 2.0, 0.0], [x + edge / 2.0, y + edge / 2.0, height]);
        }
    }

    /// Adds a solid; its texture is scaled in meters, along its longest edge.
    pub fn join(&mut self, slot: u16, solid: SolidShape) {
        let tile = self.materials[usize::from(slot)].tile_m;
        let size = solid.bounds().size();
        let density = if self.materials[usize::from(slot)].metallic.factor > 0.5 { 1600.0 } else { 680.0 };
        let solid = solid.dense(density).box_mapped(f64::from(tile), size.iamax());
        self.shape = std::mem::take(&mut self.shape).and(solid);
    }

    /// The finished piece, with a friction coefficient.
    pub fn finish(self, friction: f64) -> HouseholdModel {
        let mass_kg = self.shape.moments().total;
        HouseholdModel { shape: self.shape, materials: self.materials, mass_kg, friction, crease_deg: 38.0 }
    }
}
