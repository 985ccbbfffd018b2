//! OpenEXR files of float images.

use syntable_formats::encode::exr::{ExrCoding, ImageLayer, Precision, encode_layers};
use syntable_formats::encode::kind::accepts;
use syntable_formats::include::{self, Included, IncludedProducts};
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;

const EXTENSION: &str = "exr";

/// Writes float images as OpenEXR files.
///
/// # Behavior
///
/// Stores 16- and 32-bit float images of up to 4 channels, such as `radiance`, `depth` and `normal`, in their own
/// precision and with lossless ZIP compression. The meaning of the product determines the names of the channels:
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
/// With `layers`, a file has all products of a view. Each product is a layer with the product's name, as compositing
/// programs show it, and with channels such as `depth.Z` or `normal.X`. The first color of `include` has the plain
/// names `R` `G` `B`, so that viewers show it. The unit of a layer is in the attribute `{layer}.unit`. All images have
/// the size of the first.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.exr`, and for a product per instance
/// `{id}/{product}/{scene:06}_{view:04}_{instance:04}.exr`. A product of the scene has no `_{view:04}`. With `layers`:
/// `{id}/{scene:06}_{view:04}.exr`, and layers `{product}_{instance:04}` for a product per instance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Exr {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Stores all images as 16-bit floats: about half the size, 11 significant bits, and values above 65504 become
    /// infinite.
    pub half: bool,
    /// Whether to write one file with a layer per product instead of one file per product.
    pub layers: bool,
}

impl Default for Exr {
    fn default() -> Self {
        Self { include: ["radiance"].into(), half: false, layers: false }
    }
}

impl Config for Exr {
    type Stage = dyn Writer;
    const KIND: &'static str = "exr";
    const EXAMPLE: &'static str = "include = [\"radiance\", \"depth\", \"normal\"]\nhalf = false";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.writer())
    }
}

impl ProductWriter for Exr {
    fn include(&self) -> &Included {
        &self.include
    }

    fn accepts(key: &KeyId) -> Result<(), String> {
        accepts(key, ExrCoding::of)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match self.layers {
            true => include::path_of_all(of, EXTENSION).into_iter().collect(),
            false => include::paths(of, EXTENSION, include::IMAGE_ENDS),
        }
    }

    fn write(&self, included: &IncludedProducts) -> Result<()> {
        let precision = if self.half { Precision::Half } else { Precision::Float };
        match self.layers {
            true => write_layers(included, precision),
            false => included.write_images(EXTENSION, |kind, value| {
                ExrCoding::of(kind).map_err(Error::new)?.encode(value, precision)
            }),
        }
    }
}

/// Writes the images as layers of one file. Without images, no file is written.
fn write_layers(included: &IncludedProducts, precision: Precision) -> Result<()> {
    let mut layers = Vec::new();
    included.for_each_image(|product, id, kind, value| {
        let refuse = |reason: String| Error::new(reason).context(format!("product `{product}`"));
        let coding = ExrCoding::of(kind).map_err(refuse)?;
        let name = id.map_or_else(|| product.to_owned(), |id| format!("{product}_{:04}", id.0));
        layers.push(ImageLayer { name, coding, value });
        Ok(())
    })?;
    if let Some(color) = layers.iter_mut().find(|layer| layer.coding.color) {
        color.name.clear();
    }
    match layers.is_empty() {
        true => Ok(()),
        false => included.write_all(EXTENSION, &encode_layers(&layers, precision)?),
    }
}

register!(Exr);
