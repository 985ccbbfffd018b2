//! Relations between the bodies of a scene: contact, support, containment.

mod contact;
mod force;
mod inside;
pub mod solid;
mod support;

use crate::hull_cache::HullCache;
use crate::options::{Collision, Rapier};
use contact::Contact;
use force::{Forces, Moving};
use solid::Solid;
use support::SupportRelation;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CONTACTS, INSIDE, REMOVAL_ORDER, SUPPORT_GRAPH};

/// Contacts, support, containers and a safe order of removal, from the poses of the rendered scene, whether it settled
/// now, in an earlier run, or not at all. Shapes are the shapes of the simulation. Ids are the ids of `instance`; 0 is
/// the ground, the level z = 0, where a body touches it and no floor.
///
/// Forces are forces at the first instant: bodies at rest under gravity (9.81 m/s²) with Coulomb friction and without
/// adhesion, where no body moves into another. A body that these forces do not hold has an `acceleration_m_s2`. If a
/// body has more contact points than equilibrium determines, such as a chair with four legs, the distribution of force
/// is one of many solutions.
///
/// `contacts` lists pairs of bodies, at least one of them movable, whose shapes are at most `margin_m` apart. Each pair
/// has `ids`, the lower one first; `gap_m`, negative for overlaps; `normal_world` from the first to the second body,
/// the mean over the points; `force_world_n`, the force of the first on the second body; and `points`, at most four per
/// pair of convex parts, each with `point_world_m`, `normal_world`, `gap_m` and `force_world_n`.
///
/// `support_graph` follows from these forces. An edge from `supporter` to `supported` means that the force between them
/// has an upward part, `force_n`, of at least 1 % of the weight of the supported body; `share` is the ratio of this
/// part to the weight, above 1 if the body carries others. `roots` are the fixed bodies that carry a body, `cycles`
/// sets of bodies that carry each other, `floating` the bodies without support, and `moving` the bodies that would
/// start to move, with their acceleration: of the center of mass or of the farthest corner, whichever is larger, above
/// 0.5 m/s².
///
/// `inside` lists objects: at least half of the volume of object `id`, `fraction`, is within the convex hull of a
/// `container` that carries it, directly or through others. A spoon in a mug is listed, a book on a box is not.
///
/// `removal_order` has an `order` of all objects and distractors, in which no body is removed while it carries a
/// remaining one. If several bodies can go, the highest goes first, by the center of its box, then the lowest id. In a
/// cycle, the body goes that carries the fewest remaining ones; `forced` lists these bodies with the bodies that they
/// `carry` then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Relations {
    /// Maximum distance of two touching shapes, meters.
    #[schemars(range(min = 0.0, max = 0.02))]
    margin_m: f64,
    /// Collision shape of objects and supports. Should equal the option of `settle`.
    collision: Collision,
    /// Maximum distance of convex parts from the mesh in its hollows, meters. Should equal the option of `settle`.
    #[schemars(range(min = 0.001, max = 1.0))]
    max_deviation_m: f64,
}

impl Default for Relations {
    fn default() -> Self {
        let Rapier { collision, max_deviation_m, .. } = Rapier::default();
        Self { margin_m: 0.001, collision, max_deviation_m }
    }
}

impl Config for Relations {
    type Stage = dyn SceneAnnotator;
    const KIND: &'static str = "relations";
    const EXAMPLE: &'static str = "margin_m = 0.001";
    fn build(self) -> Result<Box<dyn SceneAnnotator>, ConfigError> {
        let Self { margin_m, collision, max_deviation_m } = self;
        let shapes = HullCache::new(&Rapier { collision, max_deviation_m, ..Rapier::default() });
        Ok(Box::new(Relate { margin_m, shapes }))
    }
}

register!(Relations);

/// The annotator of the kind `relations`.
struct Relate {
    margin_m: f64,
    shapes: HullCache,
}

impl SceneAnnotator for Relate {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CONTACTS, SUPPORT_GRAPH, INSIDE, REMOVAL_ORDER]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let scene = cx.scene;
        let solids = solid::solids(cx, scene, &self.shapes);
        let contacts = contact::contacts(&solids, self.margin_m);
        let moving: Vec<Option<Moving>> = solids.iter().map(|solid| Moving::of(solid, scene)).collect();
        let forces = Forces::new(&moving, &contacts);
        let support = SupportRelation::new(&solids, &moving, &contacts, &forces);
        let records = contacts.iter().zip(&forces.of_points);
        let records = records.map(|(contact, forces)| Value::of(&ContactView::new(contact, forces, &solids)));
        products.put(CONTACTS, Value::List(records.collect::<Result<_>>()?))?;
        products.put(SUPPORT_GRAPH, Value::of(&support.graph(&solids, &moving, &forces))?)?;
        let inside = inside::inside(scene, &solids, &support);
        products.put(INSIDE, Value::List(inside.iter().map(Value::of).collect::<Result<_>>()?))?;
        products.put(REMOVAL_ORDER, Value::of(&support.removal_order(&solids))?)
    }
}

/// An entry of the product `contacts`.
#[derive(Serialize)]
struct ContactView {
    ids: [u16; 2],
    gap_m: f64,
    normal_world: [f64; 3],
    force_world_n: [f64; 3],
    points: Vec<PointView>,
}

/// A point of an entry of `contacts`.
#[derive(Serialize)]
struct PointView {
    point_world_m: [f64; 3],
    normal_world: [f64; 3],
    gap_m: f64,
    force_world_n: [f64; 3],
}

impl ContactView {
    fn new(contact: &Contact, forces: &[force::Force], solids: &[Solid]) -> Self {
        Self {
            ids: contact.ids(solids),
            gap_m: contact.points.iter().map(|point| point.gap_m).fold(f64::INFINITY, f64::min),
            normal_world: contact.mean_normal().into(),
            force_world_n: forces.iter().sum::<force::Force>().into(),
            points: (contact.points.iter().zip(forces))
                .map(|(point, force)| PointView {
                    point_world_m: point.at.into(),
                    normal_world: point.normal.into(),
                    gap_m: point.gap_m,
                    force_world_n: (*force).into(),
                })
                .collect(),
        }
    }
}
