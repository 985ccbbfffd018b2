// Joins the filtered parts, and restores the energy that the filter lost: over squares the mean of the noisy image is
// right. One workgroup adds up a square, always in the same order.

const LANES: u32 = 128u;

var<workgroup> sums: array<vec2<f32>, LANES>;

// The sum of the lanes' numbers.
fn added(lane: u32, own: vec2<f32>) -> vec2<f32> {
    sums[lane] = own;
    workgroupBarrier();
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    return sums[0];
}

// So that squares and sums are finite.
fn bounded_luminance(light: vec3<f32>) -> f32 {
    return min(luminance(light), MOST_NITS);
}

// A pixel of a square.
fn pixel_of(cell: vec2<u32>, number: u32) -> vec2<i32> {
    return vec2<i32>(cell * CELL + vec2(number % CELL, number / CELL));
}

fn put(pixel: u32, light: vec3<f32>) {
    let at = work.output + 3u * pixel;
    output[at] = light.x;
    output[at + 1u] = light.y;
    output[at + 2u] = light.z;
}

fn joined_light(pixel: u32) -> vec3<f32> {
    let at = work.output + 3u * pixel;
    return vec3(output[at], output[at + 1u], output[at + 2u]);
}

fn filtered(plane: u32, ends_in: u32, pixel: u32) -> vec3<f32> {
    if ends_in == 1u {
        return lights_in[plane + pixel].rgb;
    }
    return lights_out[plane + pixel].rgb;
}

fn joined(pixel: u32) -> vec3<f32> {
    let place = places[pixel];
    let border = place.z > 0.0;
    let radiance = vector(work.radiance, pixel);
    let factor = demodulator(pixel);
    // Where light and color both change in a pixel, the mean of their product is not the product of their means. What it is
    // instead is known as well as the pixel's own light is.
    var trust = 0.0;
    if work.demodulated_variance != NONE && work.specular_variance != NONE {
        let difference = RESIDUAL * bounded_luminance(radiance);
        let error = difference * difference;
        let fraction = error / (error + place.w + 1e-30);
        trust = fraction * fraction;
    }
    let product = diffuse_light(pixel, border) * factor + specular_light(pixel);
    let diffuse = filtered(0u, work.diffuse_ends_in, pixel) * factor;
    let light = diffuse + filtered(pixels(), work.specular_ends_in, pixel);
    // What the filter took from a firefly it took from the difference, too.
    let kept = select(vec3(1.0), light / max(product, vec3(1e-37)), light < product);
    return max(light + kept * trust * (radiance - product), vec3(0.0));
}

@compute @workgroup_size(LANES)
fn join(@builtin(workgroup_id) cell: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var own = vec2(0.0);
    for (var i = lane; i < CELL * CELL; i += LANES) {
        let at = pixel_of(cell.xy, i);
        if !is_inside(at) {
            continue;
        }
        let pixel = index(at);
        if bodies[pixel].y < 0.0 {
            put(pixel, vector(work.radiance, pixel));
            continue;
        }
        let light = joined(pixel);
        put(pixel, light);
        own += vec2(bounded_luminance(light), 1.0);
    }
    let sum = added(lane, own);
    if lane == 0u {
        cells[cell.y * work.columns + cell.x] = Cell(sum.x, sum.y, 0.0, 1.0);
    }
}

// What a dark pixel counts as: one workgroup in all.
@compute @workgroup_size(LANES)
fn average(@builtin(local_invocation_index) lane: u32) {
    let count = work.columns * work.rows;
    var own = vec2(0.0);
    for (var i = lane; i < count; i += LANES) {
        own += vec2(cells[i].after, cells[i].count);
    }
    let sum = added(lane, own);
    if lane == 0u {
        cells[count].factor = LEAST_RESTORED * (sum.x / max(sum.y, 1.0));
    }
}

@compute @workgroup_size(LANES)
fn brightness(@builtin(workgroup_id) cell: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let least = cells[work.columns * work.rows].factor;
    var own = 0.0;
    for (var i = lane; i < CELL * CELL; i += LANES) {
        let at = pixel_of(cell.xy, i);
        if !is_inside(at) {
            continue;
        }
        let pixel = index(at);
        if bodies[pixel].y >= 0.0 {
            let after = bounded_luminance(joined_light(pixel));
            own += min(bounded_luminance(vector(work.radiance, pixel)), MOST_RESTORED * max(after, least));
        }
    }
    let sum = added(lane, vec2(own, 0.0));
    if lane == 0u {
        cells[cell.y * work.columns + cell.x].before = sum.x;
    }
}

// What every square is to be multiplied by.
@compute @workgroup_size(8, 8)
fn factors(@builtin(global_invocation_id) id: vec3<u32>) {
    let cell = vec2<i32>(id.xy);
    let size = vec2(i32(work.columns), i32(work.rows));
    if any(cell >= size) {
        return;
    }
    var weights = CELL_WEIGHTS;
    var before = 0.0;
    var after = 0.0;
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let there = cell + vec2(dx, dy);
            if all(there >= vec2(0)) && all(there < size) {
                let weight = weights[dx + 2] * weights[dy + 2];
                let number = there.y * size.x + there.x;
                before += weight * cells[number].before;
                after += weight * cells[number].after;
            }
        }
    }
    let own = cell.y * size.x + cell.x;
    cells[own].factor = select(1.0, before / after, before > 0.0 && after > 0.0);
}

// Multiplies by the factors of squares, linear between their centers.
@compute @workgroup_size(8, 8)
fn restore(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    if !is_inside(at) {
        return;
    }
    let pixel = index(at);
    if bodies[pixel].y < 0.0 {
        return;
    }
    let last = vec2(work.columns, work.rows) - 1u;
    let place = clamp((vec2<f32>(at) + 0.5) / f32(CELL) - 0.5, vec2(0.0), vec2<f32>(last));
    let first = min(vec2<u32>(place), select(last - 1u, vec2(0u), last == vec2(0u)));
    let second = min(first + 1u, last);
    let part = place - vec2<f32>(first);
    let above = mix(factor_of(first), factor_of(vec2(second.x, first.y)), part.x);
    let below = mix(factor_of(vec2(first.x, second.y)), factor_of(second), part.x);
    put(pixel, joined_light(pixel) * mix(above, below, part.y));
}

fn factor_of(cell: vec2<u32>) -> f32 {
    return cells[cell.y * work.columns + cell.x].factor;
}
