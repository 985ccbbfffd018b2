//! Objects that are put down on a support: scattered, in rows, on a grid, stacked.

mod fill;
mod item;
mod layout;
mod limits;
mod options;
mod site;

pub use options::Arrange;

use item::Items;
use site::Sites;
use syntable_model::prelude::*;
use syntable_model::scene::is_in_group;

impl Config for Arrange {
    type Stage = dyn Placer;
    const KIND: &'static str = "arrange";
    const EXAMPLE: &'static str = "from = [\"objects\"]\ncount = 24\nlayout = { rows = { per_row = 4 } }\n\
                                   pose = { upright = 0.8, stable_pose = 0.2 }\nyaw_deg = { uniform = [-5, 5] }\nstack = 2";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.check()?;
        Ok(Box::new(self))
    }
}
register!(Arrange);

impl Placer for Arrange {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Needs(Part::support(self.support.as_ref()))])
    }

    fn places_objects(&self) -> bool {
        self.annotated
    }

    fn resizes_objects(&self) -> bool {
        self.annotated && self.variation().resizes()
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        if !self.annotated && self.support.as_ref().is_some_and(|name| !has_support(scene, name.as_str())) {
            return Ok(());
        }
        let mut sites = Sites::new(self, scene, context)?;
        let mut items = Items::new(self, context)?;
        fill::fill(self, &mut sites, &mut items, &context.stream)?;
        // A scene needs its objects, and not its distractors.
        if self.annotated && sites.placed.is_empty() {
            let name = self.support.as_ref().map_or("the support".to_owned(), |name| format!("`{}`", name.as_str()));
            return Err(Error::unlucky(format!("none of {} objects finds a place on {name}", items.count())).help(
                "take smaller objects or a larger support, raise `area_factor`, `occupied` or `max_tries`, or lower `gap_m`",
            ));
        }
        for (body, zone) in sites.placed {
            scene.drop_body(body, zone);
        }
        Ok(())
    }
}

/// Whether the scene has a support of a name or group. Furnishings that an earlier step names need not carry anything.
fn has_support(scene: &SceneBuilder, name: &str) -> bool {
    scene.supports.iter().any(|support| is_in_group(&support.name, name))
}
