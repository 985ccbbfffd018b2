//! Files of the color image `rgb`.

use super::jpeg;
use super::png::PngImage;
use syntable_model::prelude::*;

/// Files of the product `rgb`. Labels and depth are always stored without loss.
///
/// JPEG files take a fifth to a tenth of the space of PNG files, and load faster. Their chroma is not subsampled (4:4:4),
/// so that the colors of small objects end at their masks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RgbFiles {
    /// Format of the files.
    pub format: RgbFormat,
    /// Quality of JPEG files on the scale of libjpeg. Default: 95.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = jpeg::QUALITY[0], max = jpeg::QUALITY[1]))]
    pub quality: Option<u8>,
}

/// Format of color images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RgbFormat {
    /// 8-bit PNG, without loss.
    #[default]
    Png,
    /// Baseline JPEG.
    Jpeg,
}

impl RgbFormat {
    /// All formats.
    pub const ALL: [Self; 2] = [Self::Png, Self::Jpeg];

    /// Its name in options and in the product `rgb_file`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpeg",
        }
    }

    /// Extension of the files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpg",
        }
    }
}

/// Quality of JPEG files unless the recipe states it.
const DEFAULT_QUALITY: u8 = 95;

impl RgbFiles {
    /// Whether the options are the default ones, which a recipe omits.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks the options.
    ///
    /// # Errors
    /// If the files are PNG files and have a quality, or the quality is out of range.
    pub fn check(self) -> Result<(), ConfigError> {
        let [min, max] = jpeg::QUALITY;
        match (self.format, self.quality) {
            (RgbFormat::Png, Some(quality)) => {
                Err(ConfigError::new("rgb.quality", format!("PNG files have no quality, and it is {quality}"))
                    .help("add `format = \"jpeg\"`, or leave `quality` out"))
            }
            (RgbFormat::Jpeg, Some(quality)) if !(min..=max).contains(&quality) => {
                Err(ConfigError::new("rgb.quality", format!("{quality} is not between {min} and {max}")))
            }
            _ => Ok(()),
        }
    }

    /// Extension of the files.
    pub fn extension(self) -> &'static str {
        self.format.extension()
    }

    /// Name of the file with a stem.
    pub fn file_name(self, stem: &str) -> String {
        format!("{stem}.{}", self.extension())
    }

    /// The bytes of a file.
    ///
    /// # Errors
    /// If the image is too large for the format.
    pub fn encode(self, rgb: &Plane<[u8; 3]>) -> Result<Vec<u8>> {
        match self.format {
            RgbFormat::Png => PngImage::rgb(rgb).encode(),
            RgbFormat::Jpeg => jpeg::encode(rgb, self.quality.unwrap_or(DEFAULT_QUALITY)),
        }
    }

    /// Writes a file at a path relative to the dataset, which has the [extension](Self::extension).
    ///
    /// # Errors
    /// If the image is too large for the format, or the file cannot be written.
    pub fn write(self, rgb: &Plane<[u8; 3]>, output: &Output, path: &str) -> Result<()> {
        output.write(path, &self.encode(rgb)?)
    }
}
