//! Procedural surfaces and prints, baked to textures.
//!
//! A [`Bake`] holds color, roughness and height on a grid that tiles; it becomes a material of two textures: color with
//! roughness in the alpha channel, and a normal map; clearcoat and sheen are added on top. A [`MaterialCanvas`] is a
//! print: an image drawn from shapes.
//!
//! **Invariants.** All random draws come from the given stream, so equal streams give equal bytes. Colors are chosen
//! and mixed in sRGB, the stored encoding.

mod built;
mod cache;
mod canvas;
mod color;
mod family;
mod field;
mod layers;
mod made;
mod natural;
mod photograph;
mod print;
mod textile;
mod worktop;
mod woven;

pub use cache::MaterialCache;
pub use canvas::{MaterialCanvas, PrintFinish};
pub use color::{SrgbColor, hsv, linear, mix, palette, shade, vivid};
pub use family::{MaterialFamily, Surface};
pub use field::ScalarField;
pub use photograph::Photograph;
pub use print::{
    LabelKind, PrintedSheet, UvRect, WallArt, WrapKind, ball, bands, book, carton, clock_face, label, leaf, magazine,
    notes, outdoors, remote, screen_image, scribbles, skin, wall_art, wrapped,
};

use std::sync::Arc;
use syntable_model::digest::Hasher;
use syntable_model::scene::{Color, Encoding, Material, NormalMap, Scalar, Texture, Wrap};

/// License of all procedural assets.
pub const LICENSE: &str = "CC0-1.0";

/// A texture of RGBA texels, row 0 at the top.
pub fn texture(width: usize, height: usize, texels: Vec<u8>, encoding: Encoding, wrap: Wrap) -> Arc<Texture> {
    let digest = Hasher::new("procedural texture")
        .number(width as f64)
        .number(height as f64)
        .text(match encoding {
            Encoding::Srgb => "srgb",
            Encoding::Linear => "linear",
        })
        .text(match wrap {
            Wrap::Repeat => "repeat",
            Wrap::Mirror => "mirror",
            Wrap::Clamp => "clamp",
        })
        .bytes(&texels)
        .finish();
    Arc::new(Texture { width: width as u32, height: height as u32, texels, encoding, wrap: [wrap; 2], digest })
}

/// A surface on a square grid that tiles.
pub struct Bake {
    /// Color, sRGB in [0, 1], row 0 at the top.
    pub color: Vec<SrgbColor>,
    /// Perceptual roughness.
    pub roughness: ScalarField,
    /// Height, in texels. Only its slope matters.
    pub height: ScalarField,
    /// 0 or 1.
    pub metallic: f32,
    /// Edge of one tile, meters.
    pub tile_m: f32,
}

impl Bake {
    /// Bakes the textures.
    pub fn material(self, name: &str) -> Material {
        let n = self.height.size();
        let mut texels = Vec::with_capacity(4 * n * n);
        for (color, roughness) in self.color.iter().zip(self.roughness.values()) {
            texels.extend(color.map(byte));
            texels.push(byte(*roughness));
        }
        let color = texture(n, n, texels, Encoding::Srgb, Wrap::Repeat);
        let normal = texture(n, n, self.height.normal_map(), Encoding::Linear, Wrap::Repeat);
        SurfaceFinish {
            base_color: Color::texture(color.clone()),
            roughness: Scalar::texture(color, 3),
            metallic: self.metallic,
            normal: Some(NormalMap { map: normal.into(), strength: 1.0 }),
            tile_m: self.tile_m,
            ior: 1.5,
            clearcoat: None,
        }
        .named(name)
    }
}

/// The parts of a material that procedural surfaces set.
pub struct SurfaceFinish {
    /// Color.
    pub base_color: Color,
    /// Perceptual roughness.
    pub roughness: Scalar,
    /// 0 or 1.
    pub metallic: f32,
    /// Normal map.
    pub normal: Option<NormalMap>,
    /// Edge of one tile, meters.
    pub tile_m: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Roughness of a clearcoat; `None` without one.
    pub clearcoat: Option<f64>,
}

impl SurfaceFinish {
    /// A constant color, sRGB.
    pub fn plain(color: SrgbColor, roughness: f64, metallic: f32) -> Self {
        Self {
            base_color: Color::constant(linear(color)),
            roughness: Scalar::constant(roughness as f32),
            metallic,
            normal: None,
            tile_m: 1.0,
            ior: 1.5,
            clearcoat: None,
        }
    }

    /// A print.
    pub fn printed(texture: Arc<Texture>, roughness: f64) -> Self {
        Self { base_color: Color::texture(texture), ..Self::plain([1.0; 3], roughness, 0.0) }
    }

    /// Adds a glaze of some roughness.
    pub fn glazed(self, roughness: f64) -> Self {
        Self { clearcoat: Some(roughness), ..self }
    }

    /// Takes the normal map of another material.
    pub fn detailed(mut self, detail: &Material) -> Self {
        self.normal = detail.normal.clone();
        self
    }

    /// The material.
    pub fn named(self, name: &str) -> Material {
        let mut material = Material {
            base_color: self.base_color,
            roughness: self.roughness,
            metallic: Scalar::constant(self.metallic),
            normal: self.normal,
            ior: self.ior,
            tile_m: self.tile_m,
            license: LICENSE.to_owned(),
            ..Material::plain(name, [1.0; 3], 1.0)
        };
        if let Some(roughness) = self.clearcoat {
            layers::add_clearcoat(&mut material, roughness, true);
        }
        material.with_digest()
    }
}

/// Quantizes [0, 1] to a byte.
fn byte(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
