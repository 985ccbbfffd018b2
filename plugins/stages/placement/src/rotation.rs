//! Rotations that recipes state.

use syntable_model::geometry::UnitQuaternion;
use syntable_model::prelude::*;

/// Limits of rotations, degrees.
pub const ROTATION_DEG: [f64; 2] = [-3600.0, 3600.0];

/// Maximum deviation of the length of a quaternion from 1.
const QUATERNION_TOLERANCE: f64 = 1e-3;

/// Refuses a quaternion `[w, x, y, z]` that is no rotation, or that is stated beside angles.
pub fn check_quaternion(key: &str, quaternion: [f64; 4], has_angles: bool) -> Result<(), ConfigError> {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() > QUATERNION_TOLERANCE {
        let message = format!("the quaternion has length {length:.4}, not 1");
        return Err(ConfigError::new(key, message).help("divide its numbers by the length"));
    }
    if has_angles {
        let message = "`rotation_deg` states the rotation already";
        return Err(ConfigError::new(key, message).help("remove one of them"));
    }
    Ok(())
}

/// The rotation of a quaternion `[w, x, y, z]`.
pub fn of_quaternion([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion([x, y, z, w].into())
}

/// Roll, pitch and yaw, degrees: rotations about the world's x, y and z axes, in this order.
pub fn euler(degrees: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = degrees.map(f64::to_radians);
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}
