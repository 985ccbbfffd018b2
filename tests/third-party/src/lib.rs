//! What a crate from outside can add to SynTable, one file each.

mod areas;
mod centroid;
mod cubes;
mod dead_pixels;
mod headlight;
mod headroom;
mod kinds;
mod off;
mod rival_boxes;
mod seen_in;
mod tower;
mod visible_area;
