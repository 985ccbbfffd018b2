//! What is odd about a scene: nothing to see, no light, no labels.

use super::journal::Notice;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::product::Products;
use syntable_model::product::standard::{RADIANCE, RGB, VISIBLE_MASK};
use syntable_model::scene::{Body, Material, Scene, View};

/// What the views of a scene showed so far.
#[derive(Debug, Default)]
pub struct Seen {
    /// Number of views with an image, and those whose image is black.
    images: usize,
    black: Vec<u32>,
    /// Number of views with masks, and those in which no mask has a pixel.
    masks: usize,
    unlabeled: Vec<u32>,
    /// Whether a view has a light.
    lights: bool,
}

/// What is odd about a scene.
#[derive(Debug, Default)]
pub struct Odd {
    /// About the scene as a whole.
    pub scene: BTreeSet<Notice>,
    /// About some of its views: their numbers, ascending.
    pub views: BTreeMap<Notice, Vec<u32>>,
}

impl Seen {
    /// Looks at a view. Views come in order.
    pub fn look(&mut self, view: &View, products: &Products) {
        self.lights |= !view.lights.is_empty();
        let image = match (products.get(RGB), products.get(RADIANCE)) {
            (Ok(image), _) => Some(image.data().iter().all(|pixel| *pixel == [0; 3])),
            (_, Ok(image)) => Some(image.data().iter().all(|pixel| *pixel == [0.0; 3])),
            _ => None,
        };
        if let Some(black) = image {
            self.images += 1;
            self.black.extend(black.then_some(view.id.0));
        }
        if let Ok(masks) = products.get(VISIBLE_MASK) {
            self.masks += 1;
            self.unlabeled.extend(masks.iter().all(|(_, mask)| mask.area() == 0).then_some(view.id.0));
        }
    }

    /// What is odd.
    pub fn odd(self, scene: &Scene) -> Odd {
        let mut odd = Odd::default();
        if self.images > 0 && !self.lights && !scene.bodies().iter().any(emits) {
            odd.scene.insert(Notice::Unlit);
        }
        let all = [(self.images, self.black, Notice::Black), (self.masks, self.unlabeled, Notice::Unlabeled)];
        for (looked, views, notice) in all {
            if !views.is_empty() && views.len() == looked {
                odd.scene.insert(notice);
            } else if !views.is_empty() {
                odd.views.insert(notice, views);
            }
        }
        odd
    }
}

fn emits(body: &Body) -> bool {
    let emissive = |material: &Material| material.emission.factor.iter().any(|&x| x > 0.0);
    match &body.material_override {
        Some(other) => emissive(&other.material),
        None => body.object.materials.iter().any(|material| emissive(material)),
    }
}
