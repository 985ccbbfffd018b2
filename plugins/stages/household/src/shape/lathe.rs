//! Solids of revolution about z.

use super::{Point3, Profile, SlotMapping, SolidShape, Uv};
use std::f64::consts::TAU;

/// A convex polygon of (radius, height) nodes: one cell of a hollow solid's wall.
pub type WallCell = Vec<[f64; 2]>;

/// Revolves an [`Profile`] about z.
pub struct Lathe {
    points: Vec<([f64; 2], SlotMapping)>,
    closed: bool,
    segments: usize,
}

impl Lathe {
    /// Starts from an outline: from the axis to the axis, or a loop.
    pub fn new(outline: &Profile) -> Self {
        Self { points: outline.points(), closed: outline.is_closed(), segments: 48 }
    }

    /// Number of segments around the axis.
    pub fn segments(mut self, segments: usize) -> Self {
        self.segments = segments;
        self
    }

    /// The surface without collision parts.
    pub fn surface(&self) -> SolidShape {
        let mut shape = SolidShape::default();
        let rings: Vec<LatheRing> = self.points.iter().map(|&(rz, _)| self.ring(&mut shape, rz)).collect();
        let widest = self.points.iter().map(|(rz, _)| rz[0]).fold(0.0, f64::max);
        let count = self.points.len();
        let mut run = (SlotMapping::fit(0), 0.0, 0.0);
        let mut along = 0.0;
        for i in 0..if self.closed { count } else { count - 1 } {
            let next = (i + 1) % count;
            let (from, (to, mapping)) = (self.points[i].0, self.points[next]);
            if i == 0 || mapping != run.0 {
                run = (mapping, along, self.run_length(i, mapping));
            }
            let length = libm::hypot(to[0] - from[0], to[1] - from[1]);
            let v = |s: f64| match mapping.uv {
                Uv::Tile(tile) => s / tile,
                _ => (s - run.1) / f64::max(run.2, 1e-12),
            };
            let repeats = match mapping.uv {
                Uv::Tile(tile) => (TAU * widest / tile).round().max(1.0),
                _ => 1.0,
            };
            self.band(
                &mut shape,
                [&rings[i], &rings[next]],
                [from, to],
                [v(along), v(along + length)],
                repeats,
                mapping,
            );
            along += length;
        }
        shape
    }

    /// The surface, with the hull of everything as its collision part.
    pub fn solid(&self) -> SolidShape {
        let hull = revolved(&self.points.iter().map(|(rz, _)| *rz).collect::<Vec<_>>(), self.segments);
        self.surface().with_part(hull)
    }

    /// The surface, with one collision part for the outline in each band of heights `[low, high]`.
    pub fn banded(&self, bands: &[[f64; 2]]) -> SolidShape {
        bands.iter().fold(self.surface(), |shape, &band| {
            let inside = self.clipped(band);
            if inside.is_empty() { shape } else { shape.with_part(revolved(&inside, self.segments)) }
        })
    }

    /// The outline's points between two heights, and its crossings with them.
    fn clipped(&self, [low, high]: [f64; 2]) -> Vec<[f64; 2]> {
        let mut inside: Vec<[f64; 2]> =
            self.points.iter().map(|(rz, _)| *rz).filter(|rz| (low..=high).contains(&rz[1])).collect();
        for pair in self.points.windows(2) {
            let ([r0, z0], [r1, z1]) = (pair[0].0, pair[1].0);
            for z in [low, high] {
                if (z0 - z) * (z1 - z) < 0.0 {
                    inside.push([r0 + (r1 - r0) * (z - z0) / (z1 - z0), z]);
                }
            }
        }
        inside
    }

    /// The surface of a hollow solid: `cells` are revolved in `sectors` steps, `discs` all around.
    pub fn hollow(&self, cells: &[WallCell], discs: &[WallCell], sectors: usize) -> SolidShape {
        let mut shape = self.surface();
        for cell in discs {
            shape = shape.with_part(revolved(cell, self.segments));
        }
        for cell in cells {
            for sector in 0..sectors {
                let angle = |i: usize| TAU * (sector as f64 + i as f64 / 3.0) / sectors as f64;
                let part = (0..=3)
                    .flat_map(|i| cell.iter().map(move |&[r, z]| (r, z, angle(i))))
                    .map(|(r, z, a)| Point3::new(r * libm::cos(a), r * libm::sin(a), z))
                    .collect();
                shape = shape.with_part(part);
            }
        }
        shape
    }

    /// Length of the run of one mapping that starts with segment `i`.
    fn run_length(&self, i: usize, mapping: SlotMapping) -> f64 {
        self.points[i..]
            .windows(2)
            .take_while(|pair| pair[1].1 == mapping)
            .map(|pair| libm::hypot(pair[1].0[0] - pair[0].0[0], pair[1].0[1] - pair[0].0[1]))
            .sum()
    }

    fn ring(&self, shape: &mut SolidShape, [r, z]: [f64; 2]) -> LatheRing {
        if r <= 0.0 {
            return LatheRing::Pole(shape.point(Point3::new(0.0, 0.0, z)));
        }
        LatheRing::Circle(
            (0..self.segments)
                .map(|j| {
                    let (sin, cos) = libm::sincos(TAU * j as f64 / self.segments as f64);
                    shape.point(Point3::new(r * cos, r * sin, z))
                })
                .collect(),
        )
    }

    fn band(
        &self,
        shape: &mut SolidShape,
        rings: [&LatheRing; 2],
        rz: [[f64; 2]; 2],
        v: [f64; 2],
        repeats: f64,
        mapping: SlotMapping,
    ) {
        for j in 0..self.segments {
            let around = |step: f64| (j as f64 + step) / self.segments as f64;
            let uv = |end: usize, step: f64| match mapping.uv {
                Uv::Planar(edge) => {
                    let (sin, cos) = libm::sincos(TAU * around(step));
                    [0.5 + rz[end][0] * cos / edge, 0.5 + rz[end][0] * sin / edge]
                }
                _ => [repeats * around(step), v[end]],
            };
            let at = |end: usize, step: usize| rings[end].index((j + step) % self.segments);
            match rings {
                [LatheRing::Pole(_), LatheRing::Pole(_)] => {}
                [LatheRing::Pole(_), _] => {
                    shape.triangle([at(0, 0), at(1, 1), at(1, 0)], [uv(0, 0.5), uv(1, 1.0), uv(1, 0.0)], mapping.slot);
                }
                [_, LatheRing::Pole(_)] => {
                    shape.triangle([at(0, 0), at(0, 1), at(1, 0)], [uv(0, 0.0), uv(0, 1.0), uv(1, 0.5)], mapping.slot);
                }
                _ => shape.quad(
                    [at(0, 0), at(0, 1), at(1, 1), at(1, 0)],
                    [uv(0, 0.0), uv(0, 1.0), uv(1, 1.0), uv(1, 0.0)],
                    mapping.slot,
                ),
            }
        }
    }
}

enum LatheRing {
    Pole(u32),
    Circle(Vec<u32>),
}

impl LatheRing {
    fn index(&self, j: usize) -> u32 {
        match self {
            Self::Pole(index) => *index,
            Self::Circle(indices) => indices[j],
        }
    }
}

/// Points of an outline revolved about z, for the hull of a convex band: 24 around, so that the hull is within 1 % of
/// the radius of the solid, or half of the segments of a finer one.
pub fn revolved(outline: &[[f64; 2]], segments: usize) -> Vec<Point3<f64>> {
    let around = if segments.is_multiple_of(24) { (segments / 2).max(24) } else { segments.min(32) };
    outline
        .iter()
        .flat_map(|&[r, z]| {
            (0..if r > 0.0 { around } else { 1 }).map(move |j| {
                let (sin, cos) = libm::sincos(TAU * j as f64 / around as f64);
                Point3::new(r * cos, r * sin, z)
            })
        })
        .collect()
}
