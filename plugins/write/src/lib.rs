//! Writers: products become files.
//!
//! | kind | writes |
//! | --- | --- |
//! | [`syntable`] | SynTable's layout: pictures, depth, occlusion order, one annotation file |
//! | [`png`] | any picture or mask |
//! | [`npy`] | any array |
//! | [`jsonl`] | any product, a line per view or scene |
//! | [`template`] | any text, by a Tera template |
//! | [`gltf`] | the scene with materials, cameras and lights, for Blender and others |
//! | [`contact_sheet`] | pictures, masks and occlusion side by side, to look at |
//!
//! Generic writers put their files into a folder named as the writer's id in the recipe and name them
//! `{product}/{scene:06}_{view:04}`, counted from 0.
//!
//! **Invariants.** Files depend on the products alone: no clock, no machine, no order of scenes. What speaks of many
//! scenes is streamed line by line from the scenes' shards, so that memory does not grow with the dataset.

pub mod contact_sheet;
pub mod files;
pub mod gltf;
pub mod jsonl;
pub mod npy;
pub mod png;
pub mod syntable;
pub mod template;
