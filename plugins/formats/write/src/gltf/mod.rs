//! Scenes as glTF 2.0, for Blender and other programs.
//!
//! | module | writes |
//! | --- | --- |
//! | [`geometry`], [`arrays`] | meshes, each once |
//! | [`material`], [`texture`] | materials, with their textures packed into glTF's channels |
//! | [`recolor`] | vertex colors of bodies with changed colors |
//! | `light`, [`environment`], [`camera`] | lights, environment maps, cameras |
//! | [`document`], [`glb`] | JSON and container |
//!
//! **Frames.** glTF is y up, the dataset z up. The root node rotates between them, so its children have the coordinates
//! of the world and of the body frames.

mod arrays;
mod camera;
mod document;
mod environment;
mod geometry;
mod glb;
mod light;
mod material;
mod recolor;
mod texture;
mod vertices;

pub use light::LightMode;

use document::{GltfAsset, GltfMesh, GltfNode, GltfPrimitive, GltfSceneEntry, Index};
use geometry::{Geometries, Needs, UvSource};
use glb::Glb;
use light::GltfLights;
use material::GltfMaterials;
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::encode::{scene_name, view_name};
use syntable_formats::include::write_file;
use syntable_model::digest::Digest;
use syntable_model::prelude::*;
use syntable_model::scene::Body;

/// Writes settled scenes as binary glTF 2.0, for Blender and other programs.
///
/// # Behavior
///
/// A file has all bodies with their materials and textures (clearcoat, sheen, transmission, volume, index of
/// refraction, emissive strength, texture transforms), the cameras and the lights. Units are meters, nits, lux and
/// candela. glTF is y up: the root node `world` rotates the scene; its children have the coordinates of the dataset, z
/// up. Bodies that share a mesh share it in the file; an object of another size has a mesh of its own. Colors that a placer
/// changed are baked: into the factor or the image of the base color, or into the vertex colors. Where a face has both vertex
/// colors and a texture, the texture is changed, and the vertex colors stay. `extras` hold what glTF cannot express: instance ids,
/// the size and the change of color of objects, camera matrices, distortion, lens and exposure.
///
/// # Output
///
/// `{id}/{scene:06}.glb`, or `{id}/{scene:06}_{view:04}.glb` per view. An environment map is a Radiance HDR file in the
/// same folder, in nits, whose name ends in `_environment.hdr` instead of `.glb`. `{id}/import_in_blender.py` imports a
/// file into Blender with the right units of light, the sky and the size of the sun.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Gltf {
    /// Representation of lights. Environment maps are written in any case.
    pub lights: LightMode,
    /// Scope of a file.
    pub per: GltfFilePer,
}

/// Scope of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GltfFilePer {
    /// One scene with the cameras of all its views and the lights of the first.
    Scene,
    /// One view with its camera and lights.
    View,
}

impl Default for Gltf {
    fn default() -> Self {
        Self { lights: LightMode::Emissive, per: GltfFilePer::Scene }
    }
}

/// Script that imports a file into Blender with the light units, the sky and the suns of the dataset.
const IMPORT_IN_BLENDER: &[u8] = include_bytes!("import_in_blender.py");

fn script_path(id: &str) -> String {
    format!("{id}/import_in_blender.py")
}

fn glb_path(id: &str, stem: &str) -> String {
    format!("{id}/{stem}.glb")
}

config!(Gltf => dyn Writer<Scenes>, "gltf", "lights = \"emissive\"\nper = \"scene\"");

impl Writer<Scenes> for Gltf {
    fn reads(&self) -> Vec<Input> {
        Vec::new()
    }

    fn scene(&self, cx: &SceneContext, output: Output) -> Result<Box<dyn SceneWriter<Scenes>>> {
        Ok(Box::new(GltfScene { config: self.clone(), output, export: Export::new(cx)?, id: cx.scene_id, views: 0 }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(match (of.scene, of.view, self.per) {
            (None, None, _) => vec![script_path(of.id)],
            (Some(scene), None, GltfFilePer::Scene) => vec![glb_path(of.id, &scene_name(scene))],
            (Some(scene), Some(view), GltfFilePer::View) => vec![glb_path(of.id, &view_name(scene, view))],
            _ => Vec::new(),
        })
    }

    fn finish(&self, _: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        write_file(finish, &script_path(finish.id()), IMPORT_IN_BLENDER)
    }
}

struct GltfScene {
    config: Gltf,
    output: Output,
    export: Export,
    id: syntable_model::scene::SceneId,
    views: usize,
}

impl SceneWriter<Scenes> for GltfScene {
    fn view(&mut self, cx: &ViewContext, _: &Products) -> Result<()> {
        let view = cx.view;
        match self.config.per {
            GltfFilePer::Scene => {
                if self.views == 0 {
                    let stem = scene_name(self.id);
                    light(&mut self.export, view, self.config.lights, &self.output, &stem)?;
                }
                self.export.camera(view);
            }
            GltfFilePer::View => {
                let mut export = self.export.clone();
                let stem = view_name(cx.scene_id, view.id);
                light(&mut export, view, self.config.lights, &self.output, &stem)?;
                export.camera(view);
                let path = glb_path(self.output.id(), &stem);
                self.output.write(&path, &export.into_bytes()?)?;
            }
        }
        self.views += 1;
        Ok(())
    }

    fn close(self: Box<Self>, _: &SceneContext, _: &Products) -> Result<()> {
        match self.config.per {
            GltfFilePer::View => Ok(()),
            GltfFilePer::Scene => {
                let path = glb_path(self.output.id(), &scene_name(self.id));
                self.output.write(&path, &self.export.into_bytes()?)
            }
        }
    }
}

/// Adds the lights of a view, and writes its environment maps next to the file.
fn light(export: &mut Export, view: &View, mode: LightMode, output: &Output, stem: &str) -> Result<()> {
    let (notes, maps) = environment::export(&view.lights, stem);
    for (name, bytes) in maps {
        output.write(&format!("{}/{name}", output.id()), &bytes)?;
    }
    export.lights(&view.lights, notes, mode);
    Ok(())
}

/// A file under construction.
#[derive(Debug, Clone, Default)]
struct Export {
    glb: Glb,
    geometries: Geometries,
    materials: GltfMaterials,
    /// Meshes by geometry and materials.
    meshes: BTreeMap<(Digest, Vec<Index>), Index>,
}

/// Maps (x, y, z) to (x, z, -y), column by column.
const Y_UP_FROM_Z_UP: [f64; 16] = [1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.];

impl Export {
    /// The bodies of a scene.
    fn new(cx: &SceneContext) -> Result<Self> {
        let mut export = Self::default();
        let licenses: BTreeSet<&str> = cx
            .scene
            .bodies()
            .iter()
            .flat_map(|body| {
                let replaced = body.material_override.as_ref().map(|replaced| replaced.material.license.as_str());
                [Some(body.object.license.as_str()), replaced]
            })
            .flatten()
            .filter(|license| !license.is_empty())
            .collect();
        let document = &mut export.glb.document;
        document.asset = GltfAsset {
            version: "2.0",
            generator: cx.dataset.program.clone(),
            copyright: licenses.into_iter().collect::<Vec<_>>().join(", "),
        };
        document.nodes.push(GltfNode { name: "world".into(), matrix: Some(Y_UP_FROM_Z_UP), ..GltfNode::default() });
        document.scenes.push(GltfSceneEntry {
            name: format!("{} {:06}", cx.dataset.name, cx.scene_id.0),
            nodes: vec![0],
            extras: json!({ "dataset": cx.dataset.name, "seed": cx.dataset.seed, "scene": cx.scene_id.0 }),
        });
        for body in cx.scene.bodies() {
            export.body(body).map_err(|error| error.context(format!("body {} ({})", body.id, body.asset)))?;
        }
        Ok(export)
    }

    fn body(&mut self, body: &Body) -> Result<()> {
        let object = &body.object;
        let used = body.materials();
        let mapping = match &body.material_override {
            Some(surface) => UvSource::Override { mapping: surface.mapping, tile_m: surface.material.tile_m },
            None => UvSource::Mesh,
        };
        let needs = Needs {
            uvs: used.iter().any(|material| material.textures().next().is_some()),
            tangents: used.iter().any(|material| material::has_normal_map(material)),
        };
        let mesh = recolor::vertex_colored(&object.mesh, &used)?;
        let geometry = self.geometries.get(&mut self.glb, &mesh, mapping, needs);
        let mut materials = Vec::new();
        for &(slot, _) in &geometry.parts {
            let material = used.get(slot).or(used.last()).ok_or_else(|| Error::new("an object without materials"))?;
            materials.push(self.materials.get(&mut self.glb, material)?);
        }
        let meshes = &mut self.glb.document.meshes;
        let mesh =
            *self.meshes.entry((geometry.digest, materials.clone())).or_insert_with(|| {
                let primitives = geometry.parts.iter().zip(&materials).map(|(&(_, indices), &material)| {
                    GltfPrimitive { attributes: geometry.attributes.clone(), indices, material }
                });
                meshes.push(GltfMesh { name: body.asset.to_string(), primitives: primitives.collect() });
                meshes.len() - 1
            });
        let mut extras = json!({
            "instance_id": body.id, "asset": body.asset, "category": object.category, "role": body.role,
        });
        if !object.license.is_empty() {
            extras["license"] = object.license.as_str().into();
        }
        if let Some(resized) = &object.model.resized {
            extras["scale"] = resized.factor.into();
        }
        if let Some(recolor) = &body.recolor {
            extras["recolor"] = json!(recolor);
        }
        if let Some(finish) = &body.finish {
            extras["finish"] = json!(finish);
        }
        let name = format!("{} {}", body.id, body.asset);
        self.child(GltfNode { mesh: Some(mesh), extras, ..GltfNode::at(name, &body.world_from_body) });
        Ok(())
    }

    fn camera(&mut self, view: &View) {
        let node = camera::add(&mut self.glb, view);
        self.child(node);
    }

    fn lights(&mut self, lights: &[syntable_model::scene::Light], environments: Vec<Json>, mode: LightMode) {
        if !environments.is_empty() {
            self.glb.document.scenes[0].extras["environments"] = Json::from(environments);
        }
        if mode == LightMode::None {
            return;
        }
        let mut written = GltfLights::default();
        for (number, light) in lights.iter().enumerate() {
            if let Some(node) = written.add(&mut self.glb, number, light, mode) {
                self.child(node);
            }
        }
    }

    /// Adds a node below the root.
    fn child(&mut self, node: GltfNode) {
        let nodes = &mut self.glb.document.nodes;
        nodes.push(node);
        let index = nodes.len() - 1;
        nodes[0].children.push(index);
    }

    fn into_bytes(self) -> Result<Vec<u8>> {
        self.glb.into_bytes()
    }
}

register!(Gltf);
