//! Scenes as stages in Python get them.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use syntable_model::geometry::{Aabb, Matrix3, Pose, Rotation3, Translation3, UnitQuaternion, Vector3};
use syntable_model::scene::{Body, Camera, Supports};

/// A pose as a matrix, row by row.
pub type Rows = [[f64; 4]; 4];

/// The matrix of a pose.
pub fn rows(pose: &Pose) -> Rows {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// The pose of a matrix whose upper left part is a rotation.
pub fn pose(rows: &Rows) -> Pose {
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|row, column| rows[row][column]));
    let at = Vector3::from_fn(|row, _| rows[row][3]);
    Pose::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Least and greatest corner.
pub fn corners(bounds: &Aabb) -> [[f64; 3]; 2] {
    [bounds.min, bounds.max].map(|corner| [corner.x, corner.y, corner.z])
}

/// Bodies as a list of dicts.
pub fn bodies<'py>(py: Python<'py>, bodies: &[Body]) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for body in bodies {
        let dict = PyDict::new(py);
        dict.set_item("id", body.id.0)?;
        dict.set_item("role", format!("{:?}", body.role).to_lowercase())?;
        dict.set_item("pool", &body.asset.pool)?;
        dict.set_item("name", &body.asset.name)?;
        dict.set_item("category", &body.object.category)?;
        dict.set_item("world_from_body", rows(&body.world_from_body))?;
        dict.set_item("bounds", corners(&body.world_bounds()))?;
        list.append(dict)?;
    }
    Ok(list)
}

/// Supports as a dict from their names to center and extents, the main one first.
pub fn supports<'py>(py: Python<'py>, supports: &Supports) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let main = supports.main().into_iter();
    for support in main.chain(supports.iter()) {
        let center = support.center();
        dict.set_item(&*support.name, ([center.x, center.y, center.z], support.surface.size()))?;
    }
    Ok(dict)
}

/// A camera as the record of the product `camera`, with the fields that every camera has.
pub fn camera<'py>(py: Python<'py>, camera: &Camera) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let k = &camera.intrinsics;
    dict.set_item("K", [[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])?;
    dict.set_item("width", k.width)?;
    dict.set_item("height", k.height)?;
    dict.set_item("world_from_camera", rows(&camera.world_from_camera))?;
    Ok(dict)
}
