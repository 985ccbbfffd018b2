// Rays through trees of two levels: compressed nodes of eight boxes (trees.rs says how they are written), triangles in the
// ray's sheared frame (Woop, Benthin and Wald, 2013), as in plugins/render-cpu's walk.rs. Of hits at equal distance the lower
// body's wins, within it the lower triangle's.

const STACK: u32 = 48u;
const NODE_SIZE: u32 = 5u;
const BAND: f32 = 4.76837158203125e-7;
const PLACED_BAND: f32 = 1.9073486328125e-6;

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

// A ray ready for boxes.
struct Slabs {
    origin: vec3<f32>,
    inverse: vec3<f32>,
    // What distances to planes may be off by rounding.
    band: vec3<f32>,
    // Exclusive-or of a slot's number and this is the order in which the ray visits it, highest first.
    order: u32,
}

fn slabs_of(ray: Ray, reach: f32, band: f32) -> Slabs {
    let size = abs(ray.direction);
    let flattest = max_component(size) * 1e-12;
    let steepness = 1.0 / max(size, vec3(flattest));
    let inverse = select(steepness, -steepness, ray.direction < vec3(0.0));
    let widened = (max_component(abs(ray.origin)) + reach) * band * steepness;
    let order = select(vec3(4u, 2u, 1u), vec3(0u), inverse < vec3(0.0));
    return Slabs(ray.origin, inverse, widened, order.x | order.y | order.z);
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

// What a ray meets of a node: children, with their slots in the highest byte and the set of all in the lowest; and items.
struct Met {
    nodes: vec2<u32>,
    items: vec2<u32>,
}

// Bits of the slots of four children whose boxes a ray meets; planes are bytes of words.
fn meet_four(
    meta_: u32,
    lower: vec3<u32>,
    upper: vec3<u32>,
    scale: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
    order: u32,
    from_: f32,
    to: f32,
) -> u32 {
    let enter_x = vec4<f32>(unpack4xU8(lower.x)) * scale.x + near.x;
    let enter_y = vec4<f32>(unpack4xU8(lower.y)) * scale.y + near.y;
    let enter_z = vec4<f32>(unpack4xU8(lower.z)) * scale.z + near.z;
    let leave_x = vec4<f32>(unpack4xU8(upper.x)) * scale.x + far.x;
    let leave_y = vec4<f32>(unpack4xU8(upper.y)) * scale.y + far.y;
    let leave_z = vec4<f32>(unpack4xU8(upper.z)) * scale.z + far.z;
    let enter = max(max(enter_x, enter_y), max(enter_z, vec4(from_)));
    let leave = min(min(leave_x, leave_y), min(leave_z, vec4(to)));
    // Of nodes the order of the visit instead of the slot, of all the number of bits.
    let is_node = ((meta_ & (meta_ << 1u)) & 0x10101010u) >> 4u;
    let at = unpack4xU8((meta_ ^ (order * is_node)) & 0x1f1f1f1fu);
    let bits_ = unpack4xU8((meta_ >> 5u) & 0x07070707u) << at;
    let met = select(vec4(0u), bits_, enter <= leave);
    return met.x | met.y | met.z | met.w;
}

fn meet_node(node: u32, s: Slabs, from_: f32, to: f32) -> Met {
    let n0 = geometry[node];
    let n1 = bitcast<vec4<u32>>(geometry[node + 1u]);
    let n2 = bitcast<vec4<u32>>(geometry[node + 2u]);
    let n3 = bitcast<vec4<u32>>(geometry[node + 3u]);
    let n4 = bitcast<vec4<u32>>(geometry[node + 4u]);
    let form = bits(n0.w);
    let step = bitcast<vec3<f32>>(vec3(form & 0xffu, (form >> 8u) & 0xffu, (form >> 16u) & 0xffu) << vec3(23u));
    let scale = step * s.inverse;
    let shift = (n0.xyz - s.origin) * s.inverse;
    let near = shift - s.band;
    let far = shift + s.band;
    let negative = s.inverse < vec3(0.0);
    let lower_a = vec3(n2.x, n2.z, n3.x);
    let upper_a = vec3(n3.z, n4.x, n4.z);
    let lower_b = vec3(n2.y, n2.w, n3.y);
    let upper_b = vec3(n3.w, n4.y, n4.w);
    let a = meet_four(
        n1.z, select(lower_a, upper_a, negative), select(upper_a, lower_a, negative), scale, near, far, s.order, from_, to
    );
    let b = meet_four(
        n1.w, select(lower_b, upper_b, negative), select(upper_b, lower_b, negative), scale, near, far, s.order, from_, to
    );
    let met = a | b;
    return Met(vec2(n1.x, (met & 0xff000000u) | (form >> 24u)), vec2(n1.y, met & 0x00ffffffu));
}

// Whether a hit is nearer than the best so far.
fn is_nearer(t: f32, instance: u32, primitive: u32, best: Hit) -> bool {
    if t != best.t {
        return t < best.t;
    }
    return instance < best.instance || (instance == best.instance && primitive < best.primitive);
}

// What a walk looks for: the first hit of all bodies; what light passes; the first hit in every body, or in every object.
const FIRST: u32 = 0u;
const PASSAGE_OF_LIGHT: u32 = 1u;
const EVERY_BODY: u32 = 2u;
const EVERY_OBJECT: u32 = 3u;

struct Walked {
    // First hit of all that were looked for.
    hit: Hit,
    // What passes of light, and through how many panes; black if a surface occludes it.
    transmittance: vec3<f32>,
    panes: u32,
    // Nearest hit of a body from `view.foreground` on, in a walk for every body.
    support: f32,
}

// A tree of two levels.
struct TopLevel {
    root: u32,
    // The first entry of its bodies.
    items: u32,
}

fn top_level_of_all() -> TopLevel {
    if TILES {
        return TopLevel(tile.all.x, tile.all.y);
    }
    return TopLevel(view.top_level, view.top_items);
}

fn top_level_of_seen() -> TopLevel {
    if TILES {
        return TopLevel(tile.seen.x, tile.seen.y);
    }
    return TopLevel(view.seen, view.seen_items);
}

// First word of the depths of objects on a pixel's ray, by object, or NONE.
var<private> depths_of_pixel: u32 = NONE;

// Adds the first hit in a body to what a walk found.
fn add_body(walked: ptr<function, Walked>, hit: Hit, members: u32) {
    if hit.instance == NONE {
        return;
    }
    if is_nearer(hit.t, hit.instance, 0u, (*walked).hit) {
        (*walked).hit = hit;
    }
    if hit.instance >= view.foreground {
        (*walked).support = min((*walked).support, hit.t);
    }
    if hit.instance < view.objects && members != NONE {
        output[members + hit.instance / 32u] |= 1u << (hit.instance % 32u);
    }
    if hit.instance < view.objects && depths_of_pixel != NONE {
        output[depths_of_pixel + hit.instance] = bitcast<u32>(hit.t);
    }
}

// Walks a ray through what is between two distances. `seed` decides where surfaces cover in part. In a walk for
// every body or object `members` is the first word of a set to which the objects that are hit are added, or NONE.
fn walk(look_for: u32, top: TopLevel, world_ray: Ray, from_: f32, to: f32, seed: u32, members: u32) -> Walked {
    var walked = Walked(no_hit(), vec3(1.0), 0u, FAR);
    let size = max_component(abs(world_ray.direction));
    if top.root == NONE || !(size > 1e-24 && size < FAR) {
        return walked;
    }
    var best = no_hit();
    best.t = to;
    var stack: array<vec2<u32>, STACK>;
    var height = 0u;
    // Height at which the walk of a body ends.
    var floor_ = 0u;
    // Nodes to visit: index of the first child; order of visits in the highest byte, slots with nodes in the lowest. Below
    // 1 << 24 it is items: index of the first, and the set of those to test.
    var group = vec2(0u, 0x80000000u);
    var root = top.root;
    var instance = NONE;
    var flags = 0u;
    let world_slabs = slabs_of(world_ray, view.reach, PLACED_BAND);
    var slabs = world_slabs;
    var shear = Shear(vec3(0.0), vec3(0.0), 0u);
    var triangles = 0u;
    loop {
        var items = group;
        if group.y > 0x00ffffffu {
            let place = firstLeadingBit(group.y);
            let slot = (place - 24u) ^ (slabs.order & 7u);
            let node = group.x + countOneBits(group.y & 0xffu & ~(0xffffffffu << slot));
            group.y &= ~(1u << place);
            if group.y > 0x00ffffffu {
                stack[min(height, STACK - 1u)] = group;
                height += 1u;
            }
            let met = meet_node(root + node * NODE_SIZE, slabs, from_, best.t);
            group = met.nodes;
            items = met.items;
        } else {
            group = vec2(0u);
        }
        while items.y != 0u {
            let item = items.x + firstTrailingBit(items.y);
            items.y &= items.y - 1u;
            if instance == NONE {
                let body = bits(geometry[top.items + item].x);
                if look_for == EVERY_OBJECT && body >= view.objects {
                    continue;
                }
                // On with its tree; the rest comes later.
                if items.y != 0u {
                    stack[min(height, STACK - 1u)] = items;
                    height += 1u;
                }
                if group.y > 0x00ffffffu {
                    stack[min(height, STACK - 1u)] = group;
                    height += 1u;
                }
                instance = body;
                flags = body_flags(instance);
                floor_ = height;
                let p = placed(world_ray, instance);
                slabs = slabs_of(p.ray, p.reach, BAND);
                shear = shear_of(p.ray);
                root = p.root;
                triangles = p.triangles;
                group = vec2(0u, 0x80000000u);
                break;
            }
            let at = triangles + 3u * item;
            let a = geometry[at];
            let b = geometry[at + 1u];
            let c = geometry[at + 2u];
            let found = test_triangle(shear, a.xyz, b.xyz, c.xyz);
            if !found.hit || found.t < from_ {
                continue;
            }
            let hit = Hit(found.t, found.u, found.v, bits(a.w), instance);
            if look_for == PASSAGE_OF_LIGHT {
                if found.t > to {
                    continue;
                }
            } else if !is_nearer(hit.t, instance, hit.primitive, best) {
                continue;
            }
            if CUTOUTS && (flags & BODY_CUTOUTS) != 0u {
                let position = world_ray.origin + world_ray.direction * hit.t;
                var solid = true;
                if look_for >= EVERY_BODY {
                    solid = is_labeled(hit, position);
                } else {
                    solid = is_solid(hit, position, alpha_random(seed, hit));
                }
                if !solid {
                    continue;
                }
            }
            if look_for == PASSAGE_OF_LIGHT {
                var transmittance = vec3(0.0);
                if PANES && (flags & BODY_PANES) != 0u {
                    transmittance = transmittance_of_pane(hit, world_ray.origin, world_ray.direction);
                }
                walked.transmittance *= transmittance;
                walked.panes += 1u;
                if is_black(transmittance) {
                    walked.transmittance = vec3(0.0);
                    return walked;
                }
            } else {
                best = hit;
            }
        }
        if group.y <= 0x00ffffffu {
            if instance != NONE && height == floor_ {
                // Done with a body.
                if look_for >= EVERY_BODY {
                    add_body(&walked, best, members);
                    best = no_hit();
                    best.t = to;
                }
                instance = NONE;
                slabs = world_slabs;
                root = top.root;
            }
            if height == 0u {
                break;
            }
            height -= 1u;
            group = stack[height];
        }
    }
    if look_for == FIRST && best.instance != NONE {
        walked.hit = best;
    }
    return walked;
}
