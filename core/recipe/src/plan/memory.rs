//! The minimum memory for the images of a view, and the memory of the machine. A run that cannot hold one view is
//! refused before it begins.

use super::Plan;
use syntable_model::error::{Error, Result};
use syntable_model::product::{Form, KeyId};

/// Bytes per pixel that a renderer keeps while it renders: sums and squares of radiance, and rays.
const RENDERER: u64 = 48;

/// Memory of a machine, bytes.
#[derive(Debug, Clone, Copy)]
pub struct MachineMemory {
    /// Main memory.
    pub total: u64,
    /// Main memory that a new program can take without swapping.
    pub available: u64,
    /// Swap space.
    pub swap: u64,
}

impl MachineMemory {
    /// The memory of this machine; none if it is unknown.
    pub fn of_this_machine() -> Option<Self> {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let bytes = |name: &str| -> Option<u64> {
            let line = text.lines().find(|line| line.starts_with(name))?;
            line.split_whitespace().nth(1)?.parse().ok().map(|kib: u64| 1024 * kib)
        };
        let swap = bytes("SwapTotal:").unwrap_or(0);
        Some(Self { total: bytes("MemTotal:")?, available: bytes("MemAvailable:")?, swap })
    }
}

/// Bytes of main memory and swap of this machine; none if they are unknown.
pub(crate) fn installed() -> Option<u64> {
    MachineMemory::of_this_machine().map(|memory| memory.total + memory.swap)
}

/// Refuses views of `[width, height]` pixels if the renderer and all products need more than `installed` bytes. All
/// products of a view are in memory at once when it is written.
///
/// # Errors
/// If one view of one scene does not fit.
pub(crate) fn fits(plan: &Plan, [width, height]: [u32; 2], installed: u64) -> Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    let products: u64 = plan.entries.iter().map(|entry| bytes_per_pixel(&entry.key)).sum();
    let needed = pixels.saturating_mul(RENDERER + products);
    if needed <= installed {
        return Ok(());
    }
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    let message = format!(
        "a view of {width} × {height} pixels takes {:.0} GiB of memory or more, and this machine has {:.0} GiB",
        gib(needed),
        gib(installed)
    );
    Err(Error::new(message)
        .help("set a lower `camera.resolution`, or write fewer products (`syntable plan` lists them)")
        .context("camera"))
}

/// Bytes of a product per pixel of the view; 0 if it is not an image, because its size then depends on the scene.
pub(crate) fn bytes_per_pixel(key: &KeyId) -> u64 {
    match key.form() {
        Form::Image { dtype, channels } if key.scope.comes_with_view() => {
            let edge = u64::from(key.framing.pixels_per_edge());
            edge * edge * channels.unwrap_or(1) as u64 * dtype.size() as u64
        }
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{PlanEntry, Provider};
    use syntable_model::product::Framing;
    use syntable_model::product::standard::{DEPTH, INSTANCE, NORMAL, RGB};

    #[test]
    fn views_that_no_memory_holds_are_refused() {
        let keys = [DEPTH.id(), NORMAL.id(), RGB.id(), INSTANCE.id()];
        assert_eq!(keys.each_ref().map(bytes_per_pixel), [4, 12, 3, 2]);
        let entry = |key| PlanEntry { key, provider: Provider::Renderer, wanted_by: Vec::new() };
        let mut plan = Plan { entries: keys.into_iter().map(entry).collect(), ..Plan::default() };
        // 1000 × 500 pixels of 48 + 21 bytes.
        assert!(fits(&plan, [1000, 500], 34_500_000).is_ok());
        let error = fits(&plan, [1000, 500], 34_499_999).expect_err("one byte too few").to_string();
        assert!(error.contains("1000 × 500") && error.contains("`camera.resolution`"), "{error}");
        // Of an image three times as wide and high, each with 2 × 2 sub-pixels.
        let wide = Framing::IMAGE.on_canvas(3).in_subpixels(2);
        plan.entries.push(entry(DEPTH.id().framed(wide)));
        assert!(fits(&plan, [1000, 500], 106_500_000).is_ok() && fits(&plan, [1000, 500], 106_499_999).is_err());
    }
}
