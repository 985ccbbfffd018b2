//! Formats of other datasets, one folder each, that training and evaluation code reads.
//!
//! | kind | writes |
//! | --- | --- |
//! | [`bop`] | BOP scenewise: poses, masks and depth of objects |
//! | [`coco`] | COCO detection: one annotation file, with amodal or visible masks |
//!
//! Writers here read products alone, never the bodies of the scene, so that what a reader of another format offers can be
//! written as well. Pixel coordinates have their origin in the top left corner of the image.

pub mod bop;
pub mod coco;
mod labels;
