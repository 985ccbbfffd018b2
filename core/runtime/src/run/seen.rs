//! What is odd about a scene: nothing to see, no light, no labels.

use super::journal::Notice;
use std::collections::BTreeSet;
use syntable_model::product::Products;
use syntable_model::product::standard::{RADIANCE, RGB, VISIBLE_MASK};
use syntable_model::scene::{Body, Material, Scene, View};

/// What the views of a scene showed so far.
#[derive(Debug, Default)]
pub struct Seen {
    /// Whether an image was made, and whether any pixel of one is not black.
    image: bool,
    bright: bool,
    /// Whether masks were made, and whether any has a pixel.
    masks: bool,
    label: bool,
    /// Whether a view has a light.
    lights: bool,
}

impl Seen {
    /// Looks at a view.
    pub fn look(&mut self, view: &View, products: &Products) {
        self.lights |= !view.lights.is_empty();
        if let Ok(image) = products.get(RGB) {
            self.image = true;
            self.bright = self.bright || image.data().iter().any(|pixel| *pixel != [0; 3]);
        } else if let Ok(image) = products.get(RADIANCE) {
            self.image = true;
            self.bright = self.bright || image.data().iter().any(|pixel| *pixel != [0.0; 3]);
        }
        if let Ok(masks) = products.get(VISIBLE_MASK) {
            self.masks = true;
            self.label = self.label || masks.iter().any(|(_, mask)| mask.area() > 0);
        }
    }

    /// What is odd.
    pub fn notices(&self, scene: &Scene) -> BTreeSet<Notice> {
        let unlit = self.image && !self.lights && !scene.bodies().iter().any(emits);
        let all = [
            (self.image && !self.bright, Notice::Black),
            (unlit, Notice::Unlit),
            (self.masks && !self.label, Notice::Unlabeled),
        ];
        all.into_iter().filter(|(is, _)| *is).map(|(_, notice)| notice).collect()
    }
}

fn emits(body: &Body) -> bool {
    let emissive = |material: &Material| material.emission.factor.iter().any(|&x| x > 0.0);
    match &body.material_override {
        Some(other) => emissive(&other.material),
        None => body.object.materials.iter().any(|material| emissive(material)),
    }
}
