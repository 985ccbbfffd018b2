//! The lights of a view.

use crate::object_info::view;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::LIGHTS;
use syntable_model::scene::Light;

/// All lights of the view, those of the scene included: shape, place in the world (metres) and emitted radiance
/// (linear Rec. 709, nits).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lights {}

impl Config for Lights {
    type Stage = dyn Annotator;
    const KIND: &'static str = "lights";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for Lights {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![LIGHTS]
    }

    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()> {
        let lights = view(site)?.lights.iter().map(describe).collect::<Vec<_>>();
        frame.put(LIGHTS, lights.into())
    }
}

fn describe(light: &Light) -> Value {
    let point = |p: &Point3<f64>| Value::from([p.x, p.y, p.z]);
    let vector = |v: &Vector3<f64>| Value::from([v.x, v.y, v.z]);
    match light {
        Light::Sphere(light) => Value::record([
            ("shape", "sphere".into()),
            ("centre_world_m", point(&light.centre)),
            ("radius_m", light.radius.into()),
            ("radiance_nits", light.radiance.into()),
        ]),
        Light::Rect(light) => Value::record([
            ("shape", "rect".into()),
            ("centre_world_m", point(&light.centre)),
            ("half_u_world_m", vector(&light.half_u)),
            ("half_v_world_m", vector(&light.half_v)),
            ("normal_world", vector(&light.normal())),
            ("radiance_nits", light.radiance.into()),
        ]),
        Light::Disk(light) => Value::record([
            ("shape", "disk".into()),
            ("centre_world_m", point(&light.centre)),
            ("normal_world", vector(&light.normal)),
            ("radius_m", light.radius.into()),
            ("radiance_nits", light.radiance.into()),
        ]),
        Light::Directional(light) => Value::record([
            ("shape", "directional".into()),
            ("towards_world", vector(&light.towards)),
            ("half_angle_deg", light.half_angle.to_degrees().into()),
            ("irradiance_lx", light.irradiance.into()),
        ]),
        Light::Environment(light) => Value::record([
            ("shape", "environment".into()),
            ("map", light.map.name.as_str().into()),
            ("scale_nits", light.scale.into()),
            ("rotation_deg", light.rotation.to_degrees().into()),
        ]),
    }
}

register!(Lights);
