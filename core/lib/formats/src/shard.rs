//! The records of one scene.
//!
//! A run writes the images and annotations of each scene to its own shard, and merges all shards at the end. A shard
//! has a line `["image", annotations, record]` for every view in order, followed by `annotations` lines `["annotation",
//! record]`, and at the end a line `["scene", record]`. Other data of a view is in a line `["view", record]` after its
//! annotations. Ids of images and annotations are 0 until the merge sets them, because they depend on the whole
//! dataset, which may grow. Merging copies the rest of the records as text, so it holds only one line in memory.

use crate::dataset::DatasetWriter;
use crate::encode::json_shard;
use serde::Serialize;
use syntable_model::error::{Error, Result};
use syntable_model::stage::{DatasetInfo, Finish};

/// Start of an image's record without an id.
const IMAGE: &str = "{\"id\":0,";
/// Start of an annotation's record without its id and its image's id.
const ANNOTATION: &str = "{\"id\":0,\"image_id\":0,";

/// Appends the line of an image, which must be followed by `annotations` lines of annotations. Its `id` must be the
/// first field, and 0.
pub fn push_image(shard: &mut Vec<u8>, annotations: usize, image: &impl Serialize) -> Result<()> {
    json_shard::push_line(shard, &("image", annotations, image))
}

/// Appends the line of an annotation. Its `id` and `image_id` must be the first fields, and 0.
pub fn push_annotation(shard: &mut Vec<u8>, annotation: &impl Serialize) -> Result<()> {
    json_shard::push_line(shard, &("annotation", annotation))
}

/// Appends a line with other data of a view.
pub fn push_view(shard: &mut Vec<u8>, view: &impl Serialize) -> Result<()> {
    json_shard::push_line(shard, &("view", view))
}

/// Appends the line of the scene itself.
pub fn push_scene(shard: &mut Vec<u8>, scene: &impl Serialize) -> Result<()> {
    json_shard::push_line(shard, &("scene", scene))
}

/// A line of a shard, without its line break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShardLine<'a> {
    /// An image.
    Image {
        /// Number of lines of annotations that follow.
        annotations: usize,
        /// The image's record.
        record: UnnumberedImage<'a>,
    },
    /// An annotation.
    Annotation(UnnumberedAnnotation<'a>),
    /// A record of the view.
    View(&'a str),
    /// The record of the scene.
    Scene(&'a str),
}

/// The record of an image without its id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnnumberedImage<'a> {
    rest: &'a str,
}

/// The record of an annotation without its id and its image's id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnnumberedAnnotation<'a> {
    rest: &'a str,
}

impl<'a> ShardLine<'a> {
    /// Parses a line; none if it is not a line of a shard. Does not parse the content of the records.
    pub fn parse(line: &'a str) -> Option<Self> {
        let body = line.strip_prefix('[')?.strip_suffix(']')?;
        if let Some(rest) = body.strip_prefix("\"image\",") {
            let (annotations, record) = rest.split_once(',')?;
            let record = UnnumberedImage { rest: record.strip_prefix(IMAGE)? };
            Some(Self::Image { annotations: annotations.parse().ok()?, record })
        } else if let Some(record) = body.strip_prefix("\"view\",") {
            Some(Self::View(record))
        } else if let Some(record) = body.strip_prefix("\"scene\",") {
            Some(Self::Scene(record))
        } else {
            let record = body.strip_prefix("\"annotation\",")?;
            Some(Self::Annotation(UnnumberedAnnotation { rest: record.strip_prefix(ANNOTATION)? }))
        }
    }
}

impl UnnumberedImage<'_> {
    /// The record with its id.
    pub fn numbered(&self, id: u64) -> String {
        format!("{{\"id\":{id},{}", self.rest)
    }
}

impl UnnumberedAnnotation<'_> {
    /// The record with its id and its image's id.
    pub fn numbered(&self, id: u64, image_id: u64) -> String {
        format!("{{\"id\":{id},\"image_id\":{image_id},{}", self.rest)
    }
}

/// Calls `each` with the image id and the text of every line of the shards.
///
/// Image ids are set here and not when a scene is written, because the number of views per scene grows with the
/// dataset. A scene never has more views than the current recipe of the dataset.
pub fn for_each_line(
    dataset: &DatasetInfo,
    finish: &Finish,
    mut each: impl FnMut(u64, ShardLine) -> Result<()>,
) -> Result<()> {
    let views_per_scene = u64::from(dataset.views_per_scene);
    let (mut of, mut views, mut image_id) = (None, 0, 0);
    json_shard::for_each_line(finish, |scene, line| {
        let damaged = |what: String| {
            Error::new(format!("the shard of scene {} has {what}", scene.0)).help(
                "the dataset is damaged, or of another version; a run with `options.repair` makes the scene again",
            )
        };
        let line = ShardLine::parse(line).ok_or_else(|| damaged("a line that is not a record".to_owned()))?;
        if of.replace(scene) != Some(scene) {
            (views, image_id) = (0, 0);
        }
        if let ShardLine::Image { .. } = line {
            if views == views_per_scene {
                return Err(damaged(format!("more than the {views_per_scene} views per scene of the recipe")));
            }
            views += 1;
            image_id = u64::from(scene.0) * views_per_scene + views;
        }
        each(image_id, line)
    })
}

/// Merges the shards of all scenes into the images and the annotations of a file. `copies` returns the number of times
/// that the file lists an image, given its number of annotations.
///
/// # Errors
/// If a shard is damaged, or the file cannot be written.
pub fn merge(
    dataset: &DatasetInfo,
    finish: &Finish,
    file: &mut DatasetWriter,
    copies: impl Fn(usize) -> usize,
) -> Result<()> {
    file.images(|images| {
        for_each_line(dataset, finish, |id, line| match line {
            ShardLine::Image { annotations, record } => {
                (0..copies(annotations)).try_for_each(|_| images.raw(&record.numbered(id)))
            }
            _ => Ok(()),
        })
    })?;
    let mut id = 0;
    file.annotations(|annotations| {
        for_each_line(dataset, finish, |image_id, line| match line {
            ShardLine::Annotation(record) => {
                id += 1;
                annotations.raw(&record.numbered(id, image_id))
            }
            _ => Ok(()),
        })
    })
}
