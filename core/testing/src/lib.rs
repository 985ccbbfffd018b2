//! Tools for tests of SynTable plugins: scenes whose labels can be worked out on paper, checks that every
//! implementation of a trait must pass, and statistics for random quantities.
//!
//! ```
//! use syntable_testing::{scenes, stats};
//! // Two unit cubes in a row.
//! let scene = scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3]), ([1.5, 0.0, 0.5], [1.0; 3])]);
//! assert_eq!(scene.objects().len(), 2);
//! assert!(stats::chi_square_p(&[100, 96, 104], &[100.0; 3]) > 0.01);
//! ```

pub mod assets;
pub mod conformance;
pub mod errors;
pub mod fault_store;
pub mod figures;
pub mod folder;
#[cfg(unix)]
pub mod hostile;
pub mod read_back;
pub mod room;
pub mod scenes;
pub mod stats;
pub mod store;
pub mod takes;
pub mod tools;
pub mod workers;
