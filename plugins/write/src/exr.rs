//! OpenEXR files of float images.

use crate::encode::exr::{Coding, Precision};
use crate::include;
use syntable_model::prelude::*;

/// Writes float images as OpenEXR files.
///
/// # What it does
///
/// Stores 32-bit float images of up to 4 channels, such as `radiance`, `depth` and `normal`, with lossless ZIP
/// compression. What the product means names the channels:
///
/// | product | channels |
/// | --- | --- |
/// | color | `R` `G` `B`, with `A` if it has 4 channels; linear Rec. 709 |
/// | depth | `Z` |
/// | normal, position in meters | `X` `Y` `Z` |
/// | other image of 1, 2, 3 or 4 channels | `Y`; `X` `Y`; `R` `G` `B`; `R` `G` `B` `A` |
///
/// The header states the unit of the product in the attribute `unit`. A color in nits has a `whiteLuminance` of 1.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.exr`, and for a product per instance
/// `{id}/{product}/{scene:06}_{view:04}_{instance:04}.exr`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Exr {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Vec<ProductName>,
    /// Stores 16-bit floats: about half the size, 11 significant bits, and values above 65504 become infinite.
    pub half: bool,
}

impl Default for Exr {
    fn default() -> Self {
        Self { include: vec!["radiance".into()], half: false }
    }
}

impl Config for Exr {
    type Stage = dyn Writer;
    const KIND: &'static str = "exr";
    const EXAMPLE: &'static str = "include = [\"radiance\", \"depth\", \"normal\"]\nhalf = false";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        include::check_unique(&self.include)?;
        Ok(Box::new(self))
    }
}

impl Writer for Exr {
    fn reads(&self) -> Vec<String> {
        include::names(&self.include)
    }

    fn scene(&self, _: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(ExrScene { config: self.clone(), output }))
    }
}

struct ExrScene {
    config: Exr,
    output: Output,
}

impl SceneWriter for ExrScene {
    fn view(&mut self, site: &Site, frame: &Products) -> Result<()> {
        let precision = if self.config.half { Precision::Half } else { Precision::Float };
        include::write_images(&self.config.include, &self.output, "exr", site, frame, |kind, value| {
            Coding::of(kind).map_err(Error::new)?.encode(value, precision)
        })
    }

    fn close(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

register!(Exr);
