//! Masks in JSON, as COCO encodes them.

use crate::{json, polygon};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value as Json;
use serde_json::value::RawValue;
use syntable_model::error::{Error, Result};
use syntable_model::limits::{IMAGE_PIXELS, OUTLINE_STEPS};
use syntable_model::product::Mask;

/// A mask as compressed run lengths. The runs go down the columns and start with the number of unset pixels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rle {
    /// `[height, width]` of the image, px.
    pub size: [u32; 2],
    /// The run lengths in COCO's alphabet.
    pub counts: String,
    /// Number of set pixels, as SynTable 1 writes it. Its value in the amodal mask is not an area; see
    /// [`syntable_1`](crate::syntable::syntable_1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<u64>,
}

impl Rle {
    /// Encodes a mask, without its area.
    pub fn encode(mask: &Mask) -> Self {
        Self { size: [mask.height(), mask.width()], counts: mask.to_coco(), area: None }
    }

    /// Decodes the mask. Fails if the run lengths are damaged or do not add up to the size.
    pub fn decode(&self) -> Result<Mask> {
        let [width, height] = checked(self.size)?;
        Mask::from_coco(width, height, &self.counts)
    }
}

/// A mask as a list of run lengths, in the same order as [`Rle`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UncompressedRle {
    /// `[height, width]` of the image, px.
    pub size: [u32; 2],
    /// Numbers of unset and set pixels in turn, starting with unset ones.
    pub counts: Vec<u32>,
}

impl UncompressedRle {
    /// Encodes a mask.
    pub fn encode(mask: &Mask) -> Self {
        Self { size: [mask.height(), mask.width()], counts: mask.counts().to_vec() }
    }

    /// Decodes the mask. Fails if the run lengths do not add up to the size.
    pub fn decode(&self) -> Result<Mask> {
        let [width, height] = checked(self.size)?;
        Mask::from_counts(width, height, &self.counts)
    }
}

/// Any of COCO's encodings of a mask.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Segmentation {
    /// Compressed run lengths.
    Rle(Rle),
    /// A list of run lengths.
    Uncompressed(UncompressedRle),
    /// Outlines `[x0, y0, x1, y1, …]` in pixels; the mask is their union.
    Polygons(Vec<Vec<f64>>),
}

impl Segmentation {
    /// Decodes the mask of an image of `width` × `height` pixels, with the same pixels as pycocotools. Fails if the
    /// encoding is damaged or belongs to an image of another size.
    pub fn decode(&self, width: u32, height: u32) -> Result<Mask> {
        let mask = match self {
            Self::Rle(rle) => rle.decode()?,
            Self::Uncompressed(rle) => rle.decode()?,
            Self::Polygons(outlines) => {
                checked([height, width])?;
                OUTLINE_STEPS
                    .check(outlines.iter().map(|outline| polygon::steps(outline)).fold(0, u64::saturating_add))?;
                let masks = outlines.iter().map(|outline| polygon::rasterize(outline, width, height));
                union(masks.collect::<Result<_>>()?).unwrap_or_else(|| Mask::empty(width, height))
            }
        };
        if (mask.width(), mask.height()) == (width, height) {
            Ok(mask)
        } else {
            let size = format!("[{}, {}]", mask.height(), mask.width());
            Err(Error::new(format!("the mask has the size {size}, its image [{height}, {width}]")))
        }
    }

    /// Reads the text of a mask without faults; none if it has one, which [`Deserialize`] explains.
    pub fn of_text(text: &str) -> Option<Self> {
        match text.as_bytes().first()? {
            b'[' => serde_json::from_str(text).ok().map(Self::Polygons),
            _ => {
                let runs = serde_json::from_str(text).ok().map(Self::Rle);
                runs.or_else(|| serde_json::from_str(text).ok().map(Self::Uncompressed))
            }
        }
    }
}

// Errors of derived untagged enums do not name the faulty field.
impl<'de> Deserialize<'de> for Segmentation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Box::<RawValue>::deserialize(deserializer)?;
        if let Some(read) = Self::of_text(text.get()) {
            return Ok(read);
        }
        let value = json::tree(&text)?;
        let read = match &value {
            Json::Array(_) => serde_json::from_value(value).map(Self::Polygons),
            Json::Object(fields) => match fields.get("counts") {
                Some(Json::String(_)) => serde_json::from_value(value).map(Self::Rle),
                Some(Json::Array(_)) => serde_json::from_value(value).map(Self::Uncompressed),
                _ => return Err(D::Error::custom("`counts` is neither a string nor a list of numbers")),
            },
            _ => return Err(D::Error::custom("neither run lengths nor polygons")),
        };
        read.map_err(|error| D::Error::custom(error.to_string()))
    }
}

/// A size as `[width, height]`, if an image may have it.
fn checked([height, width]: [u32; 2]) -> Result<[u32; 2]> {
    IMAGE_PIXELS.check_size([width, height])?;
    Ok([width, height])
}

/// The union of masks of one size; none without a mask. Joins neighbors first, so that the number of times that each
/// run is processed is only logarithmic in the number of masks.
pub fn union(mut masks: Vec<Mask>) -> Option<Mask> {
    while masks.len() > 1 {
        let joined = masks.chunks(2).map(|pair| match pair {
            [one, other] => one.or(other),
            _ => pair[0].clone(),
        });
        masks = joined.collect();
    }
    masks.pop()
}
