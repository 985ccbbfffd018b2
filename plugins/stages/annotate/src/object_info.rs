//! Identity and pose of the objects of a view.

use crate::matrix::pose;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, OBJECT_INFO};
use syntable_model::scene::{Body, MassDistribution, MassOrigin, Object};

/// Asset, category, mass and poses of every object. Poses are 4 × 4 matrices, row by row, of the object frame in meters;
/// the camera frame is x right, y down, z forward. `bounds_m` are the lowest and the highest corner of the object's box in
/// the object frame, m; `model_origin_m` is the origin of the asset's file in that frame, m. `obj_id` is the number of the
/// asset in its pool, which depends on the pools of the recipe alone. `scale`, if it is not 1, is the placer's factor on
/// the size of the asset; all lengths include it.
///
/// The mass is the one that was simulated. `mass_origin` is `known` for a mass from the object's files, `estimated`
/// from its volume, or `assigned` by the settler. The center of mass (m) and the inertia tensor about it (kg m²) are in
/// the object frame; `mass_distribution` names the domain of the integration: the enclosed `volume`, the
/// `closed_volume` of a mesh with holes, `parts` of their own densities, or the `surface` of a mesh that encloses
/// nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectInfo {
    /// Objects to describe: the `annotated` ones (the default), or `all` objects of the scene, visible or not.
    pub objects: Which,
}

/// A set of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// Objects that have an amodal mask in the view.
    Annotated,
    /// All objects of the scene.
    All,
}

impl Default for ObjectInfo {
    fn default() -> Self {
        Self { objects: Which::Annotated }
    }
}

config!(ObjectInfo => dyn ViewAnnotator, "object_info", "objects = \"annotated\"");

impl ViewAnnotator for ObjectInfo {
    fn reads(&self) -> Vec<KeyId> {
        match self.objects {
            Which::Annotated => keys![AMODAL_MASK],
            Which::All => keys![],
        }
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_INFO]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let camera_from_world = cx.view.camera.world_from_camera.inverse();
        let annotated = match self.objects {
            Which::Annotated => Some(products.get(AMODAL_MASK)?),
            Which::All => None,
        };
        let info = cx
            .scene
            .objects()
            .iter()
            .filter(|body| annotated.is_none_or(|masks| masks.get(body.id).is_some()))
            .map(|body| Ok((body.id, Value::of(&ObjectView::new(body, &camera_from_world))?)))
            .collect::<Result<_>>()?;
        products.put(OBJECT_INFO, info)
    }
}

/// Ratio of the lengths of an object to its asset's, if its placer gave it another size.
pub(crate) fn scale_of(object: &Object) -> Option<f64> {
    object.model.resized.as_ref().map(|resized| resized.factor)
}

/// An entry of the product `object_info`.
#[derive(Serialize)]
struct ObjectView<'a> {
    /// Pool and name.
    asset: String,
    pool: &'a str,
    name: &'a str,
    category: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    obj_id: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    spawn: u32,
    bounds_m: [[f64; 3]; 2],
    model_origin_m: [f64; 3],
    mass_kg: f64,
    mass_origin: MassOrigin,
    mass_distribution: MassDistribution,
    center_of_mass_m: [f64; 3],
    inertia_kg_m2: [[f64; 3]; 3],
    license: &'a str,
    digest: String,
    world_from_object: [[f64; 4]; 4],
    camera_from_object: [[f64; 4]; 4],
}

impl<'a> ObjectView<'a> {
    fn new(body: &'a Body, camera_from_world: &Pose) -> Self {
        let (object, mass) = (&body.object, &body.mass);
        let inertia = mass.inertia();
        Self {
            asset: body.asset.to_string(),
            pool: &body.asset.pool,
            name: &body.asset.name,
            category: &object.category,
            obj_id: object.model.obj_id,
            scale: scale_of(object),
            spawn: body.spawn,
            bounds_m: [object.mesh.bounds().min, object.mesh.bounds().max].map(Into::into),
            model_origin_m: object.model.origin.into(),
            mass_kg: mass.kg,
            mass_origin: mass.origin,
            mass_distribution: mass.distribution,
            center_of_mass_m: mass.center.into(),
            inertia_kg_m2: std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)])),
            license: &object.license,
            digest: object.digest.to_string(),
            world_from_object: pose(&body.world_from_body),
            camera_from_object: pose(&(camera_from_world * body.world_from_body)),
        }
    }
}

register!(ObjectInfo);
