//! Warns of noisy color images: few random paths per pixel, and no denoiser.

use crate::plan::{Plan, PlanEntry, Provider};
use crate::tables::stages::Built;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::NOWHERE;
use syntable_model::product::standard::RADIANCE;
use syntable_model::registry::{Slot, Stage};

/// Number of paths per pixel below which noise is plain to see without a denoiser. In quickstart at 640 × 480, an image of
/// 16 samples differs from one of 512 by 23 dB, of 32 by 26 dB, of 64 by 28 dB; the grain of 16 hides small textures.
const ENOUGH_SAMPLES: u32 = 32;

/// The warning for the renderer of a recipe.
pub(crate) fn check(built: &Built, plan: &Plan) -> Option<DiagnosticBuilder> {
    // A denoiser replaces the image of the renderer.
    let is_raw = |entry: &PlanEntry| entry.provider == Provider::Renderer && entry.key.is(RADIANCE.name());
    // `kind = "none"` states that noise is wanted.
    let is_decided = built.stages.iter().any(|stage| stage.slot == Slot::Denoise && stage.header != NOWHERE)
        || built.failed.contains(&Slot::Denoise);
    if is_decided || !plan.entries.iter().any(is_raw) {
        return None;
    }
    let (stage, samples) = built.stages.iter().find_map(|stage| match &stage.stage {
        Some(Stage::Render(renderer)) => Some((stage, renderer.samples_per_pixel()?)),
        _ => None,
    })?;
    let paths = if samples == 1 { "1 sample".to_owned() } else { format!("{samples} samples") };
    let warning = || {
        DiagnosticBuilder::warning(
            Code::Noise,
            stage.header.clone(),
            format!("images of {paths} per pixel are noisy without a denoiser"),
        )
        .help("add a section [denoise] with `kind = \"guided\"`, or with `kind = \"none\"` if noise is wanted")
        .help(format!("or raise `samples_per_pixel` to {ENOUGH_SAMPLES} or more"))
    };
    (samples < ENOUGH_SAMPLES).then(warning)
}
