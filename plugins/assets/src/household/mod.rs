//! Procedural assets.
