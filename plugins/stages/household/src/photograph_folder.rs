//! A folder of photographs that prints show.

use crate::material::Photograph;
use std::sync::OnceLock;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::scan::{extension, list};
use syntable_model::prelude::*;

/// Extensions of photographs.
const EXTENSIONS: [&str; 3] = ["jpeg", "jpg", "png"];

/// Most photographs that are read; of a larger folder, evenly spaced ones.
const MOST: usize = 128;

/// The photographs of a folder, read once.
#[derive(Default)]
pub struct PhotographFolder {
    path: Option<AssetPath>,
    limits: AssetLimits,
    read: OnceLock<Vec<Photograph>>,
}

impl PhotographFolder {
    /// The photographs of a folder, or none without one.
    pub fn new(path: Option<AssetPath>) -> Self {
        Self { path, ..Self::default() }
    }

    /// Sets the limits of each photograph.
    pub fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    /// Whether a folder is set.
    pub fn is_set(&self) -> bool {
        self.path.is_some()
    }

    /// The photographs in order of their names. The first call reads them; it warns of every file that it skips.
    pub fn photographs(&self, log: &dyn Log) -> Result<&[Photograph]> {
        if let Some(read) = self.read.get() {
            return Ok(read);
        }
        let read = self.read(log)?;
        Ok(self.read.get_or_init(|| read))
    }

    fn read(&self, log: &dyn Log) -> Result<Vec<Photograph>> {
        let Some(path) = &self.path else { return Ok(Vec::new()) };
        let remedy = "set `photographs` to a folder with JPEG or PNG files, or leave it out";
        let root = AssetRoot::open(path.path()).map_err(|error| error.help(remedy))?;
        let mut names = list(root.folder())?.files;
        names.retain(|name| EXTENSIONS.contains(&&*extension(name.as_ref())));
        let step = names.len().div_ceil(MOST).max(1);
        let mut read = Vec::new();
        for name in names.iter().step_by(step) {
            // Each has the limits of one asset.
            let root = AssetRoot::open(path.path())?.within(self.limits);
            let decoded = root.locate(name.as_ref()).and_then(|file| DecodedImage::read(&root, &file));
            match decoded {
                Ok(image) => {
                    read.push(Photograph::of_rgba(image.width as usize, image.height as usize, &image.texels));
                }
                Err(error) if error.is_transient() => return Err(error),
                Err(error) => log.warn(&error.with_consequence("skipping this photograph")),
            }
        }
        if read.is_empty() {
            return Err(Error::new("no readable photograph in the folder").in_file(path.path()).help(remedy));
        }
        Ok(read)
    }
}
