//! Rooms without windows, lit by softboxes: as for product photography.
//!
//! The map shows a rectangular room from its center: matte walls in indirect light, with emissive rectangles on ceiling
//! and walls. It is scaled so that a horizontal plane has the stated illuminance.

use super::raster::Raster;
use super::temperature::blackbody_color;
use syntable_model::error::Result;
use syntable_model::geometry::Vector3;
use syntable_model::photometry::luminance;
use syntable_model::random::Stream;
use syntable_model::scene::EnvironmentMap;

/// A room with softboxes.
#[derive(Debug, Clone)]
pub struct StudioRoom {
    /// Half of the room's edges, along x, y and z.
    pub half: [f64; 3],
    /// Color of walls, floor and ceiling, linear Rec. 709.
    pub walls: [f64; 3],
    /// Luminance of the walls, relative to a softbox of brightness one.
    pub ambient: f64,
    /// The softboxes.
    pub softboxes: Vec<Softbox>,
    /// Illuminance on a level plane, lux.
    pub illuminance_lx: f64,
}

/// An emissive rectangle on a face of the room.
#[derive(Debug, Clone)]
pub struct Softbox {
    /// Axis that the face is at right angles to: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// End of the axis, 1 or -1.
    pub side: f64,
    /// Center on the face, along the next axis and the one after, as fractions of the room's half edges.
    pub center: [f64; 2],
    /// Half of the edges, the same way.
    pub half: [f64; 2],
    /// Luminance, relative to the other softboxes.
    pub brightness: f64,
    /// Color temperature, kelvin.
    pub kelvin: f64,
}

impl StudioRoom {
    /// A random studio: one softbox above, one to three around.
    pub fn draw(stream: &Stream) -> Self {
        let mut draw = stream.child("studio");
        let half = [draw.uniform(1.5, 3.0), draw.uniform(1.5, 3.0), draw.uniform(1.2, 1.7)];
        let white = draw.uniform(3800.0, 6500.0);
        let shade = draw.uniform(0.15, 0.8);
        let walls = [1.0, 1.0, 1.0].map(|_: f64| shade * draw.uniform(0.85, 1.0));
        let mut softboxes = vec![Softbox {
            axis: 2,
            side: 1.0,
            center: [draw.uniform(-0.4, 0.4), draw.uniform(-0.4, 0.4)],
            half: [draw.uniform(0.15, 0.4), draw.uniform(0.15, 0.4)],
            brightness: 1.0,
            kelvin: white,
        }];
        for _ in 0..draw.integer(1, 3) {
            softboxes.push(Softbox {
                axis: draw.below(2) as usize,
                side: if draw.chance(0.5) { 1.0 } else { -1.0 },
                center: [draw.uniform(-0.5, 0.5), draw.uniform(-0.2, 0.5)],
                half: [draw.uniform(0.1, 0.3), draw.uniform(0.15, 0.4)],
                brightness: draw.uniform(0.3, 1.2),
                kelvin: white + draw.uniform(-500.0, 500.0),
            });
        }
        // On a wall the second axis after x is z, after y it is x: softboxes stand upright either way.
        for softbox in softboxes.iter_mut().filter(|softbox| softbox.axis == 1) {
            softbox.center.swap(0, 1);
            softbox.half.swap(0, 1);
        }
        Self { half, walls, ambient: draw.uniform(0.01, 0.05), softboxes, illuminance_lx: draw.uniform(500.0, 3000.0) }
    }

    /// The map, in nits.
    pub fn map(&self, name: &str, width: u32) -> Result<EnvironmentMap> {
        let raster = Raster::with_width(width);
        let colors: Vec<[f64; 3]> = raster.directions().map(|direction| self.radiance(&direction)).collect();
        let relative: Vec<f64> = colors.iter().map(|&color| luminance(color)).collect();
        let nits = self.illuminance_lx / raster.illuminance(&relative).max(1e-12);
        let luminances: Vec<f64> = relative.iter().map(|l| l * nits).collect();
        raster.map(name, &luminances, |i| colors[i].map(|c| c / relative[i].max(1e-12)))
    }

    /// Relative radiance in a direction from the room's center.
    fn radiance(&self, direction: &Vector3<f64>) -> [f64; 3] {
        // The first face along the direction, and the position on it.
        let distance = |axis: usize| self.half[axis] / direction[axis].abs().max(1e-12);
        let axis = (0..3).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(2);
        let at = direction * distance(axis);
        let side = if direction[axis] < 0.0 { -1.0 } else { 1.0 };
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(|other| at[other] / self.half[other]);
        // Corners are a little darker: they see less of the room.
        let open = |x: f64| 1.0 - 0.25 * x * x * x * x;
        let wall = self.ambient * open(u) * open(v);
        let mut radiance = self.walls.map(|w| w * wall);
        for softbox in self.softboxes.iter().filter(|softbox| softbox.axis == axis && softbox.side == side) {
            // One inside, falling to zero over a tenth of the softbox, like its cloth.
            let edge = |x: f64, i: usize| {
                ((softbox.half[i] - (x - softbox.center[i]).abs()) / (0.1 * softbox.half[i])).clamp(0.0, 1.0)
            };
            let lit = softbox.brightness * edge(u, 0) * edge(v, 1);
            let color = blackbody_color(softbox.kelvin);
            radiance = std::array::from_fn(|i| radiance[i] + lit * color[i]);
        }
        radiance
    }
}
