//! A mesh from a file at a pose.

use crate::bounds::rotated_bounds;
use crate::dist_list::dist_list;
use crate::material::MaterialReplacement;
use crate::objects::FRICTION;
use crate::rotation::{ROTATION_DEG, check_quaternion, euler, of_quaternion};
use crate::variation::{ColorChange, FinishChange, Variation};
use schemars::{Schema, SchemaGenerator};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use syntable_mesh::format::MeshFormats;
use syntable_mesh::mass::scaled_kg;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::size::{self, StatedLengths};
use syntable_mesh::{ObjectInfo, Up};
use syntable_model::context::Assets;
use syntable_model::digest::Hasher;
use syntable_model::geometry::{Aabb, Point3, Vector3};
use syntable_model::length_unit::LengthUnit;
use syntable_model::panics::guarded;
use syntable_model::prelude::*;
use syntable_model::scene::{
    AssetRef, BodyDraft, CatalogEntry, DropZone, MassOrigin, Motion, Object, Region, Role, Support,
};

/// Pool of the meshes in the labels.
const POOL: &str = "mesh";

/// Limits of positions, meters.
pub const POSITION_M: [f64; 2] = [-1000.0, 1000.0];

/// Places a mesh of a file at a pose: a robot arm, a shelf, a second table, or an object.
///
/// The position and the rotation are the pose of the file's own frame, after `units`, `scale` and `up`. Each number can be a
/// distribution, which is drawn per scene. A step places one mesh; repeat the step for others. The file may use images and
/// materials of its own folder and the folders below it. Objects and clutter that later steps place keep away from the bounding
/// box of the mesh. In the labels, the mesh is `mesh/<name>`.
///
/// A mesh with `supports` has the role `support`, as tables do. Each of its supports is a level area with the extents of the
/// bounding box, on which other steps can place objects.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// The file, in any format that `mesh_folder` reads.
    #[schemars(extend("x-syntable-ref" = "file"))]
    path: AssetPath,
    /// Name in the labels; the file's name without extension by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    name: Option<String>,
    /// Unit of the file's lengths, for files that are not in meters.
    #[serde(default = "meters", skip_serializing_if = "is_meters")]
    units: LengthUnit,
    /// Factor of the file's lengths, in addition to `units`.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e6))]
    scale: f64,
    /// Which axis points up in formats that do not state it, such as OBJ, PLY and STL. glTF is y up by its standard.
    #[serde(default)]
    up: Up,
    /// Position of the file's origin: world x, y and z, meters, −1000 to 1000.
    #[serde(default = "origin")]
    #[schemars(schema_with = "position_schema")]
    position_m: [Dist; 3],
    /// Roll, pitch and yaw: rotations about the world's x, y and z axes, in this order, degrees, −3600 to 3600.
    #[serde(default = "origin")]
    #[schemars(schema_with = "rotation_schema")]
    rotation_deg: [Dist; 3],
    /// Rotation as a unit quaternion `[w, x, y, z]`, instead of `rotation_deg`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1.0, max = 1.0)))]
    quaternion_wxyz: Option<[f64; 4]>,
    /// Name of the support that `position_m` counts from: the center of its surface. The origin of the world, on the floor, by
    /// default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    relative_to: Option<SupportName>,
    /// Purpose of the mesh.
    #[serde(default)]
    role: MeshRole,
    /// Category of an `object`. It has an id of its own in annotation files, as the `classes` of pools do. Without a category,
    /// the mesh is an `object` there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    category: Option<String>,
    /// Number of an `object` (`obj_id` of BOP), different from the numbers of all other objects. Writers such as `bop` need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    obj_id: Option<u32>,
    /// Whether physics moves the mesh.
    #[serde(default)]
    motion: MeshMotion,
    /// Mass, kg. Estimated from the volume by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e5))]
    mass_kg: Option<f64>,
    /// Coulomb friction coefficient, 0 to 10; 0.5 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FRICTION[0], "maximum" = FRICTION[1]))]
    friction: Option<Dist>,
    /// Changes the colors of the mesh in some scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the materials of the file, such as `{ from = "materials", probability = 0.2 }`. Shape and mass stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how the mesh reflects light in some scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Level areas of the mesh that carry objects, such as `[{ name = "desk" }]` for its top, or one entry per shelf board.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    supports: Vec<MeshSupport>,
    #[serde(skip)]
    loaded: Loaded,
}

/// The content of the file, read when first needed.
#[derive(Debug, Default)]
struct Loaded(Mutex<Option<Content>>);

/// The object of a file, and the other files that it was read from.
#[derive(Debug, Clone)]
struct Content {
    object: Arc<Object>,
    companions: Vec<PathBuf>,
}

impl Clone for Loaded {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Purpose of a placed mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum MeshRole {
    /// Hides objects like the table and the room do, and has no label of its own.
    #[default]
    Fixture,
    /// Lies among the objects and hides them, and has no label of its own.
    Distractor,
    /// Is labeled as an object.
    Object,
}

/// Whether physics moves a placed mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum MeshMotion {
    /// Stays at its pose, even in the air.
    #[default]
    Static,
    /// Starts at its pose, falls and collides with the others. An object must come to rest on the support of `relative_to`, or
    /// else on the scene's first support.
    Dynamic,
}

/// A level area of a placed mesh that carries objects.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MeshSupport {
    /// Name among the scene's supports, for the option `support` of other stages.
    #[schemars(length(min = 1))]
    name: String,
    /// Height above the lowest point of the mesh, meters. The height of the whole mesh by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100.0))]
    height_m: Option<f64>,
    /// Height of the space above the area, meters, such as the distance to the next shelf board. The space ends at the ceiling
    /// by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 100.0))]
    clear_height_m: Option<f64>,
}

fn position_schema(generator: &mut SchemaGenerator) -> Schema {
    dist_list(generator, 3, POSITION_M)
}
fn rotation_schema(generator: &mut SchemaGenerator) -> Schema {
    dist_list(generator, 3, ROTATION_DEG)
}

fn meters() -> LengthUnit {
    LengthUnit::M
}
fn is_meters(unit: &LengthUnit) -> bool {
    *unit == meters()
}
fn one() -> f64 {
    1.0
}
fn origin() -> [Dist; 3] {
    [0.0; 3].map(Dist::Constant)
}

impl Config for Mesh {
    type Stage = dyn Placer;
    const KIND: &'static str = "mesh";
    const EXAMPLE: &'static str =
        "path = \"${ASSETS}/robot_arm.glb\"\nposition_m = [0.6, 0.0, 0.0]\nrotation_deg = [0, 0, 180]";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        for (key, values, [low, high]) in
            [("position_m", &self.position_m, POSITION_M), ("rotation_deg", &self.rotation_deg, ROTATION_DEG)]
        {
            for (axis, value) in values.iter().enumerate() {
                value.within(&format!("{key}[{axis}]"), low, high)?;
            }
        }
        if let Some(quaternion) = self.quaternion_wxyz {
            check_quaternion("quaternion_wxyz", quaternion, self.rotation_deg != origin())?;
        }
        for (key, is_given) in [("category", self.category.is_some()), ("obj_id", self.obj_id.is_some())] {
            if is_given && self.role != MeshRole::Object {
                let message = format!("`{key}` is for labels, and this mesh has none");
                return Err(ConfigError::new(key, message).help("set `role = \"object\"`"));
            }
        }
        if !self.supports.is_empty() && (self.role, self.motion) != (MeshRole::Fixture, MeshMotion::Static) {
            let message = "a mesh that carries objects is furniture that stays where it is";
            let help = "set `role = \"fixture\"` and `motion = \"static\"`, or remove `supports`";
            return Err(ConfigError::new("supports", message).help(help));
        }
        self.friction.as_ref().map_or(Ok(()), |friction| friction.within("friction", FRICTION[0], FRICTION[1]))?;
        self.variation().check()?;
        Ok(Box::new(self))
    }
}
register!(Mesh);

impl Placer for Mesh {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let needs = self.relative_to.iter().map(|name| PartUse::Needs(Part::support(Some(name))));
        let sets = self.supports.iter().map(|support| PartUse::Sets(Part::Support(support.name.clone())));
        Some(needs.chain(sets).collect())
    }

    fn places_objects(&self) -> bool {
        self.role == MeshRole::Object
    }

    fn own_objects(&self) -> Vec<CatalogEntry> {
        let (name, category) = (self.name(), self.category.clone().unwrap_or_default());
        let entry = CatalogEntry { obj_id: self.obj_id, ..CatalogEntry::new(name, category) };
        Some(entry).filter(|_| self.role == MeshRole::Object).into_iter().collect()
    }

    fn companions(&self, log: &dyn Log) -> Result<Vec<Companions>> {
        let files = self.content(log)?.companions;
        Ok(vec![Companions { of: self.path.path().to_owned(), files }])
    }

    /// Reads the file.
    fn ready(&self, _: &dyn Assets, log: &dyn Log) -> Result<()> {
        self.content(log).map(drop)
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let Content { object, .. } = self.content(context.log)?;
        let from = match &self.relative_to {
            Some(_) => scene.support(self.relative_to.as_ref())?.center().coords,
            None => Vector3::zeros(),
        };
        let draw = |name: &str, of: &[Dist; 3]| -> [f64; 3] {
            let stream = context.stream.child(name);
            std::array::from_fn(|axis| of[axis].draw(&mut stream.at(axis as u64)))
        };
        let rotation = match self.quaternion_wxyz {
            Some(quaternion) => of_quaternion(quaternion),
            None => euler(draw("rotation", &self.rotation_deg)),
        };
        let position = Vector3::from(draw("position", &self.position_m)) + from;
        let bounds = rotated_bounds(&object.mesh, &rotation);
        for support in &self.supports {
            let [min, max] = [bounds.min, bounds.max].map(|corner| corner + position);
            scene.supports.add(support.on(&Aabb { min, max })?)?;
        }
        let role = match self.role {
            MeshRole::Fixture if self.supports.is_empty() => Role::Fixture,
            MeshRole::Fixture => Role::Support,
            MeshRole::Distractor => Role::Distractor,
            MeshRole::Object => Role::Object,
        };
        let asset = AssetRef { pool: POOL.to_owned(), name: self.name() };
        let pose = Pose::from_parts(position.into(), rotation);
        let motion = match self.motion {
            MeshMotion::Static => Motion::Fixed,
            MeshMotion::Dynamic => Motion::Dynamic,
        };
        let body = BodyDraft::new(asset, object, pose, role, motion);
        let body = self.variation().painted(body, context.assets, &context.stream)?;
        let friction = self.friction.as_ref().map(|friction| friction.draw(&mut context.stream.child("friction")));
        let body = BodyDraft { friction: friction.unwrap_or(body.friction), ..body };
        match scene.support(self.relative_to.as_ref()).ok().cloned() {
            Some(support) if motion == Motion::Dynamic => {
                scene.drop_body(body, DropZone::on(support));
            }
            _ => drop(scene.add(body)),
        }
        Ok(())
    }
}

impl Mesh {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: None,
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    fn name(&self) -> String {
        let of_file = || self.path.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        self.name.clone().unwrap_or_else(of_file)
    }

    /// The content of the file, which the first call reads.
    fn content(&self, log: &dyn Log) -> Result<Content> {
        // Held while reading, so that scenes that run in parallel repeat no warning.
        let mut loaded = self.loaded.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(content) = &*loaded {
            return Ok(content.clone());
        }
        let path = self.path.path();
        let content = guarded("the reader of meshes", path, || self.read(path, log))?;
        *loaded = Some(content.clone());
        Ok(content)
    }

    fn read(&self, path: &Path, log: &dyn Log) -> Result<Content> {
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let file = Path::new(path.file_name().unwrap_or_default());
        let root = AssetRoot::open(folder)?;
        let model = MeshFormats::linked()?.read_upright(&root, file, self.up, log)?;
        let category = self.category.clone().unwrap_or_else(|| POOL.to_owned());
        let info = ObjectInfo { name: self.name(), category, license: String::new() };
        let (object, _) = model.into_object(info, path, log)?;
        let factor = self.units.meters() * self.scale;
        let (kg, origin) = self.mass_kg.map_or_else(|| scaled_kg(&object, factor), |kg| (kg, MassOrigin::Known));
        let digest = Hasher::new("placed mesh").digest(object.digest).number(factor).number(kg).finish();
        let object = object.transformed(Vector3::zeros(), factor)?;
        let mut object = Object { mass: object.mass.with_kg(kg, origin), digest, ..object };
        object.model.obj_id = self.obj_id;
        let stated = StatedLengths { units: Some(self.units), scale: self.scale };
        size::check(object.mesh.bounds().size().max(), stated).map_err(|error| error.in_file(path))?;
        let itself = folder.join(file);
        let companions = root.files_read().into_iter().filter(|read| *read != itself).collect();
        Ok(Content { object: Arc::new(object), companions })
    }
}

impl MeshSupport {
    /// The support on a mesh with a bounding box in the world.
    fn on(&self, bounds: &Aabb) -> Result<Support> {
        let (size, Point3 { coords: center, .. }) = (bounds.size(), bounds.center());
        let height = bounds.min.z + self.height_m.unwrap_or(size.z);
        if self.height_m.is_some_and(|height| height > size.z + 1e-6) {
            let message = format!("the support `{}` is above the mesh, which is {:.3} m high", self.name, size.z);
            return Err(Error::new(message).help("lower its `height_m`"));
        }
        let surface = Region::rectangle([center.x, center.y, height], [size.x, size.y]);
        let support = Support::new(self.name.as_str(), surface);
        Ok(match self.clear_height_m {
            Some(clear_height) => support.with_clear_height(clear_height),
            None => support,
        })
    }
}
