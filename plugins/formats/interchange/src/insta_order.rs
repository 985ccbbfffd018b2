//! InstaOrder.

use crate::annotation_file::{self, Listed, SceneFiles, check_split, merge};
use crate::coco::{self, Masks};
use crate::labels;
use crate::order::{self, Order, VisibleDepth};
use std::cmp::Ordering;
use syntable_formats::coco::categories;
use syntable_formats::dataset::{DatasetWriter, Layout};
use syntable_formats::shard::{Line, for_each_line};
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

/// How names of files of orders begin.
pub(crate) const FILE: &str = "InstaOrder_";

/// Number of annotators who agree on an order in InstaOrder if none disagrees.
const COUNT: u32 = 2;

/// Writes InstaOrder's orders of occlusion and depth, beside COCO's instances.
///
/// # What it does
///
/// `instances_{split}.json` is the file that the writer `coco` writes with visible masks. Each record of
/// `InstaOrder_{split}.json` is an image with at least two visible objects: `instance_ids` are ids of annotations
/// there, and numbers in an `order` count them from 0. `occlusion` has the pairs of the occlusion order: `a<b` if a
/// occludes b, `a<b & b<a` if each occludes the other. `depth` has all pairs: `a<b` if a is nearer, by the mean depth
/// of what the image shows of it, or `a=b`; `overlap` says whether the two ranges of these depths do. `count` is 2
/// throughout, as where InstaOrder's annotators agree at once. InstaOrder's reader wants a split named `train2017` or
/// `val2017`.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/annotations/instances_{split}.json` and `{id}/annotations/InstaOrder_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InstaOrder {
    /// Name of the split in the annotation files' names.
    pub split: String,
}

impl Default for InstaOrder {
    fn default() -> Self {
        Self { split: "train2017".into() }
    }
}

impl Config for InstaOrder {
    type Stage = dyn Writer;
    const KIND: &'static str = "insta_order";
    const EXAMPLE: &'static str = "split = \"train2017\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(Box::new(self))
    }
}

impl InstaOrder {
    fn file(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }
}

impl Writer for InstaOrder {
    fn reads(&self) -> Vec<Input> {
        // Depth is half of what the format says.
        let orders = order::inputs().map(|input| Input { is_optional: false, ..input });
        std::iter::once(Input::of(RGB)).chain(orders).chain(labels::inputs()).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(InstaOrderScene { files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(annotation_file::paths(of, &[coco::file(&self.split), self.file()]))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge(cx, finish, &coco::file(&self.split), Some(&categories(cx.dataset)), Listed::All)?;
        merge_orders(cx, finish, &self.file())
    }
}

/// The orders of the objects of a view.
#[derive(Debug, Serialize, Deserialize)]
struct Orders {
    occlusion: Vec<Occlusion>,
    depth: Vec<Depth>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Occlusion {
    order: String,
    count: u32,
}

#[derive(Debug, Serialize, Deserialize)]
struct Depth {
    order: String,
    overlap: bool,
    count: u32,
}

/// The record of an image in the annotation file.
#[derive(Serialize)]
struct ImageOrders {
    image_id: u64,
    instance_ids: Vec<u64>,
    #[serde(flatten)]
    orders: Orders,
}

struct InstaOrderScene {
    files: SceneFiles,
}

impl SceneWriter for InstaOrderScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let labels = Masks::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        self.files.image(cx, products, labels.len())?;
        labels.iter().try_for_each(|label| self.files.annotation(&Masks::Visible.annotation(&(*label).into())))?;
        if labels.len() < 2 {
            return Ok(());
        }
        self.files.of_view(&orders(&Order::of(products, &labels)?))
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

fn orders(order: &Order) -> Orders {
    let count = order.depths.len();
    let pairs = || (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    let occlusion = pairs().filter_map(|(i, j)| {
        let order = match (order.occludes(i, j), order.occludes(j, i)) {
            (true, true) => format!("{i}<{j} & {j}<{i}"),
            (true, false) => format!("{i}<{j}"),
            (false, true) => format!("{j}<{i}"),
            (false, false) => return None,
        };
        Some(Occlusion { order, count: COUNT })
    });
    let depth = pairs().map(|(i, j)| {
        let [a, b] = [order.depths[i], order.depths[j]];
        let order = match a.mean.total_cmp(&b.mean) {
            Ordering::Less => format!("{i}<{j}"),
            Ordering::Equal => format!("{i}={j}"),
            Ordering::Greater => format!("{j}<{i}"),
        };
        Depth { order, overlap: overlap(&a, &b), count: COUNT }
    });
    Orders { occlusion: occlusion.collect(), depth: depth.collect() }
}

/// Whether two ranges of depth have a depth in common.
fn overlap(a: &VisibleDepth, b: &VisibleDepth) -> bool {
    a.nearest <= b.farthest && b.nearest <= a.farthest
}

/// Writes the file of orders from the shards of all scenes.
fn merge_orders(cx: &DatasetContext, finish: &Finish, file: &str) -> Result<()> {
    let path = format!("{}/{file}", finish.id());
    finish.write(&path, |out| {
        let mut file = DatasetWriter::new(out, &path, Layout::Lines)?;
        file.section("info", &annotation_file::info(cx.dataset))?;
        // Ids of the annotations of the image that the current line is of.
        let mut ids = 1..1;
        file.annotations(|annotations| {
            for_each_line(cx.dataset, finish, |image_id, line| match line {
                Line::Image { annotations, .. } => {
                    ids = ids.end..ids.end + annotations as u64;
                    Ok(())
                }
                Line::View(record) => {
                    let orders: Orders = serde_json::from_str(record).map_err(|error| damaged(&error))?;
                    annotations.record(&ImageOrders { image_id, instance_ids: ids.clone().collect(), orders })
                }
                Line::Annotation(_) | Line::Scene(_) => Ok(()),
            })
        })?;
        file.finish()
    })
}

fn damaged(error: &serde_json::Error) -> Error {
    Error::new(format!("the orders of a view cannot be read from its scene's shard: {error}"))
        .help("the dataset is damaged, or of another version; `syntable run --repair` makes the scene again")
}

register!(InstaOrder);
