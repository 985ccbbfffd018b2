//! `ycb`: folders `<name>/google_16k/textured.obj`, meters, z up.

use super::folder::catalog_of_folders;
use super::keypoints::with_keypoints;
use super::layouts::{RECONSTRUCTIONS, ycb_mesh};
use crate::formats::obj;
use std::path::Path;
use syntable_mesh::ObjectInfo;
use syntable_mesh::root::AssetRoot;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};
use syntable_model::stage::AssetLimits;

/// Objects of the YCB Object and Model Set (Calli et al., 2015), as downloaded: one folder per object with
/// `google_16k/textured.obj` next to its texture; or as in YCB-Video, with `textured.obj` or `textured_simple*.obj` in
/// the object's folder itself. Meters, z up. The origins are outside the objects; let the pool center them.
///
/// Objects have the masses that the authors weighed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ycb {
    /// Folder that holds the objects' folders.
    root: AssetPath,
    /// Which reconstruction of each object is read.
    #[serde(default)]
    reconstruction: Reconstruction,
    #[serde(skip)]
    limits: AssetLimits,
}

/// The reconstructions of YCB.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Reconstruction {
    /// Google's scanner, 16 thousand triangles.
    #[default]
    #[serde(rename = "google_16k")]
    Google16k,
    /// Google's scanner, 64 thousand triangles.
    #[serde(rename = "google_64k")]
    Google64k,
    /// Google's scanner, 512 thousand triangles.
    #[serde(rename = "google_512k")]
    Google512k,
    /// Berkeley's scanner, Poisson reconstruction.
    #[serde(rename = "poisson")]
    Poisson,
    /// Berkeley's scanner, volumetric range image integration.
    #[serde(rename = "tsdf")]
    Tsdf,
}

impl Reconstruction {
    pub(crate) fn folder(self) -> &'static str {
        RECONSTRUCTIONS[self as usize]
    }
}

/// License of all objects of the collection.
const LICENSE: &str = "CC-BY-4.0";

config!(Ycb => dyn AssetSource, "ycb", "root = \"${ASSETS}/ycb\"");

impl AssetSource for Ycb {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let wanted = format!("`<name>/{}/textured.obj`", self.reconstruction.folder());
        let has_mesh = |folder: &Path| ycb_mesh(folder, self.reconstruction.folder()).map(|mesh| mesh.is_some());
        catalog_of_folders(&self.root, has_mesh, |_, name| Ok(category(name)), &wanted)
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let folder = AssetRoot::open(self.root.path())?.locate(Path::new(name))?;
        let mesh = ycb_mesh(&folder, self.reconstruction.folder())?.ok_or_else(|| {
            Error::new(format!("no mesh of the reconstruction {:?}", self.reconstruction)).in_file(&folder)
        })?;
        let root = AssetRoot::open(&folder)?.within(self.limits);
        let model = obj::read(&root, &mesh, log)?;
        let info = ObjectInfo { name: name.to_owned(), category: category(name), license: LICENSE.to_owned() };
        let (object, _) = model.into_object(info, &folder.join(&mesh), log)?;
        let object = with_keypoints(object, &root, &mesh)?;
        Ok(match mass_kg(name) {
            Some(kg) => object.with_known_mass(kg).into(),
            None => object.into(),
        })
    }
}

/// Masses in grams, by the number and letter at the start of a name: Calli et al., Benchmarking in Manipulation
/// Research, IEEE Robotics & Automation Magazine, 2015, table 2. Sets of several pieces, for which the table has no
/// single masses, are omitted, and so are objects whose mass could not be verified.
const MASSES_G: [(&str, f64); 52] = [
    ("001", 205.0),
    ("002", 414.0),
    ("003", 411.0),
    ("004", 514.0),
    ("005", 349.0),
    ("006", 603.0),
    ("007", 171.0),
    ("008", 187.0),
    ("009", 97.0),
    ("010", 370.0),
    ("011", 66.0),
    ("012", 18.0),
    ("013", 68.0),
    ("014", 29.0),
    ("015", 33.0),
    ("016", 49.0),
    ("017", 47.0),
    ("018", 25.0),
    ("019", 178.0),
    ("021", 1131.0),
    ("022", 1022.0),
    ("024", 147.0),
    ("025", 118.0),
    ("026", 6.2),
    ("027", 950.0),
    ("028", 652.0),
    ("029", 279.0),
    ("030", 34.0),
    ("031", 30.0),
    ("032", 31.0),
    ("033", 51.5),
    ("035", 895.0),
    ("036", 729.0),
    ("037", 82.0),
    ("038", 208.0),
    ("040", 15.8),
    ("041", 8.2),
    ("042", 252.0),
    ("043", 97.0),
    ("044", 98.4),
    ("048", 665.0),
    ("050", 59.0),
    ("051", 125.0),
    ("052", 202.0),
    ("053", 123.0),
    ("054", 191.0),
    ("055", 148.0),
    ("056", 58.0),
    ("057", 41.0),
    ("058", 46.0),
    ("061", 28.0),
    ("062", 5.2),
];

/// The published mass of an object, kg.
fn mass_kg(name: &str) -> Option<f64> {
    let (number, _) = name.split_once('_')?;
    MASSES_G.iter().find(|(known, _)| *known == number).map(|(_, grams)| grams / 1000.0)
}

/// `003_cracker_box` is a `cracker_box`, `065-a_cups` are `cups`.
fn category(name: &str) -> String {
    match name.split_once('_') {
        Some((number, rest)) if number.starts_with(|c: char| c.is_ascii_digit()) && !rest.is_empty() => rest.to_owned(),
        _ => name.to_owned(),
    }
}

syntable_model::register!(Ycb);
