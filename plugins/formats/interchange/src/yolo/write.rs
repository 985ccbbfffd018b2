//! Writes YOLO's layout.

use super::data;
use super::record::{DATA, IMAGES, LABEL_END, LABELS, LabelShape, write_line};
use super::{Yolo, YoloTask};
use crate::coco::{MaskChoice, StoredParts};
use crate::labels::{self, Partial};
use crate::outlines::{self, PolygonRing, outline_key, rotated_box_key};
use std::collections::BTreeSet;
use syntable_formats::encode::rgb::RgbFormat;
use syntable_formats::encode::view_name;
use syntable_formats::image_file::{self, RgbFile};
use syntable_formats::include::write_file;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, BOX, RGB, VISIBLE_MASK};
use syntable_model::scene::{SceneId, ViewId};

impl Yolo {
    fn task(&self) -> YoloTask {
        self.task.unwrap_or(YoloTask::Segment)
    }

    /// Path of the image inside the writer's folder.
    fn image_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("{}/{}", self.images(), self.rgb.file_name(&view_name(scene, view)))
    }

    fn images(&self) -> String {
        format!("{IMAGES}/{}", self.split)
    }

    /// Path of the label file inside the writer's folder. Ultralytics derives it from the path of the image.
    fn label_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("{LABELS}/{}/{}.{LABEL_END}", self.split, view_name(scene, view))
    }

    /// Points of an object's line, px: around its mask, or center and size of its box. None if the image shows no part of the
    /// box.
    fn points(&self, products: &Products, label: &Partial, size: [f64; 2]) -> Result<Option<PolygonRing>> {
        match self.task() {
            YoloTask::Segment => outlines::ring(products, self.masks, label.id).map(Some),
            YoloTask::Detect => Ok(center_and_size(self.masks.box_of(label), size).map(Vec::from)),
            YoloTask::Obb => {
                let corners = outlines::rotated_box(products, self.masks, label.id)?;
                Ok(Some(within_size(corners, size).to_vec()))
            }
        }
    }
}

impl ImageWriter for Yolo {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let points = match self.task() {
            YoloTask::Segment => Some(outline_key(self.masks)),
            YoloTask::Detect => None,
            YoloTask::Obb => Some(rotated_box_key(self.masks)),
        };
        let labels = match (self.task(), self.masks) {
            (YoloTask::Detect, masks) => labels::boxes_alone_inputs(masks),
            (_, MaskChoice::Visible) => labels::visible_inputs(),
            (_, MaskChoice::Amodal) => labels::amodal_inputs(),
        };
        [Input::of(RGB), image_file::input()].into_iter().chain(points.map(Input::of)).chain(labels).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (rgb, scene, view) = (products.get(RGB)?, cx.scene_id, cx.view_id);
        let file = RgbFile::of(products, &RgbFormat::ALL, self.rgb)?;
        let path = file.named(&self.image_path(scene, view));
        output.write(&format!("{}/{path}", output.id()), &file.bytes)?;
        let size = [rgb.width(), rgb.height()].map(f64::from);
        let mut text = String::new();
        let (labels, stored) = match self.task() {
            YoloTask::Detect => (labels::partial_or_box(cx.dataset, products)?, StoredParts::Boxes),
            _ => (labels::partial(cx.dataset, products)?, StoredParts::Visible),
        };
        let labels = self.masks.shown_partial(cx.log, labels, stored);
        if self.task() == YoloTask::Segment {
            outlines::report_holes(cx.log, products, self.masks, labels.iter().map(|label| label.id))?;
        }
        let mut outside = 0;
        for label in &labels {
            match self.points(products, label, size)? {
                Some(points) => write_line(&mut text, cx.dataset.category(label.category)?.0, &points, size),
                None => outside += 1,
            }
        }
        cx.log.left_out(&LeftOut::new(
            outside,
            labels.len(),
            "objects are left out: their boxes are outside of the image",
        ));
        output.write(&format!("{}/{}", output.id(), self.label_path(scene, view)), text.as_bytes())
    }

    fn for_dataset(&self, has: &BTreeSet<String>) -> Option<Self> {
        let has = |name: &str| has.contains(name);
        let is_of_boxes = has(BOX.name()) && !has(VISIBLE_MASK.name()) && !has(AMODAL_MASK.name());
        (self.task.is_none() && is_of_boxes).then(|| Self { task: Some(YoloTask::Detect), ..self.clone() })
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let paths = match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![self.image_path(scene, view), self.label_path(scene, view)],
            (None, None) => vec![DATA.to_owned()],
            _ => Vec::new(),
        };
        paths.into_iter().map(|path| format!("{}/{path}", of.id)).collect()
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let path = format!("{}/{DATA}", finish.id());
        let task = (self.task() == YoloTask::Detect).then_some(LabelShape::Boxes);
        let text = data::text(&self.images(), task, self.masks, cx.dataset);
        write_file(finish, &path, text.as_bytes())
    }
}

/// Center and size of the part of a box that is in the image; none if that part is empty.
fn center_and_size([x, y, width, height]: [f64; 4], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let [low, high] = [[x, y], [x + width, y + height]].map(|[u, v]| [u.clamp(0.0, size[0]), v.clamp(0.0, size[1])]);
    let sides: [f64; 2] = std::array::from_fn(|axis| high[axis] - low[axis]);
    let center = std::array::from_fn(|axis| low[axis] + sides[axis] / 2.0);
    sides.iter().all(|side| *side > 0.0).then_some([center, sides])
}

/// The corners of a box. If the box is larger than the image, they are moved to the edge of the image.
fn within_size(corners: [[f64; 2]; 4], size: [f64; 2]) -> [[f64; 2]; 4] {
    let is_larger = |axis: usize| {
        let along = || corners.iter().map(|corner| corner[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min) > size[axis]
    };
    if is_larger(0) || is_larger(1) {
        corners.map(|[x, y]| [x.clamp(0.0, size[0]), y.clamp(0.0, size[1])])
    } else {
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_larger_than_the_image_are_moved_to_its_edge() {
        let inside = [[-3.0, 5.0], [5.0, -3.0], [10.0, 5.0], [5.0, 10.0]];
        assert_eq!(within_size(inside, [64.0, 48.0]), inside);
        let large = [[-3.0, 24.0], [32.0, -8.0], [67.0, 24.0], [32.0, 56.0]];
        assert_eq!(within_size(large, [64.0, 48.0]), [[0.0, 24.0], [32.0, 0.0], [64.0, 24.0], [32.0, 48.0]]);
    }
}
