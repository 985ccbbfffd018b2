//! OCID, which is only read.

mod read;
