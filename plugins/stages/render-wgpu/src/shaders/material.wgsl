// Textures and materials, as in core/lib/prepare's mapping.rs, texture.rs and material.rs, and the layers of layer.rs.

// A material is 22 entries: five inputs of three, then scalars, the mapping and a matrix of colors. Layers are six inputs and two entries.
const INPUT_SIZE: u32 = 3u;
const MATERIAL_SIZE: u32 = 22u;
const LAYERS_SIZE: u32 = 20u;

const BASE_COLOR: u32 = 0u;
const ROUGHNESS: u32 = 3u;
const METALLIC: u32 = 6u;
const NORMAL_MAP: u32 = 9u;
const EMISSION: u32 = 12u;
const COLOR_MATRIX: u32 = 19u;

const UNTEXTURED: u32 = 1u;
const RECOLORED: u32 = 2u;

const CLEARCOAT: u32 = 0u;
const CLEARCOAT_ROUGHNESS: u32 = 3u;
const CLEARCOAT_NORMAL: u32 = 6u;
const SHEEN_COLOR: u32 = 9u;
const SHEEN_ROUGHNESS: u32 = 12u;
const TRANSMISSION: u32 = 15u;

const ALPHA_OPAQUE: u32 = 0u;
const ALPHA_BLEND: u32 = 2u;


struct Coordinates {
    uv: vec2<f32>,
    log2_width: f32,
}

struct Material {
    // Entry of its first input.
    at: u32,
    dielectric_f0: f32,
    // Entry of its layers, or NONE.
    layers: u32,
    alpha: u32,
    alpha_value: f32,
    boxed: bool,
    per_m: f32,
    projection_height: f32,
    projects: bool,
    untextured: bool,
    recolored: bool,
    m: vec4<f32>,
    offset: vec2<f32>,
    log2_scale: f32,
}

struct Layers {
    at: u32,
    absorption: vec3<f32>,
    ior: f32,
    has_volume: bool,
}

fn material_of(body: Body, slot: u32) -> Material {
    let at = view.materials + (body.first_material + min(slot, body.last_slot)) * MATERIAL_SIZE;
    let a = tables[at + 15u];
    let b = tables[at + 16u];
    let m = table_f(at + 17u);
    let d = tables[at + 18u];
    return Material(
        at,
        bitcast<f32>(a.x),
        a.y,
        a.z,
        bitcast<f32>(a.w),
        b.x != 0u,
        bitcast<f32>(b.y),
        bitcast<f32>(b.z),
        b.w != 0u,
        (d.w & UNTEXTURED) != 0u,
        (d.w & RECOLORED) != 0u,
        m,
        bitcast<vec2<f32>>(d.xy),
        bitcast<f32>(d.z),
    );
}

fn layers_of(material: Material) -> Layers {
    let at = view.layers + material.layers * LAYERS_SIZE;
    let a = table_f(at + 18u);
    return Layers(at, a.xyz, a.w, tables[at + 19u].x != 0u);
}

fn apply_affine(m: vec4<f32>, offset: vec2<f32>, uv: vec2<f32>) -> vec2<f32> {
    return vec2(m.x * uv.x + m.y * uv.y + offset.x, m.z * uv.x + m.w * uv.y + offset.y);
}

// Neighboring texels along one axis, and the weight of the second.
struct Axis {
    first: u32,
    second: u32,
    weight: f32,
}

const WRAP_REPEAT: u32 = 0u;
const WRAP_MIRROR: u32 = 1u;

fn texture_axis(u: f32, size: u32, wrap: u32) -> Axis {
    let last = i32(size) - 1;
    var folded = clamp(u, 0.0, 1.0);
    if wrap == WRAP_REPEAT {
        folded = u - floor(u);
    } else if wrap == WRAP_MIRROR {
        let half = (u * 0.5 - floor(u * 0.5)) * 2.0;
        folded = select(half, 2.0 - half, half > 1.0);
    }
    let place = folded * f32(size) - 0.5;
    let whole = floor(place);
    let first = i32(whole);
    let second = first + 1;
    if wrap == WRAP_REPEAT {
        return Axis(
            u32(select(min(first, last), last, first < 0)),
            // As numbers without a sign, so that what is no number at all is inside, too.
            select(u32(second), 0u, u32(second) > u32(last)),
            place - whole,
        );
    }
    return Axis(u32(clamp(first, 0, last)), u32(clamp(second, 0, last)), place - whole);
}

struct Footprint {
    taps: vec4<u32>,
    weight: vec2<f32>,
    srgb: bool,
}

// The four texels around a place, RGBA of eight bits each: upper left, upper right, lower left, lower right.
fn texture_footprint(texture: u32, uv: vec2<f32>, level: f32) -> Footprint {
    let header = tables[view.textures + texture];
    let count = header.y;
    var number = 0u;
    if level > 0.0 {
        number = min(u32(level + 0.5), count - 1u);
    }
    let mip = tables[header.x + number];
    let x = texture_axis(uv.x, mip.x, header.z & 0xffffu);
    let y = texture_axis(1.0 - uv.y, mip.y, header.z >> 16u);
    let upper = mip.z + y.first * mip.x;
    let lower = mip.z + y.second * mip.x;
    let taps = vec4(
        images[upper + x.first],
        images[upper + x.second],
        images[lower + x.first],
        images[lower + x.second],
    );
    return Footprint(taps, vec2(x.weight, y.weight), header.w != 0u);
}

fn decode(code: u32, srgb: bool) -> f32 {
    if srgb {
        return bitcast<f32>(table_word(view.decode, code));
    }
    return f32(code) / 255.0;
}

fn decode_color(texel: u32, srgb: bool) -> vec3<f32> {
    return vec3(decode(texel & 255u, srgb), decode((texel >> 8u) & 255u, srgb), decode((texel >> 16u) & 255u, srgb));
}

fn texture_color(texture: u32, uv: vec2<f32>, level: f32) -> vec3<f32> {
    let f = texture_footprint(texture, uv, level);
    let upper = mix(decode_color(f.taps.x, f.srgb), decode_color(f.taps.y, f.srgb), f.weight.x);
    let lower = mix(decode_color(f.taps.z, f.srgb), decode_color(f.taps.w, f.srgb), f.weight.x);
    return mix(upper, lower, f.weight.y);
}

fn texture_channel(texture: u32, uv: vec2<f32>, level: f32, channel: u32) -> f32 {
    let f = texture_footprint(texture, uv, level);
    let shift = 8u * (channel & 3u);
    let srgb = f.srgb && channel != 3u;
    let codes = (f.taps >> vec4(shift)) & vec4(255u);
    let upper = mix(decode(codes.x, srgb), decode(codes.y, srgb), f.weight.x);
    let lower = mix(decode(codes.z, srgb), decode(codes.w, srgb), f.weight.x);
    return mix(upper, lower, f.weight.y);
}

// An input is (factor, texture), the matrix, (offset, level bias, channel).
fn input_color(at: u32, place: Coordinates) -> vec3<f32> {
    let a = tables[at];
    let factor = bitcast<vec3<f32>>(a.xyz);
    if a.w == NONE {
        return factor;
    }
    let c = table_f(at + 2u);
    let uv = apply_affine(table_f(at + 1u), c.xy, place.uv);
    return factor * texture_color(a.w, uv, place.log2_width + c.z);
}

fn input_scalar(at: u32, place: Coordinates) -> f32 {
    let a = tables[at];
    let factor = bitcast<f32>(a.x);
    if a.w == NONE {
        return factor;
    }
    let c = tables[at + 2u];
    let offset = bitcast<vec2<f32>>(c.xy);
    let uv = apply_affine(table_f(at + 1u), offset, place.uv);
    return factor * texture_channel(a.w, uv, place.log2_width + bitcast<f32>(c.z), c.w);
}

fn has_texture(at: u32) -> bool {
    return tables[at].w != NONE;
}

fn input_factor(at: u32) -> f32 {
    return bitcast<f32>(tables[at].x);
}

// Axes of the side of a box that a face is on.
struct BoxAxes {
    u: vec3<f32>,
    v: vec3<f32>,
}

fn box_axes(normal: vec3<f32>) -> BoxAxes {
    let a = abs(normal);
    if a.z >= a.x && a.z >= a.y {
        return BoxAxes(vec3(select(1.0, -1.0, is_negative(normal.z)), 0.0, 0.0), vec3(0.0, 1.0, 0.0));
    }
    if a.x >= a.y {
        return BoxAxes(vec3(0.0, select(1.0, -1.0, is_negative(normal.x)), 0.0), vec3(0.0, 0.0, 1.0));
    }
    return BoxAxes(vec3(select(-1.0, 1.0, is_negative(normal.y)), 0.0, 0.0), vec3(0.0, 0.0, 1.0));
}

fn coordinates_at(
    material: Material,
    body: Body,
    triangle: Triangle,
    weights: vec3<f32>,
    position: vec3<f32>,
    width: f32,
) -> Coordinates {
    if material.boxed {
        let axes = box_axes(triangle.normal);
        let p = point_to_body(body, position);
        let uv = apply_affine(material.m, material.offset, vec2(dot(p, axes.u), dot(p, axes.v)) * material.per_m);
        return Coordinates(uv, log2_rough(max(material.per_m * width, 1e-20)));
    }
    let uv = triangle.uv_a * weights.x + triangle.uv_b * weights.y + triangle.uv_c * weights.z;
    let log2_width = log2_rough(max(triangle.uv_per_m * width, 1e-20)) + material.log2_scale;
    return Coordinates(apply_affine(material.m, material.offset, uv), log2_width);
}

fn alpha_of_texel(material: Material, uv: vec2<f32>) -> f32 {
    let at = material.at + BASE_COLOR;
    let texture = tables[at].w;
    if texture == NONE {
        return 1.0;
    }
    let c = table_f(at + 2u);
    return texture_channel(texture, apply_affine(table_f(at + 1u), c.xy, uv), FINEST + c.z, 3u);
}

fn weights_of(hit: Hit) -> vec3<f32> {
    return vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
}

// Alpha at a hit by the finest texels, and what it means.
struct Alpha {
    mode: u32,
    texel: f32,
    value: f32,
}

fn alpha_at(hit: Hit, position: vec3<f32>) -> Alpha {
    let body = body_at(hit.instance);
    let triangle = triangle_at(body, hit.primitive);
    let material = material_of(body, triangle.slot);
    if material.alpha == ALPHA_OPAQUE {
        return Alpha(ALPHA_OPAQUE, 1.0, 1.0);
    }
    let at = coordinates_at(material, body, triangle, weights_of(hit), position, 0.0);
    return Alpha(material.alpha, alpha_of_texel(material, at.uv), material.alpha_value);
}

// Whether there is a surface at a hit, or a hole; where it covers in part, `u` decides.
fn is_solid(hit: Hit, position: vec3<f32>, u: f32) -> bool {
    let alpha = alpha_at(hit, position);
    if alpha.mode == ALPHA_BLEND {
        return alpha.texel * alpha.value > u;
    }
    return alpha.mode == ALPHA_OPAQUE || alpha.texel >= alpha.value;
}

// Whether a surface transmits one half or more of the light that enters, by its finest texels.
fn is_glass(hit: Hit, position: vec3<f32>) -> bool {
    let body = body_at(hit.instance);
    let triangle = triangle_at(body, hit.primitive);
    let material = material_of(body, triangle.slot);
    if !LAYERED || material.layers == NONE {
        return false;
    }
    let place = coordinates_at(material, body, triangle, weights_of(hit), position, 0.0);
    let at = Coordinates(place.uv, FINEST);
    let metallic = input_scalar(material.at + METALLIC, at);
    return input_scalar(layers_of(material).at + TRANSMISSION, at) * (1.0 - metallic) >= GLASS;
}

// Whether there is a surface at a hit for labels.
fn is_labeled(hit: Hit, position: vec3<f32>) -> bool {
    if (view.flags & LABELS_THROUGH_GLASS) != 0u && is_glass(hit, position) {
        return false;
    }
    let alpha = alpha_at(hit, position);
    if alpha.mode == ALPHA_BLEND {
        let by_coverage = (view.flags & BLENDED_BY_COVERAGE) != 0u;
        return alpha.texel * select(1.0, alpha.value, by_coverage) >= 0.5;
    }
    return alpha.mode == ALPHA_OPAQUE || alpha.texel >= alpha.value;
}

// A random number for a surface that covers in part: one for every ray and triangle.
fn alpha_random(seed: u32, hit: Hit) -> f32 {
    return sample_random(Sampler(seed, hit.primitive), hit.instance);
}

fn vertex_color(body: Body, hit: Hit) -> vec3<f32> {
    if body.colors == NONE {
        return vec3(1.0);
    }
    // Nine channels of 16 bits in five words of two entries.
    let a = shading[body.colors + hit.primitive * 2u];
    let b = shading[body.colors + hit.primitive * 2u + 1u];
    let w = weights_of(hit);
    let first = vec3(f32(a.x & 0xffffu), f32(a.x >> 16u), f32(a.y & 0xffffu));
    let second = vec3(f32(a.y >> 16u), f32(a.z & 0xffffu), f32(a.z >> 16u));
    let third = vec3(f32(a.w & 0xffffu), f32(a.w >> 16u), f32(b.x & 0xffffu));
    return (first * w.x + second * w.y + third * w.z) * (1.0 / 65535.0);
}

fn unpack_unit(code: u32) -> vec3<f32> {
    let x = f32(i32(code << 16u) >> 16u) * (1.0 / 32767.0);
    let y = f32(i32(code) >> 16u) * (1.0 / 32767.0);
    let z = 1.0 - abs(x) - abs(y);
    let fold = min(z, 0.0);
    return normalize(vec3(x + copysign(fold, -x), y + copysign(fold, -y), z));
}

struct Frame2 {
    u: vec3<f32>,
    v: vec3<f32>,
}

fn tangent_frame(m: vec4<f32>, f: Frame2) -> Frame2 {
    let s = copysign(1.0, m.x * m.w - m.y * m.z);
    return Frame2((f.u * m.w - f.v * m.z) * s, (f.v * m.x - f.u * m.y) * s);
}

// Directions in which the material's u and v grow, world, up to length; reversed if seen from the back.
fn texture_frame(material: Material, body: Body, triangle: Triangle, hit: Hit, side: f32) -> Frame2 {
    var f: Frame2;
    if material.boxed {
        let axes = box_axes(triangle.normal);
        f = Frame2(axes.u, axes.v);
    } else {
        if body.tangents == NONE {
            return Frame2(vec3(0.0), vec3(0.0));
        }
        let t = shading[body.tangents + hit.primitive];
        let w = weights_of(hit);
        let u = unpack_unit(t.x) * w.x + unpack_unit(t.y) * w.y + unpack_unit(t.z) * w.z;
        let v = cross(triangle.normal, u);
        f = Frame2(u, select(v, -v, triangle.mirrored));
    }
    f = tangent_frame(material.m, f);
    return Frame2(direction_to_world(body, f.u) * side, direction_to_world(body, f.v) * side);
}

fn base_color(material: Material, at: Coordinates, tint: vec3<f32>) -> vec3<f32> {
    let color = input_color(material.at + BASE_COLOR, at) * tint;
    if !material.recolored {
        return color;
    }
    let rows = material.at + COLOR_MATRIX;
    let changed = vec3(
        dot(table_f(rows).xyz, color),
        dot(table_f(rows + 1u).xyz, color),
        dot(table_f(rows + 2u).xyz, color),
    );
    return clamp(changed, vec3(0.0), vec3(1.0));
}

fn base_parameters(material: Material, at: Coordinates, tint: vec3<f32>) -> BsdfParameters {
    return BsdfParameters(
        base_color(material, at, tint),
        input_scalar(material.at + ROUGHNESS, at),
        input_scalar(material.at + METALLIC, at),
        material.dielectric_f0,
    );
}

// The layer that a path scatters from.
struct LayerSample {
    lobe: u32,
    parameters: BsdfParameters,
    weight: f32,
    coating: CoatingParameters,
    ior: f32,
    is_clearcoat: bool,
}

fn sample_layer(material: Material, at: Coordinates, base: BsdfParameters, cosine: f32, random: f32) -> LayerSample {
    var s = LayerSample(LOBE_BASE, base, 1.0, CoatingParameters(0.0, 0.0, 0.0, 0.0), 1.0, false);
    if !LAYERED || material.layers == NONE {
        return s;
    }
    let layers = layers_of(material);
    var u = random;
    s.ior = layers.ior;
    if input_factor(layers.at + CLEARCOAT) > 0.0 {
        let strength = input_scalar(layers.at + CLEARCOAT, at);
        let roughness = input_scalar(layers.at + CLEARCOAT_ROUGHNESS, at);
        if strength > 0.0 {
            let probability = clamp(strength * clearcoat_albedo(roughness, cosine), 0.15, 0.85);
            if u < probability {
                s.parameters = BsdfParameters(vec3(0.0), roughness, 0.0, CLEARCOAT_F0);
                s.weight = strength / probability;
                s.is_clearcoat = true;
                return s;
            }
            u = (u - probability) / (1.0 - probability);
            s.weight = 1.0 / (1.0 - probability);
            s.coating.clearcoat = strength;
            s.coating.clearcoat_roughness = roughness;
        }
    }
    if !is_black(bitcast<vec3<f32>>(tables[layers.at + SHEEN_COLOR].xyz)) {
        let color = input_color(layers.at + SHEEN_COLOR, at);
        let roughness = input_scalar(layers.at + SHEEN_ROUGHNESS, at);
        let strength = max_component(color);
        if strength > 0.0 {
            let probability = clamp(strength * sheen_albedo(roughness, cosine), 0.15, 0.6);
            if u < probability {
                s.lobe = LOBE_SHEEN;
                s.parameters = BsdfParameters(color, roughness, 0.0, 0.0);
                s.weight = s.weight / probability;
                return s;
            }
            u = (u - probability) / (1.0 - probability);
            s.weight /= 1.0 - probability;
            s.coating.sheen = strength;
            s.coating.sheen_roughness = roughness;
        }
    }
    if input_factor(layers.at + TRANSMISSION) > 0.0 {
        let probability = input_scalar(layers.at + TRANSMISSION, at) * (1.0 - s.parameters.metallic);
        if u < probability {
            s.lobe = select(LOBE_THIN_WALLED, LOBE_REFRACTION, layers.has_volume);
        } else {
            s.parameters.metallic = min(s.parameters.metallic / (1.0 - probability), 1.0);
        }
    }
    return s;
}

// The normal of a map around the unit normal `n`, and the variance of slopes that are too fine for the look-up.
fn mapped_normal(map: u32, at: Coordinates, frame: Frame2, n: vec3<f32>) -> vec4<f32> {
    let a = tables[map];
    let strength = bitcast<f32>(a.x);
    let m = table_f(map + 1u);
    let o = table_f(map + 2u);
    let c = texture_color(a.w, apply_affine(m, o.xy, at.uv), at.log2_width + o.z);
    let mean = length(c * 2.0 - 1.0);
    let variance = max((1.0 - mean) / max(mean, 0.1) - 0.01, 0.0) * strength * strength;
    let slope = (c.xy * 2.0 - 1.0) * strength;
    let z = c.z * 2.0 - 1.0;
    let along = tangent_frame(m, frame);
    let u = normalized_or(along.u - n * dot(along.u, n), vec3(0.0));
    let v = normalized_or(along.v - n * dot(along.v, n), vec3(0.0));
    return vec4(normalized_or(u * slope.x + v * slope.y + n * max(z, 0.05), n), variance);
}

// Layers of a material that has panes somewhere.
fn has_panes(material: Material) -> bool {
    if material.layers == NONE || has_texture(material.at + NORMAL_MAP) {
        return false;
    }
    let layers = layers_of(material);
    let roughness = material.at + ROUGHNESS;
    let smooth_ = has_texture(roughness) || input_factor(roughness) <= PANE_ROUGHNESS;
    return smooth_ && input_factor(layers.at + TRANSMISSION) > 0.0 && !layers.has_volume;
}

fn is_pane(material: Material, at: Coordinates) -> bool {
    return input_scalar(material.at + ROUGHNESS, Coordinates(at.uv, FINEST)) <= PANE_ROUGHNESS;
}
