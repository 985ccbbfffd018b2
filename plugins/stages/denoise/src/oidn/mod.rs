//! `oidn`: Open Image Denoise, if the user has it.

mod library;

use library::{Device, Job};
use parking_lot::Mutex;
use std::path::{Path, PathBuf};
use syntable_model::photometry::luminance;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DENOISE_ALBEDO, DENOISE_NORMAL, DENOISER, RADIANCE, RADIANCE_NOISY};

/// Time against quality, as Open Image Denoise has it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Smallest network. Versions before 2.3 take `balanced` instead.
    Fast,
    /// A smaller network.
    Balanced,
    /// The largest network.
    #[default]
    High,
}

impl Quality {
    fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::High => "high",
        }
    }

    /// `OIDNQuality` of the library's version.
    fn code(self, device: &Device) -> i32 {
        match self {
            Self::Fast if device.at_least(2, 3) => 4,
            Self::Fast | Self::Balanced => 5,
            Self::High => 6,
        }
    }
}

/// Open Image Denoise: a neural network for path-traced images, from a library that is loaded while the program runs.
/// It is not part of this program: `pip install pyoidn` or the archives of its releases have it. Versions from 1.4 are
/// understood. It runs on the processor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Oidn {
    /// The library: `libOpenImageDenoise.so.2`, `OpenImageDenoise.dll` or `libOpenImageDenoise.dylib`, with its path. Without
    /// it, the one that the environment variable `OIDN_LIBRARY` names, or else the one that the system has installed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "library"))]
    library: Option<AssetPath>,
    /// Time against quality. Versions before 2.0 have `high` only.
    #[serde(default)]
    quality: Quality,
    /// Whether to trust albedo and normals as free of noise, which keeps more detail. Switch it off where much is out of
    /// focus.
    #[serde(default = "yes")]
    clean_guides: bool,
}

fn yes() -> bool {
    true
}

impl Config for Oidn {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "oidn";
    const EXAMPLE: &'static str = "library = \"${OIDN_LIBRARY}\"\nquality = \"high\"";
    fn build(self) -> Result<Box<dyn Denoiser>, ConfigError> {
        let library = self.library.as_ref().map(|library| Library::Named(library.path().to_owned()));
        let library = library.unwrap_or_else(Library::of_machine);
        Ok(Box::new(OidnDenoiser { options: self, library, device: Mutex::new(None) }))
    }
}

/// Environment variable that names the library.
const VARIABLE: &str = "OIDN_LIBRARY";

/// Names by which the system's loader finds an installed library.
const INSTALLED: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// Location of the library.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Library {
    /// A file that the user named.
    Named(PathBuf),
    /// An installed library that the system's loader finds under one of these names.
    Installed(Vec<&'static str>),
}

impl Library {
    /// The library of this machine: the file that the environment variable names, or else an installed library.
    pub(crate) fn of_machine() -> Self {
        match std::env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
            Some(path) => Self::Named(path.into()),
            None => Self::Installed(INSTALLED.to_vec()),
        }
    }

    /// Opens a device with `threads` threads.
    fn open(&self, threads: usize) -> Result<Device> {
        match self {
            Self::Named(path) => Device::open(path, threads).map_err(|error| self.blamed(error).help(ADVICE)),
            Self::Installed(names) => {
                let mut reasons = Vec::new();
                for name in names {
                    match Device::open(Path::new(name), threads) {
                        Ok(device) => return Ok(device),
                        Err(error) => reasons.push(error.message().to_owned()),
                    }
                }
                let message = format!("open image denoise is not installed here: {}", reasons.join("; "));
                Err(Error::new(message).help(ADVICE))
            }
        }
    }

    /// The version of the library, which must open.
    pub(crate) fn version(&self) -> Result<String> {
        self.open(1).map(|device| device.version())
    }

    /// Adds the name of the file to an error.
    fn blamed(&self, error: Error) -> Error {
        match self {
            Self::Named(path) => error.in_file(path),
            Self::Installed(_) => error,
        }
    }
}

/// The denoiser of [`Oidn`]: one device, opened for the first image.
struct OidnDenoiser {
    options: Oidn,
    library: Library,
    device: Mutex<Option<Device>>,
}

impl Denoiser for OidnDenoiser {
    fn reads(&self) -> Vec<KeyId> {
        reads()
    }

    fn found(&self) -> Result<()> {
        let Library::Named(library) = &self.library else { return Ok(()) };
        match std::fs::metadata(library) {
            Ok(found) if found.is_file() => Ok(()),
            Ok(_) => Err(Error::new("it is not a file").in_file(library).help(ADVICE)),
            Err(error) => Err(Error::io(library, &error).help(ADVICE)),
        }
    }

    fn ready(&self) -> Result<()> {
        self.library.open(1).map(drop)
    }

    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let Oidn { quality, clean_guides, .. } = &self.options;
        let mut radiance = products.get(RADIANCE_NOISY)?.map(|pixel| pixel.map(finite));
        let mut albedo = products.get(DENOISE_ALBEDO)?.map(|pixel| pixel.map(|x| finite(x).min(1.0)));
        let mut normal = products.get(DENOISE_NORMAL)?.map(|pixel| pixel.map(|x| if x.is_finite() { x } else { 0.0 }));
        let scale = 1.0 / white(radiance.data());
        let mut held = self.device.lock();
        let device = match &mut *held {
            Some(device) => device,
            none => none.insert(self.library.open(cx.workers.threads())?),
        };
        let code = quality.code(device);
        let (width, height) = (radiance.width() as usize, radiance.height() as usize);
        let job = Job {
            width,
            height,
            color: radiance.data_mut(),
            albedo: albedo.data_mut(),
            normal: normal.data_mut(),
            clean_guides: *clean_guides,
            quality: code,
            scale,
        };
        device.filter(job).map_err(|error| self.library.blamed(error))?;
        let quality = if device.at_least(2, 0) { *quality } else { Quality::High };
        let report = Value::record([
            ("name", Oidn::KIND.into()),
            ("version", device.version().into()),
            ("quality", quality.name().into()),
            ("clean_guides", (*clean_guides).into()),
        ]);
        products.put(RADIANCE, radiance)?;
        products.put(DENOISER, report)
    }
}

/// Products that the denoiser reads.
pub(crate) fn reads() -> Vec<KeyId> {
    keys![RADIANCE_NOISY, DENOISE_ALBEDO, DENOISE_NORMAL]
}

/// Help for errors: sources of a library.
const ADVICE: &str = "`library`, or the environment variable `OIDN_LIBRARY`, must name Open Image Denoise for this system: `pip install pyoidn` puts one into \
                      site-packages/pyoidn/oidn/lib, and the archives of its releases have one in lib; or denoise with \
                      `kind = \"guided\"`";

/// A valid amount of light: 0 for negative and non-finite numbers.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x.max(0.0) } else { 0.0 }
}

/// The radiance that counts as white: about five times the log-average, as with a light meter. It depends only on the
/// image, which the library's own exposure need not.
fn white(pixels: &[[f32; 3]]) -> f32 {
    let luminance = |c: &[f32; 3]| luminance(c.map(f64::from));
    let lit = pixels.iter().map(luminance).filter(|l| *l > 0.0);
    let (sum, count) = lit.fold((0.0, 0_u32), |(sum, count), l| (sum + libm::log(l), count + 1));
    if count == 0 { 1.0 } else { (5.0 * libm::exp(sum / f64::from(count))) as f32 }
}

register!(Oidn);
