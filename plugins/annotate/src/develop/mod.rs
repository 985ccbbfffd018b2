//! From light to an 8-bit picture.

mod meter;
mod tone;

pub use meter::{ev100_of, white_nits};
pub use tone::{Curve, Tone};

use crate::object_info::view;
use syntable_model::prelude::*;
use syntable_model::product::standard::{EXPOSURE, RADIANCE, RGB};
use syntable_model::scene::Exposure;

/// Develops the 8-bit picture from the radiance: exposure, tone curve, sRGB encoding, rounding.
///
/// A fixed exposure maps `1.2 · 2^EV100` nits to white. An automatic one meters the picture as a reflected-light meter
/// does (ISO 2720, K = 12.5) on the log-average luminance of the middle 80 % of the pixels, and stops down if more than
/// 1 % of what four stops can save would be burnt out. `exposure` in the output says what was chosen.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Develop {
    /// How luminance becomes brightness: `filmic` lifts the middle tones to where a meter wants them and rolls the
    /// highlights off; `srgb` is proportional up to white; `linear` is `srgb` without the sRGB encoding.
    pub tone: Tone,
}

impl Config for Develop {
    type Stage = dyn Annotator;
    const KIND: &'static str = "develop";
    const EXAMPLE: &'static str = "tone = \"filmic\"";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for Develop {
    fn reads(&self) -> Vec<KeyId> {
        keys![RADIANCE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![RGB, EXPOSURE]
    }

    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()> {
        let radiance = frame.get(RADIANCE)?;
        let (mode, ev100) = match view(site)?.exposure {
            Exposure::Fixed { ev100 } => ("fixed", ev100),
            Exposure::Auto { compensation_ev } => ("auto", ev100_of(radiance.data()) - compensation_ev),
        };
        let white = white_nits(ev100);
        let curve = Curve::new(self.tone, white);
        let picture = radiance.map(|pixel| pixel.map(|nits| curve.code(nits)));
        frame.put(RGB, picture)?;
        let record = Value::record([
            ("mode", mode.into()),
            ("ev100", ev100.into()),
            ("white_nits", white.into()),
            ("tone", self.tone.name().into()),
        ]);
        frame.put(EXPOSURE, record)
    }
}

register!(Develop);
