//! `guided`: an edge-avoiding filter guided by albedo, normals, depth and ids. The filter is the library [`syntable_guided`], which
//! renderers use, too.

pub use syntable_guided::Guided;

syntable_model::register!(Guided);
