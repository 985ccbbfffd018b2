//! The table that objects are dropped on.

use crate::bounds::rotated_bounds;
use crate::material::{TEXTURE_SCALE, always, any_angle_deg, check_scale, draw_material, real_size};
use crate::room::refuse_table_through_wall;
use crate::variation::ColorChange;
use std::sync::Arc;
use syntable_model::digest::Hasher;
use syntable_model::geometry::{Aabb, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Motion, Object, Region, Role, Support};

/// Draws a table, places it on the floor at the center of the room, and makes the top of its bounding box a support.
///
/// The tabletop follows the paper: w and l are the extents of the table's bounding box along world x and y, h its
/// height. The box includes legs and overhangs, and a round table's bounding rectangle. It is aligned with the world
/// axes even if the table is rotated, so objects that start beyond the real edge fall off.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Object pools to draw the table from.
    from: ObjectPools,
    /// Material pools. One drawn material replaces all materials of the table; without a pool it keeps its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialPools>,
    /// Probability that the table gets a drawn material, if `material` is set.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    material_probability: f64,
    /// Rotation of the drawn material's textures, degrees.
    #[serde(default = "any_angle_deg")]
    texture_rotation_deg: Dist,
    /// Scale of the drawn material's textures relative to their real size, 0.001 to 1000.
    #[serde(default = "real_size")]
    #[schemars(extend("minimum" = TEXTURE_SCALE[0], "maximum" = TEXTURE_SCALE[1]))]
    texture_scale: Dist,
    /// Changes the colors of some tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Rotation of the table about the world z axis, degrees.
    #[serde(default = "no_rotation")]
    yaw_deg: Dist,
    /// Longer side of the tabletop, meters; 0.05 to 10. The table is scaled to it, in all directions alike. Tables keep
    /// their own size without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = LONGER_SIDE_M[0], "maximum" = LONGER_SIDE_M[1]))]
    longer_side_m: Option<Dist>,
    /// Name of the tabletop among the scene's supports, for the option `support` of other stages.
    #[serde(default = "default_support", skip_serializing_if = "is_default_support")]
    #[schemars(length(min = 1))]
    support: String,
}

fn default_support() -> String {
    "table".to_owned()
}

fn is_default_support(name: &String) -> bool {
    *name == default_support()
}

/// Limits of `longer_side_m`, meters.
const LONGER_SIDE_M: [f64; 2] = [0.05, 10.0];

fn no_rotation() -> Dist {
    Dist::Constant(0.0)
}

impl Config for Table {
    type Stage = dyn Placer;
    const KIND: &'static str = "table";
    const EXAMPLE: &'static str = "from = [\"tables\"]\nmaterial = \"materials\"\nmaterial_probability = 0.5";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        check_scale("texture_scale", &self.texture_scale)?;
        self.color.as_ref().map_or(Ok(()), ColorChange::check)?;
        self.longer_side_m
            .as_ref()
            .map_or(Ok(()), |side| side.within("longer_side_m", LONGER_SIDE_M[0], LONGER_SIDE_M[1]))?;
        Ok(Box::new(self))
    }
}
register!(Table);

impl Placer for Table {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Sets(Part::Support(self.support.clone()))])
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let (asset, object) = context.assets.draw_object(&self.from, &mut context.stream.child("asset"))?;
        let yaw = self.yaw_deg.draw(&mut context.stream.child("yaw")).to_radians();
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let (object, bounds) = self.sized(object, &rotation, context)?;
        let shift = Vector3::new(-bounds.center().x, -bounds.center().y, -bounds.min.z);
        let (size, pose) = (bounds.size(), Pose::from_parts(shift.into(), rotation));
        if size.min() < 1e-6 {
            return Err(Error::unlucky(format!("the table {asset} is flat: its box is {size:?} m")));
        }
        let material = match &self.material {
            Some(pools) if context.stream.child("keep").chance(self.material_probability) => {
                let (rotation, scale, stream) =
                    (&self.texture_rotation_deg, &self.texture_scale, context.stream.child("surface"));
                Some(draw_material(pools, rotation, scale, context.assets, &stream)?)
            }
            _ => None,
        };
        let recolor = self.color.as_ref().and_then(|color| color.draw(&context.stream.child("color")));
        let body = BodyDraft::new(asset, object, pose, Role::Support, Motion::Fixed);
        let body = body.with_material_override(material).with_recolor(recolor);
        refuse_table_in_support(scene, &body)?;
        let surface = Region::rectangle([0.0, 0.0, size.z], [size.x, size.y]);
        scene.supports.add(Support::new(self.support.as_str(), surface))?;
        scene.add(body);
        refuse_table_through_wall(scene)
    }
}

impl Table {
    /// A table of the drawn size, and its bounding box after rotation.
    fn sized(
        &self,
        object: Arc<Object>,
        rotation: &UnitQuaternion<f64>,
        context: &Context,
    ) -> Result<(Arc<Object>, Aabb)> {
        let bounds = rotated_bounds(&object.mesh, rotation);
        let Some(side) = &self.longer_side_m else { return Ok((object, bounds)) };
        let scale = side.draw(&mut context.stream.child("size")) / bounds.size().xy().max();
        if !(scale.is_finite() && scale > 0.0) {
            return Ok((object, bounds));
        }
        let digest = Hasher::new("sized table").digest(object.digest).number(scale).finish();
        let object = Arc::unwrap_or_clone(object).transformed(Vector3::zeros(), scale)?;
        let bounds = rotated_bounds(&object.mesh, rotation);
        Ok((Arc::new(Object { digest, ..object }), bounds))
    }
}

/// Refuses a second table: the center of the room has space for one.
fn refuse_table_in_support(scene: &SceneBuilder, table: &BodyDraft) -> Result<()> {
    let bounds = table.world_bounds();
    let overlaps = |other: &Aabb| (0..3).all(|k| bounds.min[k] < other.max[k] && bounds.max[k] > other.min[k]);
    let mut supports = scene.bodies().map(|(_, body)| body).filter(|body| body.role == Role::Support);
    match supports.find(|other| overlaps(&other.world_bounds())) {
        Some(other) => {
            let message = format!("the table {} would stand in {}", table.asset, other.asset);
            Err(Error::new(message).help("keep one [[place]] kind = \"table\", before steps that place supports on it"))
        }
        None => Ok(()),
    }
}
