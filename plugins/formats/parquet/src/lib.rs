//! Parquet files.
//!
//! | kind | writes, and reads |
//! | --- | --- |
//! | [`parquet`] | tables of labels for pandas and Hugging Face `datasets`: a row per instance or per image |
//!
//! The only crate that knows the format's library.

mod bounds;
mod file;
pub mod parquet;
mod read;
mod record;
mod shred;
mod write;
