//! Modeling of closed solids with exact collision parts.
//!
//! A [`SolidShape`] is a set of shared points and triangles that carry their own texture coordinates. Sharing points
//! makes closed surfaces closed by construction; [`SolidShape::finish`] then splits vertices at texture seams and at
//! creases.
//!
//! **Invariants.** Every primitive is a closed surface with outward normals; a combined shape is a union of closed
//! surfaces. Collision parts are point sets whose hulls together cover the surface.

mod block;
mod extrude;
mod lathe;
mod loft;
mod outline;
mod sheet;
mod tub;

pub use block::rounded_box;
pub use extrude::{extrude, rounded_polygon, star};
pub use lathe::{Lathe, WallCell, revolved};
pub use loft::{SweepPath, loft, sweep};
pub use outline::Profile;
pub use sheet::{thick_sheet, vessel};
pub use tub::Tub;

use std::collections::BTreeMap;
use syntable_model::error::Result;
use syntable_model::geometry::{Aabb, Point3, Pose, Vector3};
use syntable_model::scene::{ConvexPart, Mesh, MeshData, Moments};

/// How texture coordinates are assigned to a run of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Uv {
    /// The texture exactly once: u around, v along.
    Fit,
    /// Repeated tiles of this edge length, meters.
    Tile(f64),
    /// Seen along z: the texture covers a square of this edge, meters, centered on the axis.
    Planar(f64),
}

/// Material and texture mapping of a run of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlotMapping {
    /// Material slot.
    pub slot: u16,
    /// How texture coordinates are assigned.
    pub uv: Uv,
}

impl SlotMapping {
    /// A material slot that shows the texture exactly once.
    pub const fn fit(slot: u16) -> Self {
        Self { slot, uv: Uv::Fit }
    }

    /// A material slot with tiles of this edge length, meters.
    pub const fn tile(slot: u16, meters: f64) -> Self {
        Self { slot, uv: Uv::Tile(meters) }
    }

    /// A material slot seen along z.
    pub const fn planar(slot: u16, meters: f64) -> Self {
        Self { slot, uv: Uv::Planar(meters) }
    }
}

#[derive(Debug, Clone)]
struct ShapeFace {
    corners: [u32; 3],
    uv: [[f64; 2]; 3],
    slot: u16,
    /// Density of the closed surface that the face belongs to, kg/m³, or in proportion to it.
    density: f64,
}

/// A closed solid, or a union of closed solids, under construction. Meters.
#[derive(Debug, Clone, Default)]
pub struct SolidShape {
    points: Vec<Point3<f64>>,
    faces: Vec<ShapeFace>,
    parts: Vec<Vec<Point3<f64>>>,
}

impl SolidShape {
    fn point(&mut self, p: Point3<f64>) -> u32 {
        self.points.push(p);
        (self.points.len() - 1) as u32
    }

    /// Adds a triangle, unless two of its corners are one point.
    fn triangle(&mut self, corners: [u32; 3], uv: [[f64; 2]; 3], slot: u16) {
        let [a, b, c] = corners;
        if a != b && b != c && c != a {
            self.faces.push(ShapeFace { corners, uv, slot, density: 1.0 });
        }
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4], [ta, tb, tc, td]: [[f64; 2]; 4], slot: u16) {
        self.triangle([a, b, c], [ta, tb, tc], slot);
        self.triangle([a, c, d], [ta, tc, td], slot);
    }

    /// Adds a collision part: the hull of some points.
    pub fn with_part(mut self, points: Vec<Point3<f64>>) -> Self {
        self.parts.push(points);
        self
    }

    /// Replaces all collision parts by the hull of all points.
    pub fn hulled(mut self) -> Self {
        self.parts = vec![self.points.clone()];
        self
    }

    /// Removes all collision parts, for a shape inside another shape.
    pub fn without_parts(mut self) -> Self {
        self.parts.clear();
        self
    }

    /// The union with another closed shape.
    pub fn and(mut self, other: Self) -> Self {
        let offset = self.points.len() as u32;
        self.points.extend(other.points);
        self.faces.extend(
            other.faces.into_iter().map(|face| ShapeFace { corners: face.corners.map(|index| index + offset), ..face }),
        );
        self.parts.extend(other.parts);
        self
    }

    /// Moves every point by a function; it must keep the orientation, and parts must stay convex.
    pub fn bent(mut self, bend: impl Fn(Point3<f64>) -> Point3<f64>) -> Self {
        for p in self.points.iter_mut().chain(self.parts.iter_mut().flatten()) {
            *p = bend(*p);
        }
        self
    }

    /// Moves rigidly.
    pub fn moved(self, pose: Pose) -> Self {
        self.bent(|p| pose * p)
    }

    /// Translates by meters.
    pub fn translated(self, x: f64, y: f64, z: f64) -> Self {
        self.bent(|p| p + Vector3::new(x, y, z))
    }

    /// Rotates about x, y or z (0, 1, 2), degrees.
    pub fn rotated(self, axis: usize, degrees: f64) -> Self {
        let mut angle = Vector3::zeros();
        angle[axis] = degrees.to_radians();
        self.moved(Pose::rotation(angle))
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(self.points.iter().copied())
    }

    /// Enclosed volume, m³; where closed parts overlap, the overlap counts twice.
    pub fn volume(&self) -> f64 {
        self.faces
            .iter()
            .map(|face| {
                let [a, b, c] = face.corners.map(|index| self.points[index as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Gives all closed surfaces so far a density, kg/m³. Surfaces without a density have the relative density 1.
    pub fn dense(mut self, density: f64) -> Self {
        self.faces.iter_mut().for_each(|face| face.density = density);
        self
    }

    /// Whether its closed surfaces have different densities.
    pub fn is_mixed(&self) -> bool {
        self.faces.windows(2).any(|pair| pair[0].density != pair[1].density)
    }

    /// Moments of the mass about the shape's origin; where closed parts overlap, the overlap counts twice.
    pub fn moments(&self) -> Moments {
        let mut moments = Moments::ZERO;
        for face in &self.faces {
            let corners = face.corners.map(|index| self.points[index as usize].coords);
            moments += Moments::tetrahedron(corners).scaled(face.density);
        }
        moments
    }

    /// Texture coordinates by the dominant axis of every face, in tiles of `tile_m` meters. The u axis follows the axis
    /// `grain`, except on faces across it.
    pub fn box_mapped(mut self, tile_m: f64, grain: usize) -> Self {
        for i in 0..self.faces.len() {
            let corners = self.faces[i].corners.map(|index| self.points[index as usize]);
            let across = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).iamax();
            let (a, b) = ((across + 1) % 3, (across + 2) % 3);
            let (u, v) = if b == grain { (b, a) } else { (a, b) };
            self.faces[i].uv = corners.map(|p| [p[u] / tile_m, p[v] / tile_m]);
        }
        self
    }

    /// Packs all slots into one texture: slot `i` takes the rectangle `parts[i]` (u0, v0, u1, v1). All become slot 0.
    pub fn in_atlas(mut self, parts: &[[f64; 4]]) -> Self {
        for face in &mut self.faces {
            let [u0, v0, u1, v1] = parts[usize::from(face.slot)];
            face.uv = face.uv.map(|[u, v]| [u0 + u * (u1 - u0), v0 + v * (v1 - v0)]);
            face.slot = 0;
        }
        self
    }

    /// Moves the texture coordinates of one slot into a rectangle (u0, v0, u1, v1).
    pub fn uv_in(mut self, slot: u16, [u0, v0, u1, v1]: [f64; 4]) -> Self {
        for face in self.faces.iter_mut().filter(|face| face.slot == slot) {
            face.uv = face.uv.map(|[u, v]| [u0 + u * (u1 - u0), v0 + v * (v1 - v0)]);
        }
        self
    }

    /// Sets v of one slot to the height over a total height, meters.
    pub fn uv_by_height(mut self, slot: u16, height: f64) -> Self {
        for i in 0..self.faces.len() {
            if self.faces[i].slot == slot {
                let z = self.faces[i].corners.map(|index| self.points[index as usize].z);
                self.faces[i].uv.iter_mut().zip(z).for_each(|(uv, z)| uv[1] = z / height);
            }
        }
        self
    }

    /// Rotates the texture of one slot by 90°: its right edge becomes the bottom.
    pub fn rotated_uv(mut self, slot: u16) -> Self {
        for face in self.faces.iter_mut().filter(|face| face.slot == slot) {
            face.uv = face.uv.map(|[u, v]| [v, 1.0 - u]);
        }
        self
    }

    /// Adds `first` to all slots.
    pub fn from_slot(mut self, first: u16) -> Self {
        for face in &mut self.faces {
            face.slot += first;
        }
        self
    }

    /// The mesh and its collision parts with the origin at the center of the bounding box.
    ///
    /// Faces that meet at less than `crease_deg` share a smooth normal, weighted by angle and area.
    pub fn finish(self, crease_deg: f64) -> Result<(Mesh, Vec<ConvexPart>)> {
        let center = self.bounds().center();
        let origin = Vector3::new(center.x, center.y, center.z);
        let centered = self.bent(|p| p - origin);
        let parts = centered.parts.iter().map(|part| part.iter().map(single).collect()).collect();
        Ok((Mesh::new(centered.mesh_data(crease_deg))?, parts))
    }

    fn mesh_data(&self, crease_deg: f64) -> MeshData {
        let normals: Vec<(Vector3<f64>, f64)> = self.faces.iter().map(|face| self.normal(face)).collect();
        let mut around = vec![Vec::new(); self.points.len()];
        for (f, face) in self.faces.iter().enumerate() {
            for (corner, &point) in face.corners.iter().enumerate() {
                let (normal, area) = normals[f];
                around[point as usize].push((normal, area * self.angle(face, corner)));
            }
        }
        let least = libm::cos(crease_deg.to_radians());
        let mut data = MeshData::default();
        let mut known: BTreeMap<(u32, [u32; 3], [u32; 2]), u32> = BTreeMap::new();
        for (f, face) in self.faces.iter().enumerate() {
            let own = normals[f].0;
            let indices = std::array::from_fn(|corner| {
                let point = face.corners[corner];
                let sum: Vector3<f64> = around[point as usize]
                    .iter()
                    .filter(|(normal, _)| normal.dot(&own) >= least)
                    .map(|(normal, weight)| normal * *weight)
                    .sum();
                let normal: [f32; 3] = sum.try_normalize(1e-30).unwrap_or(own).map(|x| x as f32).into();
                let uv = face.uv[corner].map(|x| x as f32);
                // Rounded, so that sums in another order do not split a vertex.
                let key = (point, normal.map(|x| ((x * 4096.0).round() as i32) as u32), uv.map(f32::to_bits));
                *known.entry(key).or_insert_with(|| {
                    data.positions.push(single(&self.points[point as usize]));
                    data.normals.push(normal);
                    data.uvs.push(uv);
                    (data.positions.len() - 1) as u32
                })
            });
            data.triangles.push(indices);
            data.slots.push(face.slot);
        }
        data
    }

    /// Unit normal and area of a face.
    fn normal(&self, face: &ShapeFace) -> (Vector3<f64>, f64) {
        let [a, b, c] = face.corners.map(|index| self.points[index as usize]);
        let cross = (b - a).cross(&(c - a));
        (cross.try_normalize(1e-30).unwrap_or_else(Vector3::z), cross.norm() / 2.0)
    }

    fn angle(&self, face: &ShapeFace, corner: usize) -> f64 {
        let [a, b, c] = std::array::from_fn(|i| self.points[face.corners[(corner + i) % 3] as usize]);
        (b - a).angle(&(c - a))
    }
}

fn single(p: &Point3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::f64::consts::PI;

    /// Every directed edge has exactly one partner in the other direction.
    fn assert_closed(shape: &SolidShape) {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for face in &shape.faces {
            for i in 0..3 {
                *edges.entry((face.corners[i], face.corners[(i + 1) % 3])).or_default() += 1;
            }
        }
        for (&(a, b), &count) in &edges {
            assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "edge {a}-{b} at {:?}", shape.points[a as usize]);
        }
    }

    fn check(name: &str, shape: &SolidShape, volume: f64, tolerance: f64) {
        assert_closed(shape);
        let got = shape.volume();
        assert!((got / volume - 1.0).abs() < tolerance, "{name}: {got} instead of {volume}");
    }

    #[test]
    fn primitives_are_closed_and_have_their_closed_form_volume() {
        let mapping = SlotMapping::fit(0);
        let cylinder = Profile::at(0.0, 0.0).to(2.0, 0.0, mapping).to(2.0, 3.0, mapping).to(0.0, 3.0, mapping);
        check("cylinder", &Lathe::new(&cylinder).segments(200).solid(), PI * 12.0, 1e-3);
        let ball: Vec<f64> = (0..=60).map(|i| PI * f64::from(i) / 60.0).collect();
        let ball = ball
            .iter()
            .skip(1)
            .fold(Profile::at(0.0, -1.0), |o, a| o.to(if *a > PI - 1e-3 { 0.0 } else { a.sin() }, -a.cos(), mapping));
        check("ball", &Lathe::new(&ball).segments(120).solid(), 4.0 / 3.0 * PI, 2e-3);
        let ring =
            Profile::at(2.0, 0.0).to(3.0, 0.0, mapping).to(3.0, 1.0, mapping).to(2.0, 1.0, mapping).closed(mapping);
        check("ring", &Lathe::new(&ring).segments(200).solid(), PI * 5.0, 1e-3);
        check("box", &rounded_box([1.0, 2.0, 3.0], 0.01, 2, |_| SlotMapping::fit(0)), 6.0, 2e-3);
        // Minkowski sum of a box and a ball: abc + 2r(ab+bc+ca) + πr²(a+b+c) + 4πr³/3.
        let [a, b, c, r] = [0.4, 1.4, 2.4, 0.3_f64];
        let sum = a * b * c + 2.0 * r * (a * b + b * c + c * a) + PI * r * r * (a + b + c) + 4.0 / 3.0 * PI * r.powi(3);
        check("round box", &rounded_box([1.0, 2.0, 3.0], r, 12, |_| SlotMapping::fit(0)), sum, 3e-3);
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        check("L", &extrude(&l, [0.0, 0.5], 0.0, mapping, mapping), 2.0, 1e-12);
        // The bevel's section takes 0.3·b·b + 0.3·0.7·b·b/2 + … off every edge; small against the whole.
        check("beveled L", &extrude(&l, [0.0, 0.5], 0.01, mapping, mapping), 2.0, 2e-3);
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let bar = SweepPath::along(&[Point3::origin(), Point3::new(3.0, 0.0, 0.0)], Vector3::y());
        check("bar", &sweep(&bar, &square, mapping, 1), 12.0, 1e-12);
        // Pappus: a swept section has the volume area × length of the centroid's path.
        let arc: Vec<_> = (0..=90)
            .map(|i| f64::from(i).to_radians())
            .map(|a| Point3::new(5.0 * a.cos(), 0.0, 5.0 * a.sin()))
            .collect();
        check("arc", &sweep(&SweepPath::along(&arc, Vector3::y()), &square, mapping, 10), 4.0 * 5.0 * PI / 2.0, 1e-3);
    }

    #[test]
    fn creases_split_normals_and_smooth_surfaces_do_not() {
        let cube = rounded_box([2.0; 3], 0.0, 0, |_| SlotMapping::fit(0));
        let (mesh, _) = cube.finish(40.0).expect("sound");
        for (p, n) in mesh.data().positions.iter().zip(&mesh.data().normals) {
            assert_eq!(n.iter().filter(|x| x.abs() == 1.0).count(), 1, "{p:?} {n:?}");
        }
        let ball = rounded_box([2.0; 3], 1.0, 6, |_| SlotMapping::fit(0));
        let (mesh, _) = ball.finish(60.0).expect("sound");
        for (p, n) in mesh.data().positions.iter().zip(&mesh.data().normals) {
            let dot: f32 = p.iter().zip(n).map(|(a, b)| a * b).sum();
            assert!(dot > 0.99, "{p:?} {n:?}");
        }
    }
}
