//! Annotator `travel`: distances that objects move between the views of a scene, an annotation across moments.

use crate::object_positions::OBJECT_POSITIONS;
use std::collections::BTreeMap;
use syntable_model::prelude::*;

products! {
    /// For each object, by id, the length of its path through the moments of the views.
    pub const TRAVEL: Key<Value> = scene("travel").unit("m");
}

/// Sums the distances between the positions of each object in consecutive views.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Travel {}

impl Config for Travel {
    type Stage = dyn SceneAnnotator;
    const KIND: &'static str = "travel";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn SceneAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl SceneAnnotator for Travel {
    fn reads(&self) -> Vec<KeyId> {
        keys![OBJECT_POSITIONS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![TRAVEL]
    }

    fn annotate(&self, _: &SceneContext, views: &[ViewProducts], products: &mut Products) -> Result<()> {
        let (mut ways, mut before) = (BTreeMap::new(), BTreeMap::new());
        for view in views {
            for (id, &at) in &view.products.get(OBJECT_POSITIONS)?.0 {
                let from: [f64; 3] = before.insert(*id, at).unwrap_or(at);
                let step: f64 = at.iter().zip(from).map(|(a, b)| (a - b).powi(2)).sum();
                *ways.entry(*id).or_insert(0.0) += step.sqrt();
            }
        }
        let fields = ways.into_iter().map(|(id, way): (InstanceId, f64)| (id.to_string(), Value::from(way)));
        products.put(TRAVEL, Value::Record(fields.collect()))
    }
}
register!(Travel);
