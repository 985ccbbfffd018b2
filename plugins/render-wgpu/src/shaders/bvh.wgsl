// Rays through trees of two levels: boxes of two children a node, triangles in the ray's sheared frame (Woop, Benthin and
// Wald, 2013), as in plugins/render-cpu's walk.rs. Of hits at equal distance the lower body's wins, within it the lower
// triangle's. Trees are written by trees.rs.

const LEAF: u32 = 0x80000000u;
const EMPTY: u32 = 0xffffffffu;
const BACK: u32 = 0xfffffffeu;
const STACK: u32 = 64u;
const BAND: f32 = 4.76837158203125e-7;
const PLACED_BAND: f32 = 1.9073486328125e-6;

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

// A ray ready for boxes.
struct Slabs {
    inverse: vec3<f32>,
    near_shift: vec3<f32>,
    far_shift: vec3<f32>,
}

fn slabs_of(ray: Ray, reach: f32, band: f32) -> Slabs {
    let size = abs(ray.direction);
    let flattest = max_component(size) * 1e-12;
    let steepness = 1.0 / max(size, vec3(flattest));
    let inverse = select(steepness, -steepness, ray.direction < vec3(0.0));
    let widened = (max_component(abs(ray.origin)) + reach) * band * steepness;
    let shift = -ray.origin * inverse;
    return Slabs(inverse, shift - widened, shift + widened);
}

// A ray ready for triangles: runs along z of a permuted, sheared frame.
struct Shear {
    origin: vec3<f32>,
    shear: vec3<f32>,
    // Axis of the direction's largest component.
    along: u32,
}

fn permuted(v: vec3<f32>, along: u32) -> vec3<f32> {
    return select(select(v, v.zxy, along == 1u), v.yzx, along == 0u);
}

fn shear_of(ray: Ray) -> Shear {
    let size = abs(ray.direction);
    var along = 2u;
    if size.x >= size.y && size.x >= size.z {
        along = 0u;
    } else if size.y >= size.z {
        along = 1u;
    }
    let d = permuted(ray.direction, along);
    let per = -1.0 / d.z;
    return Shear(permuted(ray.origin, along), vec3(d.x * per, d.y * per, per), along);
}

struct Candidate {
    t: f32,
    u: f32,
    v: f32,
    hit: bool,
}

fn test_triangle(s: Shear, corner_a: vec3<f32>, corner_b: vec3<f32>, corner_c: vec3<f32>) -> Candidate {
    let a = s.origin - permuted(corner_a, s.along);
    let b = s.origin - permuted(corner_b, s.along);
    let c = s.origin - permuted(corner_c, s.along);
    let ax = s.shear.x * a.z + a.x;
    let ay = s.shear.y * a.z + a.y;
    let bx = s.shear.x * b.z + b.x;
    let by = s.shear.y * b.z + b.y;
    let cx = s.shear.x * c.z + c.x;
    let cy = s.shear.y * c.z + c.y;
    let wa = cx * by - cy * bx;
    let wb = ax * cy - ay * cx;
    let wc = bx * ay - by * ax;
    let sum = wa + wb + wc;
    let least = min(min(wa, wb), wc);
    let most = max(max(wa, wb), wc);
    if !((least >= 0.0 || most <= 0.0) && sum != 0.0) {
        return Candidate(0.0, 0.0, 0.0, false);
    }
    let scale = 1.0 / sum;
    let t = (wa * a.z + wb * b.z + wc * c.z) * scale * s.shear.z;
    return Candidate(t, wb * scale, wc * scale, true);
}

struct Placement {
    ray: Ray,
    root: u32,
    triangles: u32,
    reach: f32,
}

// A ray in the frame of a body.
fn placed(ray: Ray, instance: u32) -> Placement {
    let at = view.bodies + instance * BODY_SIZE + 5u;
    let x = table_f(at);
    let y = table_f(at + 1u);
    let z = table_f(at + 2u);
    let tree = tables[at + 3u];
    let origin = vec3(dot(x.xyz, ray.origin) + x.w, dot(y.xyz, ray.origin) + y.w, dot(z.xyz, ray.origin) + z.w);
    let direction = vec3(dot(x.xyz, ray.direction), dot(y.xyz, ray.direction), dot(z.xyz, ray.direction));
    return Placement(Ray(origin, direction), tree.x, tree.y, bitcast<f32>(tree.z));
}

struct Entry {
    // Distances at which the ray enters the boxes of the two children; FAR if it misses one.
    near: vec2<f32>,
    links: vec2<u32>,
}

fn test_node(node: u32, s: Slabs, from_: f32, to: f32) -> Entry {
    let x = geometry[node] * s.inverse.x;
    let y = geometry[node + 1u] * s.inverse.y;
    let z = geometry[node + 2u] * s.inverse.z;
    let links = bitcast<vec4<u32>>(geometry[node + 3u]).xy;
    // Lower and upper planes of both children by turns.
    let enter_x = select(x.xz, x.yw, vec2(s.inverse.x < 0.0)) + s.near_shift.x;
    let leave_x = select(x.yw, x.xz, vec2(s.inverse.x < 0.0)) + s.far_shift.x;
    let enter_y = select(y.xz, y.yw, vec2(s.inverse.y < 0.0)) + s.near_shift.y;
    let leave_y = select(y.yw, y.xz, vec2(s.inverse.y < 0.0)) + s.far_shift.y;
    let enter_z = select(z.xz, z.yw, vec2(s.inverse.z < 0.0)) + s.near_shift.z;
    let leave_z = select(z.yw, z.xz, vec2(s.inverse.z < 0.0)) + s.far_shift.z;
    let enter = max(max(enter_x, enter_y), max(enter_z, vec2(from_)));
    let leave = min(min(leave_x, leave_y), min(leave_z, vec2(to)));
    return Entry(select(vec2(FAR), enter, enter <= leave), links);
}

// Whether a hit is nearer than the best so far.
fn is_nearer(t: f32, instance: u32, primitive: u32, best: Hit) -> bool {
    if t != best.t {
        return t < best.t;
    }
    return instance < best.instance || (instance == best.instance && primitive < best.primitive);
}

// The first hit of a ray beyond `from_` and before `to`. `seed` decides where surfaces cover in part.
fn closest(top_level: u32, world_ray: Ray, from_: f32, to: f32, seed: u32) -> Hit {
    var best = no_hit();
    best.t = to;
    let size = max_component(abs(world_ray.direction));
    if top_level == NONE || !(size > 1e-24 && size < FAR) {
        return no_hit();
    }
    var stack: array<u32, STACK>;
    var height = 0u;
    var link = top_level;
    var instance = NONE;
    var ray = world_ray;
    let world_slabs = slabs_of(world_ray, view.reach, PLACED_BAND);
    var slabs = world_slabs;
    var shear = Shear(vec3(0.0), vec3(0.0), 0u);
    var triangles = 0u;
    loop {
        if (link & LEAF) == 0u {
            let entry = test_node(link, slabs, from_, best.t);
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
        } else if link == BACK {
            instance = NONE;
            slabs = world_slabs;
        } else if instance == NONE {
            // A body: on with its tree, and back when that is done.
            instance = link & ~LEAF;
            let p = placed(world_ray, instance);
            ray = p.ray;
            slabs = slabs_of(ray, p.reach, BAND);
            shear = shear_of(ray);
            triangles = p.triangles;
            stack[min(height, STACK - 1u)] = BACK;
            height += 1u;
            link = p.root;
            continue;
        } else {
            let count = (link >> 27u) & 15u;
            let start = triangles + (link & 0x07ffffffu) * 3u;
            for (var i = 0u; i < count; i++) {
                let a = geometry[start + 3u * i];
                let b = geometry[start + 3u * i + 1u];
                let c = geometry[start + 3u * i + 2u];
                let found = test_triangle(shear, a.xyz, b.xyz, c.xyz);
                let primitive = bitcast<u32>(a.w);
                if found.hit && found.t >= from_ && is_nearer(found.t, instance, primitive, best) {
                    let hit = Hit(found.t, found.u, found.v, primitive, instance);
                    var solid = true;
                    if CUTOUTS && (body_flags(instance) & BODY_CUTOUTS) != 0u {
                        let position = world_ray.origin + world_ray.direction * hit.t;
                        solid = is_solid(hit, position, alpha_random(seed, hit));
                    }
                    if solid {
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
    if best.instance == NONE {
        return no_hit();
    }
    return best;
}

struct Passed {
    transmittance: vec3<f32>,
    panes: u32,
    occluded: bool,
}

// What light passes from a point on a straight way up to a distance: nothing if a surface occludes it.
fn visibility(world_ray: Ray, to: f32, seed: u32) -> Passed {
    var passed = Passed(vec3(1.0), 0u, false);
    if view.top_level == NONE {
        return passed;
    }
    var stack: array<u32, STACK>;
    var height = 0u;
    var link = view.top_level;
    var instance = NONE;
    var flags = 0u;
    var ray = world_ray;
    let world_slabs = slabs_of(world_ray, view.reach, PLACED_BAND);
    var slabs = world_slabs;
    var shear = Shear(vec3(0.0), vec3(0.0), 0u);
    var triangles = 0u;
    loop {
        if (link & LEAF) == 0u {
            let entry = test_node(link, slabs, 0.0, to);
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
        } else if link == BACK {
            instance = NONE;
            slabs = world_slabs;
        } else if instance == NONE {
            instance = link & ~LEAF;
            flags = body_flags(instance);
            let p = placed(world_ray, instance);
            ray = p.ray;
            slabs = slabs_of(ray, p.reach, BAND);
            shear = shear_of(ray);
            triangles = p.triangles;
            stack[min(height, STACK - 1u)] = BACK;
            height += 1u;
            link = p.root;
            continue;
        } else {
            let count = (link >> 27u) & 15u;
            let start = triangles + (link & 0x07ffffffu) * 3u;
            for (var i = 0u; i < count; i++) {
                let a = geometry[start + 3u * i];
                let b = geometry[start + 3u * i + 1u];
                let c = geometry[start + 3u * i + 2u];
                let found = test_triangle(shear, a.xyz, b.xyz, c.xyz);
                if !found.hit || found.t < 0.0 || found.t > to {
                    continue;
                }
                let hit = Hit(found.t, found.u, found.v, bitcast<u32>(a.w), instance);
                if CUTOUTS && (flags & BODY_CUTOUTS) != 0u {
                    let position = world_ray.origin + world_ray.direction * hit.t;
                    if !is_solid(hit, position, alpha_random(seed, hit)) {
                        continue;
                    }
                }
                var transmittance = vec3(0.0);
                if PANES && (flags & BODY_PANES) != 0u {
                    transmittance = transmittance_of_pane(hit, world_ray.origin, world_ray.direction);
                }
                passed.transmittance *= transmittance;
                passed.panes += 1u;
                if is_black(transmittance) {
                    passed.occluded = true;
                    return passed;
                }
            }
        }
        if height == 0u {
            break;
        }
        height -= 1u;
        link = stack[height];
    }
    return passed;
}
