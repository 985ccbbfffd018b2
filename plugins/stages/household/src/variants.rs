//! Names of procedural assets: `<family>_<variant>`, such as `mug_0007`.

use syntable_model::prelude::*;
use syntable_model::scene::{Catalog, CatalogEntry};

/// The catalog of some families with equally many variants.
pub(crate) fn variant_catalog(families: impl Iterator<Item = &'static str>, variants: u32) -> Catalog {
    let mut entries: Vec<CatalogEntry> = families
        .flat_map(|family| (0..variants).map(move |i| CatalogEntry::new(format!("{family}_{i:04}"), family)))
        .collect();
    entries.sort();
    Catalog { entries }
}

/// Sorts the families of the option `key`. An empty list is refused, and so is a family that is listed twice: it would
/// be drawn twice as often.
pub(crate) fn check_families<F: Copy + Ord>(
    key: &str,
    families: &mut [F],
    name: impl Fn(F) -> &'static str,
) -> Result<(), ConfigError> {
    if families.is_empty() {
        return Err(ConfigError::new(key, format!("`{key} = []` selects nothing")).help("omit it to select all"));
    }
    families.sort();
    match families.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(ConfigError::new(key, format!("`{}` is listed twice", name(pair[0])))),
        None => Ok(()),
    }
}

/// Family and number of a variant's name.
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
            variants.saturating_sub(1),
            names.join(", ")
        ))
    })
}
