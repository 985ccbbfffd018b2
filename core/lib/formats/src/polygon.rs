//! Rasterizes polygons to masks, with the same pixels as pycocotools.
//!
//! An outline is traced on a grid five times as fine as the pixels. Where the trace passes the center of a column, the
//! mask changes between unset and set from that row on.

use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;

/// Grid lines per pixel.
const FINE: f64 = 5.0;
/// Largest coordinate of an outline, px. It limits the length of a trace.
const LARGEST: f64 = 65_536.0;

/// The mask of one outline `[x0, y0, x1, y1, …]`. Parts outside the image are cut off.
pub fn rasterize(outline: &[f64], width: u32, height: u32) -> Result<Mask> {
    if outline.len() < 6 || outline.len() % 2 == 1 {
        return Err(Error::new(format!("a polygon of {} numbers", outline.len()))
            .help("a polygon is a list x0, y0, x1, y1, … of at least three points"));
    }
    if let Some(wrong) = outline.iter().find(|value| value.is_nan() || value.abs() > LARGEST) {
        return Err(Error::new(format!("a polygon has the coordinate {wrong}; the largest is {LARGEST} px")));
    }
    let mut flips: Vec<u32> = Vec::new();
    let mut before: Option<[i64; 2]> = None;
    trace(outline.as_chunks().0, |point| {
        flips.extend(before.and_then(|before| crossing(before, point, width, height)));
        before = Some(point);
    });
    flips.sort_unstable();
    // Two changes at one pixel cancel each other.
    let mut changes: Vec<u32> = Vec::with_capacity(flips.len());
    for flip in flips {
        if changes.last() == Some(&flip) {
            changes.pop();
        } else {
            changes.push(flip);
        }
    }
    Ok(Mask::from_flips(width, height, &changes))
}

/// A point on the fine grid.
fn grid(point: &[f64; 2]) -> [i64; 2] {
    point.map(|value| (FINE * value + 0.5) as i64)
}

/// The corners of a closed outline on the fine grid, from one to the next.
fn edges(points: &[[f64; 2]]) -> impl Iterator<Item = [[i64; 2]; 2]> {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(from, to)| [grid(from), grid(to)])
}

/// Number of steps of the trace of an outline, with coordinates clamped to the range that [`rasterize`] accepts.
pub fn steps(outline: &[f64]) -> u64 {
    let within = |value: f64| value.clamp(-LARGEST, LARGEST);
    let of = |[from, to]: [[i64; 2]; 2]| from[0].abs_diff(to[0]).max(from[1].abs_diff(to[1])) + 1;
    let points: Vec<[f64; 2]> = outline.as_chunks().0.iter().map(|point: &[f64; 2]| point.map(within)).collect();
    edges(&points).map(of).sum()
}

/// Calls `each` with the points of the closed outline on the fine grid, one step apart along the longer axis of each
/// edge.
fn trace(points: &[[f64; 2]], mut each: impl FnMut([i64; 2])) {
    for edge in edges(points) {
        let steps = [0, 1].map(|axis| edge[1][axis].abs_diff(edge[0][axis]) as i64);
        let long = usize::from(steps[0] < steps[1]);
        // Edges are walked upwards, so that an edge has the same points in both directions.
        let backward = edge[0][long] > edge[1][long];
        let (from, to) = if backward { (edge[1], edge[0]) } else { (edge[0], edge[1]) };
        let slope = (to[1 - long] - from[1 - long]) as f64 / steps[long].max(1) as f64;
        for step in 0..=steps[long] {
            let t = if backward { steps[long] - step } else { step };
            let mut point = [0; 2];
            point[long] = from[long] + t;
            point[1 - long] = (from[1 - long] as f64 + slope * t as f64 + 0.5) as i64;
            each(point);
        }
    }
}

/// The position `x · height + y` where the mask changes, if a step of the trace passes a column's center.
fn crossing(from: [i64; 2], to: [i64; 2], width: u32, height: u32) -> Option<u32> {
    if from[0] == to[0] {
        return None;
    }
    let pixel = |fine: i64| (fine as f64 + 0.5) / FINE - 0.5;
    let x = pixel(if to[0] < from[0] { to[0] } else { to[0] - 1 });
    if x.floor() != x || x < 0.0 || x > f64::from(width) - 1.0 {
        return None;
    }
    let y = pixel(to[1].min(from[1])).clamp(0.0, f64::from(height)).ceil();
    let position = x as u32 * height + y as u32;
    (position < width * height).then_some(position)
}
