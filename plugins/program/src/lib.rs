//! The stock program: all stock plugins, the verbs of [`syntable_cli`], and the verbs of evaluation, statistics,
//! reports and previews. A program with its own plugins calls [`main`], too:
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
pub use syntable_cli::{Program, main, refused};
