//! Types of annotation files, for code that writes, merges, reads, checks or evaluates them.
//!
//! | module | holds |
//! | --- | --- |
//! | [`coco`] | COCO's instance annotations, as any tool writes them |
//! | [`syntable`] | SynTable's annotations: COCO's structure with visible, amodal and occluded masks |
//! | [`segmentation`] | masks in JSON: run lengths, compressed or not, and polygons |
//! | [`dataset`] | a whole annotation file: reading, and writing record by record |
//! | [`index`] | a whole annotation file whose records stay in the file until they are requested |
//! | [`listing`] | the images of an annotation file in order, each with its annotations |
//! | [`json`] | readable errors of the JSON parser |
//! | [`known`] | the products of linked crates, and the products that a dataset declares |
//! | [`shard`] | the records of one scene, kept until the annotation file is merged from all scenes |
//! | [`depth`] | the option for the depth that a writer stores |
//! | [`encode`] | image and array files, by kind of value |
//! | [`decode`] | image and array files, read back |
//! | [`image_file`] | files of color images, which conversions copy |
//! | [`members`] | members of tar files, read in any order |
//! | [`npz_archive`] | NumPy archives, read array by array |
//! | [`photographs`] | photographs of a folder, upright |
//! | [`draw`] | images for people: masks and outlines over images, panels side by side |
//! | [`read`] | shared code of all readers |
//! | [`record_arrays`] | products of any form as named arrays, and back |
//! | [`samples`] | datasets of products by name, read back |
//! | [`scores`] | scores of predictions, and the images with the lowest scores |
//! | [`structure`] | the structure of an annotation file, by the keys of its records |
//! | [`writer`] | writers whose scenes share the options |
//! | [`mod@include`] | the products that a generic writer includes, and their files |
//!
//! Pixel coordinates have their origin in the top left corner of the image; x points right, y points down. Boxes are
//! `[x, y, width, height]` in pixels, with `width = last column - first column + 1`.
//!
//! **Reading is tolerant.** Fields that a type does not know are kept in its `extra` and written back after the known
//! ones; inside run-length encoded masks they are dropped. Optional fields may be missing. An error names the file, the
//! line and the field, such as `annotations[4].segmentation.size`.
//!
//! **Writing is exact.** The order of fields is the order of the types' fields. Numbers are the shortest decimals that
//! read back as the same value. The same values always give the same bytes.

pub mod coco;
pub mod dataset;
pub mod decode;
pub mod depth;
pub mod draw;
pub mod encode;
pub mod image_file;
pub mod include;
pub mod index;
pub mod json;
pub mod known;
pub mod listing;
pub mod members;
pub mod npz_archive;
mod orientation;
pub mod photographs;
mod polygon;
pub mod read;
pub mod record_arrays;
pub mod samples;
pub mod scores;
pub mod segmentation;
pub mod shard;
pub mod structure;
pub mod syntable;
pub mod unkept;
mod window;
pub mod writer;

/// Fields that a type does not know, in the order of the file.
pub type Extra = serde_json::Map<String, serde_json::Value>;
