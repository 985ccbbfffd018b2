// All labels from one ray per pixel, as in plugins/stages/render-cpu's labels.rs: the first hit in every body.
//
// The output is one section after the other, of those that are wanted: depth, instance, normal and albedo (three numbers
// each), two sets of objects: those that cover a pixel, and those that do before the support; and the depth of every object.

// Empties the set of a pixel in a section; gives its first word, or NONE.
fn empty_set(section: u32, pixel: u32) -> u32 {
    if section == NONE {
        return NONE;
    }
    let first = section + pixel * view.words;
    for (var i = 0u; i < view.words; i++) {
        output[first + i] = 0u;
    }
    return first;
}

@compute @workgroup_size(GROUP)
fn labels(@builtin(global_invocation_id) id: vec3<u32>) {
    // Squares of 8 x 8 pixels, so that neighbors walk the same nodes.
    let number = id.x + id.y * ROW;
    let width = u32(view.window.z);
    let columns = (width + 7u) / 8u;
    let square = pass_.first_pixel + number / 64u;
    let inside = number % 64u;
    let column = (square % columns) * 8u + inside % 8u;
    let row = (square / columns) * 8u + inside / 8u;
    if number / 64u >= pass_.pixels || column >= width || row >= u32(view.window.w) {
        return;
    }
    let pixel = row * width + column;
    if TILES {
        let number = tile_number(column, row);
        if number == NONE {
            return;
        }
        enter_tile(number);
    }
    let coverage = empty_set(view.coverage_at, pixel);
    let before = empty_set(view.before_at, pixel);
    if view.object_depths_at != NONE {
        depths_of_pixel = view.object_depths_at + pixel * view.objects;
        for (var object = 0u; object < view.objects; object++) {
            output[depths_of_pixel + object] = bitcast<u32>(FAR);
        }
    }
    let direction = center_direction(column, row);
    let ray = Ray(view.origin.xyz, direction);
    let walked = walk(EVERY_BODY, top_level_of_seen(), ray, 0.0, FAR, 0u, coverage);
    depths_of_pixel = NONE;
    var first = walked.hit;
    if first.instance != NONE && is_held_out(first.instance) {
        first = no_hit();
    }
    if view.before_at != NONE {
        walk(EVERY_OBJECT, top_level_of_seen(), ray, 0.0, walked.support, 0u, before);
    }
    if view.depth_at != NONE {
        output[view.depth_at + pixel] = bitcast<u32>(first.t);
    }
    if view.instance_at != NONE {
        output[view.instance_at + pixel] = first.instance + 1u;
    }
    if view.normal_at == NONE && view.albedo_at == NONE {
        return;
    }
    var normal = vec3(0.0);
    var albedo = vec3(0.0);
    if first.instance != NONE {
        let length_ = length(direction);
        let distance = first.t * length_;
        let along = direction * (1.0 / length_);
        let surface = surface_at(first, ray.origin, along, distance, view.origin.w * distance, BASE_LAYER);
        normal = to_camera(surface.normal);
        albedo = surface.albedo;
    }
    for (var c = 0u; c < 3u; c++) {
        if view.normal_at != NONE {
            output[view.normal_at + 3u * pixel + c] = bitcast<u32>(normal[c]);
        }
        if view.albedo_at != NONE {
            output[view.albedo_at + 3u * pixel + c] = bitcast<u32>(albedo[c]);
        }
    }
}
