// The surface at a hit, as in core/lib/transport's surface.rs.

struct Surface {
    position: vec3<f32>,
    face: vec3<f32>,
    normal: vec3<f32>,
    is_perturbed: bool,
    layer: LayerSample,
    inside: bool,
    is_pane: bool,
    transmittance: vec3<f32>,
    albedo: vec3<f32>,
    emission: vec3<f32>,
}

struct Frame {
    outward: vec3<f32>,
    side: f32,
    face: vec3<f32>,
    normal: vec3<f32>,
}

fn frame_at(body: Body, triangle: Triangle, hit: Hit, along: vec3<f32>) -> Frame {
    let outward = direction_to_world(body, triangle.normal);
    let side = select(1.0, -1.0, dot(outward, along) > 0.0);
    let face = outward * side;
    var normal = face;
    if triangle.smooth_ {
        let w = weights_of(hit);
        let smoothed = unpack_unit(triangle.normals.x) * w.x
            + unpack_unit(triangle.normals.y) * w.y
            + unpack_unit(triangle.normals.z) * w.z;
        normal = normalized_or(direction_to_world(body, smoothed * side), face);
    }
    return Frame(outward, side, face, normal);
}

// Moves a shading normal to the side of the face, so that the viewer is above its horizon.
fn above_horizon(normal: vec3<f32>, face: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    var n = normal;
    let cosine = dot(n, face);
    if cosine < 0.05 {
        n = normalized_or(n + face * (0.05 - cosine), face);
    }
    let height = dot(n, wo);
    let least = min(0.02, 0.9 * dot(face, wo));
    if height < least {
        n = normalized_or(n + normalized_or(wo - n * height, vec3(0.0)) * (least - height + 1e-4), face);
        if dot(n, wo) <= 0.0 || dot(n, face) <= 0.0 {
            return face;
        }
    }
    return n;
}

// `along` is the ray's unit direction, `width` that of its cone at the hit; `u` selects one of the layers.
fn surface_at(hit: Hit, origin: vec3<f32>, along: vec3<f32>, t: f32, cone: f32, u: f32) -> Surface {
    let body = body_at(hit.instance);
    let triangle = triangle_at(body, hit.primitive);
    let material = material_of(body, triangle.slot);
    let frame = frame_at(body, triangle, hit, along);
    var normal = frame.normal;
    var is_perturbed = triangle.smooth_;
    var position = origin + along * t;
    position += frame.outward * (triangle.plane + dot(frame.outward, body.translation) - dot(frame.outward, position));
    var at = Coordinates(vec2(0.0), 0.0);
    if !material.untextured {
        let width = cone / sqrt(max(abs(dot(frame.face, along)), 0.05));
        at = coordinates_at(material, body, triangle, weights_of(hit), position, width);
    }
    var base = base_parameters(material, at, vertex_color(body, hit));
    if material.projects && view.projection != NONE {
        base.base_color = projected_albedo(material.projection_height, position);
    }
    let albedo = base.base_color;
    var layer = sample_layer(material, at, base, abs(dot(normal, along)), u);
    var map = material.at + NORMAL_MAP;
    if LAYERED && layer.is_clearcoat {
        map = layers_of(material).at + CLEARCOAT_NORMAL;
    }
    if has_texture(map) {
        let mapped = mapped_normal(map, at, texture_frame(material, body, triangle, hit, frame.side), normal);
        normal = mapped.xyz;
        is_perturbed = true;
        if mapped.w > 0.0 {
            let alpha = layer.parameters.roughness * layer.parameters.roughness;
            layer.parameters.roughness = min(sqrt(sqrt(alpha * alpha + 2.0 * mapped.w)), 1.0);
        }
    }
    if is_perturbed {
        normal = above_horizon(normal, frame.face, -along);
    }
    var transmittance = vec3(1.0);
    var pane = false;
    if LAYERED && material.layers != NONE {
        if frame.side < 0.0 {
            transmittance = exp2(layers_of(material).absorption * (t * -1.44269504088896));
        }
        pane = layer.lobe == LOBE_THIN_WALLED && has_panes(material) && is_pane(material, at);
        if pane {
            layer.parameters.roughness = 0.0;
        }
    }
    let emission = input_color(material.at + EMISSION, at);
    return Surface(
        position,
        frame.face,
        normal,
        is_perturbed,
        layer,
        frame.side < 0.0,
        pane,
        transmittance,
        albedo,
        emission,
    );
}

// Fraction of the light that a pane transmits along a ray; black for other surfaces.
fn transmittance_of_pane(hit: Hit, origin: vec3<f32>, along: vec3<f32>) -> vec3<f32> {
    let body = body_at(hit.instance);
    let triangle = triangle_at(body, hit.primitive);
    let material = material_of(body, triangle.slot);
    if !has_panes(material) {
        return vec3(0.0);
    }
    let frame = frame_at(body, triangle, hit, along);
    let at = coordinates_at(material, body, triangle, weights_of(hit), origin + along * hit.t, 0.0);
    if !is_pane(material, at) {
        return vec3(0.0);
    }
    let base = base_parameters(material, at, vertex_color(body, hit));
    var normal = frame.normal;
    if triangle.smooth_ {
        normal = above_horizon(frame.normal, frame.face, -along);
    }
    let layers = layers_of(material);
    let fraction = input_scalar(layers.at + TRANSMISSION, at) * (1.0 - base.metallic);
    return base.base_color * (fraction * pane_transmittance(abs(dot(normal, along)), layers.ior));
}

// Radiance that a body emits at a point.
fn emission_at(hit: Hit, position: vec3<f32>) -> vec3<f32> {
    let body = body_at(hit.instance);
    let triangle = triangle_at(body, hit.primitive);
    let material = material_of(body, triangle.slot);
    let at = coordinates_at(material, body, triangle, weights_of(hit), position, 0.0);
    return input_color(material.at + EMISSION, at);
}
