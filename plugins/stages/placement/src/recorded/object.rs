//! Objects of a recorded image.

use std::collections::BTreeMap;
use syntable_model::geometry::{Translation3, rigid};
use syntable_model::prelude::*;
use syntable_model::product::Value;
use syntable_model::reader::ImageRef;
use syntable_model::scene::{AssetRef, CatalogEntry, Object};

/// Maximum distance between the poses of an object that stays in its place, meters.
const SAME_M: f64 = 0.005;

/// Maximum angle between the poses of an object that stays in its place, radians.
const SAME_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// The fields of an entry of the product `object_info` that are read.
#[derive(Deserialize)]
struct ObjectEntry {
    asset: String,
    #[serde(default)]
    obj_id: Option<i64>,
    #[serde(default)]
    scale: Option<f64>,
    #[serde(default)]
    model_origin_m: [f64; 3],
    #[serde(default)]
    world_from_object: Option<[[f64; 4]; 4]>,
    #[serde(default)]
    camera_from_object: Option<[[f64; 4]; 4]>,
}

/// An object of a recorded scene.
#[derive(Debug, Clone)]
pub struct RecordedObject {
    /// Id in the images that show it.
    pub id: InstanceId,
    /// Pool and name of the asset, or the name alone.
    pub asset: String,
    /// Number of the asset, if the dataset states it.
    pub obj_id: Option<u32>,
    /// Ratio of the lengths of the object to its asset's.
    pub scale: f64,
    /// Pose of the frame of the asset's file, at the object's scale, in the recorded frame.
    pub recording_from_file: Pose,
}

impl RecordedObject {
    /// The object of a value of the product `object_info`. `camera` is the pose of the camera in the recorded frame.
    pub fn read(id: InstanceId, value: &Value, camera: &Pose, image: &ImageRef) -> Result<Self> {
        let about = |error: Error| error.context(format!("object {id} of `{}`", image.name));
        let unlike = |error: serde_json::Error| about(Error::new(format!("it is not a record of an object: {error}")));
        let entry: ObjectEntry = serde_json::to_value(value).and_then(serde_json::from_value).map_err(unlike)?;
        let pose = |rows, key: &str| rigid(rows, key).map_err(|error| about(Error::new(error.message)));
        let recording_from_object = match (entry.camera_from_object, entry.world_from_object) {
            (Some(rows), _) => camera * pose(rows, "camera_from_object")?,
            (None, Some(rows)) => pose(rows, "world_from_object")?,
            (None, None) => return Err(about(Error::new("the dataset does not state its pose"))),
        };
        let scale = entry.scale.unwrap_or(1.0);
        if !entry.model_origin_m.iter().all(|x| x.is_finite()) || !scale.is_finite() || scale <= 0.0 {
            return Err(about(Error::new("its origin or its scale is not a number of a size")));
        }
        let [x, y, z] = entry.model_origin_m;
        let obj_id = entry.obj_id.and_then(|id| u32::try_from(id).ok());
        let recording_from_file = recording_from_object * Translation3::new(x, y, z);
        Ok(Self { id, asset: entry.asset, obj_id, scale, recording_from_file })
    }

    /// Whether an object of another image is this one at the same place.
    pub fn is(&self, other: &Self) -> bool {
        let [own, its] = [self, other].map(|object| &object.recording_from_file);
        self.asset == other.asset
            && self.scale == other.scale
            && (own.translation.vector - its.translation.vector).norm() <= SAME_M
            && own.rotation.angle_to(&its.rotation) <= SAME_RAD
    }

    /// Pose of the body of an object in the recorded frame: its pool may have moved the origin of the file.
    pub fn recording_from_body(&self, object: &Object) -> Pose {
        self.recording_from_file * Translation3::from(-object.model.origin.coords)
    }
}

/// The assets of some pools, for objects of recorded scenes.
pub struct KnownAssets<'c> {
    by_full_name: BTreeMap<String, AssetRef>,
    by_number: BTreeMap<u32, AssetRef>,
    by_name: BTreeMap<&'c str, AssetRef>,
}

impl<'c> KnownAssets<'c> {
    /// The assets of pools. Of several with one number or one name, the first counts.
    pub fn of(pools: &ObjectPools, context: &Context<'c>) -> Result<Self> {
        let mut known = Self { by_full_name: BTreeMap::new(), by_number: BTreeMap::new(), by_name: BTreeMap::new() };
        for pool in pools.names() {
            let in_labels = context.assets.pool_name(pool).to_owned();
            for CatalogEntry { name, obj_id, .. } in context.assets.entries(pool)? {
                let asset = AssetRef { pool: in_labels.clone(), name: name.clone() };
                known.by_full_name.entry(format!("{pool}/{name}")).or_insert_with(|| asset.clone());
                if let Some(number) = obj_id {
                    known.by_number.entry(*number).or_insert_with(|| asset.clone());
                }
                let last = name.rsplit('/').next().unwrap_or(name);
                known.by_name.entry(last).or_insert(asset);
            }
        }
        Ok(known)
    }

    /// The asset of a recorded object: the asset with its pool and name, with its number, or else with its name.
    pub fn asset(&self, object: &RecordedObject) -> Option<&AssetRef> {
        let last = object.asset.rsplit('/').next().unwrap_or(&object.asset);
        let by_number = || self.by_number.get(&object.obj_id?);
        self.by_full_name.get(&object.asset).or_else(by_number).or_else(|| self.by_name.get(last))
    }
}
