//! Prints for packages, books, balls and crockery: every variant has its own design.
//!
//! A `Design` holds what the panels of one product share: a `Scheme` of colors, three `Typeface`s, a logo and an
//! `Artwork`. `front` lays out the show side, and `facts` the small print. A `ReliefMap` adds dents and creases; a
//! [`PrintedSheet`] is the result.

mod artwork;
mod barcode;
mod book;
mod carton;
mod composed;
mod decor;
mod design;
mod facts;
mod front;
mod glyph;
mod label;
mod marks;
mod panes;
mod papers;
mod relief;
mod scheme;
mod screen;
mod sheet;
mod text;
mod typeface;
mod wall;
mod words;

pub use book::{book, magazine};
pub use carton::{UvRect, WrapKind, carton, wrapped};
pub use decor::{ball, bands, remote, skin};
pub use label::{LabelKind, label};
pub use panes::{clock_face, leaf, outdoors};
pub use papers::{notes, scribbles};
pub use screen::screen_image;
pub use sheet::PrintedSheet;
pub use wall::{WallArt, wall_art};
