//! The kinds `exec`.

mod annotator;
mod writer;

pub use annotator::ExecAnnotator;
pub use writer::ExecWriter;
