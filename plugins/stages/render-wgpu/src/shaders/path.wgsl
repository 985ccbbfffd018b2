// Path tracing, as in plugins/stages/render-cpu's path module: kernels that each take all paths one step further.
//
// The state of a path is a row of vectors, one plane of the buffer after the other. A pass starts paths and traces
// their rays and shadow rays (`trace`), scatters them and samples lights (`shade`), bounce by bounce, and adds what they found to
// the sums of their pixels (`accumulate`). Paths that gather guides alone are few and short: one kernel takes them from their
// start to their end (`guide`).

const ORIGIN: u32 = 0u;      // origin, near
const DIRECTION: u32 = 1u;   // direction, density
const THROUGHPUT: u32 = 2u;  // throughput, width
const NORMAL: u32 = 3u;      // normal of the last scattering, spread
const NUMBERS: u32 = 4u;     // seed, index, minimum roughness, body hit
const RADIANCE: u32 = 5u;    // radiance found; 1 if the camera ray met a body and that counts
const HIT: u32 = 6u;         // t, u, v, triangle hit
const SHADOW_RAY: u32 = 7u;  // direction, distance
const SHADOW_LIGHT: u32 = 8u;    // contribution, weight of emitter sampling
const SHADOW_ORIGIN: u32 = 9u;   // origin, seed
const GUIDE_ALBEDO: u32 = 10u;   // albedo, flags
const GUIDE_NORMAL: u32 = 11u;
const GUIDE_TINT: u32 = 12u;
const DIRECT_SPECULAR: u32 = 13u;
const SPECULAR_FRACTION: u32 = 14u;
const FIRST_RADIANCE: u32 = 15u;
const SHADOW_SPECULAR: u32 = 16u;

const PENDING: u32 = 1u;
const REFLECTED: u32 = 2u;
const BOUNCE_SHIFT: u32 = 8u;

fn state(plane: u32, path: u32) -> vec4<f32> {
    return paths[plane * view.capacity + path];
}

fn set_state(plane: u32, path: u32, value: vec4<f32>) {
    paths[plane * view.capacity + path] = value;
}

fn bits(x: f32) -> u32 {
    return bitcast<u32>(x);
}

fn as_float(n: u32) -> f32 {
    return bitcast<f32>(n);
}

fn is_light(c: vec3<f32>) -> bool {
    let sum = c.x + c.y + c.z;
    return sum > 0.0 && sum < FAR;
}

fn power_heuristic(own: f32, other: f32) -> f32 {
    let ratio = other / own;
    return 1.0 / (ratio * ratio + 1.0);
}

fn alpha_seed(seed: u32, index: u32, bounce: u32) -> u32 {
    return seed ^ (index * ALPHA_OF_SAMPLE) ^ ((bounce + 1u) * ALPHA_OF_BOUNCE);
}

fn limit_luminance(c: vec3<f32>) -> vec3<f32> {
    let limit = view.right.w;
    if limit >= FAR {
        return c;
    }
    return c * min(limit / max(luminance(c), 1e-30), 1.0);
}

fn light_of(c: vec3<f32>, bounce: u32) -> vec3<f32> {
    if bounce == 0u {
        return c;
    }
    return limit_luminance(c);
}

fn casts_shadows() -> bool {
    return (view.flags & WITHOUT_SHADOWS) == 0u;
}

fn emitter_sampled_weight(emitter: f32, pdf: f32) -> f32 {
    return select(1.0, power_heuristic(emitter, pdf), casts_shadows());
}

fn bsdf_sampled_weight(pdf: f32, emitter: f32, bounce: u32) -> f32 {
    if bounce == 0u {
        return 1.0;
    }
    if !casts_shadows() {
        // Light behind a transmitting surface contributes in no other way.
        return select(0.0, 1.0, pdf >= FAR);
    }
    return power_heuristic(pdf, emitter);
}

fn shadow_terminator(face: vec3<f32>, normal: vec3<f32>, perturbed: bool, wi: vec3<f32>) -> f32 {
    if !perturbed {
        return 1.0;
    }
    let g = min(dot(face, wi) * (1.0 / max(dot(normal, wi) * dot(normal, face), 1e-6)), 1.0);
    return g * (g + 1.0 - g * g);
}

fn offset_ray_origin(position: vec3<f32>, face: vec3<f32>) -> vec3<f32> {
    return position + face * ((max_component(abs(position)) + 0.5) * 4e-6);
}

// Column and row in the window of a pixel of the pass.
fn listed_pixel(number: u32) -> vec2<u32> {
    let packed = queues[pass_.list + pass_.first_pixel + number];
    return vec2(packed & 0xffffu, packed >> 16u);
}

// Enters the tile of a path, if there are tiles.
fn enter_tile_of(path: u32) {
    if TILES {
        let pixel = listed_pixel(path / pass_.samples);
        enter_tile(tile_number(pixel.x, pixel.y));
    }
}

// Number of pixels of the pass.
fn pixel_count() -> u32 {
    if pass_.is_chosen == 0u {
        return pass_.pixels;
    }
    let chosen = atomicLoad(&counters[CHOSEN]);
    return min(pass_.pixels, max(chosen, pass_.first_pixel) - pass_.first_pixel);
}

// Draws the camera ray of a path.
fn start_path(path: u32) {
    let pixel = listed_pixel(path / pass_.samples);
    enter_tile_of(path);
    let s = sampler_of(pixel.x, pixel.y, pass_.first_sample + path % pass_.samples);
    var place = sample_pair(s, 0u);
    if (view.flags & TENT) != 0u {
        place = vec2(tent(place.x), tent(place.y));
    }
    var origin = view.origin.xyz;
    var direction = vec3(0.0);
    if (view.flags & WARPED) != 0u {
        direction = warped_direction(pixel.x, pixel.y, place);
    } else {
        let at = image_place(pixel.x, pixel.y);
        let corner = camera_corner(at.x, at.y);
        direction = corner + view.along_u.xyz * place.x + view.along_v.xyz * place.y;
    }
    if view.along_u.w > 0.0 && !is_black(direction) {
        let lens = sample_pair(s, LENS);
        let turn = sin_cos_turns(lens.y);
        let r = sqrt(lens.x);
        let aside = view.right.xyz * (r * turn.y) + view.down.xyz * (r * turn.x);
        origin += aside;
        direction = direction * view.along_u.w - aside;
    }
    set_state(ORIGIN, path, vec4(origin, 0.0));
    set_state(DIRECTION, path, vec4(normalized_or(direction, vec3(0.0)), FAR));
    set_state(THROUGHPUT, path, vec4(1.0, 1.0, 1.0, 0.0));
    set_state(NORMAL, path, vec4(0.0, 0.0, 0.0, view.corner.w));
    set_state(NUMBERS, path, vec4(as_float(s.seed), as_float(s.index), 0.0, 0.0));
    set_state(RADIANCE, path, vec4(0.0));
    if GUIDES {
        set_state(GUIDE_ALBEDO, path, vec4(1.0, 1.0, 1.0, as_float(PENDING)));
        set_state(GUIDE_NORMAL, path, vec4(0.0));
        set_state(GUIDE_TINT, path, vec4(1.0));
        set_state(DIRECT_SPECULAR, path, vec4(0.0));
        set_state(SPECULAR_FRACTION, path, vec4(0.0));
        set_state(FIRST_RADIANCE, path, vec4(0.0));
    }
}

fn rows_of(threads: u32) -> u32 {
    return (threads + ROW - 1u) / ROW;
}

// Number of paths that a bounce begins with.
fn path_count(bounce: u32) -> u32 {
    if bounce == 0u {
        return pixel_count() * pass_.samples;
    }
    return atomicLoad(&counters[bounce]);
}

// A path that a bounce begins with.
fn listed_path(number: u32, bounce: u32) -> u32 {
    if bounce == 0u {
        return number;
    }
    return queues[(bounce & 1u) * view.capacity + number];
}

// Traces the rays of a bounce, and the shadow rays of the bounce before: neither waits for the longest rays of the other.
// The shadow rays begin with a row of threads.
@compute @workgroup_size(GROUP)
fn trace(@builtin(global_invocation_id) id: vec3<u32>) {
    let bounce = pass_.bounce;
    let alive = path_count(bounce);
    let rows = rows_of(alive);
    if id.y < rows {
        let number = id.x + id.y * ROW;
        if number < alive {
            let path = listed_path(number, bounce);
            if bounce == 0u {
                start_path(path);
            }
            extend_path(path, bounce);
        }
    } else if bounce > 0u {
        let number = id.x + (id.y - rows) * ROW;
        if number < atomicLoad(&counters[SHADOW_COUNTERS + bounce - 1u]) {
            shadow_path(queues[2u * view.capacity + number], bounce - 1u);
        }
    }
}

// Takes a path that gathers guides alone from its start to its end.
@compute @workgroup_size(GROUP)
fn guide(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x + id.y * ROW;
    if path >= pixel_count() * pass_.samples {
        return;
    }
    start_path(path);
    for (var bounce = 0u; bounce <= GUIDE_BOUNCES; bounce++) {
        extend_path(path, bounce);
        if !step_path(path, bounce).going {
            break;
        }
    }
}

// Finds the surface that a path meets.
fn extend_path(path: u32, bounce: u32) {
    enter_tile_of(path);
    let o = state(ORIGIN, path);
    let d = state(DIRECTION, path);
    let n = state(NUMBERS, path);
    var seed = 0u;
    if CUTOUTS {
        seed = alpha_seed(bits(n.x), bits(n.y), bounce);
    }
    let top = select(top_level_of_all(), top_level_of_seen(), bounce == 0u);
    let hit = first_hit(top, Ray(o.xyz, d.xyz), o.w, seed);
    set_state(HIT, path, vec4(hit.t, hit.u, hit.v, as_float(hit.primitive)));
    paths[NUMBERS * view.capacity + path].w = as_float(hit.instance);
}

var<workgroup> going_here: atomic<u32>;
var<workgroup> shadows_here: atomic<u32>;
var<workgroup> going_from: u32;
var<workgroup> shadows_from: u32;

// What a path does next.
struct Step {
    going: bool,
    casts_shadow: bool,
}

@compute @workgroup_size(GROUP)
fn shade(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let number = id.x + id.y * ROW;
    let alive = path_count(pass_.bounce);
    if local == 0u {
        atomicStore(&going_here, 0u);
        atomicStore(&shadows_here, 0u);
    }
    workgroupBarrier();
    var step = Step(false, false);
    var path = 0u;
    if number < alive {
        path = listed_path(number, pass_.bounce);
        step = step_path(path, pass_.bounce);
    }
    var going_at = 0u;
    var shadow_at = 0u;
    if step.going {
        going_at = atomicAdd(&going_here, 1u);
    }
    if step.casts_shadow {
        shadow_at = atomicAdd(&shadows_here, 1u);
    }
    workgroupBarrier();
    if local == 0u {
        let going = atomicLoad(&going_here);
        let shadows = atomicLoad(&shadows_here);
        // A group adds the rows that its own paths begin, so the sum over all groups is the number of rows.
        var going_rows = 0u;
        var rows = 0u;
        if going > 0u {
            going_from = atomicAdd(&counters[pass_.bounce + 1u], going);
            going_rows = rows_of(going_from + going) - rows_of(going_from);
        }
        if shadows > 0u {
            shadows_from = atomicAdd(&counters[SHADOW_COUNTERS + pass_.bounce], shadows);
            rows = rows_of(shadows_from + shadows) - rows_of(shadows_from);
        }
        rows += going_rows;
        if going_rows > 0u {
            atomicAdd(&counters[GROUPS + 6u * pass_.bounce + 1u], going_rows);
        }
        if rows > 0u {
            atomicAdd(&counters[GROUPS + 6u * pass_.bounce + 4u], rows);
        }
    }
    workgroupBarrier();
    if step.going {
        queues[((pass_.bounce + 1u) & 1u) * view.capacity + going_from + going_at] = path;
    }
    if step.casts_shadow {
        queues[2u * view.capacity + shadows_from + shadow_at] = path;
    }
}

fn add_radiance(path: u32, light: vec3<f32>) {
    let at = RADIANCE * view.capacity + path;
    paths[at] += vec4(light, 0.0);
}

// Ends a path or takes it through the surface that it hit.
fn step_path(path: u32, bounce: u32) -> Step {
    let over = Step(false, false);
    let o = state(ORIGIN, path);
    let d = state(DIRECTION, path);
    let t4 = state(THROUGHPUT, path);
    let n4 = state(NORMAL, path);
    let n = state(NUMBERS, path);
    let h4 = state(HIT, path);
    let origin = o.xyz;
    let direction = d.xyz;
    let pdf = d.w;
    var throughput = t4.xyz;
    let s = Sampler(bits(n.x), bits(n.y));
    let hit = Hit(h4.x, h4.y, h4.z, bits(h4.w), bits(n.w));
    if is_black(direction) {
        return over;
    }
    enter_tile_of(path);

    // Lights.
    let meets_lights = bounce > 0u || (view.flags & WITHOUT_BACKGROUND) == 0u;
    if meets_lights && light_count() > 0u {
        let met = intersect_lights(origin, direction, min(hit.t * (1.0 + TOUCHING), FAR));
        if met.number != NONE {
            let shape = shape_at(met.number);
            var sampled = 0.0;
            if bounce > 0u {
                sampled = selection_probability(origin, n4.xyz, met.number) * shape_pdf(shape, origin, met.distance);
            }
            let radiance = shape_radiance(shape, origin + direction * met.distance, direction);
            let light = light_of(throughput * radiance * bsdf_sampled_weight(pdf, sampled, bounce), bounce);
            if is_light(light) {
                add_radiance(path, light);
            }
            return over;
        }
    }
    if hit.instance == NONE {
        if meets_lights && view.distant_count > 0u {
            var sum = vec3(0.0);
            for (var i = 0u; i < view.distant_count; i++) {
                let distant = distant_radiance(i, direction);
                if is_black(distant.radiance) {
                    continue;
                }
                var sampled = 0.0;
                if bounce > 0u {
                    let number = view.area_count + emitter_count() + i;
                    sampled = distant.pdf * selection_probability(origin, n4.xyz, number);
                }
                sum += distant.radiance * bsdf_sampled_weight(pdf, sampled, bounce);
            }
            let light = light_of(throughput * sum, bounce);
            if is_light(light) {
                add_radiance(path, light);
            }
        }
        return over;
    }

    if bounce == 0u && is_held_out(hit.instance) {
        return over;
    }

    // The surface.
    if OPACITY && bounce == 0u {
        paths[RADIANCE * view.capacity + path].w = 1.0;
    }
    let width = t4.w + n4.w * hit.t;
    var u = 0.0;
    if LAYERED {
        u = sample_random(s, LAYER_DIMENSION + bounce);
    }
    var surface = surface_at(hit, origin, direction, hit.t, width, u);
    var flags = 0u;
    if GUIDES && bounce <= GUIDE_BOUNCES {
        flags = add_guide_surface(path, surface, bounce);
    }
    if !surface.is_pane {
        surface.layer.parameters.roughness = max(surface.layer.parameters.roughness, n.z);
    }
    throughput *= surface.transmittance;
    if !is_black(surface.emission) {
        var sampled = 0.0;
        if bounce > 0u {
            sampled = body_pdf(origin, n4.xyz, hit, dot(surface.face, direction));
        }
        add_radiance(path, light_of(throughput * surface.emission * bsdf_sampled_weight(pdf, sampled, bounce), bounce));
    }
    throughput *= surface.layer.weight;
    if ONLY_GUIDES {
        if (flags & PENDING) == 0u || bounce == GUIDE_BOUNCES {
            return over;
        }
    } else if bounce == view.max_bounces {
        return over;
    }

    // Scattering.
    let face = surface.face;
    let normal = surface.normal;
    let basis = basis_around(normal);
    var wo = to_local(basis, -direction);
    if wo.z <= 1e-5 {
        return over;
    }
    wo.z = max(wo.z, 1e-5);
    let parameters = surface.layer.parameters;
    let bsdf = bsdf_new(parameters, wo);
    var layered: Layered;
    if LAYERED {
        let lobe = surface.layer.lobe;
        var eta = surface.layer.ior;
        if surface.inside && lobe == LOBE_REFRACTION {
            eta = 1.0 / eta;
        }
        layered = layered_new(lobe, surface.layer.coating, eta, parameters, wo);
    }
    let outside = offset_ray_origin(surface.position, face);
    let splits = GUIDES && bounce == 0u && !ONLY_GUIDES;

    // Emitter sampling.
    var step = Step(false, false);
    if light_count() > 0u && !ONLY_GUIDES {
        let lit = sample_lights(outside, normal, sample_pair(s, 2u + 2u * bounce));
        let light = lit.sample;
        let wi = to_local(basis, light.direction);
        if light.valid && wi.z > 1e-6 && dot(light.direction, face) > 0.0 {
            var lobes: Lobes;
            if LAYERED {
                lobes = layered_lobes(layered, bsdf, wi);
            } else {
                lobes = bsdf_lobes(bsdf, wi);
            }
            let weight = emitter_sampled_weight(light.pdf, lobes.pdf);
            let factor = shadow_terminator(face, normal, surface.is_perturbed, light.direction) * weight * (1.0 / light.pdf);
            let value = lobes.glossy + lobes.matte;
            let contribution = limit_luminance(throughput * value * lit.radiance * factor);
            if is_light(contribution) && !lights_occlude(outside, light.direction, light.distance) {
                step.casts_shadow = true;
                set_state(SHADOW_RAY, path, vec4(light.direction, light.distance));
                set_state(SHADOW_LIGHT, path, vec4(contribution, weight));
                set_state(SHADOW_ORIGIN, path, vec4(outside, as_float(alpha_seed(s.seed, s.index, bounce + ALPHA_OF_SHADOW))));
                if splits {
                    let fraction = specular_fraction(lobes, parameters.metallic);
                    set_state(SHADOW_SPECULAR, path, vec4(contribution * fraction, 0.0));
                }
            }
        }
    }

    // BSDF sampling.
    let uv = sample_pair(s, 3u + 2u * bounce);
    var drawn: BsdfSample;
    if LAYERED {
        var random = 0.99999988;
        var least = 0.0;
        if !ONLY_GUIDES {
            random = sample_pair(Sampler(s.seed ^ PASSAGE, s.index), bounce).x;
            if pdf >= FAR && bounce < 2u {
                least = select(SPLIT_NEXT, SPLIT_FIRST, bounce == 0u);
            }
        }
        drawn = layered_sample(layered, bsdf, uv, random, least);
    } else {
        drawn = bsdf_sample(bsdf, uv);
    }
    let straight = LAYERED && drawn.transmitted && surface.is_pane;
    var out_direction = basis * drawn.wi;
    if straight {
        out_direction = direction;
    }
    let terminator = shadow_terminator(face, normal, surface.is_perturbed && !drawn.transmitted, out_direction);
    throughput *= drawn.weight * terminator;
    let ahead = select(dot(out_direction, face), -dot(out_direction, face), drawn.transmitted);
    var going = drawn.valid && ahead > 0.0 && is_light(throughput);
    if bounce + 1u >= view.roulette_from {
        var survival = min(max_component(throughput), 0.95);
        if pdf >= FAR && drawn.pdf >= FAR {
            survival = 1.0;
        }
        going = going && sample_random(s, bounce) < survival;
        throughput *= 1.0 / survival;
    }
    if GUIDES {
        if splits {
            var lobes: Lobes;
            if LAYERED {
                lobes = layered_lobes(layered, bsdf, drawn.wi);
            } else {
                lobes = bsdf_lobes(bsdf, drawn.wi);
            }
            let fraction = select(specular_fraction(lobes, parameters.metallic), vec3(0.0), drawn.transmitted);
            set_state(SPECULAR_FRACTION, path, vec4(fraction, 0.0));
            if !step.casts_shadow {
                set_state(FIRST_RADIANCE, path, state(RADIANCE, path));
            }
        }
        if LAYERED && drawn.reflected && bounce <= GUIDE_BOUNCES && (flags >> BOUNCE_SHIFT) == bounce {
            paths[GUIDE_ALBEDO * view.capacity + path].w = as_float(flags | REFLECTED);
        }
    }
    if going {
        step.going = true;
        let alpha = select(1.0, parameters.roughness * parameters.roughness, drawn.specular);
        let spread = n4.w + alpha * DIFFUSE_SPREAD;
        var regularize = n.z;
        if alpha > ROUGH {
            regularize = view.along_v.w;
        }
        paths[NUMBERS * view.capacity + path].z = regularize;
        if straight {
            // The ray stays what it was, and so do the densities of lights that it may hit.
            set_state(ORIGIN, path, vec4(origin, hit.t * (1.0 + PAST) + PAST));
            set_state(THROUGHPUT, path, vec4(throughput, width - n4.w * hit.t));
            set_state(NORMAL, path, vec4(n4.xyz, spread));
        } else {
            var from_ = outside;
            if LAYERED && drawn.transmitted {
                from_ = offset_ray_origin(surface.position, -face);
            }
            set_state(ORIGIN, path, vec4(from_, 0.0));
            set_state(DIRECTION, path, vec4(out_direction, drawn.pdf));
            set_state(THROUGHPUT, path, vec4(throughput, width));
            set_state(NORMAL, path, vec4(normal, spread));
        }
    }
    return step;
}

// Fraction of the light by some lobes that is specular, without being colored.
fn specular_fraction(lobes: Lobes, metallic: f32) -> vec3<f32> {
    return lobes.glossy * (1.0 - metallic) / max(lobes.glossy + lobes.matte, vec3(1e-20));
}

// Adds a surface to the guides of a path; returns its flags.
fn add_guide_surface(path: u32, surface: Surface, bounce: u32) -> u32 {
    let old = state(GUIDE_ALBEDO, path);
    var flags = bits(old.w);
    if (flags & PENDING) == 0u {
        return flags;
    }
    flags = (flags & ((1u << BOUNCE_SHIFT) - 1u)) | (bounce << BOUNCE_SHIFT);
    let lobe = surface.layer.lobe;
    var color = surface.albedo;
    if lobe == LOBE_REFRACTION {
        color = sqrt(color);
    }
    if bounce > 0u {
        color = max(color, vec3(GLOSS));
    }
    let albedo = color * surface.transmittance * state(GUIDE_TINT, path).xyz;
    let p = surface.layer.parameters;
    let is_mirror = p.roughness < 0.15 && (p.metallic > 0.9 || is_transmission(lobe));
    if is_mirror && bounce != GUIDE_BOUNCES {
        set_state(GUIDE_TINT, path, vec4(albedo, 0.0));
    } else {
        flags &= ~PENDING;
        set_state(GUIDE_NORMAL, path, vec4(surface.normal, 0.0));
    }
    set_state(GUIDE_ALBEDO, path, vec4(albedo, as_float(flags)));
    return flags;
}

// Adds the light of a shadow ray to its path, unless something is in the way.
fn shadow_path(path: u32, bounce: u32) {
    enter_tile_of(path);
    let r = state(SHADOW_RAY, path);
    let o = state(SHADOW_ORIGIN, path);
    let ray = Ray(o.xyz, r.xyz);
    // Rays of no length meet nothing.
    let reach = select(0.0, r.w * (1.0 - TOUCHING), casts_shadows());
    let passed = passage_of_light(top_level_of_all(), ray, reach, bits(o.w));
    if !is_black(passed.transmittance) {
        let l = state(SHADOW_LIGHT, path);
        var transmittance = passed.transmittance;
        // A path counts panes as bounces, and may end among them: then no other estimate finds the light.
        if passed.panes > 0u && bounce + 1u + passed.panes > view.max_bounces {
            transmittance *= 1.0 / l.w;
        }
        add_radiance(path, l.xyz * transmittance);
        if GUIDES && bounce == 0u {
            let specular = state(SHADOW_SPECULAR, path).xyz * transmittance;
            set_state(DIRECT_SPECULAR, path, vec4(state(DIRECT_SPECULAR, path).xyz + specular, 0.0));
        }
    }
    if GUIDES && bounce == 0u {
        set_state(FIRST_RADIANCE, path, state(RADIANCE, path));
    }
}

// Sums of a pixel, number after number, as planes.rs says where: radiance and squared luminance, the rounding errors of both,
// samples; with guides their samples, albedo and normal; specular radiance and its square; the demodulated rest and its
// square. The opacity comes after all others.
fn sum_of_opacity() -> u32 {
    return select(SUMS_OF_LIGHT, SUMS_WITH_GUIDES, GUIDES);
}

fn pixels_of_window() -> u32 {
    return u32(view.window.z) * u32(view.window.w);
}

// Place of a number of a pixel, counted row by row.
fn sum_at(number: u32, entry: u32) -> u32 {
    return view.sums_at + number * pixels_of_window() + entry;
}

fn read_sum(number: u32, entry: u32) -> f32 {
    return bitcast<f32>(output[sum_at(number, entry)]);
}

fn write_sum(number: u32, entry: u32, value: f32) {
    output[sum_at(number, entry)] = bits(value);
}

// Adds one sample after the other to what earlier passes found, so that it does not matter how samples are divided among
// passes. Radiance and its square keep their rounding errors (Kahan).
@compute @workgroup_size(GROUP)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    let number = id.x + id.y * ROW;
    if number == 0u && !ONLY_GUIDES {
        count_rays();
    }
    if number >= pixel_count() {
        return;
    }
    let pixel = listed_pixel(number);
    let entry = pixel.y * u32(view.window.z) + pixel.x;
    let gathers_light = !ONLY_GUIDES;
    var opacity = 0.0;
    if OPACITY {
        opacity = read_sum(sum_of_opacity(), entry);
    }
    var light_sum = vec4(0.0);
    var light_error = vec4(0.0);
    var guides = 0.0;
    var albedo = vec3(0.0);
    var normal = vec3(0.0);
    var specular = vec4(0.0);
    var demodulated = vec4(0.0);
    for (var c = 0u; c < 4u; c++) {
        light_sum[c] = read_sum(c, entry);
        light_error[c] = read_sum(c + 4u, entry);
        if GUIDES {
            specular[c] = read_sum(SUM_SPECULAR + c, entry);
            demodulated[c] = read_sum(SUM_DEMODULATED + c, entry);
        }
    }
    if GUIDES {
        guides = read_sum(SUM_GUIDES, entry);
        for (var c = 0u; c < 3u; c++) {
            albedo[c] = read_sum(SUM_GUIDES + 1u + c, entry);
            normal[c] = read_sum(SUM_GUIDES + 4u + c, entry);
        }
    }
    for (var i = 0u; i < pass_.samples; i++) {
        let path = number * pass_.samples + i;
        let found = state(RADIANCE, path);
        let light = found.xyz;
        if OPACITY {
            opacity += found.w;
        }
        if gathers_light {
            let y = luminance(light);
            let value = vec4(light, y * y) - light_error;
            let sum = light_sum + value;
            light_error = (sum - light_sum) - value;
            light_sum = sum;
        }
        if GUIDES {
            let a = state(GUIDE_ALBEDO, path);
            let reflected = (bits(a.w) & REFLECTED) != 0u;
            if !reflected {
                guides += 1.0;
                albedo += a.xyz;
                normal += state(GUIDE_NORMAL, path).xyz;
            }
            if gathers_light {
                var part = light;
                if !reflected {
                    let first = state(FIRST_RADIANCE, path).xyz;
                    part = state(DIRECT_SPECULAR, path).xyz + (light - first) * state(SPECULAR_FRACTION, path).xyz;
                    part = clamp(part, vec3(0.0), max(light, vec3(0.0)));
                }
                let rest = (light - part) / (a.xyz + DEMODULATION_EPSILON);
                let part_y = luminance(part);
                let rest_y = luminance(rest);
                specular += vec4(part, part_y * part_y);
                demodulated += vec4(rest, rest_y * rest_y);
            }
        }
    }
    for (var c = 0u; c < 4u; c++) {
        write_sum(c, entry, light_sum[c]);
        write_sum(c + 4u, entry, light_error[c]);
        if GUIDES {
            write_sum(SUM_SPECULAR + c, entry, specular[c]);
            write_sum(SUM_DEMODULATED + c, entry, demodulated[c]);
        }
    }
    if gathers_light {
        write_sum(SUM_SAMPLES, entry, read_sum(SUM_SAMPLES, entry) + f32(pass_.samples));
    }
    if OPACITY && gathers_light {
        write_sum(sum_of_opacity(), entry, opacity);
    }
    if GUIDES {
        write_sum(SUM_GUIDES, entry, guides);
        for (var c = 0u; c < 3u; c++) {
            write_sum(SUM_GUIDES + 1u + c, entry, albedo[c]);
            write_sum(SUM_GUIDES + 4u + c, entry, normal[c]);
        }
    }
}

fn add_wide(at: u32, value: u32) {
    let before = atomicAdd(&counters[at], value);
    if before > 0xffffffffu - value {
        atomicAdd(&counters[at + 1u], 1u);
    }
}

// Adds up the rays of the bounces of a pass, and readies the counters for the next one.
fn count_rays() {
    for (var bounce = 0u; bounce <= view.max_bounces; bounce++) {
        add_wide(RAYS_COUNTED, path_count(bounce));
        add_wide(SHADOWS_COUNTED, atomicLoad(&counters[SHADOW_COUNTERS + bounce]));
        atomicStore(&counters[bounce], 0u);
        atomicStore(&counters[SHADOW_COUNTERS + bounce], 0u);
        atomicStore(&counters[GROUPS + 6u * bounce + 1u], 0u);
        atomicStore(&counters[GROUPS + 6u * bounce + 4u], 0u);
    }
}

fn mean_sum(first: u32, entry: u32) -> vec3<f32> {
    let per = 1.0 / max(read_sum(SUM_GUIDES, entry), 1.0);
    return vec3(read_sum(first, entry), read_sum(first + 1u, entry), read_sum(first + 2u, entry)) * per;
}

// More samples of the guides for pixels that have few and are unlike a neighbor, as in film.rs.
@compute @workgroup_size(GROUP)
fn choose(@builtin(global_invocation_id) id: vec3<u32>) {
    let entry = id.x + id.y * ROW;
    let all = pixels_of_window();
    if entry >= all {
        return;
    }
    let guides = read_sum(SUM_GUIDES, entry);
    if guides >= GUIDE_SAMPLES {
        return;
    }
    let width = u32(view.window.z);
    let column = entry % width;
    let row = entry / width;
    var number = 0u;
    if TILES {
        number = tile_number(column, row);
        if number == NONE {
            return;
        }
    }
    // Paths that glass reflected tell nothing.
    var differs = guides < read_sum(SUM_SAMPLES, entry);
    let albedo = mean_sum(SUM_GUIDES + 1u, entry);
    let normal = mean_sum(SUM_GUIDES + 4u, entry);
    for (var y = max(row, 1u) - 1u; y < min(row + 2u, u32(view.window.w)) && !differs; y++) {
        for (var x = max(column, 1u) - 1u; x < min(column + 2u, width); x++) {
            let there = y * width + x;
            if TILES && tile_number(x, y) != number {
                continue;
            }
            let a = abs(albedo - mean_sum(SUM_GUIDES + 1u, there));
            let b = abs(normal - mean_sum(SUM_GUIDES + 4u, there));
            differs = differs || max(max_component(a), max_component(b)) > DIFFERENT;
        }
    }
    if differs {
        queues[3u * view.capacity + all + atomicAdd(&counters[CHOSEN], 1u)] = column | (row << 16u);
    }
}

// One word of a plane; neighboring threads write neighboring words.
fn set_plane(word: u32, value: f32) {
    paths[word / 4u][word % 4u] = value;
}

fn set_color(first: u32, entry: u32, color: vec3<f32>) {
    let word = first * pixels_of_window() + 3u * entry;
    set_plane(word, color.x);
    set_plane(word + 1u, color.y);
    set_plane(word + 2u, color.z);
}

fn set_part(first: u32, entry: u32, sum: vec3<f32>, square: f32, samples: f32) {
    set_color(first, entry, sum / max(samples, 1.0));
    set_plane((first + 3u) * pixels_of_window() + entry, variance_of(luminance(sum), square, samples));
}

// Estimated variance of a mean, from the samples' sum and that of their squares; infinite for a single one, and 0 where
// there are none.
fn variance_of(sum: f32, square: f32, samples: f32) -> f32 {
    if samples < 1.0 {
        return 0.0;
    }
    let mean = sum / samples;
    if samples <= 1.0 {
        return FAR;
    }
    return max(square / samples - mean * mean, 0.0) / (samples - 1.0);
}

// The planes of an image, from the sums of its pixels, after the paths are done and in their place: radiance and its variance;
// with guides specular radiance, the demodulated rest, each with its variance, albedo and normal. Colors have three words
// per pixel.
@compute @workgroup_size(GROUP)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    let entry = id.x + id.y * ROW;
    if entry >= pixels_of_window() {
        return;
    }
    let samples = read_sum(SUM_SAMPLES, entry);
    var light = vec4(0.0);
    var specular = vec4(0.0);
    var demodulated = vec4(0.0);
    for (var c = 0u; c < 4u; c++) {
        // What rounding added was to be subtracted from the next number.
        light[c] = read_sum(c, entry) - read_sum(c + 4u, entry);
        if GUIDES {
            specular[c] = read_sum(SUM_SPECULAR + c, entry);
            demodulated[c] = read_sum(SUM_DEMODULATED + c, entry);
        }
    }
    set_part(AT_RADIANCE, entry, light.xyz, light.w, samples);
    if OPACITY {
        let plane = select(AT_OPACITY, AT_OPACITY_AFTER_GUIDES, GUIDES);
        set_plane(plane * pixels_of_window() + entry, read_sum(sum_of_opacity(), entry) / max(samples, 1.0));
    }
    if GUIDES {
        set_part(AT_SPECULAR, entry, specular.xyz, specular.w, samples);
        set_part(AT_DEMODULATED, entry, demodulated.xyz, demodulated.w, samples);
        set_color(AT_ALBEDO, entry, mean_sum(SUM_GUIDES + 1u, entry));
        set_color(AT_NORMAL, entry, to_camera(mean_sum(SUM_GUIDES + 4u, entry)));
    }
}
