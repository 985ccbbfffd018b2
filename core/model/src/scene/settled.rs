//! The effects of settling on a scene, stored so that the settled scene can be restored without a simulation.

use super::{BodyDraft, BodyHandle, MassProperties, Moment, SceneBuilder, SettleReport, Trajectory};
use crate::error::{Error, Result};
use crate::geometry::{Pose, UnitQuaternion};
use nalgebra::{Quaternion, Translation3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The bodies of a scene as the placers left them.
#[derive(Debug)]
pub struct PlacedBodies(Vec<Option<PlacedBody>>);

/// The properties of a body that a settler can change.
#[derive(Debug)]
struct PlacedBody {
    pose: Pose,
    mass: MassProperties,
    trajectory: Option<Arc<Trajectory>>,
}

impl PlacedBody {
    fn of(body: &BodyDraft) -> Self {
        Self { pose: body.world_from_body, mass: body.mass, trajectory: body.trajectory.clone() }
    }
}

impl PlacedBodies {
    /// Records a scene before it settles.
    pub fn of(scene: &SceneBuilder) -> Self {
        Self(scene.bodies.iter().map(|body| body.as_ref().map(PlacedBody::of)).collect())
    }
}

/// The whole effect of a settler: which bodies moved where, which left, which were given another mass or a trajectory, and its
/// report.
///
/// Formats that keep `f64` numbers to the last bit, such as TOML, keep the effect exactly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// Number of bodies that were placed, including bodies that placers took out again.
    placed: usize,
    /// Bodies that were removed, by their number in the order in which they were added.
    removed: Vec<usize>,
    /// Bodies that moved, by the same numbers.
    moved: Vec<usize>,
    /// The poses of the bodies that moved, `world_from_body`: translation x, y, z in meters, rotation i, j, k, w.
    poses: Vec<[f64; 7]>,
    /// Bodies that were given another mass, by the same numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    weighed: Vec<usize>,
    /// Their masses, kg.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    masses_kg: Vec<f64>,
    /// Bodies that were given a trajectory, by the same numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    scripted: Vec<usize>,
    /// Their trajectories: moment in seconds, then the pose as in `poses`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    trajectories: Vec<Vec<[f64; 8]>>,
    report: SettleReport,
}

impl Settled {
    /// Compares a scene with its state before it settled. None if bodies were added, because that cannot be repeated.
    pub fn between(before: &PlacedBodies, after: &SceneBuilder, report: &SettleReport) -> Option<Self> {
        if before.0.len() != after.bodies.len() {
            return None;
        }
        let mut settled = Self {
            placed: before.0.len(),
            removed: vec![],
            moved: vec![],
            poses: vec![],
            weighed: vec![],
            masses_kg: vec![],
            scripted: vec![],
            trajectories: vec![],
            report: report.clone(),
        };
        for (number, (before, after)) in before.0.iter().zip(&after.bodies).enumerate() {
            match (before, after) {
                (None, None) => {}
                (None, Some(_)) => return None,
                (Some(_), None) => settled.removed.push(number),
                (Some(before), Some(after)) => {
                    if before.mass != after.mass {
                        settled.weighed.push(number);
                        settled.masses_kg.push(after.mass.kg);
                    }
                    if let Some(trajectory) =
                        after.trajectory.as_ref().filter(|_| before.trajectory != after.trajectory)
                    {
                        settled.scripted.push(number);
                        settled.trajectories.push(trajectory.poses().iter().map(keyed_numbers).collect());
                    }
                    let (before, after) = (numbers(&before.pose), numbers(&after.world_from_body));
                    if before.map(f64::to_bits) != after.map(f64::to_bits) {
                        settled.moved.push(number);
                        settled.poses.push(after);
                    }
                }
            }
        }
        Some(settled)
    }

    /// Applies the same changes to a scene that was placed again, and returns the report of that time. An error means
    /// that the scene is not the same.
    pub fn apply(&self, scene: &mut SceneBuilder) -> Result<SettleReport> {
        let there = |number: &usize| scene.bodies.get(*number).is_some_and(Option::is_some);
        if scene.bodies.len() != self.placed
            || self.moved.len() != self.poses.len()
            || self.weighed.len() != self.masses_kg.len()
            || self.scripted.len() != self.trajectories.len()
            || !self.moved.iter().chain(&self.removed).chain(&self.weighed).chain(&self.scripted).all(there)
        {
            return Err(Error::new("the settled poses belong to another scene"));
        }
        for (&number, pose) in self.moved.iter().zip(&self.poses) {
            scene.set_pose(BodyHandle(number), pose_of(pose));
        }
        for (&number, &kg) in self.weighed.iter().zip(&self.masses_kg) {
            scene.assign_mass(BodyHandle(number), kg);
        }
        for (&number, poses) in self.scripted.iter().zip(&self.trajectories) {
            let poses = poses.iter().map(keyed_pose).collect::<Result<_>>()?;
            scene.set_trajectory(BodyHandle(number), Trajectory::new(poses)?);
        }
        for &number in &self.removed {
            scene.remove(BodyHandle(number));
        }
        Ok(self.report.clone())
    }
}

fn numbers(pose: &Pose) -> [f64; 7] {
    let (t, r) = (&pose.translation.vector, &pose.rotation.coords);
    [t.x, t.y, t.z, r.x, r.y, r.z, r.w]
}

fn keyed_numbers((moment, pose): &(Moment, Pose)) -> [f64; 8] {
    let [x, y, z, i, j, k, w] = numbers(pose);
    [moment.seconds(), x, y, z, i, j, k, w]
}

fn keyed_pose(&[seconds, x, y, z, i, j, k, w]: &[f64; 8]) -> Result<(Moment, Pose)> {
    Ok((Moment::from_seconds(seconds)?, pose_of(&[x, y, z, i, j, k, w])))
}

/// The rotation is not normalized again: that would change its last bits.
fn pose_of(&[x, y, z, i, j, k, w]: &[f64; 7]) -> Pose {
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)))
}
