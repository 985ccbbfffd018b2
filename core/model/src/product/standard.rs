//! The standard products. Plugins meet through these keys; a plugin may define more of its own.

use super::{BBox, BitPlane, Key, Mask, OcclusionOrder, PerInstance, Plane, Value};
use crate::scene::InstanceId;

// ---- Offered by renderers: one value a pixel ---------------------------------------------------------------------

/// Light that reaches the camera, linear Rec. 709 with luminance in nits. Averaged over the pixel's area.
pub const RADIANCE: Key<Plane<[f32; 3]>> = Key::view("radiance", "light reaching the camera, linear Rec. 709, nits");

/// Distance along the optical axis to the first surface at the pixel's centre, metres; infinite where there is none.
/// Never averaged.
pub const DEPTH: Key<Plane<f32>> = Key::view("depth", "distance along the optical axis at the pixel centre, m");

/// The first body on the ray through the pixel's centre; 0 where there is none.
pub const INSTANCE: Key<Plane<InstanceId>> = Key::view("instance", "id of the first body at the pixel centre");

/// The objects on the ray through the pixel's centre, at any depth.
pub const COVERAGE: Key<BitPlane> = Key::view("coverage", "objects on the pixel-centre ray at any depth, bit set");

/// The objects on the ray through the pixel's centre in front of the first support or room part.
pub const COVERAGE_BEFORE_SUPPORT: Key<BitPlane> =
    Key::view("coverage_before_support", "objects on the pixel-centre ray before table and room, bit set");

/// As [`COVERAGE`], on a canvas three times as wide and high with the picture in its middle.
pub const COVERAGE_WIDE: Key<BitPlane> =
    Key::view("coverage_wide", "coverage on a canvas three times as wide and high, bit set");

/// As [`COVERAGE_BEFORE_SUPPORT`], on the canvas of [`COVERAGE_WIDE`].
pub const COVERAGE_BEFORE_SUPPORT_WIDE: Key<BitPlane> = Key::view(
    "coverage_before_support_wide",
    "coverage before table and room on a canvas three times as wide and high, bit set",
);

/// Unit shading normal at the pixel's centre, camera frame (x right, y down, z forward); zero where there is none.
pub const NORMAL: Key<Plane<[f32; 3]>> = Key::view("normal", "unit shading normal at the pixel centre, camera frame");

/// Base colour at the pixel's centre, linear Rec. 709; zero where there is no surface.
pub const ALBEDO: Key<Plane<[f32; 3]>> = Key::view("albedo", "base colour at the pixel centre, linear Rec. 709");

/// Base colour averaged over the pixel's area, as [`RADIANCE`] is: a guide for denoisers. What a mirror or a glass shows
/// counts in its place. White where there is no surface.
pub const ALBEDO_MEAN: Key<Plane<[f32; 3]>> =
    Key::view("albedo_mean", "base colour averaged over the pixel, mirrors and glass seen through");

/// Shading normal averaged over the pixel's area, camera frame: a guide for denoisers. Shorter than one at edges.
pub const NORMAL_MEAN: Key<Plane<[f32; 3]>> =
    Key::view("normal_mean", "shading normal averaged over the pixel, camera frame");

/// Estimated variance of [`RADIANCE`]'s luminance at a pixel, nits²: the samples' variance over their number. Infinite
/// for a single sample.
pub const RADIANCE_VARIANCE: Key<Plane<f32>> =
    Key::view("radiance_variance", "estimated variance of the radiance's luminance, nits²");

/// The part of [`RADIANCE`] that the first surface mirrors without colouring it, as varnish and dielectrics do: a guide
/// for denoisers, for which the rest is more even once it is divided by the colour. What a mirror or a glass shows is in
/// the rest.
pub const RADIANCE_GLOSS: Key<Plane<[f32; 3]>> =
    Key::view("radiance_gloss", "light that the first surface mirrors without colouring it, nits");

/// Estimated variance of [`RADIANCE_GLOSS`]'s luminance, nits², as [`RADIANCE_VARIANCE`].
pub const RADIANCE_GLOSS_VARIANCE: Key<Plane<f32>> =
    Key::view("radiance_gloss_variance", "estimated variance of the luminance of radiance_gloss, nits²");

/// The rest of [`RADIANCE`] without the surfaces' colours: every sample's radiance, less its part of [`RADIANCE_GLOSS`],
/// divided by its base colour plus [`LEAST_TINT`], channel by channel. A guide for denoisers: it is even where textures are
/// not.
pub const RADIANCE_UNTINTED: Key<Plane<[f32; 3]>> = Key::view(
    "radiance_untinted",
    "radiance less radiance_gloss, every sample divided by its base colour + 0.01, nits",
);

/// Estimated variance of [`RADIANCE_UNTINTED`]'s luminance, nits².
pub const RADIANCE_UNTINTED_VARIANCE: Key<Plane<f32>> =
    Key::view("radiance_untinted_variance", "estimated variance of the luminance of radiance_untinted, nits²");

/// What is added to the base colour in [`RADIANCE_UNTINTED`], so that nothing is divided by black.
pub const LEAST_TINT: f32 = 0.01;

/// What rendering took and how noisy it is: paths, rays, samples a pixel, the standard error over the mean, and pixels far
/// brighter than all around them.
pub const RENDER_REPORT: Key<Value> = Key::view("render_report", "paths, rays, samples a pixel, fireflies");

// ---- Provided by the denoiser ------------------------------------------------------------------------------------

/// The picture as it was rendered, where [`RADIANCE`] is a denoised one.
pub const RADIANCE_NOISY: Key<Plane<[f32; 3]>> =
    Key::view("radiance_noisy", "light reaching the camera before denoising, linear Rec. 709, nits");

/// Which denoiser made [`RADIANCE`]: `name`, `none` if none did, and its settings.
pub const DENOISER: Key<Value> = Key::view("denoiser", "which denoiser ran and how; `none` if none did");

// ---- Provided by sensors -----------------------------------------------------------------------------------------
// RGB and EXPOSURE are a sensor's too.

/// Depth as a depth camera would measure it, metres along the optical axis; zero where there is no measurement, as the
/// cameras' own drivers have it.
pub const DEPTH_SENSED: Key<Plane<f32>> =
    Key::view("depth_sensed", "depth as a depth camera measures it, m; 0 where it has no return");

/// Which depth camera made [`DEPTH_SENSED`], and with which noise model.
pub const DEPTH_SENSOR: Key<Value> = Key::view("depth_sensor", "depth camera and noise model of depth_sensed");

// ---- Provided by annotators --------------------------------------------------------------------------------------

/// The developed picture: exposed, tone-mapped, sRGB-encoded, 8 bits.
pub const RGB: Key<Plane<[u8; 3]>> = Key::view("rgb", "developed picture, sRGB, 8 bits");

/// The exposure value and tone curve that made [`RGB`]: `ev100`, `white_nits`, `mode`, `tone`; and all that the camera
/// added, by the names of its options.
pub const EXPOSURE: Key<Value> = Key::view("exposure", "exposure value and tone curve of the developed picture");

/// How labels treat the image frame, table and room, and hidden objects: the options, and a statement in words.
pub const LABEL_POLICY: Key<Value> =
    Key::view("label_policy", "how labels treat frame, table, room and hidden objects");

/// Pixels at which an annotated object is the first body.
pub const VISIBLE_MASK: Key<PerInstance<Mask>> = Key::view("visible_mask", "pixels at which an object is seen (modal)");

/// Pixels that an annotated object would cover if the other objects were gone, within the image.
pub const AMODAL_MASK: Key<PerInstance<Mask>> =
    Key::view("amodal_mask", "pixels that an object covers, seen or hidden");

/// Amodal minus visible.
pub const OCCLUSION_MASK: Key<PerInstance<Mask>> = Key::view("occlusion_mask", "pixels at which an object is hidden");

/// Hidden share of an object's amodal area, in [0, 1], full precision.
pub const OCCLUSION_RATE: Key<PerInstance<f64>> = Key::view("occlusion_rate", "hidden share of an object, 0 to 1");

/// Occlusion order adjacency matrix (OOAM): row occludes column.
pub const OCCLUSION_ORDER: Key<OcclusionOrder> =
    Key::view("occlusion_order", "matrix: row object occludes column object");

/// Tight box of the visible mask, px.
pub const VISIBLE_BOX: Key<PerInstance<BBox>> = Key::view("visible_box", "tight box of the visible mask, x y w h, px");

/// Tight box of the amodal mask, px.
pub const AMODAL_BOX: Key<PerInstance<BBox>> = Key::view("amodal_box", "tight box of the amodal mask, x y w h, px");

/// What the annotated instances are: asset, pool, category, role, spawn number, poses in world and camera, mass.
pub const OBJECT_INFO: Key<PerInstance<Value>> = Key::view("object_info", "asset, category and pose of each object");

/// The view's camera: intrinsics and pose.
pub const CAMERA: Key<Value> = Key::view("camera", "intrinsics K and world_from_camera of the view");

/// The view's lights.
pub const LIGHTS: Key<Value> = Key::view("lights", "lights of the view");

/// How the scene came to rest.
pub const SETTLE_REPORT: Key<Value> = Key::scene("settle_report", "residual speed, penetration, removed objects");
