//! From radiance to an 8-bit image.

mod agx;
mod curve;
mod developer;
mod development;
mod inverse;
mod jpeg;
mod lens;
mod meter;
mod noise;
mod plate;
mod ranks;
mod sigmoid;
mod tone;
mod white_balance;

pub use curve::Curve;
pub use developer::Developer;
pub use development::Development;
pub use jpeg::Jpeg;
pub use lens::{Blur, ChromaticAberration, Vignetting};
pub use meter::{ev100_of, white_nits};
pub use noise::Noise;
pub use plate::{Behind, Plate, PlateOrder};
pub use tone::Tone;
pub use white_balance::WhiteBalance;

use crate::image_filter::filled;
use inverse::Inverse;
use std::borrow::Cow;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, EXPOSURE, RADIANCE, RGB};
use syntable_model::scene::Exposure;

/// Turns radiance into an 8-bit image: exposure, tone curve, sRGB encoding and rounding; and, if their tables are given,
/// the effects of a lens and an image sensor.
///
/// The effects come in the order of a camera: vignetting, chromatic aberration, blur, exposure, noise, white balance,
/// tone curve, JPEG. White balance follows the noise, because a camera scales what it has read out. Distributions are
/// sampled per view. The product `exposure` records everything that was applied.
///
/// A fixed exposure maps `1.2 · 2^EV100` nits to white. An automatic exposure works as a reflected-light meter (ISO 2720,
/// K = 12.5) on the log-average luminance of the central 80 % of the pixels by luminance. It then lowers the exposure by
/// up to two stops while more than 1 % of the recoverable pixels clip. It meters the light that reaches the sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RgbCamera {
    /// Tone curve.
    pub tone: Tone,
    /// Darkening towards the corners; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vignetting: Option<Vignetting>,
    /// Color fringes towards the corners; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chromatic_aberration: Option<ChromaticAberration>,
    /// Blur of lens and focus; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blur: Option<Blur>,
    /// The light that becomes white: `"none"` (the default), `"auto"`, `"gray_world"` or `{ kelvin = 4000 }`.
    pub white_balance: WhiteBalance,
    /// Photograph behind the rendered objects; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate: Option<Plate>,
    /// Shot noise and read noise; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
    /// JPEG compression artifacts; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jpeg: Option<Jpeg>,
}

impl Config for RgbCamera {
    type Stage = dyn Sensor;
    const KIND: &'static str = "rgb_camera";
    const EXAMPLE: &'static str = "tone = \"filmic\"\nwhite_balance = \"auto\"\nvignetting = { natural = 0.6 }\n\
         blur = { sigma_px = { uniform = [0.3, 0.8] } }\nnoise = { iso = { log_uniform = [100, 1600] } }\n\
         jpeg = { quality = 92 }";
    fn build(self) -> Result<Box<dyn Sensor>, ConfigError> {
        self.vignetting.as_ref().map_or(Ok(()), Vignetting::check)?;
        self.chromatic_aberration.as_ref().map_or(Ok(()), ChromaticAberration::check)?;
        self.blur.as_ref().map_or(Ok(()), Blur::check)?;
        self.white_balance.check()?;
        self.plate.as_ref().map_or(Ok(()), Plate::check)?;
        self.noise.as_ref().map_or(Ok(()), Noise::check)?;
        self.jpeg.as_ref().map_or(Ok(()), Jpeg::check)?;
        Ok(Box::new(self))
    }
}

impl Sensor for RgbCamera {
    fn reads(&self) -> Vec<KeyId> {
        let mut reads = self.plate.as_ref().map_or_else(|| keys![RADIANCE], Plate::reads);
        reads.extend(self.white_balance.reads_albedo().then_some(ALBEDO.id()));
        reads
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![RGB, EXPOSURE]
    }

    fn needs(&self) -> Option<Part> {
        self.plate.as_ref().and_then(Plate::needs)
    }

    fn found(&self, views: u32) -> Result<()> {
        self.plate.as_ref().map_or(Ok(()), |plate| plate.found(views))
    }

    fn sense(&self, cx: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()> {
        let (view, workers, stream) = (cx.view, cx.workers, |effect: &str| stream.child(effect));
        let mut applied: Vec<(&str, Value)> = Vec::new();
        // The light is estimated without noise, as by a camera that averages several images.
        let albedo = self.white_balance.reads_albedo().then(|| products.get(ALBEDO)).transpose()?;
        let metered = |light: &[[f32; 3]]| {
            let (mode, ev100) = match view.exposure {
                Exposure::Fixed { ev100 } => ("fixed", ev100),
                Exposure::Auto { compensation_ev } => ("auto", ev100_of(light) - compensation_ev),
            };
            let balance = self.white_balance.gains(light, albedo.map(Plane::data), &stream("white_balance"));
            Settings { mode, ev100, white: white_nits(ev100), balance }
        };
        let (mut light, settings) = match &self.plate {
            None => (Cow::Borrowed(products.get(RADIANCE)?), None),
            Some(plate) => {
                let settings = metered(products.get(RADIANCE)?.data());
                let inverse = (&Inverse::new(self.tone, settings.white, settings.gains()), settings.white);
                let (light, record) = plate.composed((cx, &stream("plate")), inverse, products)?;
                applied.push(("plate", record));
                (Cow::Owned(light), Some(settings))
            }
        };
        let intrinsics = &view.camera.intrinsics;
        if let Some(vignetting) = &self.vignetting {
            let record = vignetting.apply(modified(&mut light), intrinsics, workers, &stream("vignetting"));
            applied.push(("vignetting", record));
        }
        if let Some(aberration) = &self.chromatic_aberration {
            let record = aberration.apply(modified(&mut light), intrinsics, workers, &stream("chromatic_aberration"));
            applied.push(("chromatic_aberration", record));
        }
        if let Some(blur) = &self.blur {
            applied.push(("blur", blur.apply(modified(&mut light), workers, &stream("blur"))));
        }
        let settings = settings.unwrap_or_else(|| metered(light.data()));
        let (gains, Settings { mode, ev100, white, balance }) = (settings.gains(), settings);
        if let Some(noise) = &self.noise {
            applied.push(("noise", noise.apply(modified(&mut light), white, workers, &stream("noise"))));
        }
        if let Some((_, record)) = balance {
            applied.push(("white_balance", record));
        }
        let developer = Developer::new(self.tone, white, gains);
        let mut image = filled(workers, [light.width(), light.height()], |y, row: &mut [[u8; 3]]| {
            let start = y as usize * row.len();
            developer.develop(&light.data()[start..start + row.len()], row);
        });
        if let Some(jpeg) = &self.jpeg {
            applied.push(("jpeg", jpeg.apply(&mut image, &stream("jpeg"))?));
        }
        products.put(RGB, image)?;
        let exposure = [
            ("mode", mode.into()),
            ("ev100", ev100.into()),
            ("white_nits", white.into()),
            ("tone", self.tone.name().into()),
        ];
        products.put(EXPOSURE, Value::record(exposure.into_iter().chain(applied)))
    }
}

/// Exposure and white balance of a view.
struct Settings {
    mode: &'static str,
    ev100: f64,
    /// Light that becomes white, nits.
    white: f64,
    /// Gains of the channels, and their record.
    balance: Option<([f32; 3], Value)>,
}

impl Settings {
    fn gains(&self) -> [f32; 3] {
        self.balance.as_ref().map_or([1.0; 3], |(gains, _)| *gains)
    }
}

/// The image to modify, with finite light.
fn modified<'a>(light: &'a mut Cow<'_, Plane<[f32; 3]>>) -> &'a mut Plane<[f32; 3]> {
    if let Cow::Borrowed(rendered) = *light {
        *light = Cow::Owned(rendered.map(|pixel| pixel.map(finite)));
    }
    light.to_mut()
}

/// Light that filters do not spread: NaN becomes 0, and infinity very bright.
fn finite(nits: f32) -> f32 {
    const BRIGHT_NITS: f32 = 1e12;
    if nits > 0.0 { nits.min(BRIGHT_NITS) } else { 0.0 }
}

register!(RgbCamera);
