//! A device that runs out of memory.
//!
//! The only test of its program, since it limits the memory of the process, from which a software renderer takes its
//! buffers.
#![cfg(target_os = "linux")]

use std::process::Command;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, DEPTH, INSTANCE, NORMAL, RADIANCE};
use syntable_render_wgpu::{Adapters, GpuPathRenderer};
use syntable_testing::room::{self, Look};
use syntable_testing::tools::is_there;
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

/// Bytes of the address space of this process.
fn addressed() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").expect("Linux has it");
    4096 * pages.split_whitespace().next().and_then(|pages| pages.parse::<u64>().ok()).expect("a number")
}

/// Limits the address space of this process, in bytes; the hard limit stays.
fn limit(bytes: &str) {
    let pid = std::process::id().to_string();
    let status = Command::new("prlimit").args(["--pid", &pid, &format!("--as={bytes}:")]).status();
    assert!(status.expect("prlimit of util-linux runs").success());
}

#[test]
fn a_scene_without_memory_fails_and_the_next_one_renders() {
    let adapters = Adapters::find();
    let prlimit = Command::new("prlimit").arg("--version").output().is_ok();
    if !is_there(adapters.used().is_ok() && prlimit, "a graphics adapter (mesa-vulkan-drivers), and prlimit") {
        return;
    }
    let (is_card, largest) = adapters.used().map(|used| (used[0].is_hardware(), used[0].max_buffer)).expect("there");
    if is_card {
        println!("skipped: a card has memory of its own; `a_card_with_little_memory_left_gets_fewer_paths` fills it");
        return;
    }
    let renderer = GpuPathRenderer::new(PathTracing { samples_per_pixel: 2, ..PathTracing::default() }).on(adapters);
    let scene = room::scene_of(Look::Mixed);
    let open = || {
        let mut session = renderer.open(0).expect("opens");
        session.load(&scene, &Threads(2)).expect("loads");
        session
    };
    let view = room::view(24, 20);
    let light = [RADIANCE.id()];
    let image = |session: &mut Box<dyn RenderSession>| {
        let mut products = Products::new();
        let request = RenderRequest::new(&view, &light, Stream::root(3), &Threads(2));
        session.render(&request, &mut products).map(|()| products.get(RADIANCE).expect("made").clone())
    };
    let mut session = open();
    let before = image(&mut session).expect("renders");
    // Labels of eight words per pixel that fill three quarters of the largest buffer, while only half of that memory is
    // left.
    let labels = [DEPTH.id(), INSTANCE.id(), NORMAL.id(), ALBEDO.id()];
    let height = (largest / 4 * 3 / (4 * 8 * 1024)).min(1 << 14) as u32;
    let large = room::view(1024, height);
    limit(&(addressed() + u64::from(height) * 1024 * 4 * 8 / 2).to_string());
    let request = RenderRequest::new(&large, &labels, Stream::root(3), &Threads(2));
    let failed = session.render(&request, &mut Products::new());
    limit("unlimited");
    let error = failed.expect_err("there is no memory");
    println!("{error}");
    assert!(error.is_passing() && error.to_string().to_lowercase().contains("memory"), "{error}");
    // A failed device fails every later image; a new device renders.
    assert!(image(&mut session).is_err());
    assert!(image(&mut open()).expect("renders").data() == before.data(), "another image");
}
