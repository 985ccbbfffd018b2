//! `household`: everyday objects of 32 families.

use crate::family::{HouseholdModel, ObjectFamily};
use crate::material::{LICENSE, MaterialCache};
use crate::photograph_folder::PhotographFolder;
use crate::variants::{check_families, parse_name, variant_catalog};
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::prelude::*;
use syntable_model::scene::{
    Asset, AssetClass, Catalog, ConvexPart, MassDistribution, MassOrigin, MassProperties, Material, Mesh, Object,
    SourceModel, SupportArea,
};

/// Texels along the edge of the surfaces that objects share.
const SHARED_TEXELS: usize = 256;

/// Procedural household objects: mugs, cartons, tools, fruit and more, with real sizes and masses,
/// textures, and exact convex collision parts. No download is needed.
///
/// Names are `<family>_<variant>`, such as `mug_0007`. A variant depends on seed, family and number alone.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Household {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<ObjectFamily>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
    /// Folder of JPEG and PNG files. Packages, books and magazines then show crops of them instead of illustrations; all
    /// else stays the same. Of more than 128 files, evenly spaced ones are read.
    #[serde(skip_serializing_if = "Option::is_none")]
    photographs: Option<AssetPath>,
}

impl Default for Household {
    fn default() -> Self {
        Self { families: ObjectFamily::ALL.to_vec(), variants_per_family: 25, seed: 0, photographs: None }
    }
}

impl Config for Household {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "household";
    const EXAMPLE: &'static str =
        "families = [\"box\", \"can\", \"mug\", \"bowl\"]  # all by default\nvariants_per_family = 25\nseed = 1";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, ObjectFamily::name)?;
        let materials = MaterialCache::new(Stream::root(self.seed).child("household surfaces"), SHARED_TEXELS);
        let photographs = PhotographFolder::new(self.photographs.take());
        Ok(Box::new(HouseholdSource { config: self, materials, photographs }))
    }
}
register!(Household);

struct HouseholdSource {
    config: Household,
    materials: MaterialCache,
    photographs: PhotographFolder,
}

impl AssetSource for HouseholdSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        // Photographs have licenses of their own.
        (!self.photographs.is_set()).then_some(LICENSE)
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.photographs.limit(limits);
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        self.photographs.photographs(log)?;
        let families = self.config.families.iter().map(|family| family.name());
        Ok(variant_catalog(families, self.config.variants_per_family))
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let (family, variant) =
            parse_name(name, &self.config.families, |family| family.name(), self.config.variants_per_family)?;
        let stream = Stream::root(self.config.seed).child("household").child(family.name()).at(u64::from(variant));
        let model = family.model(&stream, &self.materials, self.photographs.photographs(log)?);
        let mut object = object(name, family.name(), model)?;
        if self.photographs.is_set() {
            object.license.clear();
        }
        Ok(Asset::from(object))
    }
}

/// The object of a model.
pub(crate) fn object(name: &str, category: &str, model: HouseholdModel) -> Result<Object> {
    let HouseholdModel { shape, materials, mass_kg, friction, crease_deg } = model;
    let (moments, to_center) = (shape.moments(), -shape.bounds().center().coords);
    let distribution = if shape.is_mixed() { MassDistribution::Parts } else { MassDistribution::Volume };
    let (mesh, parts) = shape.finish(crease_deg)?;
    let mass = MassProperties::of_moments(&moments, MassOrigin::Known, distribution)
        .ok_or_else(|| Error::new(format!("`{name}` encloses no volume")))?
        .with_kg(mass_kg, MassOrigin::Known)
        .transformed(to_center, 1.0);
    let digest = digest(&mesh, &materials, &parts, &mass, friction);
    Ok(Object {
        name: name.to_owned(),
        category: category.to_owned(),
        mesh: Arc::new(mesh),
        materials,
        collision: Some(Arc::new(parts)),
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        mass,
        friction,
        license: LICENSE.to_owned(),
        digest,
    })
}

/// The object of a model that carries others on level areas, in the frame of the model.
pub(crate) fn carrier(name: &str, category: &str, model: HouseholdModel, areas: Vec<SupportArea>) -> Result<Object> {
    let to_center = -model.shape.bounds().center().coords;
    let support_areas = areas.into_iter().map(|area| area.transformed(to_center, 1.0)).collect();
    Ok(Object { support_areas, ..object(name, category, model)? })
}

fn digest(
    mesh: &Mesh,
    materials: &[Arc<Material>],
    parts: &[ConvexPart],
    mass: &MassProperties,
    friction: f64,
) -> Digest {
    let data = mesh.data();
    let flat3 = |values: &[[f32; 3]]| values.concat().into_iter();
    let mut hasher = Hasher::new("procedural object")
        .floats(flat3(&data.positions))
        .floats(flat3(&data.normals))
        .floats(data.uvs.concat().into_iter())
        .bytes(&data.triangles.concat().iter().flat_map(|index| index.to_le_bytes()).collect::<Vec<_>>())
        .bytes(&data.slots.iter().flat_map(|slot| slot.to_le_bytes()).collect::<Vec<_>>());
    for material in materials {
        hasher = hasher.digest(material.digest);
    }
    for part in parts {
        hasher = hasher.floats(flat3(part));
    }
    let hasher = mass.center.iter().chain(mass.specific_inertia.iter()).fold(hasher, |hasher, x| hasher.number(*x));
    hasher.number(mass.kg).number(friction).text(LICENSE).finish()
}
