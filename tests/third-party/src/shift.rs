//! Annotator `shift`: reads a product of a view and of the next view.

use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::standard::INSTANCE;

products! {
    /// Displacement (u, v) of the mean position of an object's visible pixels from the view to the next one.
    pub const SHIFT: Key<PerInstance<Value>> = view("shift").unit("px");
}

/// Measures how far each object moves in the image until the next view. Objects that either view does not show have no
/// shift.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Shift {}

impl Config for Shift {
    type Stage = dyn ViewAnnotator;
    const KIND: &'static str = "shift";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ViewAnnotator for Shift {
    fn reads(&self) -> Vec<KeyId> {
        // The second product has the camera of the next view, and the bodies at its moment.
        keys![INSTANCE, INSTANCE.of_next_view()]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![SHIFT]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let next = means(products.get(INSTANCE.of_next_view())?);
        let shift = |(id, [u, v]): (InstanceId, [f64; 2])| {
            let [next_u, next_v] = *next.get(&id)?;
            Some((id, Value::from([next_u - u, next_v - v])))
        };
        let objects = cx.scene.objects().len();
        let now = means(products.get(INSTANCE)?).into_iter().filter(|(id, _)| usize::from(id.0) <= objects);
        let shifts: PerInstance<Value> = now.filter_map(shift).collect();
        products.put(SHIFT, shifts)
    }
}
register!(Shift);

/// Mean position of the pixels of every id except the background.
fn means(ids: &Plane<InstanceId>) -> BTreeMap<InstanceId, [f64; 2]> {
    let mut sums: BTreeMap<InstanceId, [f64; 3]> = BTreeMap::new();
    let width = ids.width() as usize;
    for (position, id) in ids.data().iter().enumerate().filter(|(_, id)| id.0 != 0) {
        let [u, v, count] = sums.entry(*id).or_default();
        *u += (position % width) as f64 + 0.5;
        *v += (position / width) as f64 + 0.5;
        *count += 1.0;
    }
    sums.into_iter().map(|(id, [u, v, count])| (id, [u / count, v / count])).collect()
}
