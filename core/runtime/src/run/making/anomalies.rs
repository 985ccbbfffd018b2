//! What is odd about a scene: nothing to see, no light, no labels.

use crate::run::dataset::journal::Notice;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::product::Products;
use syntable_model::product::standard::{RADIANCE, RGB, VISIBLE_MASK};
use syntable_model::scene::{Body, Material, Scene, View};

/// Of an overexposed image at most one pixel in as many is darker than white: noise leaves single ones.
const DARKER: usize = 100;

/// What the views of a scene showed so far.
#[derive(Debug, Default)]
pub struct Seen {
    /// Number of views with an image, and those whose image is black or white.
    images: usize,
    black: Vec<u32>,
    white: Vec<u32>,
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
    /// What was looked at, odd or not.
    pub looked_at: BTreeSet<Notice>,
}

impl Seen {
    /// Looks at a view. Views come in order.
    pub fn look(&mut self, view: &View, products: &Products) {
        self.lights |= !view.lights.is_empty();
        let image = match (products.get(RGB), products.get(RADIANCE)) {
            (Ok(image), _) => {
                // Both end where the answer is known, which in most images is at once.
                let mut darker = image.data().iter().filter(|pixel| **pixel != [255; 3]);
                let black = image.data().iter().all(|pixel| *pixel == [0; 3]);
                Some([black, darker.nth(image.data().len() / DARKER).is_none()])
            }
            // Radiance has no white.
            (_, Ok(image)) => Some([image.data().iter().all(|pixel| *pixel == [0.0; 3]), false]),
            _ => None,
        };
        if let Some([black, white]) = image {
            self.images += 1;
            self.black.extend(black.then_some(view.id.0));
            self.white.extend(white.then_some(view.id.0));
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
        let all = [
            (self.images, self.black, Notice::Black),
            (self.images, self.white, Notice::White),
            (self.masks, self.unlabeled, Notice::Unlabeled),
        ];
        for (looked, views, notice) in all {
            odd.looked_at.extend((looked > 0).then_some(notice));
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
