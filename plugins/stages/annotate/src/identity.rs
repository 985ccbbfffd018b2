//! Names and categories of objects.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, CATEGORY_ID, OBJECT_NAME};

/// Asset name and category id of every annotated object, as in annotation files: category 1 is `object`; the classes of
/// the recipe's pools follow, sorted by name. Several objects may have the same name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Identity {}

config!(Identity => dyn ViewAnnotator, "identity");

impl ViewAnnotator for Identity {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CATEGORY_ID, OBJECT_NAME]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let scene = cx.scene;
        let category = |id: InstanceId| {
            let class = scene.body(id).map_or(DatasetInfo::OBJECT.1, |body| &body.object.category);
            Ok((id, cx.dataset.category_id(class)?))
        };
        let name = |id: InstanceId| scene.body(id).map_or(String::new(), |body| body.asset.name.clone());
        let annotated = products.get(AMODAL_MASK)?;
        let categories = annotated.iter().map(|(id, _)| category(id)).collect::<Result<_>>()?;
        let names = annotated.map(|id, _| name(id));
        products.put(CATEGORY_ID, categories)?;
        products.put(OBJECT_NAME, names)
    }
}

register!(Identity);
