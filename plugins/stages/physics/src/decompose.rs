//! Convex decomposition of triangle meshes: cuts by planes with a bound, or one convex hull.
//!
//! **Bound.** The deviation of a part is the largest distance from the mesh of a point of its hull that is outside the
//! solid. It bounds the height above the mesh at which a body can rest, and the narrowing of hollows.
//!
//! **Cuts by planes.** A plane across an axis cuts the piece with the largest deviation. A plane that contains a large
//! part of the piece's concave edges comes first: it removes these edges, and a shape with flat sides, such as a tray,
//! splits into its boards (Chazelle 1984). Otherwise, the plane is the one that leaves the least volume after one more
//! cut of either side. Then neighbors are joined while the bound holds. A part is the hull of the surface in its piece,
//! so the parts together cover the mesh.

use crate::units;
use parry3d::math::Vector;
use parry3d::query::{PointQuery, Ray, RayCast};
use parry3d::shape::{FeatureId, TriMesh};
use std::collections::{BTreeMap, BTreeSet};
use syntable_convex::{ConvexHull, HullOptions};
use syntable_model::scene::{Mesh, Topology};

/// Version of the decomposition: part of the key of cached parts. It rises whenever the same mesh and options give
/// other parts; a test pins the parts of this version.
pub const DECOMPOSITION_VERSION: u32 = 4;

/// Pieces are not cut thinner, meters.
const MIN_PIECE_M: f32 = 0.001;

/// Positions of cuts, as fractions of a piece's extent.
const FRACTIONS: [f32; 3] = [0.5, 0.25, 0.75];

/// Number of planes per axis that faces of a piece lie in and that are tried as cuts.
const FLAT_CUTS: usize = 4;

/// Cost factor of cuts in the plane of faces, which often border convex regions.
const FLAT_COST: f32 = 0.9;

/// Coordinates of faces in one plane agree to this, meters.
const FLAT_M: f32 = 1e-4;

/// Minimum angle between the faces at a sharp edge, radians.
const MIN_FOLD: f32 = 0.05;

/// A plane with at least this fraction of a piece's concave edges, by length times angle, is cut along.
const MIN_NOTCHED: f32 = 0.2;

/// Number of faces of a piece that decide between cuts.
const COARSE: usize = 240;

/// Hulls that decide between cuts.
const COARSE_HULL: HullOptions = HullOptions { tolerance: 0.001, max_vertices: 24, ..units::HULL_OPTIONS };

/// Hulls are sampled down to this fraction of their size.
const FINEST: f32 = 0.01;

/// The deviation of a single hull is measured to this, meters.
const HULL_PRECISION_M: f32 = 0.003;

/// Maximum ratio of open edges to faces of a closed mesh, for which one ray distinguishes inside from outside.
const MAX_OPEN: f64 = 0.02;

/// Direction of rays: along no axis, so that a ray is parallel to few faces.
const RAY: Vector = Vector::new(0.182_574_19, 0.365_148_37, 0.912_870_9);

/// How a mesh becomes convex parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// One hull of all vertices.
    Hull,
    /// Cuts by planes until the bound holds.
    Cuts {
        /// Bound of the deviation, meters.
        max_deviation_m: f32,
        /// Maximum number of parts. When it is reached, the deviation may exceed the bound.
        max_parts: usize,
    },
}

/// Convex parts of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexParts {
    /// Their hulls, body frame, meters; empty if no point is finite.
    pub hulls: Vec<ConvexHull>,
    /// Largest deviation of a part from the mesh, meters.
    pub deviation_m: f32,
}

/// Computes the convex parts of a mesh.
pub fn convex_parts(mesh: &Mesh, method: Method) -> ConvexParts {
    let surface = ReferenceSurface::new(mesh);
    match method {
        Method::Cuts { max_deviation_m, max_parts } => cuts(mesh, &surface, max_deviation_m, max_parts),
        Method::Hull => {
            let used: Vec<[f32; 3]> =
                mesh.data().triangles.iter().flatten().map(|&i| mesh.data().positions[i as usize]).collect();
            let hulls = Vec::from_iter(units::hull(&used));
            let deviation =
                |hull: &ConvexHull| Piece::of_hull(hull.clone()).deviation(&surface, HULL_PRECISION_M, f32::INFINITY).0;
            let deviation_m = hulls.iter().map(deviation).fold(0.0, f32::max);
            ConvexParts { hulls, deviation_m }
        }
    }
}

/// Convex parts by cuts.
fn cuts(mesh: &Mesh, surface: &ReferenceSurface, bound: f32, max_parts: usize) -> ConvexParts {
    let data = mesh.data();
    let corners = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Vector::from(data.positions[i as usize]));
        if surface.is_inverted { [a, c, b] } else { [a, b, c] }
    };
    let triangles: Vec<Triangle> = data.triangles.iter().map(corners).collect();
    let notches = notches(&triangles);
    let Some(whole) = Piece::new(triangles, notches, bound, surface) else {
        return ConvexParts { hulls: Vec::new(), deviation_m: 0.0 };
    };
    let size = (whole.high - whole.low).max_element();
    let mut open = vec![whole];
    let mut done: Vec<Piece> = Vec::new();
    // Joining takes some of the pieces away again.
    while open.len() + done.len() < 2 * max_parts - 1 {
        let worst = (0..open.len()).max_by(|&a, &b| open[a].deviation.total_cmp(&open[b].deviation).then(b.cmp(&a)));
        let Some(worst) = worst.filter(|&worst| open[worst].deviation > bound) else { break };
        let piece = open.swap_remove(worst);
        match piece.cut(bound, surface) {
            Some(halves) => open.extend(halves),
            None => done.push(piece),
        }
    }
    done.extend(open);
    // Too many pieces are joined with a wider bound.
    let mut wider = bound;
    loop {
        join(&mut done, wider, surface);
        if done.len() <= max_parts || wider > size {
            break;
        }
        wider *= 1.25;
    }
    let deviation_m = done.iter().map(|piece| piece.deviation).fold(0.0, f32::max);
    ConvexParts { hulls: done.into_iter().map(|piece| piece.hull).collect(), deviation_m }
}

/// The whole mesh, to measure against.
struct ReferenceSurface {
    mesh: Option<TriMesh>,
    /// Whether the faces look inwards.
    is_inverted: bool,
    /// Whether the mesh has holes, through which a ray from the inside may leave.
    is_open: bool,
}

impl ReferenceSurface {
    fn new(mesh: &Mesh) -> Self {
        let data = mesh.data();
        let topology = Topology::of(mesh);
        let loose = topology.boundary_edges + topology.misoriented_edges;
        let points = data.positions.iter().map(|&p| Vector::from(p)).collect();
        Self {
            mesh: TriMesh::new(points, data.triangles.clone()).ok(),
            is_inverted: topology.signed_volume < 0.0,
            is_open: loose as f64 > MAX_OPEN * data.triangles.len() as f64,
        }
    }

    /// Distance of a point from the mesh.
    fn distance(&self, point: Vector) -> f32 {
        self.mesh.as_ref().map_or(0.0, |mesh| mesh.distance_to_local_point(point, false))
    }

    /// Whether a point is outside the solid: a ray from it meets no face, or the outer side of one. In a mesh with
    /// holes, most of the rays into all octants must do so: a box without a bottom is solid, as for its mass.
    fn is_outside(&self, point: Vector) -> bool {
        let Some(mesh) = &self.mesh else { return true };
        let gets_out = |direction: Vector| {
            let hit = mesh.cast_local_ray_and_get_normal(&Ray::new(point, direction), f32::MAX, true);
            // Parry numbers the side of a triangle with its normal 0.
            hit.is_none_or(|hit| (hit.feature == FeatureId::Face(0)) != self.is_inverted)
        };
        if !self.is_open {
            return gets_out(RAY);
        }
        let octant = |i: u32| RAY * Vector::from([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { 1.0 } else { -1.0 }));
        (0..8).filter(|&i| gets_out(octant(i))).count() > 4
    }
}

type Triangle = [Vector; 3];

/// A concave edge, or a remaining part of one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Notch {
    ends: [Vector; 2],
    /// Angle between the normals of its faces, radians.
    fold: f32,
}

impl Notch {
    fn weight(&self) -> f32 {
        (self.ends[1] - self.ends[0]).length() * self.fold
    }

    /// Position of a plane across an axis that contains the edge, in steps of `FLAT_M`.
    fn plane(&self, axis: usize) -> Option<i64> {
        let [p, q] = self.ends.map(|end| end[axis]);
        ((p - q).abs() < FLAT_M).then(|| (p / FLAT_M).round() as i64)
    }

    /// The parts below and above a plane across an axis. An edge in the plane is no longer concave.
    fn halves(&self, axis: usize, at: f32) -> [Option<Self>; 2] {
        let [p, q] = self.ends;
        if (p[axis] - at).abs().max((q[axis] - at).abs()) <= FLAT_M {
            return [None, None];
        }
        let is_above = |p: Vector| p[axis] > at;
        if is_above(p) == is_above(q) {
            return if is_above(p) { [None, Some(*self)] } else { [Some(*self), None] };
        }
        let crossing = p + (q - p) * ((at - p[axis]) / (q[axis] - p[axis]));
        let (low, high) = if is_above(p) { (q, p) } else { (p, q) };
        [low, high].map(|end| Some(Self { ends: [end, crossing], fold: self.fold }))
    }
}

/// The concave edges of faces that look outwards. Corners with equal positions are one.
fn notches(triangles: &[Triangle]) -> Vec<Notch> {
    let key = |p: Vector| p.to_array().map(f32::to_bits);
    let normal = |[a, b, c]: Triangle| (b - a).cross(c - a).try_normalize();
    // By the ends of the edge: the face that runs through it from the first to the second, and its third corner.
    let mut faces: BTreeMap<[[u32; 3]; 2], (Vector, Vector)> = BTreeMap::new();
    for &triangle in triangles {
        let Some(normal) = normal(triangle) else { continue };
        for i in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|k| triangle[(i + k) % 3]);
            faces.insert([key(a), key(b)], (normal, c));
        }
    }
    let mut found = Vec::new();
    for (&[from, to], (normal, _)) in faces.iter().filter(|([from, to], _)| from < to) {
        let Some((other, corner)) = faces.get(&[to, from]) else { continue };
        let ends = [from, to].map(|bits| Vector::from(bits.map(f32::from_bits)));
        let fold = libm::atan2f(normal.cross(*other).length(), normal.dot(*other));
        if fold >= MIN_FOLD && (*corner - ends[0]).dot(*normal) > 0.0 {
            found.push(Notch { ends, fold });
        }
    }
    found
}

/// A part of the surface, and its hull.
struct Piece {
    triangles: Vec<Triangle>,
    notches: Vec<Notch>,
    hull: ConvexHull,
    low: Vector,
    high: Vector,
    deviation: f32,
    /// Point of the largest deviation.
    worst: Vector,
}

impl Piece {
    /// `None` if no corner is finite.
    fn new(triangles: Vec<Triangle>, notches: Vec<Notch>, bound: f32, surface: &ReferenceSurface) -> Option<Self> {
        let points: Vec<[f32; 3]> = triangles.iter().flatten().map(Vector::to_array).collect();
        let hull = units::hull(&points)?;
        let low = triangles.iter().flatten().fold(Vector::splat(f32::INFINITY), |low, p| low.min(*p));
        let high = triangles.iter().flatten().fold(Vector::splat(f32::NEG_INFINITY), |high, p| high.max(*p));
        let mut piece = Self { triangles, notches, hull, low, high, deviation: 0.0, worst: low };
        (piece.deviation, piece.worst) = piece.deviation(surface, bound, f32::INFINITY);
        Some(piece)
    }

    /// A part with a known hull only.
    fn of_hull(hull: ConvexHull) -> Self {
        let points = || hull.points.iter().map(|&p| Vector::from(p));
        let low = points().fold(Vector::splat(f32::INFINITY), |low, p| low.min(p));
        let high = points().fold(Vector::splat(f32::NEG_INFINITY), |high, p| high.max(p));
        Self { triangles: Vec::new(), notches: Vec::new(), hull, low, high, deviation: 0.0, worst: low }
    }

    /// The largest distance of the hull from the mesh outside the solid, and its point. Returns any distance above
    /// `enough` if one exists. Distances below the bound are not distinguished.
    fn deviation(&self, surface: &ReferenceSurface, bound: f32, enough: f32) -> (f32, Vector) {
        let size = (self.high - self.low).max_element();
        let finest = bound.max(FINEST * size);
        let mut found = (0.0, self.low);
        let mut level: Vec<Triangle> =
            self.hull.triangles.iter().map(|t| t.map(|i| Vector::from(self.hull.points[i as usize]))).collect();
        // Level by level, so that distant points are found before near ones are refined.
        while !level.is_empty() {
            let mut next = Vec::new();
            for [a, b, c] in level {
                let center = (a + b + c) / 3.0;
                let radius = (a - center).length().max((b - center).length()).max((c - center).length());
                let distance = surface.distance(center);
                if distance > found.0 && surface.is_outside(center) {
                    found = (distance, center);
                    if distance > enough {
                        return found;
                    }
                }
                // Between two points, the distance changes by at most their distance.
                if distance + radius > found.0.max(bound) && radius > finest {
                    let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
                    next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                }
            }
            level = next;
        }
        found
    }

    /// The pieces on the two sides of the best cut; `None` if no cut is possible.
    fn cut(&self, bound: f32, surface: &ReferenceSurface) -> Option<[Self; 2]> {
        let (axis, at) = self.notched_plane().or_else(|| self.best_plane())?;
        let [one, two] = halves(&self.triangles, axis, at);
        let notches = |side: usize| self.notches.iter().filter_map(|notch| notch.halves(axis, at)[side]).collect();
        Some([Self::new(one, notches(0), bound, surface)?, Self::new(two, notches(1), bound, surface)?])
    }

    /// Whether a plane leaves more than a thin slice on both sides.
    fn is_within(&self, axis: usize, at: f32) -> bool {
        at - self.low[axis] >= MIN_PIECE_M && self.high[axis] - at >= MIN_PIECE_M
    }

    /// The plane with most concave edges, as an axis and a position on it, if they are a good part of all.
    fn notched_plane(&self) -> Option<(usize, f32)> {
        let mut planes: BTreeMap<(usize, i64), (f32, f32)> = BTreeMap::new();
        for notch in &self.notches {
            for axis in 0..3 {
                if let Some(plane) = notch.plane(axis).filter(|_| self.is_within(axis, notch.ends[0][axis])) {
                    planes.entry((axis, plane)).or_insert((0.0, notch.ends[0][axis])).0 += notch.weight();
                }
            }
        }
        let all: f32 = self.notches.iter().map(Notch::weight).sum();
        let most = planes.into_iter().reduce(|a, b| if b.1.0 > a.1.0 { b } else { a });
        let ((axis, _), (_, at)) = most.filter(|(_, (weight, _))| *weight >= MIN_NOTCHED * all)?;
        Some((axis, at))
    }

    /// The plane that leaves the least volume after one more cut of either side, as an axis and a position on it.
    fn best_plane(&self) -> Option<(usize, f32)> {
        let coarse: Vec<Triangle> = self.triangles.iter().step_by(self.triangles.len() / COARSE + 1).copied().collect();
        let mut best: Option<(f32, usize, f32)> = None;
        for axis in 0..3 {
            let (low, high) = (self.low[axis], self.high[axis]);
            for (at, factor) in self.positions(axis) {
                if !self.is_within(axis, at) {
                    continue;
                }
                let sides = halves(&coarse, axis, at);
                if sides.iter().any(Vec::is_empty) {
                    continue;
                }
                let off_center = (2.0 * at - low - high).abs() / (high - low);
                // Of equal cuts, the one with less volume now, then the one nearer to the middle.
                let cost = |side: &Vec<Triangle>| volume_cut_again(side) + 0.02 * volume(side);
                let cost = sides.iter().map(cost).sum::<f32>() * factor * (1.0 + 0.02 * off_center);
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, at));
                }
            }
        }
        best.map(|(_, axis, at)| (axis, at))
    }

    /// Candidate positions of a cut across an axis, with cost factors.
    fn positions(&self, axis: usize) -> Vec<(f32, f32)> {
        let (low, high) = (self.low[axis], self.high[axis]);
        let mut positions: Vec<(f32, f32)> =
            FRACTIONS.iter().map(|fraction| (low + fraction * (high - low), 1.0)).collect();
        positions.push((self.worst[axis], 1.0));
        // Faces across the axis, by their position.
        let mut flat: BTreeMap<i64, (f32, f32)> = BTreeMap::new();
        for [a, b, c] in &self.triangles {
            if (a[axis] - b[axis]).abs().max((a[axis] - c[axis]).abs()) < FLAT_M {
                let area = (*b - *a).cross(*c - *a).length();
                let entry = flat.entry((a[axis] / FLAT_M).round() as i64).or_insert((0.0, a[axis]));
                entry.0 += area;
            }
        }
        let mut flat: Vec<(f32, f32)> = flat.into_values().collect();
        flat.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
        let inside = flat.into_iter().map(|(_, at)| at).filter(|at| self.is_within(axis, *at));
        positions.extend(inside.take(FLAT_CUTS).map(|at| (at, FLAT_COST)));
        positions
    }

    /// The two as one, if that keeps within a bound.
    fn joined(&self, other: &Self, bound: f32, surface: &ReferenceSurface) -> Option<Self> {
        let points = [&self.hull.points[..], &other.hull.points[..]].concat();
        if Self::of_hull(units::hull(&points)?).deviation(surface, bound, bound).0 > bound {
            return None;
        }
        // Hulls of hulls would lose the tolerance of each.
        let triangles = [&self.triangles[..], &other.triangles[..]].concat();
        Self::new(triangles, Vec::new(), bound, surface).filter(|piece| piece.deviation <= bound)
    }

    /// Whether the bounding boxes meet.
    fn is_near(&self, other: &Self) -> bool {
        (0..3).all(|i| self.low[i] <= other.high[i] + FLAT_M && other.low[i] <= self.high[i] + FLAT_M)
    }
}

/// Joins neighbors while the bound holds, first those whose joint hull adds the least volume.
fn join(pieces: &mut Vec<Piece>, bound: f32, surface: &ReferenceSurface) {
    let mut names: Vec<u64> = (0..pieces.len() as u64).collect();
    let mut next = pieces.len() as u64;
    let mut refused: BTreeSet<[u64; 2]> = BTreeSet::new();
    let mut added: BTreeMap<[u64; 2], f32> = BTreeMap::new();
    loop {
        let mut pairs: Vec<(f32, usize, usize)> = Vec::new();
        for i in 0..pieces.len() {
            for k in i + 1..pieces.len() {
                let name = [names[i].min(names[k]), names[i].max(names[k])];
                if refused.contains(&name) || !pieces[i].is_near(&pieces[k]) {
                    continue;
                }
                let (one, two) = (&pieces[i].hull, &pieces[k].hull);
                let volume = *added.entry(name).or_insert_with(|| {
                    let both = extremes(&[&one.points[..], &two.points[..]].concat());
                    ConvexHull::new(&both, &COARSE_HULL)
                        .map_or(f32::INFINITY, |hull| hull.volume() - one.volume() - two.volume())
                });
                pairs.push((volume, i, k));
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut joined = None;
        for &(_, i, k) in &pairs {
            let name = [names[i].min(names[k]), names[i].max(names[k])];
            joined = pieces[i].joined(&pieces[k], bound, surface).map(|piece| (piece, i, k));
            if joined.is_some() {
                break;
            }
            refused.insert(name);
        }
        let Some((piece, i, k)) = joined else { return };
        pieces.remove(k);
        names.remove(k);
        pieces[i] = piece;
        names[i] = next;
        next += 1;
    }
}

/// The parts of triangles below and above a plane across an axis. Faces in the plane go to the side of their solid.
fn halves(triangles: &[Triangle], axis: usize, at: f32) -> [Vec<Triangle>; 2] {
    let mut sides = [Vec::new(), Vec::new()];
    for triangle in triangles {
        if triangle.iter().all(|p| p[axis] == at) {
            let [a, b, c] = *triangle;
            sides[usize::from((b - a).cross(c - a)[axis] < 0.0)].push(*triangle);
            continue;
        }
        let mut polygons = [[Vector::ZERO; 4]; 2];
        let mut corners = [0; 2];
        let mut give = |side: usize, p: Vector| {
            polygons[side][corners[side]] = p;
            corners[side] += 1;
        };
        for i in 0..3 {
            let (p, q) = (triangle[i], triangle[(i + 1) % 3]);
            if p[axis] <= at {
                give(0, p);
            }
            if p[axis] >= at {
                give(1, p);
            }
            if (p[axis] < at && q[axis] > at) || (p[axis] > at && q[axis] < at) {
                // The same point whichever way the edge is run through.
                let (from, to) = if p[axis] < q[axis] { (p, q) } else { (q, p) };
                let mut crossing = from + (to - from) * ((at - from[axis]) / (to[axis] - from[axis]));
                crossing[axis] = at;
                give(0, crossing);
                give(1, crossing);
            }
        }
        for side in 0..2 {
            for i in 2..corners[side] {
                let [a, b, c] = [polygons[side][0], polygons[side][i - 1], polygons[side][i]];
                if (b - a).cross(c - a).length_squared() > 0.0 {
                    sides[side].push([a, b, c]);
                }
            }
        }
    }
    sides
}

/// Approximate volume of the hull of some faces.
fn volume(triangles: &[Triangle]) -> f32 {
    let points: Vec<[f32; 3]> = triangles.iter().flatten().map(Vector::to_array).collect();
    ConvexHull::new(&extremes(&points), &COARSE_HULL).map_or(0.0, |hull| hull.volume())
}

/// The least volume of the hulls after one more cut in the middle.
fn volume_cut_again(triangles: &[Triangle]) -> f32 {
    let low = triangles.iter().flatten().fold(Vector::splat(f32::INFINITY), |low, p| low.min(*p));
    let high = triangles.iter().flatten().fold(Vector::splat(f32::NEG_INFINITY), |high, p| high.max(*p));
    let cut = |axis: usize| {
        halves(triangles, axis, (low[axis] + high[axis]) / 2.0).iter().map(|half| volume(half)).sum::<f32>()
    };
    (0..3).map(cut).fold(f32::INFINITY, f32::min)
}

/// The points that are farthest along the axes and diagonals and halfway between them: 50 directions at most.
fn extremes(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut farthest: BTreeSet<usize> = BTreeSet::new();
    for direction in 0..125 {
        let [x, y, z] = [direction % 5, direction / 5 % 5, direction / 25].map(|i| i as f32 - 2.0);
        let count = |length: f32| [x, y, z].iter().filter(|i| i.abs() == length).count();
        // No direction twice.
        if !matches!((count(2.0), count(1.0)), (0, 1..) | (1, 1)) {
            continue;
        }
        let mut best = (f32::NEG_INFINITY, 0);
        for (i, p) in points.iter().enumerate() {
            let reach = x * p[0] + y * p[1] + z * p[2];
            if reach > best.0 {
                best = (reach, i);
            }
        }
        farthest.insert(best.1);
    }
    farthest.into_iter().filter_map(|i| points.get(i).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull_codec;
    use crate::kit;
    use crate::units::HULL_OPTIONS;
    use syntable_model::digest::Hasher;
    use syntable_model::scene::MeshData;

    /// Vertices of hulls are rounded to the grid.
    const ROUNDING: f32 = 3.0 * HULL_OPTIONS.grid;
    const DEFAULT: Method = Method::Cuts { max_deviation_m: 0.008, max_parts: 64 };

    /// Largest distance of a vertex from its nearest part, meters.
    fn max_distance(data: &MeshData, parts: &[ConvexHull]) -> f32 {
        let distance = |p: [f32; 3]| parts.iter().map(|part| part.max_plane_distance(p)).fold(f32::INFINITY, f32::min);
        data.triangles.iter().flatten().map(|&i| distance(data.positions[i as usize])).fold(f32::NEG_INFINITY, f32::max)
    }

    /// Outward unit normals and offsets of a hull's faces.
    fn planes(hull: &ConvexHull) -> Vec<(Vector, f32)> {
        let plane = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| Vector::from(hull.points[i as usize]));
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((normal, normal.dot(a)))
        };
        hull.triangles.iter().filter_map(plane).collect()
    }

    /// Largest height above the mesh at which a thin needle from above rests on the parts, over a grid, meters. The
    /// deviation bounds it; this is brute force.
    fn hover(mesh: &Mesh, parts: &[ConvexHull]) -> f32 {
        let points: Vec<Vector> = mesh.data().positions.iter().map(|&p| Vector::from(p)).collect();
        let surface = TriMesh::new(points, mesh.data().triangles.clone()).expect("a mesh");
        let all: Vec<Vec<(Vector, f32)>> = parts.iter().map(planes).collect();
        let (low, high) = (mesh.bounds().min, mesh.bounds().max);
        let mut worst = 0.0_f32;
        for i in 0..60 {
            for k in 0..60 {
                let at = |n: i32, axis: usize| low[axis] + (f64::from(n) + 0.5) / 60.0 * (high[axis] - low[axis]);
                let from = Vector::new(at(i, 0) as f32, at(k, 1) as f32, high.z as f32 + 0.01);
                let Some(depth) = surface.cast_local_ray(&Ray::new(from, -Vector::Z), 10.0, true) else { continue };
                // Points where the line enters and leaves a hull.
                let highest = all.iter().filter_map(|planes| {
                    let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
                    for (normal, offset) in planes {
                        let (rate, gap) = (-normal.z, offset - normal.dot(from));
                        if rate.abs() < 1e-9 {
                            if gap < 0.0 {
                                return None;
                            }
                        } else if rate < 0.0 {
                            enter = enter.max(gap / rate);
                        } else {
                            leave = leave.min(gap / rate);
                        }
                    }
                    (enter < leave).then_some(enter)
                });
                // Distance between the mesh and the needle's resting point, for any slope.
                let rest = highest.fold(f32::INFINITY, f32::min);
                if rest < depth {
                    worst = worst.max(surface.distance_to_local_point(from - Vector::Z * rest, false));
                }
            }
        }
        worst
    }

    #[test]
    fn parts_cover_the_surface_and_keep_to_it() {
        for (name, data) in kit::shape_kit() {
            let mesh = Mesh::new(data.clone()).expect("a sound mesh");
            let hull = convex_parts(&mesh, Method::Hull);
            assert_eq!(hull.hulls.len(), 1, "{name}");
            for bound in [0.003, 0.008] {
                let ConvexParts { hulls: parts, deviation_m } =
                    convex_parts(&mesh, Method::Cuts { max_deviation_m: bound, max_parts: 128 });
                let is_full = parts.iter().any(|part| part.points.len() >= HULL_OPTIONS.max_vertices);
                let limit = if is_full { 0.001 } else { HULL_OPTIONS.tolerance + ROUNDING };
                let (missed, hover) = (max_distance(&data, &parts), hover(&mesh, &parts));
                let told = format!("{name}: {} parts, {deviation_m} m deviation, {hover} m hover", parts.len());
                println!("{told}, {missed} m missed");
                assert!(missed <= limit, "{told}: {missed} m beyond them");
                assert!(deviation_m <= bound && hover <= bound + 0.0005, "{told}");
                assert!(hull.deviation_m >= deviation_m, "{told}, {} m of the hull", hull.deviation_m);
            }
        }
        // A hull of the bowl is filled to the brim: 65 mm deep.
        let bowl = Mesh::new(kit::shape_kit().swap_remove(1).1).expect("a sound mesh");
        let hull = convex_parts(&bowl, Method::Hull);
        assert!((hull.deviation_m - 0.065).abs() < 0.003, "{}", hull.deviation_m);
    }

    #[test]
    fn a_box_without_a_bottom_stays_full() {
        // An open mesh: most rays from the inside hit an inner side, so their origins are not hollows.
        let whole = kit::cuboid([0.0; 3], [0.1, 0.2, 0.3]);
        let triangles =
            whole.triangles.iter().copied().filter(|t| t.iter().any(|&i| whole.positions[i as usize][2] > 0.0));
        let mesh = Mesh::new(MeshData { triangles: triangles.collect(), ..whole }).expect("a sound mesh");
        assert_eq!(mesh.data().triangles.len(), 10);
        assert_eq!(convex_parts(&mesh, DEFAULT).hulls.len(), 1);
    }

    #[test]
    fn what_hovers_above_a_tray_is_reported() {
        let mesh = Mesh::new(kit::tray([0.6, 0.4, 0.03], 0.01)).expect("a sound mesh");
        let parts = convex_parts(&mesh, Method::Cuts { max_deviation_m: 0.001, max_parts: 64 });
        let above = hover(&mesh, &parts.hulls);
        // A bottom and four sides.
        let told = format!("{} parts, {} m, {above} m above it", parts.hulls.len(), parts.deviation_m);
        assert!(parts.hulls.len() == 5 && parts.deviation_m < 1e-4 && above < 3e-4, "{told}");
        let one = convex_parts(&mesh, Method::Cuts { max_deviation_m: 0.001, max_parts: 1 });
        assert!((one.deviation_m - 0.02).abs() < 0.001, "the whole recess is filled: {}", one.deviation_m);
    }

    #[test]
    fn convex_and_inside_out_meshes_are_one_part() {
        let ball = kit::sphere(0.03);
        let inside_out =
            MeshData { triangles: ball.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..ball.clone() };
        for data in [ball, inside_out, kit::cuboid([0.0; 3], [0.1, 0.2, 0.3])] {
            let parts = convex_parts(&Mesh::new(data.clone()).expect("sound"), DEFAULT);
            assert_eq!(parts.hulls.len(), 1);
            assert!(max_distance(&data, &parts.hulls) < 0.001);
        }
    }

    #[test]
    fn real_objects_are_covered() {
        // At most seven of each folder. None needs all of its parts.
        let objects = kit::assets().into_iter().flat_map(|root| {
            let objects = kit::real_objects(&root);
            let step = objects.len().div_ceil(7).max(1);
            objects.into_iter().step_by(step)
        });
        let objects: Vec<_> = objects.collect();
        assert!(objects.len() >= 5, "{} objects", objects.len());
        for object in objects {
            let start = std::time::Instant::now();
            let ConvexParts { hulls: parts, deviation_m } = convex_parts(&object.mesh, DEFAULT);
            let seconds = start.elapsed().as_secs_f64();
            let missed = max_distance(object.mesh.data(), &parts);
            let vertices: Vec<usize> = parts.iter().map(|part| part.points.len()).collect();
            println!(
                "{}: {} parts in {seconds:.1} s, {deviation_m} m deviation, {} vertices, {missed} m missed",
                object.name,
                parts.len(),
                vertices.iter().sum::<usize>()
            );
            assert!(missed < 0.002, "{}: {missed} m", object.name);
            assert!(deviation_m <= 0.008 && parts.len() < 64, "{}: {deviation_m} m, {}", object.name, parts.len());
        }
    }

    #[test]
    fn the_parts_of_this_version_are_pinned() {
        let mut hasher = Hasher::new("parts");
        for (name, data) in kit::shape_kit() {
            let parts = convex_parts(&Mesh::new(data).expect("a sound mesh"), DEFAULT);
            hasher = hasher.text(name).bytes(&hull_codec::encode(&parts));
        }
        let pinned = (4, "a06e8115064a4ea88aa8e8dde5aa111a");
        let found = (DECOMPOSITION_VERSION, hasher.finish().to_string());
        assert_eq!(
            (found.0, &found.1[..]),
            pinned,
            "other parts than before: raise DECOMPOSITION_VERSION and pin them"
        );
    }
}
