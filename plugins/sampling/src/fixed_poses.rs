//! Views that the recipe lists.

use crate::hemisphere_shell::rolled;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use syntable_model::geometry::look_at;
use syntable_model::prelude::*;
use syntable_model::scene::{Tabletop, ViewId};

/// Views that are listed, the same in every scene: view `i` takes entry `i`, and there are as many views as entries.
///
/// An entry is either `{ eye_m = [x, y, z], target_m = [x, y, z] }` with optional `up` and `roll_deg`, or
/// `{ world_from_camera = [[..], [..], [..], [..]] }`, a 4 × 4 matrix row by row whose columns are the camera's right,
/// down and forward axes and its position. Metres.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixedPoses {
    /// The views, in order.
    #[schemars(length(min = 1))]
    poses: Vec<PoseEntry>,
    /// Where the origin of the poses lies.
    #[serde(default)]
    relative_to: Origin,
}

/// Where the origin of listed poses lies; axes are the world's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Origin {
    /// In the middle of the tabletop, whose height differs from table to table.
    #[default]
    TabletopCentre,
    /// On the floor under the table.
    World,
}

/// A camera pose of a recipe.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct PoseEntry {
    /// Where the camera is, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    eye_m: Option<[f64; 3]>,
    /// What it looks at, metres; the origin by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    target_m: Option<[f64; 3]>,
    /// What points up in the picture; z by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    up: Option<[f64; 3]>,
    /// Rotation about the optical axis, degrees; positive turns the camera clockwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    roll_deg: Option<f64>,
    /// The pose as a matrix, row by row, in place of the above.
    #[serde(skip_serializing_if = "Option::is_none")]
    world_from_camera: Option<[[f64; 4]; 4]>,
}

impl Config for FixedPoses {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "fixed_poses";
    const EXAMPLE: &'static str = "poses = [\n    { eye_m = [0.9, 0.0, 0.7], target_m = [0.0, 0.0, 0.05] },\n    \
        { eye_m = [0.0, 0.0, 1.2], up = [0.0, 1.0, 0.0] },\n]";

    fn build(self) -> Result<Box<dyn ViewSampler>, Invalid> {
        if self.poses.is_empty() {
            return Err(Invalid::new("poses", "`poses = []` lists no view"));
        }
        let poses = self
            .poses
            .iter()
            .enumerate()
            .map(|(i, entry)| entry.pose().map_err(|message| Invalid::new(format!("poses.{i}"), message)))
            .collect::<Result<_, _>>()?;
        Ok(Box::new(Listed { poses, relative_to: self.relative_to }))
    }
}
register!(FixedPoses);

impl PoseEntry {
    fn pose(&self) -> Result<Pose, String> {
        let points = [self.eye_m, self.target_m, self.up];
        if !points.iter().flatten().flatten().chain(&self.roll_deg).all(|x| x.is_finite()) {
            return Err("a pose needs finite numbers".into());
        }
        match (self.eye_m, self.world_from_camera) {
            (Some(eye), None) => {
                let (eye, target) = (Point3::from(eye), Point3::from(self.target_m.unwrap_or_default()));
                let up = Vector3::from(self.up.unwrap_or([0.0, 0.0, 1.0]));
                if (target - eye).norm() < 1e-9 {
                    return Err(format!("`eye_m` and `target_m` are the same point, {:?}", eye.coords.as_slice()));
                }
                if (target - eye).cross(&up).norm() < 1e-9 {
                    return Err("`up` is parallel to the direction of view; name another axis".into());
                }
                Ok(rolled(look_at(eye, target, up), self.roll_deg.unwrap_or(0.0)))
            }
            (None, Some(matrix)) if points == [None; 3] && self.roll_deg.is_none() => from_matrix(matrix),
            (None, None) => Err("a pose needs `eye_m`, or `world_from_camera`".into()),
            _ => Err("`world_from_camera` stands alone, without `eye_m`, `target_m`, `up` and `roll_deg`".into()),
        }
    }
}

fn from_matrix(rows: [[f64; 4]; 4]) -> Result<Pose, String> {
    let rotation = Matrix3::from_fn(|r, c| rows[r][c]);
    if !rows.iter().flatten().all(|x| x.is_finite()) || rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err("`world_from_camera` needs finite numbers and the last row [0, 0, 0, 1]".into());
    }
    let error = (rotation * rotation.transpose() - Matrix3::identity()).abs().max();
    if error > 1e-4 || rotation.determinant() < 0.0 {
        return Err(format!(
            "`world_from_camera` is no rigid motion: its rotation is off by {error:.1e}, determinant {:.3}",
            rotation.determinant()
        ));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
        &rotation,
        1e-12,
        100,
        Rotation3::from_matrix_unchecked(rotation),
    ));
    Ok(Pose::from_parts(Translation3::new(rows[0][3], rows[1][3], rows[2][3]), rotation))
}

struct Listed {
    poses: Vec<Pose>,
    relative_to: Origin,
}

impl Listed {
    fn origin(&self, tabletop: &Tabletop) -> Translation3<f64> {
        match self.relative_to {
            Origin::TabletopCentre => Translation3::from(tabletop.centre().coords),
            Origin::World => Translation3::identity(),
        }
    }
}

impl ViewSampler for Listed {
    fn pose(&self, scene: &Scene, view: ViewId, _: &Context) -> Result<Pose> {
        let pose = self.poses.get(view.0 as usize).ok_or_else(|| {
            Error::new(format!("view {} has no pose; {} are listed", view.0, self.poses.len()))
                .help("set dataset.views_per_scene to the number of poses, or list more")
        })?;
        Ok(self.origin(&scene.tabletop) * pose)
    }

    /// Around the middle of the tabletop.
    fn shell(&self, scene: &Scene) -> Shell {
        let centre = scene.tabletop.centre();
        let origin = self.origin(&scene.tabletop);
        let bounds = self
            .poses
            .iter()
            .map(|pose| ((origin * pose).translation.vector - centre.coords).norm())
            .fold([f64::INFINITY, 0.0], |[low, high], r| [r.min(low), r.max(high)]);
        Shell { centre, radius: bounds }
    }

    fn count(&self) -> Option<u32> {
        Some(self.poses.len() as u32)
    }
}
