//! Moments in time, and bodies that move by a script.

use crate::error::{Error, Result};
use crate::geometry::{Pose, UnitQuaternion};
use nalgebra::{Quaternion, Translation3};
use serde::Serialize;
use std::cmp::Ordering;

/// A moment of a scene, in seconds after the bodies have come to rest. Always finite.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Moment(f64);

// The number is finite.
impl Eq for Moment {}

impl Ord for Moment {
    fn cmp(&self, other: &Self) -> Ordering {
        // Moments have only one zero, so this agrees with `==`.
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Moment {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Moment {
    /// When the bodies have come to rest. A scene in which nothing moves has no other moment.
    pub const START: Self = Self(0.0);

    /// A moment after the start, or before it.
    ///
    /// # Errors
    /// If the time is not finite.
    pub fn from_seconds(seconds: f64) -> Result<Self> {
        match seconds.is_finite() {
            // Of the two zeros, the positive one.
            true => Ok(Self(seconds + 0.0)),
            false => Err(Error::new(format!("{seconds} s is not a moment"))),
        }
    }

    /// Seconds after the start.
    pub fn seconds(self) -> f64 {
        self.0
    }
}

/// The pose of a scripted body over time: `world_from_body` at some moments. Between two of them, the body moves at constant
/// velocity and turns at constant angular velocity the shorter way. Before the first and after the last it rests.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory(Vec<(Moment, Pose)>);

impl Trajectory {
    /// A trajectory through poses in the order of their moments.
    ///
    /// # Errors
    /// If the list is empty, a pose is not finite, or a moment is not after the previous one.
    pub fn new(poses: Vec<(Moment, Pose)>) -> Result<Self> {
        let is_finite = |pose: &Pose| {
            pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|number| number.is_finite())
        };
        let wrong = if poses.is_empty() {
            Some("it has no pose".to_owned())
        } else if let Some((moment, _)) = poses.iter().find(|(_, pose)| !is_finite(pose)) {
            Some(format!("the pose at {} s is not finite", moment.seconds()))
        } else {
            let unordered = poses.windows(2).find(|pair| pair[0].0 >= pair[1].0);
            unordered.map(|pair| format!("{} s is not after {} s", pair[1].0.seconds(), pair[0].0.seconds()))
        };
        wrong.map_or(Ok(Self(poses)), |wrong| Err(Error::new(wrong).context("a trajectory")))
    }

    /// The poses that it goes through, in the order of their moments.
    pub fn poses(&self) -> &[(Moment, Pose)] {
        &self.0
    }

    /// The pose at a moment.
    pub fn at(&self, moment: Moment) -> Pose {
        let after = self.0.partition_point(|(key, _)| *key <= moment);
        match (after.checked_sub(1).map(|before| &self.0[before]), self.0.get(after)) {
            (Some((start, from)), Some((end, to))) if *start != moment => {
                let fraction = (moment.seconds() - start.seconds()) / (end.seconds() - start.seconds());
                between(from, to, fraction)
            }
            (Some((_, pose)), _) | (None, Some((_, pose))) => *pose,
            (None, None) => unreachable!("a trajectory has a pose"),
        }
    }
}

/// The pose at a fraction of the way between two poses.
fn between(from: &Pose, to: &Pose, fraction: f64) -> Pose {
    let place = from.translation.vector.lerp(&to.translation.vector, fraction);
    Pose::from_parts(Translation3::from(place), turned(&from.rotation, &to.rotation, fraction))
}

/// Spherical linear interpolation, with the same bits on every platform.
fn turned(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>, fraction: f64) -> UnitQuaternion<f64> {
    let cosine = from.coords.dot(&to.coords);
    // Both q and −q are a rotation: the nearer one is the shorter way.
    let (to, cosine) = if cosine < 0.0 { (-to.coords, -cosine) } else { (to.coords, cosine) };
    let angle = libm::acos(cosine.min(1.0));
    let weights = match libm::sin(angle) {
        sine if sine > 1e-6 => [1.0 - fraction, fraction].map(|part| libm::sin(part * angle) / sine),
        _ => [1.0 - fraction, fraction],
    };
    UnitQuaternion::new_normalize(Quaternion::from(from.coords * weights[0] + to * weights[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector3;

    fn at(seconds: f64) -> Moment {
        Moment::from_seconds(seconds).expect("finite")
    }

    fn pose(x: f64, yaw_deg: f64) -> Pose {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
        Pose::from_parts(Translation3::new(x, 0.0, 0.0), turn)
    }

    #[test]
    fn a_body_moves_evenly_between_the_poses_of_its_trajectory() {
        let trajectory =
            Trajectory::new(vec![(at(1.0), pose(0.0, 170.0)), (at(3.0), pose(0.4, -170.0))]).expect("sound");
        // The shorter way from 170° to 190° is through 180°.
        for (seconds, x, yaw_deg) in [
            (0.0, 0.0, 170.0),
            (1.0, 0.0, 170.0),
            (1.5, 0.1, 175.0),
            (2.0, 0.2, 180.0),
            (3.0, 0.4, 190.0),
            (9.0, 0.4, 190.0),
        ] {
            let (found, expected) = (trajectory.at(at(seconds)), pose(x, yaw_deg));
            assert!((found.translation.vector - expected.translation.vector).norm() < 1e-12, "{seconds} s: {found}");
            assert!(found.rotation.angle_to(&expected.rotation) < 1e-7, "{seconds} s: {found}");
        }
    }

    #[test]
    fn a_trajectory_has_ordered_moments_and_finite_poses() {
        assert!(Trajectory::new(vec![]).is_err() && Moment::from_seconds(f64::NAN).is_err());
        assert_eq!(at(-0.0).cmp(&Moment::START), Ordering::Equal);
        for second in [(at(0.0), pose(0.0, 0.0)), (at(-1.0), pose(0.0, 0.0)), (at(1.0), pose(f64::INFINITY, 0.0))] {
            assert!(Trajectory::new(vec![(at(0.0), pose(0.0, 0.0)), second]).expect_err("wrong").is_permanent());
        }
    }
}
