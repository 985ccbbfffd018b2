//! Tests of the functions of the shaders that read a scene, each against the Rust function that it mirrors, or against
//! an independent result. Functions that do not read a scene are tested in `tests/functions`.
//!
//! A kernel of [`call`] reads its arguments in order from a row of numbers and writes its results in order to another.

mod camera;
mod lights;
mod nodes;
pub mod soups;
mod surface;
mod walk;

use crate::adapters::Adapters;
use crate::device::{Device, Variant};
use crate::layout::{GROUP, Pass, groups};
use crate::session::GpuSession;
use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::product::standard::DEPTH;
use syntable_simd::functions::FAR;
use syntable_testing::tools::is_there;
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

/// A session on a device, if the machine has an adapter.
fn session() -> Option<GpuSession> {
    let adapters = Adapters::find();
    is_there(adapters.used().is_ok(), "a graphics adapter (mesa-vulkan-drivers)").then(|| {
        let device = Arc::new(Device::open(&adapters, 0).expect("opens"));
        GpuSession::new(device, PathTracing::default(), Arc::default()).expect("opens")
    })
}

/// Leaves the tables and uniforms of a view of a scene on the device.
pub fn show(session: &mut GpuSession, scene: &Scene, view: &View) {
    session.load(scene, &Threads(2)).expect("loads");
    show_request(session, &RenderRequest::new(view, &[DEPTH.id()], Stream::root(3), &Threads(2)));
}

/// Like [`show`], for any request of the loaded scene.
fn show_request(session: &mut GpuSession, request: &RenderRequest) {
    session.render(request, &mut Products::new()).expect("renders");
}

/// Runs statements in WGSL once per row of numbers, and returns the results that they put. The statements read the row
/// by `f()`, `v2()`, `v3()`, and `u()` for an integer. They write by `put`, `put2`, `put3`, `put_b` for 0.0 or 1.0, and
/// `put_u` for the bits of an integer. `number` is the index of the row.
pub fn call<const ARGUMENTS: usize, const RESULTS: usize>(
    session: &mut GpuSession,
    statements: &str,
    variant: Variant,
    rows: &[[f32; ARGUMENTS]],
) -> Vec<[u32; RESULTS]> {
    call_beside(session, "", statements, variant, rows).0
}

/// Like [`call`], with further functions in WGSL; also returns the kernel, whose rows stay on the device.
fn call_beside<const ARGUMENTS: usize, const RESULTS: usize>(
    session: &mut GpuSession,
    functions: &str,
    statements: &str,
    variant: Variant,
    rows: &[[f32; ARGUMENTS]],
) -> (Vec<[u32; RESULTS]>, wgpu::ComputePipeline) {
    let kernel = format!(
        "{functions}
var<private> argument: u32;
var<private> result: u32;
fn f() -> f32 {{ argument += 1u; return paths[(argument - 1u) / 4u][(argument - 1u) % 4u]; }}
fn u() -> u32 {{ return u32(f()); }}
fn v2() -> vec2<f32> {{ let x = f(); return vec2(x, f()); }}
fn v3() -> vec3<f32> {{ let x = f(); let y = f(); return vec3(x, y, f()); }}
fn put_u(x: u32) {{ output[result] = x; result += 1u; }}
fn put(x: f32) {{ put_u(bits(x)); }}
fn put_b(x: bool) {{ put(select(0.0, 1.0, x)); }}
fn put2(x: vec2<f32>) {{ put(x.x); put(x.y); }}
fn put3(x: vec3<f32>) {{ put2(x.xy); put(x.z); }}
@compute @workgroup_size(GROUP)
fn probe(@builtin(global_invocation_id) id: vec3<u32>) {{
    let number = id.x + id.y * ROW;
    if number >= pass_.pixels {{ return; }}
    argument = {ARGUMENTS}u * number;
    result = {RESULTS}u * number;
    {statements}
}}"
    );
    let (device, rays) = (session.device.clone(), rows.len() as u64);
    let words = rays * RESULTS as u64;
    session.buffers.paths = device.storage("rows", 4 * (rays * ARGUMENTS as u64).next_multiple_of(4)).expect("room");
    session.buffers.output = device.storage("results", 4 * words).expect("room");
    let readable = device.readable("results", 4 * words).expect("room");
    device.write(&session.buffers.paths, 0, bytemuck::cast_slice(rows.as_flattened()));
    let pass = Pass { pixels: rays as u32, ..Pass::default() };
    device.write(&session.buffers.passes, 0, bytemuck::bytes_of(&pass));
    let kernel = device.kernel_of(&kernel, "probe", variant);
    let mut encoder = device.encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let [x, y] = groups(rays, GROUP);
        pass.set_pipeline(&kernel);
        pass.set_bind_group(0, &session.bind(), &[0]);
        pass.dispatch_workgroups(x, y, 1);
    }
    encoder.copy_buffer_to_buffer(&session.buffers.output, 0, &readable, 0, 4 * words);
    let results = device.read(encoder, &readable, words, |words: &[u32]| words.as_chunks().0.to_vec());
    (results.expect("runs"), kernel)
}

/// Asserts that results are equal to the wanted numbers up to an absolute and a relative difference. One row in `slip`
/// may differ, where rounding changed a decision.
fn compare<const RESULTS: usize>(
    what: &str,
    results: &[[u32; RESULTS]],
    wanted: impl Fn(usize) -> [f32; RESULTS],
    [absolute, relative]: [f32; 2],
    slip: usize,
) {
    let alike = |a: f32, b: f32| (a - b).abs() <= absolute + relative * b.abs() || (a >= FAR && b >= FAR);
    let mut wrong = Vec::new();
    for (number, result) in results.iter().enumerate() {
        let (got, wanted) = (result.map(f32::from_bits), wanted(number));
        if let Some(place) = (0..RESULTS).find(|&place| !alike(got[place], wanted[place])) {
            wrong.push((number, place, got[place], wanted[place]));
        }
    }
    println!("{what}: {} of {} rows differ", wrong.len(), results.len());
    assert!(wrong.len() * slip <= results.len(), "{what}: {} of {}; {:?}", wrong.len(), results.len(), wrong[0]);
}

/// An integer or a boolean as a result.
fn whole(x: impl Into<u32>) -> f32 {
    x.into() as f32
}
