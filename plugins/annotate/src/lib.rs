//! Annotators: products made from the renderer's planes and from the scene.
//!
//! | kind | provides |
//! | --- | --- |
//! | [`masks`] | visible, amodal and occlusion masks, occlusion rate, occlusion order, label policy |
//! | [`boxes`] | visible and amodal boxes |
//! | [`label_arrays`] | visible ids, amodal bits and categories, for training loops |
//! | [`object_info`] | asset, category, mass and poses of every object |
//! | [`camera`] | intrinsics and pose of the view |
//! | [`lights`] | lights of the view |
//! | [`settle_report`] | result of the physics simulation |
//! | [`bodies`] | what the ids of the scene stand for |
//!
//! **Invariants.** An annotator is a pure function of the site and of the products that it declares to read. All label
//! products of a view cover the same instances: those that [`masks`] annotates.

pub mod bodies;
pub mod boxes;
pub mod camera;
pub mod label_arrays;
pub mod lights;
pub mod masks;
mod matrix;
pub mod object_info;
pub mod settle_report;
