//! Reads D2SA's layout, which is COCO's with additional keys.

use crate::coco::open_file;
use crate::family::find::Structure;
use syntable_model::reader::Format;

syntable_model::register_format!(
    Format::new(
        "d2sa",
        "D2S amodal (`annotations/D2S_amodal_*.json` beside `images`), as the writer `d2sa` writes it.",
        |path| Structure::D2sa.is_at(path),
        |source| {
            let (root, file) = Structure::D2sa.find(source)?;
            open_file(source, &root, &file, true)
        },
    )
    .with_image_folder()
);
