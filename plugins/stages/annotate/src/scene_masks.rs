//! Supports, background and categories.

use syntable_model::prelude::*;
use syntable_model::product::standard::{BACKGROUND_MASK, CATEGORY_ID, CATEGORY_MAP, INSTANCE, TABLETOP_MASK};
use syntable_model::scene::Role;

/// Masks of the supports, such as the table, and of the background, and the categories of the visible objects. These
/// masks, the visible masks of objects and the pixels of distractors together cover the image.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneMasks {}

config!(SceneMasks => dyn ViewAnnotator, "scene_masks");

impl ViewAnnotator for SceneMasks {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, CATEGORY_ID]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![TABLETOP_MASK, BACKGROUND_MASK, CATEGORY_MAP]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (scene, ids) = (cx.scene, products.get(INSTANCE)?);
        let tabletop = mask_of(scene, ids, |role| role == Some(Role::Support));
        let background =
            mask_of(scene, ids, |role| role.is_none_or(|role| !role.is_foreground() && role != Role::Support));
        let categories = products.get(CATEGORY_ID)?;
        let all = 0..=scene.bodies().len() as u16;
        let category_of: Vec<u16> =
            all.map(|id| categories.get(InstanceId(id)).map_or(0, |&category| category as u16)).collect();
        let map = ids.map(|id| category_of.get(usize::from(id.0)).copied().unwrap_or(0));
        products.put(TABLETOP_MASK, tabletop)?;
        products.put(BACKGROUND_MASK, background)?;
        products.put(CATEGORY_MAP, map)
    }
}

/// The pixels that show a body of a matching role, or no body.
fn mask_of(scene: &Scene, ids: &Plane<InstanceId>, is: impl Fn(Option<Role>) -> bool) -> Mask {
    let role = |id: u16| scene.body(InstanceId(id)).map(|body| body.role);
    let is_of: Vec<bool> = (0..=u16::MAX).map(role).map(&is).take(scene.bodies().len() + 1).collect();
    let other = is(None);
    Mask::from_plane(&ids.map(|id| is_of.get(usize::from(id.0)).copied().unwrap_or(other)))
}

register!(SceneMasks);
