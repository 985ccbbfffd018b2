//! `procedural_environments`: skies and studios, in nits.
//!
//! [`sky`] computes daylight, [`studio`] rooms lit by softboxes.
//!
//! **Invariants.** The illuminance on a horizontal plane under the open map equals the value in the description, up to
//! the resolution of the map.

mod raster;
pub mod sky;
pub mod studio;
mod temperature;

use crate::material::LICENSE;
use crate::variants::{check_families, parse_name, variant_catalog};
use sky::{Sky, Weather};
use studio::StudioRoom;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, EnvironmentMap};

/// Procedural environment maps, in nits: daylight by the CIE standard general sky (ISO 15469:2004), and
/// studios. No download is needed.
///
/// Names are `<family>_<variant>`, such as `clear_sky_0003`. A variant depends only on seed, family and number. The
/// illuminance on a horizontal plane is 8,700 to 15,600 lx for clear and hazy skies, 12,000 to 41,000 lx for cloudy
/// ones, 5,700 to 19,400 lx for overcast ones, 3,300 to 6,600 lx for sunsets and 500 to 3,000 lx for studios.
///
/// The maps do not contain the sun's disc, only the bright sky around it, above the map's +x. Add a directional light
/// for the sun's shadows.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralEnvironments {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<EnvironmentFamily>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Width of the maps, texels; they are half as high.
    #[schemars(range(min = 16, max = 4096))]
    width_px: u32,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
}

/// A family of environment maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EnvironmentFamily {
    /// Blue sky without clouds.
    ClearSky,
    /// Sky without clouds, whitish and bright around the sun.
    HazySky,
    /// Clouds before a blue sky.
    CloudySky,
    /// Even gray sky.
    OvercastSky,
    /// Warm sky around a low sun.
    SunsetSky,
    /// A room lit by softboxes.
    Studio,
}

impl EnvironmentFamily {
    /// All families.
    pub const ALL: [Self; 6] =
        [Self::ClearSky, Self::HazySky, Self::CloudySky, Self::OvercastSky, Self::SunsetSky, Self::Studio];

    /// Name in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::ClearSky => "clear_sky",
            Self::HazySky => "hazy_sky",
            Self::CloudySky => "cloudy_sky",
            Self::OvercastSky => "overcast_sky",
            Self::SunsetSky => "sunset_sky",
            Self::Studio => "studio",
        }
    }

    /// A variant, drawn from its own stream.
    pub fn map(self, stream: &Stream, name: &str, width: u32) -> Result<EnvironmentMap> {
        let weather = match self {
            Self::ClearSky => Weather::Clear,
            Self::HazySky => Weather::Hazy,
            Self::CloudySky => Weather::Cloudy,
            Self::OvercastSky => Weather::Overcast,
            Self::SunsetSky => Weather::Sunset,
            Self::Studio => return StudioRoom::draw(stream).map(name, width),
        };
        Sky::draw(weather, stream).map(name, width)
    }
}

impl Default for ProceduralEnvironments {
    fn default() -> Self {
        Self { families: EnvironmentFamily::ALL.to_vec(), variants_per_family: 8, width_px: 512, seed: 0 }
    }
}

impl Config for ProceduralEnvironments {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_environments";
    const EXAMPLE: &'static str =
        "families = [\"clear_sky\", \"overcast_sky\", \"studio\"]  # all by default\nvariants_per_family = 8";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, EnvironmentFamily::name)?;
        Ok(Box::new(self))
    }
}
register!(ProceduralEnvironments);

impl AssetSource for ProceduralEnvironments {
    fn class(&self) -> AssetClass {
        AssetClass::Environment
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        Ok(variant_catalog(self.families.iter().map(|family| family.name()), self.variants_per_family))
    }

    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        let (family, variant) = parse_name(name, &self.families, |family| family.name(), self.variants_per_family)?;
        let stream = Stream::root(self.seed).child("environments").child(family.name()).at(u64::from(variant));
        let mut map = family.map(&stream, name, self.width_px)?;
        map.license = LICENSE.to_owned();
        Ok(Asset::from(map))
    }
}
