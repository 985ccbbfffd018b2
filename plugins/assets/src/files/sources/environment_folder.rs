//! Any folder of environment maps.

use super::folder::{Found, Kept, by_stem, enter};
use crate::files::formats::environment;
use crate::files::root::AssetRoot;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};

/// Environment maps anywhere below a folder: equirectangular pictures, Radiance HDR (`.hdr`) or OpenEXR (`.exr`), of
/// linear radiance with Rec. 709 primaries.
///
/// A map's name is its path without the extension; its category is the folder above. The middle column looks along the
/// world's +x, the first row up. Such files rarely say what one unit is in nits: the light that uses a map scales it.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentFolder {
    /// Folder that holds the maps, at most eight folders deep.
    root: AssetPath,
    /// Licence of the maps, as an SPDX expression or name.
    #[serde(default)]
    licence: String,
    #[serde(skip)]
    found: Kept,
}

/// Extensions, the richer format first.
const EXTENSIONS: [&str; 2] = ["exr", "hdr"];

impl Config for EnvironmentFolder {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "environment_folder";
    const EXAMPLE: &'static str = "root = \"${ASSETS}/hdri\"\nlicence = \"CC0-1.0\"";
    fn build(self) -> Result<Box<dyn AssetSource>, Invalid> {
        Ok(Box::new(self))
    }
}

impl AssetSource for EnvironmentFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Environment
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        self.found.catalog(&root, find(&root, log)?, "`.hdr` or `.exr` file")
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?;
        let file = self.found.file(name, || find(&root, log))?;
        let file = file.ok_or_else(|| Error::new(format!("no environment map `{name}`")).in_file(root.folder()))?;
        let mut map = environment::read(&root.locate(&file)?)?;
        name.clone_into(&mut map.name);
        map.licence.clone_from(&self.licence);
        Ok(Asset::Environment(map))
    }
}

/// All maps by name. Of one map in both formats OpenEXR is read.
fn find(root: &AssetRoot, log: &dyn Log) -> Result<Found> {
    let mut found = Found::new();
    for (stem, files) in by_stem(root, &EXTENSIONS)? {
        enter(&mut found, &stem, &files, root, log);
    }
    Ok(found)
}

syntable_model::register!(EnvironmentFolder);
