//! Shared code of writers of COCO's family: an image per view, a shard per scene, and one annotation file for the
//! dataset.

use super::read::extends;
use serde::Serialize;
use syntable_formats::Extra;
use syntable_formats::coco::{Category, CocoImage, CocoInfo, License, categories};
use syntable_formats::dataset::{DatasetWriter, JsonLayout};
use syntable_formats::encode::png::PngImage;
use syntable_formats::encode::rgb::{RgbFiles, RgbFormat};
use syntable_formats::encode::view_name;
use syntable_formats::image_file::{self, RgbFile};
use syntable_formats::shard;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::{LABEL_POLICY, RGB};

/// Folder of the images inside the writer's folder.
pub const IMAGES: &str = "images";

/// A writer of a format of COCO's family. The formats differ in their records and in the names of their files.
pub trait Family: Send + Sync + Sized + 'static {
    /// The products that it reads.
    fn reads(&self) -> Vec<Input>;

    /// The option `rgb`.
    fn rgb(&self) -> RgbFiles;

    /// Path of the annotation file. This path, like all paths here, is relative to the writer's folder.
    fn file(&self) -> String;

    /// All files of the dataset.
    fn files(&self) -> Vec<String> {
        vec![self.file()]
    }

    /// The files of a view, given its name.
    fn files_of_view(&self, view: &str) -> Vec<String> {
        vec![format!("{IMAGES}/{}", self.rgb().file_name(view))]
    }

    /// Writes the files of a view, and the records of its annotations.
    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()>;

    /// The categories of the annotation file.
    fn categories(&self, dataset: &DatasetInfo) -> Result<Vec<Category>> {
        Ok(categories(dataset))
    }

    /// The images that the annotation file lists.
    fn listed(&self) -> ListedImages {
        ListedImages::All
    }

    /// Options that affect only the files of the dataset.
    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    /// Writes the files of the dataset.
    fn finish(&self, cx: &DatasetContext, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), &self.categories(cx.dataset)?, self.listed())
    }

    /// The writer.
    fn writer(self) -> Box<dyn Writer> {
        FamilyWriter(self).boxed()
    }
}

struct FamilyWriter<F>(F);

impl<F: Family> ImageWriter for FamilyWriter<F> {
    /// Content of the shard.
    type Scene = Vec<u8>;

    fn reads(&self) -> Vec<Input> {
        self.0.reads().into_iter().chain([image_file::input()]).collect()
    }

    fn view(&self, shard: &mut Vec<u8>, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        self.0.view(cx, products, &mut SceneFiles { output, shard, rgb: self.0.rgb() })
    }

    fn close(&self, shard: Vec<u8>, _: &ImagesContext, _: &Products, output: &Output) -> Result<()> {
        output.write_shard(&shard)
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.0.finish(cx, finish)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let files = match (of.scene, of.view) {
            (Some(scene), Some(view)) => self.0.files_of_view(&view_name(scene, view)),
            (None, None) => self.0.files(),
            _ => Vec::new(),
        };
        files.into_iter().map(|file| format!("{}/{file}", of.id)).collect()
    }

    fn finish_options(&self) -> &'static [&'static str] {
        self.0.finish_options()
    }
}

/// The policy of the labels, if they have one. The record of an image states it where masks end at the edge of the
/// image and rates do not, so that readers can compare both.
pub fn policy() -> Input {
    Input::of(LABEL_POLICY).optional()
}

/// Checks the option `split`, which is part of a file's name.
pub fn check_split(split: &str) -> Result<(), ConfigError> {
    if split.is_empty() || split.contains(['/', '\\']) {
        return Err(ConfigError::new("split", format!("`{split}` is not part of a file name")).help("write `train`"));
    }
    check_path("split", split)
}

/// The files of a scene: images, and the records of the annotation file in the shard.
pub struct SceneFiles<'a> {
    output: &'a Output,
    shard: &'a mut Vec<u8>,
    rgb: RgbFiles,
}

impl SceneFiles<'_> {
    /// Writes the image of a view and its record. The records of `annotations` annotations follow it.
    pub fn image(&mut self, cx: &ImageContext, products: &Products, annotations: usize) -> Result<()> {
        self.image_with(cx, products, annotations, Extra::new())
    }

    /// As [`Self::image`], with further fields of the record.
    pub fn image_with(
        &mut self,
        cx: &ImageContext,
        products: &Products,
        annotations: usize,
        extra: Extra,
    ) -> Result<()> {
        let name = self.rgb.file_name(&view_name(cx.scene_id, cx.view_id));
        self.image_in(IMAGES, &name, products, annotations, extra)
    }

    /// Writes the image of a view to `folder` inside the writer's folder. Its record contains `name`, the path relative
    /// to that folder, with the extension of the image's format.
    pub fn image_in(
        &mut self,
        folder: &str,
        name: &str,
        products: &Products,
        annotations: usize,
        mut extra: Extra,
    ) -> Result<()> {
        // Formats that cannot store the policy do not declare it as an input.
        if products.contains(LABEL_POLICY.name()) {
            let policy = serde_json::to_value(products.get(LABEL_POLICY)?);
            let policy = policy.map_err(|error| Error::new(error.to_string()))?;
            if extends(&policy) {
                extra.insert(LABEL_POLICY.name().to_owned(), policy);
            }
        }
        let rgb = products.get(RGB)?;
        let file = RgbFile::of(products, &RgbFormat::ALL, self.rgb)?;
        let name = file.named(name);
        self.output.write(&format!("{}/{folder}/{name}", self.output.id()), &file.bytes)?;
        let (width, height) = (rgb.width(), rgb.height());
        let license = Some(License::of_assets().id.into());
        let record = CocoImage { file_name: name, width, height, license, extra, ..CocoImage::default() };
        shard::push_image(self.shard, annotations, &record)
    }

    /// Writes a PNG file at a path inside the writer's folder.
    pub fn png(&self, path: &str, image: &PngImage) -> Result<()> {
        image.write(self.output, &format!("{}/{path}", self.output.id()))
    }

    /// Adds the record of an annotation. Its `id` and `image_id` must be the first fields, and 0.
    pub fn annotation(&mut self, record: &impl Serialize) -> Result<()> {
        shard::push_annotation(self.shard, record)
    }

    /// Adds a record of the view that is not an annotation.
    pub fn of_view(&mut self, record: &impl Serialize) -> Result<()> {
        shard::push_view(self.shard, record)
    }
}

/// The images that an annotation file lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ListedImages {
    /// All images.
    All,
    /// Images with annotations.
    Annotated,
}

impl ListedImages {
    fn lists(self, annotations: usize) -> bool {
        self == Self::All || annotations > 0
    }
}

/// Writes the annotation file `file`, a path inside the writer's folder, from the shards of all scenes.
pub fn merge(
    cx: &DatasetContext,
    finish: &Finish,
    file: &str,
    categories: &[Category],
    listed: ListedImages,
) -> Result<()> {
    let path = format!("{}/{file}", finish.id());
    finish.write(&path, |out| {
        let mut file = DatasetWriter::new(out, &path, JsonLayout::Lines)?;
        file.header(&info(cx.dataset), &[License::of_assets()], categories)?;
        shard::merge(cx.dataset, finish, &mut file, |annotations| usize::from(listed.lists(annotations)))?;
        file.finish()
    })
}

/// Name and program of the dataset. Dates are omitted, so that files do not depend on the clock.
pub fn info(dataset: &DatasetInfo) -> CocoInfo {
    CocoInfo { description: dataset.name.clone(), contributor: dataset.program.clone(), ..CocoInfo::default() }
}
