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

/// Whether a closed mesh is nearly its own hull. Where faces are missing or turned, the volume is off and the answer
/// no; simplified hulls of round things are a little smaller than these.
fn fills(mesh: &Mesh, hull: &Hull) -> bool {
    let filled = mesh.signed_volume().abs() / f64::from(hull.volume());
    (NEARLY_CONVEX..1.1).contains(&filled)
}

fn decomposition(mesh: &Mesh, parameters: &VHACDParameters) -> Vec<Hull> {
    let data = mesh.data();
    let points: Vec<Vector> = data.positions.iter().map(|&p| Vector::from(p)).collect();
    // Some inputs make the decomposition panic; they get one hull. Its own hulls of the pieces are not used: among
    // thousands of nearly equal points they can lose some.
    let pieces = catch_unwind(AssertUnwindSafe(|| {
        VHACD::decompose(parameters, &points, &data.triangles, true)
            .compute_primitive_intersections(&points, &data.triangles)
    }));
    let around = |points: &Vec<Vector>| Hull::around(&points.iter().map(|p| p.to_array()).collect::<Vec<_>>());
    pieces.unwrap_or_default().iter().filter_map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull::{MAX_VERTICES, TOLERANCE_M};
    use crate::kit;
    use syntable_model::scene::MeshData;

    const USUAL: Method = Method::Decomposition { resolution: 64, concavity: 0.01, max_parts: 16 };

    /// How far the vertex that sticks out most lies beyond the nearest part, metres.
    fn missed(data: &MeshData, parts: &[Hull]) -> f32 {
        let beyond = |p: [f32; 3]| parts.iter().map(|part| part.outside(p)).fold(f32::INFINITY, f32::min);
        data.triangles.iter().flatten().map(|&i| beyond(data.positions[i as usize])).fold(f32::NEG_INFINITY, f32::max)
    }

    #[test]
    fn parts_cover_the_surface() {
        for (name, data) in kit::shape_kit() {
            let mesh = Mesh::new(data.clone()).expect("a sound mesh");
            let parts = convex_parts(&mesh, USUAL);
            let (missed, full) = (missed(&data, &parts), parts.iter().any(|part| part.points.len() >= MAX_VERTICES));
            let limit = if full { 0.001 } else { TOLERANCE_M + 1e-5 };
            assert!(missed <= limit, "{name}: {missed} m beyond {} parts", parts.len());
            let hull = convex_parts(&mesh, Method::Hull);
            assert_eq!(hull.len(), 1, "{name}");
            let fullness =
                |hulls: &[Hull]| f64::from(hulls.iter().map(Hull::volume).sum::<f32>()) / mesh.signed_volume();
            // Hollow things stay hollow: the parts are well below the hull, and all about the mesh.
            println!("{name}: {} parts, {:.2} of the mesh, hull {:.2}", parts.len(), fullness(&parts), fullness(&hull));
            assert!(fullness(&hull) < 1.3 || fullness(&parts) < 0.75 * fullness(&hull), "{name}");
            assert!(parts.len() <= 32, "{name}: {}", parts.len());
        }
    }

    #[test]
    fn convex_things_are_one_part_and_turned_ones_are_covered() {
        let ball = kit::sphere(0.03);
        let turned =
            MeshData { triangles: ball.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..ball.clone() };
        for data in [ball, turned, kit::cuboid([0.0; 3], [0.1, 0.2, 0.3])] {
            let parts = convex_parts(&Mesh::new(data.clone()).expect("sound"), USUAL);
            assert_eq!(parts.len(), 1);
            assert!(missed(&data, &parts) < 0.001);
        }
    }

    #[test]
    fn real_objects_are_covered() {
        // At most seven of each folder.
        let objects = kit::assets().into_iter().flat_map(|root| {
            let objects = kit::real_objects(&root);
            let step = objects.len().div_ceil(7).max(1);
            objects.into_iter().step_by(step)
        });
        let objects: Vec<_> = objects.collect();
        assert!(objects.len() >= 5, "{} objects", objects.len());
        for object in objects {
            let parts = convex_parts(&object.mesh, USUAL);
            let missed = missed(object.mesh.data(), &parts);
            let vertices: Vec<usize> = parts.iter().map(|part| part.points.len()).collect();
            println!("{}: {} parts, vertices {vertices:?}, {missed} m", object.name, parts.len());
            assert!(missed < 0.002, "{}: {missed} m", object.name);
        }
    }
}
