//! Names of shards, and of the fields of samples.

/// Suffixes of field names, which follow the name of the product.
pub const PNG: &str = "png";
/// An array.
pub const NPY: &str = "npy";
/// Ids of the instances along the first axis of the product's array.
pub const IDS: &str = "ids.npy";
/// A float image.
pub const EXR: &str = "exr";
/// A record, list or text.
pub const JSON: &str = "json";

/// Suffix of a shard's name.
const SHARD_END: &str = ".tar";
/// Minimum number of digits of the scene in a shard's name.
const DIGITS: usize = 6;

/// Path of the shard of a scene.
pub fn shard_path(id: &str, scene: &str) -> String {
    format!("{id}/{id}-{scene}{SHARD_END}")
}

/// Whether a file has the name of a shard, `{name}-{scene:06}.tar`.
pub fn is_shard(name: &str) -> bool {
    let number = name.strip_suffix(SHARD_END).and_then(|stem| Some(stem.rsplit_once('-')?.1));
    number.is_some_and(|number| number.len() >= DIGITS && number.bytes().all(|digit| digit.is_ascii_digit()))
}
