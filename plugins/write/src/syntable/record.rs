//! The records of images and annotations.

use super::{BoxSource, Compat};
use crate::jsonl::encoded;
use serde_json::Value as Json;
use syntable_formats::segmentation::Rle;
use syntable_formats::syntable::{
    Annotation, Image, OBJECT_CATEGORY, Scene, depth_path, occlusion_order_path, rgb_path, syntable_1,
};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, BODIES, CAMERA, CATEGORY_ID, DENOISER, EXPOSURE, LABEL_POLICY, OBJECT_INFO, OBJECT_NAME,
    OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::product::{BBox, OcclusionOrder};

/// The date of every record: files do not depend on the clock.
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
struct ObjectLabels<'a> {
    visible: &'a Mask,
    amodal: &'a Mask,
    occlusion: &'a Mask,
    rate: f64,
    visible_box: BBox,
    amodal_box: BBox,
}

impl<'a> Labels<'a> {
    /// All labels of a view.
    pub fn of(products: &'a Products) -> Result<Self> {
        let order = products.get(OCCLUSION_ORDER)?;
        Ok(Self {
            visible: products.get(VISIBLE_MASK)?,
            amodal: products.get(AMODAL_MASK)?,
            occlusion: products.get(OCCLUSION_MASK)?,
            rate: products.get(OCCLUSION_RATE)?,
            visible_box: products.get(VISIBLE_BOX)?,
            amodal_box: products.get(AMODAL_BOX)?,
            order,
            ids: order.ids().to_vec(),
        })
    }

    /// Drops what SynTable 1 drops: objects without a visible pixel, or with a rate that rounds to 1.00.
    pub fn annotated_by(mut self, compat: Compat) -> Self {
        if compat == Compat::Syntable1 {
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

    fn object(&self, id: InstanceId) -> Result<ObjectLabels<'a>> {
        fn of<'a, T>(product: &'a PerInstance<T>, id: InstanceId, name: &str) -> Result<&'a T> {
            product.get(id).ok_or_else(|| {
                Error::new(format!("instance {id} is in `occlusion_order` but not in `{name}`"))
                    .help("all label products must come from one annotator, or from annotators that agree")
                    .permanent()
            })
        }
        Ok(ObjectLabels {
            visible: of(self.visible, id, VISIBLE_MASK.name())?,
            amodal: of(self.amodal, id, AMODAL_MASK.name())?,
            occlusion: of(self.occlusion, id, OCCLUSION_MASK.name())?,
            rate: *of(self.rate, id, OCCLUSION_RATE.name())?,
            visible_box: *of(self.visible_box, id, VISIBLE_BOX.name())?,
            amodal_box: *of(self.amodal_box, id, AMODAL_BOX.name())?,
        })
    }
}

/// The record of an image in the coco form, without its id.
pub fn image(cx: &ViewContext, products: &Products, labels: &Labels) -> Result<Image> {
    Ok(Image {
        scene_id: Some(cx.scene.id.0),
        view_id: Some(cx.view.id.0),
        instance_ids: Some(labels.ids().iter().map(|id| id.0).collect()),
        depth_unit_mm: Some(1),
        camera: Some(encoded(products, CAMERA.name())?),
        exposure: Some(encoded(products, EXPOSURE.name())?),
        denoiser: Some(encoded(products, DENOISER.name())?),
        label_policy: Some(encoded(products, LABEL_POLICY.name())?),
        ..image_1(cx, products)?
    })
}

/// The record of an image in the syntable_1 form, without its id.
pub fn image_1(cx: &ViewContext, products: &Products) -> Result<Image> {
    let rgb = products.get(RGB)?;
    let (scene, view) = (cx.scene.id.0, cx.view.id.0);
    Ok(Image {
        id: 0,
        file_name: rgb_path(scene, view),
        depth_file_name: Some(depth_path(scene, view)),
        occlusion_order_file_name: Some(occlusion_order_path(scene, view)),
        width: rgb.width(),
        height: rgb.height(),
        date_captured: Some(DATE.into()),
        license: Some(1),
        coco_url: Some(String::new()),
        flickr_url: Some(String::new()),
        ..Image::default()
    })
}

/// What the ids of a scene stand for: the product `bodies`.
pub fn scene(cx: &SceneContext, products: &Products) -> Result<Scene> {
    let bodies = serde_json::from_value(encoded(products, BODIES.name())?);
    let bodies = bodies.map_err(|error| Error::new(format!("product `{}`: {error}", BODIES.name())).permanent())?;
    Ok(Scene { id: cx.scene.id.0, bodies, extra: Default::default() })
}

/// The record of an annotation in the coco form, without its id and that of its image.
pub fn annotation(products: &Products, labels: &Labels, id: InstanceId, bbox: BoxSource) -> Result<Annotation> {
    let object = labels.object(id)?;
    let info = products.get(OBJECT_INFO)?.get(id).map_or(Ok(Json::Null), serde_json::to_value);
    Ok(Annotation {
        id: 0,
        image_id: 0,
        category_id: products.get(CATEGORY_ID)?.get(id).map_or(OBJECT_CATEGORY, |&category| category.into()),
        instance_id: Some(id.0),
        object_name: Some(object_name(products, id)?),
        bbox: object.bbox(bbox),
        visible_bbox: Some(object.visible_box.into()),
        amodal_bbox: Some(object.amodal_box.into()),
        width: Some(object.amodal.width()),
        height: Some(object.amodal.height()),
        iscrowd: 0,
        area: object.amodal.area().into(),
        visible_area: Some(object.visible.area().into()),
        occluded_area: Some(object.occlusion.area().into()),
        occluded_rate: object.rate,
        occluded_rate_rounded: Some(two_decimals(object.rate)),
        segmentation: Rle::encode(object.amodal),
        visible_mask: Rle::encode(object.visible),
        occluded_mask: Rle::encode(object.occlusion),
        object: Some(info.map_err(|error| Error::new(format!("instance {id} in `object_info`: {error}")))?),
        extra: Default::default(),
    })
}

/// The record of an annotation in the syntable_1 form, without its id and that of its image.
pub fn annotation_1(
    products: &Products,
    labels: &Labels,
    id: InstanceId,
    bbox: BoxSource,
) -> Result<syntable_1::Annotation> {
    let object = labels.object(id)?;
    let with_area = |mask: &Mask, factor: u64| Rle { area: Some(factor * u64::from(mask.area())), ..Rle::encode(mask) };
    Ok(syntable_1::Annotation {
        id: 0,
        image_id: 0,
        category_id: OBJECT_CATEGORY,
        bbox: object.bbox(bbox),
        width: object.amodal.width(),
        height: object.amodal.height(),
        object_name: object_name(products, id)?.replace('/', "_"),
        iscrowd: 0,
        segmentation: with_area(object.amodal, syntable_1::RENDERER_ID),
        area: 0,
        visible_mask: with_area(object.visible, 1),
        visible_bbox: object.visible_box.into(),
        occluded_mask: with_area(object.occlusion, 1),
        occluded_rate: two_decimals(object.rate),
        extra: Default::default(),
    })
}

impl ObjectLabels<'_> {
    /// The box of the source. An object without a visible pixel has no other box than the amodal one.
    fn bbox(&self, source: BoxSource) -> [i32; 4] {
        match source {
            BoxSource::Visible if !self.visible.is_empty() => self.visible_box.into(),
            BoxSource::Visible | BoxSource::Amodal => self.amodal_box.into(),
        }
    }
}

/// The asset's name; not unique within an image.
fn object_name(products: &Products, id: InstanceId) -> Result<String> {
    Ok(products.get(OBJECT_NAME)?.get(id).cloned().unwrap_or_default())
}

/// Rounds to two decimals as Python's `round` does: by the exact decimal value, ties to even.
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
