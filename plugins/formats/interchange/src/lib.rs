//! Formats of other datasets, one folder each, for existing training and evaluation code.
//!
//! A folder has `mod.rs` with the options of the writer, and `record.rs` with the types of the files' records, which
//! `write.rs` and `read.rs` share. `check.rs` finds contradictions in these records. `family` has the shared code of
//! COCO's relatives.
//!
//! | kind | writes |
//! | --- | --- |
//! | [`bop`] | BOP scenewise: poses, masks and depth of objects |
//! | [`coco`] | COCO detection: one annotation file, with amodal or visible masks |
//! | [`coco_panoptic`] | COCO panoptic segmentation: visible masks as segments, the rest as background |
//! | [`cocoa`] | COCO-Amodal: the objects of an image from front to back |
//! | [`d2sa`] | D2S amodal: COCO with visible and invisible masks and the order of occlusion |
//! | [`insta_order`] | InstaOrder: pairwise orders of occlusion and depth, and COCO's instances |
//! | [`kins`] | KINS: amodal and visible polygons, with groups of overlapping objects |
//! | [`ocid`] | nothing: OCID is only read |
//! | [`osd_amodal`] | OSD-Amodal: the folders that UOAIS-Net's evaluation reads |
//! | [`tod`] | TOD: scenes from which UOIS-Net and UCN are trained |
//! | [`uoais`] | UOAIS-Sim: what UOAIS-Net is trained from |
//! | [`yolo`] | Ultralytics YOLO: polygons or oriented boxes |
//!
//! `photographs` reads folders of photographs without labels. `unread` names datasets of other programs that no format reads.
//!
//! Writers in this crate read products only, never the bodies of the scene, so they can also write the products of a
//! reader of another format. Pixel coordinates have their origin in the top left corner of the image.

pub mod bop;
pub mod coco;
pub mod coco_panoptic;
pub mod cocoa;
pub mod d2sa;
mod depth;
mod family;
mod field;
pub mod insta_order;
pub mod kins;
mod label_images;
mod labels;
pub mod ocid;
mod order;
pub mod osd_amodal;
mod outlines;
mod photographs;
mod read;
pub mod tod;
mod unread;
pub mod uoais;
pub mod yolo;
