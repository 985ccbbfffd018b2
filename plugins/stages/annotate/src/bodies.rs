//! Meaning of the ids of a scene.

use crate::materials::material_names;
use crate::matrix::pose;
use crate::object_info::scale_of;
use syntable_model::prelude::*;
use syntable_model::product::standard::BODIES;
use syntable_model::scene::{Body, Finish, Recolor, Role};

/// Every body of the scene by its id in `instance`: role, asset, materials and pose. Bodies of another size than their asset have
/// `scale`, and bodies with changed colors or reflections have `recolor` or `finish`, as their placer drew them.
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
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    recolor: Option<Recolor>,
    #[serde(skip_serializing_if = "Option::is_none")]
    finish: Option<Finish>,
    world_from_body: [[f64; 4]; 4],
}

impl<'a> From<&'a Body> for BodyRecord<'a> {
    fn from(body: &'a Body) -> Self {
        Self {
            id: body.id.0,
            role: body.role,
            pool: &body.asset.pool,
            name: &body.asset.name,
            category: &body.object.category,
            materials: material_names(body),
            scale: scale_of(&body.object),
            recolor: body.recolor,
            finish: body.finish,
            world_from_body: pose(&body.world_from_body),
        }
    }
}

register!(Bodies);
