//! Annotator `object_positions`: positions of the objects at each moment.

use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::Product;

products! {
    /// Position (x, y, z) of the origin of each object's frame in the world, at the moment of the view.
    pub const OBJECT_POSITIONS: Key<Positions> = frame("object_positions").unit("m");
}

/// Positions by object.
pub struct Positions(pub BTreeMap<InstanceId, [f64; 3]>);

impl Product for Positions {
    fn encode(&self) -> Value {
        Value::PerInstance(self.0.iter().map(|(id, position)| (*id, Value::from(*position))).collect())
    }
}

/// Lists the positions of all objects, once for all views at a moment.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectPositions {}

impl Config for ObjectPositions {
    type Stage = dyn FrameAnnotator;
    const KIND: &'static str = "object_positions";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn FrameAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl FrameAnnotator for ObjectPositions {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_POSITIONS]
    }

    fn annotate(&self, cx: &FrameContext, products: &mut Products) -> Result<()> {
        // The scene is in its state at `cx.moment`.
        let objects = cx.scene.objects().iter();
        let positions = objects.map(|body| (body.id, body.world_from_body.translation.vector.into()));
        products.put(OBJECT_POSITIONS, Positions(positions.collect()))
    }
}
register!(ObjectPositions);
