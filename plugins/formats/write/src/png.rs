//! PNG files of images and masks.

use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::png::PngCoding;
use syntable_formats::include::{self, Included, IncludedProducts};
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;
use syntable_model::product::{DType, Tensor};

const EXTENSION: &str = "png";

/// How to store what a depth image cannot hold.
const DEEPER: &str = "raise `depth_scale_mm`: 1 mm reaches 65.5 m, 2 mm 131 m; or write depth with npy or exr";

/// Writes images and masks as PNG files.
///
/// # Behavior
///
/// The kind of value determines how a product is stored:
///
/// | product | samples |
/// | --- | --- |
/// | 8-bit image of 1, 3 or 4 channels, such as `rgb` and `appearance` | unchanged; the fourth is opacity |
/// | 16-bit image, such as the ids of `instance` | unchanged |
/// | mask, image of booleans | 8-bit: 255 where it is set, 0 elsewhere |
/// | depth in meters | 16-bit: multiples of `depth_scale_mm`, rounded; 0 without a value |
/// | normal | 8-bit RGB preview: x right, y up, z toward the viewer; 128 is zero |
/// | linear color without a unit, such as `albedo` | 8-bit RGB preview, sRGB-encoded |
///
/// The writers `exr` and `npy` store other float images and colors in nits.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.png`, and for a product per instance
/// `{id}/{product}/{scene:06}_{view:04}_{instance:04}.png`. A product of the scene has no `_{view:04}`. If category ids
/// are included, `{id}/categories.json` has their names in COCO's form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Png {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Step of a depth image, mm. 1 mm reaches 65.5 m, 0.1 mm reaches 6.55 m. Depths beyond 65535 steps are stored as
    /// 65535; the run counts them, and ends with exit code 3.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub depth_scale_mm: f64,
    /// Whether to crop images per instance with an opacity, such as `appearance`, to the box of their pixels that are
    /// not fully transparent, at least one pixel. `appearance_box` has the position of this box in the image. By
    /// default, they have the size of the full image.
    pub crop: bool,
}

impl Default for Png {
    fn default() -> Self {
        Self { include: ["rgb"].into(), depth_scale_mm: 1.0, crop: false }
    }
}

impl Config for Png {
    type Stage = dyn Writer;
    const KIND: &'static str = "png";
    const EXAMPLE: &'static str = "include = [\"rgb\", \"depth\", \"visible_mask\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.writer())
    }
}

impl ProductWriter for Png {
    fn include(&self) -> &Included {
        &self.include
    }

    fn accepts(key: &KeyId) -> Result<(), String> {
        accepts(key, PngCoding::of)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        include::paths(of, EXTENSION, include::IMAGE_ENDS)
    }

    fn write(&self, included: &IncludedProducts) -> Result<()> {
        included.write_images(EXTENSION, |kind, value| {
            let cut = if self.crop { cropped(value) } else { None };
            let value = cut.as_ref().unwrap_or(value);
            let coding = PngCoding::of(kind).map_err(Error::new)?;
            if let Some(beyond) = coding.beyond(value, self.depth_scale_mm, DEEPER) {
                included.log.left_out(&beyond);
            }
            coding.image(value, self.depth_scale_mm)?.encode()
        })
    }
}

/// An 8-bit image with opacity, cropped to the box of its pixels that are not fully transparent; none for other kinds
/// of images.
fn cropped(value: &Value) -> Option<Value> {
    let Value::Tensor(Tensor { dtype: DType::U8, shape, bytes, .. }) = value else { return None };
    let &[height, width, 4] = &shape[..] else { return None };
    let pixels: &[[u8; 4]] = bytes.as_chunks().0;
    let seen = || (0..width * height).filter(|&at| pixels[at][3] > 0);
    let span = |place: fn(usize, usize) -> usize| {
        let places = || seen().map(|at| place(at, width));
        places().min().zip(places().max()).map_or(0..1, |(first, last)| first..last + 1)
    };
    let (columns, rows) = (span(|at, width| at % width), span(|at, width| at / width));
    let row = |y: usize| pixels[y * width..][columns.clone()].as_flattened();
    let cut: Vec<u8> = rows.clone().flat_map(row).copied().collect();
    Some(Value::Tensor(Tensor::new(DType::U8, &["y", "x", "channel"], vec![rows.len(), columns.len(), 4], cut)))
}

register!(Png);
