//! Sources of labels and predictions: a dataset in any readable format, label maps, a result file, or memory.

use crate::label_maps::{self, LabelMaps};
use crate::masked_object::{MaskedObject, Occluded};
use crate::memory::Detections;
use crate::names::ImageNames;
use crate::results::ResultFile;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;
use syntable_model::product::standard::{AMODAL_MASK, CATEGORY_ID, OCCLUSION_MASK, VISIBLE_MASK};
use syntable_model::reader::{ImageRef, OpenDataset, ReadImage, Source};
use syntable_model::registry::Registry;
use syntable_model::scene::InstanceId;
use syntable_model::shown::shown;

/// Opens a dataset or a folder of label maps. Also returns its format.
///
/// # Errors
/// If it cannot be read.
pub fn open(registry: &Registry, source: &Source, format: Option<&str>) -> Result<(&'static str, OpenDataset)> {
    let path = source.path.as_path();
    let is_other = || registry.formats().iter().any(|format| format.detects(path));
    let is_ours = format.map_or_else(|| LabelMaps::is_one(path) && !is_other(), |format| format == label_maps::NAME);
    if is_ours {
        let opened = OpenDataset::open(label_maps::NAME, source, || LabelMaps::open(source))?;
        return Ok((label_maps::NAME, opened));
    }
    let (format, dataset) = registry.open_dataset(source, format)?;
    Ok((format.name(), dataset))
}

/// Predictions for the images of a dataset.
pub enum Predictions {
    /// The labels of a dataset; its image for each image of the ground truth; its categories in the ground truth.
    Dataset(Box<OpenDataset>, Vec<usize>, BTreeMap<u32, u32>),
    /// A result file.
    Results(ResultFile),
    /// Predictions in memory.
    Memory(Detections),
}

impl Predictions {
    /// Opens predictions for the images of a dataset. Also returns their format.
    ///
    /// # Errors
    /// If they cannot be read, or do not belong to these images.
    pub fn open(
        registry: &Registry,
        source: &Source,
        format: Option<&str>,
        least: f64,
        truth: (&Path, &OpenDataset),
    ) -> Result<(&'static str, Self)> {
        let path = source.path.as_path();
        if format.is_none() && ResultFile::is_one(path) {
            return Ok(("results", Self::Results(ResultFile::open(path, least, truth.0, truth.1)?)));
        }
        let found = open(registry, source, format);
        let (format, dataset) = match found {
            Err(error) if path.is_file() => {
                let help = "a result file is a JSON list of predictions, `[{\"image_id\": …, \"score\": …, \"segmentation\": …}, …]`";
                return Err(error.help(help));
            }
            found => found?,
        };
        if !dataset.offers.contains(&VISIBLE_MASK.id()) {
            return Err(lacks(VISIBLE_MASK.id(), path));
        }
        let pairs = paired(path, &dataset.images, (truth.0, &truth.1.images))?;
        // Categories of two datasets are equal if their names are equal.
        let named: BTreeMap<&str, u32> = truth.1.info.categories().map(|(id, name)| (name, id)).collect();
        let own = dataset.info.categories().filter_map(|(id, name)| Some((id, *named.get(name)?)));
        let categories = own.collect();
        Ok((format, Self::Dataset(Box::new(dataset), pairs, categories)))
    }

    /// Predictions for an image of the ground truth with `[width, height]` pixels: first the predictions with
    /// sufficient scores, then the others.
    ///
    /// # Errors
    /// If they cannot be read, or have another size.
    pub fn instances(&self, image: usize, size: [u32; 2], occluded: Occluded) -> Result<[Vec<MaskedObject>; 2]> {
        match self {
            Self::Dataset(dataset, pairs, categories) => {
                let least = occluded.least(says_occlusion(dataset));
                let make = |amodal, visible, occlusion| MaskedObject::predicted_from(least, amodal, visible, occlusion);
                let (mut instances, own) = instances(dataset, pairs[image], make)?;
                if own != size {
                    let ([a, b], [c, d]) = (own, size);
                    return Err(Error::new(format!("the prediction has {a} × {b} pixels, the ground truth {c} × {d}"))
                        .help("predict masks with the size of the image"));
                }
                for it in &mut instances {
                    (it.id, it.category) = (0, it.category.and_then(|own| categories.get(&own).copied()));
                }
                Ok([instances, Vec::new()])
            }
            Self::Results(results) => results.instances(image, size, occluded),
            Self::Memory(detections) => detections.instances(image, size, occluded),
        }
    }
}

/// Whether a dataset has explicit masks of hidden pixels, which do not follow from other masks.
fn says_occlusion(dataset: &OpenDataset) -> bool {
    let key = OCCLUSION_MASK.id();
    dataset.offers.contains(&key) && !dataset.derived.contains(&key)
}

/// The objects of an image in the order of their ids, and `[width, height]` of the image. `make` receives the amodal,
/// visible and occlusion masks. In a dataset without amodal masks, the visible masks replace them.
///
/// # Errors
/// If the image cannot be read, or some objects have an amodal mask and others do not.
pub fn instances(
    dataset: &OpenDataset,
    image: usize,
    make: impl Fn(Mask, Mask, Option<Mask>) -> MaskedObject,
) -> Result<(Vec<MaskedObject>, [u32; 2])> {
    let offers = &dataset.offers;
    let wants = [VISIBLE_MASK.id(), AMODAL_MASK.id(), CATEGORY_ID.id()];
    let mut wants: Vec<_> = wants.into_iter().filter(|key| offers.contains(key)).collect();
    // Without an explicit occlusion mask, it is computed from the other two, as for a result file.
    wants.extend(says_occlusion(dataset).then_some(OCCLUSION_MASK.id()));
    let ReadImage { size, products, .. } = dataset.read(image, &wants)?;
    let visible = &products.get(VISIBLE_MASK)?.0;
    let categories = products.optional(CATEGORY_ID)?;
    let named = |id: InstanceId, instance: MaskedObject| {
        let category = categories.and_then(|of| of.get(id)).copied();
        MaskedObject { id: id.0, category, ..instance }
    };
    if !wants.contains(&AMODAL_MASK.id()) {
        let of = |(id, mask): (&InstanceId, &Mask)| named(*id, make(mask.clone(), mask.clone(), None));
        return Ok((visible.iter().map(of).collect(), size));
    }
    let amodal = &products.get(AMODAL_MASK)?.0;
    let occlusion = wants.contains(&OCCLUSION_MASK.id()).then(|| products.get(OCCLUSION_MASK)).transpose()?;
    if let Some(id) = visible.keys().find(|id| !amodal.contains_key(id)) {
        return Err(
            Error::new(format!("object {} has no amodal mask", id.0)).help("`syntable validate` lists all faults")
        );
    }
    let of = |(id, amodal): (&InstanceId, &Mask)| {
        let visible = visible.get(id).cloned().unwrap_or_else(|| Mask::empty(amodal.width(), amodal.height()));
        named(*id, make(amodal.clone(), visible, occlusion.and_then(|it| it.0.get(id)).cloned()))
    };
    Ok((amodal.iter().map(of).collect(), size))
}

/// Refuses a dataset without amodal or visible masks.
///
/// # Errors
/// If it lacks a mask that evaluation needs.
pub fn check_masks(dataset: &OpenDataset, path: &Path) -> Result<()> {
    let offers = &dataset.offers;
    match [AMODAL_MASK.id(), VISIBLE_MASK.id()].into_iter().find(|key| !offers.contains(key)) {
        None => Ok(()),
        Some(key) => Err(lacks(key, path)),
    }
}

fn lacks(name: impl std::fmt::Display, path: &Path) -> Error {
    Error::new(format!("the dataset has no `{name}`"))
        .in_file(path)
        .help("evaluation needs visible masks, and for the ground truth amodal masks, too")
}

/// For each image of the ground truth, the index of the image with predictions.
fn paired(path: &Path, own: &[ImageRef], (truth, images): (&Path, &[ImageRef])) -> Result<Vec<usize>> {
    let known = ImageNames::of(images.iter().map(|it| it.name.as_str()));
    let mut pairs: Vec<Option<usize>> = vec![None; images.len()];
    let refuse = |message: String, help: &'static str| Error::new(message).in_file(path).help(help);
    for (number, image) in own.iter().enumerate() {
        let Some(of) = known.find(&image.name) else {
            let message = format!("image \"{}\" is not in {}", image.name, shown(truth).display());
            return Err(refuse(message, "use the image names of the ground truth, and leave other images out"));
        };
        if let Some(other) = pairs[of].replace(number) {
            let message = format!(
                "images \"{}\" and \"{}\" both match image \"{}\" of {}",
                own[other].name,
                image.name,
                images[of].name,
                truth.display()
            );
            return Err(refuse(message, "leave one of them out"));
        }
    }
    let number = |(image, pair): (&ImageRef, Option<usize>)| {
        let message = || format!("image \"{}\" of {} has no prediction", image.name, truth.display());
        pair.ok_or_else(|| refuse(message(), "add the image, without objects if none was found"))
    };
    images.iter().zip(pairs).map(number).collect()
}
