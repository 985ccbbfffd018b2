//! Products as fields of images and annotations.

use super::Coco;
use std::collections::BTreeMap;
use syntable_formats::encode::kind::{Form, with_article};
use syntable_formats::json::unwritable;
use syntable_formats::{Extra, coco};
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Fields of images and annotations with another meaning, in this writer's files and in the files of the formats that the
/// reader of `coco` reads.
const TAKEN: &[&str] = &[
    "amodal_base",
    "amodal_bbox",
    "amodal_mask",
    "amodal_region",
    "area",
    "bbox",
    "category_id",
    "coco_url",
    "date_captured",
    "depth_file_name",
    "file_name",
    "flickr_url",
    "height",
    "id",
    "image_id",
    "inmodal_bbox",
    "inmodal_seg",
    "instance_id",
    "invisible_mask",
    "iscrowd",
    "keypoints",
    "label_policy",
    "license",
    "num_keypoints",
    "occl_depth",
    "occlude_rate",
    "occluded_mask",
    "occluded_rate",
    "segmentation",
    "visible_bbox",
    "visible_mask",
    "width",
];

impl Coco {
    /// Refuses fields that the records have already.
    pub(super) fn check_fields(&self) -> Result<(), ConfigError> {
        self.include.check_free(TAKEN)
    }

    /// The included products.
    pub(super) fn field_inputs(&self) -> Vec<Input> {
        self.include.inputs(Accepts::when(accepts))
    }

    /// The fields of the image, and of each object.
    pub(super) fn fields(&self, products: &Products) -> Result<(Extra, BTreeMap<InstanceId, Extra>)> {
        let (mut of_image, mut of_objects) = (Extra::new(), BTreeMap::<InstanceId, Extra>::new());
        for (product, _) in self.include.of_scope(products, Scope::View) {
            let json = |value: &Value| {
                serde_json::to_value(value).map_err(|error| unwritable(error).context(format!("product `{product}`")))
            };
            match products.value(product)? {
                Value::PerInstance(values) => {
                    for (id, value) in &values {
                        of_objects.entry(*id).or_default().insert(product.to_owned(), json(value)?);
                    }
                }
                value => drop(of_image.insert(product.to_owned(), json(&value)?)),
            }
        }
        Ok((of_image, of_objects))
    }

    /// The supercategories of the recipe, beside supercategories of a converted dataset.
    pub(super) fn set_supercategories(&self, categories: &mut [coco::Category]) -> Result<()> {
        for (name, supercategory) in &self.supercategories {
            let Some(category) = categories.iter_mut().find(|category| category.name == *name) else {
                let known: Vec<&str> = categories.iter().map(|category| category.name.as_str()).collect();
                return Err(Error::new(format!(
                    "`supercategories` names `{name}`, which is no category of the dataset"
                ))
                .help(format!("its categories are {}", known.join(", "))));
            };
            category.supercategory.clone_from(supercategory);
        }
        Ok(())
    }
}

/// Accepts products that are not an image.
fn accepts(key: &KeyId) -> Result<(), String> {
    if !key.scope.comes_with_view() {
        return Err("it is not made per view; write it with jsonl".to_owned());
    }
    match key.form().of_one() {
        form @ Form::Image { .. } => {
            Err(format!("a field holds no pixels, and this is {}; write it with png or npy", with_article(form)))
        }
        Form::Bytes => Err("a field holds no bytes; write it with jsonl".to_owned()),
        _ => Ok(()),
    }
}
