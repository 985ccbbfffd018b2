//! Asset sources: files of many formats ([`files`]), and procedural objects, tables and materials that need no
//! download ([`household`]).

pub mod files;
pub mod household;
