//! Edges of occlusion.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, INSTANCE, OCCLUSION_BOUNDARY};

/// Where one body ends before another one in the image, and which side is in front: of two pixels side by side that show
/// different bodies, the nearer one is 1 and the farther one 2. A pixel that is in front of one neighbor and behind another
/// is 1. What lies on something ends before it, too, with little difference in depth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionBoundary {}

impl Config for OcclusionBoundary {
    type Stage = dyn Annotator;
    const KIND: &'static str = "occlusion_boundary";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for OcclusionBoundary {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OCCLUSION_BOUNDARY]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (ids, depth) = (products.get(INSTANCE)?, products.get(DEPTH)?);
        let (width, height) = (ids.width(), ids.height());
        let mut boundary = Plane::from_fn(width, height, |_, _| 0_u8);
        let mut mark = |x: u32, y: u32, side: u8| {
            let pixel = &mut boundary.data_mut()[y as usize * width as usize + x as usize];
            *pixel = if *pixel == FRONT { FRONT } else { side };
        };
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            for (u, v) in [(x + 1, y), (x, y + 1)].into_iter().filter(|&(u, v)| u < width && v < height) {
                if ids.at(x, y) != ids.at(u, v) {
                    let nearer = depth.at(x, y) <= depth.at(u, v);
                    mark(x, y, if nearer { FRONT } else { BEHIND });
                    mark(u, v, if nearer { BEHIND } else { FRONT });
                }
            }
        }
        products.put(OCCLUSION_BOUNDARY, boundary)
    }
}

/// The side of a boundary in front, and the one behind.
const FRONT: u8 = 1;
const BEHIND: u8 = 2;

register!(OcclusionBoundary);
