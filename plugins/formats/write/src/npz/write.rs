//! Writes NumPy archives.

use super::Npz;
use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::npz;
use syntable_formats::include::{self, Included, IncludedProducts};
use syntable_formats::npz_archive::{ARCHIVE, IDS};
use syntable_formats::record_arrays::{self, NamedArrays};
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;

impl ProductWriter for Npz {
    fn include(&self) -> &Included {
        &self.include
    }

    fn accepts(key: &KeyId) -> Result<(), String> {
        accepts(key, record_arrays::check)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        include::path_of_all(of, ARCHIVE).into_iter().collect()
    }

    fn write(&self, included: &IncludedProducts) -> Result<()> {
        let mut arrays: Vec<(String, Array)> = Vec::new();
        let mut ids: Option<(&str, Array)> = None;
        included.try_for_each(|product, key, value| {
            let NamedArrays { arrays: own, ids: of } = record_arrays::arrays(product, key, &value, included.shape)?;
            if let Some((name, _)) = own.iter().find(|(name, _)| name == IDS || arrays.iter().any(|(it, _)| it == name))
            {
                return Err(Error::new(format!("`{product}` makes an array `{name}`, and the archive has one"))
                    .help("include the product in another writer of the kind npz, or write it with jsonl"));
            }
            arrays.extend(own);
            match (&ids, of) {
                (None, of) => ids = of.map(|of| (product, of)),
                (Some(_), None) => {}
                (Some((_, same)), Some(of)) if *same == of => {}
                (Some((first, _)), Some(_)) => {
                    return Err(Error::new(format!("`{first}` and `{product}` are of different instances"))
                        .help("include them in two writers of the kind npz, or write them with npy"));
                }
            }
            Ok(())
        })?;
        if arrays.is_empty() {
            return Ok(());
        }
        arrays.extend(ids.map(|(_, ids)| (IDS.to_owned(), ids)));
        let bytes = npz::encode(arrays.iter().map(|(name, array)| (name.as_str(), array)), self.compress)?;
        included.write_all(ARCHIVE, &bytes)
    }
}
