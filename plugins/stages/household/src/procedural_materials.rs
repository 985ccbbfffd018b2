//! `procedural_materials`: tileable surface materials of 28 families.

use crate::material::{LICENSE, MaterialFamily, Surface};
use crate::variants::{check_families, parse_name, variant_catalog};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};

/// Procedural surface materials: wood, stone, tiles, cloth, metal and more. All tile, at real sizes.
/// No download is needed.
///
/// Names are `<family>_<variant>`, such as `marble_0003`. A variant depends on seed, family and number alone.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralMaterials {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<MaterialFamily>,
    /// Keeps the families that one of these surfaces has in the world, such as boards and carpet for a floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    surfaces: Option<Vec<Surface>>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Edge length of the textures, texels. Each material takes eight bytes per texel.
    #[schemars(range(min = 64, max = 2048))]
    texture_px: u32,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
}

impl Default for ProceduralMaterials {
    fn default() -> Self {
        Self {
            families: MaterialFamily::ALL.to_vec(),
            surfaces: None,
            variants_per_family: 8,
            texture_px: 512,
            seed: 0,
        }
    }
}

impl Config for ProceduralMaterials {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_materials";
    const EXAMPLE: &'static str = "surfaces = [\"floor\"]                        # or families = [\"wood\", \"marble\"]; all by default\nvariants_per_family = 8";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, MaterialFamily::name)?;
        if let Some(surfaces) = &self.surfaces {
            self.families.retain(|family| family.surfaces().iter().any(|surface| surfaces.contains(surface)));
        }
        if self.families.is_empty() {
            return Err(ConfigError::new("surfaces", "none of `families` is for these surfaces".to_owned())
                .help("leave out `families` or `surfaces`"));
        }
        Ok(Box::new(self))
    }
}
register!(ProceduralMaterials);

impl AssetSource for ProceduralMaterials {
    fn class(&self) -> AssetClass {
        AssetClass::Material
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        Ok(variant_catalog(self.families.iter().map(|family| family.name()), self.variants_per_family))
    }

    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        let (family, variant) = parse_name(name, &self.families, |family| family.name(), self.variants_per_family)?;
        let stream = Stream::root(self.seed).child("materials").child(family.name()).at(u64::from(variant));
        Ok(Asset::from(family.bake(&stream, self.texture_px as usize, name)))
    }
}
