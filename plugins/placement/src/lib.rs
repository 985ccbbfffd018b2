//! Placers: room, table, and objects dropped from a box.
