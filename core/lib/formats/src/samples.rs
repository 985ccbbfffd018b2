//! Datasets of samples: the products of each view by name, as generic writers store them.
//!
//! A format locates samples and reads the values of their fields. The products of these fields, and the labels derived
//! from them, are the same for all formats.

use crate::coco::Category;
use crate::known::KnownProducts;
use crate::read::{self, Categories, Faults, KnownMasks, ObjectLabels};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use syntable_model::error::{Error, Result};
use syntable_model::limits::IMAGE_PIXELS;
use syntable_model::product::standard::{
    AMODAL_BITS, AMODAL_BOX, AMODAL_MASK, CAMERA, CATEGORY_ID, OBJECT_NAME, OCCLUSION_ORDER, OCCLUSION_RATE,
    VISIBILITY, VISIBLE_BOX, VISIBLE_IDS, VISIBLE_MASK,
};
use syntable_model::product::{
    Form, Key, KeyId, Mask, PerInstance, Plane, Product, Products, Scope, Semantic, Stored, Tensor, Value,
};
use syntable_model::reader::{
    DatasetFault, FaultSubject, ImageRef, ImageSource, Note, Opened, ReadImage, unnamed_category,
};
use syntable_model::rule;
use syntable_model::scene::InstanceId;
use syntable_model::shown::shown;
use syntable_model::stage::DatasetInfo;

/// The fields of a sample by name.
pub type SampleFields = BTreeMap<String, Value>;

/// The content of a dataset, without the values of its samples.
#[derive(Debug, Default)]
pub struct Contents {
    /// The views of the samples, by scene and view.
    pub images: Vec<ImageRef>,
    /// Names of the fields that samples have.
    pub fields: BTreeSet<String>,
    /// The products that samples may have.
    pub known: KnownProducts,
    /// Faults of the dataset as a whole.
    pub faults: Faults,
    /// The categories, if the dataset lists them.
    pub categories: Option<Vec<Category>>,
    /// Category names by id, from the objects of the dataset. Used if no file lists all categories.
    pub named: BTreeMap<u64, String>,
    /// The fields without values for hidden objects, which may still be annotated.
    pub of_shown: BTreeSet<String>,
    /// Whether the format omits images without objects.
    pub leaves_out_empty: bool,
}

/// The samples of a dataset.
pub trait SampleReader: Send + Sync {
    /// The wanted fields that the sample of an image has. A value per instance is [`Value::PerInstance`] or a record
    /// with ids as keys.
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields>;
    /// Width and height of an image, if the format states them outside its fields.
    fn size(&self, image: usize) -> Option<[u32; 2]> {
        let _ = image;
        None
    }
}

/// Files of views, in order. A second file of a view is a fault and omitted.
pub fn files_of_views(files: Vec<((u32, u32), PathBuf)>, faults: &mut Faults) -> BTreeMap<(u32, u32), PathBuf> {
    let mut views = BTreeMap::new();
    for (place, path) in files {
        match views.entry(place) {
            Entry::Vacant(entry) => drop(entry.insert(path)),
            Entry::Occupied(first) => {
                let (scene, view) = place;
                let message = format!("it is view {view} of scene {scene}, as {} is", shown(first.get()).display());
                faults.lost(rule::UNIQUE_VIEWS, shown(&path).display().to_string(), message);
            }
        }
    }
    views
}

/// The most recently read values, for readers of files that many images share.
#[derive(Debug)]
pub struct Latest<K, V>(Mutex<VecDeque<(K, Arc<V>)>>);

/// Number of values. It is more than one because threads work on different scenes.
const KEPT: usize = 4;

impl<K: PartialEq, V> Default for Latest<K, V> {
    fn default() -> Self {
        Self(Mutex::new(VecDeque::new()))
    }
}

impl<K: PartialEq, V> Latest<K, V> {
    /// The value of a key. Reads it unless it is among the most recent values.
    pub fn get(&self, key: K, read: impl FnOnce() -> Result<V>) -> Result<Arc<V>> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, value)) = kept().iter().find(|(other, _)| *other == key) {
            return Ok(Arc::clone(value));
        }
        let value = Arc::new(read()?);
        let mut kept = kept();
        kept.push_back((key, Arc::clone(&value)));
        if kept.len() > KEPT {
            kept.pop_front();
        }
        Ok(value)
    }
}

/// Fields whose instances are exactly the annotated ones, fast ones first.
const OF_ANNOTATED: [KeyId; 7] = [
    CATEGORY_ID.id(),
    AMODAL_BOX.id(),
    VISIBLE_BOX.id(),
    OCCLUSION_RATE.id(),
    OBJECT_NAME.id(),
    AMODAL_MASK.id(),
    VISIBLE_MASK.id(),
];

/// The values of instances from one array, with the instances along the first axis. An error is the reason.
pub fn instances(values: &Tensor, ids: &Tensor) -> Result<Value, String> {
    let ids: Vec<InstanceId> = ids_of(ids)?;
    let (count, shape) = values.shape.split_first().ok_or("it is a single number")?;
    if *count != ids.len() {
        return Err(format!("it has {count} values of {} ids", ids.len()));
    }
    let size = shape.iter().product::<usize>() * values.dtype.size();
    let axes = values.axes[1..].to_vec();
    let row = |row: usize| match shape {
        [] => values.element(row),
        _ => Value::Tensor(Tensor {
            dtype: values.dtype,
            axes: axes.clone(),
            shape: shape.to_vec(),
            bytes: values.bytes[row * size..][..size].to_vec(),
        }),
    };
    Ok(Value::PerInstance(ids.into_iter().enumerate().map(|(at, id)| (id, row(at))).collect()))
}

/// The ids, which must be ascending. All other axes of instances have the same order. An error is the reason.
pub fn ids_of(ids: &Tensor) -> Result<Vec<InstanceId>, String> {
    if ids.shape.len() != 1 {
        return Err(format!("ids are of shape {:?}", ids.shape));
    }
    let id = |at: usize| match ids.element(at) {
        Value::Int(id) => u16::try_from(id).ok(),
        Value::Uint(id) => u16::try_from(id).ok(),
        _ => None,
    };
    let all: Option<Vec<u16>> = (0..ids.shape[0]).map(id).collect();
    let is_sound = |all: &Vec<u16>| all.iter().zip(std::iter::once(&0).chain(all)).all(|(id, before)| id > before);
    let all = all.filter(is_sound).ok_or("ids are no numbers from 1 to 65535 in ascending order")?;
    Ok(all.into_iter().map(InstanceId).collect())
}

/// Opens a dataset of samples with this name.
pub fn open(name: String, mut contents: Contents, samples: Box<dyn SampleReader>) -> Opened {
    let of_view = |key: &KeyId| (key.scope == Scope::Scene || key.scope.comes_with_view()) && key.is_decoded();
    let is_stored = |key: &&KeyId| of_view(key) && contents.fields.contains(&key.to_string());
    let mut keys: Vec<KeyId> = contents.known.iter().filter(is_stored).copied().collect();
    let of_all = |key: &KeyId| keys.contains(key) && !contents.of_shown.contains(&key.to_string());
    let annotated = OF_ANNOTATED.into_iter().find(of_all);
    let has_categories = of_all(&CATEGORY_ID.id());
    // Occlusion orders and bits do not state their instances.
    if annotated.is_none() {
        keys.retain(|key| ![OCCLUSION_ORDER.id(), AMODAL_BITS.id()].contains(key));
    }
    let first = |of: [KeyId; 2]| of.into_iter().find(|key| keys.contains(key));
    let visible = first([VISIBLE_MASK.id(), VISIBLE_IDS.id()]);
    let amodal = first([AMODAL_MASK.id(), AMODAL_BITS.id()]);
    let known = match (visible, amodal) {
        (Some(_), Some(_)) => Some(KnownMasks::Both),
        (Some(_), None) => Some(KnownMasks::Visible),
        (None, Some(_)) => Some(KnownMasks::Amodal),
        (None, None) => None,
    };
    let used = categories_used(&contents, &*samples);
    let own = contents.categories.clone().unwrap_or_else(|| categories_of(&used, &contents.named));
    contents.faults.of_categories(&own);
    let mut categories = Categories::of(&own);
    used.into_iter().for_each(|id| categories.note(id.into()));
    // Objects without any category get a category of their own.
    if !has_categories {
        categories.note(read::BACKGROUND);
    }
    let info = categories.info(name, String::new(), &contents.images, String::new());
    let Contents { images, fields, faults, categories: listed, named, leaves_out_empty, .. } = contents;
    let refuses_unknown = listed.is_some();
    let category_ids = Some(categories.ids());
    let source = SampleSource { refuses_unknown, samples, categories, keys, visible, amodal, annotated, known };
    let follow = source.follow();
    let is_known = |name: &&String| source.keys.iter().any(|key| key.is(name));
    let others: Vec<String> = fields.iter().filter(|name| !is_known(name)).map(|name| format!("`{name}`")).collect();
    let mut notes = Vec::new();
    if !others.is_empty() {
        let text = format!("fields that are no products that files give back are left out: {}", others.join(", "));
        notes.push(Note::caveat(text));
    }
    if listed.is_none() && info.own_categories.len() > 1 {
        if named.is_empty() {
            notes.push(Note::caveat("the dataset has only ids of categories: names are made from the ids"));
        }
        let ids = info.own_categories.iter().map(|own| own.id.into()).collect();
        let unlisted = read::unlisted(&ids, "a file `categories.json`");
        notes.extend(unlisted.map(|text| Note::caveat(text).of([CATEGORY_ID.id()])));
    }
    if leaves_out_empty {
        notes.push(Note::caveat("these tables have no rows for images without objects, so such images are left out"));
    }
    if follow.contains(&VISIBILITY.id()) {
        notes.push(Note::caveat(read::WITHIN_IMAGE).of([VISIBILITY.id()]));
    }
    Opened {
        alike: vec![[VISIBLE_IDS.id(), VISIBLE_MASK.id()], [AMODAL_BITS.id(), AMODAL_MASK.id()]],
        faults: faults.into_inner(),
        lists_all_images: !leaves_out_empty,
        category_ids,
        notes,
        derived: follow.clone(),
        ..Opened::new(info, images, source.keys.iter().copied().chain(follow).collect(), source)
    }
}

/// Ids of the objects' categories.
fn categories_used(contents: &Contents, samples: &dyn SampleReader) -> BTreeSet<u32> {
    let name = CATEGORY_ID.name();
    let mut ids: BTreeSet<u32> = BTreeSet::new();
    if contents.fields.contains(name) {
        let wanted = BTreeSet::from([name]);
        for image in 0..contents.images.len() {
            // Errors are reported with their image.
            let fields = samples.read(image, &wanted).unwrap_or_default();
            let categories = fields.get(name).and_then(|value| <PerInstance<u32>>::decode(stored(value, &[])));
            ids.extend(categories.iter().flat_map(PerInstance::iter).map(|(_, id)| *id));
        }
    }
    ids
}

/// Categories from the ids and names of objects, if no file lists categories.
fn categories_of(used: &BTreeSet<u32>, named: &BTreeMap<u64, String>) -> Vec<Category> {
    let object = u64::from(DatasetInfo::OBJECT.0);
    let mut ids: BTreeSet<u64> = used.iter().copied().map(u64::from).chain(named.keys().copied()).collect();
    if ids.is_empty() {
        ids.insert(object);
    }
    let unnamed = |id: u64| if id == object { DatasetInfo::OBJECT.1.to_owned() } else { unnamed_category(id) };
    let name = |id: u64| named.get(&id).cloned().unwrap_or_else(|| unnamed(id));
    let ids = read::with_gaps_filled(ids);
    ids.into_iter().map(|id| Category { id, name: name(id), ..Category::default() }).collect()
}

fn stored<'a>(value: &'a Value, ids: &'a [InstanceId]) -> Stored<'a> {
    Stored { value, ids, missing: f64::NAN }
}

struct SampleSource {
    /// Whether a file lists all categories, so that others are a fault.
    refuses_unknown: bool,
    samples: Box<dyn SampleReader>,
    categories: Categories,
    /// The products of the samples.
    keys: Vec<KeyId>,
    /// The product with the visible masks.
    visible: Option<KeyId>,
    /// The product with the amodal masks.
    amodal: Option<KeyId>,
    /// The product that determines the annotated instances.
    annotated: Option<KeyId>,
    known: Option<KnownMasks>,
}

impl SampleSource {
    /// Products derived from the products of samples.
    fn follow(&self) -> Vec<KeyId> {
        let mut all = self.known.map(KnownMasks::offers).unwrap_or_default();
        all.extend((self.known == Some(KnownMasks::Both)).then_some(VISIBILITY.id()));
        all.into_iter().filter(|key| !self.keys.contains(key)).collect()
    }

    /// The fields that determine the size of an image, fast ones first.
    fn sized(&self) -> Vec<KeyId> {
        let camera = self.keys.iter().filter(|key| **key == CAMERA.id());
        let images = self.keys.iter().filter(|key| matches!(key.form(), Form::Image { .. }));
        // Bits are not pixels.
        let masks = self.visible.iter().chain(&self.amodal).filter(|key| **key != AMODAL_BITS.id());
        camera.chain(images).chain(masks).copied().collect()
    }

    /// Width and height of an image; zeros if no field determines them, such as masks of an image without objects.
    fn size(&self, image: usize, fields: &SampleFields) -> [u32; 2] {
        let read = |key: KeyId| -> Option<[u32; 2]> {
            let name = key.to_string();
            match fields.get(&name) {
                Some(value) => size_of(value),
                None => {
                    let fields = self.samples.read(image, &BTreeSet::from([name.as_str()])).ok()?;
                    size_of(fields.get(&name)?)
                }
            }
        };
        self.samples.size(image).or_else(|| self.sized().into_iter().find_map(read)).unwrap_or_default()
    }

    /// A field decoded as the type of its key.
    fn decoded<T: Product + Clone>(&self, key: Key<T>, fields: &SampleFields, ids: &[InstanceId]) -> Result<T> {
        let mut products = Products::new();
        products.put_stored(key.id(), stored(field(fields, key.id())?, ids)).map_err(|_| unlike(key.id()))?;
        products.get(key).cloned()
    }

    /// Labels of the annotated instances.
    fn labels(&self, fields: &SampleFields, ids: Option<&[InstanceId]>, size: [u32; 2]) -> Result<Vec<ObjectLabels>> {
        let annotated = ids.unwrap_or_default();
        let none = PerInstance::default;
        let visible = match self.visible {
            Some(key) if key == VISIBLE_MASK.id() => self.decoded(VISIBLE_MASK, fields, annotated)?,
            Some(_) => visible_masks(&self.decoded(VISIBLE_IDS, fields, annotated)?, ids),
            None => none(),
        };
        let amodal = match self.amodal {
            Some(key) if key == AMODAL_MASK.id() => self.decoded(AMODAL_MASK, fields, annotated)?,
            Some(_) => amodal_masks(&self.decoded(AMODAL_BITS, fields, annotated)?, annotated, size)?,
            None => none(),
        };
        let categories = match self.keys.contains(&CATEGORY_ID.id()) {
            true => self.decoded(CATEGORY_ID, fields, annotated)?,
            false => PerInstance::default(),
        };
        for (name, masks) in [("visible", &visible), ("amodal", &amodal)] {
            if let Some((id, mask)) = masks.iter().find(|(_, mask)| [mask.width(), mask.height()] != size) {
                let [width, height] = size;
                let what = format!("the {name} mask of instance {id} has {} × {} pixels", mask.width(), mask.height());
                return Err(Error::new(format!("{what}, the image {width} × {height}")));
            }
        }
        let all: BTreeSet<InstanceId> = visible.iter().chain(amodal.iter()).map(|(id, _)| id).collect();
        let [width, height] = size;
        let empty = || Mask::empty(width, height);
        let label = |id: InstanceId| {
            let whole = self.amodal.map(|_| amodal.get(id).cloned().unwrap_or_else(empty));
            let category = self.category_of(categories.get(id).copied());
            ObjectLabels::of_masks(id, visible.get(id).cloned().unwrap_or_else(empty), whole, category)
        };
        Ok(all.into_iter().map(label).collect())
    }
}

impl SampleSource {
    /// The category of an object in a dataset that is written from this dataset.
    fn category_of(&self, own: Option<u32>) -> u32 {
        self.categories.id(own.map_or(read::BACKGROUND, u64::from))
    }

    /// Categories of all annotated instances.
    fn categories(&self, fields: &SampleFields, ids: Option<&[InstanceId]>) -> Result<PerInstance<u32>> {
        let own = self.decoded(CATEGORY_ID, fields, ids.unwrap_or_default())?;
        let all: BTreeSet<InstanceId> =
            own.iter().map(|(id, _)| id).chain(ids.into_iter().flatten().copied()).collect();
        Ok(all.into_iter().map(|id| (id, self.category_of(own.get(id).copied()))).collect())
    }
}

fn field(fields: &SampleFields, key: KeyId) -> Result<&Value> {
    let name = key.to_string();
    fields.get(&name).ok_or_else(|| Error::new(format!("it has no field `{name}`, which others have")))
}

fn unlike(key: KeyId) -> Error {
    let what = match key == OCCLUSION_ORDER.id() {
        true => "no matrix of the annotated instances".to_owned(),
        false => format!("no {}", key.kind_of_value()),
    };
    Error::new(format!("its field `{key}` is {what}"))
}

/// Visible masks from a plane of ids, for these instances and all instances in the plane.
fn visible_masks(plane: &Plane<InstanceId>, ids: Option<&[InstanceId]>) -> PerInstance<Mask> {
    let shown = read::masks_of(&plane.map(|id| id.0)).into_iter().map(|(id, mask)| (InstanceId(id), mask));
    let empty = || Mask::empty(plane.width(), plane.height());
    let mut masks: BTreeMap<InstanceId, Mask> = shown.collect();
    for id in ids.into_iter().flatten() {
        masks.entry(*id).or_insert_with(empty);
    }
    PerInstance(masks)
}

/// Amodal masks from bits in the layout of [`AMODAL_BITS`].
fn amodal_masks(bits: &Value, ids: &[InstanceId], [width, height]: [u32; 2]) -> Result<PerInstance<Mask>> {
    let row_bytes = (width as usize).div_ceil(8);
    let expected = [ids.len(), height as usize, row_bytes];
    let bits = match bits {
        Value::Tensor(tensor) if tensor.shape == expected && tensor.dtype.size() == 1 => tensor,
        _ => {
            let what = format!("its field `amodal_bits` is no array of bytes of shape {expected:?}");
            return Err(Error::new(what));
        }
    };
    let of = |plane: usize| {
        let rows = &bits.bytes[plane * height as usize * row_bytes..];
        let is_set = |x: u32, y: u32| rows[y as usize * row_bytes + x as usize / 8] & (0x80 >> (x % 8)) != 0;
        Mask::from_fn(width, height, is_set)
    };
    Ok(ids.iter().enumerate().map(|(plane, id)| (*id, of(plane))).collect())
}

/// The size of a sample's image, if this field determines it.
fn size_of(value: &Value) -> Option<[u32; 2]> {
    match value {
        Value::Mask(mask) => Some([mask.width(), mask.height()]),
        Value::Tensor(tensor) => match tensor.shape.as_slice() {
            [height, width] | [height, width, _] => Some([u32::try_from(*width).ok()?, u32::try_from(*height).ok()?]),
            _ => None,
        },
        Value::List(rows) => match rows.first()? {
            Value::List(pixels) => Some([pixels.len() as u32, rows.len() as u32]),
            _ => None,
        },
        Value::PerInstance(each) => each.values().find_map(size_of),
        // A camera, a mask in JSON, or one of them for each instance.
        Value::Record(fields) => {
            let named = |name: &str| fields.iter().find(|(field, _)| field == name).map(|(_, value)| value);
            let edge = |value: &Value| match value {
                Value::Int(edge) => u32::try_from(*edge).ok(),
                Value::Float(edge) if edge.fract() == 0.0 && (0.0..4e9).contains(edge) => Some(*edge as u32),
                _ => None,
            };
            if let (Some(width), Some(height)) = (named("width").and_then(edge), named("height").and_then(edge)) {
                return Some([width, height]);
            }
            match named("size") {
                Some(Value::List(size)) if size.len() == 2 => Some([edge(&size[1])?, edge(&size[0])?]),
                _ => fields.iter().filter(|(name, _)| name.parse::<u16>().is_ok()).find_map(|(_, it)| size_of(it)),
            }
        }
        _ => None,
    }
}

/// Refuses images and masks whose size differs from the view, and sizes that no image may have.
fn check_sizes(fields: &SampleFields, keys: &[KeyId], [width, height]: [u32; 2]) -> Result<()> {
    let refuse = |what: String| Err(Error::new(what));
    IMAGE_PIXELS.check_size([width, height])?;
    let of_pixels = |key: &&KeyId| matches!(key.form().of_one(), Form::Mask | Form::Image { .. });
    for key in keys.iter().filter(of_pixels) {
        let Some(value) = fields.get(&key.to_string()) else { continue };
        let each: Vec<&Value> = match value {
            Value::PerInstance(each) => each.values().collect(),
            Value::Record(each) if instances_of(value).is_some() => each.iter().map(|(_, value)| value).collect(),
            value => vec![value],
        };
        if let Some([w, h]) = each.into_iter().filter_map(size_of).find(|size| *size != [width, height]) {
            return refuse(format!("its field `{key}` has {w} × {h} pixels, the image {width} × {height}"));
        }
    }
    Ok(())
}

/// The instances of a value, in order.
fn instances_of(value: &Value) -> Option<Vec<InstanceId>> {
    let mut ids = match value {
        Value::PerInstance(each) => each.keys().copied().collect(),
        Value::Record(fields) => {
            fields.iter().map(|(id, _)| id.parse().ok().map(InstanceId)).collect::<Option<Vec<_>>>()?
        }
        _ => return None,
    };
    ids.sort_unstable();
    Some(ids)
}

impl ImageSource for SampleSource {
    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        if !self.keys.contains(&CATEGORY_ID.id()) || !self.refuses_unknown {
            return Vec::new();
        }
        let fields = self.samples.read(image, &BTreeSet::from([CATEGORY_ID.name()])).unwrap_or_default();
        let Ok(own) = self.decoded(CATEGORY_ID, &fields, &[]) else { return Vec::new() };
        let unknown = own.iter().filter(|(_, category)| self.categories.known((**category).into()).is_none());
        let fault = |(id, category): (InstanceId, &u32)| {
            let fault = DatasetFault::new(rule::KNOWN_CATEGORIES, format!("unknown category {category}"));
            fault.of(FaultSubject::Instance(id))
        };
        unknown.map(fault).collect()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let own: Vec<KeyId> = self.keys.iter().copied().filter(|key| wants.contains(key)).collect();
        let follow: Vec<KeyId> = self.follow().into_iter().filter(|key| wants.contains(key)).collect();
        let mut read: Vec<KeyId> = own.clone();
        if !follow.is_empty() {
            let category = self.keys.iter().copied().filter(|key| *key == CATEGORY_ID.id());
            read.extend(category.chain(self.visible).chain(self.amodal));
        }
        let needs_ids = [OCCLUSION_ORDER.id(), CATEGORY_ID.id()];
        let has_rows = own.iter().any(|key| needs_ids.contains(key)) || !follow.is_empty();
        read.extend(self.annotated.filter(|_| has_rows));
        let names: Vec<String> = read.iter().map(|key| key.to_string()).collect();
        let fields = self.samples.read(image, &names.iter().map(String::as_str).collect())?;
        let ids = match self.annotated.filter(|_| has_rows) {
            Some(key) => Some(instances_of(field(&fields, key)?).ok_or_else(|| unlike(key))?),
            None => None,
        };
        let [width, height] = self.size(image, &fields);
        check_sizes(&fields, &self.keys, [width, height])?;
        let mut products = Products::new();
        for key in own {
            if key == CATEGORY_ID.id() {
                products.put(CATEGORY_ID, self.categories(&fields, ids.as_deref())?)?;
                continue;
            }
            let missing = if key.semantic == Semantic::Depth { f64::INFINITY } else { f64::NAN };
            let stored = Stored { value: field(&fields, key)?, ids: ids.as_deref().unwrap_or_default(), missing };
            products.put_stored(key, stored).map_err(|_| unlike(key))?;
        }
        if !follow.is_empty() {
            let labels = self.labels(&fields, ids.as_deref(), [width, height])?;
            read::put(&labels, None, &follow, &mut products)?;
            if follow.contains(&VISIBILITY.id()) {
                products.put(VISIBILITY, read::visibility(&labels)?)?;
            }
        }
        Ok(ReadImage::new([width, height], products))
    }
}
