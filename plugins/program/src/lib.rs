//! The stock program: all stock plugins, and the verbs of evaluation, statistics, reports and previews beside those of
//! [`syntable_cli`]. A program with plugins of its own calls [`main`], too:
//!
//! ```ignore
//! use my_annotators as _; // naming the crate is what links it
//!
//! fn main() -> std::process::ExitCode {
//!     syntable_program::main()
//! }
//! ```

mod verbs;

use syntable as _;
pub use syntable_cli::{Program, main};
