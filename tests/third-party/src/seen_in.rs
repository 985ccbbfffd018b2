//! Annotator `seen_in`: the views that show each object, an annotation across views.

use crate::centroid::CENTROID;
use std::collections::BTreeMap;
use syntable_model::prelude::*;

products! {
    /// For each object, by id, the numbers of the views that show it.
    pub const SEEN_IN: Key<Value> = scene("seen_in");
}

/// Lists the views in which each object is visible.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SeenIn {}

impl Config for SeenIn {
    type Stage = dyn SceneAnnotator;
    const KIND: &'static str = "seen_in";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn SceneAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl SceneAnnotator for SeenIn {
    fn reads(&self) -> Vec<KeyId> {
        keys![CENTROID]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![SEEN_IN]
    }

    fn annotate(&self, _: &SceneContext, views: &[ViewProducts], products: &mut Products) -> Result<()> {
        let mut seen: BTreeMap<InstanceId, Vec<u32>> = BTreeMap::new();
        for view in views {
            for (id, _) in view.products.get(CENTROID)?.iter() {
                seen.entry(id).or_default().push(view.view.id.0);
            }
        }
        let fields = seen.into_iter().map(|(id, views)| (id.to_string(), Value::from(views)));
        products.put(SEEN_IN, Value::Record(fields.collect()))
    }
}
register!(SeenIn);
