//! Mesh repair: the same for all formats.
//!
//! - Faces without area and duplicate faces are dropped with a warning; a mesh with no other face is refused.
//! - Vertices that no face uses are dropped.
//! - Missing normals are computed from the faces.
//! - The orientation of a closed mesh whose faces point inwards is flipped with a warning.
//! - Holes, edges of more than two faces and inconsistently oriented neighbors stay, with a warning.
//! - A mesh in one plane is refused: a rigid body needs thickness.

use nalgebra::{Matrix3, Point3, Vector3};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Mesh, MeshData, Topology, weld};

/// Minimum height of a face relative to its longest edge. Below it, single precision cannot distinguish its area from
/// zero.
const MIN_HEIGHT: f64 = 1e-7;
/// Minimum thickness of a mesh relative to its width. Below it, the mesh is flat.
const MIN_THICKNESS: f64 = 1e-5;

/// Repairs a mesh. Warnings report every change that a user should know about.
pub fn repair(data: MeshData, log: &dyn Log) -> Result<(Mesh, Topology)> {
    // Indices and positions are checked first, because the following steps rely on them.
    let mut data = Mesh::new(data)?.into_data();
    if let Some(i) = data.uvs.iter().position(|uv| !uv.iter().all(|x| x.is_finite())) {
        return Err(Error::new(format!("non-finite texture coordinate of vertex {i}")));
    }
    drop_faces(&mut data, log)?;
    drop_unused_vertices(&mut data);
    repair_normals(&mut data);
    let mut mesh = Mesh::new(data)?;
    if is_flat(&mesh) {
        return Err(Error::new("all vertices lie in one plane; a rigid body needs thickness")
            .help("give the mesh a thickness, or use it as a material"));
    }
    let mut topology = Topology::of(&mesh);
    if topology.is_closed() && topology.is_oriented() && topology.signed_volume < 0.0 {
        log.warn(&Error::new("all faces point inwards; their orientation was flipped"));
        mesh = flip_orientation(mesh)?;
        topology.signed_volume = -topology.signed_volume;
    }
    let Topology { boundary_edges, non_manifold_edges, misoriented_edges, .. } = topology;
    if boundary_edges > 0 {
        log.warn(&Error::new(format!(
            "the surface is open, with {boundary_edges} boundary edges; its volume is computed with the holes closed"
        )));
    }
    if non_manifold_edges > 0 {
        log.warn(&Error::new(format!(
            "the surface is not manifold, with {non_manifold_edges} edges of more than two faces"
        )));
    }
    if misoriented_edges > 0 {
        log.warn(&Error::new(format!(
            "neighboring faces are oriented inconsistently at {misoriented_edges} edges; the volume is an estimate"
        )));
    }
    Ok((mesh, topology))
}

fn drop_faces(data: &mut MeshData, log: &dyn Log) -> Result<()> {
    let ids = weld(&data.positions);
    let total = data.triangles.len();
    let mut keep: Vec<bool> = data
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|index| ids[index as usize]);
            a != b && b != c && c != a && has_area(triangle.map(|index| data.positions[index as usize]))
        })
        .collect();
    let degenerate = keep.iter().filter(|keep| !**keep).count();
    if degenerate == total {
        return Err(Error::new(format!("none of the {total} faces has area")));
    }
    // Two faces are duplicates if they visit the same positions in the same cyclic order.
    let mut order: Vec<([u32; 3], u32)> = (0..total as u32)
        .filter(|&t| keep[t as usize])
        .map(|t| {
            let mut corners = data.triangles[t as usize].map(|index| ids[index as usize]);
            let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
            corners.rotate_left(first);
            (corners, t)
        })
        .collect();
    order.sort_unstable();
    let mut duplicates = 0;
    for pair in order.windows(2) {
        if pair[0].0 == pair[1].0 {
            keep[pair[1].1 as usize] = false;
            duplicates += 1;
        }
    }
    if degenerate > 0 {
        log.warn(&Error::new(format!("{degenerate} of {total} faces have no area and were dropped")));
    }
    if duplicates > 0 {
        log.warn(&Error::new(format!("{duplicates} of {total} faces are duplicates of others and were dropped")));
    }
    if degenerate + duplicates > 0 {
        let mut kept = keep.iter();
        data.triangles.retain(|_| *kept.next().unwrap_or(&true));
        if !data.slots.is_empty() {
            let mut kept = keep.iter();
            data.slots.retain(|_| *kept.next().unwrap_or(&true));
        }
    }
    Ok(())
}

fn has_area(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
    let (u, v) = (b - a, c - a);
    let longest = u.norm_squared().max(v.norm_squared()).max((c - b).norm_squared());
    u.cross(&v).norm() > MIN_HEIGHT * longest
}

fn drop_unused_vertices(data: &mut MeshData) {
    let mut used = vec![false; data.positions.len()];
    for &index in data.triangles.iter().flatten() {
        used[index as usize] = true;
    }
    if used.iter().all(|&used| used) {
        return;
    }
    fn keep<T>(values: &mut Vec<T>, used: &[bool]) {
        let mut at = used.iter();
        values.retain(|_| *at.next().unwrap_or(&false));
    }
    keep(&mut data.positions, &used);
    keep(&mut data.normals, &used);
    keep(&mut data.uvs, &used);
    keep(&mut data.colors, &used);
    let mut next = 0;
    let numbers: Vec<u32> = used
        .iter()
        .map(|&used| {
            let number = next;
            next += u32::from(used);
            number
        })
        .collect();
    for index in data.triangles.iter_mut().flatten() {
        *index = numbers[*index as usize];
    }
}

/// Normalizes normals. A zero or non-finite normal becomes the area-weighted mean of its faces' normals.
fn repair_normals(data: &mut MeshData) {
    let unit = |normal: Vector3<f64>| normal.try_normalize(1e-12).filter(|n| n.iter().all(|x| x.is_finite()));
    let mut missing = false;
    for normal in &mut data.normals {
        match unit(Vector3::from(normal.map(f64::from))) {
            Some(n) => *normal = n.map(|x| x as f32).into(),
            None => {
                *normal = [0.0; 3];
                missing = true;
            }
        }
    }
    if !missing {
        return;
    }
    let mut sums = vec![Vector3::zeros(); data.positions.len()];
    for triangle in &data.triangles {
        let [a, b, c] = triangle.map(|index| Vector3::from(data.positions[index as usize].map(f64::from)));
        let area = (b - a).cross(&(c - a));
        for index in triangle {
            sums[*index as usize] += area;
        }
    }
    for (normal, sum) in data.normals.iter_mut().zip(sums) {
        if *normal == [0.0; 3] {
            *normal = sum.try_normalize(0.0).unwrap_or_else(Vector3::z).map(|x| x as f32).into();
        }
    }
}

fn flip_orientation(mesh: Mesh) -> Result<Mesh> {
    let mut data = mesh.into_data();
    // The shading normals may already point outwards: compare them with the flipped faces.
    let mut agreement = 0.0;
    for triangle in &mut data.triangles {
        triangle.swap(1, 2);
        if !data.normals.is_empty() {
            let [a, b, c] = triangle.map(|index| Vector3::from(data.positions[index as usize].map(f64::from)));
            let face = (b - a).cross(&(c - a));
            agreement += triangle
                .iter()
                .map(|&index| face.dot(&Vector3::from(data.normals[index as usize].map(f64::from))))
                .sum::<f64>();
        }
    }
    if agreement < 0.0 {
        for normal in &mut data.normals {
            *normal = normal.map(|x| -x);
        }
    }
    Mesh::new(data)
}

/// Whether the standard deviation along the narrowest principal axis is negligible against the widest.
fn is_flat(mesh: &Mesh) -> bool {
    let bounds = mesh.bounds();
    let (center, scale) = (bounds.center(), bounds.diagonal());
    if !(scale > 0.0 && scale.is_finite()) {
        return true;
    }
    let mut moments = Matrix3::zeros();
    let mut mean = Vector3::zeros();
    let count = mesh.data().positions.len() as f64;
    for p in &mesh.data().positions {
        let p = (Point3::from(p.map(f64::from)) - center) / scale;
        moments += p * p.transpose() / count;
        mean += p / count;
    }
    let spread = (moments - mean * mean.transpose()).symmetric_eigenvalues();
    spread.min().max(0.0).sqrt() < MIN_THICKNESS * spread.max().max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    fn cube() -> MeshData {
        let corner = |i: u32| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32];
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        MeshData {
            positions: (0..8).map(corner).collect(),
            triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
            ..MeshData::default()
        }
    }

    /// Repairs a modified cube; checks the number of faces and all warnings, or the error.
    fn check(change: impl FnOnce(&mut MeshData), want: Result<(usize, &[&str]), &str>) -> Option<Mesh> {
        let (mut data, log) = (cube(), Collected::default());
        change(&mut data);
        match (repair(data, &log), want) {
            (Ok((mesh, _)), Ok((faces, warnings))) => {
                assert_eq!(mesh.data().triangles.len(), faces);
                let got: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
                assert_eq!(got.len(), warnings.len(), "{got:?}");
                for (got, want) in got.iter().zip(warnings) {
                    assert!(got.contains(want), "{got} lacks {want}");
                }
                Some(mesh)
            }
            (Err(got), Err(want)) => {
                assert!(got.to_string().contains(want), "{got} lacks {want}");
                None
            }
            (got, want) => panic!("got {got:?}, want {want:?}"),
        }
    }

    #[test]
    fn a_sound_mesh_stays_as_it_is() {
        let mesh = check(|_| {}, Ok((12, &[]))).expect("a mesh");
        assert_eq!(mesh.data().triangles, cube().triangles);
    }

    #[test]
    fn faces_without_area_and_duplicates_go() {
        let with_flat = |data: &mut MeshData| {
            data.positions.push([0.0; 3]);
            data.triangles.extend([[0, 0, 1], [0, 8, 1], [1, 2, 1]]);
            data.slots = vec![0; data.triangles.len()];
        };
        check(with_flat, Ok((12, &["3 of 15 faces have no area"])));
        let with_turned = |data: &mut MeshData| data.triangles.extend([[4, 6, 0], [6, 0, 4]]);
        check(with_turned, Ok((12, &["2 of 14 faces are duplicates"])));
        check(|data| data.positions.fill([1.0; 3]), Err("none of the 12 faces has area"));
        let collinear = |data: &mut MeshData| {
            data.positions.iter_mut().for_each(|p| *p = [p[0] * 0.1 + p[1] * 0.2 + p[2] * 0.7; 3])
        };
        check(collinear, Err("faces has area"));
    }

    #[test]
    fn small_and_huge_meshes_are_treated_alike() {
        for scale in [1e-30_f32, 1e-7, 1e7, 1e29, 1e38] {
            check(|data| data.positions.iter_mut().flatten().for_each(|x| *x *= scale), Ok((12, &[])));
        }
    }

    #[test]
    fn unsound_surfaces_are_reported() {
        check(|data| data.triangles.truncate(10), Ok((10, &["open, with 4 boundary edges"])));
        let fin = |data: &mut MeshData| {
            data.positions.push([0.5, -1.0, 0.5]);
            data.triangles.push([0, 1, 8]);
        };
        check(fin, Ok((13, &["open, with 2", "not manifold, with 1"])));
        check(|data| data.triangles[0].swap(0, 1), Ok((12, &["inconsistently at 3 edges"])));
    }

    #[test]
    fn inverted_meshes_are_flipped_with_their_normals() {
        let outwards = |data: &MeshData| data.positions.iter().map(|p| p.map(|x| x - 0.5)).collect::<Vec<_>>();
        for right in [true, false] {
            let mesh = check(
                |data| {
                    data.triangles.iter_mut().for_each(|t| t.swap(1, 2));
                    data.normals = outwards(data);
                    if !right {
                        data.normals.iter_mut().flatten().for_each(|x| *x = -*x);
                    }
                },
                Ok((12, &["orientation was flipped"])),
            )
            .expect("a mesh");
            assert!((mesh.signed_volume() - 1.0).abs() < 1e-6);
            let [x, y, z] = mesh.data().normals[7];
            assert!(x > 0.5 && y > 0.5 && z > 0.5, "{:?}", mesh.data().normals[7]);
        }
    }

    #[test]
    fn flat_meshes_are_refused_in_any_direction() {
        check(|data| data.positions.iter_mut().for_each(|p| p[2] = 0.1), Err("lie in one plane"));
        let tilted = |data: &mut MeshData| data.positions.iter_mut().for_each(|p| p[2] = 0.3 * p[0] + 0.4 * p[1] + 7.0);
        check(tilted, Err("lie in one plane"));
        check(|data| data.positions.iter_mut().for_each(|p| p[2] *= 1e-3), Ok((12, &[])));
    }

    #[test]
    fn normals_become_units_and_missing_ones_are_made() {
        let mesh = check(
            |data| {
                data.normals = vec![[0.0, 0.0, 5.0]; 8];
                data.normals[0] = [0.0; 3];
                data.normals[1] = [f32::NAN, 0.0, 0.0];
            },
            Ok((12, &[])),
        )
        .expect("a mesh");
        assert_eq!(mesh.data().normals[7], [0.0, 0.0, 1.0]);
        let [x, y, z] = mesh.data().normals[0];
        assert!(x < -0.3 && y < -0.3 && z < -0.3 && (x * x + y * y + z * z - 1.0).abs() < 1e-5);
    }

    #[test]
    fn unused_vertices_go() {
        let mesh = check(
            |data| {
                data.positions.insert(0, [99.0; 3]);
                data.uvs = (0..9).map(|i| [i as f32, 0.0]).collect();
                data.triangles.iter_mut().flatten().for_each(|index| *index += 1);
            },
            Ok((12, &[])),
        )
        .expect("a mesh");
        assert_eq!((mesh.data().positions.len(), mesh.data().uvs[0]), (8, [1.0, 0.0]));
    }
}
