//! Asset sources: files of many formats ([`files`]), and procedural objects, tables and materials ([`household`]) and
//! environment maps ([`environments`]) that need no download.

pub mod environments;
pub mod files;
pub mod household;
