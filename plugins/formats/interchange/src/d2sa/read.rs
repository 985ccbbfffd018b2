//! Reads D2SA's layout: COCO's, with keys of its own.

use super::FILE;
use crate::coco::open_file;
use crate::family::read::FOLDER;
use crate::read::{is_dataset, name_starts, root_and_file};
use syntable_model::reader::Format;

syntable_model::register_format!(Format::new(
    "d2sa",
    "D2S amodal (`annotations/D2S_amodal_*.json` beside `images`), as the writer `d2sa` writes it.",
    |path| is_dataset(path, Some(FOLDER), |file| name_starts(file, FILE)),
    |source| {
        let (root, file) = root_and_file(source, Some(FOLDER), |file| name_starts(file, FILE))?;
        open_file(&root, &file)
    },
));
