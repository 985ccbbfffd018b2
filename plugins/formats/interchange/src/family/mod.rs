//! Shared code of COCO's family: `coco`, `coco_panoptic`, `cocoa`, `d2sa`, `insta_order`, `kins` and `uoais` have one
//! annotation file beside images, and differ in its name and in its records of annotations.

pub mod find;
pub mod read;
pub mod write;
