//! Depth of hidden parts.

use syntable_model::prelude::*;
use syntable_model::product::ObjectDepths;
use syntable_model::product::standard::{AMODAL_DEPTH, AMODAL_MASK, OBJECT_DEPTHS};

/// Depth of every annotated object's first surface, where it is seen and where it is hidden, as if it stood there alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmodalDepth {}

impl Config for AmodalDepth {
    type Stage = dyn Annotator;
    const KIND: &'static str = "amodal_depth";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for AmodalDepth {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![AMODAL_DEPTH]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let depths = products.get(OBJECT_DEPTHS)?;
        let amodal = products.get(AMODAL_MASK)?.map(|id, mask| depth_of(id, mask, depths));
        products.put(AMODAL_DEPTH, amodal)
    }
}

/// Depth of an object at the pixels of its mask, infinite elsewhere.
pub(crate) fn depth_of(id: InstanceId, mask: &Mask, depths: &ObjectDepths) -> Plane<f32> {
    let mut plane = Plane::from_fn(mask.width(), mask.height(), |_, _| f32::INFINITY);
    for ([x, y], depth) in depths_of(id, mask, depths) {
        plane.data_mut()[y as usize * mask.width() as usize + x as usize] = depth;
    }
    plane
}

/// The pixels of an object's mask, column and row, with its depth where its surface is on their rays.
pub(crate) fn depths_of(id: InstanceId, mask: &Mask, depths: &ObjectDepths) -> impl Iterator<Item = ([u32; 2], f32)> {
    mask.pixels().filter_map(move |pixel| {
        let [x, y] = [pixel as u32 % mask.width(), pixel as u32 / mask.width()];
        depths.at(x, y).iter().find(|(other, _)| *other == id).map(|(_, depth)| ([x, y], *depth))
    })
}

register!(AmodalDepth);
