//! `syntable doctor`.

use super::list::products;
use crate::console::Console;
use crate::exit::Exit;
use std::fmt::Write as _;
use syntable_model::context::Cache;
use syntable_model::digest::Digest;
use syntable_model::inspect::inspectors;
use syntable_model::registry::{Choice, Registry, Slot, Stage};
use syntable_model::stage::RenderDevice;
use syntable_recipe::plan::memory::MachineMemory;
use syntable_runtime::cache::DiskCache;
use syntable_runtime::workers;
use syntable_simd::Processor;

pub(crate) fn doctor(console: &Console, registry: &Registry) -> Result<(), Exit> {
    let mut out = format!("syntable {}\n", env!("CARGO_PKG_VERSION"));
    let mut line = |name: &str, value: String| {
        let _ = writeln!(out, "  {name:12} {value}");
    };
    line("system", format!("{} {}", std::env::consts::OS, std::env::consts::ARCH));
    line("threads", workers::available().to_string());
    line("memory", memory());
    line("instructions", Processor::detect().name().to_owned());
    let cache = DiskCache::of_user();
    let probe = Digest::of(b"doctor");
    cache.put("doctor", probe, b"ok");
    let works = cache.get("doctor", probe).is_some();
    line(
        "cache",
        match cache.root() {
            Some(root) if works => root.display().to_string(),
            Some(root) => format!("{} (read-only: set SYNTABLE_CACHE to a writable folder)", root.display()),
            None => "none (HOME is not set: set SYNTABLE_CACHE to a folder)".to_owned(),
        },
    );
    let kinds: Vec<String> =
        Slot::ALL.into_iter().map(|slot| format!("{slot} {}", registry.of_slot(slot).count())).collect();
    line("kinds", kinds.join(", "));
    line("products", products(registry).len().to_string());
    line("assets", inspectors().iter().map(|inspector| inspector.name).collect::<Vec<_>>().join(", "));
    let mut crates: Vec<String> =
        registry.entries().iter().map(|entry| format!("{} {}", entry.crate_name, entry.crate_version)).collect();
    crates.sort();
    crates.dedup();
    line("plugins", if crates.is_empty() { "none: name them in main.rs".into() } else { crates.join(", ") });
    for entry in registry.of_slot(Slot::Render).filter(|entry| entry.choose.is_none()) {
        let Ok(Stage::Render(renderer)) = entry.construct_str(entry.example).map(|made| made.stage) else { continue };
        match renderer.devices() {
            Ok(devices) => devices.into_iter().enumerate().for_each(|(number, RenderDevice { name, limits, .. })| {
                let with = if limits.is_empty() { "" } else { "; " };
                line(if number == 0 { entry.kind } else { "" }, format!("{name}{with}{limits}"));
            }),
            Err(error) => line(entry.kind, error.to_string()),
        }
        renderer.unused_devices().into_iter().for_each(|device| line("", format!("not used: {device}")));
    }
    for entry in registry.entries() {
        let Some(choose) = entry.choose else { continue };
        line(
            &format!("{}.{}", entry.slot, entry.kind),
            match choose(registry) {
                Ok(Choice { kind, reason }) => format!("{kind}: {reason}"),
                Err(error) => error.to_string(),
            },
        );
    }
    console.print(&out)
}

fn memory() -> String {
    let Some(memory) = MachineMemory::of_this_machine() else { return "unknown".to_owned() };
    let [total, available] = [memory.total, memory.available].map(|bytes| bytes as f64 / f64::from(1 << 30));
    format!("{total:.1} GiB, {available:.1} GiB free")
}
