//! Objects of a recorded image.

use syntable_model::context::Assets;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Translation3, rigid};
use syntable_model::prelude::*;
use syntable_model::product::Value;
use syntable_model::reader::{ImageRef, is_unnamed};
use syntable_model::scene::{AssetRef, CatalogEntry, Object};

/// Maximum distance between the poses of an object that stays in its place, millimeters.
const SAME_MM: f64 = 5.0;

/// Maximum angle between the poses of an object that stays in its place, degrees.
const SAME_DEG: f64 = 2.0;

/// The fields of an entry of the product `object_info` that are read.
#[derive(Deserialize)]
struct ObjectEntry {
    asset: String,
    #[serde(default)]
    obj_id: Option<i64>,
    #[serde(default)]
    digest: Option<String>,
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
    /// Digest of the object at its size, if the dataset states it.
    pub digest: Option<String>,
    /// Ratio of the lengths of the object to its asset's.
    pub scale: f64,
    /// Pose of the frame of the asset's file, at the object's scale, in the recorded frame.
    pub recording_from_file: Pose,
}

impl RecordedObject {
    /// The object of a value of the product `object_info`. `camera` is the pose of the camera in the recorded frame; none if the recorded
    /// frame is the camera's.
    pub fn read(id: InstanceId, value: &Value, camera: Option<&Pose>, image: &ImageRef) -> Result<Self> {
        let about = |error: Error| error.context(format!("object {id} of `{}`", image.name));
        let unlike = |error: serde_json::Error| about(Error::new(format!("it is not a record of an object: {error}")));
        let entry: ObjectEntry = serde_json::to_value(value).and_then(serde_json::from_value).map_err(unlike)?;
        let pose = |rows, key: &str| rigid(rows, key).map_err(|error| about(Error::new(error.message)));
        let recording_from_object = match (entry.camera_from_object, entry.world_from_object, camera) {
            (Some(rows), _, Some(camera)) => camera * pose(rows, "camera_from_object")?,
            (Some(rows), _, None) => pose(rows, "camera_from_object")?,
            (None, Some(rows), Some(_)) => pose(rows, "world_from_object")?,
            (None, Some(_), None) => {
                return Err(about(Error::new("its pose is stated in the world, and the camera's pose is not")));
            }
            (None, None, _) => return Err(about(Error::new("the dataset does not state its pose"))),
        };
        let scale = entry.scale.unwrap_or(1.0);
        if !entry.model_origin_m.iter().all(|x| x.is_finite()) || !scale.is_finite() || scale <= 0.0 {
            return Err(about(Error::new("`model_origin_m` must be finite, and `scale` above 0")));
        }
        let [x, y, z] = entry.model_origin_m;
        let obj_id = entry.obj_id.and_then(|id| u32::try_from(id).ok());
        let recording_from_file = recording_from_object * Translation3::new(x, y, z);
        Ok(Self { id, asset: entry.asset, obj_id, digest: entry.digest, scale, recording_from_file })
    }

    /// Distance and angle from the pose of an object of another image, millimeters and degrees.
    pub fn apart(&self, other: &Self) -> (f64, f64) {
        let [own, its] = [self, other].map(|object| &object.recording_from_file);
        let meters = (own.translation.vector - its.translation.vector).norm();
        (1e3 * meters, own.rotation.angle_to(&its.rotation).to_degrees())
    }

    /// Whether an object of another image is this one at the same place.
    pub fn is(&self, other: &Self) -> bool {
        let (millimeters, degrees) = self.apart(other);
        self.asset == other.asset && self.scale == other.scale && millimeters <= SAME_MM && degrees <= SAME_DEG
    }

    /// Whether an object has another shape or another look than the recorded one. False if the dataset does not state its digest.
    pub fn differs_from(&self, digest: &Digest) -> bool {
        self.digest.as_ref().is_some_and(|recorded| *recorded != digest.to_string())
    }

    /// Pose of the body of an object in the recorded frame: its pool may have moved the origin of the file.
    pub fn recording_from_body(&self, object: &Object) -> Pose {
        self.recording_from_file * Translation3::from(-object.model.origin.coords)
    }
}

/// The asset of a recorded object in some pools: the asset with its pool and name; or else, the only one with its name; or else, if the
/// dataset names objects by their numbers, the only one with its number. None if the pools have no such asset.
///
/// # Errors
/// If several assets have the name or the number.
pub fn asset_of(object: &RecordedObject, pools: &ObjectPools, assets: &dyn Assets) -> Result<Option<AssetRef>> {
    let named = |pool: &str, name: &str| AssetRef { pool: assets.pool_name(pool).to_owned(), name: name.to_owned() };
    for pool in pools.names() {
        let Some(name) = object.asset.strip_prefix(pool).and_then(|rest| rest.strip_prefix('/')) else { continue };
        if assets.entries(pool)?.binary_search_by(|it| it.name.as_str().cmp(name)).is_ok() {
            return Ok(Some(named(pool, name)));
        }
    }
    let own = last_part(&object.asset);
    let is_numbered = object.obj_id.is_some_and(|number| is_unnamed(number.into(), own));
    let mut found: Vec<AssetRef> = Vec::new();
    for pool in pools.names() {
        let fits = |entry: &&CatalogEntry| match is_numbered {
            true => entry.obj_id == object.obj_id,
            false => last_part(&entry.name) == own,
        };
        for entry in assets.entries(pool)?.iter().filter(fits) {
            let asset = named(pool, &entry.name);
            if !found.contains(&asset) {
                found.push(asset);
            }
        }
    }
    match found.as_slice() {
        [first, second, ..] => {
            let message = format!("the recorded object `{}` may be `{first}` or `{second}`", object.asset);
            Err(Error::new(message)
                .help("name only the pool of its dataset in `from`, or narrow the pool by `include`"))
        }
        _ => Ok(found.pop()),
    }
}

/// The last part of a name with slashes.
fn last_part(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
