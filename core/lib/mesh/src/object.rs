//! Converts a model to an object that placers can use: repaired, weighed, with a digest.

use crate::mass::estimate_kg;
use crate::repair::repair;
use crate::text::shorten;
use crate::{Model, mesh_digest};
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::Log;
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Alpha, MassOrigin, MassProperties, Material, Object, SourceModel, Topology};

/// Coulomb friction coefficient between dry household materials.
pub const FRICTION: f64 = 0.5;

/// Information on an object that its file does not contain.
#[derive(Debug, Clone, Default)]
pub struct ObjectInfo {
    /// Name within the source.
    pub name: String,
    /// Category, such as `mug`.
    pub category: String,
    /// License as an SPDX expression or name; empty if unknown. A pool's `license` replaces it.
    pub license: String,
}

impl Model {
    /// Repairs the mesh and makes the object, in the unit of the model, which should be the meter. Errors and warnings
    /// name `file`. The extent is not checked here, because a pool may scale the object first.
    pub fn into_object(self, info: ObjectInfo, file: &Path, log: &dyn Log) -> Result<(Object, Topology)> {
        let log = ObjectLog { file, log };
        let Self { mesh, materials } = self;
        if materials.is_empty() {
            return Err(Error::new("the model has no material").in_file(file));
        }
        if let Some(slot) = mesh.slots.iter().find(|&&slot| usize::from(slot) >= materials.len()) {
            return Err(Error::new(format!("material slot {slot} of {}", materials.len())).in_file(file));
        }
        for material in &materials {
            if let Alpha::Blend { factor } = material.alpha
                && factor < 0.5
            {
                let (name, percent) = (shorten(&material.name), (factor * 100.0).round());
                let message =
                    format!("`{name}` covers {percent} % of the background behind it, but labels treat it as opaque");
                log.warn(
                    &Error::new(message).help("the renderer's `blended_labels = \"coverage\"` omits it from labels"),
                );
            }
        }
        let (mesh, topology) = repair(mesh, &log).map_err(|error| error.in_file(file))?;
        let mass_kg = estimate_kg(topology.solid_volume());
        let mass = MassProperties::of_topology(&mesh, &topology, mass_kg, MassOrigin::Estimated);
        let mut hasher = Hasher::new("object").digest(mesh_digest(&mesh)).number(mass_kg).number(FRICTION);
        for material in &materials {
            hasher = hasher.digest(material.digest);
        }
        let object = Object {
            name: info.name,
            category: info.category,
            mesh: Arc::new(mesh),
            materials: materials
                .into_iter()
                .map(|material| Arc::new(Material { license: info.license.clone(), ..material }))
                .collect(),
            collision: None,
            keypoints: Vec::new(),
            support_areas: Vec::new(),
            restitution: None,
            model: SourceModel::default(),
            mass,
            friction: FRICTION,
            license: info.license,
            digest: hasher.finish(),
        };
        Ok((object, topology))
    }
}

/// A log that adds a file to warnings without one.
struct ObjectLog<'a> {
    file: &'a Path,
    log: &'a dyn Log,
}

impl Log for ObjectLog<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().in_file(self.file));
    }
}
