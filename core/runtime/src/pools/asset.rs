//! One asset of a pool: the asset of the source, with the options of the pool applied.

use super::open_pool::OpenPool;
use std::sync::Arc;
use syntable_mesh::mass::scaled_kg;
use syntable_mesh::size::{self, StatedLengths};
use syntable_model::context::Log;
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::{Asset, CatalogEntry, MassOrigin, Material, Object, Topology};
use syntable_recipe::{CatalogAsset, CatalogNames, Center, Mass};

/// Minimum mass of an object, kg.
const MIN_KG: f64 = 1e-4;

impl OpenPool<'_> {
    /// Loads an entry, and applies the pool's options.
    pub(super) fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        Ok(match (self.source.load(name, log)?, &self.options.license) {
            (Asset::Object(object), _) => {
                let mut object = Arc::unwrap_or_clone(object);
                if let Some(CatalogEntry { category, obj_id, .. }) = self.entry(name) {
                    object.category.clone_from(category);
                    object.model.obj_id = *obj_id;
                }
                self.normalize(object)?.into()
            }
            (Asset::Material(material), Some(license)) => {
                Material { license: license.clone(), ..Arc::unwrap_or_clone(material) }.into()
            }
            (Asset::Environment(map), Some(license)) => {
                let mut map = Arc::unwrap_or_clone(map);
                map.license.clone_from(license);
                map.into()
            }
            (other, _) => other,
        })
    }

    /// The entry of a name. Entries are sorted.
    pub(super) fn entry(&self, name: &str) -> Option<&CatalogEntry> {
        let entries = &self.selection.entries;
        let found = entries.binary_search_by(|entry| entry.name.as_str().cmp(name));
        found.ok().map(|index| &entries[index])
    }

    /// The entries by name.
    pub(super) fn catalog(&self) -> CatalogNames {
        let asset = |CatalogEntry { category, obj_id, .. }: &CatalogEntry| CatalogAsset {
            category: category.clone(),
            obj_id: *obj_id,
        };
        self.selection.entries.iter().map(|entry| (entry.name.clone(), asset(entry))).collect()
    }

    /// Warns of an object of unlikely size if neither the source nor the pool states the unit or the size.
    pub(super) fn doubt_size(&self, asset: &Asset, log: &dyn Log) {
        let stated = self.source.states_units() || self.options.units.is_some() || self.options.scale.is_size();
        if let (Asset::Object(object), false) = (asset, stated)
            && let Some(doubt) = size::doubt(object.mesh.bounds().size().max())
        {
            log.warn(&doubt);
        }
    }

    /// Applies the pool's scale, center, mass and license to an object as the source read it, and checks its size.
    pub(super) fn normalize(&self, object: Object) -> Result<Object> {
        let options = self.options;
        if options.single_part_only {
            let parts = Topology::of(&object.mesh).significant_parts();
            if parts > 1 {
                return Err(Error::new(format!("it consists of {parts} separate parts"))
                    .help("single_part_only = false accepts it as one rigid body"));
            }
        }
        let bounds = object.mesh.bounds();
        let longest = bounds.size().max();
        let scale = options.factor(longest);
        let center = bounds.center();
        let offset = match options.center {
            Center::Bounds => -center.coords,
            Center::Bottom => -Point3::new(center.x, center.y, bounds.min.z).coords,
            Center::None => Vector3::zeros(),
        };
        let properties = |name: &str| self.properties.get(name).copied().unwrap_or_default();
        let own = properties(&object.name).or(properties(&object.category));
        let volume = || Topology::of(&object.mesh).solid_volume() * scale.powi(3);
        let stated = match options.mass {
            _ if own.mass_kg.is_some() => own.mass_kg,
            _ if own.density_kg_m3.is_some() => own.density_kg_m3.map(|density| density * volume()),
            Some(Mass::Kg(mass)) => Some(mass),
            Some(Mass::DensityKgM3(density)) => Some(density * volume()),
            None => None,
        };
        let mass = match stated {
            Some(kg) => (kg.max(MIN_KG), MassOrigin::Known),
            None => scaled_kg(&object, scale),
        };
        let friction = own.friction.unwrap_or(object.friction);
        let hasher = Hasher::new("pooled object")
            .digest(object.digest)
            .number(scale)
            .number(offset.x)
            .number(offset.y)
            .number(offset.z)
            .number(mass.0)
            .number(friction);
        let restitution = own.restitution.or(object.restitution);
        let digest = match restitution {
            Some(restitution) => hasher.number(restitution),
            None => hasher,
        }
        .finish();
        let license = options.license.clone().unwrap_or_else(|| object.license.clone());
        let object = object.transformed(offset, scale)?;
        let mass = object.mass.with_kg(mass.0, mass.1);
        let object = Object { mass, friction, restitution, digest, license, ..object };
        let stated = StatedLengths { units: options.units, scale: options.scale.factor(longest) };
        size::check(object.mesh.bounds().size().max(), stated)?;
        Ok(object)
    }
}
