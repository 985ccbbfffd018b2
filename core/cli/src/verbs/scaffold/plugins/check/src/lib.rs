//! Check `sane_sizes`: no object covers almost the whole image.

use syntable_model::check::{Check, LabelFault};
use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;
use syntable_model::register_check;

/// Largest part of an image that an object may cover.
const LARGEST_PART: f64 = 0.9;

// A run checks each view before it writes the view's files, and `syntable validate` checks finished datasets.
register_check!(Check {
    name: "sane_sizes",
    doc: "No object covers more than nine tenths of the image.",
    reads: || keys![VISIBLE_MASK],
    finds_subject: Check::ALWAYS,
    faults,
});

/// A fault for each object that is too large.
pub fn faults(products: &Products) -> Result<Vec<LabelFault>> {
    let masks = products.get(VISIBLE_MASK)?;
    let too_large = masks.iter().filter_map(|(id, mask)| {
        let part = f64::from(mask.area()) / (f64::from(mask.width()) * f64::from(mask.height()));
        (part > LARGEST_PART).then(|| LabelFault::of(id, format!("it covers {:.0} % of the image", 100.0 * part)))
    });
    Ok(too_large.collect())
}
