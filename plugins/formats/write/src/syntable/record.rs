//! The records of images and annotations.

use super::{BoxSource, Compat, SynTable};
use serde::de::DeserializeOwned;
use serde_json::Value as Json;
use syntable_formats::json;
use syntable_formats::read::label_of;
use syntable_formats::segmentation::Rle;
use syntable_formats::syntable::{
    OBJECT_CATEGORY, SynTableAnnotation, SynTableImage, SynTableScene, depth_path, occlusion_order_path, syntable_1,
};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, BODIES, CAMERA, CATEGORY_ID, DENOISER, EXPOSURE, LABEL_POLICY, OBJECT_INFO, OBJECT_NAME,
    OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::product::{BBox, OcclusionOrder, Product};

/// The date of every record: files do not depend on the clock.
pub const DATE: &str = "1970-01-01 00:00:00.000000";

/// The labels of a view, with the list of its annotated instances.
pub struct ViewLabels<'a> {
    products: &'a Products,
    /// Whether labels of hidden parts exist. A dataset without amodal masks does not have them.
    has_hidden: bool,
    /// The order of all instances that have labels.
    pub order: Option<&'a OcclusionOrder>,
    ids: Vec<InstanceId>,
}

/// The labels of one instance.
struct InstanceLabels<'a> {
    visible: &'a Mask,
    visible_box: BBox,
    hidden: Option<HiddenLabels<'a>>,
}

/// The labels of the hidden parts of one instance.
#[derive(Clone, Copy)]
struct HiddenLabels<'a> {
    amodal: &'a Mask,
    occlusion: &'a Mask,
    rate: f64,
    amodal_box: BBox,
}

impl<'a> ViewLabels<'a> {
    /// All labels of a view.
    pub fn of(products: &'a Products) -> Result<Self> {
        let order = products.optional(OCCLUSION_ORDER)?;
        let visible = products.get(VISIBLE_MASK)?;
        let ids = order.map_or_else(|| visible.iter().map(|(id, _)| id).collect(), |order| order.ids().to_vec());
        let hidden = [AMODAL_MASK.name(), OCCLUSION_MASK.name(), OCCLUSION_RATE.name(), AMODAL_BOX.name()];
        Ok(Self { products, has_hidden: hidden.into_iter().all(|name| products.contains(name)), order, ids })
    }

    /// Removes the objects that SynTable 1 omits: objects without a visible pixel, or with a rate that rounds to 1.00.
    pub fn annotated_by(mut self, compat: Compat) -> Result<Self> {
        if compat == Compat::Syntable1 {
            let (visible, rates) = (self.products.get(VISIBLE_MASK)?, self.products.optional(OCCLUSION_RATE)?);
            let is_seen = |id: &InstanceId| visible.get(*id).is_some_and(|mask| !mask.is_empty());
            let is_hidden =
                |id: &InstanceId| rates.and_then(|rates| rates.get(*id)).is_some_and(|rate| two_decimals(*rate) >= 1.0);
            self.ids.retain(|id| is_seen(id) && !is_hidden(id));
        }
        Ok(self)
    }

    /// The annotated instances, in id order.
    pub fn ids(&self) -> &[InstanceId] {
        &self.ids
    }

    /// The visible, amodal and occlusion mask of an instance.
    pub fn masks(&self, id: InstanceId) -> Result<[&'a Mask; 3]> {
        let object = self.object(id)?;
        let hidden = object.hidden()?;
        Ok([object.visible, hidden.amodal, hidden.occlusion])
    }

    fn object(&self, id: InstanceId) -> Result<InstanceLabels<'a>> {
        let products = self.products;
        let hidden = || -> Result<HiddenLabels<'a>> {
            Ok(HiddenLabels {
                amodal: label_of(products, AMODAL_MASK, id)?,
                occlusion: label_of(products, OCCLUSION_MASK, id)?,
                rate: *label_of(products, OCCLUSION_RATE, id)?,
                amodal_box: *label_of(products, AMODAL_BOX, id)?,
            })
        };
        Ok(InstanceLabels {
            visible: label_of(products, VISIBLE_MASK, id)?,
            visible_box: *label_of(products, VISIBLE_BOX, id)?,
            hidden: self.has_hidden.then(hidden).transpose()?,
        })
    }
}

/// The record of an image in the coco form, without its id.
pub fn image(config: &SynTable, cx: &ImageContext, products: &Products, labels: &ViewLabels) -> Result<SynTableImage> {
    Ok(SynTableImage {
        scene_id: Some(cx.scene_id.0),
        view_id: Some(cx.view_id.0),
        instance_ids: Some(labels.ids().iter().map(|id| id.0).collect()),
        depth_unit_mm: products.contains(&config.depth.key().id()).then_some(1),
        camera: found(products, CAMERA)?,
        exposure: found(products, EXPOSURE)?,
        denoiser: found(products, DENOISER)?,
        label_policy: found(products, LABEL_POLICY)?,
        ..image_1(config, cx, products)?
    })
}

/// A product as JSON; none if the product does not exist.
fn found<T: Product>(products: &Products, key: Key<T>) -> Result<Option<Json>> {
    products.optional(key)?.map(|_| json::of_product(products, key.name())).transpose()
}

/// The record of an image in the syntable_1 form, without its id.
pub fn image_1(config: &SynTable, cx: &ImageContext, products: &Products) -> Result<SynTableImage> {
    let rgb = products.get(RGB)?;
    let (scene, view) = (cx.scene_id.0, cx.view_id.0);
    Ok(SynTableImage {
        id: 0,
        file_name: config.rgb_path(scene, view),
        depth_file_name: products.optional(config.depth.key())?.map(|_| depth_path(scene, view)),
        occlusion_order_file_name: products.optional(OCCLUSION_ORDER)?.map(|_| occlusion_order_path(scene, view)),
        width: rgb.width(),
        height: rgb.height(),
        date_captured: Some(DATE.into()),
        license: Some(1),
        coco_url: Some(String::new()),
        flickr_url: Some(String::new()),
        ..SynTableImage::default()
    })
}

/// The bodies of a scene by id: the product `bodies`, if it exists.
pub fn scene(cx: &ImagesContext, products: &Products) -> Result<Option<SynTableScene>> {
    let Some(bodies) = found(products, BODIES)? else { return Ok(None) };
    Ok(Some(SynTableScene { id: cx.scene_id.0, bodies: decoded(BODIES.name(), &bodies)?, extra: Default::default() }))
}

/// Converts the records of a product to a type.
///
/// # Errors
/// If the records have other fields; the message names the product.
pub fn decoded<T: DeserializeOwned>(product: &str, value: &impl Serialize) -> Result<T> {
    json::typed(value).map_err(|error| Error::new(format!("product `{product}`: {error}")))
}

/// The record of an annotation in the coco form, with the ids of annotation and image left at 0.
pub fn annotation(
    dataset: &DatasetInfo,
    products: &Products,
    labels: &ViewLabels,
    id: InstanceId,
    bbox: BoxSource,
) -> Result<SynTableAnnotation> {
    let object = labels.object(id)?;
    let hidden = object.hidden;
    // COCO's readers expect a mask here, so the visible mask is used if no amodal mask exists.
    let whole = hidden.map_or(object.visible, |hidden| hidden.amodal);
    let info = |infos: &PerInstance<Value>| infos.get(id).map_or(Ok(Json::Null), serde_json::to_value);
    let info = products.optional(OBJECT_INFO)?.map(info).transpose();
    let category = products.optional(CATEGORY_ID)?.and_then(|categories| categories.get(id)).copied();
    let category = category.map_or_else(|| dataset.category_id(DatasetInfo::OBJECT.1), Ok)?;
    dataset.category(category).map_err(|error| error.context(format!("instance {id}")))?;
    Ok(SynTableAnnotation {
        id: 0,
        image_id: 0,
        category_id: category.into(),
        instance_id: Some(id.0),
        object_name: object_name(products, id)?,
        bbox: object.bbox(bbox),
        visible_bbox: Some(object.visible_box.into()),
        amodal_bbox: hidden.map(|it| it.amodal_box.into()),
        width: Some(whole.width()),
        height: Some(whole.height()),
        iscrowd: 0,
        area: whole.area().into(),
        visible_area: Some(object.visible.area().into()),
        occluded_area: hidden.map(|it| it.occlusion.area().into()),
        occluded_rate: hidden.map(|it| it.rate),
        occluded_rate_rounded: hidden.map(|it| two_decimals(it.rate)),
        segmentation: Rle::encode(whole),
        visible_mask: Rle::encode(object.visible),
        occluded_mask: hidden.map(|it| Rle::encode(it.occlusion)),
        object: info.map_err(|error| Error::new(format!("instance {id} in `object_info`: {error}")))?,
        extra: Default::default(),
    })
}

/// The record of an annotation in the syntable_1 form, with the ids of annotation and image left at 0.
pub fn annotation_1(
    products: &Products,
    labels: &ViewLabels,
    id: InstanceId,
    bbox: BoxSource,
) -> Result<syntable_1::SynTable1Annotation> {
    let object = labels.object(id)?;
    let hidden = object.hidden()?;
    let with_area = |mask: &Mask, factor: u64| Rle { area: Some(factor * u64::from(mask.area())), ..Rle::encode(mask) };
    Ok(syntable_1::SynTable1Annotation {
        id: 0,
        image_id: 0,
        category_id: OBJECT_CATEGORY,
        bbox: object.bbox(bbox),
        width: object.visible.width(),
        height: object.visible.height(),
        object_name: object_name(products, id)?.unwrap_or_default().replace('/', "_"),
        iscrowd: 0,
        segmentation: with_area(hidden.amodal, syntable_1::RENDERER_ID),
        area: 0,
        visible_mask: with_area(object.visible, 1),
        visible_bbox: object.visible_box.into(),
        occluded_mask: with_area(hidden.occlusion, 1),
        occluded_rate: two_decimals(hidden.rate),
        extra: Default::default(),
    })
}

impl<'a> InstanceLabels<'a> {
    /// The labels of hidden parts, for a form that requires them.
    fn hidden(&self) -> Result<HiddenLabels<'a>> {
        self.hidden.ok_or_else(|| Error::new("the objects have no amodal masks"))
    }

    /// The box of the given source. An object without a visible pixel has only the amodal box.
    fn bbox(&self, source: BoxSource) -> [i32; 4] {
        match (source, self.hidden) {
            (BoxSource::Visible, _) if !self.visible.is_empty() => self.visible_box.into(),
            (_, hidden) => hidden.map_or(self.visible_box, |it| it.amodal_box).into(),
        }
    }
}

/// The asset's name, if the dataset has names; not unique within an image.
fn object_name(products: &Products, id: InstanceId) -> Result<Option<String>> {
    Ok(products.optional(OBJECT_NAME)?.map(|names| names.get(id).cloned().unwrap_or_default()))
}

/// Rounds to two decimals like Python's `round`: by the exact decimal value, with ties to even.
pub fn two_decimals(rate: f64) -> f64 {
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
