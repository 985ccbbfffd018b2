//! The records of one scene.
//!
//! A run writes the images and annotations of each scene to a shard of its own, and merges all shards at the end.
//! A shard has a line `["image", annotations, record]` for every view in order, followed by that many lines
//! `["annotation", record]`, and at the end a line `["scene", record]`. Ids of images and annotations are 0 until the merge
//! gives them: they depend on the whole dataset, which may grow. Merging copies the rest of the records as text: memory is
//! bounded by one line.

use serde::Serialize;
use syntable_model::error::{Error, Result};

/// How an image's record starts before it has its id.
const IMAGE: &str = "{\"id\":0,";
/// How an annotation's record starts before it has its id and that of its image.
const ANNOTATION: &str = "{\"id\":0,\"image_id\":0,";

/// Appends the line of an image that `annotations` lines of annotations follow. Its `id` must be the first field, and 0.
pub fn push_image(shard: &mut Vec<u8>, annotations: usize, image: &impl Serialize) -> Result<()> {
    push(shard, &("image", annotations, image))
}

/// Appends the line of an annotation. Its `id` and `image_id` must be the first fields, and 0.
pub fn push_annotation(shard: &mut Vec<u8>, annotation: &impl Serialize) -> Result<()> {
    push(shard, &("annotation", annotation))
}

/// Appends the line of the scene itself.
pub fn push_scene(shard: &mut Vec<u8>, scene: &impl Serialize) -> Result<()> {
    push(shard, &("scene", scene))
}

fn push(shard: &mut Vec<u8>, line: &impl Serialize) -> Result<()> {
    serde_json::to_writer(&mut *shard, line)
        .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?;
    shard.push(b'\n');
    Ok(())
}

/// A line of a shard, without its line break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line<'a> {
    /// An image.
    Image {
        /// Number of lines of annotations that follow.
        annotations: usize,
        /// The image's record.
        record: UnnumberedImage<'a>,
    },
    /// An annotation.
    Annotation(UnnumberedAnnotation<'a>),
    /// The record of the scene.
    Scene(&'a str),
}

/// The record of an image without its id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnnumberedImage<'a> {
    rest: &'a str,
}

/// The record of an annotation without its id and that of its image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnnumberedAnnotation<'a> {
    rest: &'a str,
}

impl<'a> Line<'a> {
    /// Reads a line; none if it is not one of a shard. The records' own content is not looked at.
    pub fn parse(line: &'a str) -> Option<Self> {
        let body = line.strip_prefix('[')?.strip_suffix(']')?;
        if let Some(rest) = body.strip_prefix("\"image\",") {
            let (annotations, record) = rest.split_once(',')?;
            let record = UnnumberedImage { rest: record.strip_prefix(IMAGE)? };
            Some(Self::Image { annotations: annotations.parse().ok()?, record })
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
    /// The record with its id and that of its image.
    pub fn numbered(&self, id: u64, image_id: u64) -> String {
        format!("{{\"id\":{id},\"image_id\":{image_id},{}", self.rest)
    }
}
