//! Signs of a mistake in a scene: images that are black or white, no light, no labels.

use crate::run::dataset::journal::Notice;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::product::Products;
use syntable_model::product::standard::{RADIANCE, RGB, VISIBLE_MASK};
use syntable_model::scene::{Body, Material, Role, Scene, View};

/// At most one pixel in this number is darker than white in an overexposed image. Noise leaves single darker pixels.
const DARKER: usize = 100;

/// Looks for anomalies in the views of a scene.
#[derive(Debug, Default)]
pub struct AnomalyScan {
    /// Number of views with an image, and the numbers of views with a black or white image.
    images: usize,
    black: Vec<u32>,
    white: Vec<u32>,
    /// Number of views with masks, and the numbers of views whose masks are all empty.
    masks: usize,
    unlabeled: Vec<u32>,
    /// Whether a view has a light.
    lights: bool,
    /// Places of the cameras.
    cameras: Vec<Point3<f64>>,
}

/// The anomalies of a scene.
#[derive(Debug, Default)]
pub struct Anomalies {
    /// Anomalies of the scene as a whole.
    pub scene: BTreeSet<Notice>,
    /// Anomalies of some views, with the numbers of these views, ascending.
    pub views: BTreeMap<Notice, Vec<u32>>,
    /// All anomalies that the scan could have found.
    pub looked_at: BTreeSet<Notice>,
}

impl AnomalyScan {
    /// Looks at a view. Views come in order.
    pub fn look(&mut self, view: &View, products: &Products) {
        self.lights |= !view.lights.is_empty();
        self.cameras.push(view.camera.world_from_camera.translation.vector.into());
        let image = match (products.get(RGB), products.get(RADIANCE)) {
            (Ok(image), _) => {
                // Both stop as soon as the answer is known.
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

    /// The anomalies of the scene with these views.
    pub fn anomalies(self, scene: &Scene) -> Anomalies {
        let mut odd = Anomalies::default();
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
        odd.looked_at.extend(odd.looked_at.first().map(|_| Notice::Outside));
        let is_dark = [Notice::Black, Notice::Unlabeled].iter().any(|notice| odd.scene.contains(notice));
        if is_dark && self.cameras.iter().all(|camera| is_outside(scene, camera)) {
            odd.scene.insert(Notice::Outside);
        }
        odd
    }
}

/// Thickness from which a room is more than a floor, meters.
const ROOM_M: f64 = 0.5;

/// Whether a scene has a room, and a camera is not in it.
fn is_outside(scene: &Scene, camera: &Point3<f64>) -> bool {
    let parts = scene.bodies().iter().filter(|body| body.role == Role::Room);
    let room = parts.fold(Aabb::empty(), |room, part| room.union(part.world_bounds()));
    !room.is_empty()
        && room.max.z - room.min.z > ROOM_M
        && (0..3).any(|axis| camera[axis] < room.min[axis] || camera[axis] > room.max[axis])
}

fn emits(body: &Body) -> bool {
    let emissive = |material: &Material| material.emission.factor.iter().any(|&x| x > 0.0);
    body.own_materials().iter().any(|material| emissive(material))
}
