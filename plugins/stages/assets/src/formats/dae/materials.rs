//! Materials: the common profile's diffuse color or image, emission and opacity.

use crate::formats::xml::{ById, array, attribute, only, target};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::material::{blend, default_material, untextured};
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Encoding, Material, Texture, TextureRef, UvTransform, Wrap};

/// Roughness of surfaces, which the format does not state.
const ROUGHNESS: f32 = 0.5;

/// Materials by slot, in the order in which geometries name them.
pub struct DaeMaterials<'a> {
    root: &'a AssetRoot,
    folder: &'a Path,
    log: &'a dyn Log,
    /// Reference of each slot, and whether its faces have texture coordinates.
    slots: Vec<(Option<&'a str>, bool)>,
    textures: BTreeMap<String, Option<Arc<Texture>>>,
}

impl<'a> DaeMaterials<'a> {
    /// No materials yet; `folder` holds the file, relative to the root.
    pub fn new(root: &'a AssetRoot, folder: &'a Path, log: &'a dyn Log) -> Self {
        Self { root, folder, log, slots: Vec::new(), textures: BTreeMap::new() }
    }

    /// The slot of a material for faces with or without texture coordinates.
    pub fn slot(&mut self, reference: Option<&'a str>, textured: bool) -> Result<u16> {
        let known = self.slots.iter().position(|slot| *slot == (reference, textured));
        let slot = known.unwrap_or_else(|| {
            self.slots.push((reference, textured));
            self.slots.len() - 1
        });
        u16::try_from(slot).map_err(|_| Error::new("more than 65536 materials"))
    }

    /// Builds the materials of all slots.
    pub fn into_slots<'d>(mut self, ids: &ById<'a, 'd>) -> Result<Vec<Material>> {
        let slots = std::mem::take(&mut self.slots);
        let mut built = Vec::new();
        for (reference, textured) in slots {
            let material = match reference.and_then(|reference| target(ids, "material", reference)) {
                Some(material) => self.build(material, ids)?,
                None => default_material(false),
            };
            built.push(match untextured(&material) {
                Some(plain) if !textured => plain,
                _ => material,
            });
        }
        Ok(built)
    }

    fn build<'d>(&mut self, material: Node<'a, 'd>, ids: &ById<'a, 'd>) -> Result<Material> {
        let name = attribute(material, "name").or(attribute(material, "id")).unwrap_or("material");
        let effect =
            only(material, "instance_effect").and_then(|instance| target(ids, "effect", attribute(instance, "url")?));
        let profile = effect.and_then(|effect| only(effect, "profile_COMMON"));
        let technique = profile.and_then(|profile| only(profile, "technique"));
        let shading =
            technique.and_then(|it| ["phong", "lambert", "blinn", "constant"].iter().find_map(|kind| only(it, kind)));
        let (Some(effect), Some(shading)) = (effect, shading) else {
            return Ok(default_material(false));
        };
        let mut built = Material::plain(name, [0.6; 3], ROUGHNESS);
        if let Some(diffuse) = only(shading, "diffuse") {
            if let Some(color) = color(diffuse)? {
                built.base_color.factor = [color[0], color[1], color[2]].map(unit);
            } else if let Some(texture) = self.texture(diffuse, effect, ids)? {
                built.base_color.factor = [1.0; 3];
                built.base_color.texture = Some(texture);
            }
        }
        if let Some(emission) = only(shading, "emission").map(color).transpose()?.flatten() {
            built.emission.factor = [emission[0], emission[1], emission[2]].map(|x| x.max(0.0));
        }
        let opacity = opacity(shading)?;
        if opacity < 1.0 {
            if opacity > 0.0 {
                blend(&mut built, opacity);
            } else {
                let what = format!("material `{}` would be invisible; it is treated as opaque", shorten(name));
                self.log.warn(&Error::new(what));
            }
        }
        Ok(built.with_digest())
    }

    /// The image that an element names by its sampler, or by the id of an image.
    fn texture<'d>(
        &mut self,
        of: Node<'a, 'd>,
        effect: Node<'a, 'd>,
        ids: &ById<'a, 'd>,
    ) -> Result<Option<TextureRef>> {
        let Some(name) = only(of, "texture").and_then(|texture| attribute(texture, "texture")) else { return Ok(None) };
        let parameter = |name: &str| {
            effect
                .descendants()
                .find(|node| node.tag_name().name() == "newparam" && attribute(*node, "sid") == Some(name))
        };
        // COLLADA 1.4 has a surface between sampler and image; 1.5 has none.
        let text = |of: Node<'a, 'd>, name: &'static str| {
            of.descendants().find(|node| node.tag_name().name() == name).and_then(|node| node.text())
        };
        let mut image = name;
        for _ in 0..2 {
            let Some(found) = parameter(image) else { break };
            let next = text(found, "source").or_else(|| text(found, "init_from")).or_else(|| {
                found
                    .descendants()
                    .find(|node| node.tag_name().name() == "instance_image")
                    .and_then(|it| attribute(it, "url"))
            });
            let Some(next) = next else { break };
            image = next.trim();
        }
        let file = target(ids, "image", image).and_then(|image| {
            let from = only(image, "init_from")?;
            only(from, "ref").unwrap_or(from).text().map(str::trim)
        });
        let Some(file) = file.filter(|file| !file.is_empty()) else {
            self.log.warn(&Error::new(format!("texture `{}` names no image; using a constant color", shorten(name))));
            return Ok(None);
        };
        if !self.textures.contains_key(file) {
            let texture = self.load(file)?;
            self.textures.insert(file.to_owned(), texture);
        }
        let texture = self.textures.get(file).cloned().flatten();
        Ok(texture.map(|texture| TextureRef { texture, transform: UvTransform::default() }))
    }

    fn load(&self, file: &str) -> Result<Option<Arc<Texture>>> {
        let plain = file.strip_prefix("file://").unwrap_or(file);
        let plain = plain.replace("%20", " ");
        let Some(found) = self.root.find(self.folder, &plain)? else {
            let what = format!("texture `{}` is missing; using a constant color", shorten(file));
            self.log.warn(&Error::new(what));
            return Ok(None);
        };
        let path = found.noted(|note| self.log.warn(&note));
        let image = DecodedImage::read_if_known(self.root, &path, |error| self.log.warn(&error))?;
        Ok(image.map(|image| Arc::new(image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]))))
    }
}

/// The constant color of an element.
fn color(of: Node) -> Result<Option<[f32; 4]>> {
    only(of, "color").map(|color| array::<4>(color).map(|color| color.map(|x| x as f32))).transpose()
}

/// The opacity of a shading model: of the color `transparent` in its mode, times `transparency`.
fn opacity(shading: Node) -> Result<f32> {
    let amount = only(shading, "transparency").and_then(|it| only(it, "float")).and_then(|it| it.text());
    let amount = amount.and_then(|text| text.trim().parse::<f32>().ok());
    let Some(transparent) = only(shading, "transparent") else {
        // Without a color, exporters state the opacity; some write 0 for none.
        return Ok(amount.filter(|amount| *amount > 0.0).map_or(1.0, unit));
    };
    let Some(color) = color(transparent)? else { return Ok(1.0) };
    let amount = amount.unwrap_or(1.0);
    let mean = (color[0] + color[1] + color[2]) / 3.0;
    Ok(unit(match attribute(transparent, "opaque") {
        Some("RGB_ZERO") => 1.0 - mean * amount,
        Some("RGB_ONE") => mean * amount,
        Some("A_ZERO") => 1.0 - color[3] * amount,
        _ => color[3] * amount,
    }))
}

fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
