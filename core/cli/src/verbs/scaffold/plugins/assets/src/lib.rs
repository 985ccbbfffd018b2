//! Source of assets `plain_cubes`: plain cubes, made in memory.

use std::path::Path;
use syntable_mesh::material::default_material;
use syntable_mesh::{Model, ObjectInfo};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, CatalogEntry, MeshData};

/// Cubes of several sizes.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlainCubes {
    /// Edge of each cube, meters.
    #[schemars(inner(range(min = 0.001, max = 10.0)))]
    edges_m: Vec<f32>,
}

impl Default for PlainCubes {
    fn default() -> Self {
        Self { edges_m: vec![0.05, 0.08] }
    }
}

impl Config for PlainCubes {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "plain_cubes";
    const EXAMPLE: &'static str = "edges_m = [0.05, 0.08]";
    fn build(self) -> Result<Box<dyn AssetSource>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl AssetSource for PlainCubes {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let entry = |i| CatalogEntry::new(format!("cube_{i}"), "cube");
        Ok(Catalog { entries: (0..self.edges_m.len()).map(entry).collect() })
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let edge = name.strip_prefix("cube_").and_then(|i| self.edges_m.get(i.parse::<usize>().ok()?));
        let edge = *edge.ok_or_else(|| Error::new(format!("no cube `{name}`")))?;
        // The bits of i select the side of the cube for corner i. Each face has two triangles, counterclockwise seen
        // from outside.
        let side = |i: u32, axis: u32| if i >> axis & 1 == 1 { edge / 2.0 } else { -edge / 2.0 };
        let positions = (0..8).map(|i| [side(i, 0), side(i, 1), side(i, 2)]).collect();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mesh = MeshData { positions, triangles, ..MeshData::default() };
        let info = ObjectInfo { name: name.to_owned(), category: "cube".into(), license: "CC0-1.0".into() };
        // Repairs the mesh, and estimates mass and friction.
        let model = Model { mesh, materials: vec![default_material(false)] };
        let (object, _) = model.into_object(info, Path::new(name), log)?;
        Ok(Asset::from(object))
    }
}
register!(PlainCubes);
