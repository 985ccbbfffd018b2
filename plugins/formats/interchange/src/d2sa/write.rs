//! Writes D2SA's layout.

use super::D2sa;
use super::record::{D2saAnnotation, D2saRegion, FILE};
use crate::coco::MaskChoice;
use crate::family::write::{Family, SceneFiles, policy};
use crate::labels::{self, ShownLabel};
use crate::order::{self, ObjectOrder};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

impl Family for D2sa {
    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), policy()].into_iter().chain(order::inputs()).chain(labels::inputs()).collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let labels = MaskChoice::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        let order = ObjectOrder::of(products, &labels)?;
        let sorted = order.front_to_back();
        let layers = order.layers(&sorted);
        files.image(cx, products, labels.len())?;
        sorted
            .iter()
            .enumerate()
            .try_for_each(|(at, &i)| files.annotation(&annotation(cx.dataset, &labels[i], at + 1, layers[i])?))
    }
}

fn annotation(dataset: &DatasetInfo, label: &ShownLabel, order: usize, layer: usize) -> Result<D2saAnnotation> {
    let area = f64::from(label.amodal.area());
    let bbox = <[i32; 4]>::from(label.amodal_box).map(f64::from);
    Ok(D2saAnnotation {
        id: 0,
        image_id: 0,
        category_id: label.category,
        iscrowd: false,
        area,
        bbox,
        segmentation: Rle::encode(label.amodal),
        visible_mask: Rle::encode(label.visible),
        invisible_mask: (!label.occlusion.is_empty()).then(|| Rle::encode(label.occlusion)),
        occlude_rate: label.rate,
        occl_depth: layer,
        amodal_region: D2saRegion {
            name: dataset.category(label.category)?.1.to_owned().into(),
            area: area.into(),
            is_stuff: 0.into(),
            bbox: bbox.into(),
            order: (order as u64).into(),
        },
    })
}
