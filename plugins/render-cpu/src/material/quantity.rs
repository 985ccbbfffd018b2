//! What a material says of itself at a point: colours, numbers and bumps, each a factor times a texture.

use super::mapping::{Coordinates, Laid};
use crate::cache::SceneCache;
use crate::vec3::Rgb;
use syntable_model::scene;

/// A colour: factor times texture.
#[derive(Debug)]
pub(super) struct Tint {
    pub factor: Rgb,
    pub texture: Option<Laid>,
}

/// A number: factor times a channel of a texture.
#[derive(Debug)]
pub(super) struct Number {
    pub factor: f32,
    pub texture: Option<(Laid, u8)>,
}

/// A normal map and its strength.
#[derive(Debug)]
pub(super) struct Bumps(pub Laid, pub f32);

/// A number in [0, 1]; NaN counts as 0.
pub(super) fn share(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

impl Tint {
    #[inline(always)]
    pub fn at(&self, at: Coordinates) -> Rgb {
        match &self.texture {
            Some(texture) => self.factor * texture.color(at),
            None => self.factor,
        }
    }
}

impl Number {
    #[inline(always)]
    pub fn at(&self, at: Coordinates) -> f32 {
        match &self.texture {
            Some((texture, channel)) => self.factor * texture.channel(at, *channel),
            None => self.factor,
        }
    }
}

/// Lays textures on a body.
pub(super) struct Layer<'a>(pub &'a SceneCache);

impl Layer<'_> {
    pub fn tint(&self, color: &scene::Color) -> Tint {
        let texture = color.texture.as_ref().map(|used| Laid::new(used, self.0));
        Tint { factor: Rgb::from(color.factor.map(share)), texture }
    }

    pub fn number(&self, scalar: &scene::Scalar) -> Number {
        let texture = scalar.texture.as_ref().map(|(used, channel)| (Laid::new(used, self.0), *channel));
        Number { factor: share(scalar.factor), texture }
    }

    pub fn bumps(&self, normal: &Option<scene::NormalMap>) -> Option<Bumps> {
        let normal = normal.as_ref()?;
        let strength = if normal.strength.is_finite() { normal.strength } else { 1.0 };
        Some(Bumps(Laid::new(&normal.map, self.0), strength))
    }
}
