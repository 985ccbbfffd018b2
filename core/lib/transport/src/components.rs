//! Components of light: images that are rendered beside the whole one, of shorter paths by the same random numbers.

use crate::film::Statistics;
use syntable_model::error::Result;
use syntable_model::product::standard::{RADIANCE, RADIANCE_DIRECT, RADIANCE_INDIRECT, RADIANCE_UNSHADOWED};
use syntable_model::product::{Key, KeyId, Plane, Products};
use syntable_model::stage::RenderRequest;

/// Which light paths gather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Light {
    /// All of it.
    #[default]
    All,
    /// Light after at most one reflection.
    Direct,
    /// The same without shadows. Only emitters are sampled, because a hit of a reflected ray would hide lights.
    Unshadowed,
}

/// Products that are components of light.
const OFFERED: [KeyId; 3] = [RADIANCE_DIRECT.id(), RADIANCE_INDIRECT.id(), RADIANCE_UNSHADOWED.id()];

/// Products that [`render`] adds to the products of a renderer.
pub fn offers() -> impl Iterator<Item = KeyId> {
    OFFERED.into_iter()
}

/// Renders a view, and the components of its light that the request wants.
///
/// Renders a request. `trace` renders one component of light; `whole` is its key for all light before a denoiser.
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
        request.wants.iter().partition(|want| OFFERED.contains(want));
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
