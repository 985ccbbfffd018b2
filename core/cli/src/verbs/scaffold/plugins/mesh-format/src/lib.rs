//! Mesh format `off_mesh`: OFF (Object File Format), triangles only.

use std::path::Path;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::material::default_material;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::{Model, register_mesh_format};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

fn read(root: &AssetRoot, file: &Path, _: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let bytes = root.read(&path)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut words = text.split_ascii_whitespace();
    if words.next() != Some("OFF") {
        return Err(Error::new("the file does not start with OFF").in_file(&path));
    }
    let mut number = || {
        let word = words.next().ok_or_else(|| Error::new("the file ends early").in_file(&path))?;
        word.parse::<f32>().map_err(|_| Error::new(format!("`{word}` is not a number")).in_file(&path))
    };
    let [vertices, faces, _edges] = [number()?, number()?, number()?];
    let mut mesh = MeshData::default();
    for _ in 0..vertices as usize {
        mesh.positions.push([number()?, number()?, number()?]);
    }
    for _ in 0..faces as usize {
        let [corners, a, b, c] = [number()?, number()?, number()?, number()?];
        if corners != 3.0 {
            return Err(Error::new(format!("a face has {corners} corners, not 3")).in_file(&path));
        }
        mesh.triangles.push([a, b, c].map(|index| index as u32));
    }
    Ok(Model { mesh, materials: vec![default_material(false)] })
}

register_mesh_format!(MeshFormat::new("OFF", &["off"], read));
