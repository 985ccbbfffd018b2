//! Writes InstaOrder's orders.

use super::InstaOrder;
use super::record::{Depth, FILE, ImageOrders, Occlusion, Orders};
use crate::coco::{self, MaskChoice};
use crate::family::write::{Family, ListedImages, SceneFiles, info, merge};
use crate::labels;
use crate::order::{self, ObjectOrder, VisibleDepth};
use std::cmp::Ordering;
use syntable_formats::dataset::{DatasetWriter, JsonLayout};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::shard::{ShardLine, for_each_line};
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

/// InstaOrder's count of annotators for an order on which all annotators agree.
const COUNT: u32 = 2;

impl InstaOrder {
    /// Path of the file of orders.
    fn orders(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }
}

impl Family for InstaOrder {
    fn reads(&self) -> Vec<Input> {
        // Half of the format's content is the order by depth, so depth is required here.
        let orders = order::inputs().map(|input| Input { need: InputNeed::Always, ..input });
        std::iter::once(Input::of(RGB)).chain(orders).chain(labels::inputs()).collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        coco::file(&self.split)
    }

    fn files(&self) -> Vec<String> {
        vec![self.file(), self.orders()]
    }

    fn finish(&self, cx: &DatasetContext, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), &self.categories(cx.dataset)?, ListedImages::All)?;
        merge_orders(cx, finish, &self.orders())
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let labels = MaskChoice::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        files.image(cx, products, labels.len())?;
        labels.iter().try_for_each(|label| files.annotation(&MaskChoice::Visible.annotation(&(*label).into())))?;
        if labels.len() < 2 {
            return Ok(());
        }
        files.of_view(&orders(&ObjectOrder::of(products, &labels)?))
    }
}

fn orders(order: &ObjectOrder) -> Orders {
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
        let mut file = DatasetWriter::new(out, &path, JsonLayout::Lines)?;
        file.section("info", &info(cx.dataset))?;
        // Ids of the annotations of the current image.
        let mut ids = 1..1;
        file.annotations(|annotations| {
            for_each_line(cx.dataset, finish, |image_id, line| match line {
                ShardLine::Image { annotations, .. } => {
                    ids = ids.end..ids.end + annotations as u64;
                    Ok(())
                }
                ShardLine::View(record) => {
                    let orders: Orders = serde_json::from_str(record).map_err(|error| damaged(&error))?;
                    annotations.record(&ImageOrders { image_id, instance_ids: ids.clone().collect(), orders })
                }
                ShardLine::Annotation(_) | ShardLine::Scene(_) => Ok(()),
            })
        })?;
        file.finish()
    })
}

fn damaged(error: &serde_json::Error) -> Error {
    Error::new(format!("the orders of a view cannot be read from its scene's shard: {error}"))
        .help("the dataset is damaged, or of another version; a run with `options.repair` makes the scene again")
}
