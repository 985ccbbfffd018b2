//! Procedural household objects, materials and tables: what a dataset needs without any download.
//!
//! [`objects`] offers the families of [`family`], built with the modelling kit [`shape`] and the surfaces and prints of
//! [`paint`]; [`materials`] offers the surfaces themselves; [`tables`] offers tables.
//!
//! **Invariants.** A variant is a function of seed, family and number: not of what was loaded before, nor of the
//! families or the number of variants chosen. Meshes are unions of closed surfaces that point outwards.

pub mod family;
pub mod materials;
pub mod objects;
pub mod paint;
pub mod shape;
mod shelf;
pub mod tables;

pub use shelf::Shelf;

use syntable_model::prelude::*;
use syntable_model::scene::{Catalog, CatalogEntry};

/// The catalogue of some families with equally many variants.
pub(crate) fn variant_entries(families: impl Iterator<Item = &'static str>, variants: u32) -> Catalog {
    let mut entries: Vec<CatalogEntry> = families
        .flat_map(|family| {
            (0..variants).map(move |i| CatalogEntry { name: format!("{family}_{i:04}"), category: family.to_owned() })
        })
        .collect();
    entries.sort();
    Catalog { entries }
}

/// Sorts families; one named twice is refused, since it would be drawn twice as often.
pub(crate) fn check_families<F: Copy + Ord>(
    families: &mut [F],
    name: impl Fn(F) -> &'static str,
) -> Result<(), Invalid> {
    if families.is_empty() {
        return Err(Invalid::new("families", "`families = []` offers nothing").help("leave it out to have all"));
    }
    families.sort();
    match families.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Invalid::new("families", format!("`{}` is named twice", name(pair[0])))),
        None => Ok(()),
    }
}

/// Family and number of a name such as `mug_0007`.
pub(crate) fn parse_name<F: Copy>(
    text: &str,
    families: &[F],
    name: impl Fn(F) -> &'static str,
    variants: u32,
) -> Result<(F, u32)> {
    let parsed = text.rsplit_once('_').and_then(|(family, number)| {
        let family = families.iter().copied().find(|&f| name(f) == family)?;
        let variant: u32 = number.parse().ok().filter(|&variant| variant < variants)?;
        (number == format!("{variant:04}")).then_some((family, variant))
    });
    parsed.ok_or_else(|| {
        let names: Vec<&str> = families.iter().map(|&f| name(f)).collect();
        Error::new(format!("no procedural asset `{text}`")).help(format!(
            "names are <family>_<number>, numbers 0000 to {:04}, families: {}",
            variants - 1,
            names.join(", ")
        ))
    })
}
