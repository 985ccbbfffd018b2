//! Visible part of every object.

use crate::CANVAS;
use crate::object_info::Which;
use syntable_model::prelude::*;
use syntable_model::product::extents;
use syntable_model::product::standard::{AMODAL_MASK, COVERAGE, DEPTH, INSTANCE, VISIBILITY};
use syntable_model::product::{BitPlane, PixelCounts, Plane};

/// Visibility of every object, counted as in BOP's `scene_gt_info.json`.
///
/// `px_count_all` is the number of pixels of the whole silhouette, without table, room and other objects, on a canvas
/// that extends one image size beyond every edge. Of these pixels, `px_count_in_frame` are in the image,
/// `px_count_valid` have a depth there, and `px_count_visib` show the object. `visib_fract` is `px_count_visib /
/// px_count_all`. `outside_fract` is the fraction of the silhouette outside the image, and `truncated` is true if it is
/// not zero. `silhouette_box` is the box of the whole silhouette: x, y, width and height in pixels from the image's
/// top-left corner; x and y may be negative.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Visibility {
    /// Objects to count: the `annotated` ones (the default), or `all` objects of the scene, visible or not.
    pub objects: Which,
}

impl Default for Visibility {
    fn default() -> Self {
        Self { objects: Which::Annotated }
    }
}

config!(Visibility => dyn ViewAnnotator, "visibility", "objects = \"annotated\"");

impl ViewAnnotator for Visibility {
    fn reads(&self) -> Vec<KeyId> {
        let mut keys = keys![INSTANCE, DEPTH, COVERAGE, COVERAGE.on_canvas(CANVAS)];
        if self.objects == Which::Annotated {
            keys.push(AMODAL_MASK.id());
        }
        keys
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBILITY]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (image, canvas) = (products.get(COVERAGE)?, products.get(COVERAGE.on_canvas(CANVAS))?);
        let depth = products.get(DEPTH)?;
        let (inside, whole) = (extents(image), extents(canvas));
        let valid = count_valid(image, depth, inside.iter().map(|extent| extent.area).collect());
        let k = &cx.view.camera.intrinsics;
        let visible = count_visible(products.get(INSTANCE)?, image.objects());
        let of = |id: InstanceId| -> Result<Value> {
            let object = usize::from(id.0) - 1;
            let (Some(all), Some(in_frame)) = (whole.get(object), inside.get(object)) else {
                return Err(Error::new(format!("instance {id} is not in the coverage plane")));
            };
            let [x, y, width, height] = all.bounds();
            let visib = visible[object];
            PixelCounts {
                all: all.area,
                in_frame: in_frame.area,
                valid: valid[object],
                visible: visib,
                silhouette: [x as i32 - k.width as i32, y as i32 - k.height as i32, width as i32, height as i32],
            }
            .record()
        };
        let ids: Vec<InstanceId> = match self.objects {
            Which::Annotated => products.get(AMODAL_MASK)?.iter().map(|(id, _)| id).collect(),
            Which::All => (1..=image.objects()).map(|id| InstanceId(id as u16)).collect(),
        };
        let visibility = ids.into_iter().map(|id| Ok((id, of(id)?))).collect::<Result<_>>()?;
        products.put(VISIBILITY, visibility)
    }
}

/// For each object, the number of pixels that show it.
fn count_visible(first: &Plane<InstanceId>, objects: usize) -> Vec<u64> {
    let mut counts = vec![0; objects];
    for run in first.data().chunk_by(|a, b| a == b) {
        if let Some(count) = usize::from(run[0].0).checked_sub(1).and_then(|object| counts.get_mut(object)) {
            *count += run.len() as u64;
        }
    }
    counts
}

/// For each object, the number of its pixels in the image that have a depth: `counts` minus the pixels without one.
fn count_valid(image: &BitPlane, depth: &Plane<f32>, mut counts: Vec<u64>) -> Vec<u64> {
    let missing = |depth: f32| !(depth.is_finite() && depth > 0.0);
    for (set, _) in image.data().chunks_exact(image.words()).zip(depth.data()).filter(|(_, depth)| missing(**depth)) {
        for (word, &bits) in set.iter().enumerate() {
            let mut bits = bits;
            while bits != 0 {
                counts[word * 64 + bits.trailing_zeros() as usize] -= 1;
                bits &= bits - 1;
            }
        }
    }
    counts
}

register!(Visibility);
