// Noise estimation per pixel, and clamping of fireflies: both parts at once, x the diffuse one, y the specular one.

@compute @workgroup_size(8, 8)
fn noise(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    if !is_inside(at) {
        return;
    }
    let pixel = index(at);
    let here = guides_of(pixel);
    if here.id < 0.0 {
        return;
    }
    let per_normal = vec2(DIFFUSE_PER_NORMAL, SPECULAR_PER_NORMAL);
    // Sums over similar taps: weights, their squares, luminance, its square, variance; and over all surfaces.
    var weights = vec2(0.0);
    var squares = vec2(0.0);
    var bright = vec2(0.0);
    var bright_squares = vec2(0.0);
    var variances = vec2(0.0);
    var all_taps = 0.0;
    var all_bright = vec2(0.0);
    var all_variances = vec2(0.0);
    for (var dy = -REACH; dy <= REACH; dy++) {
        for (var dx = -REACH; dx <= REACH; dx++) {
            let place = at + vec2(dx, dy);
            if (dx == 0 && dy == 0) || !is_inside(place) {
                continue;
            }
            let there = index(place);
            let body = bodies[there];
            if body.y < 0.0 {
                continue;
            }
            let diffuse = lights_in[there];
            let specular = lights_in[pixels() + there];
            let l = vec2(luminance(diffuse.rgb), luminance(specular.rgb));
            let v = vec2(diffuse.w, specular.w);
            let cost = guided_cost(here, there, body, vec2(f32(dx), f32(dy)));
            let w = falloff(cost.x * per_normal + cost.y);
            weights += w;
            squares += w * w;
            bright += w * l;
            bright_squares += w * (l * l);
            variances += w * v;
            all_taps += 1.0;
            all_bright += l;
            all_variances += v;
        }
    }
    let diffuse = lights_in[pixel];
    let specular = lights_in[pixels() + pixel];
    let l = vec2(luminance(diffuse.rgb), luminance(specular.rgb));
    let v = vec2(diffuse.w, specular.w);
    let known = vec2(work.demodulated_variance != NONE, work.specular_variance != NONE);
    let mean = bright / (weights + 1e-6);
    let spread = max(bright_squares / (weights + 1e-6) - mean * mean, vec2(0.0));
    let usual = mean + vec2(DIFFUSE_FIREFLY, SPECULAR_FIREFLY) * sqrt(spread);
    // Light that the pixel's own samples agree on is not clamped.
    let sure = select(vec2(0.0), l - SURE * sqrt(v), known);
    let limit = max(usual, sure);
    let kept = select(l, limit, (weights > vec2(FEWEST)) & (l > limit));
    let factor = select(vec2(1.0), kept / (l + 1e-30), kept < l);
    let loose = all_bright / (all_taps + 1e-6);
    let rendered = (variances + v + PRIOR * all_variances / (all_taps + 1e-6)) / (weights + 1.0 + PRIOR);
    let of_neighbors = (weights * spread + PRIOR * loose * loose) / (weights + PRIOR);
    let variance = select(of_neighbors, rendered, known);
    let total = weights + 1.0;
    let pilot = (bright + kept) / total;
    let pilot_variance = variance * (squares + 1.0) / (total * total);
    lights_out[pixel] = vec4(diffuse.rgb * factor.x, variance.x);
    lights_out[pixels() + pixel] = vec4(specular.rgb * factor.y, variance.y);
    lights_out[2u * pixels() + pixel] = vec4(pilot.x, pilot_variance.x, pilot.y, pilot_variance.y);
    places[pixel].w = variance.x * here.color * here.color + variance.y;
}
