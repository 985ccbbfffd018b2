//! Labels as arrays that a training loop reads without decoding.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_BITS, AMODAL_MASK, VISIBLE_IDS, VISIBLE_MASK};
use syntable_model::product::{DType, Tensor};

/// Visible masks as one plane of ids and amodal masks as bits: what a training loop reads with the `npz` writer.
///
/// `visible_ids` is `[height, width]`, the id of the annotated object that a pixel shows, else 0. `amodal_bits` is
/// `[N, height, ⌈width/8⌉]` for N annotated objects in id order, eight pixels of a row per byte, the leftmost in the
/// highest bit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LabelArrays {}

impl Config for LabelArrays {
    type Stage = dyn Annotator;
    const KIND: &'static str = "label_arrays";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for LabelArrays {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_IDS, AMODAL_BITS]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn groups(&self) -> Vec<ProductGroup> {
        vec![
            ProductGroup { reads: keys![VISIBLE_MASK], provides: keys![VISIBLE_IDS] },
            ProductGroup { reads: keys![AMODAL_MASK], provides: keys![AMODAL_BITS] },
        ]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let k = &cx.view.camera.intrinsics;
        if let Some(visible) = products.optional(VISIBLE_MASK)? {
            let mut ids = Plane::from_fn(k.width, k.height, |_, _| InstanceId::default());
            for (id, mask) in visible.iter() {
                mask.pixels().for_each(|pixel| ids.data_mut()[pixel] = id);
            }
            products.put(VISIBLE_IDS, ids)?;
        }
        let Some(amodal) = products.optional(AMODAL_MASK)? else { return Ok(()) };
        let (height, bytes) = (k.height as usize, (k.width as usize).div_ceil(8));
        let mut bits = vec![0_u8; amodal.0.len() * height * bytes];
        for (plane, (_, mask)) in bits.chunks_exact_mut(height * bytes).zip(amodal.iter()) {
            for (x, rows) in mask.segments() {
                let column = plane[rows.start as usize * bytes + x as usize / 8..].iter_mut().step_by(bytes);
                column.take(rows.len()).for_each(|byte| *byte |= 0x80 >> (x % 8));
            }
        }
        let bits = Tensor::new(DType::U8, &["instance", "y", "byte"], vec![amodal.0.len(), height, bytes], bits);
        products.put(AMODAL_BITS, Value::Tensor(bits))
    }
}

register!(LabelArrays);
