//! Occlusion boundaries.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, INSTANCE, OCCLUSION_BOUNDARY};

/// Occlusion boundaries and their front sides: of two neighboring pixels that show different bodies, the nearer one is
/// 1 and the farther one 2. A pixel in front of one neighbor and behind another is 1. Bodies that lie on another have a
/// boundary, too, with a small difference in depth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionBoundary {}

config!(OcclusionBoundary => dyn ImageAnnotator, "occlusion_boundary");

impl ImageAnnotator for OcclusionBoundary {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OCCLUSION_BOUNDARY]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let (ids, depth) = (products.get(INSTANCE)?, products.get(DEPTH)?);
        let (ids_of, depth) = (ids.data(), depth.data());
        let (width, mut boundary) = (ids.width() as usize, vec![0_u8; ids_of.len()]);
        let mut edge = |here: usize, there: usize| {
            if ids_of[here] != ids_of[there] {
                let (front, behind) = if depth[here] <= depth[there] { (here, there) } else { (there, here) };
                boundary[front] = FRONT;
                // A pixel in front of one neighbor and behind another counts as in front.
                boundary[behind] = if boundary[behind] == FRONT { FRONT } else { BEHIND };
            }
        };
        for row in (0..ids_of.len()).step_by(width.max(1)) {
            (row + 1..row + width).for_each(|right| edge(right - 1, right));
        }
        (width..ids_of.len()).for_each(|below| edge(below - width, below));
        let boundary = Plane::from_vec(ids.width(), ids.height(), boundary);
        products.put(OCCLUSION_BOUNDARY, boundary)
    }
}

/// Values of the front side and the back side of a boundary.
const FRONT: u8 = 1;
const BEHIND: u8 = 2;

register!(OcclusionBoundary);
