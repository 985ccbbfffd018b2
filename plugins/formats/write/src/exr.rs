//! OpenEXR files of float images.

use syntable_formats::encode::exr::{Coding, ImageLayer, Precision, encode_layers};
use syntable_formats::encode::kind::{Kind, accepts};
use syntable_formats::encode::{scene_name, view_name};
use syntable_formats::include::{self, Included};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Writes float images as OpenEXR files.
///
/// # What it does
///
/// Stores 16- and 32-bit float images of up to 4 channels, such as `radiance`, `depth` and `normal`, in their own
/// precision and with lossless ZIP compression. What the product means names the channels:
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
/// With `layers` a file has all products of a view: each is a layer of its own name, as compositing programs show it, and
/// its channels are `depth.Z` or `normal.X`. The first color of `include` has the plain names `R` `G` `B`, so that viewers
/// show it. The unit of a layer is in the attribute `{layer}.unit`. All images have the size of the first.
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
        Ok(self.boxed())
    }
}

impl ImageWriter for Exr {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        self.include.inputs(Accepts::If(|key| accepts(key, Coding::of)))
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        self.write(Scope::View, &view_name(cx.scene_id, cx.view_id), products, output)
    }

    fn close(&self, (): (), cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        self.write(Scope::Scene, &scene_name(cx.scene_id), products, output)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match self.layers {
            true => include::path_of_all(of, |name| layers_path(of.id, name)).into_iter().collect(),
            false => include::paths(of, "exr", include::IMAGE_ENDS),
        }
    }
}

fn layers_path(id: &str, name: &str) -> String {
    format!("{id}/{name}.exr")
}

impl Exr {
    fn write(&self, scope: Scope, name: &str, products: &Products, output: &Output) -> Result<()> {
        let precision = if self.half { Precision::Half } else { Precision::Float };
        if self.layers {
            return self.write_layers(scope, name, products, output, precision);
        }
        let images = self.include.of_scope(products, scope);
        include::write_images(images, output, "exr", name, products, |kind, value| {
            Coding::of(kind).map_err(Error::new)?.encode(value, precision)
        })
    }

    /// Writes the images of a scope as layers of one file, if there are any.
    fn write_layers(
        &self,
        scope: Scope,
        name: &str,
        products: &Products,
        output: &Output,
        precision: Precision,
    ) -> Result<()> {
        let mut layers = Vec::new();
        for (product, key) in self.include.of_scope(products, scope) {
            let mut add = |value: Value, name: String| {
                let coding = Coding::of(&Kind::of(&key, &value))
                    .map_err(|refusal| Error::new(refusal).context(format!("product `{product}`")))?;
                layers.push(ImageLayer { name, coding, value });
                Ok(())
            };
            match products.value(product)? {
                Value::PerInstance(values) => {
                    values.into_iter().try_for_each(|(id, value)| add(value, format!("{product}_{:04}", id.0)))?;
                }
                value => add(value, product.to_owned())?,
            }
        }
        if let Some(color) = layers.iter_mut().find(|layer| layer.coding.color) {
            color.name.clear();
        }
        match layers.is_empty() {
            true => Ok(()),
            false => output.write(&layers_path(output.id(), name), &encode_layers(&layers, precision)?),
        }
    }
}

register!(Exr);
