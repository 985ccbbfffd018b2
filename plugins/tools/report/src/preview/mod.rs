//! Renders a few views of a few scenes quickly, on one contact sheet, and again after every save.
//!
//! | module | does |
//! | --- | --- |
//! | `session` | content, file and page of a preview, and its threads |
//! | `load` | loading a recipe with the preview's changes, and the list of its files |
//! | `watch` | waiting for a save |
//! | `studio` | rendering the changes of a recipe, image by image |
//! | `choice` | scenes, views and seed that the page's user chose |
//! | `shot` | the images and objects of a view |
//! | `sheet`, `text` | the contact sheet: images with captions, and errors as text |
//! | `page` | the sheet in the browser |

mod cell;
mod choice;
mod load;
mod page;
mod session;
mod sheet;
mod shot;
mod studio;
mod watch;

pub use session::{Preview, PreviewOptions};
pub use studio::PassEnd;
