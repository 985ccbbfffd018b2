//! Table, background and categories.

use syntable_model::prelude::*;
use syntable_model::product::standard::{
    BACKGROUND_MASK, CATEGORY_ID, CATEGORY_MAP, INSTANCE, TABLETOP_MASK, VISIBLE_MASK,
};
use syntable_model::scene::Role;

/// Masks of the table and of the background, and the categories of what is seen. With the visible masks of objects and what
/// distractors cover they make up the image.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneMasks {}

impl Config for SceneMasks {
    type Stage = dyn Annotator;
    const KIND: &'static str = "scene_masks";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for SceneMasks {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, VISIBLE_MASK, CATEGORY_ID]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![TABLETOP_MASK, BACKGROUND_MASK, CATEGORY_MAP]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let ids = products.get(INSTANCE)?;
        let roles: Vec<Option<Role>> = (0..=u16::MAX)
            .map(|id| cx.scene.body(InstanceId(id)).map(|body| body.role))
            .take(cx.scene.bodies().len() + 1)
            .collect();
        let role = |id: &InstanceId| roles.get(usize::from(id.0)).copied().flatten();
        let mask = |is: fn(Option<Role>) -> bool| Mask::from_plane(&ids.map(|id| is(role(id))));
        let tabletop = mask(|role| role == Some(Role::Support));
        let background = mask(|role| matches!(role, None | Some(Role::Room)));
        let categories = products.get(CATEGORY_ID)?;
        let mut map = Plane::from_fn(ids.width(), ids.height(), |_, _| 0_u16);
        for (id, visible) in products.get(VISIBLE_MASK)?.iter() {
            let category = categories.get(id).map_or(0, |&category| category as u16);
            visible.pixels().for_each(|pixel| map.data_mut()[pixel] = category);
        }
        products.put(TABLETOP_MASK, tabletop)?;
        products.put(BACKGROUND_MASK, background)?;
        products.put(CATEGORY_MAP, map)
    }
}

register!(SceneMasks);
