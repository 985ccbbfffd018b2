//! From light to an 8-bit picture.

mod agx;
mod jpeg;
mod lens;
mod meter;
mod noise;
mod tone;
mod white_balance;

pub use jpeg::Jpeg;
pub use lens::{Blur, ChromaticAberration, Vignetting};
pub use meter::{ev100_of, white_nits};
pub use noise::Noise;
pub use tone::{Curve, Developer, Tone};
pub use white_balance::WhiteBalance;

use crate::grid::filled;
use crate::view;
use std::borrow::Cow;
use syntable_model::prelude::*;
use syntable_model::product::standard::{EXPOSURE, RADIANCE, RGB};
use syntable_model::scene::Exposure;

/// Makes the 8-bit picture from the radiance: exposure, tone curve, sRGB encoding, rounding; and, if their tables are
/// given, what a lens and an image sensor add.
///
/// The effects come in the order of a camera: vignetting, chromatic aberration, blur, exposure, noise, white balance,
/// tone curve, JPEG. White balance follows the noise, because a camera scales what it has read out. Every number that
/// can be a distribution is drawn anew for every view. `exposure` in the output says all that was applied.
///
/// A fixed exposure maps `1.2 · 2^EV100` nits to white. An automatic one meters the picture as a reflected-light meter
/// does (ISO 2720, K = 12.5) on the log-average luminance of the middle 80 % of the pixels, and stops down if more than
/// 1 % of what two stops can save would be burnt out. It meters what reaches the sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RgbCamera {
    /// How luminance becomes brightness: `filmic` lifts the middle tones to where a meter wants them and rolls the
    /// highlights off; `srgb` is proportional up to white; `linear` is `srgb` without the sRGB encoding; `agx` is
    /// `filmic` with more room for highlights, in which bright colours fade to white.
    pub tone: Tone,
    /// Light lost towards the corners; off if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vignetting: Option<Vignetting>,
    /// Coloured fringes towards the corners; off if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chromatic_aberration: Option<ChromaticAberration>,
    /// Blur of lens and focus; off if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blur: Option<Blur>,
    /// Which light is made white.
    pub white_balance: WhiteBalance,
    /// Photon and read-out noise; off if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
    /// Traces of compression; off if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jpeg: Option<Jpeg>,
}

impl Config for RgbCamera {
    type Stage = dyn Sensor;
    const KIND: &'static str = "rgb_camera";
    const EXAMPLE: &'static str = "tone = \"filmic\"\nwhite_balance = \"auto\"\nvignetting = { natural = 0.6 }\n\
         blur = { sigma_px = { uniform = [0.3, 0.8] } }\nnoise = { iso = { log_uniform = [100, 1600] } }\n\
         jpeg = { quality = 92 }";
    fn build(self) -> Result<Box<dyn Sensor>, Invalid> {
        self.vignetting.as_ref().map_or(Ok(()), Vignetting::check)?;
        self.chromatic_aberration.as_ref().map_or(Ok(()), ChromaticAberration::check)?;
        self.blur.as_ref().map_or(Ok(()), Blur::check)?;
        self.white_balance.check()?;
        self.noise.as_ref().map_or(Ok(()), Noise::check)?;
        self.jpeg.as_ref().map_or(Ok(()), Jpeg::check)?;
        Ok(Box::new(self))
    }
}

impl Sensor for RgbCamera {
    fn reads(&self) -> Vec<KeyId> {
        keys![RADIANCE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![RGB, EXPOSURE]
    }

    fn sense(&self, site: &Site, context: &Context, frame: &mut Frame) -> Result<()> {
        let view = view(site)?;
        let (workers, stream) = (context.workers, |effect: &str| context.stream.child(effect));
        let mut applied: Vec<(&str, Value)> = Vec::new();
        let mut light = Cow::Borrowed(frame.get(RADIANCE)?);
        let intrinsics = &view.camera.intrinsics;
        if let Some(vignetting) = &self.vignetting {
            let told = vignetting.apply(finite(&mut light), intrinsics, workers, &stream("vignetting"));
            applied.push(("vignetting", told));
        }
        if let Some(aberration) = &self.chromatic_aberration {
            let told = aberration.apply(finite(&mut light), intrinsics, workers, &stream("chromatic_aberration"));
            applied.push(("chromatic_aberration", told));
        }
        if let Some(blur) = &self.blur {
            applied.push(("blur", blur.apply(finite(&mut light), workers, &stream("blur"))));
        }
        let (mode, ev100) = match view.exposure {
            Exposure::Fixed { ev100 } => ("fixed", ev100),
            Exposure::Auto { compensation_ev } => ("auto", ev100_of(light.data()) - compensation_ev),
        };
        let white = white_nits(ev100);
        // The light is judged without noise, as by a camera that has seen more than one picture of it.
        let balance = self.white_balance.gains(light.data(), &stream("white_balance"));
        if let Some(noise) = &self.noise {
            applied.push(("noise", noise.apply(finite(&mut light), white, workers, &stream("noise"))));
        }
        let mut gains = [1.0; 3];
        if let Some((balanced, told)) = balance {
            gains = balanced;
            applied.push(("white_balance", told));
        }
        let developer = Developer::new(self.tone, white);
        let mut picture = filled(workers, [light.width(), light.height()], |y, row: &mut [[u8; 3]]| {
            for (x, code) in row.iter_mut().enumerate() {
                let nits = light.at(x as u32, y);
                *code = developer.code(std::array::from_fn(|c| nits[c] * gains[c]));
            }
        });
        if let Some(jpeg) = &self.jpeg {
            applied.push(("jpeg", jpeg.apply(&mut picture, &stream("jpeg"))?));
        }
        frame.put(RGB, picture)?;
        let exposure = [
            ("mode", mode.into()),
            ("ev100", ev100.into()),
            ("white_nits", white.into()),
            ("tone", self.tone.name().into()),
        ];
        frame.put(EXPOSURE, Value::record(exposure.into_iter().chain(applied)))
    }
}

/// The picture to work on. Not a number is dark and infinity is very bright, so that a filter does not spread them.
fn finite<'a>(light: &'a mut Cow<'_, Plane<[f32; 3]>>) -> &'a mut Plane<[f32; 3]> {
    const BRIGHT_NITS: f32 = 1e12;
    if let Cow::Borrowed(rendered) = *light {
        let finite = |v: f32| if v > 0.0 { v.min(BRIGHT_NITS) } else { 0.0 };
        *light = Cow::Owned(rendered.map(|pixel| pixel.map(finite)));
    }
    light.to_mut()
}

register!(RgbCamera);
