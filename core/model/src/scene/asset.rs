//! Assets, which sources load and pools provide.

use super::{EnvironmentMap, MassOrigin, MassProperties, Material, Mesh, SupportArea, Symmetries};
use crate::digest::{Digest, Hasher};
use crate::error::{Error, Result};
use crate::geometry::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Class of the assets of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AssetClass {
    /// Rigid objects: tables, and the objects to drop.
    Object,
    /// Surface materials.
    Material,
    /// Environment maps.
    Environment,
}

impl fmt::Display for AssetClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Object => "object",
            Self::Material => "material",
            Self::Environment => "environment",
        })
    }
}

/// A name of an asset: the pool's id in the recipe, and the name within.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AssetRef {
    /// Id of the `[assets.<pool>]` table.
    pub pool: String,
    /// Name within the pool.
    pub name: String,
}

impl fmt::Display for AssetRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.pool, self.name)
    }
}

impl<'de> Deserialize<'de> for AssetRef {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let (pool, name) = text.split_once('/').ok_or_else(|| serde::de::Error::custom("an asset is `pool/name`"))?;
        Ok(Self { pool: pool.to_owned(), name: name.to_owned() })
    }
}

impl Serialize for AssetRef {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The content of a source, found without loading it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Catalog {
    /// The entries, sorted by name, names unique.
    pub entries: Vec<CatalogEntry>,
}

/// One asset of a catalog.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct CatalogEntry {
    /// Name within the source, such as `mug_0007` or `003_cracker_box`.
    pub name: String,
    /// Category: a family or folder name; the source's kind if nothing better is known.
    pub category: String,
    /// Number of the object, from 1. A source sets it only if its files state one, as BOP's `obj_000005.ply` does; the pool
    /// numbers the others.
    pub obj_id: Option<u32>,
}

impl CatalogEntry {
    /// An asset whose files state no number.
    pub fn new(name: impl Into<String>, category: impl Into<String>) -> Self {
        Self { name: name.into(), category: category.into(), obj_id: None }
    }
}

/// A loaded asset, shared.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Asset {
    /// A rigid object.
    Object(Arc<Object>),
    /// A surface material.
    Material(Arc<Material>),
    /// An environment map: radiance from all directions.
    Environment(Arc<EnvironmentMap>),
}

impl From<Object> for Asset {
    fn from(object: Object) -> Self {
        Self::Object(Arc::new(object))
    }
}

impl From<Material> for Asset {
    fn from(material: Material) -> Self {
        Self::Material(Arc::new(material))
    }
}

impl From<EnvironmentMap> for Asset {
    fn from(map: EnvironmentMap) -> Self {
        Self::Environment(Arc::new(map))
    }
}

impl Asset {
    /// Its class.
    pub fn class(&self) -> AssetClass {
        match self {
            Self::Object(_) => AssetClass::Object,
            Self::Material(_) => AssetClass::Material,
            Self::Environment(_) => AssetClass::Environment,
        }
    }

    /// Its content digest.
    pub fn digest(&self) -> Digest {
        match self {
            Self::Object(object) => object.digest,
            Self::Material(material) => material.digest,
            Self::Environment(map) => map.digest,
        }
    }

    /// The object, or an error naming the class.
    pub fn into_object(self) -> Result<Arc<Object>> {
        match self {
            Self::Object(object) => Ok(object),
            other => Err(other.is_not(AssetClass::Object)),
        }
    }

    /// The material, or an error naming the class.
    pub fn into_material(self) -> Result<Arc<Material>> {
        match self {
            Self::Material(material) => Ok(material),
            other => Err(other.is_not(AssetClass::Material)),
        }
    }

    /// The environment map, or an error naming the class.
    pub fn into_environment(self) -> Result<Arc<EnvironmentMap>> {
        match self {
            Self::Environment(map) => Ok(map),
            other => Err(other.is_not(AssetClass::Environment)),
        }
    }

    fn is_not(&self, wanted: AssetClass) -> Error {
        Error::new(format!("class `{}` where `{wanted}` is wanted", self.class()))
    }
}

/// Points whose convex hull is one part of a collision shape, body frame, meters.
pub type ConvexPart = Vec<[f32; 3]>;

/// A named point of an object, such as the end of a handle.
#[derive(Debug, Clone, PartialEq)]
pub struct Keypoint {
    /// Name, unique in the object.
    pub name: String,
    /// Where it is, body frame, meters.
    pub point: Point3<f64>,
}

/// The model that an object was made from, as described by its catalog and its file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SourceModel {
    /// Number of the object, from 1, unique in the recipe. None outside of pools.
    pub obj_id: Option<u32>,
    /// Origin of the model's file, body frame, meters: a pool may have moved it. Its axes are the axes of the body.
    pub origin: Point3<f64>,
    /// Symmetries that the source states.
    pub symmetries: Symmetries,
    /// The object at the size of its pool, if this one has another size.
    pub resized: Option<Resized>,
}

/// The object that a larger or smaller one was made from.
#[derive(Debug, Clone)]
pub struct Resized {
    /// The object at the size of its pool.
    pub of: Arc<Object>,
    /// Ratio of the lengths.
    pub factor: f64,
}

impl PartialEq for Resized {
    fn eq(&self, other: &Self) -> bool {
        self.of.digest == other.of.digest && self.factor == other.factor
    }
}

impl SourceModel {
    /// The model of an object that is moved and scaled: `p ↦ (p + offset) · factor`.
    fn transformed(self, offset: Vector3<f64>, factor: f64) -> Self {
        Self {
            origin: ((self.origin + offset).coords * factor).into(),
            symmetries: self.symmetries.scaled(factor),
            obj_id: self.obj_id,
            // The source of a new size or origin states it for all objects of the asset.
            resized: None,
        }
    }
}

/// A rigid object: shape, surface and mass. Immutable and shared.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name within its source.
    pub name: String,
    /// Category, such as `mug`.
    pub category: String,
    /// The model that it was made from.
    pub model: SourceModel,
    /// Its shape, body frame: meters, z up.
    pub mesh: Arc<Mesh>,
    /// Materials by slot; never empty.
    pub materials: Vec<Arc<Material>>,
    /// Collision shape, where the source knows it exactly; otherwise the settler decomposes the mesh.
    pub collision: Option<Arc<Vec<ConvexPart>>>,
    /// Named points, in the order of their annotation file; empty if it has none.
    pub keypoints: Vec<Keypoint>,
    /// Level areas that carry other objects, lowest first, where the source knows them: of a bin, a shelf.
    pub support_areas: Vec<SupportArea>,
    /// Mass, center of mass and inertia.
    pub mass: MassProperties,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1, if it is known.
    pub restitution: Option<f64>,
    /// License as an SPDX expression or name; empty if unknown.
    pub license: String,
    /// Digest of everything that shapes or colors it.
    pub digest: Digest,
}

impl Object {
    /// The object moved and scaled: `p ↦ (p + offset) · factor`, with its collision shape, its keypoints, the media of
    /// its materials, and the origin and the symmetries of its model. The density stays the same, so the mass grows
    /// with the cube of the factor. The digest does not change.
    pub fn transformed(self, offset: Vector3<f64>, factor: f64) -> Result<Self> {
        if factor == 1.0 && offset == Vector3::zeros() {
            return Ok(self);
        }
        let moved = |p: &[f32; 3]| std::array::from_fn(|i| ((f64::from(p[i]) + offset[i]) * factor) as f32);
        let part = |part: &ConvexPart| part.iter().map(moved).collect();
        Ok(Self {
            mesh: Arc::new(self.mesh.transformed(offset, factor)?),
            collision: self.collision.map(|parts| Arc::new(parts.iter().map(part).collect())),
            keypoints: self
                .keypoints
                .into_iter()
                .map(|Keypoint { name, point }| Keypoint { name, point: ((point + offset).coords * factor).into() })
                .collect(),
            support_areas: self.support_areas.into_iter().map(|area| area.transformed(offset, factor)).collect(),
            materials: self.materials.into_iter().map(|material| material.enlarged(factor)).collect(),
            model: self.model.transformed(offset, factor),
            mass: self.mass.transformed(offset, factor),
            ..self
        })
    }

    /// The object at another size, with a digest of its own. It remembers the object that it was made from, so that work on
    /// shapes need not be repeated for every size.
    pub fn resized(self: &Arc<Self>, factor: f64) -> Result<Self> {
        let (of, before) = match &self.model.resized {
            Some(Resized { of, factor }) => (of, *factor),
            None => (self, 1.0),
        };
        let factor = before * factor;
        let digest = Hasher::new("resized object").digest(of.digest).number(factor).finish();
        let mut object = Self { digest, ..Self::clone(of).transformed(Vector3::zeros(), factor)? };
        object.model.resized = Some(Resized { of: Arc::clone(of), factor });
        Ok(object)
    }

    /// The object at the size of its pool, and the ratio of this object's lengths to it.
    pub fn at_own_size(&self) -> (&Self, f64) {
        self.model.resized.as_ref().map_or((self, 1.0), |Resized { of, factor }| (of, *factor))
    }

    /// The object with a known mass, kg. The distribution of the mass stays.
    pub fn with_known_mass(self, kg: f64) -> Self {
        let digest = Hasher::new("known mass").digest(self.digest).number(kg).finish();
        Self { mass: self.mass.with_kg(kg, MassOrigin::Known), digest, ..self }
    }

    /// The object with named points.
    pub fn with_keypoints(self, keypoints: Vec<Keypoint>) -> Self {
        if keypoints.is_empty() {
            return Self { keypoints, ..self };
        }
        let add = |hasher: Hasher, Keypoint { name, point }: &Keypoint| {
            point.iter().fold(hasher.text(name), |hasher, x| hasher.number(*x))
        };
        let digest = keypoints.iter().fold(Hasher::new("keypoints").digest(self.digest), add).finish();
        Self { keypoints, digest, ..self }
    }
}
