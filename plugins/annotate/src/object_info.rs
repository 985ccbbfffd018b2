//! What the objects of a view are and where they lie.

use crate::matrix::pose;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, OBJECT_INFO};
use syntable_model::scene::Body;

/// Asset, category, mass and poses of every object. Poses are 4 × 4 matrices, row by row, of the body frame in metres;
/// the camera frame is x right, y down, z forward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectInfo {
    /// Which objects to describe: the `annotated` ones, or `all` objects of the scene, seen or not.
    pub objects: Which,
}

/// A set of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// Those that have an amodal mask in the view.
    Annotated,
    /// All objects of the scene.
    All,
}

impl Default for ObjectInfo {
    fn default() -> Self {
        Self { objects: Which::Annotated }
    }
}

impl Config for ObjectInfo {
    type Stage = dyn Annotator;
    const KIND: &'static str = "object_info";
    const EXAMPLE: &'static str = "objects = \"annotated\"";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for ObjectInfo {
    fn reads(&self) -> Vec<KeyId> {
        match self.objects {
            Which::Annotated => keys![AMODAL_MASK],
            Which::All => keys![],
        }
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_INFO]
    }

    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()> {
        let camera_from_world = view(site)?.camera.world_from_camera.inverse();
        let annotated = match self.objects {
            Which::Annotated => Some(frame.get(AMODAL_MASK)?),
            Which::All => None,
        };
        let info = site
            .scene
            .objects()
            .iter()
            .filter(|body| annotated.is_none_or(|masks| masks.get(body.id).is_some()))
            .map(|body| (body.id, describe(body, &camera_from_world)))
            .collect();
        frame.put(OBJECT_INFO, info)
    }
}

/// The view of a site, for an annotator that runs once a view.
pub(crate) fn view<'a>(site: &Site<'a>) -> Result<&'a View> {
    site.view.ok_or_else(|| Error::new("a product of a view was asked for without a view"))
}

fn describe(body: &Body, camera_from_world: &Pose) -> Value {
    let object = &body.object;
    Value::record([
        ("asset", body.asset.to_string().into()),
        ("pool", body.asset.pool.as_str().into()),
        ("name", body.asset.name.as_str().into()),
        ("category", object.category.as_str().into()),
        ("spawn", body.spawn.into()),
        ("mass_kg", object.mass_kg.into()),
        ("licence", object.licence.as_str().into()),
        ("digest", object.digest.to_string().into()),
        ("world_from_object", pose(&body.world_from_body)),
        ("camera_from_object", pose(&(camera_from_world * body.world_from_body))),
    ])
}

register!(ObjectInfo);
