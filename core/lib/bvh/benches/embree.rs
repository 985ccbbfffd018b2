//! Compares this crate's tree with Embree 3.13 (Debian: `libembree-dev`), in the same process, with the same rays, in
//! turns.
//!
//! `cargo bench -p syntable-bvh --features embree --bench embree [-- REPEATS]`. Times are
//! CPU time of the tracing threads, medians over the repeats; single-ray calls on both sides.

mod common;

use std::{ffi::c_void, ptr::null_mut, sync::Arc};

use common::{Class, Object};
use syntable_bvh::{IDENTITY, Instance, MeshBvh, Ray, SceneBvh};

/// Hand-written declarations of the few functions used; layouts as in `rtcore_ray.h`.
mod ffi {
    use std::ffi::c_void;

    #[repr(C, align(16))]
    #[derive(Clone, Copy)]
    pub struct RayHit {
        pub origin: [f32; 3],
        pub near: f32,
        pub direction: [f32; 3],
        pub time: f32,
        pub far: f32,
        pub mask: u32,
        pub id: u32,
        pub flags: u32,
        pub normal: [f32; 3],
        pub u: f32,
        pub v: f32,
        pub primitive: u32,
        pub geometry: u32,
        pub instance: u32,
    }

    #[repr(C)]
    pub struct Context {
        pub flags: u32,
        pub filter: *const c_void,
        pub instance: u32,
        pub min_width_distance_factor: f32,
    }

    #[link(name = "embree3")]
    unsafe extern "C" {
        pub fn rtcNewDevice(config: *const i8) -> *mut c_void;
        pub fn rtcNewScene(device: *mut c_void) -> *mut c_void;
        pub fn rtcCommitScene(scene: *mut c_void);
        pub fn rtcNewGeometry(device: *mut c_void, kind: i32) -> *mut c_void;
        pub fn rtcSetNewGeometryBuffer(
            geometry: *mut c_void,
            kind: i32,
            slot: u32,
            format: i32,
            stride: usize,
            count: usize,
        ) -> *mut c_void;
        pub fn rtcSetGeometryInstancedScene(geometry: *mut c_void, scene: *mut c_void);
        pub fn rtcSetGeometryTransform(geometry: *mut c_void, time_step: u32, format: i32, transform: *const c_void);
        pub fn rtcCommitGeometry(geometry: *mut c_void);
        pub fn rtcAttachGeometry(scene: *mut c_void, geometry: *mut c_void) -> u32;
        pub fn rtcIntersect1(scene: *mut c_void, context: *mut Context, ray: *mut RayHit);
        pub fn rtcOccluded1(scene: *mut c_void, context: *mut Context, ray: *mut RayHit);
    }

    #[repr(C)]
    pub struct TimeSpec {
        pub seconds: i64,
        pub nanoseconds: i64,
    }

    unsafe extern "C" {
        pub fn clock_gettime(clock: i32, time: *mut TimeSpec) -> i32;
    }
}

/// A committed scene. Embree's scenes may be read from any thread once committed.
#[derive(Clone, Copy)]
struct Embree(*mut c_void);

// SAFETY: see above.
unsafe impl Sync for Embree {}

impl Embree {
    fn mesh(device: *mut c_void, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        // SAFETY: the buffers have the requested length, and are filled before the commit.
        unsafe {
            let scene = ffi::rtcNewScene(device);
            let geometry = ffi::rtcNewGeometry(device, 0);
            let (n, m) = (positions.len(), triangles.len());
            let vertex = ffi::rtcSetNewGeometryBuffer(geometry, 1, 0, 0x9003, 12, n);
            std::ptr::copy_nonoverlapping(positions.as_ptr(), vertex.cast(), n);
            let index = ffi::rtcSetNewGeometryBuffer(geometry, 0, 0, 0x5003, 12, m);
            std::ptr::copy_nonoverlapping(triangles.as_ptr(), index.cast(), m);
            ffi::rtcCommitGeometry(geometry);
            ffi::rtcAttachGeometry(scene, geometry);
            ffi::rtcCommitScene(scene);
            Self(scene)
        }
    }

    fn instanced(device: *mut c_void, objects: &[Object]) -> Self {
        // SAFETY: the transform is twelve floats in row-major order, as the format requires.
        unsafe {
            let scene = ffi::rtcNewScene(device);
            for object in objects {
                let mesh = Self::mesh(device, &object.positions, &object.triangles);
                let geometry = ffi::rtcNewGeometry(device, 121);
                ffi::rtcSetGeometryInstancedScene(geometry, mesh.0);
                let transform = object.world_from_object.as_ptr().cast();
                ffi::rtcSetGeometryTransform(geometry, 0, 0x9134, transform);
                ffi::rtcCommitGeometry(geometry);
                ffi::rtcAttachGeometry(scene, geometry);
            }
            ffi::rtcCommitScene(scene);
            Self(scene)
        }
    }
}

/// All objects in one mesh, in world coordinates.
fn merged(objects: &[Object]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for object in objects {
        let base = positions.len() as u32;
        positions.extend(object.world_positions());
        triangles.extend(object.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    (positions, triangles)
}

/// One mesh as a scene.
fn flat(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> SceneBvh {
    let mesh = Arc::new(MeshBvh::build(positions, triangles));
    SceneBvh::build([Instance { world_from_object: IDENTITY, mesh, id: 0 }])
}

/// Hits and the sum of their distances.
type Tally = (usize, f64);

fn trace_ours(scene: &SceneBvh, rays: &[Ray], shadow: bool) -> Tally {
    if shadow {
        return (rays.iter().filter(|ray| scene.any(ray, 0.0, 1.0)).count(), 0.0);
    }
    rays.iter().fold((0, 0.0), |(hits, sum), ray| match scene.closest(ray, 0.0, f32::INFINITY) {
        Some(hit) => (hits + 1, sum + f64::from(hit.t)),
        None => (hits, sum),
    })
}

fn trace_embree(scene: &Embree, rays: &[Ray], shadow: bool) -> Tally {
    let mut context =
        ffi::Context { flags: 0, filter: std::ptr::null(), instance: u32::MAX, min_width_distance_factor: 0.0 };
    let (mut hits, mut sum) = (0, 0.0);
    for ray in rays {
        let mut query = ffi::RayHit {
            origin: ray.origin,
            near: 0.0,
            direction: ray.direction,
            time: 0.0,
            far: if shadow { 1.0 } else { f32::INFINITY },
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: u32::MAX,
            geometry: u32::MAX,
            instance: u32::MAX,
        };
        // SAFETY: the scene is committed; the query and the context have Embree's layout.
        unsafe {
            if shadow {
                ffi::rtcOccluded1(scene.0, &mut context, &mut query);
                hits += usize::from(query.far < 0.0);
            } else {
                ffi::rtcIntersect1(scene.0, &mut context, &mut query);
                if query.geometry != u32::MAX {
                    hits += 1;
                    sum += f64::from(query.far);
                }
            }
        }
    }
    (hits, sum)
}

/// CPU seconds of this thread.
fn thread_time() -> f64 {
    let mut time = ffi::TimeSpec { seconds: 0, nanoseconds: 0 };
    // SAFETY: `time` is valid; 3 is CLOCK_THREAD_CPUTIME_ID on Linux.
    unsafe { ffi::clock_gettime(3, &mut time) };
    time.seconds as f64 + time.nanoseconds as f64 * 1e-9
}

/// Mray/s of CPU time, summed over threads that share the rays in blocks, and the tally.
fn measure(rays: &[Ray], threads: usize, trace: impl Fn(&[Ray]) -> Tally + Sync) -> (f64, Tally) {
    let block = rays.len().div_ceil(threads);
    std::thread::scope(|scope| {
        let workers: Vec<_> = rays
            .chunks(block)
            .map(|rays| {
                let trace = &trace;
                scope.spawn(move || {
                    let start = thread_time();
                    let tally = trace(rays);
                    (rays.len() as f64 / (thread_time() - start) * 1e-6, tally)
                })
            })
            .collect();
        workers.into_iter().fold((0.0, (0, 0.0)), |(speed, (hits, sum)), worker| {
            let (s, (h, d)) = worker.join().expect("a tracing thread panicked");
            (speed + s, (hits + h, sum + d))
        })
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let repeats = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(5);
    let objects = common::objects();
    let (positions, triangles) = merged(&objects);
    let clock = std::time::Instant::now();
    let flat = flat(&positions, &triangles);
    println!("{} triangles; our flat tree took {:?}", triangles.len(), clock.elapsed());
    let clock = std::time::Instant::now();
    let instanced = common::instanced(&objects);
    println!("our {} mesh trees and the scene took {:?}", objects.len(), clock.elapsed());
    let clock = std::time::Instant::now();
    // SAFETY: no configuration.
    let device = unsafe { ffi::rtcNewDevice(null_mut()) };
    let embree_flat = Embree::mesh(device, &positions, &triangles);
    println!("Embree's flat tree took {:?}", clock.elapsed());
    let embree_instanced = Embree::instanced(device, &objects);
    let classes = common::classes(&instanced, &objects, 4);
    for threads in [1, 2] {
        println!("\n{threads} thread(s), Mray/s");
        println!(
            "{:18} {:>9} {:>9} {:>6}  {:>9} {:>9} {:>6}",
            "", "flat", "Embree", "ratio", "instanced", "Embree", "ratio"
        );
        for Class { name, shadow, rays } in &classes {
            let (mut speeds, mut tallies) = ([const { Vec::new() }; 4], [(0, 0.0); 4]);
            for _ in 0..repeats {
                let runs = [
                    measure(rays, threads, |rays| trace_ours(&flat, rays, *shadow)),
                    measure(rays, threads, |rays| trace_embree(&embree_flat, rays, *shadow)),
                    measure(rays, threads, |rays| trace_ours(&instanced, rays, *shadow)),
                    measure(rays, threads, |rays| trace_embree(&embree_instanced, rays, *shadow)),
                ];
                for (kernel, (speed, tally)) in runs.into_iter().enumerate() {
                    speeds[kernel].push(speed);
                    tallies[kernel] = tally;
                }
            }
            let [a, b, c, d] = speeds.map(median);
            println!("{name:18} {a:9.2} {b:9.2} {:6.2}  {c:9.2} {d:9.2} {:6.2}", a / b, c / d);
            if threads == 1 {
                let hits = tallies.map(|(hits, _)| hits);
                let sums = tallies.map(|(_, sum)| format!("{sum:.3}"));
                println!("    {} rays, hits {hits:?}, distances {sums:?}", rays.len());
            }
        }
    }
}
