//! Affine placements of meshes: by nodes of a scene, or by links of a robot.

use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// From a mesh's frame to the body's: meters, z up.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    body_from_mesh: Matrix4<f64>,
    /// Transforms normals: the cofactors of the linear part, with its sign.
    normals: Matrix3<f64>,
    determinant: f64,
}

impl Placement {
    /// A placement by an affine matrix.
    pub fn new(body_from_mesh: Matrix4<f64>) -> Self {
        let linear = body_from_mesh.fixed_view::<3, 3>(0, 0).into_owned();
        let [x, y, z] = [0, 1, 2].map(|i| Vector3::from(linear.column(i)));
        let determinant = linear.determinant();
        let cofactors = Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)]);
        let normals = cofactors * if determinant < 0.0 { -1.0 } else { 1.0 };
        Self { body_from_mesh, normals, determinant }
    }

    /// A point of the mesh in the body frame.
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = p.map(f64::from);
        let p = self.body_from_mesh * Vector4::new(x, y, z, 1.0);
        [p.x as f32, p.y as f32, p.z as f32]
    }

    /// A normal of the mesh in the body frame, a unit vector; zero if it has no direction.
    pub fn normal(&self, n: [f32; 3]) -> [f32; 3] {
        let n = self.normals * Vector3::from(n.map(f64::from));
        n.try_normalize(0.0).unwrap_or_default().map(|x| x as f32).into()
    }

    /// Positive unless faces change their winding.
    pub fn determinant(&self) -> f64 {
        self.determinant
    }
}
