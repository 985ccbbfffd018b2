//! Surface materials after glTF 2.0's metallic-roughness model (appendix B) and its ratified extensions, as plain data.
//!
//! Every quantity is a constant factor times an optional texture, as in glTF.

use super::{ColorMatrix, Finish, Texture, TextureRef, UvTransform};
use crate::digest::{Digest, Hasher};
use std::sync::Arc;

/// A color: factor times texture. Linear Rec. 709 in [0, 1].
#[derive(Debug, Clone)]
pub struct Color {
    /// Linear factor.
    pub factor: [f32; 3],
    /// Multiplied in after decoding.
    pub texture: Option<TextureRef>,
}

impl Color {
    /// The same color everywhere.
    pub fn constant(factor: [f32; 3]) -> Self {
        Self { factor, texture: None }
    }

    /// An image.
    pub fn texture(texture: Arc<Texture>) -> Self {
        Self { factor: [1.0; 3], texture: Some(texture.into()) }
    }
}

/// A number in [0, 1]: factor times one channel of a texture.
#[derive(Debug, Clone)]
pub struct Scalar {
    /// Factor.
    pub factor: f32,
    /// Texture and the channel to read: 0 red … 3 alpha.
    pub texture: Option<(TextureRef, u8)>,
}

impl Scalar {
    /// The same number everywhere.
    pub fn constant(factor: f32) -> Self {
        Self { factor, texture: None }
    }

    /// One channel of an image.
    pub fn texture(texture: Arc<Texture>, channel: u8) -> Self {
        Self { factor: 1.0, texture: Some((texture.into(), channel)) }
    }
}

/// A tangent-space normal map in the OpenGL convention: green points along +v.
#[derive(Debug, Clone)]
pub struct NormalMap {
    /// The map; linear.
    pub map: TextureRef,
    /// Factor on the x and y components.
    pub strength: f32,
}

/// How alpha, from the base color's texture, is understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Alpha {
    /// Ignored.
    Opaque,
    /// Below the cutoff, the surface does not exist, for images and for labels alike.
    Mask {
        /// Cutoff in [0, 1].
        cutoff: f32,
    },
    /// The surface covers this fraction of the background: light hits it with this probability. A label needs a surface
    /// that either exists or not: an option of the renderer decides by the texture's alpha or by the coverage.
    Blend {
        /// Multiplies the texture's alpha.
        factor: f32,
    },
}

/// A clear dielectric layer of index 1.5 over everything else (KHR_materials_clearcoat).
#[derive(Debug, Clone)]
pub struct Clearcoat {
    /// Fraction of the surface that the clearcoat covers.
    pub strength: Scalar,
    /// Perceptual roughness of the clearcoat.
    pub roughness: Scalar,
    /// Surface detail of the clearcoat; without it, the clearcoat is smooth whatever is below.
    pub normal: Option<NormalMap>,
}

/// Retroreflection of cloth at grazing angles (KHR_materials_sheen).
#[derive(Debug, Clone)]
pub struct Sheen {
    /// Reflectance at grazing angles.
    pub color: Color,
    /// Perceptual roughness; the lower, the narrower the rim.
    pub roughness: Scalar,
}

/// Light that passes the surface rather than being scattered below it (KHR_materials_transmission).
#[derive(Debug, Clone)]
pub struct Transmission {
    /// Fraction of the light entering the surface that is transmitted, tinted by the base color.
    pub fraction: Scalar,
    /// The medium inside the body. Without it, the surface is a thin sheet: light passes straight through.
    pub volume: Option<Volume>,
}

/// A clear medium that fills a closed mesh (KHR_materials_volume); light is refracted by the material's index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Fraction of light left after [`attenuation_distance_m`](Self::attenuation_distance_m), linear Rec. 709.
    pub attenuation_color: [f32; 3],
    /// Distance after which light has that color, meters; infinite for a clear medium.
    pub attenuation_distance_m: f32,
}

/// A surface material. Surfaces are two-sided.
#[derive(Debug, Clone)]
pub struct Material {
    /// Name within its source.
    pub name: String,
    /// Base color: diffuse albedo of a dielectric, reflectance of a metal at normal incidence.
    pub base_color: Color,
    /// Changes the base color after its texture and the vertex color. Sources leave it out.
    pub recolor: Option<ColorMatrix>,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: Scalar,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: Scalar,
    /// Surface detail.
    pub normal: Option<NormalMap>,
    /// Emitted radiance, nits; the factor may exceed one.
    pub emission: Color,
    /// Index of refraction of the dielectric; 1.5 reflects 4 % at normal incidence.
    pub ior: f32,
    /// Cut-outs.
    pub alpha: Alpha,
    /// Clear layer on top, if any.
    pub clearcoat: Option<Clearcoat>,
    /// Cloth-like retroreflection, if any.
    pub sheen: Option<Sheen>,
    /// Glass and the like.
    pub transmission: Option<Transmission>,
    /// Makes the surface show the environment of the view instead of its base color, projected from a point this high
    /// above the world's origin, meters: where nothing is in the way of the light, its radiance is the environment's in
    /// the direction from that point. Base color where a view has no environment.
    pub projection_height_m: Option<f32>,
    /// Edge length of one tile of the textures when they are laid by meters rather than by uv, meters.
    pub tile_m: f32,
    /// License as an SPDX expression or name; empty if unknown.
    pub license: String,
    /// Digest of everything above except name and license.
    pub digest: Digest,
}

impl Material {
    /// A dielectric of one color.
    pub fn plain(name: impl Into<String>, color: [f32; 3], roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color: Color::constant(color),
            recolor: None,
            roughness: Scalar::constant(roughness),
            metallic: Scalar::constant(0.0),
            normal: None,
            emission: Color::constant([0.0; 3]),
            ior: 1.5,
            alpha: Alpha::Opaque,
            clearcoat: None,
            sheen: None,
            transmission: None,
            projection_height_m: None,
            tile_m: 1.0,
            license: String::new(),
            digest: Digest::of(&[]),
        }
        .with_digest()
    }
}

impl Material {
    /// The material of an object that is made larger by a factor.
    ///
    /// Light travels through the larger object on paths that are longer by that factor. The distance after which a
    /// medium has its color grows by the same factor, so a large bottle looks like a small one. In glTF this distance
    /// is a length in the world, which no node scales; but a scaled object changes the unit of a file's whole world.
    pub fn enlarged(self: Arc<Self>, factor: f64) -> Arc<Self> {
        let medium = self.transmission.as_ref().and_then(|transmission| transmission.volume);
        if factor == 1.0 || medium.is_none_or(|medium| medium.attenuation_distance_m.is_infinite()) {
            return self;
        }
        let mut material = Arc::unwrap_or_clone(self);
        if let Some(medium) = material.transmission.as_mut().and_then(|transmission| transmission.volume.as_mut()) {
            medium.attenuation_distance_m = (f64::from(medium.attenuation_distance_m) * factor) as f32;
        }
        Arc::new(material.with_digest())
    }

    /// The material with its base color changed. A color that is the same everywhere is replaced: no texture and, on the body at
    /// hand, no vertex color varies it. The images of a texture are shared.
    pub fn recolored(self: Arc<Self>, matrix: ColorMatrix, has_vertex_colors: bool) -> Arc<Self> {
        let mut material = Arc::unwrap_or_clone(self);
        if material.base_color.texture.is_some() || has_vertex_colors {
            material.recolor = Some(matrix);
        } else {
            let unit = |x: f32| if x > 0.0 { x.min(1.0) } else { 0.0 };
            material.base_color.factor = matrix.apply(material.base_color.factor.map(unit));
        }
        Arc::new(material.with_digest())
    }

    /// The material with another finish.
    pub fn finished(self: Arc<Self>, finish: &Finish) -> Arc<Self> {
        let mut material = Arc::unwrap_or_clone(self);
        let constant = |number: f64| Scalar::constant(number as f32);
        if let Some(roughness) = finish.roughness {
            material.roughness = constant(roughness);
        }
        if let Some(metallic) = finish.metallic {
            material.metallic = constant(metallic);
        }
        if let Some(ior) = finish.ior().filter(|_| material.transmission.is_none()) {
            material.ior = ior as f32;
        }
        Arc::new(material.with_digest())
    }

    /// The same with its digest set from everything but name and license.
    pub fn with_digest(mut self) -> Self {
        let color = |hasher: Hasher, color: &Color| {
            hash_texture(hasher.floats(color.factor.into_iter()), color.texture.as_ref().map(|texture| (texture, 0)))
        };
        let scalar = |hasher: Hasher, scalar: &Scalar| {
            let texture = scalar.texture.as_ref().map(|(texture, channel)| (texture, *channel));
            hash_texture(hasher.number(scalar.factor.into()), texture)
        };
        let normal = |hasher: Hasher, normal: &Option<NormalMap>| match normal {
            Some(normal) => hash_texture(hasher.number(normal.strength.into()), Some((&normal.map, 0))),
            None => hasher.text("even"),
        };
        let mut hasher = color(Hasher::new("material"), &self.base_color);
        hasher = scalar(hasher, &self.roughness);
        hasher = scalar(hasher, &self.metallic);
        hasher = normal(hasher, &self.normal);
        hasher = color(hasher, &self.emission).number(self.ior.into()).number(self.tile_m.into());
        hasher = match self.alpha {
            Alpha::Opaque => hasher.text("opaque"),
            Alpha::Mask { cutoff } => hasher.text("mask").number(cutoff.into()),
            Alpha::Blend { factor } => hasher.text("blend").number(factor.into()),
        };
        if let Some(coat) = &self.clearcoat {
            hasher = scalar(scalar(hasher.text("clearcoat"), &coat.strength), &coat.roughness);
            hasher = normal(hasher, &coat.normal);
        }
        if let Some(sheen) = &self.sheen {
            hasher = scalar(color(hasher.text("sheen"), &sheen.color), &sheen.roughness);
        }
        if let Some(transmission) = &self.transmission {
            hasher = scalar(hasher.text("transmission"), &transmission.fraction);
            if let Some(volume) = transmission.volume {
                hasher = hasher.text("volume").floats(volume.attenuation_color.into_iter());
                hasher = hasher.number(volume.attenuation_distance_m.into());
            }
        }
        if let Some(ColorMatrix(rows)) = &self.recolor {
            hasher = hasher.text("recolor").floats(rows.as_flattened().iter().copied());
        }
        if let Some(height) = self.projection_height_m {
            hasher = hasher.text("projection").number(height.into());
        }
        self.digest = hasher.finish();
        self
    }

    /// All textures that it uses, some perhaps more than once.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        fn of_scalar(scalar: &Scalar) -> Option<&TextureRef> {
            scalar.texture.as_ref().map(|(texture, _)| texture)
        }
        let coat = self.clearcoat.as_ref();
        let coat_normal = coat.and_then(|coat| coat.normal.as_ref());
        let sheen = self.sheen.as_ref();
        [
            self.base_color.texture.as_ref(),
            of_scalar(&self.roughness),
            of_scalar(&self.metallic),
            self.normal.as_ref().map(|normal| &normal.map),
            self.emission.texture.as_ref(),
            coat.and_then(|coat| of_scalar(&coat.strength)),
            coat.and_then(|coat| of_scalar(&coat.roughness)),
            coat_normal.map(|normal| &normal.map),
            sheen.and_then(|sheen| sheen.color.texture.as_ref()),
            sheen.and_then(|sheen| of_scalar(&sheen.roughness)),
            self.transmission.as_ref().and_then(|transmission| of_scalar(&transmission.fraction)),
        ]
        .into_iter()
        .flatten()
    }
}

/// Adds a texture and its mapping.
fn hash_texture(hasher: Hasher, used: Option<(&TextureRef, u8)>) -> Hasher {
    let Some((TextureRef { texture, transform }, channel)) = used else { return hasher.text("constant") };
    let ([a, b], [c, d]) = (transform.scale, transform.offset);
    hasher.digest(texture.digest).bytes(&[channel]).floats([a, b, transform.rotation, c, d].into_iter())
}

/// A material that replaces a body's own.
#[derive(Debug, Clone)]
pub struct MaterialOverride {
    /// The material.
    pub material: Arc<Material>,
    /// How its textures are mapped.
    pub mapping: TextureMapping,
}

/// How textures are mapped onto a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TextureMapping {
    /// By the mesh's texture coordinates, moved first.
    Uv(UvTransform),
    /// By the body's own axes: each face takes the two axes at right angles to its dominant normal axis, scaled by
    /// the material's [`tile_m`](Material::tile_m) and rotated.
    Box {
        /// Rotation of the texture, radians.
        rotation: f32,
        /// Shift in tiles.
        offset: [f32; 2],
    },
}
