//! Annotators and writers in programs of any language.
//!
//! A recipe names a program. SynTable starts it, sends it messages through its standard input, and reads its answers from its
//! standard output. What it prints to standard error appears in errors.
//!
//! | module | holds |
//! | --- | --- |
//! | [`annotator`] | the annotator `exec` |
//! | [`writer`] | the writer `exec` |
//! | `program` | the options of a program, and its processes |
//! | `process` | one running process |
//! | `message` | messages and answers: NumPy archives with a length |
//! | `answer` | products from answers |
//!
//! # Messages
//!
//! A message is the four letters `SYN1`, the number of bytes that follow as an unsigned little-endian integer of 32 bits, and a
//! NumPy archive (`.npz`) without compression. The digit is the version of all that this page describes. Every message has one
//! answer of the same form. The program ends when its standard input ends.
//!
//! The array `syntable_message` names the message:
//!
//! | `syntable_message` | other arrays | arrays of the answer |
//! | --- | --- | --- |
//! | `start`, the first message | `syntable_options` (JSON), `syntable_reads`, `syntable_provides` (names of products), `syntable_seed` | none |
//! | `view` | `syntable_scene`, `syntable_view`, `syntable_size` (height, width), `syntable_seed`, the products that the stage reads, `ids` | of an annotator: its products; of a writer: files |
//! | `finish`, to a writer at the end of a run | `syntable_name`, `syntable_scenes`, `syntable_records` | files |
//!
//! Products have the arrays of the writer `npz`: images are height × width (× channels), values per object have the objects of
//! `ids` along their first axis, and a record has an array `{product}_{field}` per field. An annotator answers in the same form;
//! masks are objects × height × width. If it leaves out objects, its answer has the `ids` of the others. The answer of a writer
//! has a file per array of bytes (`uint8`, one axis); the array's name is the path in the dataset.
//!
//! `syntable_seed` of a view depends on the dataset's seed, the stage, the scene and the view alone. A stage whose answers depend
//! on something else makes datasets that cannot be repeated.
//!
//! Any answer may have `syntable_warnings`, texts that become warnings, or `syntable_error`, a text that ends the run. The answer
//! of a writer to a view may have `syntable_record`, a text that returns in `syntable_records` at the end, one per view that has
//! one, in the order of scenes and views.

pub mod annotator;
mod answer;
mod message;
mod process;
mod program;
pub mod writer;
