//! `none`: no denoiser.

use syntable_model::prelude::*;
use syntable_model::product::standard::DENOISER;

/// Leaves images as they are rendered. The default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoDenoiser {}

impl Config for NoDenoiser {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "none";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Denoiser>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Denoiser for NoDenoiser {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![DENOISER]
    }

    fn replaces(&self) -> Vec<Replacement> {
        Vec::new()
    }

    fn denoise(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        products.put(DENOISER, Value::record([("name", Self::KIND.into())]))
    }
}

register!(NoDenoiser);
