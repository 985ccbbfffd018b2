//! Writes YOLO's layout.

use super::data;
use super::record::{DATA, IMAGES, LABEL_END, LABELS, line};
use super::{Yolo, YoloTask};
use crate::coco::MaskChoice;
use crate::family::write::image_name;
use crate::labels;
use crate::outlines::{self, PolygonRing, outline_key, rotated_box_key};
use syntable_formats::encode::png::PngImage;
use syntable_formats::encode::view_name;
use syntable_formats::include::write_file;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::scene::{SceneId, ViewId};

impl Yolo {
    /// Path of the image inside the writer's folder.
    fn image_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("{}/{}", self.images(), image_name(scene, view))
    }

    fn images(&self) -> String {
        format!("{IMAGES}/{}", self.split)
    }

    /// Path of the label file inside the writer's folder: Ultralytics finds it from that of the image.
    fn label_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("{LABELS}/{}/{}.{LABEL_END}", self.split, view_name(scene, view))
    }

    /// Points around an object's mask, px.
    fn points(&self, products: &Products, id: InstanceId, size: [f64; 2]) -> Result<PolygonRing> {
        match self.task {
            YoloTask::Segment => outlines::ring(products, self.masks, id),
            YoloTask::Obb => Ok(within_size(outlines::rotated_box(products, self.masks, id)?, size).to_vec()),
        }
    }
}

impl ImageWriter for Yolo {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let points = match self.task {
            YoloTask::Segment => outline_key(self.masks),
            YoloTask::Obb => rotated_box_key(self.masks),
        };
        let labels = match self.masks {
            MaskChoice::Visible => labels::visible_inputs(),
            MaskChoice::Amodal => labels::amodal_inputs(),
        };
        [Input::of(RGB), Input::of(points)].into_iter().chain(labels).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (rgb, scene, view) = (products.get(RGB)?, cx.scene_id, cx.view_id);
        PngImage::rgb(rgb).write(output, &format!("{}/{}", output.id(), self.image_path(scene, view)))?;
        let size = [rgb.width(), rgb.height()].map(f64::from);
        let mut text = String::new();
        let labels = self.masks.shown_partial(cx.log, labels::partial(cx.dataset, products)?, false);
        if self.task == YoloTask::Segment {
            outlines::report_holes(cx.log, products, self.masks, labels.iter().map(|label| label.id))?;
        }
        for label in &labels {
            text += &line(cx.dataset.category(label.category)?.0, &self.points(products, label.id, size)?, size);
        }
        output.write(&format!("{}/{}", output.id(), self.label_path(scene, view)), text.as_bytes())
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
        let text = data::text(&self.images(), self.masks, cx.dataset);
        write_file(finish, &path, text.as_bytes())
    }
}

/// The corners of a box, moved to the edge of the image if the box is larger.
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
