//! Labels as arrays that a training loop reads without decoding.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_BITS, AMODAL_MASK, VISIBLE_IDS, VISIBLE_MASK};
use syntable_model::product::{DType, Painted, Tensor};

/// Visible masks as one plane of ids and amodal masks as bits: compact arrays for training loops, with the `npz`
/// writer.
///
/// `visible_ids` is `[height, width]`: the id of the visible annotated object, or 0. If visible masks overlap, as in
/// COCO and LVIS, a pixel belongs to the object with the smallest mask; the number of objects that lose pixels is
/// reported. `amodal_bits` is `[N, height, ⌈width/8⌉]` for N annotated objects in id order, with eight pixels of a row
/// per byte, the leftmost in the highest bit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LabelArrays {}

config!(LabelArrays => dyn ImageAnnotator, "label_arrays");

impl ImageAnnotator for LabelArrays {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_IDS, AMODAL_BITS]
    }

    fn groups(&self) -> Vec<ProductGroup> {
        vec![
            ProductGroup { reads: keys![VISIBLE_MASK], provides: keys![VISIBLE_IDS] },
            ProductGroup { reads: keys![AMODAL_MASK], provides: keys![AMODAL_BITS] },
        ]
    }

    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()> {
        if let Some(visible) = products.optional(VISIBLE_MASK)? {
            let painted = Painted::new(cx.size, visible.iter());
            painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
            products.put(VISIBLE_IDS, painted.ids)?;
        }
        let Some(amodal) = products.optional(AMODAL_MASK)? else { return Ok(()) };
        let [width, height] = cx.size.map(|edge| edge as usize);
        let bytes = width.div_ceil(8);
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
