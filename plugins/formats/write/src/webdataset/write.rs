//! Writes shards.

use super::record::{EXR, IDS, JSON, NPY, PNG, shard_path};
use super::{Floats, Webdataset};
use syntable_formats::encode::kind::ValueKind;
use syntable_formats::encode::npy::{self, NpyArrays};
use syntable_formats::encode::tar::TarWriter;
use syntable_formats::encode::{exr, json_shard, png, scene_name, view_name};
use syntable_formats::include;
use syntable_model::prelude::*;
use syntable_model::product::Scope;
use syntable_model::product::standard::RGB;

impl Writer for Webdataset {
    fn reads(&self) -> Vec<Input> {
        let of_view = |key: &KeyId| match key.scope.comes_with_view() {
            true => Ok(()),
            false => Err("a sample is a view; write it with jsonl".to_owned()),
        };
        self.include.inputs(Accepts::when(of_view))
    }

    fn scene(&self, cx: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let path = shard_path(output.id(), &scene_name(cx.scene_id));
        let archive = TarWriter::new(output.create(&path)?, path);
        Ok(Box::new(WebdatasetScene { config: self.clone(), archive }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(match (of.scene, of.view) {
            (Some(scene), None) => vec![shard_path(of.id, &scene_name(scene))],
            _ => self.include.list_paths(of),
        })
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.include.write_lists(cx.dataset, finish)
    }
}

struct WebdatasetScene {
    config: Webdataset,
    archive: TarWriter<FileWriter>,
}

impl SceneWriter for WebdatasetScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let size = include::shape(cx);
        let sample = view_name(cx.scene_id, cx.view_id);
        for (product, key) in self.config.include.of_scope(products, Scope::View) {
            let fields = self.config.fields_of(product, &key, products, size)?;
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

impl Webdataset {
    /// The [fields](Self::fields) of a product, which are the file of the option `rgb` for the color image.
    fn fields_of(
        &self,
        product: &str,
        key: &KeyId,
        products: &Products,
        size: [usize; 2],
    ) -> Result<Vec<(&'static str, Vec<u8>)>> {
        if *key == RGB.id() && !self.rgb.is_default() {
            return Ok(vec![(self.rgb.extension(), self.rgb.encode(products.get(RGB)?)?)]);
        }
        self.fields(product, key, &products.value(product)?, size)
    }

    /// The fields of a product: the suffixes of their names, and their bytes. `size` is the height and width of an
    /// image without instances.
    fn fields(
        &self,
        product: &str,
        key: &KeyId,
        value: &Value,
        size: [usize; 2],
    ) -> Result<Vec<(&'static str, Vec<u8>)>> {
        let kind = ValueKind::of(key, value);
        let explain = |error: Error| error.context(format!("product `{product}`"));
        match png::PngCoding::of(&kind) {
            // A value that a lossless format can store is never stored with loss.
            Ok(png::PngCoding::Depth | png::PngCoding::Normal | png::PngCoding::Color) | Err(_) => {}
            Ok(coding) => {
                let image = coding.image(value, 1.0).and_then(|image| image.encode()).map_err(explain)?;
                return Ok(vec![(PNG, image)]);
            }
        }
        if let (Floats::Exr, Ok(coding)) = (self.floats, exr::ExrCoding::of(&kind)) {
            return Ok(vec![(EXR, coding.encode(value, exr::Precision::Float).map_err(explain)?)]);
        }
        match npy::arrays_of_numbers(product, key, value, size) {
            Some(NpyArrays::One(array)) => Ok(vec![(NPY, array.encode())]),
            Some(NpyArrays::PerInstance { values, ids }) => Ok(vec![(NPY, values.encode()), (IDS, ids.encode())]),
            None => {
                let mut line = Vec::new();
                json_shard::push_line(&mut line, value).map_err(explain)?;
                Ok(vec![(JSON, line)])
            }
        }
    }
}
