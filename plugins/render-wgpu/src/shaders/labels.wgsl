// All labels from one ray per pixel, as in plugins/render-cpu's labels.rs: the first hit in every body.
//
// The output is one section after the other, of those that are wanted: depth, instance, normal and albedo (three numbers
// each), and two sets of objects: those that cover a pixel, and those that do before the support.

const BASE_LAYER: f32 = 0.99999988;

// The first hit in one body.
fn closest_in(instance: u32, ray: Ray) -> Hit {
    var best = no_hit();
    let p = placed(ray, instance);
    let slabs = slabs_of(p.ray, p.reach, BAND);
    let shear = shear_of(p.ray);
    let cutouts = CUTOUTS && (body_flags(instance) & BODY_CUTOUTS) != 0u;
    var stack: array<u32, STACK>;
    var height = 0u;
    var link = p.root;
    loop {
        if (link & LEAF) == 0u {
            let entry = test_node(link, slabs, 0.0, best.t);
            let first = entry.near.x < FAR;
            let second = entry.near.y < FAR;
            if first && second {
                let swap = entry.near.y < entry.near.x;
                stack[min(height, STACK - 1u)] = select(entry.links.y, entry.links.x, swap);
                height += 1u;
                link = select(entry.links.x, entry.links.y, swap);
                continue;
            }
            if first || second {
                link = select(entry.links.y, entry.links.x, first);
                continue;
            }
        } else {
            let count = (link >> 27u) & 15u;
            let start = p.triangles + (link & 0x07ffffffu) * 3u;
            for (var i = 0u; i < count; i++) {
                let a = geometry[start + 3u * i];
                let b = geometry[start + 3u * i + 1u];
                let c = geometry[start + 3u * i + 2u];
                let found = test_triangle(shear, a.xyz, b.xyz, c.xyz);
                let primitive = bitcast<u32>(a.w);
                if found.hit && found.t >= 0.0 && is_nearer(found.t, instance, primitive, best) {
                    let hit = Hit(found.t, found.u, found.v, primitive, instance);
                    if !cutouts || is_labeled(hit, ray.origin + ray.direction * hit.t) {
                        best = hit;
                    }
                }
            }
        }
        if height == 0u {
            break;
        }
        height -= 1u;
        link = stack[height];
    }
    return best;
}

// Empties the set of a pixel in a section; gives its first word.
fn empty_set(section: u32, pixel: u32) -> u32 {
    let first = section + pixel * view.words;
    if section != NONE {
        for (var i = 0u; i < view.words; i++) {
            output[first + i] = 0u;
        }
    }
    return first;
}

fn add_to_set(section: u32, first: u32, instance: u32) {
    if section != NONE {
        output[first + instance / 32u] |= 1u << (instance % 32u);
    }
}

@compute @workgroup_size(64)
fn labels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    // Squares of 8 x 8 pixels, so that neighbors walk the same nodes.
    let number = id.x + id.y * groups.x * 64u;
    let width = u32(view.window.z);
    let columns = (width + 7u) / 8u;
    let square = number / 64u;
    let inside = number % 64u;
    let column = (square % columns) * 8u + inside % 8u;
    let row = (square / columns) * 8u + inside / 8u;
    if column >= width || row >= u32(view.window.w) {
        return;
    }
    let pixel = row * width + column;
    let coverage = empty_set(view.coverage_at, pixel);
    let before = empty_set(view.before_at, pixel);
    let direction = center_direction(column, row);
    let ray = Ray(view.origin.xyz, direction);
    var first = no_hit();
    var support = FAR;
    if !is_black(direction) && view.seen != NONE {
        let slabs = slabs_of(ray, view.reach, PLACED_BAND);
        // Bodies, in the order of the tree; a second time those before the support.
        for (var round = 0u; round < 2u; round++) {
            var stack: array<u32, 32>;
            var height = 0u;
            var link = view.seen;
            loop {
                if (link & LEAF) == 0u {
                    let entry = test_node(link, slabs, 0.0, select(FAR, support, round == 1u));
                    if entry.near.x < FAR && entry.near.y < FAR {
                        stack[min(height, 31u)] = entry.links.y;
                        height += 1u;
                        link = entry.links.x;
                        continue;
                    }
                    if entry.near.x < FAR || entry.near.y < FAR {
                        link = select(entry.links.y, entry.links.x, entry.near.x < FAR);
                        continue;
                    }
                } else {
                    let instance = link & ~LEAF;
                    if round == 0u || instance < view.objects {
                        let hit = closest_in(instance, ray);
                        if hit.instance != NONE {
                            if round == 0u {
                                if is_nearer(hit.t, hit.instance, 0u, first) {
                                    first = hit;
                                }
                                if instance >= view.foreground {
                                    support = min(support, hit.t);
                                }
                                if instance < view.objects {
                                    add_to_set(view.coverage_at, coverage, instance);
                                }
                            } else if hit.t <= support {
                                add_to_set(view.before_at, before, instance);
                            }
                        }
                    }
                }
                if height == 0u {
                    break;
                }
                height -= 1u;
                link = stack[height];
            }
            if view.objects == 0u || view.before_at == NONE {
                break;
            }
        }
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
