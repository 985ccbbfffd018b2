//! Views in which the objects of a scene are visible.

use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::standard::{OCCLUSION_RATE, SEEN_IN_VIEWS, VISIBLE_MASK};

/// Views that show each object of the scene: the object's `id`; the numbers of the `views` in which it is annotated
/// with a visible pixel; and `best_view`, the view with its lowest occlusion rate, with this rate as
/// `least_occlusion_rate`. For an object that no view shows, both are `null`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SeenInViews {}

config!(SeenInViews => dyn SceneAnnotator, "seen_in_views");

impl SceneAnnotator for SeenInViews {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, OCCLUSION_RATE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![SEEN_IN_VIEWS]
    }

    fn annotate(&self, cx: &SceneContext, views: &[ViewProducts], products: &mut Products) -> Result<()> {
        let mut seen: BTreeMap<InstanceId, Vec<(u32, f64)>> =
            cx.scene.objects().iter().map(|body| (body.id, Vec::new())).collect();
        for view in views {
            let rates = view.products.get(OCCLUSION_RATE)?;
            for (id, _) in view.products.get(VISIBLE_MASK)?.iter().filter(|(_, mask)| !mask.is_empty()) {
                let rate = rates.get(id).copied().unwrap_or_default();
                seen.entry(id).or_default().push((view.view.id.0, rate));
            }
        }
        let record = |(id, views): (InstanceId, Vec<(u32, f64)>)| {
            let best = views.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            let (best_view, least_occlusion_rate) = best.unzip();
            let views = views.into_iter().map(|(view, _)| view).collect();
            Value::of(&SeenRecord { id: id.0, views, best_view, least_occlusion_rate })
        };
        let records = seen.into_iter().map(record).collect::<Result<_>>()?;
        products.put(SEEN_IN_VIEWS, Value::List(records))
    }
}

/// An entry of the product `seen_in_views`.
#[derive(Serialize)]
struct SeenRecord {
    id: u16,
    views: Vec<u32>,
    best_view: Option<u32>,
    least_occlusion_rate: Option<f64>,
}

register!(SeenInViews);
