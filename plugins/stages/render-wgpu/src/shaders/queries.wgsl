// What the rays of paths meet, by ray queries of the device. A query finds the triangle; where a ray meets it, the walk's test
// says, so that what follows from a hit is the same to the bit. The walk of bvh.wgsl is the reference of all of this.

// Whether rays are queried; else they are walked. Windows that show some bodies alone are not in the acceleration structure.
override QUERIES: bool = true;

@group(0) @binding(10) var bodies: acceleration_structure;

// Flags of queries, as in SPIR-V.
const FORCE_OPAQUE: u32 = 1u;
const TERMINATE_ON_FIRST_HIT: u32 = 4u;

const EVERY_INSTANCE: u32 = 0xffu;

// Whether a ray can meet anything. Queries of rays that are not finite mean nothing.
fn may_meet(top: u32, ray: Ray, from_: f32, to: f32) -> bool {
    let size = max_component(abs(ray.direction));
    return top != NONE && size > 1e-24 && size < FAR && max_component(abs(ray.origin)) < FAR && from_ < to;
}

// A triangle that a query found.
struct Found {
    hit: Hit,
    // Of its body.
    flags: u32,
}

fn found_triangle(found: RayIntersection, ray: Ray) -> Found {
    let instance = found.instance_custom_data;
    let node = node_at(view.body_nodes + instance * NODE_SIZE);
    let rows = mat3x3(node.b.xyz, node.c.xyz, node.d.xyz);
    let shear = shear_of(Ray(ray.origin * rows + node.a.xyz, ray.direction * rows));
    let corners = bits(node.c.w) + 3u * found.primitive_index;
    let a = geometry[corners];
    let tested = test_triangle(shear, a.xyz, geometry[corners + 1u].xyz, geometry[corners + 2u].xyz);
    var hit = Hit(found.t, found.barycentrics.x, found.barycentrics.y, bits(a.w), instance);
    // A ray along an edge may miss both of its triangles by rounding, but not in the query: then its numbers are taken.
    if tested.hit {
        hit.t = tested.t;
        hit.u = tested.u;
        hit.v = tested.v;
    }
    return Found(hit, bits(node.e.y));
}

fn is_cut_out(found: Found, ray: Ray, seed: u32) -> bool {
    if !CUTOUTS || (found.flags & BODY_CUTOUTS) == 0u {
        return false;
    }
    return !is_solid(found.hit, ray.origin + ray.direction * found.hit.t, alpha_random(seed, found.hit));
}

// The first hit of a ray from a distance on. `seed` decides where surfaces cover in part.
fn first_hit(top: u32, ray: Ray, from_: f32, seed: u32) -> Hit {
    if !QUERIES {
        return walk(FIRST, top, ray, from_, FAR, seed, NONE).hit;
    }
    if !may_meet(top, ray, from_, FAR) {
        return no_hit();
    }
    var query: ray_query;
    let flags = select(FORCE_OPAQUE, 0u, CUTOUTS);
    rayQueryInitialize(&query, bodies, RayDesc(flags, EVERY_INSTANCE, from_, FAR, ray.origin, ray.direction));
    // Bodies without cut-outs and panes are opaque: the query takes their triangles without asking.
    while rayQueryProceed(&query) {
        if !is_cut_out(found_triangle(rayQueryGetCandidateIntersection(&query), ray), ray, seed) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let nearest = rayQueryGetCommittedIntersection(&query);
    if nearest.kind == RAY_QUERY_INTERSECTION_NONE {
        return no_hit();
    }
    return found_triangle(nearest, ray).hit;
}

// What passes of the light along a ray, up to a distance.
fn passage_of_light(top: u32, ray: Ray, to: f32, seed: u32) -> Walked {
    if !QUERIES {
        return walk(PASSAGE_OF_LIGHT, top, ray, 0.0, to, seed, NONE);
    }
    var passed = Walked(no_hit(), vec3(1.0), 0u, FAR);
    if !may_meet(top, ray, 0.0, to) {
        return passed;
    }
    var query: ray_query;
    let flags = select(FORCE_OPAQUE, 0u, CUTOUTS || PANES) | TERMINATE_ON_FIRST_HIT;
    rayQueryInitialize(&query, bodies, RayDesc(flags, EVERY_INSTANCE, 0.0, to, ray.origin, ray.direction));
    while rayQueryProceed(&query) {
        let found = found_triangle(rayQueryGetCandidateIntersection(&query), ray);
        if is_cut_out(found, ray, seed) {
            continue;
        }
        var transmittance = vec3(0.0);
        if PANES && (found.flags & BODY_PANES) != 0u {
            transmittance = transmittance_of_pane(found.hit, ray.origin, ray.direction);
        }
        passed.transmittance *= transmittance;
        passed.panes += 1u;
        if is_black(transmittance) {
            // That ends the query.
            rayQueryConfirmIntersection(&query);
        }
    }
    if rayQueryGetCommittedIntersection(&query).kind != RAY_QUERY_INTERSECTION_NONE {
        passed.transmittance = vec3(0.0);
    }
    return passed;
}
