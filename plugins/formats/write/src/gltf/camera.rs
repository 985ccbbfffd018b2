//! Cameras.
//!
//! A glTF camera looks along its -z with y up and has its principal point in the center. The vertical field of view
//! follows from the focal length; matrix, distortion, lens and exposure are in `extras`.

use super::document::{GltfCamera, GltfNode, Perspective};
use super::glb::Glb;
use serde_json::json;
use syntable_model::scene::{Distortion, Exposure, View};

/// Distance of the near plane, m.
const NEAR_M: f64 = 0.01;

/// Adds a view's camera. Returns its node.
pub fn add(glb: &mut Glb, view: &View) -> GltfNode {
    let name = format!("view {}", view.id.0);
    let k = &view.camera.intrinsics;
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let exposure = match view.exposure {
        Exposure::Fixed { ev100 } => json!({ "ev100": ev100 }),
        Exposure::Auto { compensation_ev } => json!({ "auto": true, "compensation_ev": compensation_ev }),
    };
    let mut extras = json!({
        "view": view.id.0, "width": k.width, "height": k.height, "K": k.matrix(), "exposure": exposure,
    });
    match view.camera.distortion {
        None => {}
        Some(Distortion::Fisheye(lens)) => extras["distortion"] = json!({ "fisheye": lens.coefficients }),
        Some(Distortion::Polynomial(lens)) => {
            extras["distortion"] = json!({ "radial": lens.radial, "tangential": lens.tangential });
            if lens.denominator != [0.0; 3] || lens.thin_prism != [0.0; 4] {
                extras["distortion"]["denominator"] = json!(lens.denominator);
                extras["distortion"]["thin_prism"] = json!(lens.thin_prism);
            }
        }
    }
    if let Some(lens) = view.camera.lens {
        extras["lens"] =
            json!({ "aperture_radius_m": lens.aperture_radius_m, "focus_distance_m": lens.focus_distance_m });
    }
    let perspective = Perspective {
        aspect_ratio: (width / k.fx) / (height / k.fy),
        yfov: 2.0 * libm::atan(height / (2.0 * k.fy)),
        znear: NEAR_M,
    };
    glb.document.cameras.push(GltfCamera { name: name.clone(), kind: "perspective", perspective, extras });
    let node = GltfNode::at(name, &view.camera.world_from_camera);
    // From x right, y up, z backward to x right, y down, z forward is a rotation by 180° about x: the product with (1,
    // 0, 0, 0).
    let rotation = node.rotation.map(|[x, y, z, w]| [w, z, -y, -x]);
    GltfNode { camera: Some(glb.document.cameras.len() - 1), rotation, ..node }
}
