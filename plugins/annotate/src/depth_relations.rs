//! Occlusion in pixels, and the order in depth.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH_ORDER, INSTANCE, OBJECT_DEPTHS, OCCLUSION_AREAS};

/// Who hides how much of whom, counted on the rays of the view, and the objects from front to back.
///
/// `occlusion_areas` has the `ids` of the annotated objects and three matrices of pixels. Row i and column j of each count
/// pixels of the amodal mask of object j before which object i stands: in `seen` those where the image shows i, which are
/// positive where the occlusion order says that i occludes j; in `direct` those where no other object is between them; in
/// `all` all of them. Where table or room hide i as well, they count in `direct` and `all`.
///
/// `depth_order` lists the objects `front_to_back` by the median depth of their first surface, hidden parts included, and
/// that depth as `median_depth_m`; of equal depths the lower id comes first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthRelations {}

impl Config for DepthRelations {
    type Stage = dyn Annotator;
    const KIND: &'static str = "depth_relations";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for DepthRelations {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OCCLUSION_AREAS, DEPTH_ORDER]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (seen, depths) = (products.get(INSTANCE)?, products.get(OBJECT_DEPTHS)?);
        let ids: Vec<InstanceId> = products.get(AMODAL_MASK)?.iter().map(|(id, _)| id).collect();
        let mut rows = vec![None; ids.last().map_or(0, |id| usize::from(id.0) + 1)];
        ids.iter().enumerate().for_each(|(row, id)| rows[usize::from(id.0)] = Some(row));
        let row = |id: InstanceId| rows.get(usize::from(id.0)).copied().flatten();
        let mut areas = Areas::new(&ids);
        let mut depths_of = vec![Vec::new(); ids.len()];
        for (objects, &first) in depths.pixels().zip(seen.data()) {
            for (place, &(id, depth)) in objects.iter().enumerate() {
                let Some(hidden) = row(id) else { continue };
                depths_of[hidden].push(depth);
                for (before, &(other, _)) in objects[..place].iter().enumerate() {
                    if let Some(front) = row(other) {
                        areas.add(front, hidden, before + 1 == place, other == first);
                    }
                }
            }
        }
        let mut order: Vec<(f32, InstanceId)> =
            depths_of.iter_mut().zip(&ids).map(|(depths, &id)| (median(depths), id)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let order = Value::record([
            ("front_to_back", order.iter().map(|(_, id)| i64::from(id.0)).collect::<Vec<_>>().into()),
            ("median_depth_m", order.iter().map(|(depth, _)| f64::from(*depth)).collect::<Vec<_>>().into()),
        ]);
        let areas = Value::of(&areas)?;
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

impl Areas {
    fn new(ids: &[InstanceId]) -> Self {
        let zeros = vec![vec![0; ids.len()]; ids.len()];
        Self { ids: ids.iter().map(|id| id.0).collect(), seen: zeros.clone(), direct: zeros.clone(), all: zeros }
    }

    /// Counts a pixel at which one object is before another: right before it, and as what the image shows.
    fn add(&mut self, front: usize, hidden: usize, is_direct: bool, is_seen: bool) {
        self.all[front][hidden] += 1;
        self.direct[front][hidden] += u32::from(is_direct);
        self.seen[front][hidden] += u32::from(is_seen);
    }
}

/// The median, the lower one of two; infinite of nothing.
fn median(depths: &mut [f32]) -> f32 {
    let middle = depths.len().saturating_sub(1) / 2;
    if depths.is_empty() { f32::INFINITY } else { *depths.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

register!(DepthRelations);
