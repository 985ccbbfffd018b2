//! Material of every pixel.

mod cast;
mod opaque;

use crate::materials::Numbered;
use cast::{Caster, Trees};
use syntable_model::prelude::*;
use syntable_model::product::standard::{INSTANCE, MATERIAL_MAP};

/// Material of the surface at the pixel center, as an id of the product `materials`, 0 without a surface.
///
/// Glass is looked through: the surface is the first labeled one that transmits less than half of the entering light.
/// The ray passes through glass straight, without refraction. With `glass = "seen"`, the surface is the one in
/// `instance` and `depth`. A body with several materials needs another ray per pixel, which the stage traces itself, so
/// every renderer works.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialMap {
    /// Surface of pixels that show glass.
    pub glass: Glass,
}

/// Surface of pixels that show glass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Glass {
    /// The first opaque surface behind the glass (the default).
    #[default]
    LookedThrough,
    /// The glass, as in `instance`.
    Seen,
}

impl Config for MaterialMap {
    type Stage = dyn ViewAnnotator;
    const KIND: &'static str = "material_map";
    const EXAMPLE: &'static str = "glass = \"looked_through\"";
    fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
        Ok(Box::new(Mapper { options: self, trees: Trees::default() }))
    }
}

register!(MaterialMap);

/// The annotator of the kind `material_map`.
struct Mapper {
    options: MaterialMap,
    trees: Trees,
}

impl ViewAnnotator for Mapper {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![MATERIAL_MAP]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let instance = products.get(INSTANCE)?;
        let numbered = Numbered::new(cx.scene)?;
        let caster = Caster::new(cx, &self.trees, self.options.glass == Glass::LookedThrough)?;
        let shown = |x: u32, y: u32| {
            let Some(index) = usize::from(instance.at(x, y).0).checked_sub(1) else { return 0 };
            let Some(of_slots) = numbered.of_bodies.get(index) else { return 0 };
            match of_slots.only {
                Some(id) if caster.is_opaque(index) => id,
                _ => caster.surface(index, [x, y]).map_or(0, |(body, slot)| numbered.of_bodies[body].slots[slot]),
            }
        };
        let rows = caster.rows(instance.height(), &|y| (0..instance.width()).map(|x| shown(x, y)).collect());
        let map = Plane::from_vec(instance.width(), instance.height(), rows.concat());
        products.put(MATERIAL_MAP, map)
    }
}
