//! Data of an image for the pages: its objects with their masks, and the occlusion order.

use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::error::Result;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CATEGORY_ID, DEPTH, OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, RGB,
    VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::product::{BBox, Graph, Key, KeyId, Mask, PerInstance, Product, Products};
use syntable_model::reader::OpenDataset;
use syntable_model::scene::InstanceId;
use syntable_model::stage::DatasetInfo;

/// An image of a dataset, as the pages show it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageView {
    /// Name in the dataset.
    pub name: String,
    /// Its scene.
    pub scene: u32,
    /// Its view.
    pub view: u32,
    /// Width and height, px.
    pub size: [u32; 2],
    /// Whether the image has a color image.
    pub has_image: bool,
    /// Minimum and maximum depth, m; `None` without depths.
    pub depth_m: Option<[f32; 2]>,
    /// Its objects, in the order of their ids.
    pub objects: Vec<ImageObject>,
    /// Occlusion graph; `None` if the order is unknown.
    pub graph: Option<OcclusionGraphView>,
    /// Faults: the check, and a sentence.
    pub faults: Vec<[String; 2]>,
}

/// An object in an image. Masks are run lengths as in COCO files.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ImageObject {
    /// Its id.
    pub id: u16,
    /// Whether it has no visible pixel.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_hidden: bool,
    /// Name of its asset; empty if unknown.
    pub name: String,
    /// Name of its class.
    pub category: String,
    /// Hidden fraction of its amodal area, in [0, 1].
    pub rate: Option<f64>,
    /// Layer in the occlusion graph.
    pub layer: Option<&'static str>,
    /// Area of its amodal mask, or else of its visible mask, px.
    #[serde(skip)]
    pub area: u64,
    /// Visible mask; `None` if it is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub visible: Option<String>,
    /// Amodal mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amodal: Option<String>,
    /// Occlusion mask; `None` if it is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<String>,
    /// Box of the visible mask: x, y, width, height.
    pub visible_box: Option<[i32; 4]>,
    /// Box of the amodal mask.
    pub amodal_box: Option<[i32; 4]>,
}

/// The occlusion graph of an image, by ids of objects.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct OcclusionGraphView {
    /// Occluder and occludee.
    pub edges: Vec<[u16; 2]>,
    /// Sets of objects that occlude each other, directly or through others of the set.
    pub cycles: Vec<Vec<u16>>,
    /// All objects from front to back.
    pub depth_layers: Vec<Vec<u16>>,
}

/// Data of an image in the gallery.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GalleryRow {
    /// Name in the dataset.
    pub name: String,
    /// Its scene and view.
    pub place: [u32; 2],
    /// Width and height, px.
    pub size: [u32; 2],
    /// Number of objects with a visible pixel.
    pub objects: usize,
    /// Whether the image has a color image.
    pub has_image: bool,
    /// Maximum occlusion rate of an object.
    pub most: Option<f64>,
    /// Number of faults.
    pub faults: usize,
    /// Its objects, for the index.
    #[serde(skip)]
    pub known: Vec<IndexObject>,
}

/// An object in the index of images.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexObject {
    /// Name of its asset and name of its class.
    pub texts: [Arc<str>; 2],
    /// Hidden fraction of its amodal area.
    pub rate: Option<f64>,
    /// Area, px.
    pub area: u64,
}

/// A part of the index of images, by which the gallery selects and sorts. Its texts are numbered, because many objects
/// share them.
#[derive(Debug, Default, Serialize)]
pub struct ImageIndex {
    texts: Vec<Arc<str>>,
    rows: Vec<IndexRow>,
}

/// Name, scene and view, width and height, whether a color image exists, visible objects, faults, and objects as
/// number of the name, number of the class, rate and area.
type IndexRow = (String, [u32; 2], [u32; 2], u8, usize, usize, Vec<(usize, usize, Option<f64>, u64)>);

impl ImageIndex {
    /// The index of some images.
    pub fn of(rows: &[GalleryRow]) -> Self {
        let (mut index, mut numbers) = (Self::default(), BTreeMap::new());
        for row in rows {
            let objects = row.known.iter().map(|object| {
                let [name, class] = object.texts.each_ref().map(|text| {
                    *numbers.entry(Arc::clone(text)).or_insert_with(|| {
                        index.texts.push(Arc::clone(text));
                        index.texts.len() - 1
                    })
                });
                (name, class, object.rate, object.area)
            });
            let objects = objects.collect();
            let GalleryRow { name, place, size, objects: visible, has_image, faults, .. } = row;
            index.rows.push((name.clone(), *place, *size, u8::from(*has_image), *visible, *faults, objects));
        }
        index
    }
}

pub use syntable_model::rule::READABLE;

/// Products to read of each image.
fn wants(offers: &[KeyId]) -> Vec<KeyId> {
    let own = syntable_model::keys![
        VISIBLE_MASK,
        AMODAL_MASK,
        OCCLUSION_MASK,
        OCCLUSION_RATE,
        OCCLUSION_ORDER,
        VISIBLE_BOX,
        AMODAL_BOX,
        CATEGORY_ID,
        OBJECT_NAME
    ];
    own.into_iter().filter(|key| offers.contains(key)).collect()
}

/// Reads an image: data for the pages and, with `whole`, all inputs of the checks, color and depth.
pub fn read(
    dataset: &OpenDataset,
    checks: &[Arc<dyn LabelCheck>],
    image: usize,
    whole: bool,
) -> Result<(ImageView, Products)> {
    let offers = &dataset.offers;
    let of = &dataset.images[image];
    let mut faults: Vec<[String; 2]> = Vec::new();
    let (size, products) = if whole {
        read_all(dataset, image, offers, &mut faults)
    } else {
        let read = dataset.read(image, &wants(offers));
        let read = read.map_err(|error| error.context(format!("image \"{}\"", of.name)))?;
        (read.size, read.products)
    };
    // Amodal masks alone do not show which pixels are hidden.
    let has_visible = offers.contains(&VISIBLE_MASK.id());
    let (objects, graph) = objects_of(&products, has_visible, &dataset.info)?;
    if whole {
        for check in checks {
            let found = dataset.label_faults(image, &**check, &products);
            let found = found.unwrap_or_else(|error| vec![error.to_string()]);
            faults.extend(found.into_iter().map(|message| [check.name().to_owned(), message]));
        }
        faults.extend(dataset.image_faults(image).iter().map(|fault| [fault.rule.to_owned(), fault.to_string()]));
    }
    let depth_m = products.optional(DEPTH)?.and_then(super::pixels::range);
    let has_image = if whole { products.contains(&RGB.id()) } else { offers.contains(&RGB.id()) };
    let (name, scene, view) = (of.name.clone(), of.scene.0, of.view.0);
    Ok((ImageView { name, scene, view, size, has_image, depth_m, objects, graph, faults }, products))
}

/// Objects of a view, in the order of their ids, and its occlusion graph. With `has_visible`, an object without a visible
/// mask is hidden.
pub fn objects_of(
    products: &Products,
    has_visible: bool,
    info: &DatasetInfo,
) -> Result<(Vec<ImageObject>, Option<OcclusionGraphView>)> {
    let mut objects: BTreeMap<InstanceId, ImageObject> = BTreeMap::new();
    let mut put = ObjectCollector { products, objects: &mut objects };
    put.each(VISIBLE_MASK, |object, mask: &Mask| {
        object.is_hidden = mask.is_empty();
        object.visible = (!mask.is_empty()).then(|| mask.to_coco());
        object.area = mask.area().into();
    })?;
    put.each(AMODAL_MASK, |object, mask: &Mask| {
        object.is_hidden = has_visible && object.visible.is_none();
        object.amodal = Some(mask.to_coco());
        object.area = mask.area().into();
    })?;
    put.each(OCCLUSION_MASK, |object, mask: &Mask| object.hidden = (!mask.is_empty()).then(|| mask.to_coco()))?;
    put.each(OCCLUSION_RATE, |object, rate: &f64| object.rate = Some(*rate))?;
    put.each(VISIBLE_BOX, |object, bbox: &BBox| object.visible_box = Some((*bbox).into()))?;
    put.each(AMODAL_BOX, |object, bbox: &BBox| object.amodal_box = Some((*bbox).into()))?;
    put.each(OBJECT_NAME, |object, name: &String| object.name.clone_from(name))?;
    let classes: BTreeMap<u32, &str> = info.categories().collect();
    put.each(CATEGORY_ID, |object, id: &u32| {
        object.category = classes.get(id).copied().unwrap_or_default().to_owned()
    })?;
    let graph = match products.optional(OCCLUSION_ORDER)? {
        Some(order) => {
            let (graph, ids) = (Graph::new(order), order.ids());
            for (node, id) in ids.iter().enumerate() {
                if let Some(object) = objects.get_mut(id) {
                    object.layer = Some(graph.layer(node).name());
                }
            }
            let named = |sets: Vec<Vec<usize>>| {
                sets.iter().map(|set| set.iter().map(|&node| ids[node].0).collect()).collect::<Vec<Vec<u16>>>()
            };
            Some(OcclusionGraphView {
                edges: graph.edges().map(|(i, j)| [ids[i].0, ids[j].0]).collect(),
                cycles: named(graph.cycles()),
                depth_layers: named(graph.depth_layers()),
            })
        }
        None => None,
    };
    Ok((objects.into_values().collect(), graph))
}

/// All readable products of an image. An unreadable product is a fault.
fn read_all(
    dataset: &OpenDataset,
    image: usize,
    offers: &[KeyId],
    faults: &mut Vec<[String; 2]>,
) -> ([u32; 2], Products) {
    if let Ok(read) = dataset.read(image, offers) {
        return (read.size, read.products);
    }
    let (mut size, mut all) = ([0; 2], Products::new());
    for key in offers {
        let one = dataset.read(image, std::slice::from_ref(key));
        let kept = one.and_then(|one| {
            size = one.size;
            all.extend(one.products)
        });
        if let Err(error) = kept {
            let fault = [READABLE.to_owned(), error.to_string()];
            if !faults.contains(&fault) {
                faults.push(fault);
            }
        }
    }
    (size, all)
}

struct ObjectCollector<'a> {
    products: &'a Products,
    objects: &'a mut BTreeMap<InstanceId, ImageObject>,
}

impl ObjectCollector<'_> {
    fn each<T>(&mut self, key: Key<PerInstance<T>>, mut put: impl FnMut(&mut ImageObject, &T)) -> Result<()>
    where
        PerInstance<T>: Product,
    {
        let Some(values) = self.products.optional(key)? else { return Ok(()) };
        for (id, value) in values.iter() {
            let new = || ImageObject { id: id.0, ..ImageObject::default() };
            put(self.objects.entry(id).or_insert_with(new), value);
        }
        Ok(())
    }
}

impl ImageView {
    /// Data of the image in the gallery. `shared` returns the same text for equal texts.
    pub fn row(&self, shared: &dyn Fn(&str) -> Arc<str>) -> GalleryRow {
        let known = self.objects.iter().map(|object| IndexObject {
            texts: [shared(&object.name), shared(&object.category)],
            rate: object.rate,
            area: object.area,
        });
        let rates = self.objects.iter().filter_map(|object| object.rate);
        GalleryRow {
            name: self.name.clone(),
            place: [self.scene, self.view],
            size: self.size,
            objects: self.objects.iter().filter(|object| !object.is_hidden).count(),
            has_image: self.has_image,
            most: rates.reduce(f64::max),
            faults: self.faults.len(),
            known: known.collect(),
        }
    }
}
