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
mod relief;
mod scheme;
mod sheet;
mod text;
mod typeface;
mod words;

pub use book::{book, magazine};
pub use carton::{UvRect, WrapKind, carton, wrapped};
pub use decor::{ball, bands, remote, skin};
pub use label::{LabelKind, label};
pub use sheet::PrintedSheet;
