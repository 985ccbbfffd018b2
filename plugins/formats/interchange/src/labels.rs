//! The labels that all formats share.

use crate::coco::MaskChoice;
use syntable_formats::json::typed;
use syntable_formats::read::label_of;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, BOX, CATEGORY_ID, OCCLUSION_MASK, OCCLUSION_RATE, VISIBLE_BOX, VISIBLE_MASK,
};

/// The products that [`labels`] reads.
pub fn inputs() -> Vec<Input> {
    vec![
        Input::of(VISIBLE_MASK),
        Input::of(AMODAL_MASK),
        Input::of(OCCLUSION_MASK),
        Input::of(OCCLUSION_RATE),
        Input::of(VISIBLE_BOX),
        Input::of(AMODAL_BOX),
        Input::of(CATEGORY_ID),
    ]
}

/// The labels of one object in a view.
#[derive(Debug, Clone, Copy)]
pub struct ShownLabel<'a> {
    /// Its id in the scene.
    pub id: InstanceId,
    /// Pixels at which the object is the first body.
    pub visible: &'a Mask,
    /// Pixels that the object would cover without the other objects.
    pub amodal: &'a Mask,
    /// The amodal mask minus the visible mask.
    pub occlusion: &'a Mask,
    /// Hidden share of the amodal area, in [0, 1].
    pub rate: f64,
    /// Box of the visible mask; zeros if the mask is empty.
    pub visible_box: BBox,
    /// Box of the amodal mask.
    pub amodal_box: BBox,
    /// Id of its category.
    pub category: u32,
}

/// The inputs of a format that requires only the labels `needed`.
fn inputs_needing(needed: Vec<KeyId>) -> Vec<Input> {
    let is_needed = |input: &Input| needed.iter().any(|key| key.is(&input.product));
    inputs().into_iter().map(|input| if is_needed(&input) { input } else { input.optional() }).collect()
}

/// The inputs of formats with visible masks.
pub fn visible_inputs() -> Vec<Input> {
    only(keys![VISIBLE_MASK, VISIBLE_BOX, CATEGORY_ID])
}

/// The inputs of formats with amodal masks.
pub fn amodal_inputs() -> Vec<Input> {
    only(keys![AMODAL_MASK, AMODAL_BOX, CATEGORY_ID])
}

/// The inputs of formats with boxes alone, of the masks that the option `masks` selects.
pub fn boxes_alone_inputs(masks: MaskChoice) -> Vec<Input> {
    let own = match masks {
        MaskChoice::Visible => VISIBLE_BOX.id(),
        MaskChoice::Amodal => AMODAL_BOX.id(),
    };
    storing(&[own, BOX.id(), CATEGORY_ID.id()], box_inputs(masks))
}

/// The inputs of a format that requires and stores only these labels.
fn only(labels: Vec<KeyId>) -> Vec<Input> {
    storing(&labels.clone(), inputs_needing(labels))
}

/// The inputs of a format that stores only the products `stored`: the others decide what it stores.
fn storing(stored: &[KeyId], inputs: Vec<Input>) -> Vec<Input> {
    let of = |input: Input| if stored.iter().any(|key| key.is(&input.product)) { input } else { input.not_stored() };
    inputs.into_iter().map(of).collect()
}

/// The inputs of formats that accept either kind of mask. The option `masks` selects the preferred kind. [`partial`]
/// refuses a dataset without any masks.
pub fn either_inputs(masks: MaskChoice) -> Vec<Input> {
    let preferred = match masks {
        MaskChoice::Visible => VISIBLE_MASK,
        MaskChoice::Amodal => AMODAL_MASK,
    };
    let named =
        |input: Input| Input { option: (input.product == *preferred.name()).then(|| "masks".to_owned()), ..input };
    inputs_needing(keys![CATEGORY_ID]).into_iter().map(named).collect()
}

/// The inputs of formats that can store objects by their boxes alone.
pub fn box_inputs(masks: MaskChoice) -> Vec<Input> {
    either_inputs(masks).into_iter().chain([Input::of(BOX).if_stored()]).collect()
}

/// The labels of one object in a view of a dataset that need not have both kinds of masks.
#[derive(Debug, Clone, Copy)]
pub struct Partial<'a> {
    /// Its id in the scene.
    pub id: InstanceId,
    /// Id of its category.
    pub category: u32,
    /// Its masks.
    pub masks: LabelMasks<'a>,
}

/// The place of an object in the image: masks with their boxes, or a box alone.
#[derive(Debug, Clone, Copy)]
pub enum LabelMasks<'a> {
    /// A box without a mask, as detection datasets have it: x, y, width, height, px.
    Box([f64; 4]),
    /// Pixels at which the object is the first body.
    Visible(&'a Mask, BBox),
    /// Pixels that the object would cover without the other objects.
    Amodal(&'a Mask, BBox),
    /// All labels.
    All(ShownLabel<'a>),
}

impl<'a> From<ShownLabel<'a>> for Partial<'a> {
    fn from(label: ShownLabel<'a>) -> Self {
        Self { id: label.id, category: label.category, masks: LabelMasks::All(label) }
    }
}

/// The labels of all objects of a view, by id, for a format whose inputs are [`box_inputs`]. An object whose masks are empty or
/// missing has its stated box, if the products have one.
///
/// # Errors
/// If the products have neither masks nor boxes, or the dataset lacks the category of an object.
pub fn partial_or_box<'a>(dataset: &DatasetInfo, products: &'a Products) -> Result<Vec<Partial<'a>>> {
    let Some(boxes) = products.optional(BOX)? else { return partial(dataset, products) };
    let stated = |id: InstanceId| boxes.get(id).map(typed::<[f64; 4]>).transpose();
    let wrong = |error: serde_json::Error| Error::new(format!("product `{}`: {error}", BOX.name()));
    if [VISIBLE_MASK, AMODAL_MASK].iter().all(|key| !products.contains(key.name())) {
        let of_object = |(id, bbox)| {
            let masks = LabelMasks::Box(typed(bbox).map_err(wrong)?);
            Ok(Partial { id, category: category(dataset, products, id)?, masks })
        };
        return boxes.iter().map(of_object).collect();
    }
    let with_box = |label: Partial<'a>| match stated(label.id).map_err(wrong)?.filter(|_| !label.masks.has_pixels()) {
        Some(bbox) => Ok(Partial { masks: LabelMasks::Box(bbox), ..label }),
        None => Ok(label),
    };
    partial(dataset, products)?.into_iter().map(with_box).collect()
}

impl LabelMasks<'_> {
    fn has_pixels(&self) -> bool {
        match self {
            Self::Box(_) => false,
            Self::Visible(mask, _) | Self::Amodal(mask, _) => !mask.is_empty(),
            Self::All(label) => !label.visible.is_empty() || !label.amodal.is_empty(),
        }
    }
}

/// The labels of all objects of a view, by id. A dataset with one kind of mask yields only this kind.
///
/// # Errors
/// If the dataset has neither visible nor amodal masks, or lacks the category of an object.
pub fn partial<'a>(dataset: &DatasetInfo, products: &'a Products) -> Result<Vec<Partial<'a>>> {
    let has = |input: Input| products.contains(&*input.product);
    if inputs().into_iter().all(has) {
        return Ok(labels(dataset, products)?.into_iter().map(Partial::from).collect());
    }
    let [is_visible, is_amodal] = [VISIBLE_MASK, AMODAL_MASK].map(|key| products.contains(key.name()));
    let (masks, boxes) = match (is_visible, is_amodal) {
        (true, _) => (VISIBLE_MASK, VISIBLE_BOX),
        (false, true) => (AMODAL_MASK, AMODAL_BOX),
        (false, false) => {
            return Err(Error::new("the dataset has neither masks (`visible_mask`, `amodal_mask`) nor boxes (`box`)"));
        }
    };
    let known = if is_visible { LabelMasks::Visible } else { LabelMasks::Amodal };
    let of_object = |(id, mask)| {
        Ok(Partial {
            id,
            category: category(dataset, products, id)?,
            masks: known(mask, *label_of(products, boxes, id)?),
        })
    };
    products.get(masks)?.iter().map(of_object).collect()
}

/// The labels of all annotated objects of a view, by id.
///
/// # Errors
/// If the dataset lacks the category of an object.
pub fn labels<'a>(dataset: &DatasetInfo, products: &'a Products) -> Result<Vec<ShownLabel<'a>>> {
    let amodal = products.get(AMODAL_MASK)?;
    let label = |(id, amodal)| {
        Ok(ShownLabel {
            id,
            visible: label_of(products, VISIBLE_MASK, id)?,
            amodal,
            occlusion: label_of(products, OCCLUSION_MASK, id)?,
            rate: *label_of(products, OCCLUSION_RATE, id)?,
            visible_box: *label_of(products, VISIBLE_BOX, id)?,
            amodal_box: *label_of(products, AMODAL_BOX, id)?,
            category: category(dataset, products, id)?,
        })
    };
    amodal.iter().map(label).collect()
}

/// The category of an object. It must be in the list of the dataset.
fn category(dataset: &DatasetInfo, products: &Products, id: InstanceId) -> Result<u32> {
    let category = *label_of(products, CATEGORY_ID, id)?;
    dataset.category(category).map_err(|error| error.context(format!("instance {id}")))?;
    Ok(category)
}
