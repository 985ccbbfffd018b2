//! Components of light: additional images with shorter paths, from the same random numbers as the whole image.

use crate::film::{Film, Statistics};
use syntable_model::error::Result;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DEPTH, INSTANCE, NORMAL, OBJECT_DEPTHS, RADIANCE, RADIANCE_DIRECT,
    RADIANCE_INDIRECT, RADIANCE_UNSHADOWED,
};
use syntable_model::product::{Key, KeyId, Plane, Products};
use syntable_model::stage::RenderRequest;

/// The light that paths gather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Light {
    /// All light.
    #[default]
    All,
    /// Light after at most one reflection.
    Direct,
    /// Light after at most one reflection, without shadows. Only emitters are sampled, because a hit of a reflected ray
    /// would hide lights.
    Unshadowed,
}

/// Products of surfaces and labels that every path tracer makes.
const OF_SURFACES: [KeyId; 7] = [
    DEPTH.id(),
    INSTANCE.id(),
    COVERAGE.id(),
    COVERAGE_BEFORE_SUPPORT.id(),
    OBJECT_DEPTHS.id(),
    NORMAL.id(),
    ALBEDO.id(),
];

/// Products that are components of light.
const OF_LIGHT: [KeyId; 3] = [RADIANCE_DIRECT.id(), RADIANCE_INDIRECT.id(), RADIANCE_UNSHADOWED.id()];

/// Products of a renderer that traces paths: surfaces and labels, its film, and the components that [`render`] adds.
pub fn offers() -> Vec<KeyId> {
    OF_SURFACES.into_iter().chain(Film::offers()).chain(OF_LIGHT).collect()
}

/// Renders a view, and the components of its light that the request wants. `trace` renders one component of light;
/// `whole` is its key for all light before a denoiser.
///
/// # Errors
/// Errors of `trace`.
pub fn render(
    request: &RenderRequest,
    whole: Key<Plane<[f32; 3]>>,
    frame: &mut Products,
    mut trace: impl FnMut(Light, &RenderRequest, &mut Products) -> Result<Statistics>,
) -> Result<Statistics> {
    let (components, mut others): (Vec<KeyId>, Vec<KeyId>) =
        request.wants.iter().partition(|want| OF_LIGHT.contains(want));
    if components.is_empty() {
        return trace(Light::All, request, frame);
    }
    let wants = |key: Key<Plane<[f32; 3]>>| components.contains(&key.id());
    if wants(RADIANCE_INDIRECT) && !others.contains(&whole.id()) {
        others.push(whole.id());
    }
    let mut made = Products::new();
    let mut statistics = trace(Light::All, &RenderRequest { wants: &others, ..request.clone() }, &mut made)?;
    let mut alone = |light: Light| -> Result<Plane<[f32; 3]>> {
        let mut made = Products::new();
        let request = RenderRequest { wants: &[RADIANCE.id()], denoiser: None, ..request.clone() };
        statistics.add(&trace(light, &request, &mut made)?);
        made.get(RADIANCE).cloned()
    };
    if wants(RADIANCE_DIRECT) || wants(RADIANCE_INDIRECT) {
        let direct = alone(Light::Direct)?;
        if wants(RADIANCE_INDIRECT) {
            let all = made.get(whole)?;
            let rest = |x, y| [0, 1, 2].map(|c| all.at(x, y)[c] - direct.at(x, y)[c]);
            made.put(RADIANCE_INDIRECT, Plane::from_fn(direct.width(), direct.height(), rest))?;
        }
        made.put(RADIANCE_DIRECT, direct)?;
    }
    if wants(RADIANCE_UNSHADOWED) {
        made.put(RADIANCE_UNSHADOWED, alone(Light::Unshadowed)?)?;
    }
    let wanted: Vec<_> = request.wants.iter().map(|key| key.product_id()).collect();
    frame.extend(made.only(&wanted))?;
    Ok(statistics)
}
