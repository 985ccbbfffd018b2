//! The stock binary: every plugin family, linked.
