// What the rays of paths meet, by the walk of bvh.wgsl. Where rays are queried, queries.wgsl stands in the place of this module.

// The first hit of a ray from a distance on. `seed` decides where surfaces cover in part.
fn first_hit(top: u32, ray: Ray, from_: f32, seed: u32) -> Hit {
    return walk(FIRST, top, ray, from_, FAR, seed, NONE).hit;
}

// What passes of the light along a ray, up to a distance.
fn passage_of_light(top: u32, ray: Ray, to: f32, seed: u32) -> Walked {
    return walk(PASSAGE_OF_LIGHT, top, ray, 0.0, to, seed, NONE);
}
