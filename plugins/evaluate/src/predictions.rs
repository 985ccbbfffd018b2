//! Where predictions come from: a dataset of any format that can be read, or a result file.

use crate::image::Instance;
use crate::results::Results;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;
use syntable_model::product::standard::{AMODAL_MASK, VISIBLE_MASK};
use syntable_model::reader::{self, DatasetReader, ImageRef};

/// Predictions for the images of a dataset.
pub enum Predictions {
    /// Those that a dataset has as labels; for each image of the ground truth, the number of its own.
    Dataset(Box<dyn DatasetReader>, Vec<usize>),
    /// Those of a result file.
    Results(Results),
}

impl Predictions {
    /// Opens predictions for the images of a dataset, and says what they were read as.
    ///
    /// # Errors
    /// If they cannot be read, or are not of these images.
    pub fn open(
        path: &Path,
        format: Option<&str>,
        least: f64,
        truth: (&Path, &[ImageRef]),
    ) -> Result<(&'static str, Self)> {
        if format.is_none() && Results::is_one(path) {
            return Ok(("results", Self::Results(Results::open(path, least, truth.0, truth.1)?)));
        }
        let (format, dataset) = reader::open(path, format)?;
        check_masks(&*dataset, path)?;
        let pairs = paired(path, dataset.images(), truth)?;
        Ok((format.name, Self::Dataset(dataset, pairs)))
    }

    /// The predictions of an image of the ground truth of `[width, height]` pixels, occluded from an occlusion rate on.
    ///
    /// # Errors
    /// If they cannot be read, or are of another size.
    pub fn instances(&self, image: usize, size: [u32; 2], occluded_from: f64) -> Result<Vec<Instance>> {
        match self {
            Self::Dataset(dataset, pairs) => {
                let make = |amodal, visible| Instance::predicted_from(occluded_from, amodal, visible, None);
                let (instances, own) = instances(&**dataset, pairs[image], make)?;
                if own != size {
                    let ([a, b], [c, d]) = (own, size);
                    return Err(Error::new(format!("the prediction has {a} × {b} pixels, the ground truth {c} × {d}"))
                        .help("predict masks of the size of the image")
                        .permanent());
                }
                Ok(instances)
            }
            Self::Results(results) => results.instances(image, size, occluded_from),
        }
    }
}

/// The objects of an image in the order of their ids, and `[width, height]` of the image.
///
/// # Errors
/// If the image cannot be read, or an object has no amodal or visible mask.
pub fn instances(
    dataset: &dyn DatasetReader,
    image: usize,
    make: impl Fn(Mask, Mask) -> Instance,
) -> Result<(Vec<Instance>, [u32; 2])> {
    let (view, products) = dataset.read(image, &[AMODAL_MASK.id(), VISIBLE_MASK.id()])?;
    let (amodal, visible) = (&products.get(AMODAL_MASK)?.0, &products.get(VISIBLE_MASK)?.0);
    if let Some(id) = visible.keys().find(|id| !amodal.contains_key(id)) {
        return Err(Error::new(format!("object {} has no amodal mask", id.0))
            .help("`syntable validate` lists what is wrong")
            .permanent());
    }
    let of = |(id, amodal): (_, &Mask)| {
        let visible = visible.get(id).cloned().unwrap_or_else(|| Mask::empty(amodal.width(), amodal.height()));
        make(amodal.clone(), visible)
    };
    let size = view.camera.intrinsics;
    Ok((amodal.iter().map(of).collect(), [size.width, size.height]))
}

/// Refuses a dataset without amodal masks.
///
/// # Errors
/// If it has none.
pub fn check_masks(dataset: &dyn DatasetReader, path: &Path) -> Result<()> {
    let offers = dataset.offers();
    match [AMODAL_MASK.id(), VISIBLE_MASK.id()].into_iter().find(|key| !offers.contains(key)) {
        None => Ok(()),
        Some(key) => Err(Error::new(format!("the dataset has no `{}`", key.name))
            .in_file(path)
            .help("evaluation needs amodal and visible masks of objects")
            .permanent()),
    }
}

/// For each image of the ground truth, the number of the predicted one of its name.
fn paired(path: &Path, own: &[ImageRef], (truth, images): (&Path, &[ImageRef])) -> Result<Vec<usize>> {
    let numbers: BTreeMap<&str, usize> = own.iter().enumerate().map(|(i, it)| (it.name.as_str(), i)).collect();
    let known: BTreeSet<&str> = images.iter().map(|it| it.name.as_str()).collect();
    if let Some(image) = own.iter().find(|it| !known.contains(it.name.as_str())) {
        return Err(Error::new(format!("image \"{}\" is not in {}", image.name, truth.display()))
            .in_file(path)
            .help("predictions call their images as the ground truth does; leave others out")
            .permanent());
    }
    let number = |image: &ImageRef| {
        numbers.get(image.name.as_str()).copied().ok_or_else(|| {
            Error::new(format!("image \"{}\" of {} has no prediction", image.name, truth.display()))
                .in_file(path)
                .help("add the image, without objects if none was found")
                .permanent()
        })
    };
    images.iter().map(number).collect()
}
