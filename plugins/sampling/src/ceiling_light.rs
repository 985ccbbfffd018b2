//! Light sampler `ceiling_light`: a glowing rectangle overhead.

use crate::colour;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::photometry::polygon_illuminance;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, RectLight, Role};

/// A level rectangle under the ceiling that shines downwards (the paper's ceiling light).
///
/// The released code uses `size_m = [15, 15]`, 6500 K and 5 m of height.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CeilingLight {
    /// Extents along world x and y, m.
    #[schemars(inner(range(min = 0.001, max = 1000.0)))]
    size_m: [f64; 2],
    /// Height above the floor, m; just under the room's ceiling if left out, or 2.5 m above the tabletop without a room.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    height_m: Option<f64>,
    /// How far its middle may lie from the table's, along x and y, m: drawn uniformly from both sides.
    #[schemars(range(min = 0, max = 1000))]
    shift_m: f64,
    /// Colour temperature, K.
    temperature_k: Dist,
    /// Illuminance that it alone gives, unoccluded, at the middle of the tabletop on a plane facing its middle, lx.
    illuminance_lx: Dist,
}

impl Default for CeilingLight {
    fn default() -> Self {
        Self {
            size_m: [1.2, 0.6],
            height_m: None,
            shift_m: 0.5,
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            illuminance_lx: Dist::Uniform(100.0, 2000.0),
        }
    }
}

impl Config for CeilingLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "ceiling_light";
    const EXAMPLE: &'static str = "size_m = [1.2, 0.6]\nilluminance_lx = { uniform = [100, 2000] }";
    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.temperature_k.within("temperature_k", 1000.0, 40000.0)?;
        self.illuminance_lx.within("illuminance_lx", 0.0, 1e6)?;
        Ok(Box::new(self))
    }
}
register!(CeilingLight);

/// Gap between the lamp and the ceiling, m.
const GAP_M: f64 = 0.01;

impl LightSampler for CeilingLight {
    fn lights(&self, scene: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let mut stream = context.stream.clone();
        let kelvin = self.temperature_k.draw(&mut stream);
        let lux = self.illuminance_lx.draw(&mut stream);
        let shift = [stream.uniform(-self.shift_m, self.shift_m), stream.uniform(-self.shift_m, self.shift_m)];
        let top = scene.tabletop.centre();
        let height = match (self.height_m, underside_of_ceiling(scene)) {
            (Some(height), _) => height,
            (None, Some(ceiling)) => ceiling - GAP_M,
            (None, None) => top.z + 2.5,
        };
        if height <= top.z {
            return Err(Error::new(format!("the lamp at {height} m hangs below the tabletop at {} m", top.z))
                .help("raise height_m or the room's height"));
        }
        let centre = Point3::new(top.x + shift[0], top.y + shift[1], height);
        let mut lamp = RectLight {
            centre,
            half_u: Vector3::new(self.size_m[0] / 2.0, 0.0, 0.0),
            half_v: Vector3::new(0.0, -self.size_m[1] / 2.0, 0.0),
            radiance: [0.0; 3],
        };
        let per_nit = polygon_illuminance(&lamp.corners(), top, (centre - top).normalize());
        lamp.radiance = colour::radiance(lux / per_nit, kelvin);
        Ok(vec![Light::Rect(lamp)])
    }
}

/// Height of the lowest point of the room's highest part, if there is one above the tabletop.
fn underside_of_ceiling(scene: &Scene) -> Option<f64> {
    let bottoms = scene.bodies().iter().filter(|body| body.role == Role::Room).map(|body| {
        let corners = body.object.mesh.bounds().corners().map(|p| (body.world_from_body * p).z);
        corners.into_iter().fold(f64::INFINITY, f64::min)
    });
    bottoms.reduce(f64::max).filter(|bottom| *bottom > scene.tabletop.height())
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::{Collected, NoCache, Serial};
    use syntable_model::photometry::luminance;
    use syntable_testing::{assets::NoAssets, scenes};

    #[test]
    fn the_lux_are_what_the_lamp_gives() {
        let scene = scenes::boxes(&[([0.0, 0.0, 0.05], [0.1; 3])]);
        let view = scenes::view([1.0, 0.0, 1.0], [0.0; 3], [64, 48], 60.0);
        let shell = Shell { centre: Point3::origin(), radius: [1.0, 1.7] };
        for (seed, config) in ["", "size_m = [15.0, 15.0]\nheight_m = 1.5\nshift_m = 3.0"].into_iter().enumerate() {
            let mut config: CeilingLight = toml::from_str(config).expect("well-formed");
            config.illuminance_lx = Dist::Constant(750.0);
            let log = Collected::default();
            let stream = Stream::root(seed as u64);
            let context = Context { stream, assets: &NoAssets, cache: &NoCache, workers: &Serial, log: &log };
            let lights = config.build().expect("sound").lights(&scene, &view.camera, &shell, &context).expect("lit");
            let [Light::Rect(lamp)] = lights[..] else { panic!("one lamp, not {lights:?}") };
            assert!(lamp.normal().z < -0.999, "it shines downwards");
            // The illuminance once more, by adding up small pieces of the lamp.
            let facing = lamp.centre.coords.normalize();
            let n = 800;
            let (mut lux, cell) = (0.0, 4.0 * lamp.half_u.norm() * lamp.half_v.norm() / f64::from(n * n));
            for i in 0..n * n {
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0;
                let p = lamp.centre.coords + lamp.half_u * at(i % n) + lamp.half_v * at(i / n);
                let (distance, direction) = (p.norm(), p.normalize());
                let (here, there) = (direction.dot(&facing).max(0.0), (-direction).dot(&lamp.normal()).max(0.0));
                lux += luminance(lamp.radiance) * here * there * cell / (distance * distance);
            }
            assert!((lux / 750.0 - 1.0).abs() < 2e-3, "{lux} lx");
        }
    }
}
