//! Writers: products become files.
//!
//! | kind | writes |
//! | --- | --- |
//! | [`syntable`] | SynTable's layout: images, depth, occlusion order, one annotation file |
//! | [`png`] | integer images, masks, depth |
//! | [`exr`] | float images |
//! | [`npy`] | numeric arrays |
//! | [`npz`] | numeric arrays, one file per view |
//! | [`ply`] | point clouds of the views |
//! | [`jsonl`] | any product, one line per view or scene |
//! | [`template`] | any text, from a Tera template |
//! | [`gltf`] | the scene with materials, cameras and lights, for Blender and others |
//! | [`webdataset`] | tar files of samples, with any product |
//! | [`contact_sheet`] | images, masks and occlusion side by side |
//!
//! Generic writers put their files into a folder named after the writer's id in the recipe, as
//! `{product}/{scene:06}_{view:04}`, counted from 0. They know no product by name: [`syntable_formats::encode`] decides by kind of value
//! what a file can hold.
//!
//! **Invariants.** Files depend on the products alone: no clock, no machine, no order of scenes. Files that cover many
//! scenes are streamed line by line from the scenes' shards, so that memory does not grow with the dataset.

pub mod contact_sheet;
pub mod exr;
pub mod gltf;
pub mod jsonl;
pub mod npy;
pub mod npz;
pub mod ply;
pub mod png;
pub mod syntable;
pub mod template;
pub mod webdataset;
