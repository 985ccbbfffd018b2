//! What a crate from outside can add to SynTable, one file each.

mod areas;
mod centroid;
mod cubes;
mod dead_pixels;
mod headlight;
mod headroom;
mod kinds;
mod off;
mod open_bin;
mod rival_boxes;
mod seen_in;
mod shift;
mod slider;
mod time_lapse;
mod tower;
mod visible_area;
