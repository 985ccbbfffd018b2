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
//! | [`label_arrays`] | visible ids and amodal bits, for training loops |
//! | [`identity`] | names of assets, ids of categories |
//! | [`object_info`] | asset, category, mass and poses of every object |
//! | [`object_models`] | triangle meshes of the assets |
//! | [`camera`] | intrinsics and pose of the view |
//! | [`lights`] | lights of the view |
//! | [`settle_report`] | result of the physics simulation |
//! | [`bodies`] | what the ids of the scene stand for |
//! | [`depth_relations`] | who hides how many pixels of whom, and objects from front to back |
//! | [`amodal_depth`] | depth of every object, hidden parts included |
//! | [`amodal_normal`] | normals of every object, hidden parts included |
//! | [`object_coordinates`] | normalized object coordinates, of what is seen and of what is hidden |
//! | [`occlusion_boundary`] | edges where a body ends before another, and which side is in front |
//! | [`distance`] | distance from the camera |
//! | [`scene_masks`] | table, background, categories |
//! | [`seen_in_views`] | in which views of the scene an object is seen |
//! | [`soft_masks`] | parts of pixels that objects cover, seen or hidden |
//! | [`keypoints`] | named points of objects in the image |
//! | [`optical_flow`] | where the points of an image are in the next view |
//! | [`material_statistics`] | mean color, roughness, metallic and transmission of bodies |
//! | [`material_map`], [`materials`] | the material that every pixel shows, and the materials by their ids |
//! | [`visibility`] | how much of every object the image shows, and what lies beyond its edges |
//!
//! [`checks`] says what must hold among their products.
//!
//! **Invariants.** An annotator is a pure function of the site and of the products that it declares to read. All label
//! products of a view cover the same instances: those that [`masks`] annotates.

pub mod amodal_depth;
pub mod amodal_normal;
pub mod bodies;
pub mod boxes;
pub mod camera;
pub mod checks;
pub mod cuboids;
pub mod depth_relations;
pub mod distance;
pub mod identity;
pub mod keypoints;
pub mod label_arrays;
pub mod lights;
pub mod masks;
pub mod material_map;
pub mod material_statistics;
pub mod materials;
mod matrix;
pub mod object_coordinates;
pub mod object_info;
pub mod object_models;
pub mod occlusion_boundary;
pub mod occlusion_graph;
pub mod optical_flow;
pub mod outlines;
pub mod rotated_boxes;
pub mod scene_masks;
pub mod seen_in_views;
pub mod settle_report;
pub mod soft_masks;
pub mod visibility;

/// Canvas of the parts of objects beyond the image: one image size beyond every edge, as in BOP's tools.
pub const CANVAS: u32 = 3;
