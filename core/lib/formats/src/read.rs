//! Shared code of all readers: products from the labels in a file, categories, faults, and scenes from names.

use crate::coco::Category;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetFolder;
use syntable_model::limits::ORDERED;
pub use syntable_model::product::masks_of;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CATEGORY_ID, LABEL_POLICY, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, VISIBLE_BOX,
    VISIBLE_MASK, is_image_file,
};
use syntable_model::product::{
    BBox, Key, KeyId, Mask, OcclusionOrder, PerInstance, PixelCounts, Product, Products, Value, meeting_boxes,
};
use syntable_model::reader::{DatasetFault, FaultSubject, ImageRef};
use syntable_model::rule;
use syntable_model::scene::{InstanceId, SceneId, ViewId};
use syntable_model::stage::{DatasetInfo, LabelSurface, OwnCategory};

/// The labels of an object in a file. Missing labels are derived from the masks.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectLabels {
    /// Its id in the scene or the image.
    pub id: InstanceId,
    /// Visible mask.
    pub visible: Mask,
    /// Amodal mask; none if the format does not store it.
    pub amodal: Option<Mask>,
    /// Occlusion mask.
    pub occlusion: Option<Mask>,
    /// Occlusion rate.
    pub rate: Option<f64>,
    /// Box of the visible mask.
    pub visible_box: Option<BBox>,
    /// Box of the amodal mask.
    pub amodal_box: Option<BBox>,
    /// Id of its category.
    pub category: u32,
}

/// The kinds of object masks in a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownMasks {
    /// The visible part of each object.
    Visible,
    /// Whole objects without their visible parts, so that occlusion is unknown.
    Amodal,
    /// Both.
    Both,
}

impl KnownMasks {
    /// The products that [`put`] makes from them. With amodal masks alone, [`ObjectLabels::visible`] has no meaning.
    pub fn offers(self) -> Vec<KeyId> {
        let mut keys = syntable_model::keys![CATEGORY_ID];
        if self != Self::Amodal {
            keys.extend(syntable_model::keys![VISIBLE_MASK, VISIBLE_BOX]);
        }
        if self != Self::Visible {
            keys.extend(syntable_model::keys![AMODAL_MASK, AMODAL_BOX]);
        }
        if self == Self::Both {
            keys.extend(syntable_model::keys![OCCLUSION_MASK, OCCLUSION_RATE, OCCLUSION_ORDER]);
        }
        keys
    }

    /// The masks of a dataset with visible masks and, if `has_amodal`, amodal masks.
    pub fn with_amodal(has_amodal: bool) -> Self {
        if has_amodal { Self::Both } else { Self::Visible }
    }
}

/// Ids of the objects of an image. The stated ids if every object has one, all are distinct, and 0, the background, is
/// not among them; else the objects' positions, from 1.
///
/// # Errors
/// If the image has more objects than ids.
pub fn ids_of(stated: &[Option<u64>]) -> Result<Vec<InstanceId>> {
    let own: Option<Vec<u16>> = stated.iter().map(|id| id.and_then(|id| u16::try_from(id).ok())).collect();
    let are_told_apart = |ids: &Vec<u16>| !ids.contains(&0) && ids.iter().collect::<BTreeSet<_>>().len() == ids.len();
    if let Some(own) = own.filter(are_told_apart) {
        return Ok(own.into_iter().map(InstanceId).collect());
    }
    (0..stated.len()).map(id_of).collect()
}

/// The id of an object by its index in its image, from 0.
///
/// # Errors
/// If the image has more objects than ids.
pub fn id_of(row: usize) -> Result<InstanceId> {
    match u16::try_from(row + 1) {
        Ok(id) => Ok(InstanceId(id)),
        Err(_) => Err(Error::new(format!("an image has more than {} objects", u16::MAX))
            .help("split the image, or remove objects")),
    }
}

/// The fault of the object ids that a file states for an image.
pub fn id_fault(stated: &[Option<u64>]) -> Option<DatasetFault> {
    let ids = ids_of(stated).ok()?;
    let differ = ids.iter().zip(stated).any(|(id, own)| Some(u64::from(id.0)) != *own);
    let message = "the `instance_id` of its annotations are not distinct numbers from 1 to 65535";
    (differ && stated.iter().any(Option::is_some)).then(|| DatasetFault::new(rule::UNIQUE_IDS, message))
}

/// Puts the wanted products. `order` is the stated order of the dataset; without it, the order is derived from the
/// masks.
pub fn put(
    labels: &[ObjectLabels],
    order: Option<OcclusionOrder>,
    wants: &[KeyId],
    products: &mut Products,
) -> Result<()> {
    let mut of = WantedLabels { labels, wants, products };
    of.each(VISIBLE_MASK, |it| Some(it.visible.clone()))?;
    of.each(VISIBLE_BOX, |it| Some(it.visible_box.unwrap_or_else(|| it.visible.bbox())))?;
    of.each(CATEGORY_ID, |it| Some(it.category))?;
    of.each(AMODAL_MASK, |it| it.amodal.clone())?;
    of.each(AMODAL_BOX, |it| Some(it.amodal_box.unwrap_or(it.amodal.as_ref()?.bbox())))?;
    of.each(OCCLUSION_MASK, ObjectLabels::hidden)?;
    of.each(OCCLUSION_RATE, ObjectLabels::hidden_rate)?;
    if wants.contains(&OCCLUSION_ORDER.id()) {
        ORDERED.check(labels.len() as u64)?;
        products.put(OCCLUSION_ORDER, order.unwrap_or_else(|| order_of(labels)))?;
    }
    Ok(())
}

/// The note about [`visibility`].
pub const WITHIN_IMAGE: &str =
    "what of objects lies beyond the image is not known, and counts as nothing in `visibility`";

/// The product `visibility` from masks, which lack the parts outside the image.
pub fn visibility(labels: &[ObjectLabels]) -> Result<PerInstance<Value>> {
    labels.iter().map(|labels| Ok((labels.id, labels.counts().record()?))).collect()
}

struct WantedLabels<'a> {
    labels: &'a [ObjectLabels],
    wants: &'a [KeyId],
    products: &'a mut Products,
}

impl WantedLabels<'_> {
    fn each<T>(&mut self, key: Key<PerInstance<T>>, value: impl Fn(&ObjectLabels) -> Option<T>) -> Result<()>
    where
        PerInstance<T>: Product,
    {
        if !self.wants.contains(&key.id()) {
            return Ok(());
        }
        let values = self.labels.iter().filter_map(|it| Some((it.id, value(it)?))).collect();
        self.products.put(key, values)
    }
}

impl ObjectLabels {
    /// An object with only masks and a category.
    pub fn of_masks(id: InstanceId, visible: Mask, amodal: Option<Mask>, category: u32) -> Self {
        Self { id, visible, amodal, occlusion: None, rate: None, visible_box: None, amodal_box: None, category }
    }

    /// Whether no mask of the object has a pixel.
    pub fn is_empty(&self) -> bool {
        self.visible.is_empty() && self.amodal.as_ref().is_none_or(Mask::is_empty)
    }

    /// The stated occlusion mask, or else the amodal pixels that are not visible; none without an amodal mask.
    pub fn hidden(&self) -> Option<Mask> {
        self.occlusion.clone().or_else(|| Some(self.amodal.as_ref()?.minus(&self.visible)))
    }

    /// Pixels of the silhouette within the image.
    fn counts(&self) -> PixelCounts {
        let amodal = self.amodal.as_ref().unwrap_or(&self.visible);
        let area = u64::from(amodal.area());
        PixelCounts {
            all: area,
            in_frame: area,
            valid: area,
            visible: self.visible.area().into(),
            silhouette: amodal.bbox().into(),
        }
    }

    fn hidden_rate(&self) -> Option<f64> {
        let ratio = || {
            let (hidden, amodal) = (self.hidden()?.area(), self.amodal.as_ref()?.area());
            Some(if amodal == 0 { 0.0 } else { f64::from(hidden) / f64::from(amodal) })
        };
        self.rate.or_else(ratio)
    }
}

/// The occlusion order of labels, whose occlusion masks may be derived.
fn order_of(labels: &[ObjectLabels]) -> OcclusionOrder {
    let mut labels: Vec<&ObjectLabels> = labels.iter().collect();
    labels.sort_by_key(|it| it.id);
    let hidden: Vec<Option<Mask>> = labels.iter().map(|it| it.hidden()).collect();
    let objects = labels.iter().zip(&hidden).map(|(it, hidden)| (it.id, &it.visible, hidden.as_ref()));
    order_by(&objects.collect::<Vec<_>>(), occludes)
}

/// Whether an object with this visible mask occludes an object with this occlusion mask, by SynTable's Algorithm 1:
/// whether the masks share a pixel.
pub fn occludes(visible: &Mask, hidden: &Mask) -> bool {
    visible.shared_area(hidden) > 0
}

/// The occlusion order by a rule for pairs of a visible and an occlusion mask that share a pixel. `objects` are in the
/// order of their ids, with both masks.
pub fn order_by(
    objects: &[(InstanceId, &Mask, Option<&Mask>)],
    occludes: impl Fn(&Mask, &Mask) -> bool,
) -> OcclusionOrder {
    let visible: Vec<BBox> = objects.iter().map(|it| it.1.bbox()).collect();
    let hidden: Vec<BBox> = objects.iter().map(|it| it.2.map(Mask::bbox).unwrap_or_default()).collect();
    let mut order = OcclusionOrder::new(objects.iter().map(|it| it.0).collect());
    meeting_boxes(&visible, &hidden, |row, column| {
        if row != column && objects[column].2.is_some_and(|hidden| occludes(objects[row].1, hidden)) {
            order.set(row, column);
        }
    });
    order
}

/// The value of an object in a product.
///
/// # Errors
/// If the product is missing, or has no value for the object.
pub fn label_of<T: 'static>(products: &Products, key: Key<PerInstance<T>>, id: InstanceId) -> Result<&T>
where
    PerInstance<T>: Product,
{
    products.get(key)?.get(id).ok_or_else(|| {
        Error::new(format!("instance {id} is in the masks but not in `{}`", key.name()))
            .help("all label products must come from one annotator, or from annotators that agree")
    })
}

/// The products that are labels, not images.
pub fn labels_among(products: &[KeyId]) -> Vec<KeyId> {
    products.iter().copied().filter(|key| !is_image_file(*key) && *key != LABEL_POLICY.id()).collect()
}

/// The categories of an annotation file, and their ids in a dataset that is written from it.
///
/// The ids of the file are kept if all are from 1 to 2³² − 2: 0 is the background in maps. Otherwise, and for formats
/// without ids, categories are numbered like the classes of a recipe.
#[derive(Debug, Clone, Default)]
pub struct Categories {
    names: BTreeMap<u64, String>,
    /// Supercategories by id, for the categories that have one.
    supercategories: BTreeMap<u64, String>,
    classes: Vec<String>,
    /// Whether the ids of the file are kept.
    keeps_ids: bool,
    /// Whether an object has a category that the file does not list.
    has_unknown: bool,
}

impl Categories {
    /// The categories of a file. A category 0 named `background` is the background, as in SynTable's files, and not a
    /// class.
    pub fn of(categories: &[Category]) -> Self {
        let names: BTreeMap<u64, String> = categories.iter().map(|it| (it.id, it.name.clone())).collect();
        let is_background = |id: u64, name: &str| id == BACKGROUND && name.eq_ignore_ascii_case("background");
        let own: Vec<(u64, &String)> =
            names.iter().map(|(id, name)| (*id, name)).filter(|(id, name)| !is_background(*id, name)).collect();
        // The id after the last one is for objects without any of these categories.
        let keeps_ids = !own.is_empty() && own.iter().all(|(id, _)| (1..u64::from(u32::MAX)).contains(id));
        let classes: BTreeSet<String> =
            own.iter().filter(|(_, name)| **name != DatasetInfo::OBJECT.1).map(|(_, name)| (*name).clone()).collect();
        let tells = |it: &&Category| !it.supercategory.is_empty();
        let supercategories = categories.iter().filter(tells).map(|it| (it.id, it.supercategory.clone())).collect();
        Self { classes: classes.into_iter().collect(), keeps_ids, has_unknown: false, names, supercategories }
    }

    /// The categories of a format with names but no ids.
    pub fn named(names: impl IntoIterator<Item = String>) -> Self {
        let category = |(id, name)| Category { id, name, ..Category::default() };
        // No name is the background.
        let categories = (BACKGROUND + 1..).zip(names).map(category).collect::<Vec<_>>();
        Self { keeps_ids: false, ..Self::of(&categories) }
    }

    /// Forgets a supercategory that a format gives to all categories.
    pub fn forget_supercategory(&mut self, name: &str) {
        self.supercategories.retain(|_, other| other != name);
    }

    /// Records the category of an object, which may be unknown.
    pub fn note(&mut self, id: u64) {
        self.has_unknown |= !self.names.contains_key(&id) || id == BACKGROUND;
    }

    /// The id of the category with this name.
    pub fn id_of(&self, name: &str) -> u32 {
        if self.keeps_ids {
            return self.own().find(|(_, own)| *own == name).map_or_else(|| self.object(), |(id, _)| id);
        }
        let place = self.classes.binary_search_by(|class| class.as_str().cmp(name));
        place.map_or(DatasetInfo::OBJECT.0, |at| DatasetInfo::OBJECT.0 + 1 + at as u32)
    }

    /// The id of a file's category in a dataset that is written from it.
    pub fn id(&self, id: u64) -> u32 {
        self.known(id).unwrap_or_else(|| self.object())
    }

    /// Like [`id`](Self::id), but none if the file has no such category.
    pub fn known(&self, id: u64) -> Option<u32> {
        let name = self.names.get(&id)?;
        match self.keeps_ids {
            true => (id != BACKGROUND).then_some(id as u32),
            false => Some(self.id_of(name)),
        }
    }

    /// Ids of the file's categories, with their ids in a dataset that is written from it.
    pub fn ids(&self) -> BTreeMap<u64, u32> {
        self.names.keys().filter_map(|id| Some((*id, self.known(*id)?))).collect()
    }

    /// The category of objects without a class: the category `object` if the file has it, else one more than the
    /// largest id.
    fn object(&self) -> u32 {
        if !self.keeps_ids {
            return DatasetInfo::OBJECT.0;
        }
        let named = self.own().find(|(_, name)| *name == DatasetInfo::OBJECT.1);
        named.map_or_else(|| self.own().map(|(id, _)| id).max().unwrap_or_default() + 1, |(id, _)| id)
    }

    /// Ids and names of the categories whose ids are kept.
    fn own(&self) -> impl Iterator<Item = (u32, &String)> {
        self.names.iter().filter(|(id, _)| self.keeps_ids && **id != BACKGROUND).map(|(id, name)| (*id as u32, name))
    }

    /// The description of a dataset with these images.
    pub fn info(&self, name: String, program: String, images: &[ImageRef], recipe: String) -> DatasetInfo {
        let (scenes, views) = (images.iter().map(|it| it.scene.0).max(), images.iter().map(|it| it.view.0).max());
        let [scenes, views_per_scene] = [scenes, views].map(|last| last.map_or(0, |last| last.saturating_add(1)));
        let own = |id: u32, name: &str| {
            let supercategory = self.supercategories.get(&id.into()).cloned().unwrap_or_default();
            OwnCategory { id, name: name.to_owned(), supercategory }
        };
        let mut own_categories: Vec<OwnCategory> = self.own().map(|(id, name)| own(id, name)).collect();
        let object = self.object();
        if self.keeps_ids && self.has_unknown && !own_categories.iter().any(|it| it.id == object) {
            own_categories.push(own(object, DatasetInfo::OBJECT.1));
        }
        let classes = self.classes.clone();
        let label_surface = LabelSurface::First;
        DatasetInfo { name, seed: 0, scenes, views_per_scene, recipe, program, classes, own_categories, label_surface }
    }
}

/// Largest number up to which [`with_gaps_filled`] fills a list.
const FILLED: u64 = 1 << 16;

/// Fills the gaps in the category numbers of a dataset without a list of categories: returns all numbers up to the
/// largest.
///
/// Writers such as `yolo` number categories by their positions in the list, so positions must not depend on the content
/// of the images in a part of a dataset. The set stays unchanged if it has a 0, since such numbers are not kept, or a
/// number above 65,536.
pub fn with_gaps_filled(mut numbers: BTreeSet<u64>) -> BTreeSet<u64> {
    if let Some(last) = numbers.last().copied().filter(|last| are_filled(&numbers, *last)) {
        numbers.extend(1..=last);
    }
    numbers
}

fn are_filled(numbers: &BTreeSet<u64>, last: u64) -> bool {
    last <= FILLED && !numbers.contains(&BACKGROUND)
}

/// Message about such numbers; none if the set is empty. `list` names the file that would list all categories.
pub fn unlisted(numbers: &BTreeSet<u64>, list: &str) -> Option<String> {
    let last = *numbers.last()?;
    let known = match are_filled(numbers, last) {
        true => format!("they are numbered up to {last}, the largest number here, and another part of the dataset may have more"),
        false => "a format that numbers them by their places, such as `yolo`, may number another part of the dataset otherwise"
            .to_owned(),
    };
    Some(format!("nothing lists all categories of the dataset ({list} would): {known}"))
}

/// Category of the background in SynTable's own files, which is no object.
pub const BACKGROUND: u64 = 0;

/// Supercategory of all categories in SynTable's files, which therefore carries no information.
pub const SUPERCATEGORY: &str = "shape";

/// The faults that a reader finds while it opens a dataset.
#[derive(Debug, Default)]
pub struct Faults(Vec<DatasetFault>);

impl Faults {
    /// Adds a fault.
    pub fn add(&mut self, rule: &'static str, subject: impl Into<FaultSubject>, message: impl Into<String>) {
        self.0.push(DatasetFault::new(rule, message).of(subject));
    }

    /// Adds a fault that makes the reader omit images.
    pub fn lost(&mut self, rule: &'static str, subject: impl Into<FaultSubject>, message: impl Into<String>) {
        self.0.push(DatasetFault { is_lost: true, ..DatasetFault::new(rule, message).of(subject) });
    }

    /// Adds faults for duplicate ids and names of categories.
    pub fn of_categories(&mut self, categories: &[Category]) {
        let mut names = BTreeMap::new();
        for category in categories {
            if let Some(first) = names.insert(category.name.as_str(), category.id).filter(|first| *first != category.id)
            {
                let message = format!("category {first} has this name, too: `{}`", category.name);
                self.add(rule::UNIQUE_NAMES, FaultSubject::Category(category.id), message);
            }
        }
        let mut seen = BTreeSet::new();
        for category in categories.iter().filter(|category| !seen.insert(category.id)) {
            let message = format!("two categories have this id; the last one, `{}`, counts", category.name);
            self.add(rule::UNIQUE_IDS, FaultSubject::Category(category.id), message);
        }
    }

    /// Adds faults for duplicate ids of annotations, and for their unknown categories.
    pub fn of_annotations(&mut self, categories: &Categories, annotations: impl Iterator<Item = (u64, Option<u64>)>) {
        let mut seen = BTreeSet::new();
        for (id, category) in annotations {
            if !seen.insert(id) {
                self.add(rule::UNIQUE_IDS, FaultSubject::Annotation(id), "two annotations have this id");
            }
            if let Some(category) = category.filter(|category| !categories.names.contains_key(category)) {
                let message = format!("unknown category {category}");
                self.add(rule::KNOWN_CATEGORIES, FaultSubject::Annotation(id), message);
            }
        }
    }

    /// Sorts images by scene and view: from their records, else from their names `{scene}_{view}`. Unless all images
    /// have these, each image is a scene. A second image of a view is a fault and omitted.
    pub fn in_order<R>(
        &mut self,
        records: Vec<R>,
        of: impl Fn(&R) -> (&String, Option<(u32, u32)>),
    ) -> (Vec<ImageRef>, Vec<R>) {
        let mut placed: BTreeMap<(u32, u32), (ImageRef, R)> = BTreeMap::new();
        let named = records.iter().all(|record| of(record).1.or_else(|| place_in_name(of(record).0)).is_some());
        for (number, record) in (0..).zip(records) {
            let (name, said) = of(&record);
            let place = said.or_else(|| place_in_name(name)).filter(|_| named).unwrap_or((number, 0));
            let image = image(place, name.clone());
            match placed.entry(place) {
                Entry::Vacant(entry) => drop(entry.insert((image, record))),
                Entry::Occupied(first) => {
                    let message = format!("it is view {} of scene {}, as {} is", place.1, place.0, first.get().0.name);
                    self.lost(rule::UNIQUE_VIEWS, image.name, message);
                }
            }
        }
        placed.into_values().unzip()
    }

    /// All faults.
    pub fn into_inner(self) -> Vec<DatasetFault> {
        self.0
    }
}

/// The name of a dataset that states none: the name of its folder, or of its file without the extension.
pub fn name_of(root: &Path) -> String {
    let name = if root.is_file() { root.file_stem() } else { root.file_name() };
    name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The name of a file without its folder.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// JSON files in a folder, sorted.
///
/// # Errors
/// If the folder cannot be read.
pub fn json_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let files = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    let mut files: Vec<PathBuf> = files.into_iter().filter(|path| path.is_file() && is_json(path)).collect();
    files.sort();
    Ok(files)
}

/// The entries of a folder with wanted extensions, with their names without extensions, sorted. An entry that is not a
/// file fails when it is read.
///
/// # Errors
/// If the folder cannot be read.
pub fn entries_with(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<(String, PathBuf)>> {
    let fail = |error: std::io::Error| Error::io(folder, &error).of_request();
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let is_one = path.extension().and_then(|end| end.to_str()).is_some_and(&is_wanted);
        if let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()).filter(|_| is_one) {
            files.push((stem.to_owned(), path.clone()));
        }
    }
    files.sort();
    Ok(files)
}

/// Whether a file has the JSON extension.
pub fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == "json")
}

/// The folder above a file, independent of the working directory.
pub fn above(file: &Path) -> PathBuf {
    let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    file.parent().map_or_else(|| file.clone(), Path::to_owned)
}

/// The entries of a folder, sorted; nothing if it cannot be read.
pub fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    entries.sort();
    entries
}

/// Refuses files found in a folder of a dataset if one is a link that leads outside.
pub fn check_inside<'p>(folder: &DatasetFolder, files: impl IntoIterator<Item = &'p PathBuf>) -> Result<()> {
    files.into_iter().try_for_each(|path| folder.file(path.file_name().unwrap_or_default()).map(drop))
}

/// The image of a view, with its name.
pub fn image((scene, view): (u32, u32), name: String) -> ImageRef {
    ImageRef { scene: SceneId(scene), view: ViewId(view), name, id: None }
}

/// Image and object in the name of a mask, `IMAGE_LABEL`. Label 0 is the background.
pub fn labeled(name: &str) -> Option<(&str, u16)> {
    let (image, digits) = name.rsplit_once('_')?;
    let label = digits.parse().ok().filter(|label| *label > 0)?;
    digits.bytes().all(|byte| byte.is_ascii_digit()).then_some((image, label))
}

/// Scene and view in an image name `{scene}_{view}`.
pub fn place_in_name(name: &str) -> Option<(u32, u32)> {
    let (scene, view) = Path::new(name).file_stem()?.to_str()?.split_once('_')?;
    Some((scene.parse().ok()?, view.parse().ok()?))
}
