//! How the triangles of a mesh are connected: boundaries, parts, and the volume that they enclose.

use super::{Mesh, Moments};
use crate::geometry::{Aabb, Point3, Vector3};

/// Connectivity of a mesh after equal positions are taken as one vertex.
///
/// Texture seams and flat shading split vertices; here they do not count. Faces with two corners in one place have no
/// edges and are skipped.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    /// Edges of one face only: the rims of holes.
    pub boundary_edges: usize,
    /// Edges of three faces or more.
    pub non_manifold_edges: usize,
    /// Edges whose two faces run along them in the same direction: neighbors that face opposite sides.
    pub misoriented_edges: usize,
    /// Area of every connected part, largest first, m². Vertices connect parts.
    pub part_areas: Vec<f64>,
    /// Volume by the divergence theorem, m³, with every hole closed by a fan around the center of its rim; negative if
    /// the faces point inwards.
    pub signed_volume: f64,
    /// Moments of that volume about the center of the bounding box, m³, m⁴ and m⁵.
    pub moments: Moments,
    bounds: Aabb,
}

impl Topology {
    /// Minimum area of a connected part that counts as a piece of its own, as a fraction of the mesh's area.
    pub const PART_FRACTION: f64 = 0.01;
    /// Volume of a mesh whose faces enclose none in a consistent way, as a fraction of its bounding box.
    pub const BOX_FRACTION: f64 = 0.3;

    /// Examines a mesh. Time O(T log T) for T triangles.
    pub fn of(mesh: &Mesh) -> Self {
        let ids = weld(&mesh.data().positions);
        let bounds = mesh.bounds();
        let origin = bounds.center();
        let mut parts = Forest::new(ids.len());
        let (mut forward, mut backward) = (Vec::new(), Vec::new());
        let mut moments = Moments::ZERO;
        let mut areas = vec![0.0; ids.len()];
        for (t, triangle) in mesh.data().triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|index| ids[index as usize]);
            if a == b || b == c || c == a {
                continue;
            }
            let [p, q, r] = mesh.corners(t);
            areas[a as usize] += (q - p).cross(&(r - p)).norm() / 2.0;
            moments += Moments::tetrahedron([p, q, r].map(|p| p - origin));
            parts.join(a, b);
            parts.join(a, c);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if from < to {
                    forward.push(edge(from, to));
                } else {
                    backward.push(edge(to, from));
                }
            }
        }
        forward.sort_unstable();
        backward.sort_unstable();

        let mut part_areas = vec![0.0; ids.len()];
        for (id, area) in areas.iter().enumerate().filter(|(_, area)| **area > 0.0) {
            part_areas[parts.root(id as u32) as usize] += area;
        }
        part_areas.retain(|area| *area > 0.0);
        part_areas.sort_unstable_by(|a, b| b.total_cmp(a));

        let mut found = Self {
            boundary_edges: 0,
            non_manifold_edges: 0,
            misoriented_edges: 0,
            part_areas,
            signed_volume: 0.0,
            moments,
            bounds,
        };
        let mut rims = Vec::new();
        let (mut f, mut b) = (0, 0);
        while f < forward.len() || b < backward.len() {
            let key = match (forward.get(f), backward.get(b)) {
                (Some(&x), Some(&y)) => x.min(y),
                (Some(&x), None) | (None, Some(&x)) => x,
                (None, None) => break,
            };
            let ahead = forward[f..].iter().take_while(|&&x| x == key).count();
            let back = backward[b..].iter().take_while(|&&x| x == key).count();
            (f, b) = (f + ahead, b + back);
            match (ahead, back) {
                (1, 1) => {}
                (1, 0) | (0, 1) => found.boundary_edges += 1,
                (2, 0) | (0, 2) => found.misoriented_edges += 1,
                _ => found.non_manifold_edges += 1,
            }
            if ahead != back {
                let (low, high) = ((key >> 32) as u32, key as u32);
                // The rim runs against the faces that it bounds.
                let (from, to) = if ahead > back { (high, low) } else { (low, high) };
                rims.push((from, to, ahead.abs_diff(back) as f64));
            }
        }
        cap(mesh, &ids, &rims, origin, &mut found.moments);
        if found.moments.total < 0.0 {
            // Faces that point inwards enclose the same.
            found.moments = found.moments.scaled(-1.0);
            found.signed_volume = -found.moments.total;
        } else {
            found.signed_volume = found.moments.total;
        }
        found
    }

    /// Whether every edge has two faces: no holes, no fins.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0 && self.non_manifold_edges == 0
    }

    /// Whether neighboring faces agree on which side is outside.
    pub fn is_oriented(&self) -> bool {
        self.misoriented_edges == 0
    }

    /// Number of connected parts with at least [`PART_FRACTION`](Self::PART_FRACTION) of the area. A model of several
    /// separate objects has more than one.
    pub fn significant_parts(&self) -> usize {
        let total: f64 = self.part_areas.iter().sum();
        self.part_areas.iter().filter(|area| **area >= Self::PART_FRACTION * total).count()
    }

    /// Volume for computing a mass, m³; above zero and finite for a mesh with thickness.
    ///
    /// The enclosed volume of a closed, consistently oriented mesh. Otherwise the volume with holes closed, if it is
    /// between 1 % and all of the bounding box; else [`BOX_FRACTION`](Self::BOX_FRACTION) of the bounding box.
    pub fn solid_volume(&self) -> f64 {
        self.enclosed_volume().unwrap_or(Self::BOX_FRACTION * self.box_volume())
    }

    /// The enclosed volume, m³, with holes closed; none if it is not plausible.
    pub fn enclosed_volume(&self) -> Option<f64> {
        let (volume, boxed) = (self.signed_volume.abs(), self.box_volume());
        let plausible = if self.is_closed() && self.is_oriented() { 0.0 } else { 0.01 * boxed };
        (volume > plausible && volume <= boxed * (1.0 + 1e-6)).then_some(volume)
    }

    fn box_volume(&self) -> f64 {
        self.bounds.size().iter().product()
    }
}

/// For every vertex the number of the first one at the same position. `0.0` and `-0.0` are the same.
pub fn weld(positions: &[[f32; 3]]) -> Vec<u32> {
    let key = |index: u32| positions[index as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|&index| (key(index), index));
    let mut ids = vec![0; positions.len()];
    let mut first = 0;
    for (i, &index) in order.iter().enumerate() {
        if i == 0 || key(index) != key(order[i - 1]) {
            first = index;
        }
        ids[index as usize] = first;
    }
    ids
}

fn edge(low: u32, high: u32) -> u64 {
    u64::from(low) << 32 | u64::from(high)
}

/// Adds the moments of fans that close the rims; each connected rim has one fan, around the mean of its edges' ends.
fn cap(mesh: &Mesh, ids: &[u32], rims: &[(u32, u32, f64)], origin: Point3<f64>, moments: &mut Moments) {
    if rims.is_empty() {
        return;
    }
    let point = |id: u32| {
        let [x, y, z] = mesh.data().positions[id as usize].map(f64::from);
        Point3::new(x, y, z) - origin
    };
    let mut loops = Forest::new(ids.len());
    for &(from, to, _) in rims {
        loops.join(from, to);
    }
    let mut centers = vec![(Vector3::zeros(), 0.0); ids.len()];
    for &(from, to, _) in rims {
        let (sum, count) = &mut centers[loops.root(from) as usize];
        *sum += point(from) + point(to);
        *count += 2.0;
    }
    for &(from, to, times) in rims {
        let (sum, count) = centers[loops.root(from) as usize];
        *moments += Moments::tetrahedron([point(from), point(to), sum / count]).scaled(times);
    }
}

/// Disjoint sets, joined along shared members.
struct Forest(Vec<u32>);

impl Forest {
    fn new(members: usize) -> Self {
        Self((0..members as u32).collect())
    }

    fn root(&mut self, mut member: u32) -> u32 {
        while self.0[member as usize] != member {
            let above = self.0[member as usize];
            self.0[member as usize] = self.0[above as usize];
            member = above;
        }
        member
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MeshData;

    /// A box of 2 × 3 × 4 at an offset; every face has its own four vertices, as flat shading makes them.
    fn split_box(offset: f32) -> MeshData {
        let corner = |i: usize| [offset + (i & 1) as f32 * 2.0, (i >> 1 & 1) as f32 * 3.0, (i >> 2 & 1) as f32 * 4.0];
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut data = MeshData::default();
        for quad in quads {
            let base = data.positions.len() as u32;
            data.positions.extend(quad.map(corner));
            data.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
        data
    }

    fn examine(change: impl FnOnce(&mut MeshData)) -> Topology {
        let mut data = split_box(0.0);
        change(&mut data);
        Topology::of(&Mesh::new(data).expect("sound"))
    }

    #[test]
    fn a_box_is_closed_though_its_vertices_are_split() {
        let found = examine(|_| {});
        assert!(found.is_closed() && found.is_oriented(), "{found:?}");
        assert!((found.signed_volume - 24.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.part_areas, [52.0]);
    }

    #[test]
    fn holes_are_counted_and_closed_for_the_volume() {
        let found = examine(|data| data.triangles.truncate(10));
        assert_eq!(found.boundary_edges, 4);
        assert!((found.solid_volume() - 24.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_fin_is_not_manifold_and_adds_no_volume() {
        let found = examine(|data| {
            data.positions.push([1.0, -5.0, 2.0]);
            data.triangles.push([0, 1, 24]);
        });
        assert_eq!((found.non_manifold_edges, found.boundary_edges), (1, 2));
        assert!((found.signed_volume - 24.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn inverted_and_mixed_windings_are_told_apart() {
        let inverted = examine(|data| data.triangles.iter_mut().for_each(|t| t.swap(1, 2)));
        assert!(inverted.is_oriented() && (inverted.signed_volume + 24.0).abs() < 1e-9, "{inverted:?}");
        assert!((inverted.solid_volume() - 24.0).abs() < 1e-9);
        let mixed = examine(|data| data.triangles[0].swap(1, 2));
        assert_eq!(mixed.misoriented_edges, 3);
        assert!(mixed.solid_volume() > 0.0);
    }

    #[test]
    fn separate_boxes_are_parts() {
        let found = examine(|data| {
            let other = split_box(10.0);
            data.triangles.extend(other.triangles.iter().map(|t| t.map(|index| index + 24)));
            data.positions.extend(other.positions);
        });
        assert_eq!((found.significant_parts(), found.part_areas.len()), (2, 2));
        assert!((found.signed_volume - 48.0).abs() < 1e-9);
    }
}
