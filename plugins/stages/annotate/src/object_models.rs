//! The models of the scene's assets.

use syntable_model::prelude::*;
use syntable_model::product::standard::OBJECT_MODELS;
use syntable_model::product::{ObjectModel, ObjectModels as Models};

/// Triangle meshes of the assets of the scene's objects, in meters and in the object frame: `camera_from_object` of
/// `object_info` times a vertex is a point of the object in the camera frame. The `scale` of `object_info` multiplies the
/// vertex first.
///
/// A pool scales and centers an asset once, so all objects of an asset share one mesh. `obj_id` is the number of the
/// asset; `model_origin_m` is the origin of its file in the object frame. Symmetries are in the frame of the file, at
/// the pool's scale of the asset. The writer `bop` stores materials; generic writers omit them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectModels {}

config!(ObjectModels => dyn SceneAnnotator, "object_models");

impl SceneAnnotator for ObjectModels {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_MODELS]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let objects = cx.scene.objects().iter();
        let models = objects.map(|body| (body.asset.to_string(), ObjectModel::from(body.object.at_own_size().0)));
        products.put(OBJECT_MODELS, Models(models.collect()))
    }
}

register!(ObjectModels);
