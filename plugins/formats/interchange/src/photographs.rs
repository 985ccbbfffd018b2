//! Reads folders of photographs.

use std::path::Path;
use syntable_formats::decode::FileContent;
use syntable_formats::photographs::Photographs;
use syntable_formats::read::{self, Categories};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::reader::{Format, ImageSource, Note, Opened, ReadImage, Source};

syntable_model::register_format!(
    Format::new(
        "photographs",
        "A folder of JPEG and PNG photographs without labels, turned upright by their EXIF orientation.",
        is_folder_of_photographs,
        open,
    )
    .as_fallback()
);

/// Whether a folder has photographs, and the first one is readable.
fn is_folder_of_photographs(root: &Path) -> bool {
    let first = |it: Photographs| FileContent::read(it.files().first()?).ok()?.size().ok();
    root.is_dir() && Photographs::of(root).ok().and_then(first).is_some()
}

struct PhotographSource {
    root: DatasetFolder,
    names: Vec<String>,
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.folder(&source.path)?;
    let files = Photographs::of(&source.path)?;
    let name = |file: &Path| file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let names: Vec<String> = files.files().iter().map(|file| name(file)).collect();
    let refs: Vec<_> = (0..).zip(&names).map(|(number, name)| read::image((number, 0), name.clone())).collect();
    let info = Categories::default().info(read::name_of(&source.path), String::new(), &refs, String::new());
    let mut opened = Opened::new(info, refs, keys![RGB], PhotographSource { root, names });
    opened.notes.push(Note::caveat("photographs have no labels: the objects in them are unknown"));
    Ok(opened)
}

impl ImageSource for PhotographSource {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let photograph = FileContent::read(&self.root.file(&self.names[image])?)?.upright()?;
        let size = [photograph.width(), photograph.height()];
        let mut products = Products::new();
        if wants.contains(&RGB.id()) {
            products.put(RGB, photograph)?;
        }
        Ok(ReadImage::new(size, products))
    }
}
