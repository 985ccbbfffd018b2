//! A few views of a few scenes, fast, on one contact sheet, and again after every save.
//!
//! | module | does |
//! | --- | --- |
//! | `session` | what a preview shows and where, and who runs beside whom |
//! | `load` | loading a recipe as a preview wants it, and which files it was made of |
//! | `watch` | waiting for a save |
//! | `studio` | making what a recipe changes, image by image |
//! | `sheet`, `text` | the contact sheet: images with captions, and mistakes in words |
//! | `page` | the sheet in the browser |

mod load;
mod page;
mod session;
mod sheet;
mod studio;
mod text;
mod watch;

pub use session::{Preview, PreviewOptions};
pub use studio::PassEnd;
