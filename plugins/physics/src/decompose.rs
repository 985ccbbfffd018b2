//! From a triangle mesh to convex parts: VHACD on voxels, or one hull around everything.

use crate::hull::Hull;
use parry3d::math::Vector;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use std::panic::{AssertUnwindSafe, catch_unwind};
use syntable_model::scene::Mesh;

/// A mesh that fills this fraction of its hull is taken to be convex.
const NEARLY_CONVEX: f64 = 0.97;

/// How a mesh becomes convex parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// One hull around all vertices.
    Hull,
    /// Approximate convex decomposition (VHACD; Mamou and Ghorbel, ICIP 2009): the mesh's voxels are cut by planes
    /// until every part is nearly convex; a part is the hull of the pieces of the mesh in its voxels.
    Decomposition {
        /// Voxels along the longest side.
        resolution: u32,
        /// Volume by which a part may exceed what it covers, as a fraction of the whole hull's volume.
        concavity: f32,
        /// Most parts; a few more can come about.
        max_parts: u32,
    },
}

/// The convex parts of a mesh. Whatever fails ends in one hull around everything.
pub fn convex_parts(mesh: &Mesh, method: Method) -> Vec<Hull> {
    let data = mesh.data();
    let used: Vec<[f32; 3]> = data.triangles.iter().flatten().map(|&i| data.positions[i as usize]).collect();
    let Some(whole) = Hull::around(&used) else { return Vec::new() };
    match method {
        Method::Decomposition { resolution, concavity, max_parts } if !fills(mesh, &whole) => {
            let parameters =
                VHACDParameters { resolution, concavity, max_convex_hulls: max_parts, ..VHACDParameters::default() };
            let parts = decomposition(mesh, &parameters);
            if parts.is_empty() { vec![whole] } else { parts }
        }
        _ => vec![whole],
    }
}

/// Whether a closed mesh is nearly its own hull. Where faces are missing or turned, the volume is off and the answer no.
fn fills(mesh: &Mesh, hull: &Hull) -> bool {
    let filled = mesh.signed_volume().abs() / f64::from(hull.volume());
    (NEARLY_CONVEX..1.02).contains(&filled)
}

fn decomposition(mesh: &Mesh, parameters: &VHACDParameters) -> Vec<Hull> {
    let data = mesh.data();
    let points: Vec<Vector> = data.positions.iter().map(|&p| Vector::from(p)).collect();
    // Some inputs make the decomposition panic; they get one hull.
    let parts = catch_unwind(AssertUnwindSafe(|| {
        VHACD::decompose(parameters, &points, &data.triangles, true)
            .compute_exact_convex_hulls(&points, &data.triangles)
    }));
    let around = |points: &[Vector]| Hull::around(&points.iter().map(|p| p.to_array()).collect::<Vec<_>>());
    parts.unwrap_or_default().iter().filter_map(|(points, _)| around(points)).collect()
}
