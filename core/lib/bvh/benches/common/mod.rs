//! The measured scene and its rays: 40 deformed spheres and tori on a table and a floor.

use std::sync::Arc;

use syntable_bvh::{Affine, IDENTITY, Instance, MeshBvh, Ray, SceneBvh};

/// SplitMix64: small, and the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.word() >> 40) as f32 / (1 << 24) as f32
    }
}

/// A mesh and its position.
pub struct Object {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub world_from_object: Affine,
}

impl Object {
    pub fn world_positions(&self) -> Vec<[f32; 3]> {
        let place = |p: &[f32; 3]| self.world_from_object.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]);
        self.positions.iter().map(place).collect()
    }
}

/// The scene's objects: 302 574 triangles.
pub fn objects() -> Vec<Object> {
    let mut random = Random(1);
    let mut objects = vec![slab([3.0, 3.0, 0.0], 0.0), slab([0.6, 0.4, 0.02], 0.72)];
    for number in 0..40 {
        let (positions, triangles) = blob(&mut random, number % 2 == 0);
        let (s, c) = (random.unit() * std::f32::consts::TAU).sin_cos();
        let x = (number % 8) as f32 * 0.14 - 0.49 + random.unit() * 0.03;
        let y = (number / 8) as f32 * 0.14 - 0.28 + random.unit() * 0.03;
        let z = 0.74 + 0.06 + random.unit() * 0.05;
        let world_from_object = [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z]];
        objects.push(Object { positions, triangles, world_from_object });
    }
    objects
}

/// A box of half-sizes `half` at height `z`; a single rectangle if it is flat.
fn slab(half: [f32; 3], z: f32) -> Object {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 1 { half[a] } else { -half[a] });
    let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let sides = if half[2] == 0.0 { &quads[..1] } else { &quads[..] };
    let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut world_from_object = IDENTITY;
    world_from_object[2][3] = z;
    Object { positions: (0..8).map(corner).collect(), triangles, world_from_object }
}

/// A closed grid of 61 × 62 quads, rippled; about 6 cm across the middle.
fn blob(random: &mut Random, torus: bool) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (rows, columns) = (61_u32, 62_u32);
    let waves: [(f32, f32); 3] =
        std::array::from_fn(|i| ((i + 2) as f32 + (random.unit() * 3.0).floor(), random.unit() * 6.0));
    let mut positions = Vec::new();
    for row in 0..=rows {
        for column in 0..columns {
            let turn = std::f32::consts::TAU * column as f32 / columns as f32;
            let v = row as f32 / rows as f32;
            let ripple = waves.iter().map(|(k, phase)| (k.round() * turn + phase + 5.0 * v).sin());
            let swell = 1.0 + 0.05 * ripple.sum::<f32>();
            let (ring, height) = if torus {
                let around = std::f32::consts::TAU * v;
                (0.04 + 0.018 * swell * around.cos(), 0.018 * swell * around.sin())
            } else {
                let polar = std::f32::consts::PI * v;
                (0.05 * swell * polar.sin(), 0.06 * swell * polar.cos())
            };
            positions.push([ring * turn.cos(), ring * turn.sin(), height]);
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let [a, b] = [row * columns + column, row * columns + next];
            let [c, d] = [a + columns, b + columns];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    (positions, triangles)
}

/// Every object as an instance of its own tree.
pub fn instanced(objects: &[Object]) -> SceneBvh {
    SceneBvh::build(objects.iter().zip(0..).map(|(o, id)| {
        let mesh = Arc::new(MeshBvh::build(&o.positions, &o.triangles));
        Instance { world_from_object: o.world_from_object, mesh, id }
    }))
}

/// A named set of rays; shadow rays end at distance 1.
pub struct Class {
    pub name: &'static str,
    pub shadow: bool,
    pub rays: Vec<Ray>,
}

/// Camera rays of a `width × height` image in pixel order, `samples` jittered per pixel.
pub fn primary(width: usize, height: usize, samples: usize) -> Vec<Ray> {
    let mut random = Random(2);
    let eye = [0.55, -0.45, 1.3];
    let ahead = unit(sub([0.0, 0.0, 0.76], eye));
    let right = unit(cross(ahead, [0.0, 0.0, 1.0]));
    let up = cross(right, ahead);
    let mut rays = Vec::with_capacity(width * height * samples);
    for pixel in 0..width * height {
        for _ in 0..samples {
            let x = ((pixel % width) as f32 + random.unit()) / height as f32 - 0.667;
            let y = 0.5 - ((pixel / width) as f32 + random.unit()) / height as f32;
            let direction = unit([0, 1, 2].map(|a| ahead[a] + right[a] * x + up[a] * y));
            rays.push(Ray { origin: eye, direction });
        }
    }
    rays
}

/// All classes: camera rays, a cosine-weighted bounce from each hit, the same bounces shuffled, and a shadow ray from
/// each hit to a 20 cm light above the table.
pub fn classes(scene: &SceneBvh, objects: &[Object], samples: usize) -> Vec<Class> {
    let world: Vec<Vec<[f32; 3]>> = objects.iter().map(Object::world_positions).collect();
    let mut random = Random(3);
    let primary = primary(640, 480, samples);
    let (mut bounce, mut shadow) = (Vec::new(), Vec::new());
    for ray in &primary {
        let Some(hit) = scene.closest(ray, 0.0, f32::INFINITY) else { continue };
        let corners = objects[hit.instance as usize].triangles[hit.primitive as usize]
            .map(|i| world[hit.instance as usize][i as usize]);
        let normal = unit(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
        let facing = if dot(normal, ray.direction) > 0.0 { -1.0 } else { 1.0 };
        let normal = normal.map(|x| x * facing);
        let origin = [0, 1, 2].map(|a| ray.origin[a] + hit.t * ray.direction[a] + 1e-4 * normal[a]);
        let (s, c) = (random.unit() * std::f32::consts::TAU).sin_cos();
        let z = 1.0 - 2.0 * random.unit();
        let r = (1.0 - z * z).sqrt();
        let direction = unit([normal[0] + r * c, normal[1] + r * s, normal[2] + z + 1e-6]);
        bounce.push(Ray { origin, direction });
        let light = [0.4 + 0.2 * random.unit(), 0.3 + 0.2 * random.unit(), 2.4];
        shadow.push(Ray { origin, direction: sub(light, origin) });
    }
    let mut shuffled = bounce.clone();
    for i in (1..shuffled.len()).rev() {
        shuffled.swap(i, (random.word() % (i as u64 + 1)) as usize);
    }
    vec![
        Class { name: "primary", shadow: false, rays: primary },
        Class { name: "bounce", shadow: false, rays: bounce },
        Class { name: "bounce, shuffled", shadow: false, rays: shuffled },
        Class { name: "shadow", shadow: true, rays: shadow },
    ]
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}
