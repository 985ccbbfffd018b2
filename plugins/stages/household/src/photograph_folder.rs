//! A folder of photographs that prints show.

use crate::material::Photograph;
use std::path::Path;
use std::sync::OnceLock;
use syntable_formats::decode::FileContent;
use syntable_formats::photographs::Photographs;
use syntable_mesh::image::MAX_SIDE;
use syntable_mesh::root::AssetRoot;
use syntable_model::prelude::*;

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

    /// The photographs, upright, in the order of their names. The first call reads them; it warns of every file that it skips.
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
        let found = Photographs::of(path.path()).map_err(|error| error.help(remedy))?;
        let step = found.files().len().div_ceil(MOST).max(1);
        let mut read = Vec::new();
        for file in found.files().iter().step_by(step) {
            match self.photograph(path.path(), file) {
                Ok(photograph) => read.push(photograph),
                Err(error) if error.is_transient() => return Err(error),
                Err(error) => log.warn(&error.with_consequence("skipping this photograph")),
            }
        }
        if read.is_empty() {
            return Err(Error::new("no readable photograph in the folder").in_file(path.path()).help(remedy));
        }
        Ok(read)
    }

    /// Reads a file of a folder within the limits of one asset.
    fn photograph(&self, folder: &Path, file: &Path) -> Result<Photograph> {
        let root = AssetRoot::open(folder)?.within(self.limits);
        let file = root.locate(file.file_name().unwrap_or_default().as_ref())?;
        let content = FileContent::new(root.read(&file)?, file);
        let [width, height] = content.size()?.map(u64::from);
        root.budget().image(width, height, MAX_SIDE).map_err(|error| content.located(error))?;
        Ok(Photograph::of(&content.upright()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::de::IntoDeserializer;
    use serde::de::value::{Error, StrDeserializer};
    use syntable_formats::encode::jpeg;
    use syntable_model::context::Collected;
    use syntable_model::product::Plane;

    #[test]
    fn photographs_are_upright() {
        let folder = tempfile::tempdir().expect("a folder");
        // The camera was turned by a quarter: the top of the scene is at the left of the stored image.
        let stored = Plane::from_fn(64, 32, |x, _| if x < 32 { [255; 3] } else { [0; 3] });
        let file = jpeg::encode(&stored, 95).expect("an image");
        let exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
        let segment = [&b"\xff\xe1\0"[..], &[8 + exif.len() as u8], b"Exif\0\0", exif].concat();
        let turned = [&file[..2], &segment, &file[2..]].concat();
        std::fs::write(folder.path().join("a.jpg"), turned).expect("written");
        let path = folder.path().to_str().expect("text").into_deserializer();
        let path = AssetPath::deserialize::<StrDeserializer<Error>>(path).expect("a path");
        let read = PhotographFolder::new(Some(path));
        let photographs = read.photographs(&Collected::default()).expect("readable");
        let [photograph] = photographs else { panic!("one photograph") };
        assert_eq!(photograph.aspect(), 0.5);
        assert!(photograph.sample(0.5, 0.1)[0] > 0.9 && photograph.sample(0.5, 0.9)[0] < 0.1);
    }
}
