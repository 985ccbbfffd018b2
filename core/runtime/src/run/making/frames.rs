//! The products of the moments of a scene.

use crate::run::making::losses::Losses;
use crate::run::making::stages::run_in_frame;
use crate::run::making::times::Times;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use syntable_model::context::SceneContext;
use syntable_model::error::Result;
use syntable_model::product::Products;
use syntable_model::scene::Moment;
use syntable_recipe::plan::Plan;

/// Products of a scene and its moments. The products of a moment are made once, for its first view.
pub struct Frames<'f> {
    plan: &'f Plan,
    times: &'f Times,
    losses: &'f Losses,
    of_scene: &'f Products,
    made: BTreeMap<Moment, Products>,
}

impl<'f> Frames<'f> {
    /// No moment yet; `of_scene` has the products of the scene from before its views.
    pub fn new(plan: &'f Plan, of_scene: &'f Products, (times, losses): (&'f Times, &'f Losses)) -> Self {
        Self { plan, times, losses, of_scene, made: BTreeMap::new() }
    }

    /// The products of the scene and of a moment. The context has the scene at this moment.
    pub fn products(&mut self, cx: &SceneContext, moment: Moment) -> Result<Products> {
        if self.plan.per_frame.is_empty() {
            return Ok(self.of_scene.clone());
        }
        match self.made.entry(moment) {
            Entry::Occupied(made) => Ok(made.get().clone()),
            Entry::Vacant(entry) => {
                let mut products = self.of_scene.clone();
                for stage in &self.plan.per_frame {
                    run_in_frame(self.times, self.losses, stage, &cx.frame(moment), &mut products)?;
                }
                Ok(entry.insert(products).clone())
            }
        }
    }
}
