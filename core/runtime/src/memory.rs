//! Memory that an image takes at least, and what the machine has: a run that cannot hold one view is refused before it begins.
//! `check` does not look, since a recipe may be checked on another machine than the one that runs it.

use crate::plan::Plan;
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, RenderParameters, Scope};

/// Bytes per pixel that a renderer keeps while it renders: sums and squares of radiance, and rays.
const RENDERER: u64 = 48;

/// Bytes of main memory and swap of the machine; none if that is not known.
pub(crate) fn installed() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kib = |name: &str| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_whitespace().nth(1)?.parse().ok()
    };
    Some(1024 * (kib("MemTotal:")? + kib("SwapTotal:").unwrap_or(0)))
}

/// Refuses views of `[width, height]` pixels whose products are more than `installed` bytes, all of which are there at once
/// when the view is written.
///
/// # Errors
/// If one view of one scene does not fit.
pub(crate) fn fits(plan: &Plan, [width, height]: [u32; 2], installed: u64) -> Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    let of_view = plan.entries.iter().map(|entry| entry.key).filter(|key| key.scope == Scope::View);
    let products = of_view.map(|key| per_pixel(&key).saturating_mul(factor(key.name.parameters)));
    let needed = pixels.saturating_mul(products.fold(RENDERER, u64::saturating_add));
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
        .context("camera")
        .permanent())
}

/// Pixels of a product by those of the image, as far as the name says.
fn factor(parameters: RenderParameters) -> u64 {
    // Of objects, how many pixels there are depends on the scene.
    if parameters.objects.is_some() {
        return 0;
    }
    u64::from(parameters.canvas * parameters.subpixels).pow(2)
}

/// Bytes per pixel of a product; 0 of one that is no image, whose size depends on the scene.
fn per_pixel(key: &KeyId) -> u64 {
    let name = key.type_name();
    let Some(of) = name.strip_prefix("Plane<").and_then(|name| name.strip_suffix('>')) else { return 0 };
    let (element, count) = match of.strip_prefix('[').and_then(|of| of.strip_suffix(']')?.split_once("; ")) {
        Some((element, count)) => (element, count.parse().unwrap_or(1)),
        None => (of, 1),
    };
    count
        * match element {
            "f32" | "u32" | "i32" => 4,
            "f64" | "u64" => 8,
            "u16" | "InstanceId" => 2,
            _ => 1,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::PlanEntry;
    use syntable_model::product::standard::{DEPTH, INSTANCE, NORMAL, RGB};

    #[test]
    fn views_that_no_memory_holds_are_refused() {
        let keys = [DEPTH.id(), NORMAL.id(), RGB.id(), INSTANCE.id()];
        assert_eq!(keys.each_ref().map(per_pixel), [4, 12, 3, 2]);
        let entry = |key| PlanEntry { key, provider: "render".into(), wanted_by: Vec::new() };
        let mut plan = Plan { entries: keys.into_iter().map(entry).collect(), ..Plan::default() };
        // 1000 × 500 pixels of 48 + 21 bytes.
        assert!(fits(&plan, [1000, 500], 34_500_000).is_ok());
        let error = fits(&plan, [1000, 500], 34_499_999).expect_err("one byte too few").to_string();
        assert!(error.contains("1000 × 500") && error.contains("`camera.resolution`"), "{error}");
        // Of an image three times as wide and high, each with 2 × 2 sub-pixels.
        let wide = RenderParameters { canvas: 3, subpixels: 2, ..RenderParameters::IMAGE };
        plan.entries.push(entry(DEPTH.id().with(wide)));
        assert!(fits(&plan, [1000, 500], 106_500_000).is_ok() && fits(&plan, [1000, 500], 106_499_999).is_err());
    }
}
