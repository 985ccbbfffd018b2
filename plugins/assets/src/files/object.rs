//! From a model as read to an object that can be placed: cleaned, weighed and with a digest.

use crate::files::formats::Model;
use crate::files::hygiene::clean;
use crate::files::mesh_digest::mesh_digest;
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::Log;
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Object, Topology};

/// Density of a thing of the household, kg/m³, over the volume that its surface encloses: between a full carton of
/// juice (1000) and an empty box (50), as most things are hollow in part.
pub const DENSITY_KG_M3: f64 = 400.0;
/// Least and greatest mass that is believed, kg.
pub const MASS_KG: std::ops::RangeInclusive<f64> = 0.005..=20.0;
/// Coulomb friction between dry household materials.
pub const FRICTION: f64 = 0.5;

/// What a source knows of an object besides its file.
#[derive(Debug, Clone, Default)]
pub struct Identity {
    /// Name within the source.
    pub name: String,
    /// What sort of thing it is.
    pub category: String,
    /// Licence as an SPDX expression or name; empty if unknown.
    pub licence: String,
}

/// Cleans a model and makes it an object, in the unit of the model, which should be the metre. The file is named in
/// errors and warnings. The extent is not checked here: a pool may scale the object first.
pub fn finish(model: Model, identity: Identity, file: &Path, log: &dyn Log) -> Result<(Object, Topology)> {
    let named = InFile { file, log };
    let Model { mesh, materials } = model;
    if let Some(slot) = mesh.slots.iter().find(|&&slot| usize::from(slot) >= materials.len()) {
        return Err(Error::new(format!("material slot {slot} of {}", materials.len())).in_file(file));
    }
    let (mesh, topology) = clean(mesh, &named).map_err(|error| error.in_file(file))?;
    let mass_kg = default_mass(topology.solid_volume());
    let mut hasher = Hasher::new("object").digest(mesh_digest(&mesh)).number(mass_kg).number(FRICTION);
    for material in &materials {
        hasher = hasher.digest(material.digest);
    }
    let object = Object {
        name: identity.name,
        category: identity.category,
        mesh: Arc::new(mesh),
        materials: materials
            .into_iter()
            .map(|material| Arc::new(syntable_model::scene::Material { licence: identity.licence.clone(), ..material }))
            .collect(),
        collision: None,
        mass_kg,
        friction: FRICTION,
        licence: identity.licence,
        digest: hasher.finish(),
    };
    Ok((object, topology))
}

/// Mass of a thing of a volume in m³, if nothing better is known: [`DENSITY_KG_M3`] within [`MASS_KG`].
pub fn default_mass(volume_m3: f64) -> f64 {
    let mass = volume_m3 * DENSITY_KG_M3;
    if mass.is_nan() { *MASS_KG.start() } else { mass.clamp(*MASS_KG.start(), *MASS_KG.end()) }
}

/// A log that names a file in warnings that name none.
struct InFile<'a> {
    file: &'a Path,
    log: &'a dyn Log,
}

impl Log for InFile<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().in_file(self.file));
    }
}
