//! The records of images and annotations.

use super::{Bbox, Compat};
use crate::files::view;
use crate::jsonl::json;
use serde_json::{Value as Json, json};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CAMERA, DENOISER, EXPOSURE, LABEL_POLICY, OBJECT_INFO, OCCLUSION_MASK, OCCLUSION_ORDER,
    OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::product::{BBox, OcclusionOrder};

/// The date of every record: the dataset knows no clock.
pub const DATE: &str = "1970-01-01 00:00:00.000000";

/// The labels of a view, and which of its instances are annotated.
pub struct Labels<'a> {
    visible: &'a PerInstance<Mask>,
    amodal: &'a PerInstance<Mask>,
    occlusion: &'a PerInstance<Mask>,
    rate: &'a PerInstance<f64>,
    visible_box: &'a PerInstance<BBox>,
    amodal_box: &'a PerInstance<BBox>,
    /// The order of all instances that have labels.
    pub order: &'a OcclusionOrder,
    ids: Vec<InstanceId>,
}

/// The labels of one instance.
struct Object<'a> {
    visible: &'a Mask,
    amodal: &'a Mask,
    occlusion: &'a Mask,
    rate: f64,
    visible_box: BBox,
    amodal_box: BBox,
}

impl<'a> Labels<'a> {
    /// All labels of a view.
    pub fn of(frame: &'a Frame) -> Result<Self> {
        let order = frame.get(OCCLUSION_ORDER)?;
        Ok(Self {
            visible: frame.get(VISIBLE_MASK)?,
            amodal: frame.get(AMODAL_MASK)?,
            occlusion: frame.get(OCCLUSION_MASK)?,
            rate: frame.get(OCCLUSION_RATE)?,
            visible_box: frame.get(VISIBLE_BOX)?,
            amodal_box: frame.get(AMODAL_BOX)?,
            order,
            ids: order.ids().to_vec(),
        })
    }

    /// Leaves out what the released program leaves out: objects with no visible pixel, or with a rate that is 1.00
    /// when rounded.
    pub fn annotated_by(mut self, compat: Compat) -> Self {
        if compat == Compat::Release {
            let seen = |id: &InstanceId| self.visible.get(*id).is_some_and(|mask| !mask.is_empty());
            let hidden = |id: &InstanceId| self.rate.get(*id).is_some_and(|&rate| two_decimals(rate) >= 1.0);
            self.ids.retain(|id| seen(id) && !hidden(id));
        }
        self
    }

    /// The annotated instances, in id order.
    pub fn ids(&self) -> &[InstanceId] {
        &self.ids
    }

    /// The annotated instances' rows of the order.
    pub fn rows(&self) -> Vec<usize> {
        let row = |id: &InstanceId| self.order.ids().binary_search(id).expect("the ids are those of the order");
        self.ids.iter().map(row).collect()
    }

    /// The visible, amodal and occlusion mask of an instance.
    pub fn masks(&self, id: InstanceId) -> Result<[&'a Mask; 3]> {
        let object = self.object(id)?;
        Ok([object.visible, object.amodal, object.occlusion])
    }

    fn object(&self, id: InstanceId) -> Result<Object<'a>> {
        fn of<'a, T>(product: &'a PerInstance<T>, id: InstanceId, name: &str) -> Result<&'a T> {
            product.get(id).ok_or_else(|| {
                Error::new(format!("instance {id} is in `occlusion_order` but not in `{name}`"))
                    .help("all label products must come from one annotator, or from annotators that agree")
            })
        }
        Ok(Object {
            visible: of(self.visible, id, VISIBLE_MASK.name())?,
            amodal: of(self.amodal, id, AMODAL_MASK.name())?,
            occlusion: of(self.occlusion, id, OCCLUSION_MASK.name())?,
            rate: *of(self.rate, id, OCCLUSION_RATE.name())?,
            visible_box: *of(self.visible_box, id, VISIBLE_BOX.name())?,
            amodal_box: *of(self.amodal_box, id, AMODAL_BOX.name())?,
        })
    }
}

/// The record of an image.
pub fn image(site: &Site, frame: &Frame, labels: &Labels, name: &str) -> Result<Json> {
    let mut record = released_image(site, frame, name)?;
    let more = [
        ("scene_id", site.scene.id.0.into()),
        ("view_id", view(site)?.id.0.into()),
        ("instance_ids", labels.ids().iter().map(|id| id.0).collect()),
        ("depth_unit_mm", 1.into()),
        ("camera", json(frame, CAMERA.name())?),
        ("exposure", json(frame, EXPOSURE.name())?),
        ("denoiser", json(frame, DENOISER.name())?),
        ("label_policy", json(frame, LABEL_POLICY.name())?),
    ];
    for (key, value) in more {
        record[key] = value;
    }
    Ok(record)
}

/// The record of an image with the released program's keys.
pub fn released_image(site: &Site, frame: &Frame, name: &str) -> Result<Json> {
    let rgb = frame.get(RGB)?;
    Ok(json!({
        "id": image_id(site)?,
        "file_name": format!("data/mono/rgb/{name}.png"),
        "depth_file_name": format!("data/mono/depth/{name}.png"),
        "occlusion_order_file_name": format!("data/mono/occlusion_order/{name}.npy"),
        "width": rgb.width(),
        "height": rgb.height(),
        "date_captured": DATE,
        "license": 1,
        "coco_url": "",
        "flickr_url": "",
    }))
}

/// The record of an annotation, without its id.
pub fn annotation(site: &Site, frame: &Frame, labels: &Labels, id: InstanceId, bbox: Bbox) -> Result<Json> {
    let object = labels.object(id)?;
    let info = frame.get(OBJECT_INFO)?.get(id).map(serde_json::to_value).transpose();
    let info = info.map_err(|error| Error::new(format!("instance {id} in `object_info`: {error}")))?;
    Ok(json!({
        "image_id": image_id(site)?,
        "category_id": 1,
        "instance_id": id.0,
        "object_name": object_name(site, id),
        "bbox": object.bbox(bbox),
        "visible_bbox": array(object.visible_box),
        "amodal_bbox": array(object.amodal_box),
        "width": object.amodal.width(),
        "height": object.amodal.height(),
        "iscrowd": 0,
        "area": object.amodal.area(),
        "visible_area": object.visible.area(),
        "occluded_area": object.occlusion.area(),
        "occluded_rate": object.rate,
        "occluded_rate_rounded": two_decimals(object.rate),
        "segmentation": rle(object.amodal),
        "visible_mask": rle(object.visible),
        "occluded_mask": rle(object.occlusion),
        "object": info,
    }))
}

/// The record of an annotation, without its id, with the released program's keys and values.
///
/// Its area is 0, and the area inside `segmentation` is the sum of the instance ids over the mask instead of a number
/// of pixels; those inside the other masks are right.
pub fn released_annotation(site: &Site, labels: &Labels, id: InstanceId, bbox: Bbox) -> Result<Json> {
    let object = labels.object(id)?;
    let with_area = |mask: &Mask, area: u64| {
        let mut rle = rle(mask);
        rle["area"] = area.into();
        rle
    };
    Ok(json!({
        "image_id": image_id(site)?,
        "category_id": 1,
        "bbox": object.bbox(bbox),
        "visible_bbox": array(object.visible_box),
        "width": object.amodal.width(),
        "height": object.amodal.height(),
        "object_name": object_name(site, id),
        "iscrowd": 0,
        "segmentation": with_area(object.amodal, u64::from(object.amodal.area()) * u64::from(id.0)),
        "area": 0,
        "visible_mask": with_area(object.visible, object.visible.area().into()),
        "occluded_mask": with_area(object.occlusion, object.occlusion.area().into()),
        "occluded_rate": two_decimals(object.rate),
    }))
}

impl Object<'_> {
    fn bbox(&self, which: Bbox) -> [i32; 4] {
        array(match which {
            Bbox::Visible => self.visible_box,
            Bbox::Amodal => self.amodal_box,
        })
    }
}

/// From 1; a function of scene and view alone.
fn image_id(site: &Site) -> Result<u64> {
    let (scene, view) = (u64::from(site.scene.id.0), u64::from(view(site)?.id.0));
    Ok(scene * u64::from(site.dataset.views_per_scene) + view + 1)
}

/// The asset's name; not unique within an image.
fn object_name<'a>(site: &Site<'a>, id: InstanceId) -> &'a str {
    site.scene.body(id).map_or("", |body| &body.asset.name)
}

fn array(bbox: BBox) -> [i32; 4] {
    bbox.into()
}

/// A mask as COCO's compressed runs.
fn rle(mask: &Mask) -> Json {
    json!({ "size": [mask.height(), mask.width()], "counts": mask.to_coco() })
}

/// Rounded to two decimals as Python's `round` does: by the exact decimal value, ties to even.
fn two_decimals(rate: f64) -> f64 {
    format!("{rate:.2}").parse().unwrap_or(rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_round_as_in_python() {
        // round(x, 2) of CPython.
        for (rate, want) in
            [(0.005, 0.01), (0.125, 0.12), (0.375, 0.38), (0.994999, 0.99), (0.995, 0.99), (0.9951, 1.0)]
        {
            assert_eq!(two_decimals(rate), want, "{rate}");
        }
    }
}
