//! WebDataset: tar files of samples.

mod read;

use syntable_formats::encode::kind::Kind;
use syntable_formats::encode::npy::{self, Arrays};
use syntable_formats::encode::tar::Archive;
use syntable_formats::encode::{exr, json_shard, png, scene_name, view_name};
use syntable_formats::include::{self, Included};
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Writes WebDataset shards: tar files of samples, for training from disks and object stores that read fast in one piece.
///
/// # What it does
///
/// Each scene is a shard, each view a sample with the key `{scene:06}_{view:04}`. A sample has a field per included
/// product, in their order, and the kind of value decides about its format:
///
/// | product | field |
/// | --- | --- |
/// | 8- or 16-bit image, such as `rgb` and `visible_ids` | `{product}.png` |
/// | float image, such as `depth` | `{product}.npy`, or `{product}.exr` with `floats = "exr"` |
/// | other numbers, such as `amodal_bits` | `{product}.npy` |
/// | a number, a box or a mask per instance | `{product}.npy`, instances along the first axis, and `{product}.ids.npy` |
/// | record, list or text, such as `camera` | `{product}.json` |
///
/// Values are those of the writers `png`, `exr`, `npy` and `jsonl`. Nothing is compressed twice: the tar files are plain.
/// They have neither times nor owners, so that equal samples make equal files. WebDataset's readers take
/// `{id}-{000000..000099}.tar` for the first hundred scenes; a shard has as many samples as a scene has views.
///
/// # Output
///
/// `{id}/{id}-{scene:06}.tar`, and with ids of categories `{id}/categories.json`, their names in COCO's form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Webdataset {
    /// Products of the view to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Format of float images.
    pub floats: Floats,
}

/// Format of float images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Floats {
    /// NumPy arrays, which WebDataset decodes by itself.
    Npy,
    /// OpenEXR, compressed without loss.
    Exr,
}

impl Default for Webdataset {
    fn default() -> Self {
        let include = [
            "rgb",
            "depth",
            "visible_ids",
            "amodal_bits",
            "visible_box",
            "amodal_box",
            "category_id",
            "occlusion_order",
            "camera",
        ];
        Self { include: include.into(), floats: Floats::Npy }
    }
}

impl Config for Webdataset {
    type Stage = dyn Writer;
    const KIND: &'static str = "webdataset";
    const EXAMPLE: &'static str =
        "include = [\"rgb\", \"depth\", \"visible_ids\", \"amodal_bits\", \"category_id\", \"camera\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Writer for Webdataset {
    fn reads(&self) -> Vec<Input> {
        let of_view = |key: &KeyId| match key.scope.comes_with_view() {
            true => Ok(()),
            false => Err("a sample is a view; write it with jsonl".to_owned()),
        };
        self.include.inputs(Accepts::If(of_view))
    }

    fn scene(&self, cx: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let path = path(output.id(), &scene_name(cx.scene_id));
        let archive = Archive::new(output.create(&path)?, path);
        Ok(Box::new(WebdatasetScene { config: self.clone(), archive }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(match (of.scene, of.view) {
            (Some(scene), None) => vec![path(of.id, &scene_name(scene))],
            _ => self.include.categories_path(of).into_iter().collect(),
        })
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.include.write_categories(cx.dataset, finish)
    }
}

fn path(id: &str, scene: &str) -> String {
    format!("{id}/{id}-{scene}.tar")
}

struct WebdatasetScene {
    config: Webdataset,
    archive: Archive<FileWriter>,
}

impl SceneWriter for WebdatasetScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let size = include::shape(cx);
        let sample = view_name(cx.scene_id, cx.view_id);
        for (product, key) in self.config.include.of_scope(products, Scope::View) {
            let fields = self.config.floats.fields(product, &key, &products.value(product)?, size)?;
            fields
                .iter()
                .try_for_each(|(field, bytes)| self.archive.add(&format!("{sample}.{product}.{field}"), bytes))?;
        }
        Ok(())
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.archive.finish()
    }
}

impl Floats {
    /// The fields of a product without its name: their ends and their bytes. `size` is the height and width of an image
    /// without instances.
    fn fields(
        self,
        product: &str,
        key: &KeyId,
        value: &Value,
        size: [usize; 2],
    ) -> Result<Vec<(&'static str, Vec<u8>)>> {
        let kind = Kind::of(key, value);
        let explain = |error: Error| error.context(format!("product `{product}`"));
        match png::Coding::of(&kind) {
            // Nothing that has a format without loss is stored with less.
            Ok(png::Coding::Depth | png::Coding::Normal | png::Coding::Color) | Err(_) => {}
            Ok(coding) => {
                let image = coding.image(value, 1.0).and_then(|image| image.encode()).map_err(explain)?;
                return Ok(vec![("png", image)]);
            }
        }
        if let (Self::Exr, Ok(coding)) = (self, exr::Coding::of(&kind)) {
            return Ok(vec![("exr", coding.encode(value, exr::Precision::Float).map_err(explain)?)]);
        }
        match npy::arrays_of_numbers(product, key, value, size) {
            Some(Arrays::One(array)) => Ok(vec![("npy", array.encode())]),
            Some(Arrays::PerInstance { values, ids }) => Ok(vec![("npy", values.encode()), ("ids.npy", ids.encode())]),
            None => {
                let mut line = Vec::new();
                json_shard::push_line(&mut line, value).map_err(explain)?;
                Ok(vec![("json", line)])
            }
        }
    }
}

register!(Webdataset);
