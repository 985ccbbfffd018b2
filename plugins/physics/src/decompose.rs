//! Convex decomposition of triangle meshes: VHACD on voxels, or one convex hull.

use crate::units;
use parry3d::math::Vector;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use std::panic::{AssertUnwindSafe, catch_unwind};
use syntable_convex::ConvexHull;
use syntable_model::scene::Mesh;

/// Version of the decomposition: part of the key of cached parts. Raised whenever the same mesh and options give other
/// parts, be it for a new parry3d; a test pins the parts of this version.
pub const DECOMPOSITION_VERSION: u32 = 1;

/// A mesh that fills at least this fraction of its hull counts as convex.
const MIN_CONVEX_FILL: f64 = 0.97;

/// How a mesh becomes convex parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// One hull of all vertices.
    Hull,
    /// Approximate convex decomposition (VHACD; Mamou and Ghorbel, ICIP 2009): planes split the
    /// mesh's voxels until every part is nearly convex; a part is the hull of the pieces of the mesh in its voxels.
    Decomposition {
        /// Voxels along the longest side.
        resolution: u32,
        /// Volume by which a part may exceed what it covers, as a fraction of the whole hull's volume.
        concavity: f32,
        /// Target for the maximum number of parts; VHACD can return a few more.
        max_parts: u32,
    },
}

/// Computes the convex parts of a mesh. If the decomposition fails, the result is one hull.
pub fn convex_parts(mesh: &Mesh, method: Method) -> Vec<ConvexHull> {
    let data = mesh.data();
    let used: Vec<[f32; 3]> = data.triangles.iter().flatten().map(|&i| data.positions[i as usize]).collect();
    let Some(whole) = units::hull(&used) else { return Vec::new() };
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

/// Whether a closed mesh is nearly convex. Missing or flipped faces change its volume, so that the answer is no. A
/// simplified hull of a round mesh is slightly smaller than the mesh.
fn fills(mesh: &Mesh, hull: &ConvexHull) -> bool {
    let fill = mesh.signed_volume().abs() / f64::from(hull.volume());
    (MIN_CONVEX_FILL..1.1).contains(&fill)
}

fn decomposition(mesh: &Mesh, parameters: &VHACDParameters) -> Vec<ConvexHull> {
    let data = mesh.data();
    let points: Vec<Vector> = data.positions.iter().map(|&p| Vector::from(p)).collect();
    // VHACD panics on some inputs; they get one hull. Its own hulls of the pieces are not used: they can lose some of
    // thousands of nearly equal points.
    let pieces = catch_unwind(AssertUnwindSafe(|| {
        VHACD::decompose(parameters, &points, &data.triangles, true)
            .compute_primitive_intersections(&points, &data.triangles)
    }));
    let hull = |points: &Vec<Vector>| units::hull(&points.iter().map(|p| p.to_array()).collect::<Vec<_>>());
    pieces.unwrap_or_default().iter().filter_map(hull).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull_codec;
    use crate::kit;
    use crate::units::HULL_OPTIONS;
    use syntable_model::digest::Hasher;
    use syntable_model::scene::MeshData;

    const DEFAULT: Method = Method::Decomposition { resolution: 64, concavity: 0.01, max_parts: 16 };

    /// Largest distance of a vertex from its nearest part, meters.
    fn max_distance(data: &MeshData, parts: &[ConvexHull]) -> f32 {
        let distance = |p: [f32; 3]| parts.iter().map(|part| part.max_plane_distance(p)).fold(f32::INFINITY, f32::min);
        data.triangles.iter().flatten().map(|&i| distance(data.positions[i as usize])).fold(f32::NEG_INFINITY, f32::max)
    }

    #[test]
    fn parts_cover_the_surface() {
        for (name, data) in kit::shape_kit() {
            let mesh = Mesh::new(data.clone()).expect("a sound mesh");
            let parts = convex_parts(&mesh, DEFAULT);
            let (missed, is_full) =
                (max_distance(&data, &parts), parts.iter().any(|part| part.points.len() >= HULL_OPTIONS.max_vertices));
            let limit = if is_full { 0.001 } else { HULL_OPTIONS.tolerance + 1e-5 };
            assert!(missed <= limit, "{name}: {missed} m beyond {} parts", parts.len());
            let hull = convex_parts(&mesh, Method::Hull);
            assert_eq!(hull.len(), 1, "{name}");
            let fill = |hulls: &[ConvexHull]| {
                f64::from(hulls.iter().map(ConvexHull::volume).sum::<f32>()) / mesh.signed_volume()
            };
            // Hollow shapes stay hollow: the parts have clearly less volume than the hull.
            println!("{name}: {} parts, {:.2} of the mesh, hull {:.2}", parts.len(), fill(&parts), fill(&hull));
            assert!(fill(&hull) < 1.3 || fill(&parts) < 0.75 * fill(&hull), "{name}");
            assert!(parts.len() <= 32, "{name}: {}", parts.len());
        }
    }

    #[test]
    fn convex_and_inside_out_meshes_are_one_part() {
        let ball = kit::sphere(0.03);
        let inside_out =
            MeshData { triangles: ball.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..ball.clone() };
        for data in [ball, inside_out, kit::cuboid([0.0; 3], [0.1, 0.2, 0.3])] {
            let parts = convex_parts(&Mesh::new(data.clone()).expect("sound"), DEFAULT);
            assert_eq!(parts.len(), 1);
            assert!(max_distance(&data, &parts) < 0.001);
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
            let parts = convex_parts(&object.mesh, DEFAULT);
            let missed = max_distance(object.mesh.data(), &parts);
            let vertices: Vec<usize> = parts.iter().map(|part| part.points.len()).collect();
            println!("{}: {} parts, vertices {vertices:?}, {missed} m", object.name, parts.len());
            assert!(missed < 0.002, "{}: {missed} m", object.name);
        }
    }

    #[test]
    fn the_parts_of_this_version_are_pinned() {
        let mut hasher = Hasher::new("parts");
        for (name, data) in kit::shape_kit() {
            let parts = convex_parts(&Mesh::new(data).expect("a sound mesh"), DEFAULT);
            hasher = hasher.text(name).bytes(&hull_codec::encode(&parts));
        }
        let pinned = (1, "b8be73947742801c4d6033613935fc39");
        let found = (DECOMPOSITION_VERSION, hasher.finish().to_string());
        assert_eq!(
            (found.0, &found.1[..]),
            pinned,
            "other parts than before: raise DECOMPOSITION_VERSION and pin them"
        );
    }
}
