//! The ground of an environment.

use crate::floor_support::{FloorSupport, floor_parts};
use crate::room::{POOL, parts, refuse_second_floor, slab};
use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, BodyDraft, Material, Motion, Role, Scalar};

/// Places a level ground at z = 0 that shows the lower half of the environment map: a shadow catcher.
///
/// The map is projected on the ground from `projection_height_m` above its center. Where nothing blocks the light, the
/// ground looks like the map, and the table's legs stand in the photograph. Table, objects and clutter cast shadows on
/// it and receive its light, and clutter that falls off the table comes to rest on it. The ground is a diffuse surface
/// whose color reflects the map's radiance, limited to all incoming light; reflections and glare of the photograph are
/// painted on it. Nothing is composited. In views without a light `environment`, the ground is plain gray. Labels name
/// it `room/floor`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Edge of the square, meters; 1 to 1000. At some hundred meters its edge is at the map's horizon.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    size_m: Dist,
    /// Height of the point that the map is projected from, meters; 0.1 to 100. The camera's height in a photograph
    /// shows its floor in true size.
    #[schemars(extend("minimum" = HEIGHT_M[0], "maximum" = HEIGHT_M[1]))]
    projection_height_m: Dist,
    /// Makes an area of the ground a support, for scenes without a table: `{ name = "floor", size_m = [1.5, 1.5] }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<FloorSupport>,
}

/// Limits of `size_m`, meters.
const SIZE_M: [f64; 2] = [1.0, 1000.0];
/// Limits of `projection_height_m`, meters.
const HEIGHT_M: [f64; 2] = [0.1, 100.0];

impl Default for Ground {
    fn default() -> Self {
        Self { size_m: Dist::Constant(500.0), projection_height_m: Dist::Constant(1.5), support: None }
    }
}

impl Config for Ground {
    type Stage = dyn Placer;
    const KIND: &'static str = "ground";
    const EXAMPLE: &'static str = "projection_height_m = 1.5";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.size_m.within("size_m", SIZE_M[0], SIZE_M[1])?;
        self.projection_height_m.within("projection_height_m", HEIGHT_M[0], HEIGHT_M[1])?;
        self.support.as_ref().map_or(Ok(()), |support| support.check([self.size_m.range().0; 2]))?;
        Ok(Box::new(self))
    }
}
register!(Ground);

impl Placer for Ground {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(floor_parts(self.support.as_ref()))
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        refuse_second_floor(scene)?;
        self.support.as_ref().map_or(Ok(()), |support| support.add_to(scene))?;
        let half = self.size_m.draw(&mut context.stream.child("size")) / 2.0;
        let height = self.projection_height_m.draw(&mut context.stream.child("height"));
        let [floor, ..] = parts([half; 2], 1.0);
        let material = Material {
            // Diffuse: nothing is reflected at the surface.
            ior: 1.0,
            roughness: Scalar::constant(1.0),
            projection_height_m: Some(height as f32),
            ..Material::plain("ground", [0.45; 3], 1.0)
        };
        let center = floor.bounds.center().coords;
        let pose = Pose::translation(center.x, center.y, center.z);
        let asset = AssetRef { pool: POOL.into(), name: floor.name.into() };
        let object = Arc::new(slab(&floor, material.with_digest())?);
        scene.add(BodyDraft::new(asset, object, pose, Role::Room, Motion::Fixed));
        Ok(())
    }
}
