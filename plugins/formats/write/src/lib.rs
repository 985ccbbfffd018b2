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
//! Generic writers write to a folder named after the writer's id in the recipe, as `{product}/{scene:06}_{view:04}`,
//! counted from 0. They know no product by name: [`syntable_formats::encode`] decides by the kind of value whether a
//! file format can store it.
//!
//! **Invariants.** Files depend on the products only: not on the clock, the machine or the order of scenes. Files that
//! cover many scenes are streamed line by line from the scenes' shards, so memory does not grow with the dataset.

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
