//! Shared code of COCO's family: `coco`, `coco_panoptic`, `cocoa`, `d2sa`, `insta_order`, `kins` and `uoais` have
//! images and one annotation file. They differ in the name of this file and in its records of annotations.

pub mod find;
pub mod read;
pub mod write;
