//! The lights of a view.

use syntable_model::prelude::*;
use syntable_model::product::standard::LIGHTS;
use syntable_model::scene::Light;

/// All lights of the view, including the lights of the scene: shape, position in the world (meters) and emitted
/// radiance (linear Rec. 709, nits).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lights {}

config!(Lights => dyn ViewAnnotator, "lights");

impl ViewAnnotator for Lights {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![LIGHTS]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let lights: Vec<LightView> = cx.view.lights.iter().map(LightView::from).collect();
        products.put(LIGHTS, Value::of(&lights)?)
    }
}

/// An entry of the product `lights`.
#[derive(Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
enum LightView<'a> {
    Sphere {
        center_world_m: [f64; 3],
        radius_m: f64,
        radiance_nits: [f64; 3],
    },
    Rect {
        center_world_m: [f64; 3],
        half_u_world_m: [f64; 3],
        half_v_world_m: [f64; 3],
        normal_world: [f64; 3],
        radiance_nits: [f64; 3],
    },
    Disk {
        center_world_m: [f64; 3],
        normal_world: [f64; 3],
        radius_m: f64,
        radiance_nits: [f64; 3],
    },
    Directional {
        towards_world: [f64; 3],
        half_angle_deg: f64,
        irradiance_lx: [f64; 3],
    },
    Environment {
        map: &'a str,
        scale_nits: [f64; 3],
        rotation_deg: f64,
    },
    Window {
        center_world_m: [f64; 3],
        half_u_world_m: [f64; 3],
        half_v_world_m: [f64; 3],
        normal_world: [f64; 3],
        mean_radiance_nits: [f64; 3],
        panes: [u32; 2],
        frame_m: f64,
        bar_m: f64,
        frame_radiance_nits: [f64; 3],
        map: &'a str,
        scale_nits: [f64; 3],
        rotation_deg: f64,
    },
}

impl<'a> From<&'a Light> for LightView<'a> {
    fn from(light: &'a Light) -> Self {
        match light {
            Light::Sphere(light) => Self::Sphere {
                center_world_m: light.center.into(),
                radius_m: light.radius,
                radiance_nits: light.radiance,
            },
            Light::Rect(light) => Self::Rect {
                center_world_m: light.center.into(),
                half_u_world_m: light.half_u.into(),
                half_v_world_m: light.half_v.into(),
                normal_world: light.normal().into(),
                radiance_nits: light.radiance,
            },
            Light::Disk(light) => Self::Disk {
                center_world_m: light.center.into(),
                normal_world: light.normal.into(),
                radius_m: light.radius,
                radiance_nits: light.radiance,
            },
            Light::Directional(light) => Self::Directional {
                towards_world: light.towards.into(),
                half_angle_deg: light.half_angle.to_degrees(),
                irradiance_lx: light.irradiance,
            },
            Light::Environment(light) => Self::Environment {
                map: &light.map.name,
                scale_nits: light.scale,
                rotation_deg: light.rotation.to_degrees(),
            },
            Light::Window(light) => {
                let mean = light.mean();
                Self::Window {
                    center_world_m: light.center.into(),
                    half_u_world_m: light.half_u.into(),
                    half_v_world_m: light.half_v.into(),
                    normal_world: mean.normal().into(),
                    mean_radiance_nits: mean.radiance,
                    panes: light.panes,
                    frame_m: light.frame_m,
                    bar_m: light.bar_m,
                    frame_radiance_nits: light.frame_radiance,
                    map: &light.view.map.name,
                    scale_nits: light.view.scale,
                    rotation_deg: light.view.rotation.to_degrees(),
                }
            }
        }
    }
}

register!(Lights);
