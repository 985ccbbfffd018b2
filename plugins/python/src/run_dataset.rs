//! Datasets of runs: the products of all writers.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use syntable_model::error::Result;
use syntable_model::product::{KeyId, Products};
use syntable_model::reader::{DatasetFormat, ImageRef, OpenDataset, Source};
use syntable_model::scene::{SceneId, ViewId};

/// A dataset with the products that other writers of the same run stored by name.
pub struct RunDataset {
    /// The dataset that lists the images.
    pub first: OpenDataset,
    companions: Vec<(Arc<dyn DatasetFormat>, Source)>,
    /// The datasets of the other writers, opened at their first use.
    others: OnceLock<Companions>,
}

/// The datasets of the other writers of a run.
#[derive(Default)]
struct Companions {
    datasets: Vec<Companion>,
    /// Parts that cannot be read, with reasons.
    left_out: Vec<String>,
}

/// A dataset of another writer of the run.
struct Companion {
    dataset: OpenDataset,
    /// Its images by scene and view.
    places: BTreeMap<(SceneId, ViewId), usize>,
    /// The products that it stores, and no dataset before it.
    keys: Vec<KeyId>,
}

impl RunDataset {
    /// A dataset, and the datasets of other writers.
    pub fn new(first: OpenDataset, companions: Vec<(Arc<dyn DatasetFormat>, Source)>) -> Self {
        Self { first, companions, others: OnceLock::new() }
    }

    fn others(&self) -> &Companions {
        self.others.get_or_init(|| {
            let (mut others, mut known) = (Companions::default(), self.first.offers.clone());
            for (format, source) in &self.companions {
                let dataset = match format.open(source) {
                    Ok(dataset) => dataset,
                    Err(error) => {
                        others.left_out.push(error.to_string());
                        continue;
                    }
                };
                let is_known = |key: &KeyId| known.iter().any(|other| other.is(&key.to_string()));
                let new = dataset.offers.iter().filter(|key| !dataset.is_derived(key) && !is_known(key));
                let keys: Vec<KeyId> = new.copied().collect();
                known.extend(&keys);
                others.left_out.extend(lost(&dataset));
                let places = dataset.images.iter().enumerate().map(|(at, image)| ((image.scene, image.view), at));
                let places: BTreeMap<_, _> = places.collect();
                others.left_out.extend(self.lacking(&places, &keys, &source.path));
                others.datasets.push(Companion { places, dataset, keys });
            }
            others
        })
    }

    /// Names images that a dataset of another writer lacks, if it stores products that no other dataset has.
    fn lacking(&self, places: &BTreeMap<(SceneId, ViewId), usize>, keys: &[KeyId], folder: &Path) -> Option<String> {
        let is_lacking = |image: &&ImageRef| !places.contains_key(&(image.scene, image.view));
        let lacking: Vec<_> = self.first.images.iter().filter(is_lacking).collect();
        let first = lacking.first().filter(|_| !keys.is_empty())?;
        let (count, products) = (lacking.len(), keys.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "));
        let images = if count == 1 { "image lacks" } else { "images lack" };
        Some(format!("{}: {count} {images} {products}, such as `{}`", folder.display(), first.name))
    }

    /// The keys of all products.
    pub fn keys(&self) -> Vec<KeyId> {
        let others = self.others().datasets.iter().flat_map(|other| &other.keys);
        self.first.offers.iter().chain(others).copied().collect()
    }

    /// The key of a product. The other writers' datasets are opened only for products that the first one lacks.
    pub fn key(&self, name: &str) -> Option<KeyId> {
        let of = |keys: &[KeyId]| keys.iter().find(|key| key.is(name)).copied();
        of(&self.first.offers).or_else(|| of(&self.keys()))
    }

    /// Parts of the other writers' datasets that cannot be read, with reasons.
    pub fn left_out_of_others(&self) -> &[String] {
        &self.others().left_out
    }

    /// Reads products of an image. An image that a writer left out lacks its products.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn read(&self, image: usize, wants: &[KeyId]) -> Result<Products> {
        let (own, others): (Vec<KeyId>, Vec<KeyId>) = wants.iter().partition(|key| self.first.offers.contains(key));
        let mut products = if own.is_empty() { Products::new() } else { self.first.read(image, &own)?.products };
        if others.is_empty() {
            return Ok(products);
        }
        let found = &self.first.images[image];
        for other in &self.others().datasets {
            let own: Vec<KeyId> = others.iter().filter(|key| other.keys.contains(key)).copied().collect();
            if let Some(&place) = other.places.get(&(found.scene, found.view)).filter(|_| !own.is_empty()) {
                products.extend(other.dataset.read(place, &own)?.products)?;
            }
        }
        Ok(products)
    }
}

/// Parts of a dataset that its reader could not read, with reasons.
pub fn lost(dataset: &OpenDataset) -> Vec<String> {
    let lost = dataset.faults.iter().filter(|fault| fault.is_lost);
    lost.map(|fault| fault.place_and_text(&dataset.images).join(": ")).collect()
}
