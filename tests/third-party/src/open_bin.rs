//! Placer `open_bin`: a custom support with walls. A scene with it needs no table.

use std::sync::Arc;
use syntable_mesh::material::default_material;
use syntable_mesh::{Model, ObjectInfo};
use syntable_model::geometry::{Translation3, UnitQuaternion};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, BodyDraft, MeshData, Motion, Object, Region, Role, Support};

/// Places an open bin of five boxes, a bottom and four walls, on the floor. Its inside is a support.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenBin {
    /// Name of the inside among the scene's supports.
    support: String,
    /// Width, length and height of the inside, meters.
    #[schemars(inner(range(min = 0.05, max = 2.0)))]
    size_m: [f64; 3],
    /// Center of the bin on the floor, meters.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    center_m: [f64; 2],
    /// Thickness of floor and walls, meters.
    #[schemars(range(min = 0.005, max = 0.1))]
    thickness_m: f64,
}

impl Default for OpenBin {
    fn default() -> Self {
        Self { support: "bin".to_owned(), size_m: [0.4, 0.3, 0.12], center_m: [0.0; 2], thickness_m: 0.02 }
    }
}

impl Config for OpenBin {
    type Stage = dyn Placer;
    const KIND: &'static str = "open_bin";
    const EXAMPLE: &'static str = "size_m = [0.4, 0.3, 0.12]";
    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Placer for OpenBin {
    // If every placer lists its names, `check` finds names of supports that no step sets.
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Sets(Part::Support(self.support.clone()))])
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let ([w, l, h], thick) = (self.size_m, self.thickness_m);
        let [x, y] = self.center_m;
        scene.supports.add(Support::new(self.support.as_str(), Region::rectangle([x, y, thick], [w, l])))?;
        let (outer, middle) = (w + 2.0 * thick, thick + h / 2.0);
        for (name, size, at) in [
            ("floor", [outer, l + 2.0 * thick, thick], [0.0, 0.0, thick / 2.0]),
            ("east", [thick, l, h], [(w + thick) / 2.0, 0.0, middle]),
            ("west", [thick, l, h], [-(w + thick) / 2.0, 0.0, middle]),
            ("north", [outer, thick, h], [0.0, (l + thick) / 2.0, middle]),
            ("south", [outer, thick, h], [0.0, -(l + thick) / 2.0, middle]),
        ] {
            let pose = Pose::from_parts(Translation3::new(x + at[0], y + at[1], at[2]), UnitQuaternion::identity());
            let asset = AssetRef { pool: "open_bin".into(), name: name.into() };
            let object = Arc::new(cuboid(name, size, context.log)?);
            scene.add(BodyDraft::new(asset, object, pose, Role::Support, Motion::Fixed));
        }
        Ok(())
    }
}
register!(OpenBin);

/// A box around the origin, with the given edges in meters.
pub fn cuboid(name: &str, size: [f64; 3], log: &dyn Log) -> Result<Object> {
    // The bits of i select the sides of the box for corner i; each face has two triangles, counterclockwise when seen
    // from outside.
    let side = |i: u32, axis: usize| (size[axis] * if i >> axis & 1 == 1 { 0.5 } else { -0.5 }) as f32;
    let positions = (0..8).map(|i| [side(i, 0), side(i, 1), side(i, 2)]).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mesh = MeshData { positions, triangles, ..MeshData::default() };
    let info = ObjectInfo { name: name.to_owned(), category: "bin".into(), license: "CC0-1.0".into() };
    let model = Model { mesh, materials: vec![default_material(false)] };
    let (object, _) = model.into_object(info, name.as_ref(), log)?;
    Ok(object)
}
