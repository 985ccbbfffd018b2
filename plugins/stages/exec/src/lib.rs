//! Annotators and writers in programs of any language.
//!
//! A recipe names a program. SynTable starts it, sends it messages through its standard input, and reads its answers from its
//! standard output. Errors show its last lines of standard error.
//!
//! | module | holds |
//! | --- | --- |
//! | [`exec`] | the annotator and the writer `exec` |
//! | `program` | the options of a program, and its processes |
//! | `process` | one running process |
//! | `message` | messages and answers: NumPy archives with a length |
//! | `answer` | products from answers |
//!
//! The book's chapter [Programs as stages](https://github.com/syntable/syntable/blob/main/book/src/programs.md) describes the
//! messages.

mod answer;
pub mod exec;
mod message;
mod process;
mod program;
