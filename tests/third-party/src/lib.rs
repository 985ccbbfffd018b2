//! What a crate from outside can add to SynTable, one file each.

mod centroid;
mod headroom;
mod kinds;
mod off;
mod seen_in;
