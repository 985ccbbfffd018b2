//! Daylight by the CIE standard general sky.
//!
//! The luminance follows ISO 15469:2004 (CIE S 011/E:2003, after Kittler, Perez and Darula). Relative to the zenith, it
//! is `f(χ) φ(Z) / (f(Z_s) φ(0))`, where Z is the angle between the direction and the zenith, χ the angle between the
//! direction and the sun, and Z_s the angle between the sun and the zenith; `φ(Z) = 1 + a exp(b / cos Z)` and `f(χ) = 1
//! + c (exp(d χ) - exp(d π/2)) + e cos² χ`.
//!
//! The illuminance on a horizontal plane follows Gillette, Pierpoint and Treado (Journal of the IES 13, 1984), as the
//! IES recommends: `A + B sin^C h` klx at a solar elevation h, with (0.8, 15.5, 1/2) for clear, (0.3, 45, 1) for partly
//! cloudy and (0.3, 21, 1) for overcast skies. This is the illuminance of the sky without the sun.
//!
//! The color of blue sky follows Takagi et al. (SIGGRAPH 1990): `6500 + 1.1985e8 / L^1.2` kelvin at L nits. Clouds have
//! one temperature. Temperatures become colors of the CIE daylight locus. The warm sky around a low sun and the clouds'
//! shapes are models of our own.
//!
//! **The sun.** The map does not contain the sun's disc, only the bright sky around it. Add a directional light for the
//! sun's shadows. The sun is above the center column, the map's +x. Below the horizon is level ground lit by the sky.

use super::raster::Raster;
use super::temperature::daylight_color;
use crate::material::ScalarField;
use std::f64::consts::{FRAC_PI_2, PI};
use syntable_model::error::Result;
use syntable_model::geometry::Vector3;
use syntable_model::photometry::luminance;
use syntable_model::random::Stream;
use syntable_model::scene::EnvironmentMap;

/// Parameters a, b, c, d, e of the fifteen types of ISO 15469:2004, table 1; type 1 first.
pub const TYPES: [[f64; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.80, 0.0, -1.0, 0.0],
    [1.1, -0.80, 2.0, -1.5, 0.15],
    [0.0, -1.00, 0.0, -1.0, 0.0],
    [0.0, -1.00, 2.0, -1.5, 0.15],
    [0.0, -1.00, 5.0, -2.5, 0.30],
    [0.0, -1.00, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];

/// Edge length of the cloud coverage map, texels.
const CLOUD_TEXELS: usize = 256;

/// A sky.
#[derive(Debug, Clone)]
pub struct Sky {
    /// Type of the standard, 1 to 15.
    pub kind: usize,
    /// Elevation of the sun above the horizon, radians.
    pub sun_elevation: f64,
    /// Illuminance on a level plane, of the sky without the sun, lux.
    pub illuminance_lx: f64,
    /// Color temperature of overcast sky and of clouds, kelvin.
    pub cloud_kelvin: f64,
    /// Whether the sky between clouds is blue; if not, all of it has the clouds' temperature.
    pub blue: bool,
    /// Fraction of the sky that clouds cover, in [0, 1].
    pub cover: f64,
    /// Color temperature of the sky next to the sun, kelvin, and its angular reach, radians.
    pub sunset: Option<(f64, f64)>,
    /// Reflectance of the ground, linear Rec. 709.
    pub ground: [f64; 3],
    /// Random stream of the clouds.
    pub clouds: Stream,
}

/// Types of weather.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weather {
    /// No cloud: blue, types 11 to 13.
    Clear,
    /// No cloud, but vapor and dust: brighter around the sun, types 14 and 15.
    Hazy,
    /// Clouds before a blue sky.
    Cloudy,
    /// An even gray layer: types 1 to 5.
    Overcast,
    /// A low sun in a warm sky, with or without clouds.
    Sunset,
}

impl Sky {
    /// A random sky of a type of weather.
    pub fn draw(weather: Weather, stream: &Stream) -> Self {
        use Weather::{Clear, Cloudy, Hazy, Overcast, Sunset};
        let mut draw = stream.child("sky");
        let types: &[usize] = match weather {
            Clear => &[11, 12, 13],
            Hazy => &[14, 15],
            Cloudy => &[9, 10, 11, 12],
            Overcast => &[1, 2, 3, 4, 5],
            Sunset => &[12, 13, 14],
        };
        let kind = draw.pick(types).copied().unwrap_or(12);
        let elevation_deg = if weather == Sunset { draw.uniform(1.5, 8.0) } else { draw.uniform(15.0, 65.0) };
        let sun_elevation = f64::to_radians(elevation_deg);
        let high = libm::sin(sun_elevation);
        let illuminance_klx = match weather {
            Clear | Hazy | Sunset => 0.8 + 15.5 * high.sqrt(),
            Cloudy => 0.3 + 45.0 * high,
            Overcast => 0.3 + 21.0 * high,
        };
        let cover = match weather {
            Clear | Hazy | Overcast => 0.0,
            Cloudy => draw.uniform(0.25, 0.7),
            Sunset => draw.uniform(0.0, 0.5),
        };
        let sunset_kelvin = draw.uniform(2000.0, 3200.0);
        let sunset_width = f64::to_radians(draw.uniform(35.0, 70.0));
        let reflectance = draw.uniform(0.08, 0.3);
        let warm = draw.uniform(0.0, 0.25);
        let cloud_kelvin = match weather {
            Overcast => draw.uniform(5800.0, 7200.0),
            Sunset => draw.uniform(3600.0, 5200.0),
            _ => draw.uniform(5600.0, 6600.0),
        };
        Self {
            kind,
            sun_elevation,
            illuminance_lx: 1e3 * illuminance_klx,
            cloud_kelvin,
            blue: weather != Overcast,
            cover,
            sunset: (weather == Sunset).then_some((sunset_kelvin, sunset_width)),
            ground: [reflectance * (1.0 + warm), reflectance, reflectance * (1.0 - warm)],
            clouds: stream.child("clouds"),
        }
    }

    /// Unit vector towards the sun.
    pub fn sun(&self) -> Vector3<f64> {
        Vector3::new(libm::cos(self.sun_elevation), 0.0, libm::sin(self.sun_elevation))
    }

    /// Luminance of the cloudless sky in a direction above the horizon, relative to the zenith's.
    pub fn relative_luminance(&self, direction: &Vector3<f64>) -> f64 {
        let [a, b, c, d, e] = TYPES[self.kind.clamp(1, TYPES.len()) - 1];
        let gradation = |cos: f64| if cos > 0.0 { 1.0 + a * libm::exp(b / cos) } else { 1.0 };
        let indicatrix = |cos: f64| {
            let angle = libm::acos(cos.clamp(-1.0, 1.0));
            1.0 + c * (libm::exp(d * angle) - libm::exp(d * FRAC_PI_2)) + e * cos * cos
        };
        indicatrix(direction.dot(&self.sun())) * gradation(direction.z)
            / (indicatrix(libm::sin(self.sun_elevation)) * gradation(1.0))
    }

    /// The map, in nits.
    pub fn map(&self, name: &str, width: u32) -> Result<EnvironmentMap> {
        let raster = Raster::with_width(width);
        let clouds = self.cloud_coverage();
        let cover: Vec<f64> = raster.directions().map(|direction| self.cloud_at(&clouds, &direction)).collect();
        let clear: Vec<f64> = raster
            .directions()
            .map(|direction| if direction.z > 0.0 { self.relative_luminance(&direction).max(0.0) } else { 0.0 })
            .collect();
        // A cloud is lit by the whole sky and by the sun behind it: brighter than blue sky, duller than the aureole.
        let mean = raster.illuminance(&clear) / PI;
        let mix = |clear: f64, cover: f64| clear + (1.6 * mean + 0.25 * clear - clear) * cover;
        let mut sky: Vec<f64> = clear.iter().zip(&cover).map(|(&clear, &cover)| mix(clear, cover)).collect();
        for (luminance, direction) in sky.iter_mut().zip(raster.directions()) {
            if direction.z <= 0.0 {
                *luminance = 0.0;
            }
        }
        let nits = self.illuminance_lx / raster.illuminance(&sky).max(1e-12);
        let ground = self.ground.map(|r| r * self.illuminance_lx / PI);
        let (ground_luminance, directions) = (luminance(ground), raster.directions().collect::<Vec<_>>());
        let luminances: Vec<f64> = sky
            .iter()
            .zip(&directions)
            .map(|(l, direction)| if direction.z > 0.0 { l * nits } else { ground_luminance })
            .collect();
        raster.map(name, &luminances, |i| match directions[i].z > 0.0 {
            true => daylight_color(self.kelvin(&directions[i], clear[i] * nits, cover[i])),
            false => ground.map(|g| g / ground_luminance),
        })
    }

    /// Color temperature in a direction, for a cloudless sky with a luminance in nits and clouds that cover a fraction
    /// of the sky. Temperatures are mixed by their reciprocals.
    fn kelvin(&self, direction: &Vector3<f64>, nits: f64, cover: f64) -> f64 {
        let blue = if self.blue { 6500.0 + 1.1985e8 / libm::pow(nits.max(1.0), 1.2) } else { self.cloud_kelvin };
        let mut mired = (1.0 - cover) * 1e6 / blue.min(25_000.0) + cover * 1e6 / self.cloud_kelvin;
        if let Some((kelvin, width)) = self.sunset {
            let from_sun = libm::acos(direction.dot(&self.sun()).clamp(-1.0, 1.0));
            let low = 1.0 - 0.7 * direction.z.max(0.0);
            let weight = low * libm::exp(-(from_sun / width) * (from_sun / width));
            mired += weight * (1e6 / kelvin - mired);
        }
        1e6 / mired
    }

    fn cloud_coverage(&self) -> ScalarField {
        let mut stream = self.clouds.clone();
        if self.cover <= 0.0 {
            return ScalarField::constant(1, 0.0);
        }
        let noise = ScalarField::fractal(CLOUD_TEXELS, [4, 5], 6, 0.55, &mut stream);
        // The threshold that leaves the wanted cover.
        let mut sorted = noise.values().to_vec();
        sorted.sort_by(f32::total_cmp);
        let at = ((1.0 - self.cover) * (sorted.len() - 1) as f64) as usize;
        let threshold = sorted[at.min(sorted.len() - 1)];
        noise.map(|x| {
            let t = ((x - threshold) / 0.5 + 0.5).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        })
    }

    /// Cloud coverage in a direction: the coverage map on a level sheet that bends down towards the horizon.
    fn cloud_at(&self, clouds: &ScalarField, direction: &Vector3<f64>) -> f64 {
        if direction.z <= 0.0 || clouds.size() == 1 {
            return 0.0;
        }
        let scale = 0.12 / (direction.z + 0.12);
        let at = |x: f64| (x - x.floor()) * clouds.size() as f64 - 0.5;
        let (x, y) = (at(direction.x * scale * 2.0 + 0.5), at(direction.y * scale * 2.0 + 0.5));
        let size = clouds.size() as i64;
        let texel =
            |x: i64, y: i64| f64::from(clouds.values()[(y.rem_euclid(size) * size + x.rem_euclid(size)) as usize]);
        let (left, top) = (x.floor(), y.floor());
        let (s, t) = (x - left, y - top);
        let (left, top) = (left as i64, top as i64);
        let row = |y: i64| texel(left, y) * (1.0 - s) + texel(left + 1, y) * s;
        row(top) * (1.0 - t) + row(top + 1) * t
    }
}
