//! Materials by slot from the material libraries of an OBJ.

use super::{MaterialUse, ParsedObj};
use crate::formats::FormatLog;
use crate::formats::mtl::{self, MtlMap, MtlMaterial};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_mesh::Model;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::material::{blend, default_material, mean, untextured};
use syntable_mesh::paint::{VertexAlpha, blend_by_vertex, full_intensity, hide_colors_under_textures};
use syntable_mesh::root::{AssetRoot, ResolvedName};
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{
    Alpha, Color, Encoding, Material, NormalMap, Scalar, Texture, TextureRef, UvTransform, Wrap,
};

/// Folder of the textures of Google Scanned Objects, relative to the OBJ.
const GSO_TEXTURES: &str = "../materials/textures";
/// Images of a scanned object without a material library, relative to the OBJ: in a repackaged scan, and as downloaded.
const SCAN_TEXTURES: [&str; 4] =
    ["texture.png", "texture.jpg", "../materials/textures/texture.png", "materials/textures/texture.png"];
/// Roughness of a material that states none.
const DEFAULT_ROUGHNESS: f32 = 0.5;

/// Finds the libraries and images of a parsed file and builds its materials.
pub(super) fn attach(parsed: ParsedObj, root: &AssetRoot, folder: &Path, file: &Path, log: &dyn Log) -> Result<Model> {
    let ParsedObj { mesh, colored: has_color, alphas, libraries, uses, .. } = parsed;
    let (images, textures, black, unread) = Default::default();
    let mut loader = MtlLoader { root, folder: folder.to_owned(), file, log, images, textures, black, unread };
    // Whether faces of a slot have vertex colors.
    let mut painted = vec![false; uses.len()];
    if !has_color.is_empty() {
        for (triangle, &slot) in mesh.triangles.iter().zip(&mesh.slots) {
            painted[usize::from(slot)] |= triangle.iter().any(|&vertex| has_color[vertex as usize]);
        }
    }
    let colored = !mesh.colors.is_empty();
    let known = loader.libraries(&libraries, colored)?;
    let missing = known.is_none();
    let known = known.unwrap_or_default();
    // The materials that the library lacks, by the line of their first use, and how many.
    let mut unknown: Option<(&MaterialUse, usize)> = None;
    let mut materials = Vec::with_capacity(uses.len());
    let mut scanned = None;
    for (used, &painted) in uses.iter().zip(&painted) {
        let stated = match known.get(&used.name) {
            // Files with one material often omit `usemtl`.
            None if used.name.is_empty() && !libraries.is_empty() && !missing => {
                let only = known.values().next().filter(|_| known.len() == 1);
                // Vertex colors need no material.
                if only.is_some() || !painted {
                    loader.without_usemtl(used, only.map(|(_, material)| material));
                }
                only
            }
            stated => stated,
        };
        let mut material = match stated {
            Some((library, material)) => loader.material(material, library, painted)?,
            None => {
                if !missing && !used.name.is_empty() {
                    unknown.get_or_insert((used, 0)).1 += 1;
                }
                // A mesh without a library, or with a missing one, may be a scan with an image next to it.
                if (missing || libraries.is_empty()) && used.textured && !colored {
                    if scanned.is_none() {
                        scanned = Some(loader.scanned_material()?);
                    }
                    scanned.clone().flatten().unwrap_or_else(|| default_material(false))
                } else {
                    default_material(colored)
                }
            }
        };
        if painted && !used.textured && material.base_color.texture.take().is_some() {
            material.base_color.factor = [1.0; 3];
            material = material.with_digest();
        }
        materials.push(if used.textured { material } else { loader.without_textures(material, used) });
    }
    loader.tell_unread();
    // Without any library, a scan's own image is its material.
    let explained = libraries.is_empty() && scanned.flatten().is_some();
    if let Some((first, count)) = unknown.filter(|_| !explained) {
        let others = if count > 1 { format!(" and {} others", count - 1) } else { String::new() };
        let message =
            format!("the library has no material `{}`{others}; using the default material", shorten(&first.name));
        log.warn(&Error::new(message).in_file(file).at_line(first.line));
    }
    let mut model = Model { mesh, materials };
    let log = FormatLog { log, path: file };
    let has_texture = |&slot: &u16| model.materials[usize::from(slot)].base_color.texture.is_some();
    let textured: Vec<bool> = model.mesh.slots.iter().map(has_texture).collect();
    let alphas = hide_colors_under_textures(&mut model.mesh, alphas, &[], &textured, &log);
    blend_by_vertex(&mut model, &alphas, |_| VertexAlpha::Blends, &log);
    Ok(model)
}

struct MtlLoader<'a> {
    root: &'a AssetRoot,
    folder: PathBuf,
    file: &'a Path,
    log: &'a dyn Log,
    /// Files by name as written, after a look-up.
    images: BTreeMap<String, Option<PathBuf>>,
    /// Textures by file and use; none for a file of an unknown format.
    textures: BTreeMap<(PathBuf, bool, bool), Option<Arc<Texture>>>,
    /// Lines of the first black `Kd` with a texture, or with vertex colors, and the numbers of such lines.
    black: [Option<(PathBuf, usize, usize)>; 2],
    /// Unsupported statements of a library, by key: the first, its line, and their number.
    unread: BTreeMap<(PathBuf, String), (String, usize, usize)>,
}

impl MtlLoader<'_> {
    fn warn(&self, message: String, file: &Path, line: usize) {
        self.log.warn(&Error::new(message).in_file(file).at_line(line));
    }

    /// All materials by name with the path of their library; the first of a name applies. `None` if a library is
    /// missing.
    fn libraries(
        &self,
        names: &[(String, usize)],
        colored: bool,
    ) -> Result<Option<BTreeMap<String, (PathBuf, MtlMaterial)>>> {
        let mut known = BTreeMap::new();
        let mut read = BTreeSet::new();
        let mut missing = false;
        for (name, line) in names {
            let at = |error: Error| error.in_file(self.file).at_line(*line);
            let noted = |found: ResolvedName| found.noted(|note| self.log.warn(&at(note)));
            // The statement may hold one name with blanks or several names.
            let mut paths = Vec::new();
            match self.root.find(&self.folder, name).map_err(at)? {
                Some(found) => paths.push(noted(found)),
                None => {
                    for name in name.split_whitespace() {
                        match self.root.find(&self.folder, name).map_err(at)? {
                            Some(found) => paths.push(noted(found)),
                            None => {
                                missing = true;
                                // With vertex colors the library is not needed.
                                if !colored {
                                    let name = shorten(name);
                                    self.warn(
                                        format!("material library `{name}` is missing; using default materials"),
                                        self.file,
                                        *line,
                                    );
                                }
                            }
                        }
                    }
                }
            }
            for path in paths {
                if !read.insert(path.clone()) {
                    continue;
                }
                let materials = mtl::parse(&self.root.read(&path)?).map_err(|error| error.in_file(&path))?;
                for material in materials {
                    known.entry(material.name.clone()).or_insert((path.clone(), material));
                }
            }
        }
        Ok(if missing && known.is_empty() { None } else { Some(known) })
    }

    /// The material of a scanned object without a library: its one image.
    fn scanned_material(&mut self) -> Result<Option<Material>> {
        for name in SCAN_TEXTURES {
            // A scan's folder of textures is next to its mesh folder, and inside the root.
            if self.folder == Path::new("") && name.starts_with("..") {
                continue;
            }
            if let Some(ResolvedName { path, note: None }) = self.root.find(&self.folder, name)? {
                let Some(texture) = self.texture(&path, Encoding::Srgb, false)? else { return Ok(None) };
                let mut material = default_material(false);
                material.base_color = Color::texture(texture);
                return Ok(Some(material.with_digest()));
            }
        }
        Ok(None)
    }

    /// Warns about faces before any `usemtl`, naming their material.
    fn without_usemtl(&self, used: &MaterialUse, only: Option<&MtlMaterial>) {
        let has = match only {
            Some(material) => format!("`{}`, the only material of the library", shorten(&material.name)),
            None => "the default material".into(),
        };
        self.warn(format!("{} faces have no `usemtl`; they get {has}", used.triangles), self.file, used.line);
    }

    /// Remembers unsupported statements of a material, for one warning per kind.
    fn note_unread(&mut self, from: &MtlMaterial, library: &Path) {
        let ambient = from.ambient.iter().filter(|_| from.diffuse.is_none() && from.diffuse_map.is_none());
        let has_image = from.diffuse_map.is_some();
        for (text, line) in from.unread.iter().chain(ambient) {
            let key = text.split_whitespace().next().unwrap_or_default().to_ascii_lowercase();
            // Exporters repeat the image of the color there.
            if key == "map_ka" && has_image {
                continue;
            }
            let entry = self.unread.entry((library.to_owned(), key)).or_insert_with(|| (text.clone(), *line, 0));
            entry.2 += 1;
        }
    }

    fn tell_unread(&mut self) {
        let what = [
            "`Kd` is black next to `map_Kd`, which would hide the texture; ignoring `Kd`",
            "`Kd` is black, which would hide the vertex colors; ignoring `Kd`",
        ];
        for (black, what) in std::mem::take(&mut self.black).into_iter().zip(what) {
            if let Some((library, line, count)) = black {
                let all = if count > 1 { format!(" ({count} materials)") } else { String::new() };
                self.warn(format!("{what}{all}"), &library, line);
            }
        }
        for ((library, key), (text, line, count)) in std::mem::take(&mut self.unread) {
            let why = match key.as_str() {
                "ks" | "map_ks" => "highlights are white",
                "tf" => "transmitted light takes the color `Kd`",
                "ka" | "map_ka" => "the color is `Kd` or `map_Kd`",
                "kd" | "ke" => "spectra are in other files; write red, green and blue",
                "-mm" => "the range of the texture stays unchanged",
                _ => "the appearance may differ",
            };
            let all = if count > 1 { format!(" ({count} statements)") } else { String::new() };
            self.warn(format!("`{}` is not supported{all}: {why}", shorten(&text)), &library, line);
        }
    }

    /// `Kd` as a color in [0, 1]; `None` if it is missing, or black with a texture or vertex colors.
    fn diffuse(&mut self, from: &MtlMaterial, library: &Path, painted: bool) -> Option<[f32; 3]> {
        let (kd, line) = (from.diffuse?, from.diffuse_line);
        if kd == [0.0; 3] && (from.diffuse_map.is_some() || painted) {
            let black = &mut self.black[usize::from(from.diffuse_map.is_none())];
            black.get_or_insert_with(|| (library.to_owned(), line, 0)).2 += 1;
            return None;
        }
        let full = full_intensity(kd.map(f64::from));
        if full > 1.0 {
            let name = shorten(&from.name);
            self.warn(format!("`Kd` of `{name}` is above 1; its range is taken as 0 to {full}"), library, line);
        }
        Some(kd.map(|x| unit((f64::from(x) / full) as f32)))
    }

    fn material(&mut self, from: &MtlMaterial, library: &Path, painted: bool) -> Result<Material> {
        self.note_unread(from, library);
        let unstated = if from.diffuse_map.is_some() || painted { [1.0; 3] } else { [0.6; 3] };
        let mut material = Material::plain(
            from.name.clone(),
            self.diffuse(from, library, painted).unwrap_or(unstated),
            from.roughness.map(unit).or(from.shininess.map(phong_roughness)).unwrap_or(DEFAULT_ROUGHNESS),
        );
        material.metallic.factor = from.metallic.map_or(0.0, unit);
        material.emission.factor = from.emission.unwrap_or_default().map(|x| x.max(0.0));
        // Exporters write 1 for an unknown index; the default 1.5 is kept then.
        if let Some(ior) = from.ior.filter(|ior| (1.0..=3.0).contains(ior) && *ior > 1.0) {
            material.ior = ior;
        }
        if let Some(map) = &from.diffuse_map {
            let encoding = if map.linear { Encoding::Linear } else { Encoding::Srgb };
            material.base_color.texture = self.map(map, library, encoding)?;
            if let Some(opacity) = &from.opacity_map {
                if opacity.name == map.name && material.base_color.texture.is_some() {
                    material.alpha = Alpha::Mask { cutoff: 0.5 };
                } else {
                    let what =
                        format!("opacity map `{}` is not supported; use the alpha of `map_Kd`", shorten(&opacity.name));
                    self.warn(what, library, opacity.line);
                }
            }
        }
        if let (None, Some(opacity)) = (&from.diffuse_map, &from.opacity_map) {
            let what = format!("opacity map `{}` is not supported; use the alpha of `map_Kd`", shorten(&opacity.name));
            self.warn(what, library, opacity.line);
        }
        self.blend(&mut material, from, library);
        if let Some(map) = &from.emission_map {
            if from.emission == Some([0.0; 3]) {
                let what = format!("`map_Ke {}` emits nothing: `Ke` is 0 0 0", shorten(&map.name));
                self.warn(what, library, map.line);
            }
            material.emission.texture = self.map(map, library, Encoding::Srgb)?;
            if from.emission.is_none() && material.emission.texture.is_some() {
                material.emission.factor = [1.0; 3];
            }
        }
        for (map, scalar, stated) in [
            (&from.roughness_map, &mut material.roughness, from.roughness),
            (&from.metallic_map, &mut material.metallic, from.metallic),
        ] {
            if let Some(map) = map
                && let Some(texture) = self.map(map, library, Encoding::Linear)?
            {
                *scalar = Scalar {
                    factor: stated.map_or(1.0, unit),
                    texture: Some((texture, map.channel.filter(|&channel| channel < 3).unwrap_or(0))),
                };
            }
        }
        for (map, surely) in [(&from.normal_map, true), (&from.bump_map, false)] {
            let Some(map) = map.as_ref().filter(|_| material.normal.is_none()) else {
                continue;
            };
            if let Some(texture) = self.map(map, library, Encoding::Linear)? {
                if surely || looks_like_normals(&texture.texture) {
                    material.normal = Some(NormalMap { map: texture, strength: map.strength });
                } else {
                    let what =
                        format!("`{}` is a height map, which is not supported; use a normal map", shorten(&map.name));
                    self.warn(what, library, map.line);
                }
            }
        }
        Ok(material.with_digest())
    }

    /// Opacity below one blends. An invisible surface is an error of the exporter: some write the opacity as `Tr`, or 0
    /// if it is unknown.
    fn blend(&self, material: &mut Material, from: &MtlMaterial, library: &Path) {
        let opacity = from.opacity.or(from.transparency.map(|(tr, line)| (1.0 - tr, line)));
        let Some((opacity, line)) = opacity.filter(|(opacity, _)| *opacity < 1.0) else { return };
        if opacity > 0.0 {
            blend(material, opacity);
        } else {
            let what = format!("material `{}` would be invisible; it is treated as opaque", shorten(&from.name));
            self.warn(what, library, line);
        }
    }

    /// Loads a texture. A missing file causes a warning, and returns `None`.
    fn map(&mut self, map: &MtlMap, library: &Path, encoding: Encoding) -> Result<Option<TextureRef>> {
        let Some(path) = self.image(map, library)? else { return Ok(None) };
        let Some(texture) = self.texture(&path, encoding, map.clamp)? else { return Ok(None) };
        let transform = UvTransform { scale: map.scale, rotation: 0.0, offset: map.offset };
        Ok(Some(TextureRef { texture, transform }))
    }

    /// The file of a texture, looked up with one warning at most.
    fn image(&mut self, map: &MtlMap, library: &Path) -> Result<Option<PathBuf>> {
        if let Some(known) = self.images.get(&map.name) {
            return Ok(known.clone());
        }
        let at = |error: Error| error.in_file(library).at_line(map.line);
        let mut found = self.root.find(&self.folder, &map.name).map_err(at)?;
        if found.is_none() && self.folder != Path::new("") {
            found = self.root.find(&self.folder.join(GSO_TEXTURES), &map.name).map_err(at)?;
        }
        let path = found.map(|found| found.noted(|note| self.log.warn(&at(note))));
        if path.is_none() {
            let name = shorten(&map.name);
            self.warn(format!("texture `{name}` is missing; using a constant color"), library, map.line);
        }
        self.images.insert(map.name.clone(), path.clone());
        Ok(path)
    }

    fn texture(&mut self, path: &Path, encoding: Encoding, clamp: bool) -> Result<Option<Arc<Texture>>> {
        let key = (path.to_owned(), encoding == Encoding::Srgb, clamp);
        if let Some(texture) = self.textures.get(&key) {
            return Ok(texture.clone());
        }
        let wrap = if clamp { Wrap::Clamp } else { Wrap::Repeat };
        let image = DecodedImage::read_if_known(self.root, path, |error| self.log.warn(&error))?;
        let texture = image.map(|image| Arc::new(image.into_texture(encoding, [wrap; 2])));
        self.textures.insert(key, texture.clone());
        Ok(texture)
    }

    /// A material for faces without texture coordinates: textures are replaced by their mean.
    fn without_textures(&self, material: Material, used: &MaterialUse) -> Material {
        let Some(plain) = untextured(&material) else {
            return material;
        };
        self.warn(
            format!(
                "{} faces have no texture coordinates; the mean color of the texture is used for them",
                used.triangles
            ),
            self.file,
            used.line,
        );
        plain
    }
}

fn unit(x: f32) -> f32 {
    x.clamp(0.0, 1.0)
}

/// The GGX roughness whose highlight is as wide as Blinn and Phong's with this exponent: α² = 2 / (n + 2), r = √α
/// (Walter et al. 2007, section 5.1).
fn phong_roughness(exponent: f32) -> f32 {
    (2.0 / (exponent.max(0.0) + 2.0)).sqrt().sqrt()
}

/// Normal maps are bluish; height maps are gray.
fn looks_like_normals(texture: &Texture) -> bool {
    let [r, g, b] = mean(texture);
    b > 0.6 && (0.3..0.7).contains(&r) && (0.3..0.7).contains(&g)
}
