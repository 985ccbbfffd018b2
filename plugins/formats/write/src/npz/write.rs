//! Writes NumPy archives.

use super::Npz;
use super::record::{ARCHIVE, IDS};
use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::{self, Array, NpyArrays};
use syntable_formats::encode::npz;
use syntable_formats::include::{self, Included, IncludedProducts};
use syntable_formats::writer::ProductWriter;
use syntable_model::prelude::*;

impl ProductWriter for Npz {
    fn include(&self) -> &Included {
        &self.include
    }

    fn accepts(key: &KeyId) -> Result<(), String> {
        accepts(key, npy::check)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        include::path_of_all(of, ARCHIVE).into_iter().collect()
    }

    fn write(&self, included: &IncludedProducts) -> Result<()> {
        let mut arrays: Vec<(&str, Array)> = Vec::new();
        let mut ids: Option<(&str, Array)> = None;
        included.try_for_each(|product, key, value| {
            match npy::arrays(product, key, &value, included.shape)? {
                NpyArrays::One(array) => arrays.push((product, array)),
                NpyArrays::PerInstance { values, ids: of } => {
                    arrays.push((product, values));
                    match &ids {
                        None => ids = Some((product, of)),
                        Some((_, same)) if *same == of => {}
                        Some((first, _)) => {
                            return Err(Error::new(format!("`{first}` and `{product}` are of different instances"))
                                .help("include them in two writers of the kind npz, or write them with npy"));
                        }
                    }
                }
            }
            Ok(())
        })?;
        if arrays.is_empty() {
            return Ok(());
        }
        arrays.extend(ids.map(|(_, ids)| (IDS, ids)));
        let bytes = npz::encode(arrays.iter().map(|(name, array)| (*name, array)), self.compress)?;
        included.write_all(ARCHIVE, &bytes)
    }
}
