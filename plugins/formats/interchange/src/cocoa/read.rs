//! Reads COCO-Amodal: one annotation per image with its regions.

use super::record::{CocoaAnnotation, CocoaRegion};
use crate::family::find::Structure;
use crate::family::read::{Annotated, AnnotationFile, image_folders, not_objects};
use crate::read::{POLYGONS, settle_edges};
use std::collections::BTreeSet;
use syntable_formats::coco::Category;
use syntable_formats::index::RecordSection;
use syntable_formats::listing::AnnotationListing;
use syntable_formats::read::{self, Categories, ObjectLabels};
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_model::limits::ANNOTATIONS;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, LABEL_POLICY, OCCLUSION_MASK};
use syntable_model::reader::{DatasetFault, Format, Note, Opened, Source};

syntable_model::register_format!(Format::new(
    "cocoa",
    "COCO-Amodal (`annotations/COCO_amodal_*.json` beside an image folder), as the writer `cocoa` writes it. Regions of \
          stuff are no objects; of several annotations of an image the first one counts.",
    |path| Structure::Regions.is_at(path),
    open,
).with_image_folder());

/// The regions of objects.
struct Regions {
    /// Whether this program wrote the dataset.
    is_ours: bool,
    /// The categories, by the names of the regions.
    categories: Categories,
}

fn open(source: &Source) -> Result<Opened> {
    let (root, path) = Structure::Regions.find(source)?;
    let (mut names, mut has_hidden) = (BTreeSet::new(), false);
    // Numbers of regions of each annotation: of all regions, and of regions of stuff.
    let mut regions: Vec<[usize; 2]> = Vec::new();
    let mut file = AnnotationFile::open(
        source,
        &root,
        &path,
        &image_folders(&path),
        &[("annotations", &[]), ("regions", &[])],
        &mut |annotation: &CocoaAnnotation, unkept| {
            unkept[0].add(&annotation.extra);
            annotation.regions.iter().for_each(|region| unkept[1].add(&region.extra));
            let all = annotation.regions.len();
            regions.push([all, all - annotation.objects().count()]);
            let of_objects = annotation.objects().map(|(_, region)| region.name.clone());
            names.extend(of_objects.filter(|name| !name.is_empty()));
            has_hidden |= annotation.objects().any(|(_, region)| region.invisible_mask.is_some());
        },
    )?;
    let [mut stuff, mut others, mut all] = [0; 3];
    for image in &file.listing.images {
        for (place, &number) in image.annotations.iter().enumerate() {
            let [of_all, of_stuff] = regions[number as usize];
            all += of_all;
            match place {
                0 => stuff += of_stuff,
                _ => others += of_all,
            }
        }
    }
    let listed = file.listing.file.categories.as_deref().filter(|listed| !listed.is_empty());
    let categories = listed.map_or_else(|| Categories::named(names.clone()), |own| with_names(own, &names));
    let are_listed = listed.is_some() || names.is_empty();
    let info = file.info(&categories);
    let labels = read::KnownMasks::Both.offers();
    let offers = file.offers(labels.clone(), &[LABEL_POLICY.id()]);
    let unlisted = "the file lists no categories: names of regions are numbered in their order, and another part of the dataset \
                    with other names has other numbers";
    let mut notes = vec![Note::caveat(POLYGONS).of(labels)];
    notes.extend((!are_listed).then(|| Note::caveat(unlisted).of([CATEGORY_ID.id()])));
    notes.extend(file.not_kept(&offers));
    notes.push(not_objects(&offers, stuff, all, "regions are stuff (`isStuff`), and no objects"));
    let what = "regions are of another annotation of an image whose first one is read";
    notes.push(not_objects(&offers, others, all, what));
    let derived = if has_hidden { Vec::new() } else { keys![OCCLUSION_MASK] };
    let of = Regions { is_ours: file.is_ours(), categories };
    let opened = file.opened(info, offers, notes, of);
    Ok(Opened { derived, lists_all_images: false, category_ids: None, ..opened })
}

/// The categories that a file lists, followed by the names of regions that are not in this list.
fn with_names(listed: &[Category], names: &BTreeSet<String>) -> Categories {
    let mut all = listed.to_vec();
    let unlisted = names.iter().filter(|name| !listed.iter().any(|it| it.name == **name));
    let last = listed.iter().map(|it| it.id).max().unwrap_or_default();
    let category = |(place, name): (u64, &String)| Category {
        id: last.saturating_add(place),
        name: name.clone(),
        ..Category::default()
    };
    all.extend((1..).zip(unlisted).map(category));
    Categories::of(&all)
}

/// A key of a region for messages, with the number of the region from 1.
pub fn key_of(region: usize, key: &str) -> String {
    format!("`regions[{}].{key}`", region - 1)
}

impl CocoaAnnotation {
    fn key(&self, region: usize, key: &str) -> String {
        format!("annotation {}: {}", self.id, key_of(region, key))
    }

    /// The regions of objects, each with its number from 1.
    pub fn objects(&self) -> impl Iterator<Item = (usize, &CocoaRegion)> {
        (1..).zip(&self.regions).filter(|(_, region)| region.is_stuff == 0)
    }

    fn mask(&self, number: usize, (key, rle): (&str, &Rle), [width, height]: [u32; 2]) -> Result<Mask> {
        let decoded = Segmentation::Rle(rle.clone()).decode(width, height);
        decoded.map_err(|error| error.context(self.key(number, key)))
    }

    pub fn polygon(&self, number: usize, region: &CocoaRegion, [width, height]: [u32; 2]) -> Result<Mask> {
        let decoded = Segmentation::Polygons(vec![region.segmentation.clone()]).decode(width, height);
        decoded.map_err(|error| error.context(self.key(number, "segmentation")))
    }

    /// Visible, amodal and occlusion mask of a region. A region without occlusion has only a polygon; otherwise the
    /// masks are exact.
    pub fn masks(&self, number: usize, region: &CocoaRegion, size: [u32; 2]) -> Result<[Mask; 3]> {
        let visible =
            region.visible_mask.as_ref().map(|rle| self.mask(number, ("visible_mask", rle), size)).transpose()?;
        let hidden =
            region.invisible_mask.as_ref().map(|rle| self.mask(number, ("invisible_mask", rle), size)).transpose()?;
        Ok(match (visible, hidden) {
            (Some(visible), Some(hidden)) => [visible.clone(), visible.or(&hidden), hidden],
            (Some(visible), None) => {
                let amodal = self.polygon(number, region, size)?.or(&visible);
                let hidden = amodal.minus(&visible);
                [visible, amodal, hidden]
            }
            (None, Some(hidden)) => {
                let amodal = self.polygon(number, region, size)?.or(&hidden);
                [amodal.minus(&hidden), amodal, hidden]
            }
            (None, None) => {
                let amodal = self.polygon(number, region, size)?;
                [amodal.clone(), amodal, Mask::empty(size[0], size[1])]
            }
        })
    }

    /// The labels of its objects. With `beyond`, rates count parts outside the image, and the stated rates are used.
    pub fn labels(&self, categories: &Categories, size: [u32; 2], beyond: bool) -> Result<Vec<ObjectLabels>> {
        let of = |(row, (number, region)): (usize, (usize, &CocoaRegion))| {
            let [visible, amodal, _] = self.masks(number, region, size)?;
            let category = categories.id_of(&region.name);
            let labels = ObjectLabels::of_masks(read::id_of(row)?, visible, Some(amodal), category);
            Ok(ObjectLabels { rate: region.occlude_rate.filter(|_| beyond), ..labels })
        };
        let mut labels = self.objects().enumerate().map(of).collect::<Result<Vec<_>>>()?;
        settle_edges(&mut labels);
        Ok(labels)
    }
}

/// The first annotation of an image.
fn annotation(listing: &AnnotationListing, image: usize) -> Result<Option<CocoaAnnotation>> {
    let first = listing.images[image].annotations.get(..1).unwrap_or_default();
    let records: Vec<CocoaAnnotation> = listing.file.records(RecordSection::Annotations, first)?;
    let annotation = records.into_iter().next();
    annotation.iter().try_for_each(|annotation| ANNOTATIONS.check(annotation.regions.len() as u64))?;
    Ok(annotation)
}

impl Annotated for Regions {
    type Records = Option<CocoaAnnotation>;

    fn records(&self, file: &AnnotationFile, image: usize) -> Result<Self::Records> {
        annotation(&file.listing, image)
    }

    fn put(
        &self,
        file: &AnnotationFile,
        image: usize,
        records: &Self::Records,
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()> {
        let labels = match records {
            Some(annotation) => annotation.labels(&self.categories, file.size(image), file.counts_beyond(image)?)?,
            None => Vec::new(),
        };
        read::put(&labels, None, wants, products)
    }

    fn faults(&self, file: &AnnotationFile, image: usize, records: &Self::Records) -> Vec<DatasetFault> {
        let Some(annotation) = records else { return Vec::new() };
        let Ok(beyond) = file.counts_beyond(image) else { return Vec::new() };
        annotation.faults(file.size(image), beyond, self.is_ours)
    }
}
