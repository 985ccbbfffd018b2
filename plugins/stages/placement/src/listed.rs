//! Objects at the poses of a list.

use crate::material::MaterialReplacement;
use crate::mesh::POSITION_M;
use crate::objects::COUNT;
use crate::rotation::{ROTATION_DEG, check_quaternion, euler, of_quaternion};
use crate::variation::{ColorChange, FinishChange, SCALE, Variation, resized};
use std::sync::{Arc, Mutex, PoisonError};
use syntable_mesh::root::read_file;
use syntable_model::context::Assets;
use syntable_model::geometry::{Translation3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetRef, BodyDraft, DropZone, Motion, Role};

/// Places objects at listed poses: a layout that was planned or measured.
///
/// A pose is the pose of the frame of the asset's file, in which embedded objects have the center of their bounding box at the origin.
/// The list is in the recipe or in a JSON file, or in both. All scenes have the same poses; objects without a stated `asset`, sizes and
/// looks differ. Objects may overlap.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Listed {
    /// Object pools to take the objects from.
    from: ObjectPools,
    /// The poses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 10000))]
    poses: Vec<ListedPose>,
    /// JSON file with a list of further poses, whose entries have the same keys as `poses`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-syntable-ref" = "file"))]
    file: Option<AssetPath>,
    /// Name of the support that positions count from: the center of its surface. The axes are the world's. If left out, positions are in
    /// the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    relative_to: Option<SupportName>,
    /// Factor of each object's size, 0.01 to 100; the mass grows with its cube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    scale: Option<Dist>,
    /// Changes the colors of some objects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some objects, such as `{ from = "materials", probability = 0.2 }`. Shape and mass stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how some objects reflect light, such as `{ roughness = { uniform = [0, 1] } }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Whether the objects are labeled. Otherwise, they are distractors.
    #[serde(default = "yes")]
    annotated: bool,
    /// Whether the objects stay at their poses. Otherwise, physics lets them settle from there, on the support of `relative_to` or else
    /// the first support of the scene.
    #[serde(default = "yes")]
    fixed: bool,
}

/// The pose of an object.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ListedPose {
    /// Name of the asset, or its pool and name, such as `objects/mug_0003`. Without it, an asset is drawn for each scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    asset: Option<String>,
    /// Position of the origin: x, y and z, meters, −1000 to 1000.
    #[schemars(inner(range(min = POSITION_M[0], max = POSITION_M[1])))]
    position_m: [f64; 3],
    /// Roll, pitch and yaw: rotations about the world's x, y and z axes, in this order, degrees, −3600 to 3600.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = ROTATION_DEG[0], max = ROTATION_DEG[1]))))]
    rotation_deg: Option<[f64; 3]>,
    /// Rotation as a unit quaternion `[w, x, y, z]`, instead of `rotation_deg`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = -1.0, max = 1.0))))]
    quaternion_wxyz: Option<[f64; 4]>,
}

fn yes() -> bool {
    true
}

impl ListedPose {
    /// Refuses numbers that are no pose. `key` is the place of the entry.
    fn check(&self, key: &str) -> Result<(), ConfigError> {
        let within = |name: &str, values: &[f64], [low, high]: [f64; 2]| {
            let outside = values.iter().enumerate().find(|(_, value)| !(low..=high).contains(*value));
            outside.map_or(Ok(()), |(axis, value)| {
                let message = format!("`{name}[{axis}] = {value}` is not within {low} and {high}");
                Err(ConfigError::new(format!("{key}.{name}[{axis}]"), message))
            })
        };
        within("position_m", &self.position_m, POSITION_M)?;
        within("rotation_deg", self.rotation_deg.as_ref().map_or(&[], |it| it.as_slice()), ROTATION_DEG)?;
        let Some(quaternion) = self.quaternion_wxyz else { return Ok(()) };
        check_quaternion(&format!("{key}.quaternion_wxyz"), quaternion, self.rotation_deg.is_some())
    }

    fn rotation(&self) -> UnitQuaternion<f64> {
        let angles = self.rotation_deg.unwrap_or_default();
        self.quaternion_wxyz.map_or_else(|| euler(angles), of_quaternion)
    }
}

impl Config for Listed {
    type Stage = dyn Placer;
    const KIND: &'static str = "listed";
    const EXAMPLE: &'static str = "from = \"objects\"\nrelative_to = \"table\"\nposes = [\n    \
                                   { asset = \"mug_0003\", position_m = [0.1, 0.0, 0.06] },\n    \
                                   { position_m = [-0.2, 0.1, 0.1], rotation_deg = [0, 90, 30] },\n]";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        if self.poses.is_empty() && self.file.is_none() {
            return Err(ConfigError::new("poses", "the step lists no poses").help("set `poses` or `file`"));
        }
        for (number, pose) in self.poses.iter().enumerate() {
            pose.check(&format!("poses[{number}]"))?;
        }
        self.variation().check()?;
        Ok(Box::new(ListedPlacer { options: self, read: Mutex::default() }))
    }
}
register!(Listed);

impl Listed {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }
}

struct ListedPlacer {
    options: Listed,
    /// The poses of recipe and file, after the first scene has been placed.
    read: Mutex<Option<Arc<[ListedPose]>>>,
}

impl Placer for ListedPlacer {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let Listed { relative_to, fixed, .. } = &self.options;
        let needs = relative_to.is_some() || !fixed;
        Some(needs.then(|| PartUse::Needs(Part::support(relative_to.as_ref()))).into_iter().collect())
    }

    fn places_objects(&self) -> bool {
        self.options.annotated
    }

    fn resizes_objects(&self) -> bool {
        self.options.annotated && self.options.variation().resizes()
    }

    fn ready(&self, assets: &dyn Assets, _: &dyn Log) -> Result<()> {
        let poses = self.poses()?;
        let named = (0..).zip(poses.iter()).filter_map(|(number, pose)| Some((number, pose.asset.as_ref()?)));
        named.into_iter().try_for_each(|(number, name)| self.asset(number, name, assets).map(drop))
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let Listed { from, relative_to, annotated, fixed, .. } = &self.options;
        let poses = self.poses()?;
        let support = match relative_to.is_some() || !fixed {
            true => Some(scene.support(relative_to.as_ref())?.clone()),
            false => None,
        };
        let base = support.as_ref().filter(|_| relative_to.is_some());
        let base = base.map_or_else(Vector3::zeros, |support| support.center().coords);
        let role = if *annotated { Role::Object } else { Role::Distractor };
        let motion = if *fixed { Motion::Fixed } else { Motion::Dynamic };
        context.assets.expect(poses.len());
        for (number, pose) in poses.iter().enumerate() {
            let stream = context.stream.child("object").at(number as u64);
            let (asset, object) = match &pose.asset {
                Some(name) => {
                    let asset = self.asset(number, name, context.assets)?;
                    let object = context.assets.get(&asset).and_then(Asset::into_object)?;
                    (asset, object)
                }
                None => context.assets.draw_object(from, &mut stream.child("asset"))?,
            };
            let factor = self.options.variation().factor(&stream);
            let object = resized(object, factor).map_err(|error| error.context(asset.to_string()))?;
            let position = base + Vector3::from(pose.position_m);
            let of_file = Pose::from_parts(position.into(), pose.rotation());
            let of_body = of_file * Translation3::from(-object.model.origin.coords);
            let body = BodyDraft::new(asset, object, of_body, role, motion);
            let body = self.options.variation().painted(body, context.assets, &stream)?;
            match &support {
                Some(support) if !fixed => {
                    scene.drop_body(body, DropZone { starts_at_rest: true, ..DropZone::on(support.clone()) })
                }
                _ => scene.add(body),
            };
        }
        Ok(())
    }
}

impl ListedPlacer {
    /// The poses of recipe and file; the first call reads the file.
    fn poses(&self) -> Result<Arc<[ListedPose]>> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(poses) = &*read {
            return Ok(Arc::clone(poses));
        }
        let mut poses = self.options.poses.clone();
        if let Some(file) = &self.options.file {
            poses.extend(of_file(file).map_err(|error| error.in_file(file.path()))?);
            if poses.len() as i64 > COUNT[1] {
                let message =
                    format!("{} poses with the poses of the recipe, and a scene has 1 to {}", poses.len(), COUNT[1]);
                return Err(Error::new(message).in_file(file.path()));
            }
        }
        let poses: Arc<[ListedPose]> = poses.into();
        *read = Some(Arc::clone(&poses));
        Ok(poses)
    }

    /// The asset that a pose names.
    fn asset(&self, number: usize, name: &str, assets: &dyn Assets) -> Result<AssetRef> {
        // The poses of the file come after the poses of the recipe.
        let of_recipe = self.options.poses.len();
        named(name, &self.options.from, assets).map_err(|error| match &self.options.file {
            Some(file) if number >= of_recipe => {
                error.context(format!("pose {} of the list", number - of_recipe)).in_file(file.path())
            }
            _ => error.context(format!("pose {number}")),
        })
    }
}

/// The poses of a JSON file.
fn of_file(file: &AssetPath) -> Result<Vec<ListedPose>> {
    let bytes = read_file(file.path())?;
    // Some editors begin text files with a byte order mark.
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let poses: Vec<ListedPose> = serde_json::from_slice(text).map_err(|error| {
        let help = "write a list of poses: [{ \"asset\": \"mug_0003\", \"position_m\": [0, 0, 0.1] }]";
        Error::new(format!("not a list of poses: {error}")).at_line(error.line()).help(help)
    })?;
    if poses.is_empty() || poses.len() as i64 > COUNT[1] {
        return Err(Error::new(format!("{} poses, and a scene has 1 to {}", poses.len(), COUNT[1])));
    }
    for (number, pose) in poses.iter().enumerate() {
        pose.check(&format!("[{number}]")).map_err(|error| {
            let refusal = Error::new(format!("{}: {}", error.key, error.message));
            error.help.into_iter().fold(refusal, |refusal, help| refusal.help(help))
        })?;
    }
    Ok(poses)
}

/// The asset of a name, or of a pool and a name, in some pools.
fn named(text: &str, pools: &ObjectPools, assets: &dyn Assets) -> Result<AssetRef> {
    let find = |pool: &str, name: &str| -> Result<Option<AssetRef>> {
        let found = assets.entries(pool)?.binary_search_by(|entry| entry.name.as_str().cmp(name)).is_ok();
        Ok(found.then(|| AssetRef { pool: assets.pool_name(pool).to_owned(), name: name.to_owned() }))
    };
    let mut found = Vec::new();
    for pool in pools.names() {
        let in_pool = text.strip_prefix(pool).and_then(|rest| rest.strip_prefix('/'));
        for name in [Some(text), in_pool].into_iter().flatten() {
            found.extend(find(pool, name)?.filter(|asset| !found.contains(asset)));
        }
    }
    match found.as_slice() {
        [asset] => Ok(asset.clone()),
        [] => {
            let message = format!("the listed object `{text}` is in none of `{}`", pools.names().join("`, `"));
            Err(Error::new(message).help("check `include` and `exclude` of its pool"))
        }
        [first, second, ..] => {
            let message = format!("the listed object `{text}` may be `{first}` or `{second}`");
            Err(Error::new(message).help("write the pool before its name"))
        }
    }
}
