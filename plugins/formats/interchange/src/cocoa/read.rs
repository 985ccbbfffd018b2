//! Reads COCO-Amodal: one annotation per image with its regions.

use super::FILE;
use crate::coco::read::{FOLDER, images_root};
use crate::read::{self as shared, POLYGONS, edge_px2, enclosed, eroded, settle_edges};
use serde::de::IgnoredAny;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::Extra;
use syntable_formats::coco::{Category, Image, id};
use syntable_formats::decode;
use syntable_formats::index::Record;
use syntable_formats::listing::{AnnotationRecord, Listing};
use syntable_formats::read::{self, Categories, Labels};
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_formats::unkept::Unkept;
use syntable_model::files::DatasetFolder;
use syntable_model::limits::ANNOTATIONS;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, LABEL_POLICY, OCCLUSION_MASK, RGB};
use syntable_model::product::{BBox, meeting_boxes};
use syntable_model::reader::{Format, ImageSource, Note, Opened, ReadImage, Source};

syntable_model::register_format!(Format {
    name: "cocoa",
    doc: "COCO-Amodal (`annotations/COCO_amodal_*.json` beside an image folder), as the writer `cocoa` writes it. Regions of \
          stuff are no objects; of several annotations of an image the first one counts.",
    detect: |path| shared::is_dataset(path, Some(FOLDER), |file| shared::name_starts(file, FILE)),
    open,
    is_generic: false,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Largest error of a rate of two decimals.
const TWO_DECIMALS: f64 = 0.005;

/// The annotation of an image by one person.
#[derive(Debug, Deserialize)]
struct ImageAnnotation {
    #[serde(deserialize_with = "id")]
    id: u64,
    #[serde(deserialize_with = "id")]
    image_id: u64,
    #[serde(default)]
    size: Option<usize>,
    #[serde(default)]
    depth_constraint: String,
    regions: Vec<Region>,
    /// Fields that are not read.
    #[serde(flatten)]
    extra: Extra,
}

/// An object, or stuff.
#[derive(Debug, Deserialize)]
struct Region {
    segmentation: Vec<f64>,
    #[serde(default)]
    name: String,
    #[serde(default)]
    area: Option<f64>,
    #[serde(default, rename = "isStuff")]
    is_stuff: u8,
    #[serde(default)]
    occlude_rate: Option<f64>,
    #[serde(default)]
    order: Option<usize>,
    #[serde(default)]
    visible_mask: Option<Rle>,
    #[serde(default)]
    invisible_mask: Option<Rle>,
    /// Fields that are not read.
    #[serde(flatten)]
    extra: Extra,
}

impl AnnotationRecord for ImageAnnotation {
    fn id(&self) -> u64 {
        self.id
    }

    fn image(&self) -> u64 {
        self.image_id
    }

    fn category(&self) -> Option<u64> {
        None
    }
}

struct Reader {
    images_root: DatasetFolder,
    /// Whether this program wrote the dataset.
    is_ours: bool,
    /// The names of regions.
    categories: Categories,
    /// Whether every image says the policy of its labels.
    has_policy: bool,
    listing: Listing,
}

fn open(source: &Source) -> Result<Opened> {
    let (root, file) = shared::root_and_file(source, Some(FOLDER), |file| shared::name_starts(file, FILE))?;
    let (mut names, mut has_policy, mut has_hidden) = (BTreeSet::new(), true, false);
    let mut unkept =
        [("images", shared::OF_IMAGES), ("annotations", &[]), ("regions", &[])].map(|(of, read)| Unkept::new(of, read));
    // Regions of each annotation, all and those of stuff.
    let mut regions: Vec<[usize; 2]> = Vec::new();
    let listing = Listing::open(&file, &mut |record: &Record<Image, ImageAnnotation, IgnoredAny>| match record {
        Record::Annotation(annotation) => {
            unkept[1].add(&annotation.extra);
            annotation.regions.iter().for_each(|region| unkept[2].add(&region.extra));
            let all = annotation.regions.len();
            regions.push([all, all - annotation.objects().count()]);
            let of_objects = annotation.objects().map(|(_, region)| region.name.clone());
            names.extend(of_objects.filter(|name| !name.is_empty()));
            has_hidden |= annotation.objects().any(|(_, region)| region.invisible_mask.is_some());
        }
        Record::Image(image) => {
            shared::count_unkept(&mut unkept[0], image);
            has_policy &= shared::policy(image).is_some();
        }
        Record::Scene(_) => {}
    })?;
    let mut no_objects = [0; 3];
    for image in &listing.images {
        for (place, &number) in image.annotations.iter().enumerate() {
            let [all, stuff] = regions[number as usize];
            let [of_stuff, of_others, of_all] = &mut no_objects;
            *of_all += all;
            match place {
                0 => *of_stuff += stuff,
                _ => *of_others += all,
            }
        }
    }
    let listed = listing.file.categories.as_deref().filter(|listed| !listed.is_empty());
    let categories = listed.map_or_else(|| Categories::named(names.clone()), |own| with_names(own, &names));
    let are_listed = listed.is_some() || names.is_empty();
    let first = listing.images.first().map(|image| image.frame.file_name.as_str());
    let images_root = images_root(&root, &file, first);
    let about = &listing.file.info;
    let info = categories.info(about.description.clone(), about.contributor.clone(), &listing.refs, String::new());
    let has_policy = has_policy && !listing.images.is_empty();
    let mut offers = read::Known::Both.offers();
    let labels = offers.clone();
    offers.push(RGB.id());
    offers.extend(has_policy.then_some(LABEL_POLICY.id()));
    let unlisted = "the file lists no categories: names of regions are numbered in their order, and another part of the dataset \
                    with other names has other numbers";
    let mut notes = vec![Note::caveat(POLYGONS).of(labels.clone())];
    notes.extend((!are_listed).then(|| Note::caveat(unlisted).of([CATEGORY_ID.id()])));
    notes.extend(shared::information(&listing, &unkept));
    notes.extend(shared::labels_not_kept(&offers, &unkept));
    let [stuff, others, all] = no_objects;
    for (count, what) in [
        (stuff, "regions are stuff (`isStuff`), and no objects"),
        (others, "regions are of another annotation of an image whose first one is read"),
    ] {
        notes.push(Note::not_objects(LeftOut::new(count, all, what)).of(labels.clone()));
    }
    let (is_ours, category_ids) = (shared::is_ours(&info), None);
    let derived = if has_hidden { Vec::new() } else { keys![OCCLUSION_MASK] };
    let opened =
        listing.opened(info, offers, |listing| Reader { images_root, is_ours, categories, has_policy, listing });
    notes.splice(0..0, opened.notes);
    Ok(Opened { derived, lists_all_images: false, category_ids, notes, ..opened })
}

/// The categories that a file lists, and behind them the names of regions that it does not list.
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

impl ImageAnnotation {
    /// The regions of objects, each with its number from 1.
    fn objects(&self) -> impl Iterator<Item = (usize, &Region)> {
        (1..).zip(&self.regions).filter(|(_, region)| region.is_stuff == 0)
    }

    /// A key of a region, for messages.
    fn key(&self, region: usize, key: &str) -> String {
        format!("annotation {}: `regions[{}].{key}`", self.id, region - 1)
    }

    /// The pairs of regions, by their numbers from 1, of which the first is in front of the second.
    fn constraints(&self) -> Result<BTreeSet<[usize; 2]>, String> {
        let number = |text: &str| {
            let number = text.trim().parse().ok().filter(|number| (1..=self.regions.len()).contains(number));
            number.ok_or_else(|| {
                format!(
                    "annotation {}: `depth_constraint` has `{text}`; regions are 1 to {}",
                    self.id,
                    self.regions.len()
                )
            })
        };
        let pair = |text: &str| {
            let (front, back) = text.split_once('-').unwrap_or((text, ""));
            Ok([number(front)?, number(back)?])
        };
        self.depth_constraint.split(',').filter(|text| !text.trim().is_empty()).map(pair).collect()
    }

    fn mask(&self, number: usize, (key, rle): (&str, &Rle), [width, height]: [u32; 2]) -> Result<Mask> {
        let decoded = Segmentation::Rle(rle.clone()).decode(width, height);
        decoded.map_err(|error| error.context(self.key(number, key)))
    }

    fn polygon(&self, number: usize, region: &Region, [width, height]: [u32; 2]) -> Result<Mask> {
        let decoded = Segmentation::Polygons(vec![region.segmentation.clone()]).decode(width, height);
        decoded.map_err(|error| error.context(self.key(number, "segmentation")))
    }

    /// Visible, amodal and occlusion mask of a region. Without occlusion there is only the polygon; else the masks are exact.
    fn masks(&self, number: usize, region: &Region, size: [u32; 2]) -> Result<[Mask; 3]> {
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

    /// The labels of its objects. Rates that count what is `beyond` the image are those that it states.
    fn labels(&self, categories: &Categories, size: [u32; 2], beyond: bool) -> Result<Vec<Labels>> {
        let of = |(row, (number, region)): (usize, (usize, &Region))| {
            let [visible, amodal, _] = self.masks(number, region, size)?;
            Ok(Labels {
                id: read::id_of(row)?,
                visible,
                amodal: Some(amodal),
                occlusion: None,
                rate: region.occlude_rate.filter(|_| beyond),
                visible_box: None,
                amodal_box: None,
                category: categories.id_of(&region.name),
            })
        };
        let mut labels = self.objects().enumerate().map(of).collect::<Result<Vec<_>>>()?;
        settle_edges(&mut labels);
        Ok(labels)
    }

    /// What it says beside its masks, and what contradicts them. Rates may count what is `beyond` the image.
    fn faults(&self, size: [u32; 2], beyond: bool, is_ours: bool) -> Vec<(&'static str, String)> {
        let mut faults = Vec::new();
        if let Some(count) = self.size.filter(|count| *count != self.regions.len()) {
            let message = format!("annotation {}: `size` is {count}, it has {} regions", self.id, self.regions.len());
            faults.push(("records_agree", message));
        }
        for (number, region) in self.objects() {
            if let Some(order) = region.order.filter(|order| *order != number) {
                let message = format!("{} is {order}, its place from the front {number}", self.key(number, "order"));
                faults.push(("records_agree", message));
            }
            let (Ok([visible, amodal, hidden]), Ok(polygon)) =
                (self.masks(number, region, size), self.polygon(number, region, size))
            else {
                continue;
            };
            if visible.is_empty() && amodal.is_empty() {
                faults.push(shared::no_pixels(&format!("annotation {}: `regions[{}]`", self.id, number - 1)));
            }
            faults.extend(self.faults_of_masks(number, region, [&visible, &amodal, &hidden], (&polygon, beyond)));
        }
        match self.constraints() {
            Ok(pairs) => {
                faults.extend(self.faults_of_order(&pairs, size));
                // Files of others may have a part of all pairs.
                if is_ours || pairs.is_empty() {
                    faults.extend(self.missing_pair(&pairs, size));
                }
            }
            Err(message) => faults.push(("records_agree", message)),
        }
        faults
    }

    fn faults_of_masks(
        &self,
        number: usize,
        region: &Region,
        [visible, amodal, hidden]: [&Mask; 3],
        (polygon, beyond): (&Mask, bool),
    ) -> Vec<(&'static str, String)> {
        let mut faults = Vec::new();
        let edge = edge_px2(amodal).max(1.0);
        let area = f64::from(amodal.area());
        if let Some(said) = region.area.filter(|said| (said - area).abs() > edge) {
            let message = format!("{} is {said}, its masks have {area}", self.key(number, "area"));
            faults.push(("areas_are_those_of_masks", message));
        }
        let rate = if area == 0.0 { 0.0 } else { f64::from(hidden.area()) / area };
        // A rate may be that of the polygon, whose area is off by the pixels at its edge.
        let of_area = |area: f64| if area <= 0.0 { 1.0 } else { (f64::from(hidden.area()) / area).min(1.0) };
        let [low, high] = match (&region.visible_mask, &region.invisible_mask) {
            // What is hidden is what the polygon has more.
            (Some(_), None) => [-1.0, 1.0].map(|sign: f64| rate + sign * edge / area.max(1.0)),
            _ => [rate.min(of_area(area + edge)), rate.max(of_area(area - edge))],
        };
        let is_off =
            |said: &f64| *said < low - TWO_DECIMALS || (!beyond && *said > high + TWO_DECIMALS) || said.is_nan();
        if let Some(said) = region.occlude_rate.filter(is_off) {
            let message = format!("{} is {said}, that of its masks {rate:.6}", self.key(number, "occlude_rate"));
            faults.push(("rate_is_ratio_of_areas", message));
        }
        let both = visible.and(hidden).area();
        if both > 0 {
            let message = format!("{}: {both} of its pixels are visible, too", self.key(number, "invisible_mask"));
            faults.push(("occlusion_is_amodal_minus_visible", message));
        }
        // A polygon fills the holes of its mask.
        let more = polygon.minus(amodal);
        let holes: u32 = enclosed(&more, polygon).iter().map(Mask::area).sum();
        let differ = f64::from(amodal.minus(polygon).area() + more.area() - holes);
        if differ > edge {
            let message = format!("{} differs from its masks at {differ} pixels", self.key(number, "segmentation"));
            faults.push(("polygon_is_that_of_masks", message));
        }
        faults
    }

    /// The first two regions that are no pair, although the one in front hides a part of the other, away from its own edge.
    fn missing_pair(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Option<(&'static str, String)> {
        let masks = self.objects().filter_map(|(number, region)| {
            let [visible, _, hidden] = self.masks(number, region, size).ok()?;
            Some((number, eroded(&visible), hidden))
        });
        let masks: Vec<(usize, Mask, Mask)> = masks.collect();
        let boxes = |of: fn(&(usize, Mask, Mask)) -> &Mask| masks.iter().map(|it| of(it).bbox()).collect::<Vec<BBox>>();
        let mut meeting = Vec::new();
        meeting_boxes(&boxes(|it| &it.1), &boxes(|it| &it.2), |front, back| {
            let pair = [masks[front].0, masks[back].0];
            meeting.extend((front < back && !pairs.contains(&pair)).then_some((front, back)));
        });
        meeting.sort_unstable();
        meeting.into_iter().find_map(|(front, back)| {
            let ((front, seen, _), (back, _, hidden)) = (&masks[front], &masks[back]);
            let area = seen.shared_area(hidden);
            let message = format!(
                "annotation {}: `depth_constraint` has no pair {front}-{back}, and region {front} hides {area} pixels of \
                 region {back}",
                self.id
            );
            (area > 0).then_some(("order_is_that_of_masks", message))
        })
    }

    /// Pairs whose order the masks contradict: the object behind hides a part of that in front, and not the other way round.
    fn faults_of_order(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Vec<(&'static str, String)> {
        let masks =
            self.objects().filter_map(|(number, region)| Some((number, self.masks(number, region, size).ok()?)));
        let masks: BTreeMap<usize, [Mask; 3]> = masks.collect();
        let wrong = |&[front, back]: &[usize; 2]| {
            let ([seen, _, hidden], [seen_behind, _, hidden_behind]) = (masks.get(&front)?, masks.get(&back)?);
            let opposite = seen_behind.shared_area(hidden);
            (opposite > 0 && seen.shared_area(hidden_behind) == 0).then(|| {
                let message = format!(
                    "annotation {}: `depth_constraint` has {front}-{back}, and by its masks region {back} hides {opposite} pixels of \
                     region {front}",
                    self.id
                );
                ("order_is_that_of_masks", message)
            })
        };
        pairs.iter().filter_map(wrong).collect()
    }
}

impl ImageSource for Reader {
    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let frame = &self.listing.images[image].frame;
        let Ok(Some(annotation)) = self.annotation(image) else { return Vec::new() };
        let Ok(beyond) = self.counts_beyond(image) else { return Vec::new() };
        annotation.faults([frame.width, frame.height], beyond, self.is_ours)
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let frame = &self.listing.images[image].frame;
        let size = [frame.width, frame.height];
        let mut products = Products::new();
        if wants.iter().any(is_label) {
            let labels = match self.annotation(image)? {
                Some(annotation) => annotation.labels(&self.categories, size, self.counts_beyond(image)?)?,
                None => Vec::new(),
            };
            read::put(&labels, None, wants, &mut products)?;
        }
        if self.has_policy && wants.contains(&LABEL_POLICY.id()) {
            let record: Image = self.listing.image(image)?;
            if let Some(policy) = shared::policy(&record) {
                products.put(LABEL_POLICY, Value::of(policy)?)?;
            }
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, decode::rgb_of_size(&self.images_root.file(&frame.file_name)?, size)?)?;
        }
        Ok(ReadImage::new(size, products))
    }
}

/// Whether a product follows from masks.
fn is_label(key: &KeyId) -> bool {
    ![RGB.id(), LABEL_POLICY.id()].contains(key)
}

impl Reader {
    /// Whether the rates of an image count what is beyond it.
    fn counts_beyond(&self, image: usize) -> Result<bool> {
        Ok(self.has_policy && shared::counts_beyond(&self.listing.image(image)?))
    }

    /// The first annotation of an image.
    fn annotation(&self, image: usize) -> Result<Option<ImageAnnotation>> {
        let numbers = &self.listing.images[image].annotations;
        let first = numbers.get(..1).unwrap_or_default();
        let records: Vec<ImageAnnotation> =
            self.listing.file.records(syntable_formats::index::Section::Annotations, first)?;
        let annotation = records.into_iter().next();
        annotation.iter().try_for_each(|annotation| ANNOTATIONS.check(annotation.regions.len() as u64))?;
        Ok(annotation)
    }
}
