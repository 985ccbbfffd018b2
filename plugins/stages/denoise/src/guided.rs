//! `guided`: an edge-avoiding filter guided by albedo, normals, depth and ids. The library [`syntable_guided`]
//! implements the filter; renderers use it, too.

pub use syntable_guided::Guided;

syntable_model::register!(Guided);
