//! The standard products. Plugins meet through these keys; a plugin may define more of its own.
//!
//! Camera frame: x right, y down, z forward. Images have row 0 at the top; pixel centers are at half-integers.

use super::{
    BBox, BitPlane, DType, Form, KeyId, Mask, ObjectDepths, ObjectImages, ObjectModels, OcclusionOrder, PerInstance,
    Plane, Semantic, Value,
};
use crate::products;
use crate::scene::InstanceId;

// ---- Offered by renderers: one value per pixel -------------------------------------------------------------------

products! {
    /// Radiance reaching the camera, linear Rec. 709 with luminance in nits. Averaged over the pixel's area.
    pub const RADIANCE: Key<Plane<[f32; 3]>> = view("radiance").semantic(Semantic::Color).unit("nit");

    /// Fraction of the pixel's samples of [`RADIANCE`] whose camera ray hits a body before a light, in [0, 1].
    /// `radiance (objects alone)` and `opacity (objects alone)` show each object alone, in windows side by side. With
    /// `(objects in scene)`, the other bodies still cast shadows and reflect light. `(foreground in scene)` is the image of
    /// objects and distractors where nothing hides them. In these framings, the radiance is premultiplied by the opacity.
    /// `(furniture in scene)` is the image without objects and distractors but with their shadows, `(furniture alone)`
    /// without their shadows, and `(background alone)` shows lights and sky.
    pub const OPACITY: Key<Plane<f32>> = view("opacity");

    /// Direct light: the part of [`RADIANCE`] that reaches the camera after at most one reflection. Light through glass is
    /// not direct. Rendered with the same paths as [`RADIANCE`] and never denoised.
    pub const RADIANCE_DIRECT: Key<Plane<[f32; 3]>> = view("radiance_direct").semantic(Semantic::Color).unit("nit");

    /// Indirect light: [`RADIANCE`] before the denoiser minus [`RADIANCE_DIRECT`]. Never negative if all pixels have the
    /// same number of samples.
    pub const RADIANCE_INDIRECT: Key<Plane<[f32; 3]>> = view("radiance_indirect").semantic(Semantic::Color).unit("nit");

    /// Direct light without shadows: all lights that a surface faces illuminate it. Never denoised. The ratio of
    /// [`RADIANCE_DIRECT`] to it is a shadow map.
    pub const RADIANCE_UNSHADOWED: Key<Plane<[f32; 3]>> =
        view("radiance_unshadowed").semantic(Semantic::Color).unit("nit");

    /// Distance along the optical axis to the first surface at the pixel center. Infinite without a surface; never
    /// averaged. `depth (next view)` is the depth of the scene's next view. The last view is its own next view.
    pub const DEPTH: Key<Plane<f32>> = view("depth").semantic(Semantic::Depth).unit("m");

    /// Id of the first body on the ray through the pixel center. 0 without a body.
    pub const INSTANCE: Key<Plane<InstanceId>> = view("instance").semantic(Semantic::Label);

    /// Objects on the ray through the pixel center at any depth, as a bit set: bit `i` is instance `i + 1`.
    /// `coverage (canvas 3)` shows a canvas three times as wide and high with the image in its center. `coverage
    /// (subpixels 4)` has four by four pixels for each pixel of the image.
    pub const COVERAGE: Key<BitPlane> = view("coverage");

    /// The objects of [`COVERAGE`] that are in front of the first support or room part on the ray.
    pub const COVERAGE_BEFORE_SUPPORT: Key<BitPlane> = view("coverage_before_support");

    /// The objects of [`COVERAGE`] from front to back, each with the depth of its first surface along the optical axis.
    pub const OBJECT_DEPTHS: Key<ObjectDepths> = view("object_depths").unit("m");

    /// Unit shading normal at the pixel center, camera frame. Zero without a surface.
    pub const NORMAL: Key<Plane<[f32; 3]>> = view("normal").semantic(Semantic::Normal);

    /// Base color at the pixel center, linear Rec. 709. Zero without a surface.
    pub const ALBEDO: Key<Plane<[f32; 3]>> = view("albedo").semantic(Semantic::Color);

    /// Numbers of paths, rays and samples per pixel, the ratio of standard error to mean, and `fireflies`: the number of
    /// pixels that a few samples made far brighter than their surroundings.
    pub const RENDER_REPORT: Key<Value> = view("render_report").form(|| Form::Record);
}

// ---- Denoising: guides that renderers offer, and what denoisers provide ------------------------------------------

products! {
    /// Base color averaged over the pixel's area, the albedo guide of denoisers. Mirrors and glass have the
    /// color of the surface that they show. White without a surface.
    pub const DENOISE_ALBEDO: Key<Plane<[f32; 3]>> = view("denoise_albedo").semantic(Semantic::Color);

    /// Shading normal averaged over the pixel's area, camera frame, the normal guide of denoisers. Shorter than one at
    /// edges.
    pub const DENOISE_NORMAL: Key<Plane<[f32; 3]>> = view("denoise_normal").semantic(Semantic::Normal);

    /// Estimated variance of the luminance of [`RADIANCE`]: the variance of the samples divided by their number. Infinite for a
    /// single sample.
    pub const RADIANCE_VARIANCE: Key<Plane<f32>> = view("radiance_variance").unit("nit²");

    /// Part of [`RADIANCE`] that the first surface reflects without coloring it, such as the reflections of clearcoats,
    /// dielectrics and glass. Excludes reflections of metals and light through glass.
    pub const RADIANCE_SPECULAR: Key<Plane<[f32; 3]>> =
        view("radiance_specular").semantic(Semantic::Color).unit("nit");

    /// Estimated variance of the luminance of [`RADIANCE_SPECULAR`].
    pub const RADIANCE_SPECULAR_VARIANCE: Key<Plane<f32>> = view("radiance_specular_variance").unit("nit²");

    /// Albedo-demodulated rest of [`RADIANCE`]: each sample minus its part of [`RADIANCE_SPECULAR`], divided by its base
    /// color plus 0.01, per channel. Free of the detail of textures.
    pub const RADIANCE_DEMODULATED: Key<Plane<[f32; 3]>> =
        view("radiance_demodulated").semantic(Semantic::Color).unit("nit");

    /// Estimated variance of the luminance of [`RADIANCE_DEMODULATED`].
    pub const RADIANCE_DEMODULATED_VARIANCE: Key<Plane<f32>> = view("radiance_demodulated_variance").unit("nit²");

    /// [`RADIANCE`] before the denoiser replaces it.
    pub const RADIANCE_NOISY: Key<Plane<[f32; 3]>> = view("radiance_noisy").semantic(Semantic::Color).unit("nit");

    /// Denoiser that made [`RADIANCE`], with its settings. Without a denoiser, its `name` is `none`.
    pub const DENOISER: Key<Value> = view("denoiser").form(|| Form::Record);
}

/// Added to the base color in [`RADIANCE_DEMODULATED`], so that nothing is divided by zero.
pub const DEMODULATION_EPSILON: f32 = 0.01;

// ---- Provided by sensors -----------------------------------------------------------------------------------------

products! {
    /// Developed image: exposed, tone-mapped, sRGB-encoded, 8 bits.
    pub const RGB: Key<Plane<[u8; 3]>> = view("rgb").semantic(Semantic::Color);

    /// Exposure and tone curve of [`RGB`]: `ev100`, `white_nits`, `mode`, `tone`, and the camera effects, named after
    /// their options.
    pub const EXPOSURE: Key<Value> = view("exposure").form(|| Form::Record);

    /// Depth as a depth camera measures it, along the optical axis. 0 without a measurement.
    pub const DEPTH_SENSED: Key<Plane<f32>> = view("depth_sensed").semantic(Semantic::Depth).unit("m");

    /// Depth camera and noise model of [`DEPTH_SENSED`].
    pub const DEPTH_SENSOR: Key<Value> = view("depth_sensor").form(|| Form::Record);
}

// ---- Provided by annotators --------------------------------------------------------------------------------------

products! {
    /// Treatment of the image frame, table, room and hidden objects by the labels: the options, and a statement in words.
    pub const LABEL_POLICY: Key<Value> = view("label_policy").form(|| Form::Record);

    /// Visible (modal) mask: pixels at which the object is the first body.
    pub const VISIBLE_MASK: Key<PerInstance<Mask>> = view("visible_mask").semantic(Semantic::Mask);

    /// Amodal mask: pixels that the object would cover without the other objects, within the image.
    pub const AMODAL_MASK: Key<PerInstance<Mask>> = view("amodal_mask").semantic(Semantic::Mask);

    /// Occlusion (invisible) mask: amodal mask minus visible mask.
    pub const OCCLUSION_MASK: Key<PerInstance<Mask>> = view("occlusion_mask").semantic(Semantic::Mask);

    /// Hidden fraction of the object's amodal area, in [0, 1].
    pub const OCCLUSION_RATE: Key<PerInstance<f64>> = view("occlusion_rate");

    /// Occlusion order adjacency matrix (OOAM): entry (i, j) is true if the object of row i occludes the object of column
    /// j.
    pub const OCCLUSION_ORDER: Key<OcclusionOrder> = view("occlusion_order");

    /// The occlusion order as a directed graph: edges, weakly connected components, cycles, and the objects from front to
    /// back.
    pub const OCCLUSION_GRAPH: Key<Value> = view("occlusion_graph").form(|| Form::Record);

    /// Layer in the occlusion graph: `top`, `intermediate` or `bottom`.
    pub const OCCLUSION_LAYER: Key<PerInstance<&'static str>> = view("occlusion_layer");

    /// Bounding box of the visible mask: x, y, width, height.
    pub const VISIBLE_BOX: Key<PerInstance<BBox>> = view("visible_box").unit("px");

    /// Bounding box of the amodal mask: x, y, width, height.
    pub const AMODAL_BOX: Key<PerInstance<BBox>> = view("amodal_box").unit("px");

    /// Rotated rectangle of minimum area around the visible mask: center, size, angle and corners.
    pub const VISIBLE_ROTATED_BOX: Key<PerInstance<Value>> =
        view("visible_rotated_box").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// Rotated rectangle of minimum area around the amodal mask: center, size, angle and corners.
    pub const AMODAL_ROTATED_BOX: Key<PerInstance<Value>> =
        view("amodal_rotated_box").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// Outline of the visible mask: `polygons` and `holes`, lists of x1, y1, x2, y2, … in pixels, as in COCO files.
    pub const VISIBLE_OUTLINE: Key<PerInstance<Value>> =
        view("visible_outline").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// Outline of the amodal mask: `polygons` and `holes`, lists of x1, y1, x2, y2, … in pixels, as in COCO files.
    pub const AMODAL_OUTLINE: Key<PerInstance<Value>> =
        view("amodal_outline").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// Visibility of each annotated object: numbers of silhouette pixels outside the image, inside it and visible, their
    /// fractions, and the silhouette's box.
    pub const VISIBILITY: Key<PerInstance<Value>> = view("visibility").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// Numbers of pixels that objects hide of each other: `ids`, and the matrices `seen`, `direct` and `all`, whose row is
    /// the occluder and whose column is the occluded object.
    pub const OCCLUSION_AREAS: Key<Value> = view("occlusion_areas").unit("px").form(|| Form::Record);

    /// The annotated objects from front to back by the median depth of their amodal area, with that depth in meters.
    pub const DEPTH_ORDER: Key<Value> = view("depth_order").form(|| Form::Record);

    /// Depth of each annotated object's first surface along the optical axis, hidden parts included. Infinite outside its
    /// amodal mask.
    pub const AMODAL_DEPTH: Key<ObjectImages<f32>> = view("amodal_depth").semantic(Semantic::Depth).unit("m");

    /// Unit shading normal of each annotated object's first surface in the camera frame, hidden parts included. Zero
    /// outside its amodal mask.
    pub const AMODAL_NORMAL: Key<ObjectImages<[f32; 3]>> = view("amodal_normal").semantic(Semantic::Normal);

    /// Each annotated object as the camera would see it without its occluders: red, green, blue and opacity, 8 bits each,
    /// developed like [`RGB`], not premultiplied. 0 in all channels outside the object.
    pub const APPEARANCE: Key<ObjectImages<[u8; 4]>> = view("appearance").semantic(Semantic::Color);

    /// Box of an object as a dataset of boxes states it, `[x, y, width, height]` to a fraction of a pixel; (0, 0) is the top left
    /// corner of the image. Objects with a mask have [`VISIBLE_BOX`] and [`AMODAL_BOX`] instead.
    pub const BOX: Key<PerInstance<Value>> = view("box").unit("px");

    /// Bounding box of the pixels of [`APPEARANCE`] that are not fully transparent: x, y, width, height.
    pub const APPEARANCE_BOX: Key<PerInstance<BBox>> = view("appearance_box").unit("px");

    /// Normalized object coordinates (NOCS) of the visible surfaces of annotated objects: (0.5, 0.5, 0.5) is the center of
    /// an object's box, 1 is the length of its diagonal, and the axes are the object's. Zero elsewhere.
    pub const OBJECT_COORDINATES: Key<Plane<[f32; 3]>> = view("object_coordinates");

    /// Normalized object coordinates of each annotated object's first surface, hidden parts included. Zero outside its
    /// amodal mask.
    pub const AMODAL_OBJECT_COORDINATES: Key<ObjectImages<[f32; 3]>> = view("amodal_object_coordinates");

    /// Occlusion boundaries: 1 on the pixel of the body in front, 2 on the pixel of the body behind, 0 elsewhere.
    pub const OCCLUSION_BOUNDARY: Key<Plane<u8>> = view("occlusion_boundary").semantic(Semantic::Label);

    /// Distance from the center of the camera to the first surface at the pixel center. Infinite without a surface.
    pub const DISTANCE: Key<Plane<f32>> = view("distance").semantic(Semantic::Depth).unit("m");

    /// Pixels that show the bodies of supports, such as the table.
    pub const TABLETOP_MASK: Key<Mask> = view("tabletop_mask").semantic(Semantic::Mask);

    /// Pixels that show no object, distractor or support, such as the table: the room, or no body.
    pub const BACKGROUND_MASK: Key<Mask> = view("background_mask").semantic(Semantic::Mask);

    /// Category of the annotated object at the pixel, 0 without one.
    pub const CATEGORY_MAP: Key<Plane<u16>> = view("category_map").semantic(Semantic::Label);

    /// Id in [`MATERIALS`] of the material at the pixel center: the material of the first surface that is not glass. 0
    /// without a surface.
    pub const MATERIAL_MAP: Key<Plane<u16>> = view("material_map").semantic(Semantic::Label);

    /// Materials of the scene by their ids in [`MATERIAL_MAP`]: name, content digest, and the bodies with the material.
    pub const MATERIALS: Key<Value> = scene("materials").form(|| Form::Records);

    /// For each object, the views of the scene that show it, with its occlusion rate.
    pub const SEEN_IN_VIEWS: Key<Value> = scene("seen_in_views").form(|| Form::Records);

    /// Fraction of each pixel's area in which an annotated object is visible, in [0, 1].
    pub const VISIBLE_SOFT_MASK: Key<ObjectImages<f32>> = view("visible_soft_mask");

    /// Fraction of each pixel's area that an annotated object covers, hidden parts included, in [0, 1].
    pub const AMODAL_SOFT_MASK: Key<ObjectImages<f32>> = view("amodal_soft_mask");

    /// Optical flow to the next view of the scene: displacement (u, v) of the point at the pixel center, pixels. In the next
    /// view, the point may be hidden or outside the image. Zero without a surface.
    pub const FLOW: Key<Plane<[f32; 2]>> = view("flow").unit("px");

    /// Visibility in the next view of the point at the pixel center: 0 outside the image or no point, 1 hidden, 2 visible.
    pub const FLOW_VISIBILITY: Key<Plane<u8>> = view("flow_visibility").semantic(Semantic::Label);

    /// Named points of each annotated object: `name`, `point_world_m`, pixel `uv_px`, `depth_m` along the optical axis, and
    /// `visibility`: 0 outside the image, 1 hidden, 2 visible.
    pub const KEYPOINTS: Key<PerInstance<Value>> =
        view("keypoints").form(|| Form::PerInstance(Box::new(Form::Records)));

    /// Mean surface of every body of the scene, weighted by area: base color, roughness, metallic and transmission.
    pub const MATERIAL_STATISTICS: Key<Value> = scene("material_statistics").form(|| Form::Records);

    /// Pairs of touching bodies: ids, normal, gap, force, and contact points in world coordinates.
    pub const CONTACTS: Key<Value> = scene("contacts").form(|| Form::Records);

    /// Support as a directed graph: edges from supporter to supported, roots, cycles, and floating bodies.
    pub const SUPPORT_GRAPH: Key<Value> = scene("support_graph").form(|| Form::Record);

    /// Convex parts, mass, friction and pose of each body, for other physics engines.
    pub const COLLISION_SHAPES: Key<Value> = scene("collision_shapes").form(|| Form::Records);

    /// Pairs of an object and its container.
    pub const INSIDE: Key<Value> = scene("inside").form(|| Form::Records);

    /// An order in which objects and distractors can be removed: no body is removed while it carries another.
    pub const REMOVAL_ORDER: Key<Value> = scene("removal_order").form(|| Form::Record);

    /// Visible masks as one plane: id of the annotated object at the pixel, 0 without one.
    pub const VISIBLE_IDS: Key<Plane<InstanceId>> = view("visible_ids").semantic(Semantic::Label);

    /// Amodal masks as bits, `[N, height, ⌈width/8⌉]` for the N annotated objects in id order: eight pixels of a row per byte,
    /// the leftmost in the highest bit. NumPy's `unpackbits(bits, axis=2, count=width)` gives `[N, height, width]`.
    pub const AMODAL_BITS: Key<Value> = view("amodal_bits").form(|| Form::Tensor(DType::U8));

    /// Id of the category of each annotated object in annotation files: 1 is `object`; the classes of pools follow, sorted
    /// by name.
    pub const CATEGORY_ID: Key<PerInstance<u32>> = view("category_id");

    /// Name of each annotated object's asset in its pool.
    pub const OBJECT_NAME: Key<PerInstance<String>> = view("object_name");

    /// Asset, pool, category, spawn number, mass, license, digest, and poses in world and camera of each annotated object.
    pub const OBJECT_INFO: Key<PerInstance<Value>> = view("object_info").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// 3D box of each annotated object: size, pose, and the eight corners in the world, in the camera frame and in the
    /// image.
    pub const CUBOID: Key<PerInstance<Value>> = view("cuboid").form(|| Form::PerInstance(Box::new(Form::Record)));

    /// The file that stores `rgb`, if writers can copy it: its `format`, `png` or `jpeg`, and its `bytes`. Only conversions have it.
    pub const RGB_FILE: Key<Value> = view("rgb_file").form(|| Form::Record);

    /// Intrinsics and pose of the view's camera.
    pub const CAMERA: Key<Value> = view("camera").form(|| Form::Record);

    /// Lights of the view.
    pub const LIGHTS: Key<Value> = view("lights").form(|| Form::Records);

    /// Role, asset, materials and pose of every body of the scene, by its id in `instance`: objects, distractors, supports
    /// and room.
    pub const BODIES: Key<Value> = scene("bodies").form(|| Form::Records);

    /// Shape, surface, number and symmetries of the assets of the scene's objects. Meshes are in meters, object frame.
    pub const OBJECT_MODELS: Key<ObjectModels> = scene("object_models").unit("m");

    /// Residual speeds, maximum penetration depth and removed bodies of the settled scene.
    pub const SETTLE_REPORT: Key<Value> = scene("settle_report").form(|| Form::Record);
}

/// Whether datasets of labeled images keep a product in an image file, beside the labels: color or depth.
pub fn is_image_file(key: KeyId) -> bool {
    [RGB.id(), RGB_FILE.id(), DEPTH.id()].contains(&key)
}

/// Products that had another name, as (old, new).
pub const RENAMED: &[(&str, &str)] = &[
    ("albedo_mean", "denoise_albedo"),
    ("coverage (before support)", "coverage_before_support"),
    ("coverage_before_support_wide", "coverage_before_support (canvas 3)"),
    ("coverage_wide", "coverage (canvas 3)"),
    ("normal_mean", "denoise_normal"),
    ("radiance_gloss", "radiance_specular"),
    ("radiance_gloss_variance", "radiance_specular_variance"),
    ("radiance_untinted", "radiance_demodulated"),
    ("radiance_untinted_variance", "radiance_demodulated_variance"),
];
