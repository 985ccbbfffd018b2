//! Statistics of one image.

use super::appearance::Appearance;
use super::duplicates::{Thumbnail, luma};
use super::options::{Edges, StatisticsOptions};
use super::quantity::Quantity;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use syntable_formats::read::{occludes, order_by};
use syntable_model::error::{Error, Result};
use syntable_model::left_out::LeftOut;
use syntable_model::product::standard::{
    AMODAL_MASK, CATEGORY_ID, DEPTH, OBJECT_INFO, OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER, RGB, VISIBLE_MASK,
};
use syntable_model::product::{Graph, KeyId, Layer, Mask, OcclusionOrder, Plane, Products};
use syntable_model::reader::{OpenDataset, ReadImage};
use syntable_model::scene::InstanceId;

/// IoU of a visible and an occlusion mask above which some of the authors' notebooks have an edge.
const LEAST_IOU: f64 = 0.1;
/// Limit of plausible depths, distances and sizes, m. Larger values are ignored, since no table scene has them.
const FAR_M: f64 = 10_000.0;
/// Number of depth steps with a counter each. Larger depths, which few images have, are counted in a map.
const NEAR_STEPS: usize = 10_000;
/// Fraction of a step by which single precision may put a depth below a whole number of steps.
const DEPTH_ROUNDING: f64 = 1e-3;

/// Statistics of an image: a line of the CSV file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageRow {
    /// Its name in the dataset.
    pub name: String,
    /// Its number in the annotation file.
    pub id: Option<u64>,
    /// Its scene.
    pub scene: u32,
    /// Its view.
    pub view: u32,
    /// Objects that it shows; `None` without labels.
    pub objects: Option<u32>,
    /// Annotated objects without a visible pixel. No other number includes them.
    pub hidden_objects: u32,
    /// Occlusion order; `None` without amodal masks.
    pub occlusion: Option<OcclusionRow>,
    /// Mean depth of its pixels, m.
    pub mean_depth_m: Option<f64>,
    /// Mean distance of the objects from the camera, m; `None` without objects.
    pub mean_distance_m: Option<f64>,
    /// Mean luma in [0, 1].
    pub brightness: Option<f64>,
    /// Number of its group of near-duplicates, from 0.
    pub duplicates: Option<u32>,
}

/// Occlusion in an image, without objects that have no visible pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OcclusionRow {
    /// Objects with at least one hidden pixel.
    pub occluded: u32,
    /// Sum of the areas of occlusion masks, px.
    pub occluded_px: u64,
    /// Sum of the areas of amodal masks, px.
    pub amodal_px: u64,
    /// Occlusion rate weighted by pixels: `occluded_px` / `amodal_px`; `None` without objects.
    pub rate: Option<f64>,
    /// Mean of the objects' occlusion rates; `None` without objects.
    pub mean_rate: Option<f64>,
    /// Maximum occlusion rate of an object; `None` without objects.
    pub max_rate: Option<f64>,
    /// Edges "i occludes j".
    pub edges: u32,
    /// Pairs of objects that occlude each other.
    pub mutual_pairs: u32,
    /// Sets of objects that occlude each other, directly or through others of the set.
    pub cycles: u32,
    /// Weakly connected components, including isolated objects.
    pub components: u32,
    /// Number of objects in the largest component.
    pub largest_component: u32,
    /// Layers from front to back.
    pub depth_layers: u32,
    /// Objects by their layers.
    pub layers: LayerCounts,
}

/// Numbers of objects by their layers in the occlusion graph.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LayerCounts {
    /// Objects that nothing occludes.
    pub top: u64,
    /// Objects that occlude and are occluded.
    pub intermediate: u64,
    /// Objects that are occluded and occlude nothing.
    pub bottom: u64,
}

impl LayerCounts {
    /// Top, intermediate and bottom.
    pub fn counts(&self) -> [u64; 3] {
        [self.top, self.intermediate, self.bottom]
    }

    /// Adds the counts of another image.
    pub fn add(&mut self, other: Self) {
        self.top += other.top;
        self.intermediate += other.intermediate;
        self.bottom += other.bottom;
    }
}

/// Contribution of an image to the dataset's statistics.
pub(super) struct ImageTally {
    pub row: ImageRow,
    /// Values of quantities, without depths.
    pub values: Vec<(Quantity, f64)>,
    /// Depths of the pixels; `None` without depths.
    pub depths: Option<Depths>,
    /// Names of the assets of objects that it shows.
    pub assets: Vec<String>,
    /// Categories of objects that it shows.
    pub categories: Vec<u32>,
    /// Sums of the rates of all objects, and of the occluded objects.
    pub rates: f64,
    pub thumbnail: Option<Thumbnail>,
    /// Annotations that are not objects.
    pub left_out: Vec<LeftOut>,
}

/// Depths of the pixels of an image.
pub(super) struct Depths {
    /// Numbers of pixels by whole steps of depth, for near pixels.
    pub near: Vec<u64>,
    /// Numbers of pixels by whole steps of depth, for far pixels.
    pub far: BTreeMap<usize, u64>,
    /// Sum of the depths, m.
    pub sum: f64,
    /// Minimum and maximum depth, m.
    pub range: [f64; 2],
}

/// Products to read of each image.
#[derive(Debug, Clone)]
pub(super) struct ImageInputs {
    pub keys: Vec<KeyId>,
}

impl ImageInputs {
    pub fn of(dataset: &OpenDataset, options: &StatisticsOptions) -> Self {
        let mut keys = syntable_model::keys![VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK, CATEGORY_ID];
        keys.extend(syntable_model::keys![OBJECT_NAME, OBJECT_INFO]);
        if options.edges == Edges::Stored {
            keys.push(OCCLUSION_ORDER.id());
        }
        if !options.labels_only {
            keys.extend(syntable_model::keys![RGB, DEPTH]);
        }
        let offers = &dataset.offers;
        keys.retain(|key| offers.contains(key));
        Self { keys }
    }

    pub fn has(&self, key: &KeyId) -> bool {
        self.keys.contains(key)
    }
}

/// An object with visible pixels, and values from its masks.
struct ShownObject<'a> {
    id: InstanceId,
    visible: &'a Mask,
    amodal_px: u64,
    /// None without amodal masks.
    hidden: Option<Mask>,
}

/// Attributes of an object other than its masks, in formats that store them.
#[derive(Default, Deserialize)]
#[serde(default)]
struct ObjectDetails {
    asset: String,
    bounds_m: Option<[[f64; 3]; 2]>,
    camera_from_object: Option<[[f64; 4]; 4]>,
}

/// Reads an image and counts its content.
pub(super) fn tally(
    dataset: &OpenDataset,
    image: usize,
    wanted: &ImageInputs,
    options: &StatisticsOptions,
) -> Result<ImageTally> {
    let at = &dataset.images[image];
    let of = |error: Error| error.context(format!("image \"{}\"", at.name));
    let read = dataset.read(image, &wanted.keys);
    let ReadImage { products, left_out, .. } =
        read.map_err(|error| of(without_images(error, dataset, image, wanted)))?;
    let mut tally = ImageTally {
        row: ImageRow {
            name: at.name.clone(),
            id: at.id,
            scene: at.scene.0,
            view: at.view.0,
            objects: None,
            hidden_objects: 0,
            occlusion: None,
            mean_depth_m: None,
            mean_distance_m: None,
            brightness: None,
            duplicates: None,
        },
        values: Vec::new(),
        depths: None,
        assets: Vec::new(),
        categories: Vec::new(),
        rates: 0.0,
        thumbnail: None,
        left_out,
    };
    tally.objects(&products, options).map_err(of)?;
    if let Some(rgb) = products.optional(RGB)? {
        let (brightness, thumbnail) = luma(rgb);
        (tally.row.brightness, tally.thumbnail) = (Some(brightness), Some(thumbnail));
        tally.values.push((Quantity::Brightness, brightness));
        tally.values.extend(Appearance::of(rgb).values());
    }
    if let Some(depth) = products.optional(DEPTH)? {
        tally.depth(depth);
    }
    Ok(tally)
}

/// Adds a hint to an error if the image can be read without its color and depth files.
fn without_images(error: Error, dataset: &OpenDataset, image: usize, wanted: &ImageInputs) -> Error {
    let labels: Vec<KeyId> = wanted.keys.iter().filter(|key| ![RGB.id(), DEPTH.id()].contains(key)).copied().collect();
    if labels.len() < wanted.keys.len() && dataset.read(image, &labels).is_ok() {
        let hint = "`options.labels_only` reads no images, and counts labels only";
        let help = error.help_text().map_or_else(|| hint.to_owned(), |help| format!("{help}; {hint}"));
        return error.help(help);
    }
    error
}

impl ImageTally {
    fn objects(&mut self, products: &Products, options: &StatisticsOptions) -> Result<()> {
        let categories = products.optional(CATEGORY_ID)?;
        // Photographs have no labels: how many objects they show is unknown.
        if categories.is_none() && !products.contains(&VISIBLE_MASK.id()) {
            return Ok(());
        }
        let ids: Vec<InstanceId> = match products.optional(VISIBLE_MASK)? {
            Some(visible) => {
                let shown = shown(products, visible)?;
                // Fully hidden objects may have no visible mask.
                let annotated = products.optional(AMODAL_MASK)?.map_or(0, |it| it.0.len()).max(visible.0.len());
                self.row.hidden_objects = (annotated - shown.len()) as u32;
                self.values.extend(shown.iter().map(|it| (Quantity::ObjectArea, it.amodal_px as f64)));
                if shown.iter().all(|it| it.hidden.is_some()) && products.contains(&AMODAL_MASK.id()) {
                    self.occlusion(&shown, products.optional(OCCLUSION_ORDER)?, options);
                }
                shown.into_iter().map(|it| it.id).collect()
            }
            // Objects that have only a box or a class.
            None => categories.map_or_else(Vec::new, |it| it.iter().map(|(id, _)| id).collect()),
        };
        self.row.objects = Some(ids.len() as u32);
        self.values.push((Quantity::ObjectsPerView, ids.len() as f64));
        self.categories = ids.iter().filter_map(|id| categories?.get(*id).copied()).collect();
        let (infos, names) = (products.optional(OBJECT_INFO)?, products.optional(OBJECT_NAME)?);
        let mut distances = Vec::new();
        for id in ids {
            let info = infos.and_then(|infos| infos.get(id));
            let info = info.and_then(|info| serde_json::to_value(info).ok());
            // A record in another form, from another program, is ignored.
            let info: ObjectDetails = info.and_then(|info| serde_json::from_value(info).ok()).unwrap_or_default();
            let name = Some(&info.asset).filter(|it| !it.is_empty()).or_else(|| names?.get(id));
            self.assets.extend(name.filter(|it| !it.is_empty()).cloned());
            if let Some([low, high]) = info.bounds_m {
                let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
                if (0.0..FAR_M).contains(&longest) {
                    self.values.push((Quantity::ObjectSize, longest));
                }
            }
            let center = info.bounds_m.unwrap_or_default();
            let center: [f64; 3] = std::array::from_fn(|axis| (center[0][axis] + center[1][axis]) / 2.0);
            distances.extend(info.camera_from_object.map(|pose| distance(&pose, center)));
        }
        distances.retain(|it| (0.0..FAR_M).contains(it));
        self.values.extend(distances.iter().map(|it| (Quantity::ObjectDistance, *it)));
        self.row.mean_distance_m = mean(&distances);
        Ok(())
    }

    fn occlusion(&mut self, shown: &[ShownObject], stored: Option<&OcclusionOrder>, options: &StatisticsOptions) {
        let area = |it: &ShownObject| it.hidden.as_ref().map_or(0, |hidden| u64::from(hidden.area()));
        let rate = |it: &ShownObject| if it.amodal_px == 0 { 0.0 } else { area(it) as f64 / it.amodal_px as f64 };
        let rates: Vec<f64> = shown.iter().map(rate).collect();
        let (occluded_px, amodal_px) = (shown.iter().map(area).sum(), shown.iter().map(|it| it.amodal_px).sum());
        let order = match (options.edges, stored) {
            (Edges::Stored, Some(stored)) => restricted(stored, shown),
            (Edges::Iou, _) => order(shown, exceeds),
            _ => order(shown, occludes),
        };
        let graph = Graph::new(&order);
        let mut layers = LayerCounts::default();
        for node in 0..shown.len() {
            match graph.layer(node) {
                Layer::Top => layers.top += 1,
                Layer::Intermediate => layers.intermediate += 1,
                Layer::Bottom => layers.bottom += 1,
            }
        }
        let components = graph.components();
        let depth_layers = graph.depth_layers().len();
        if options.prefixes {
            for last in 1..=shown.len() {
                self.components(&Graph::new(&restricted(&order, &shown[..last])).components());
            }
        } else {
            self.components(&components);
        }
        self.values.push((Quantity::DepthLayers, depth_layers as f64));
        self.values.extend(rates.iter().map(|rate| (Quantity::OcclusionRate, *rate)));
        self.rates = rates.iter().sum();
        self.row.occlusion = Some(OcclusionRow {
            occluded: shown.iter().filter(|it| area(it) > 0).count() as u32,
            occluded_px,
            amodal_px,
            rate: (amodal_px > 0).then(|| occluded_px as f64 / amodal_px as f64),
            mean_rate: mean(&rates),
            max_rate: rates.iter().copied().reduce(f64::max),
            edges: graph.edges().count() as u32,
            mutual_pairs: graph.edges().filter(|&(i, j)| i < j && graph.has_edge(j, i)).count() as u32,
            cycles: graph.cycles().len() as u32,
            components: components.len() as u32,
            largest_component: components.iter().map(Vec::len).max().unwrap_or(0) as u32,
            depth_layers: depth_layers as u32,
            layers,
        });
    }

    fn components(&mut self, components: &[Vec<usize>]) {
        self.values.push((Quantity::ComponentsPerView, components.len() as f64));
        self.values.extend(components.iter().map(|it| (Quantity::ComponentSize, it.len() as f64)));
    }

    fn depth(&mut self, depth: &Plane<f32>) {
        let step = Quantity::Depth.about().step;
        let (mut depths, mut n) =
            (Depths { near: Vec::new(), far: BTreeMap::new(), sum: 0.0, range: [f64::INFINITY, 0.0] }, 0_u64);
        for depth in depth.data().iter().map(|it| f64::from(*it)).filter(|it| *it > 0.0 && *it < FAR_M) {
            let steps = (depth / step + DEPTH_ROUNDING) as usize;
            if steps < NEAR_STEPS {
                if depths.near.len() <= steps {
                    depths.near.resize(steps + 1, 0);
                }
                depths.near[steps] += 1;
            } else {
                *depths.far.entry(steps).or_default() += 1;
            }
            depths.sum += depth;
            depths.range = [depths.range[0].min(depth), depths.range[1].max(depth)];
            n += 1;
        }
        if n > 0 {
            self.row.mean_depth_m = Some(depths.sum / n as f64);
            self.depths = Some(depths);
        }
    }
}

/// Objects with a visible pixel, in the order of their ids.
fn shown<'a>(
    products: &'a Products,
    visible: &'a syntable_model::product::PerInstance<Mask>,
) -> Result<Vec<ShownObject<'a>>> {
    let (amodal, hidden) = (products.optional(AMODAL_MASK)?, products.optional(OCCLUSION_MASK)?);
    let of = |(id, visible): (InstanceId, &'a Mask)| {
        let whole = amodal.and_then(|it| it.get(id));
        let hidden = hidden.and_then(|it| it.get(id)).cloned().or_else(|| Some(whole?.minus(visible)));
        if amodal.is_some() && whole.is_none() {
            return Err(
                Error::new(format!("object {} has no amodal mask", id.0)).help("`syntable validate` lists all faults")
            );
        }
        Ok(ShownObject { id, visible, amodal_px: whole.unwrap_or(visible).area().into(), hidden })
    };
    visible.iter().filter(|(_, mask)| !mask.is_empty()).map(of).collect()
}

/// Occlusion order, by a rule for a visible and an occlusion mask.
fn order(shown: &[ShownObject], occludes: impl Fn(&Mask, &Mask) -> bool) -> OcclusionOrder {
    order_by(&shown.iter().map(|it| (it.id, it.visible, it.hidden.as_ref())).collect::<Vec<_>>(), occludes)
}

fn exceeds(visible: &Mask, hidden: &Mask) -> bool {
    let both = visible.shared_area(hidden);
    f64::from(both) > LEAST_IOU * f64::from(visible.area() + hidden.area() - both)
}

/// The order restricted to the shown objects.
fn restricted(order: &OcclusionOrder, shown: &[ShownObject]) -> OcclusionOrder {
    let rows: Vec<Option<usize>> = shown.iter().map(|it| order.ids().iter().position(|id| *id == it.id)).collect();
    let mut part = OcclusionOrder::new(shown.iter().map(|it| it.id).collect());
    for (i, row) in rows.iter().enumerate() {
        for (j, column) in rows.iter().enumerate() {
            if row.zip(*column).is_some_and(|(row, column)| order.occludes(row, column)) {
                part.set(i, j);
            }
        }
    }
    part
}

/// Distance from the camera to a point of an object.
fn distance(camera_from_object: &[[f64; 4]; 4], point: [f64; 3]) -> f64 {
    let square = |row: &[f64; 4]| {
        let at = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
        at * at
    };
    camera_from_object[..3].iter().map(square).sum::<f64>().sqrt()
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
