//! Annotators: products made from the renderer's planes and from the scene.
//!
//! | kind | provides |
//! | --- | --- |
//! | [`masks`] | visible, amodal and occlusion masks, occlusion rate, occlusion order, label policy |
//! | [`occlusion_graph`] | who occludes whom as a graph: layers, components, cycles, order from front to back |
//! | [`boxes`] | visible and amodal boxes |
//! | [`rotated_boxes`] | rotated boxes of both |
//! | [`outlines`] | polygons around both |
//! | [`cuboids`] | boxes in space, and their projections |
//! | [`label_arrays`] | visible ids, amodal bits and categories, for training loops |
//! | [`object_info`] | asset, category, mass and poses of every object |
//! | [`camera`] | intrinsics and pose of the view |
//! | [`lights`] | lights of the view |
//! | [`settle_report`] | result of the physics simulation |
//! | [`bodies`] | what the ids of the scene stand for |
//! | [`visibility`] | how much of every object the image shows, and what lies beyond its edges |
//!
//! **Invariants.** An annotator is a pure function of the site and of the products that it declares to read. All label
//! products of a view cover the same instances: those that [`masks`] annotates.

pub mod bodies;
pub mod boxes;
pub mod camera;
pub mod cuboids;
mod extent;
pub mod label_arrays;
pub mod lights;
pub mod masks;
mod matrix;
pub mod object_info;
pub mod occlusion_graph;
pub mod outlines;
pub mod rotated_boxes;
pub mod settle_report;
pub mod visibility;
