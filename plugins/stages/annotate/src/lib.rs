//! Annotators: products made from the renderer's planes and from the scene.
//!
//! | kind | provides |
//! | --- | --- |
//! | [`masks`] | visible, amodal and occlusion masks, occlusion rate, occlusion order, label policy |
//! | [`occlusion_graph`] | occlusions between objects as a graph: layers, components, cycles, order from front to back
//! |
//! | [`boxes`] | visible and amodal boxes |
//! | [`rotated_boxes`] | rotated boxes of the visible and amodal masks |
//! | [`outlines`] | polygons around the visible and amodal masks |
//! | [`cuboids`] | 3D boxes, and their projections |
//! | [`label_arrays`] | visible ids and amodal bits, for training loops |
//! | [`identity`] | names of assets, ids of categories |
//! | [`object_info`] | asset, category, mass and poses of every object |
//! | [`object_models`] | triangle meshes of the assets |
//! | [`camera`] | intrinsics and pose of the view |
//! | [`lights`] | lights of the view |
//! | [`settle_report`] | result of the physics simulation |
//! | [`bodies`] | meaning of the ids of the scene |
//! | [`depth_relations`] | pairwise occlusion areas in pixels, and objects from front to back |
//! | [`amodal_depth`] | depth of every object, hidden parts included |
//! | [`amodal_normal`] | normals of every object, hidden parts included |
//! | [`object_coordinates`] | normalized object coordinates, of visible and of hidden surfaces |
//! | [`occlusion_boundary`] | edges where a body ends before another, and which side is in front |
//! | [`distance`] | distance from the camera |
//! | [`scene_masks`] | table, background, categories |
//! | [`seen_in_views`] | views of the scene in which an object is visible |
//! | [`soft_masks`] | fractions of pixels that objects cover, visible or hidden |
//! | [`keypoints`] | named points of objects in the image |
//! | [`optical_flow`] | positions of the points of an image in the next view |
//! | [`material_statistics`] | mean color, roughness, metallic and transmission of bodies |
//! | [`material_map`], [`materials`] | the material that every pixel shows, and the materials by their ids |
//! | [`visibility`] | visible fraction of every object, and its parts outside the image |
//!
//! [`checks`] verifies that their products are consistent.
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

/// Size of the canvas for the parts of objects outside the image: one image size beyond every edge, as in BOP's tools.
pub const CANVAS: u32 = 3;
