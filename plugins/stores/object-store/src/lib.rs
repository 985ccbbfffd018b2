//! Datasets in object stores, which URLs name: `s3://bucket/folder`, `gs://bucket/folder`, `az://container/folder`.
//!
//! | file | does |
//! |---|---|
//! | `connection.rs`, `profile.rs` | the client of a URL, with credentials from the environment or from the files of `aws` |
//! | `bucket.rs`, `objects.rs` | requests for objects; the [`Store`](syntable_model::store::Store) made of them |
//! | `content.rs`, `spool.rs` | files that are read by ranges; files that are uploaded when they are complete |
//! | `lease.rs` | locks that end when their owner no longer renews them |
//! | `requests.rs`, `failure.rs` | requests of threads that wait for them; errors without secrets |
//!
//! An object store has no folders: a folder exists if a key begins with its path and `/`. A file is one object. Requests
//! that fail for a reason of the network or the server are sent again up to ten times, with growing pauses.

mod bucket;
mod connection;
mod content;
mod failure;
mod lease;
mod moment;
mod objects;
mod profile;
mod requests;
mod spool;

pub use lease::LeaseTimes;
pub use objects::Objects;

syntable_model::register_store!(&["s3", "gs", "az"], connection::open);
