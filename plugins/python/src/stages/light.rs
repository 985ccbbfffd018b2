//! Lights in Python.

use crate::stages::call::with_python;
use crate::stages::kind::Kind;
use crate::stages::scene::{bodies, camera, supports};
use pyo3::prelude::*;
use std::sync::Arc;
use syntable_model::context::Context;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::{Camera, DirectionalLight, DiskLight, Light, RectLight, Scene, SphereLight};
use syntable_model::stage::{LightSampler, Shell};

/// A light as Python checks it: type, three vectors, and a number.
type Checked = (String, [f64; 3], [f64; 3], [f64; 3], [f64; 3], f64);

/// A function in Python that gives lights, with its options.
struct PythonLights {
    /// From the scene's number, its supports, bodies and camera, the seed of random numbers and the options to lights.
    call: Arc<Py<PyAny>>,
    options: Arc<Py<PyAny>>,
    once_per_scene: bool,
}

/// Registers a light sampler.
#[pyfunction]
pub fn add_light(kind: Kind, call: Py<PyAny>, once_per_scene: bool) -> PyResult<()> {
    let call = Arc::new(call);
    kind.add(Slot::Lights, move |options| {
        Stage::Lights(Box::new(PythonLights { call: Arc::clone(&call), options, once_per_scene }))
    })
}

impl LightSampler for PythonLights {
    fn lights(&self, scene: &Scene, of: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        context.workers.check_stop();
        let lights = with_python(|py| {
            let (supports, bodies) = (supports(py, &scene.supports)?, bodies(py, scene.bodies())?);
            let camera = (!self.once_per_scene).then(|| camera(py, of)).transpose()?;
            let seed = context.stream.seed();
            let arguments = (scene.id.0, supports, bodies, camera, seed, &*self.options);
            self.call.call1(py, arguments)?.extract::<Vec<Checked>>(py)
        })?;
        lights.into_iter().map(light).collect()
    }

    fn once_per_scene(&self) -> bool {
        self.once_per_scene
    }
}

fn light((kind, at, one, other, power, number): Checked) -> Result<Light> {
    let (center, vector) = (Point3::from(at), Vector3::from(one));
    Ok(match kind.as_str() {
        "sphere" => Light::Sphere(SphereLight { center, radius: number, radiance: power }),
        "rect" => Light::Rect(RectLight { center, half_u: vector, half_v: Vector3::from(other), radiance: power }),
        "disk" => Light::Disk(DiskLight { center, normal: vector.normalize(), radius: number, radiance: power }),
        "directional" => {
            let towards = vector.normalize();
            Light::Directional(DirectionalLight { towards, half_angle: number, irradiance: power })
        }
        _ => return Err(Error::new(format!("`{kind}` is no type of light"))),
    })
}
