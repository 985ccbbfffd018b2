// Rays through trees of two levels: compressed nodes of eight boxes (trees.rs says how they are written), triangles in the
// ray's sheared frame (Woop, Benthin and Wald, 2013), as in plugins/stages/render-cpu's walk.rs. Of hits at equal distance the lower
// body's wins, within it the lower triangle's.

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

// What a ray meets of a node: children, as a group to visit; and items: index of the first, the set of those to test, and that
// of all, three bits per slot.
struct Met {
    nodes: vec2<u32>,
    first_item: u32,
    items: u32,
    all_items: u32,
}

// The set of four slots whose boxes a ray meets; planes are bytes of words.
fn meet_four(
    lower: vec3<u32>,
    upper: vec3<u32>,
    scale: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
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
    let met = select(vec4(0u), vec4(1u, 2u, 4u, 8u), enter <= leave);
    return met.x | met.y | met.z | met.w;
}

// A set of slots by the order of the visit: slot, exclusive-or the order.
fn in_order(slots: u32, order: u32) -> u32 {
    var some = slots;
    some = select(some, ((some & 0x55u) << 1u) | ((some >> 1u) & 0x55u), (order & 1u) != 0u);
    some = select(some, ((some & 0x33u) << 2u) | ((some >> 2u) & 0x33u), (order & 2u) != 0u);
    return select(some, ((some & 0x0fu) << 4u) | (some >> 4u), (order & 4u) != 0u);
}

// Three bits for each slot of a set.
fn thrice(slots: u32) -> u32 {
    var some = (slots | (slots << 8u)) & 0x00f00fu;
    some = (some | (some << 4u)) & 0x0c30c3u;
    some = (some | (some << 2u)) & 0x249249u;
    return some * 7u;
}

// The vectors of a node, or of a body among nodes.
struct Node {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    d: vec4<f32>,
    e: vec4<f32>,
}

fn node_at(at: u32) -> Node {
    return Node(geometry[at], geometry[at + 1u], geometry[at + 2u], geometry[at + 3u], geometry[at + 4u]);
}

fn meet_node(node: Node, s: Slabs, from_: f32, to: f32) -> Met {
    let n0 = node.a;
    let n1 = bitcast<vec4<u32>>(node.b);
    let n2 = bitcast<vec4<u32>>(node.c);
    let n3 = bitcast<vec4<u32>>(node.d);
    let n4 = bitcast<vec4<u32>>(node.e);
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
        select(lower_a, upper_a, negative), select(upper_a, lower_a, negative), scale, near, far, from_, to
    );
    let b = meet_four(
        select(lower_b, upper_b, negative), select(upper_b, lower_b, negative), scale, near, far, from_, to
    );
    let met = a | (b << 4u);
    let nodes = form >> 24u;
    return Met(vec2(n1.x, (in_order(met & nodes, s.order) << 24u) | nodes), n1.y, thrice(met) & n1.z, n1.z);
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

fn top_level_of_all() -> u32 {
    if TILES {
        return tile.all;
    }
    return view.top_level;
}

fn top_level_of_seen() -> u32 {
    if TILES {
        return tile.seen;
    }
    return view.seen;
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

// Walks a ray through the bodies of a top level, between two distances. `seed` decides where surfaces cover in part. In a walk for
// every body or object `members` is the first word of a set to which the objects that are hit are added, or NONE.
fn walk(look_for: u32, top: u32, world_ray: Ray, from_: f32, to: f32, seed: u32, members: u32) -> Walked {
    var walked = Walked(no_hit(), vec3(1.0), 0u, FAR);
    let size = max_component(abs(world_ray.direction));
    if top == NONE || !(size > 1e-24 && size < FAR) {
        return walked;
    }
    var best = no_hit();
    best.t = to;
    // One of the two is used.
    var stack: array<vec2<u32>, STACK>;
    var deep_stack: array<vec2<u32>, DEEP_STACK>;
    var height = 0u;
    // Height at which the walk of a body ends.
    var floor_ = 0u;
    // Nodes to visit: index of the first child; order of visits in the highest byte, slots with nodes in the lowest.
    var group = vec2(0u, 0x80000000u);
    var root = top;
    var instance = NONE;
    var flags = 0u;
    let world_slabs = slabs_of(world_ray, view.reach, PLACED_BAND);
    var slabs = world_slabs;
    var shear = Shear(vec3(0.0), vec3(0.0), 0u);
    var triangles = 0u;
    loop {
        let place = firstLeadingBit(group.y);
        let slot = (place - 24u) ^ (slabs.order & 7u);
        let at = root + (group.x + countOneBits(group.y & 0xffu & ~(0xffffffffu << slot))) * NODE_SIZE;
        group.y &= ~(1u << place);
        if group.y > 0x00ffffffu {
            if DEEP {
                deep_stack[height] = group;
            } else {
                stack[height] = group;
            }
            height += 1u;
        }
        var node = node_at(at);
        var is_skipped = false;
        if instance == NONE && (bits(node.a.w) & 0xffu) == BODY_NODE {
            let number = bits(node.e.x);
            is_skipped = look_for == EVERY_OBJECT && number >= view.objects;
            if !is_skipped {
                // On with its tree, in its frame.
                instance = number;
                flags = bits(node.e.y);
                if CUTOUTS && look_for >= EVERY_BODY && (view.flags & LABELS_THROUGH_GLASS) != 0u && (flags & BODY_GLASS) != 0u {
                    flags |= BODY_CUTOUTS;
                }
                floor_ = height;
                let rows = mat3x3(node.b.xyz, node.c.xyz, node.d.xyz);
                let ray = Ray(world_ray.origin * rows + node.a.xyz, world_ray.direction * rows);
                slabs = slabs_of(ray, node.d.w, BAND);
                shear = shear_of(ray);
                root = bits(node.b.w);
                triangles = bits(node.c.w);
                node = node_at(root);
            }
        }
        var met = Met(vec2(0u), 0u, 0u, 0u);
        if !is_skipped {
            met = meet_node(node, slabs, from_, best.t);
        }
        group = met.nodes;
        while met.items != 0u {
            let next = met.items & (0u - met.items);
            let item = met.first_item + countOneBits(met.all_items & (next - 1u));
            met.items ^= next;
            let corners = triangles + 3u * item;
            let a = geometry[corners];
            let b = geometry[corners + 1u];
            let c = geometry[corners + 2u];
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
                root = top;
            }
            if height == 0u {
                break;
            }
            height -= 1u;
            if DEEP {
                group = deep_stack[height];
            } else {
                group = stack[height];
            }
        }
    }
    if look_for == FIRST && best.instance != NONE {
        walked.hit = best;
    }
    return walked;
}
