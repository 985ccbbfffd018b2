//! Meaning of the ids of a scene.

use crate::matrix::pose;
use syntable_model::prelude::*;
use syntable_model::product::standard::BODIES;
use syntable_model::scene::{Body, Role};

/// Every body of the scene by its id in `instance`: role, asset, materials and pose.
///
/// Objects have the ids 1 to M; distractors follow, then table and room. 0 means no body. Together with `role`,
/// `instance` also gives the masks of tabletop and background.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Bodies {}

config!(Bodies => dyn SceneAnnotator, "bodies");

impl SceneAnnotator for Bodies {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![BODIES]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let bodies = cx.scene.bodies().iter().map(|body| Value::of(&BodyRecord::from(body))).collect::<Result<_>>()?;
        products.put(BODIES, Value::List(bodies))
    }
}

/// An entry of the product `bodies`.
#[derive(Serialize)]
struct BodyRecord<'a> {
    id: u16,
    role: Role,
    pool: &'a str,
    name: &'a str,
    category: &'a str,
    /// Names of the materials, by the object's material slots, or of the single material that replaces them.
    materials: Vec<&'a str>,
    world_from_body: [[f64; 4]; 4],
}

impl<'a> From<&'a Body> for BodyRecord<'a> {
    fn from(body: &'a Body) -> Self {
        let own = || body.object.materials.iter().map(|material| material.name.as_str()).collect();
        Self {
            id: body.id.0,
            role: body.role,
            pool: &body.asset.pool,
            name: &body.asset.name,
            category: &body.object.category,
            materials: body.material_override.as_ref().map_or_else(own, |other| vec![other.material.name.as_str()]),
            world_from_body: pose(&body.world_from_body),
        }
    }
}

register!(Bodies);
