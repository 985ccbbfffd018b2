// One level of the filter of a part: 5 × 5 taps, some pixels apart.

fn pilot_of(pixel: u32) -> vec2<f32> {
    let pilots = lights_in[2u * pixels() + pixel];
    return select(pilots.xy, pilots.zw, work.part == 1u);
}

@compute @workgroup_size(8, 8)
fn level(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    if !is_inside(at) {
        return;
    }
    let pixel = index(at);
    let here = guides_of(pixel);
    if here.id < 0.0 {
        return;
    }
    let plane = work.part * pixels();
    let own = lights_in[plane + pixel];
    let has_pilots = work.per_pilot > 0.0;
    var pilot = vec2(luminance(own.rgb), 0.0);
    if has_pilots {
        pilot = pilot_of(pixel);
    }
    let square = pilot.x * pilot.x;
    let least = 1e-8 * square + 1e-20;
    // The noisier, the more a tap may be rotated away.
    let spread = work.normal_scale * sqrt(own.w / (square + 1e-12));
    let per_normal = 1.0 / clamp(spread, work.normal_least, work.normal_most);
    var light = vec3(0.0);
    var variance = 0.0;
    var weight = 0.0;
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let offset = vec2(dx, dy) * i32(work.step);
            let place = at + offset;
            if !is_inside(place) {
                continue;
            }
            let there = index(place);
            let guided = guided_cost(here, there, bodies[there], vec2<f32>(offset));
            var cost = guided.x * per_normal + guided.y;
            if cost >= END {
                continue;
            }
            if has_pilots {
                let other = pilot_of(there);
                let difference = pilot.x - other.x;
                cost += difference * difference * work.per_pilot / (pilot.y + other.y + least);
            }
            let tap = lights_in[plane + there];
            let difference = own.rgb - tap.rgb;
            cost += luminance(difference * difference) * work.per_light / (own.w + tap.w + least);
            let w = falloff(vec2(cost)).x * work.kernel[abs(dx)] * work.kernel[abs(dy)];
            light += w * tap.rgb;
            variance += w * w * tap.w;
            weight += w;
        }
    }
    // The pixel itself weighs at least as the kernel has it.
    lights_out[plane + pixel] = vec4(light / weight, variance / (weight * weight));
}
