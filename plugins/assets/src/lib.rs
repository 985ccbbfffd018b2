//! Asset sources: files of many formats, and procedural objects, tables and materials.
