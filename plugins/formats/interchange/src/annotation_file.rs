//! What the formats of COCO's family share: an image per view, a shard per scene, and one annotation file for the
//! dataset.

use serde::Serialize;
use syntable_formats::Extra;
use syntable_formats::coco::{Category, Image as ImageRecord, Info, License};
use syntable_formats::dataset::{DatasetWriter, Layout};
use syntable_formats::encode::png::Image;
use syntable_formats::encode::view_name;
use syntable_formats::shard::{self, Line, for_each_line};
use syntable_model::prelude::*;
use syntable_model::product::standard::{LABEL_POLICY, RGB};
use syntable_model::scene::{SceneId, ViewId};

/// Folder of the images inside the writer's folder.
const IMAGES: &str = "images";

/// File name of a view's image.
pub fn image_name(scene: SceneId, view: ViewId) -> String {
    format!("{}.png", view_name(scene, view))
}

/// Paths of a writer of one image per view and of files of the dataset, which are relative to the writer's folder.
pub fn paths(of: &FileOf, files: &[String]) -> Vec<String> {
    match (of.scene, of.view) {
        (Some(scene), Some(view)) => vec![format!("{}/{IMAGES}/{}", of.id, image_name(scene, view))],
        (None, None) => files.iter().map(|file| format!("{}/{file}", of.id)).collect(),
        _ => Vec::new(),
    }
}

/// The policy of the labels, if they have one: records of images say it where masks end at the image and rates do not, so that
/// both can be compared.
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
pub struct SceneFiles {
    output: Output,
    shard: Vec<u8>,
}

impl SceneFiles {
    /// Starts a scene.
    pub fn new(output: Output) -> Self {
        Self { output, shard: Vec::new() }
    }

    /// Writes the image of a view, and its record, which `annotations` records of annotations follow.
    pub fn image(&mut self, cx: &ImageContext, products: &Products, annotations: usize) -> Result<()> {
        let name = image_name(cx.scene_id, cx.view_id);
        self.image_in(IMAGES, name, products, annotations, Extra::new())
    }

    /// Writes the image of a view to `folder` inside the writer's folder; its record says `name`, the path inside that
    /// folder.
    pub fn image_in(
        &mut self,
        folder: &str,
        name: String,
        products: &Products,
        annotations: usize,
        mut extra: Extra,
    ) -> Result<()> {
        // Formats without a place for it do not declare it.
        if products.contains(LABEL_POLICY.name()) {
            let policy = serde_json::to_value(products.get(LABEL_POLICY)?);
            let policy = policy.map_err(|error| Error::new(error.to_string()))?;
            if policy["image_frame"] == "extend" {
                extra.insert(LABEL_POLICY.name().to_owned(), policy);
            }
        }
        let rgb = products.get(RGB)?;
        self.png(&format!("{folder}/{name}"), &Image::rgb(rgb))?;
        let (width, height) = (rgb.width(), rgb.height());
        let license = Some(license().id);
        let record = ImageRecord { file_name: name, width, height, license, extra, ..ImageRecord::default() };
        shard::push_image(&mut self.shard, annotations, &record)
    }

    /// Writes a PNG file at a path inside the writer's folder.
    pub fn png(&self, path: &str, image: &Image) -> Result<()> {
        image.write(&self.output, &format!("{}/{path}", self.output.id()))
    }

    /// Adds the record of an annotation. Its `id` and `image_id` must be the first fields, and 0.
    pub fn annotation(&mut self, record: &impl Serialize) -> Result<()> {
        shard::push_annotation(&mut self.shard, record)
    }

    /// Adds a record of the view that is no annotation.
    pub fn of_view(&mut self, record: &impl Serialize) -> Result<()> {
        shard::push_view(&mut self.shard, record)
    }

    /// Ends the scene.
    pub fn close(self) -> Result<()> {
        self.output.write_shard(&self.shard)
    }
}

/// Which images an annotation file lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Listed {
    /// All images.
    All,
    /// Those that have annotations.
    Annotated,
}

impl Listed {
    fn lists(self, annotations: usize) -> bool {
        self == Self::All || annotations > 0
    }
}

/// Writes the annotation file `file`, a path inside the writer's folder, from the shards of all scenes. It has no
/// section of categories if there are none.
pub fn merge(
    cx: &DatasetContext,
    finish: &Finish,
    file: &str,
    categories: Option<&[Category]>,
    listed: Listed,
) -> Result<()> {
    let path = format!("{}/{file}", finish.id());
    finish.write(&path, |out| {
        let mut file = DatasetWriter::new(out, &path, Layout::Lines)?;
        file.section("info", &info(cx.dataset))?;
        file.section("licenses", &[license()])?;
        if let Some(categories) = categories {
            file.section("categories", &categories)?;
        }
        file.images(|images| {
            for_each_line(cx.dataset, finish, |id, line| match line {
                Line::Image { annotations, record } if listed.lists(annotations) => images.raw(&record.numbered(id)),
                _ => Ok(()),
            })
        })?;
        let mut number = 0;
        file.annotations(|annotations| {
            for_each_line(cx.dataset, finish, |image, line| match line {
                Line::Annotation(record) => {
                    number += 1;
                    annotations.raw(&record.numbered(number, image))
                }
                _ => Ok(()),
            })
        })?;
        file.finish()
    })
}

/// What the dataset is, without dates: files do not depend on the clock.
pub fn info(dataset: &DatasetInfo) -> Info {
    Info { description: dataset.name.clone(), contributor: dataset.program.clone(), ..Info::default() }
}

/// The one license of all images.
pub fn license() -> License {
    License { id: 1, name: "licenses of the assets".into(), ..License::default() }
}
