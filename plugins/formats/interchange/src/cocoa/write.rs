//! Writes COCO-Amodal.

use super::Cocoa;
use super::record::{CocoaAnnotation, CocoaRegion, FILE};
use crate::coco::MaskChoice;
use crate::family::write::{Family, ListedImages, SceneFiles, policy};
use crate::labels::{self, ShownLabel};
use crate::order::{self, ObjectOrder};
use crate::outlines;
use syntable_formats::Extra;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::encode::view_name;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_OUTLINE, RGB};

impl Family for Cocoa {
    fn reads(&self) -> Vec<Input> {
        let own = [Input::of(RGB), Input::of(AMODAL_OUTLINE), policy()];
        own.into_iter().chain(order::inputs()).chain(labels::inputs()).collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }

    fn listed(&self) -> ListedImages {
        ListedImages::Annotated
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let labels = MaskChoice::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        outlines::report_holes(cx.log, products, MaskChoice::Amodal, labels.iter().map(|label| label.id))?;
        let order = ObjectOrder::of(products, &labels)?;
        let sorted = order.front_to_back();
        let region = |(at, &i): (usize, &usize)| region(cx.dataset, products, at + 1, &labels[i]);
        let regions = sorted.iter().enumerate().map(region).collect::<Result<Vec<_>>>()?;
        files.image(cx, products, usize::from(!regions.is_empty()))?;
        if regions.is_empty() {
            return Ok(());
        }
        let url = self.rgb.file_name(&view_name(cx.scene_id, cx.view_id));
        let author = cx.dataset.program.as_str();
        files.annotation(&CocoaAnnotation {
            id: 0,
            image_id: 0,
            extra: Extra::from_iter([("url".to_owned(), url.into()), ("author".to_owned(), author.into())]),
            size: Some(regions.len()),
            depth_constraint: constraints(&order, &sorted).join(","),
            regions,
        })
    }
}

fn region(dataset: &DatasetInfo, products: &Products, order: usize, label: &ShownLabel) -> Result<CocoaRegion> {
    let is_occluded = !label.occlusion.is_empty();
    let mask = |mask: &Mask| is_occluded.then(|| Rle::encode(mask));
    Ok(CocoaRegion {
        segmentation: outlines::ring(products, MaskChoice::Amodal, label.id)?.into_flattened(),
        name: dataset.category(label.category)?.1.to_owned(),
        area: Some(label.amodal.area().into()),
        is_stuff: 0,
        occlude_rate: Some(label.rate),
        order: Some(order),
        visible_mask: mask(label.visible),
        invisible_mask: mask(label.occlusion),
        extra: Extra::new(),
    })
}

/// The pairs `i-j` of positions in `sorted`, from 1, where `i` occludes `j`.
fn constraints(order: &ObjectOrder, sorted: &[usize]) -> Vec<String> {
    let places = order::places(sorted);
    let behind = |i: usize| {
        let mut behind: Vec<usize> = order.behind(sorted[i]).map(|j| places[j]).filter(|j| *j > i).collect();
        behind.sort_unstable();
        behind
    };
    (0..sorted.len()).flat_map(|i| behind(i).into_iter().map(move |j| format!("{}-{}", i + 1, j + 1))).collect()
}
