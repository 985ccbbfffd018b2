//! One program for all tests of the crate: each program takes seconds to compile.

mod bop;
mod coco;
mod read;
mod readers;
mod rules;
mod unread;
