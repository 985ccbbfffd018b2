//! `none`: no denoiser.

use syntable_model::prelude::*;
use syntable_model::product::standard::DENOISER;

/// Leaves images as they are rendered. The default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoDenoiser {}

config!(NoDenoiser => dyn Denoiser, "none");

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
