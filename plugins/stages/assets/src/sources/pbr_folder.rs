//! `pbr_folder`: folders of surface materials, named as ambientCG (old and new) and Poly Haven name their maps.

use super::nothing_found;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_mesh::format::ImageFormats;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::scan::{is_dir, list, root_name};
use syntable_model::prelude::*;
use syntable_model::scene::{
    Asset, AssetClass, Catalog, CatalogEntry, Color, Encoding, Material, NormalMap, Scalar, Texture, Wrap,
};
use syntable_model::stage::AssetLimits;

/// Tileable surface materials, one folder each, of maps named as ambientCG (`_Color`, `_Roughness`, `_NormalGL`, or the
/// older `_col`, `_rgh`, `_nrm`) or Poly Haven (`_diff`, `_rough`, `_nor_gl`, `_arm`) name them. A color map is needed;
/// without a roughness map the roughness is 0.5, without a metalness map the material is a dielectric. Ambient occlusion and
/// displacement are not read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PbrFolder {
    /// Folder that holds the materials' folders.
    root: AssetPath,
    /// Edge length of one tile of the textures, meters.
    #[serde(default = "tile_m")]
    #[schemars(range(min = 0.01, max = 100.0))]
    tile_m: f64,
    #[serde(skip)]
    limits: AssetLimits,
}

fn tile_m() -> f64 {
    1.0
}

/// Roughness without a map.
const DEFAULT_ROUGHNESS: f32 = 0.5;

config!(PbrFolder => dyn AssetSource, "pbr_folder", "root = \"${ASSETS}/materials\"\ntile_m = 1.0");

impl AssetSource for PbrFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Material
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        let mut names = Vec::new();
        for name in list(root.folder())?.folders {
            if has_maps(&root.folder().join(&name))? {
                names.push(name);
            }
        }
        // The root may be a single material.
        if names.is_empty() && has_maps(root.folder())? {
            names.push(root_name(root.folder()));
        }
        if names.is_empty() {
            return Err(nothing_found(&root, "folder with maps such as `<name>/<name>_Color.jpg`"));
        }
        let entries = names.into_iter().map(|name| CatalogEntry::new(&name, category(&name))).collect();
        Ok(Catalog { entries })
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?;
        let folder = match root.find(Path::new(""), name)?.filter(|found| found.note.is_none()) {
            Some(found) => found.path,
            None if name == root_name(root.folder()) => root.folder().to_owned(),
            None => return Err(Error::new(format!("no material `{name}`")).in_file(root.folder())),
        };
        let mut material = read(&AssetRoot::open(&folder)?.within(self.limits), name, log)?;
        material.tile_m = self.tile_m as f32;
        Ok(Asset::from(material.with_digest()))
    }
}

/// Type of a material's texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Map {
    /// Base color.
    Color,
    /// Roughness, gray.
    Roughness,
    /// Metalness, gray.
    Metalness,
    /// Normals, green upwards.
    NormalGl,
    /// Normals, green downwards.
    NormalDx,
    /// Occlusion, roughness and metalness in red, green and blue.
    Arm,
}

impl Map {
    /// Name in messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Roughness => "roughness",
            Self::Metalness => "metalness",
            Self::NormalGl => "normal (OpenGL)",
            Self::NormalDx => "normal (DirectX)",
            Self::Arm => "occlusion, roughness and metalness",
        }
    }

    /// The map that a file name denotes, by its last word that is neither a size nor a format.
    fn of(file: &str, extensions: &[&str]) -> Option<Self> {
        let (stem, extension) = file.rsplit_once('.')?;
        if !extensions.contains(&extension.to_ascii_lowercase().as_str()) {
            return None;
        }
        let stem = stem.to_ascii_lowercase();
        let mut words: Vec<&str> = stem.split(['_', '-', ' ', '.']).filter(|word| !word.is_empty()).collect();
        let is_size = |word: &str| {
            word.strip_suffix('k').is_some_and(|digits| digits.parse::<u16>().is_ok())
                || word.parse::<u32>().is_ok_and(|size| size >= 256)
                || ["jpg", "png"].contains(&word)
        };
        while words.last().is_some_and(|word| is_size(word)) {
            words.pop();
        }
        // A single word is a name, not a kind.
        match words[..] {
            [_, .., "nor" | "normal" | "nrm", "gl" | "ogl" | "opengl"] => Some(Self::NormalGl),
            [_, .., "nor" | "normal" | "nrm", "dx" | "directx"] => Some(Self::NormalDx),
            [_, .., "base", "color"] => Some(Self::Color),
            [_, .., "color" | "colour" | "col" | "diff" | "diffuse" | "albedo" | "basecolor"] => Some(Self::Color), // typos: ignore
            [_, .., "roughness" | "rough" | "rgh"] => Some(Self::Roughness),
            [_, .., "metalness" | "metallic" | "metal" | "met"] => Some(Self::Metalness),
            [_, .., "normalgl" | "nrm" | "nor" | "normal"] => Some(Self::NormalGl),
            [_, .., "normaldx"] => Some(Self::NormalDx),
            [_, .., "arm" | "orm"] => Some(Self::Arm),
            _ => None,
        }
    }
}

/// Maps of a folder, or of its folder `textures`, relative to it; several of a kind are sorted by name.
pub(crate) fn maps(folder: &Path) -> Result<BTreeMap<Map, Vec<PathBuf>>> {
    let extensions = ImageFormats::linked()?.texture_extensions();
    let mut maps: BTreeMap<Map, Vec<PathBuf>> = BTreeMap::new();
    for inside in ["", "textures"] {
        if !is_dir(&folder.join(inside))? {
            continue;
        }
        for file in list(&folder.join(inside))?.files {
            if let Some(map) = Map::of(&file, &extensions) {
                maps.entry(map).or_default().push(Path::new(inside).join(file));
            }
        }
        if !maps.is_empty() {
            break;
        }
    }
    Ok(maps)
}

/// Whether a folder holds maps of a material.
pub(crate) fn has_maps(folder: &Path) -> Result<bool> {
    Ok(is_dir(folder)? && !maps(folder)?.is_empty())
}

/// Reads the material of a folder.
pub(crate) fn read(root: &AssetRoot, name: &str, log: &dyn Log) -> Result<Material> {
    let folder = root.folder();
    let maps = maps(folder)?;
    let mut sizes = Vec::new();
    let mut texture = |map: Map, encoding: Encoding| -> Result<Option<Arc<Texture>>> {
        let Some([file, others @ ..]) = maps.get(&map).map(Vec::as_slice) else {
            return Ok(None);
        };
        if !others.is_empty() {
            let message = format!("{} {} maps; using `{}`", others.len() + 1, map.name(), file.display());
            log.warn(&Error::new(message).in_file(folder));
        }
        let mut image = DecodedImage::read(root, &root.locate(file)?)?;
        if map == Map::NormalDx {
            image.flip_green();
        }
        sizes.push((map, image.width, image.height));
        Ok(Some(Arc::new(image.into_texture(encoding, [Wrap::Repeat; 2]))))
    };
    let color = texture(Map::Color, Encoding::Srgb)?.ok_or_else(|| {
        let there: Vec<&str> = maps.keys().map(|map| map.name()).collect();
        Error::new(format!("no color map, only: {}", there.join(", ")))
            .in_file(folder)
            .help("a material needs an image such as `<name>_Color.jpg` or `<name>_diff_1k.jpg`")
    })?;
    let mut material = Material::plain(name, [1.0; 3], DEFAULT_ROUGHNESS);
    material.base_color = Color::texture(color);
    if let Some(packed) = texture(Map::Arm, Encoding::Linear)? {
        material.roughness = Scalar::texture(packed.clone(), 1);
        material.metallic = Scalar::texture(packed, 2);
    }
    if let Some(map) = texture(Map::Roughness, Encoding::Linear)? {
        material.roughness = Scalar::texture(map, 0);
    }
    if let Some(map) = texture(Map::Metalness, Encoding::Linear)? {
        material.metallic = Scalar::texture(map, 0);
    }
    let normal = match texture(Map::NormalGl, Encoding::Linear)? {
        Some(map) => Some(map),
        None => texture(Map::NormalDx, Encoding::Linear)?,
    };
    material.normal = normal.map(|map| NormalMap { map: map.into(), strength: 1.0 });
    if sizes.iter().any(|&(_, width, height)| (width, height) != (sizes[0].1, sizes[0].2)) {
        let sizes: Vec<String> =
            sizes.iter().map(|(map, width, height)| format!("{} {width} x {height}", map.name())).collect();
        log.warn(
            &Error::new(format!("maps differ in size: {}; each is sampled at its own size", sizes.join(", ")))
                .in_file(folder),
        );
    }
    Ok(material.with_digest())
}

/// `Fabric04` is a `fabric`, `concrete_wall_001` a `concrete_wall`.
fn category(name: &str) -> String {
    let end = name.find(|c: char| c.is_ascii_digit()).unwrap_or(name.len());
    let word = name[..end].trim_end_matches(['_', '-', ' ']).to_ascii_lowercase();
    if word.is_empty() { name.to_owned() } else { word }
}

syntable_model::register!(PbrFolder);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_denote_maps() {
        for (file, want) in [
            ("Metal053C_1K-JPG_Color.jpg", Some(Map::Color)),
            ("fabric02_col.jpg", Some(Map::Color)),
            ("concrete_wall_001_diff_1k.jpg", Some(Map::Color)),
            ("wood_2k_albedo.PNG", Some(Map::Color)),
            ("Rock058_1K-JPG_AmbientOcclusion.jpg", None),
            ("Rock058_1K-JPG_Displacement.jpg", None),
            ("fabric02_rgh.jpg", Some(Map::Roughness)),
            ("long_white_tiles_rough_1k.jpg", Some(Map::Roughness)),
            ("Fabric04_met.jpg", Some(Map::Metalness)),
            ("Metal055A_1K-JPG_Metalness.jpg", Some(Map::Metalness)),
            ("Onyx003_1K-JPG_NormalGL.jpg", Some(Map::NormalGl)),
            ("Onyx003_1K-JPG_NormalDX.jpg", Some(Map::NormalDx)),
            ("Fabric04_nrm.jpg", Some(Map::NormalGl)),
            ("rosewood_veneer1_nor_gl_1k.png", Some(Map::NormalGl)),
            ("rosewood_veneer1_nor_dx_1024.png", Some(Map::NormalDx)),
            ("tea_set_01_arm_1k.jpg", Some(Map::Arm)),
            ("Fabric04.png", None),
            ("metal.png", None),
            ("Fabric04_col.txt", None),
        ] {
            assert_eq!(Map::of(file, &["png", "jpg", "jpeg"]), want, "{file}");
        }
        for (name, want) in [
            ("Fabric04", "fabric"),
            ("concrete_wall_001", "concrete_wall"),
            ("Metal053C_1K-JPG", "metal"),
            ("007", "007"),
        ] {
            assert_eq!(category(name), want);
        }
    }
}
