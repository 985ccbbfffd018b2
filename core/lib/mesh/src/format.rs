//! Registries of mesh and image formats.
//!
//! Formats register at link time, like stages: [`register_mesh_format!`](crate::register_mesh_format) and
//! [`register_image_format!`](crate::register_image_format). [`MeshFormats::linked`] and [`ImageFormats::linked`]
//! collect them in a fixed order and refuse two formats that claim the same name or extension.

use crate::Model;
use crate::foreign;
use crate::image::DecodedImage;
use crate::limits::Budget;
use crate::root::AssetRoot;
use crate::scan::extension;
use crate::up::Up;
use std::path::{Path, PathBuf};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::inventory;
use syntable_model::length_unit::LengthUnit;
use syntable_model::scene::EnvironmentMap;

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Name for reports, such as `meter`.
    pub name: &'static str,
    /// Meters per unit.
    pub meters: f64,
}

impl Unit {
    /// The meter.
    pub const METER: Self = Self { name: "meter", meters: 1.0 };
}

/// Reads a mesh file, named relative to the asset's root. The model is in the file's unit; z is up if the format
/// states its axes, else the file's axes are kept.
pub type ReadMesh = fn(&AssetRoot, &Path, &dyn Log) -> Result<Model>;

/// A format of triangle meshes.
#[derive(Debug, Clone, Copy)]
pub struct MeshFormat {
    /// Name in messages, in `check --asset` and in lists, such as `OBJ`.
    pub name: &'static str,
    /// Extensions of its files: lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Reads a file.
    pub read: ReadMesh,
    /// Whether files state which axis is up. If not, the option `up` of `mesh_folder` applies.
    pub states_up_axis: bool,
    /// If a mesh exists in several formats, the format of highest preference is read; ties go by name.
    pub preference: u32,
    /// The unit of a file by its name, for `check --asset`. Sources ask the recipe instead.
    pub unit_of: fn(&Path) -> Unit,
    /// The unit in which `check --asset` takes files whose size no object has in meters.
    pub usual_unit: Option<LengthUnit>,
    /// The meshes that a file is made of, relative to the root: they are no objects of their own.
    pub parts: fn(&AssetRoot, &Path) -> Vec<PathBuf>,
    /// The crate that registered it.
    pub crate_name: &'static str,
}

impl MeshFormat {
    /// A format with files that do not state their axes and are in meters, with preference 0.
    pub const fn new(name: &'static str, extensions: &'static [&'static str], read: ReadMesh) -> Self {
        Self {
            name,
            extensions,
            read,
            states_up_axis: false,
            preference: 0,
            unit_of: |_| Unit::METER,
            usual_unit: None,
            parts: |_, _| Vec::new(),
            crate_name: "",
        }
    }

    /// Declares that files state which axis is up, and that the reader converts to z up.
    pub const fn with_stated_up_axis(mut self) -> Self {
        self.states_up_axis = true;
        self
    }

    /// Sets the preference over other formats of the same mesh.
    pub const fn with_preference(mut self, preference: u32) -> Self {
        self.preference = preference;
        self
    }

    /// Sets the unit by the name of a file in `check --asset`.
    pub const fn with_unit_by_name(mut self, unit: fn(&Path) -> Unit) -> Self {
        self.unit_of = unit;
        self
    }

    /// Sets the unit in which `check --asset` takes files whose size no object has in meters.
    pub const fn with_usual_unit(mut self, unit: LengthUnit) -> Self {
        self.usual_unit = Some(unit);
        self
    }

    /// Declares that files are made of other meshes.
    pub const fn with_parts(mut self, parts: fn(&AssetRoot, &Path) -> Vec<PathBuf>) -> Self {
        self.parts = parts;
        self
    }

    /// Sets the crate; used by [`register_mesh_format!`](crate::register_mesh_format).
    pub const fn registered_by(mut self, crate_name: &'static str) -> Self {
        self.crate_name = crate_name;
        self
    }

    /// Whether a path has one of the extensions and is not a folder.
    pub fn accepts(&self, path: &Path) -> bool {
        has_extension(path, self.extensions)
    }
}

inventory::collect!(MeshFormat);

/// All mesh formats of a program, by descending preference.
#[derive(Debug, Clone, Default)]
pub struct MeshFormats(Vec<MeshFormat>);

impl MeshFormats {
    /// The formats of all crates that are linked into this program and named in its source.
    pub fn linked() -> Result<Self> {
        Self::new(inventory::iter::<MeshFormat>.into_iter().copied())
    }

    /// Sorts and checks formats.
    pub fn new(formats: impl IntoIterator<Item = MeshFormat>) -> Result<Self> {
        let mut formats: Vec<MeshFormat> = formats.into_iter().collect();
        formats.sort_by_key(|format| (u32::MAX - format.preference, format.name, format.crate_name));
        check(formats.iter().map(|f| Claim { name: f.name, extensions: f.extensions, crate_name: f.crate_name }))?;
        Ok(Self(formats))
    }

    /// The formats.
    pub fn iter(&self) -> impl Iterator<Item = &MeshFormat> {
        self.0.iter()
    }

    /// All extensions, starting with the preferred format.
    pub fn extensions(&self) -> Vec<&'static str> {
        self.0.iter().flat_map(|format| format.extensions).copied().collect()
    }

    /// The names of all formats, joined for messages: `A, B and C`.
    pub fn names(&self, conjunction: &str) -> String {
        enumerate(self.0.iter().map(|format| format.name), conjunction)
    }

    /// The format of a file, by its extension.
    pub fn of_file(&self, file: &Path) -> Option<&MeshFormat> {
        let extension = extension(file);
        self.0.iter().find(|format| format.extensions.contains(&extension.as_str()))
    }

    /// Reads a mesh file, named relative to its root.
    pub fn read(&self, root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
        match self.of_file(file) {
            Some(format) => (format.read)(root, file, log),
            None => {
                let path = root.folder().join(file);
                Err(foreign::refusal(&path, &self.extensions()).unwrap_or_else(|| {
                    Error::new(format!("`.{}` is not a mesh format", extension(file)))
                        .in_file(path)
                        .help(format!("the mesh formats are {}", self.names("and")))
                }))
            }
        }
    }

    /// Reads a mesh file with z up. `up` is the axis that points up in a file of a format that does not state it.
    pub fn read_upright(&self, root: &AssetRoot, file: &Path, up: Up, log: &dyn Log) -> Result<Model> {
        let model = self.read(root, file, log)?;
        let states_up_axis = self.of_file(file).is_some_and(|format| format.states_up_axis);
        Ok(if up == Up::Y && !states_up_axis { model.y_up_to_z_up() } else { model })
    }
}

/// Decoder of an image format.
#[derive(Debug, Clone, Copy)]
pub enum ImageDecoder {
    /// 8 bits per channel, for textures.
    Texture(fn(&[u8], &Budget) -> Result<DecodedImage>),
    /// Linear radiance, for environment maps. The map needs no name.
    Radiance(fn(&[u8], &Budget) -> Result<EnvironmentMap>),
}

/// A format of images.
#[derive(Debug, Clone, Copy)]
pub struct ImageFormat {
    /// Name in messages, in `check --asset` and in lists, such as `PNG`.
    pub name: &'static str,
    /// Extensions of its files: lower case, without the dot. Folders are scanned by extension.
    pub extensions: &'static [&'static str],
    /// Whether the first bytes of a file identify this format.
    pub matches: fn(&[u8]) -> bool,
    /// Decodes a file in memory. The decoder reserves the image in the budget ([`Budget::image`]) before it allocates.
    pub decode: ImageDecoder,
    /// If an image exists in several formats, the format of highest preference is read; ties go by name.
    pub preference: u32,
    /// The crate that registered it.
    pub crate_name: &'static str,
}

impl ImageFormat {
    /// A format with preference 0.
    pub const fn new(
        name: &'static str,
        extensions: &'static [&'static str],
        matches: fn(&[u8]) -> bool,
        decode: ImageDecoder,
    ) -> Self {
        Self { name, extensions, matches, decode, preference: 0, crate_name: "" }
    }

    /// Sets the preference over other formats of the same image.
    pub const fn with_preference(mut self, preference: u32) -> Self {
        self.preference = preference;
        self
    }

    /// Sets the crate; used by [`register_image_format!`](crate::register_image_format).
    pub const fn registered_by(mut self, crate_name: &'static str) -> Self {
        self.crate_name = crate_name;
        self
    }

    /// Whether a path has one of the extensions and is not a folder.
    pub fn accepts(&self, path: &Path) -> bool {
        has_extension(path, self.extensions)
    }

    fn is_texture(&self) -> bool {
        matches!(self.decode, ImageDecoder::Texture(_))
    }
}

inventory::collect!(ImageFormat);

impl DecodedImage {
    /// Reads a file of any registered format. Errors name the file.
    pub fn read(root: &AssetRoot, path: &Path) -> Result<Self> {
        Self::decode(&root.read(path)?, root.budget()).map_err(|error| error.in_file(path))
    }

    /// As [`read`](Self::read), for an image that an asset can do without: none, after a warning, if its format is
    /// unknown or its kind unsupported.
    pub fn read_if_known(root: &AssetRoot, path: &Path, warn: impl FnOnce(Error)) -> Result<Option<Self>> {
        let (bytes, formats) = (root.read(path)?, ImageFormats::linked()?);
        // Other content under the name of a known format is damage.
        let is_named = formats.0.iter().any(|format| format.accepts(path));
        let decoded = if !is_named && formats.0.iter().all(|format| !(format.matches)(&bytes)) {
            Err(Error::unsupported("an image of an unknown format").help(formats.known_textures()))
        } else {
            formats.decode_texture(&bytes, root.budget())
        };
        Self::if_supported(decoded.map_err(|error| error.in_file(path)), warn)
    }

    /// None, after a warning, for an image of an unsupported kind.
    pub fn if_supported(decoded: Result<Self>, warn: impl FnOnce(Error)) -> Result<Option<Self>> {
        match decoded {
            Err(error) if error.is_unsupported() => {
                warn(error.with_consequence("using a constant color"));
                Ok(None)
            }
            decoded => decoded.map(Some),
        }
    }

    /// Decodes an image of any registered format.
    pub fn decode(bytes: &[u8], budget: &Budget) -> Result<Self> {
        ImageFormats::linked()?.decode_texture(bytes, budget)
    }
}

/// All image formats of a program, by descending preference.
#[derive(Debug, Clone, Default)]
pub struct ImageFormats(Vec<ImageFormat>);

impl ImageFormats {
    /// The formats of all crates that are linked into this program and named in its source.
    pub fn linked() -> Result<Self> {
        Self::new(inventory::iter::<ImageFormat>.into_iter().copied())
    }

    /// Sorts and checks formats.
    pub fn new(formats: impl IntoIterator<Item = ImageFormat>) -> Result<Self> {
        let mut formats: Vec<ImageFormat> = formats.into_iter().collect();
        formats.sort_by_key(|format| (u32::MAX - format.preference, format.name, format.crate_name));
        check(formats.iter().map(|f| Claim { name: f.name, extensions: f.extensions, crate_name: f.crate_name }))?;
        Ok(Self(formats))
    }

    /// The formats.
    pub fn iter(&self) -> impl Iterator<Item = &ImageFormat> {
        self.0.iter()
    }

    /// Extensions of texture formats, starting with the preferred format.
    pub fn texture_extensions(&self) -> Vec<&'static str> {
        self.0.iter().filter(|format| format.is_texture()).flat_map(|format| format.extensions).copied().collect()
    }

    /// Extensions of environment map formats, starting with the preferred format.
    pub fn radiance_extensions(&self) -> Vec<&'static str> {
        self.0.iter().filter(|format| !format.is_texture()).flat_map(|format| format.extensions).copied().collect()
    }

    /// Names of texture formats, for messages.
    fn known_textures(&self) -> String {
        let names = self.0.iter().filter(|format| format.is_texture()).map(|format| format.name);
        format!("texture formats are {}", enumerate(names, "and"))
    }

    /// Decodes an image for a texture.
    pub fn decode_texture(&self, bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
        let known = || self.known_textures();
        match self.0.iter().find(|format| (format.matches)(bytes)) {
            Some(ImageFormat { decode: ImageDecoder::Texture(decode), .. }) => decode(bytes, budget),
            Some(format) => {
                Err(Error::new(format!("{} is a format of environment maps, not of textures", format.name))
                    .help(known()))
            }
            None => Err(Error::new("not an image of a known format").help(known())),
        }
    }

    /// Decodes an environment map.
    pub fn decode_radiance(&self, bytes: &[u8], budget: &Budget) -> Result<EnvironmentMap> {
        let known = || {
            let names = self.0.iter().filter(|format| !format.is_texture()).map(|format| format.name);
            format!("environment map formats are {}", enumerate(names, "and"))
        };
        match self.0.iter().find(|format| (format.matches)(bytes)) {
            Some(ImageFormat { decode: ImageDecoder::Radiance(decode), .. }) => decode(bytes, budget),
            Some(format) => {
                Err(Error::new(format!("not an environment map: {} has no radiance", format.name)).help(known()))
            }
            None => Err(Error::new("not an environment map of a known format").help(known())),
        }
    }
}

/// Names and extensions of a format, for clashes.
struct Claim {
    name: &'static str,
    extensions: &'static [&'static str],
    crate_name: &'static str,
}

/// Refuses malformed extensions, and names or extensions that two formats claim.
fn check(claims: impl Iterator<Item = Claim>) -> Result<()> {
    let claims: Vec<Claim> = claims.collect();
    for claim in &claims {
        let well_formed = |extension: &&str| {
            !extension.is_empty() && extension.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit())
        };
        if let Some(extension) = claim.extensions.iter().find(|extension| !well_formed(extension)) {
            return Err(Error::new(format!(
                "format `{}` of crate {} has the extension `{extension}`",
                claim.name, claim.crate_name
            ))
            .help("an extension is lower case and has no dot"));
        }
    }
    for (i, first) in claims.iter().enumerate() {
        for second in &claims[i + 1..] {
            let clash = if first.name == second.name {
                Some(format!("the format name `{}`", first.name))
            } else {
                let both = first.extensions.iter().find(|extension| second.extensions.contains(extension));
                both.map(|extension| format!("the extension `.{extension}`"))
            };
            if let Some(clash) = clash {
                return Err(Error::new(format!(
                    "two crates register {clash}: {} for {} and {} for {}",
                    first.crate_name, first.name, second.crate_name, second.name
                ))
                .help("link only one of them"));
            }
        }
    }
    Ok(())
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    extensions.contains(&extension(path).as_str()) && !path.is_dir()
}

/// Joins names: `A, B and C`.
fn enumerate(names: impl Iterator<Item = &'static str>, conjunction: &str) -> String {
    let names: Vec<&str> = names.collect();
    match &names[..] {
        [] => "none".into(),
        [only] => (*only).into(),
        [first @ .., last] => format!("{} {conjunction} {last}", first.join(", ")),
    }
}

/// Registers mesh formats: constant [`MeshFormat`] values. `mesh_folder` and `syntable check --asset` then read them.
#[macro_export]
macro_rules! register_mesh_format {
    ($($format:expr),+ $(,)?) => {$(
        $crate::syntable_model::inventory::submit! {
            $crate::format::MeshFormat::registered_by($format, env!("CARGO_PKG_NAME"))
        }
        $crate::syntable_model::inventory::submit! {
            $crate::syntable_model::inspect::Inspector {
                name: $crate::format::MeshFormat::registered_by($format, "").name,
                accepts: |path| {
                    const FORMAT: $crate::format::MeshFormat = $format;
                    FORMAT.accepts(path)
                },
                inspect: $crate::inspect::mesh_file,
            }
        }
    )+};
}

/// Registers image formats: constant [`ImageFormat`] values. Textures or environment maps, the folders that hold them
/// and `syntable check --asset` then read them.
#[macro_export]
macro_rules! register_image_format {
    ($($format:expr),+ $(,)?) => {$(
        $crate::syntable_model::inventory::submit! {
            $crate::format::ImageFormat::registered_by($format, env!("CARGO_PKG_NAME"))
        }
        $crate::syntable_model::inventory::submit! {
            $crate::syntable_model::inspect::Inspector {
                name: $crate::format::ImageFormat::registered_by($format, "").name,
                accepts: |path| {
                    const FORMAT: $crate::format::ImageFormat = $format;
                    FORMAT.accepts(path)
                },
                inspect: $crate::inspect::image_file,
            }
        }
    )+};
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unreadable(_: &AssetRoot, file: &Path, _: &dyn Log) -> Result<Model> {
        Err(Error::new("unreadable").in_file(file))
    }

    fn mesh(name: &'static str, extensions: &'static [&'static str], crate_name: &'static str) -> MeshFormat {
        MeshFormat::new(name, extensions, unreadable).registered_by(crate_name)
    }

    #[test]
    fn formats_are_sorted_by_preference_then_name() {
        let formats = [
            mesh("C", &["c"], "x"),
            mesh("B", &["b", "bb"], "y").with_preference(7),
            mesh("A", &["a"], "z").with_preference(7),
        ];
        for rotation in 0..3 {
            let mut formats = formats;
            formats.rotate_left(rotation);
            let formats = MeshFormats::new(formats).expect("no clash");
            assert_eq!(formats.extensions(), ["a", "b", "bb", "c"]);
            assert_eq!(formats.names("or"), "A, B or C");
        }
    }

    #[test]
    fn clashes_name_both_crates() {
        let check = |formats: Vec<MeshFormat>, want: &str| {
            let error = MeshFormats::new(formats).expect_err(want).to_string();
            assert!(error.contains(want), "{error} lacks {want}");
        };
        check(
            vec![mesh("One", &["xyz", "abc"], "crate-one"), mesh("Two", &["def", "abc"], "crate-two")],
            "two crates register the extension `.abc`: crate-one for One and crate-two for Two (link only one of them)",
        );
        check(vec![mesh("One", &["a"], "crate-one"), mesh("One", &["b"], "crate-two")], "the format name `One`");
        check(vec![mesh("One", &["OBJ"], "crate-one")], "format `One` of crate crate-one has the extension `OBJ`");
        check(vec![mesh("One", &[".obj"], "crate-one")], "lower case and has no dot");
        check(vec![mesh("One", &[""], "crate-one")], "has the extension ``");
    }

    #[test]
    fn images_are_known_by_their_content() {
        let texture =
            |_: &[u8], _: &Budget| Ok(DecodedImage { width: 1, height: 1, texels: vec![1, 2, 3, 4], kind: "T".into() });
        let radiance = |_: &[u8], _: &Budget| EnvironmentMap::new("", 1, 1, vec![[1.0; 3]]);
        let formats = ImageFormats::new([
            ImageFormat::new("T", &["t"], |b| b.starts_with(b"T"), ImageDecoder::Texture(texture)),
            ImageFormat::new("R", &["r"], |b| b.starts_with(b"R"), ImageDecoder::Radiance(radiance)),
        ])
        .expect("no clash");
        let budget = &Budget::default();
        assert_eq!(formats.decode_texture(b"T!", budget).expect("a texture").texels, [1, 2, 3, 4]);
        assert_eq!(formats.decode_radiance(b"R!", budget).expect("a map").width(), 1);
        for (error, want) in [
            (formats.decode_texture(b"R", budget).map(|_| ()), "R is a format of environment maps, not of textures"),
            (
                formats.decode_texture(b"x", budget).map(|_| ()),
                "not an image of a known format (texture formats are T)",
            ),
            (formats.decode_radiance(b"T", budget).map(|_| ()), "not an environment map: T has no radiance"),
            (formats.decode_radiance(b"", budget).map(|_| ()), "not an environment map of a known format"),
        ] {
            let error = error.expect_err(want).to_string();
            assert!(error.contains(want), "{error} lacks {want}");
        }
    }
}
