//! Level areas of bodies that carry objects: the bottom of a bin, the boards of a shelf, a tabletop.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use syntable_model::digest::Digest;
use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::scene::{Mesh, Object, Region, Support, SupportArea, Walls};

/// Cells along each edge of the mesh's bounding rectangle.
const CELLS: usize = 96;

/// A face is level if the vertical component of its unit normal is at least this.
const MIN_UP: f64 = 0.98;

/// Level faces within this height of each other are one area, meters.
const SAME_LEVEL_M: f64 = 0.006;

/// An area has at least this fraction of the mesh's bounding rectangle.
const MIN_FRACTION: f64 = 0.12;

/// Minimum length of an edge of an area, meters.
const MIN_EDGE_M: f64 = 0.03;

/// Minimum height of the space above an area, meters.
const MIN_CLEAR_M: f64 = 0.05;

/// Walls are at least this high, meters.
const MIN_WALL_M: f64 = 0.015;

/// Adds the areas of a body at a pose to the supports of a scene. The support of a body with one area has the name; several areas have
/// the name and a number, from the lowest. The number of the body, if any, comes first. Their space ends at a height, if any.
pub fn add_supports(
    scene: &mut SceneBuilder,
    (name, body): (&str, Option<usize>),
    areas: &[SupportArea],
    world_from_body: &Pose,
    end: Option<f64>,
) -> Result<()> {
    for (index, area) in areas.iter().enumerate() {
        let mut name = name.to_owned();
        if let Some(body) = body {
            name += &format!("/{}", body + 1);
        }
        if areas.len() > 1 {
            name += &format!("/{}", index + 1);
        }
        let support = Support::of_area(name, area, world_from_body);
        // A bin on a board has the rest of the board's space.
        let rest = end.map(|end| end - support.height()).into_iter().chain(support.clear_height_m);
        let clear_height_m = rest.reduce(f64::min);
        scene.supports.add(match clear_height_m {
            Some(height) => support.with_clear_height(height),
            None => support,
        })?;
    }
    Ok(())
}

/// The areas of objects, kept for those whose meshes were searched.
#[derive(Debug, Default)]
pub struct FoundAreas(Mutex<BTreeMap<Digest, Vec<SupportArea>>>);

impl Clone for FoundAreas {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl FoundAreas {
    /// The areas that an object states, or else the areas of its mesh.
    pub fn of(&self, object: &Object) -> Vec<SupportArea> {
        if !object.support_areas.is_empty() {
            return object.support_areas.clone();
        }
        let mut found = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        found.entry(object.digest).or_insert_with(|| support_areas(&object.mesh)).clone()
    }
}

/// The areas of a mesh, body frame, lowest first. Each is the largest rectangle along the axes in which level faces are at one height,
/// with free space above. An area with walls on all four sides gets the height of the lowest one.
pub fn support_areas(mesh: &Mesh) -> Vec<SupportArea> {
    let grid = Grid::of(mesh);
    let mut areas: Vec<SupportArea> = grid.levels(mesh).into_iter().filter_map(|level| grid.area(level)).collect();
    areas.sort_by(|a, b| a.surface.height().total_cmp(&b.surface.height()));
    areas
}

/// The heights of a mesh above the cells of a grid.
struct Grid {
    low: Point3<f64>,
    size: [f64; 2],
    /// By cell: the faces over its middle, lowest first.
    faces: Vec<Vec<FaceHeight>>,
    /// By cell: height of the highest edge of a face in it.
    highest: Vec<f64>,
}

/// A face over the middle of a cell.
#[derive(Clone, Copy)]
struct FaceHeight {
    z: f64,
    is_level: bool,
    faces_up: bool,
}

impl Grid {
    fn of(mesh: &Mesh) -> Self {
        let (bounds, cells) = (mesh.bounds(), CELLS * CELLS);
        let size = [bounds.size().x.max(1e-9), bounds.size().y.max(1e-9)];
        let mut grid =
            Self { low: bounds.min, size, faces: vec![Vec::new(); cells], highest: vec![f64::NEG_INFINITY; cells] };
        for triangle in 0..mesh.data().triangles.len() {
            let corners = mesh.corners(triangle);
            let [a, b, c] = corners;
            [[a, b], [b, c], [c, a]].into_iter().for_each(|edge| grid.raise(edge));
            let normal = (b - a).cross(&(c - a));
            if normal.z == 0.0 {
                continue;
            }
            let is_level = normal.z >= MIN_UP * normal.norm();
            let range = |axis: usize| {
                let at = corners.map(|p| grid.cell(&p, axis));
                let (low, high) = at.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
                low.floor().max(0.0) as usize..=(high as usize).min(CELLS - 1)
            };
            let (columns, rows) = (range(0), range(1));
            for k in rows {
                for i in columns.clone() {
                    let [x, y] = grid.middle(i, k);
                    let side = |p: &Point3<f64>, q: &Point3<f64>| {
                        ((q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)) * normal.z.signum()
                    };
                    if side(&a, &b) >= 0.0 && side(&b, &c) >= 0.0 && side(&c, &a) >= 0.0 {
                        let z = a.z - (normal.x * (x - a.x) + normal.y * (y - a.y)) / normal.z;
                        grid.faces[k * CELLS + i].push(FaceHeight { z, is_level, faces_up: normal.z > 0.0 });
                    }
                }
            }
        }
        grid.faces.iter_mut().for_each(|faces| faces.sort_by(|a, b| a.z.total_cmp(&b.z)));
        grid
    }

    /// Raises the cells that an edge goes through.
    fn raise(&mut self, [a, b]: [Point3<f64>; 2]) {
        let cells = (0..2).map(|axis| (self.cell(&a, axis) - self.cell(&b, axis)).abs()).fold(0.0, f64::max);
        let steps = (2.0 * cells).ceil().max(1.0);
        for step in 0..=steps as usize {
            let p = a + (b - a) * (step as f64 / steps);
            let [i, k] = [0, 1].map(|axis| (self.cell(&p, axis) as usize).min(CELLS - 1));
            let highest = &mut self.highest[k * CELLS + i];
            *highest = highest.max(p.z);
        }
    }

    /// Position of a point in cells.
    fn cell(&self, p: &Point3<f64>, axis: usize) -> f64 {
        (p[axis] - self.low[axis]) / self.size[axis] * CELLS as f64
    }

    fn middle(&self, i: usize, k: usize) -> [f64; 2] {
        let at = |number: usize, axis: usize| self.low[axis] + (number as f64 + 0.5) / CELLS as f64 * self.size[axis];
        [at(i, 0), at(k, 1)]
    }

    /// Heights of level faces that cover a large part of the bounding rectangle.
    fn levels(&self, mesh: &Mesh) -> Vec<f64> {
        let bounds = mesh.bounds();
        let count = (bounds.size().z / SAME_LEVEL_M).ceil() as usize + 1;
        let mut cells = vec![0_usize; count];
        let bin = |z: f64| (((z - bounds.min.z) / SAME_LEVEL_M) as usize).min(count - 1);
        for face in self.faces.iter().flatten().filter(|face| face.is_level) {
            cells[bin(face.z)] += 1;
        }
        let least = (MIN_FRACTION * (CELLS * CELLS) as f64) as usize;
        let mut levels = Vec::new();
        // The bins of one surface can be neighbors: the fuller one represents both.
        for (number, count) in cells.iter().enumerate() {
            let next = cells.get(number + 1).copied().unwrap_or(0);
            let before = number.checked_sub(1).map_or(0, |before| cells[before]);
            if count + next.max(before) >= least && *count >= next && *count > before {
                let within = |z: &f64| bin(*z).abs_diff(number) <= 1;
                let level = self.faces.iter().flatten().filter(|face| face.is_level);
                let mut heights: Vec<f64> = level.map(|face| face.z).filter(within).collect();
                let middle = heights.len() / 2;
                levels.push(*heights.select_nth_unstable_by(middle, f64::total_cmp).1);
            }
        }
        levels
    }

    /// The area at a height.
    fn area(&self, level: f64) -> Option<SupportArea> {
        // Clear height over each cell that the level covers. Below a face that faces up is a solid, such as a wall.
        let clear = |faces: &Vec<FaceHeight>| {
            let at = faces.iter().rposition(|face| face.is_level && (face.z - level).abs() <= SAME_LEVEL_M)?;
            let clear = match faces[at + 1..].iter().find(|face| face.z - level > SAME_LEVEL_M) {
                Some(above) if above.faces_up => return None,
                Some(above) => above.z - level,
                None => f64::INFINITY,
            };
            (clear >= MIN_CLEAR_M).then_some(clear)
        };
        let clear: Vec<Option<f64>> = self.faces.iter().map(clear).collect();
        let [columns, rows] = largest_rectangle(&clear.iter().map(Option::is_some).collect::<Vec<_>>())?;
        let cells = || rows.clone().flat_map(|k| columns.clone().map(move |i| k * CELLS + i));
        let clear_height = cells().filter_map(|cell| clear[cell]).fold(f64::INFINITY, f64::min);
        let edge = [columns.len(), rows.len()];
        // The level covers the middles of the cells at the border, but not always their outer halves.
        let size = [0, 1].map(|axis| (edge[axis] as f64 - 1.0) / CELLS as f64 * self.size[axis]);
        let fraction = (edge[0] * edge[1]) as f64 / (CELLS * CELLS) as f64;
        if fraction < MIN_FRACTION || size.iter().any(|edge| *edge < MIN_EDGE_M) {
            return None;
        }
        let start = [columns.start, rows.start];
        let center = [0, 1].map(|axis| {
            self.low[axis] + (start[axis] as f64 + edge[axis] as f64 / 2.0) / CELLS as f64 * self.size[axis]
        });
        Some(SupportArea {
            surface: Region::rectangle([center[0], center[1], level], size),
            clear_height_m: Some(clear_height).filter(|height| height.is_finite()),
            // Below a higher board, the edges beside the area belong to that board.
            walls: self.walls(level, &columns, &rows).filter(|_| clear_height.is_infinite()),
        })
    }

    /// The walls around a rectangle of cells.
    fn walls(&self, level: f64, columns: &std::ops::Range<usize>, rows: &std::ops::Range<usize>) -> Option<Walls> {
        let highest = |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>| {
            let cells = rows.flat_map(|k| columns.clone().map(move |i| k * CELLS + i));
            cells.map(|cell| self.highest[cell]).fold(f64::NEG_INFINITY, f64::max)
        };
        let sides = [
            highest(0..columns.start, rows.clone()),
            highest(columns.end..CELLS, rows.clone()),
            highest(columns.clone(), 0..rows.start),
            highest(columns.clone(), rows.end..CELLS),
        ];
        let height_m = sides.into_iter().fold(f64::INFINITY, f64::min) - level;
        (height_m >= MIN_WALL_M).then_some(Walls { height_m, draft_m: 0.0 })
    }
}

/// The largest rectangle of marked cells, as ranges of columns and rows.
fn largest_rectangle(marked: &[bool]) -> Option<[std::ops::Range<usize>; 2]> {
    let mut best: Option<(usize, [std::ops::Range<usize>; 2])> = None;
    let mut heights = [0_usize; CELLS];
    for row in 0..CELLS {
        for (column, height) in heights.iter_mut().enumerate() {
            *height = if marked[row * CELLS + column] { *height + 1 } else { 0 };
        }
        // The largest rectangle under the heights that end at this row: a stack of open ones, with rising heights.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for column in 0..=CELLS {
            let height = heights.get(column).copied().unwrap_or(0);
            let mut start = column;
            while let Some((left, tall)) = open.pop_if(|(_, tall)| *tall > height) {
                let area = tall * (column - left);
                if best.as_ref().is_none_or(|(largest, _)| area > *largest) {
                    best = Some((area, [left..column, row + 1 - tall..row + 1]));
                }
                start = left;
            }
            open.push((start, height));
        }
    }
    best.map(|(_, ranges)| ranges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn the_largest_rectangle_agrees_with_trying_all() {
        let mut stream = Stream::root(3);
        for _ in 0..20 {
            // A few marked blocks on an empty grid keep brute force small.
            let mut marked = vec![false; CELLS * CELLS];
            let blocks: Vec<[usize; 4]> = (0..4)
                .map(|_| std::array::from_fn(|k| if k < 2 { stream.below(10) } else { 1 + stream.below(6) } as usize))
                .collect();
            for [x, y, w, h] in &blocks {
                (*y..y + h).for_each(|k| (*x..x + w).for_each(|i| marked[k * CELLS + i] = true));
            }
            let [columns, rows] = largest_rectangle(&marked).expect("marked");
            assert!(rows.clone().all(|k| columns.clone().all(|i| marked[k * CELLS + i])));
            let full =
                |x0: usize, x1: usize, y0: usize, y1: usize| (y0..y1).all(|k| (x0..x1).all(|i| marked[k * CELLS + i]));
            let mut largest = 0;
            for x0 in 0..16 {
                for x1 in x0 + 1..=16 {
                    for y0 in 0..16 {
                        for y1 in y0 + 1..=16 {
                            if (x1 - x0) * (y1 - y0) > largest && full(x0, x1, y0, y1) {
                                largest = (x1 - x0) * (y1 - y0);
                            }
                        }
                    }
                }
            }
            assert_eq!(columns.len() * rows.len(), largest);
        }
        assert!(largest_rectangle(&vec![false; CELLS * CELLS]).is_none());
    }
}
