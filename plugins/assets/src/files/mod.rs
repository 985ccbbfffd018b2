//! Assets read from files.
