//! Reads D2SA's layout: COCO's, with keys of its own.

use super::FILE;
use crate::coco::read::{FOLDER, open_file};
use crate::read::{json_files, name_starts, only_file};
use syntable_model::reader::Format;

syntable_model::register_format!(Format {
    name: "d2sa",
    doc: "D2S amodal (`annotations/D2S_amodal_*.json` beside `images`), as the writer `d2sa` writes it.",
    detect: |root| {
        json_files(&root.join(FOLDER)).is_ok_and(|files| files.iter().any(|file| name_starts(file, FILE)))
    },
    open: |root| open_file(root, &only_file(&root.join(FOLDER), |file| name_starts(file, FILE))?),
    crate_name: env!("CARGO_PKG_NAME"),
});
