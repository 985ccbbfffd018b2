//! The surface at a hit: position, normals, the selected layer, and emission.

use crate::bsdf::{Lobe, pane_transmittance};
use crate::layer::{LayerSample, base_parameters, mapped_normal, normal_map, sample_layer};
use syntable_prepare::{PreparedScene, ProjectedEnvironment, SurfacePoint, TextureCoordinates, unpack_unit};
use syntable_simd::{Rgb, Vec3, max, min};

/// The surface at a hit.
#[derive(Clone, Debug)]
pub struct Surface {
    /// World, on the plane of the triangle.
    pub position: Vec3,
    /// Unit normal of the triangle, towards the ray's origin.
    pub face: Vec3,
    /// Unit shading normal, on the same side as `face`, with the ray's origin above its horizon.
    pub normal: Vec3,
    /// Whether `normal` differs from `face`.
    pub is_perturbed: bool,
    /// The selected layer.
    pub layer: LayerSample,
    /// Whether the ray came through the body's interior medium.
    pub inside: bool,
    /// Whether the surface is a pane, which transmits light straight.
    pub is_pane: bool,
    /// Transmittance of the interior medium along the ray.
    pub transmittance: Rgb,
    /// Color of the base.
    pub albedo: Rgb,
    /// Emitted radiance towards the ray, nits.
    pub emission: Rgb,
}

/// The normals at a hit.
struct HitNormals {
    /// Unit normal of the triangle, out of the body.
    outward: Vec3,
    /// 1 if the ray comes from the outward side, else −1.
    side: f32,
    /// Like [`Surface::face`].
    face: Vec3,
    /// Interpolated normal, on the same side.
    normal: Vec3,
    /// Whether `normal` comes from a smooth mesh.
    is_smooth: bool,
}

impl Surface {
    /// Whether the surface shows other surfaces instead of its own color.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        let LayerSample { lobe, parameters, .. } = &self.layer;
        parameters.roughness < 0.15
            && (parameters.metallic > 0.9 || matches!(lobe, Lobe::Refraction | Lobe::ThinWalled))
    }
}

/// The surface at a point that a ray hits. `along` is the ray's unit direction, `width` the width of its cone at the
/// hit, meters; `u` in [0, 1) selects one of the layers. `projection` is for materials that show the environment.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the ray in parts, as batches hold it")]
pub fn surface(
    scene: &PreparedScene,
    point: &SurfacePoint,
    origin: Vec3,
    along: Vec3,
    t: f32,
    width: f32,
    u: f32,
    projection: Option<&ProjectedEnvironment>,
) -> Surface {
    let (body, triangle) = scene.at(point);
    let material = scene.material(body, triangle);
    let textures = &scene.materials.textures[..];

    let HitNormals { outward, side, face, mut normal, is_smooth: mut is_perturbed } = frame(scene, point, along);
    let mut position = origin + along * t;
    // Moves the position back onto the plane of the triangle, so that the remaining error does not grow with the
    // distance.
    position = position + outward * (triangle.plane + outward.dot(body.translation) - outward.dot(position));
    let at = if material.is_untextured() {
        TextureCoordinates { uv: [0.0; 2], log2_width: 0.0 }
    } else {
        let width = width / max(face.dot(along).abs(), 0.05).sqrt();
        scene.texture_coordinates(material, point, position, width)
    };
    let mut base = base_parameters(textures, material, at, scene.vertex_color(point));
    if let (Some(projection), Some(height)) = (projection, material.projection_height) {
        base.base_color = projection.albedo(height, position);
    }
    let mut layer = sample_layer(&scene.materials, material, at, base, normal.dot(along).abs(), u);
    if let Some(map) = normal_map(&scene.materials, material, layer.is_clearcoat) {
        let frame = scene.texture_frame(material, point, side);
        let variance;
        (normal, variance) = mapped_normal(textures, map, at, frame, normal);
        is_perturbed = true;
        if variance > 0.0 {
            // Bumps below the resolution add their variance to the roughness of the surface.
            let alpha = layer.parameters.roughness * layer.parameters.roughness;
            layer.parameters.roughness = min((alpha * alpha + 2.0 * variance).sqrt().sqrt(), 1.0);
        }
    }
    if is_perturbed {
        normal = above_horizon(normal, face, -along);
    }
    let medium = scene.materials.layers(material).filter(|_| side < 0.0);
    let is_pane = layer.lobe == Lobe::ThinWalled
        && scene.materials.pane(material).is_some()
        && scene.materials.is_pane(material, at);
    if is_pane {
        layer.parameters.roughness = 0.0;
    }
    Surface {
        position,
        face,
        normal,
        is_perturbed,
        layer,
        inside: side < 0.0,
        is_pane,
        transmittance: medium.map_or(Rgb::ONE, |layers| layers.transmittance(t)),
        albedo: base.base_color,
        emission: scene.materials.emission(material, at),
    }
}

/// Fraction of the light that a pane transmits along a ray: the mean over its layers. Black for other surfaces.
pub fn transmittance_of_pane(scene: &PreparedScene, point: &SurfacePoint, origin: Vec3, along: Vec3, t: f32) -> Rgb {
    let (body, triangle) = scene.at(point);
    let material = scene.material(body, triangle);
    let Some(layers) = scene.materials.pane(material) else { return Rgb::ZERO };
    let frame = frame(scene, point, along);
    let at = scene.texture_coordinates(material, point, origin + along * t, 0.0);
    if !scene.materials.is_pane(material, at) {
        return Rgb::ZERO;
    }
    let textures = &scene.materials.textures[..];
    let base = base_parameters(textures, material, at, scene.vertex_color(point));
    let normal = if frame.is_smooth { above_horizon(frame.normal, frame.face, -along) } else { frame.normal };
    let fraction = layers.transmitted_fraction(textures, at, base.metallic);
    base.base_color * (fraction * pane_transmittance(normal.dot(along).abs(), layers.ior))
}

/// The normals of a point, towards the origin of a ray along `along`.
#[inline(always)]
fn frame(scene: &PreparedScene, point: &SurfacePoint, along: Vec3) -> HitNormals {
    let (body, triangle) = scene.at(point);
    let outward = body.direction_to_world(triangle.normal);
    let side = if outward.dot(along) > 0.0 { -1.0 } else { 1.0 };
    let face = outward * side;
    let mut normal = face;
    if triangle.smooth {
        let [a, b, c] = triangle.normals.map(unpack_unit);
        let [wa, wb, wc] = point.weights();
        let smooth = a * wa + b * wb + c * wc;
        normal = body.direction_to_world(smooth * side).normalized_or(face);
    }
    HitNormals { outward, side, face, normal, is_smooth: triangle.smooth }
}

/// Moves a shading normal to the side of the face, so that the viewer is above its horizon.
#[inline]
fn above_horizon(normal: Vec3, face: Vec3, wo: Vec3) -> Vec3 {
    let mut n = normal;
    let cosine = n.dot(face);
    if cosine < 0.05 {
        n = (n + face * (0.05 - cosine)).normalized_or(face);
    }
    let height = n.dot(wo);
    // Never steeper than the face itself allows.
    let least = min(0.02, 0.9 * face.dot(wo));
    if height < least {
        n = (n + (wo - n * height).normalized_or(Vec3::ZERO) * (least - height + 1e-4)).normalized_or(face);
        if n.dot(wo) <= 0.0 || n.dot(face) <= 0.0 {
            return face;
        }
    }
    n
}
