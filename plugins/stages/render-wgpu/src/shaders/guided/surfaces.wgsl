// Guides and light, pixel by pixel.

// Whether the ray through the center meets a surface.
fn meets_surface(pixel: u32) -> bool {
    let depth = number(work.depth + pixel);
    return input[work.instance + pixel] != 0u && depth > NEAREST && depth < FAR;
}

fn is_beside_nothing(at: vec2<i32>) -> bool {
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let there = at + vec2(dx, dy);
            if is_inside(there) && !meets_surface(index(there)) {
                return true;
            }
        }
    }
    return false;
}

// Whether a pixel shows surfaces alone, and sound light.
fn is_surface(at: vec2<i32>, pixel: u32) -> bool {
    if !is_finite(vector(work.radiance, pixel)) || !meets_surface(pixel) {
        return false;
    }
    let normal = vector(work.normal, pixel);
    return dot(normal, normal) >= WHOLE * WHOLE || !is_beside_nothing(at);
}

@compute @workgroup_size(8, 8)
fn surfaces(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    if !is_inside(at) {
        return;
    }
    let pixel = index(at);
    if !is_surface(at, pixel) {
        shapes[pixel] = vec4(0.0);
        bodies[pixel] = vec2(0.0, NO_SURFACE);
        return;
    }
    let normal = vector(work.normal, pixel);
    let bounded = select(vec3(0.0), clamp(normal, vec3(-1.0), vec3(1.0)), abs(normal) < vec3(FAR));
    shapes[pixel] = vec4(bounded, 1.0 / number(work.depth + pixel));
    bodies[pixel] = vec2(luminance(demodulator(pixel)), f32(input[work.instance + pixel]));
}

fn is_of(id: f32, at: vec2<i32>) -> bool {
    return is_inside(at) && bodies[index(at)].y == id;
}

// The smaller of the differences to the two neighbors of the same body; 0 if there is none.
fn slope(at: vec2<i32>, id: f32, step: vec2<i32>) -> f32 {
    let here = shapes[index(at)].w;
    var back = FAR;
    var forth = FAR;
    if is_of(id, at - step) {
        back = here - shapes[index(at - step)].w;
    }
    if is_of(id, at + step) {
        forth = shapes[index(at + step)].w - here;
    }
    let least = select(forth, back, abs(back) < abs(forth));
    return select(0.0, least, abs(least) < FAR);
}

// Whether another body, or none, is among the eight neighbors.
fn is_border(at: vec2<i32>, id: f32) -> bool {
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let there = at + vec2(dx, dy);
            if is_inside(there) && bodies[index(there)].y != id {
                return true;
            }
        }
    }
    return false;
}

fn light_and_variance(light: vec3<f32>, plane: u32, pixel: u32) -> vec4<f32> {
    let bright = luminance(light);
    var variance = bright * bright;
    if plane != NONE {
        let rendered = number(plane + pixel);
        variance = select(variance, rendered, rendered >= 0.0 && rendered < FAR);
    }
    return vec4(light, min(variance, MOST_NITS * MOST_NITS));
}

// Finds slopes and borders, and writes the light of both parts.
@compute @workgroup_size(8, 8)
fn borders(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    if !is_inside(at) {
        return;
    }
    let pixel = index(at);
    let body = bodies[pixel].y;
    if body < 0.0 {
        return;
    }
    let border = is_border(at, body);
    let along = vec2(slope(at, body, vec2(1, 0)), slope(at, body, vec2(0, 1)));
    places[pixel] = vec4(along, select(0.0, 1.0, border), 0.0);
    lights_out[pixel] = light_and_variance(diffuse_light(pixel, border), work.demodulated_variance, pixel);
    lights_out[pixels() + pixel] = light_and_variance(specular_light(pixel), work.specular_variance, pixel);
}
