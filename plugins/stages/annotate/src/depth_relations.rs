//! Occlusion in pixels, and the order in depth.

use syntable_model::prelude::*;
use syntable_model::product::ObjectRun;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH_ORDER, INSTANCE, OBJECT_DEPTHS, OCCLUSION_AREAS};

/// Pairwise occlusion areas, counted on the rays of the view, and the objects from front to back.
///
/// `occlusion_areas` has the `ids` of the annotated objects and three matrices of pixel counts. Row i and column j
/// count the pixels of the amodal mask of object j that are behind object i: in `seen`, the pixels where the image
/// shows i, which are positive if i occludes j in the occlusion order; in `direct`, the pixels without another object
/// between i and j; in `all`, all of them. `direct` and `all` include pixels where table or room hide i as well.
///
/// `depth_order` lists the objects `front_to_back` by the median depth of their first surface, hidden parts included,
/// and this depth as `median_depth_m`. At equal depths, the lower id comes first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthRelations {}

config!(DepthRelations => dyn ImageAnnotator, "depth_relations");

impl ImageAnnotator for DepthRelations {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OCCLUSION_AREAS, DEPTH_ORDER]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let (seen, depths) = (products.get(INSTANCE)?, products.get(OBJECT_DEPTHS)?);
        let masks = products.get(AMODAL_MASK)?;
        let ids: Vec<InstanceId> = masks.iter().map(|(id, _)| id).collect();
        let mut rows = vec![None; ids.last().map_or(0, |id| usize::from(id.0) + 1)];
        ids.iter().enumerate().for_each(|(row, id)| rows[usize::from(id.0)] = Some(row));
        let row = |id: InstanceId| rows.get(usize::from(id.0)).copied().flatten();
        let mut pairs = vec![Pair::default(); ids.len() * ids.len()];
        let mut depths_of: Vec<Vec<f32>> =
            masks.iter().map(|(_, mask)| Vec::with_capacity(mask.area() as usize)).collect();
        let mut count = |run: ObjectRun<'_>, first: InstanceId, pixels: u32| {
            for (place, id) in run.ids().enumerate() {
                let Some(hidden) = row(id) else { continue };
                for (before, other) in run.ids().take(place).enumerate() {
                    if let Some(front) = row(other) {
                        let pair = &mut pairs[front * ids.len() + hidden];
                        pair.all += pixels;
                        pair.direct += pixels * u32::from(before + 1 == place);
                        pair.seen += pixels * u32::from(other == first);
                    }
                }
            }
        };
        for run in depths.runs() {
            for (place, id) in run.ids().enumerate() {
                if let Some(row) = row(id) {
                    depths_of[row].extend(run.depths_from(run.x, place));
                }
            }
            // Neighboring pixels that show the same body are counted together.
            let start = run.y as usize * seen.width() as usize + run.x as usize;
            let first = &seen.data()[start..][..run.length as usize];
            first.chunk_by(|a, b| a == b).for_each(|first| count(run, first[0], first.len() as u32));
        }
        let mut order: Vec<(f32, InstanceId)> =
            depths_of.iter_mut().zip(&ids).map(|(depths, &id)| (median(depths), id)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let order = Value::record([
            ("front_to_back", order.iter().map(|(_, id)| i64::from(id.0)).collect::<Vec<_>>().into()),
            ("median_depth_m", order.iter().map(|(depth, _)| f64::from(*depth)).collect::<Vec<_>>().into()),
        ]);
        let areas = Value::of(&Areas::new(&ids, &pairs))?;
        products.put(OCCLUSION_AREAS, areas)?;
        products.put(DEPTH_ORDER, order)
    }
}

/// The product `occlusion_areas`.
#[derive(Serialize)]
struct Areas {
    ids: Vec<u16>,
    seen: Vec<Vec<u32>>,
    direct: Vec<Vec<u32>>,
    all: Vec<Vec<u32>>,
}

/// Pixel counts of a pair of objects: pixels at which the first is in front of the second, at which it is directly in
/// front, and at which it is also the visible object.
#[derive(Clone, Copy, Default)]
struct Pair {
    all: u32,
    direct: u32,
    seen: u32,
}

impl Areas {
    /// From pairs row by row: the object in front, then the hidden one.
    fn new(ids: &[InstanceId], pairs: &[Pair]) -> Self {
        let of = |count: fn(&Pair) -> u32| {
            pairs.chunks(ids.len().max(1)).map(|row| row.iter().map(count).collect()).collect()
        };
        Self {
            ids: ids.iter().map(|id| id.0).collect(),
            seen: of(|pair| pair.seen),
            direct: of(|pair| pair.direct),
            all: of(|pair| pair.all),
        }
    }
}

/// The median, or the lower of two medians; infinite without depths.
fn median(depths: &mut [f32]) -> f32 {
    let middle = depths.len().saturating_sub(1) / 2;
    if depths.is_empty() { f32::INFINITY } else { *depths.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

register!(DepthRelations);
