//! `environment_folder`: any folder of environment maps.

use super::folder::{AssetFiles, FileIndex, add_asset, by_stem};
use syntable_mesh::environment;
use syntable_mesh::format::ImageFormats;
use syntable_mesh::root::AssetRoot;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};
use syntable_model::stage::AssetLimits;

/// Environment maps anywhere below a folder: equirectangular images of linear radiance with Rec. 709 primaries, in
/// Radiance HDR (`.hdr`), OpenEXR (`.exr`) or a format that a plugin registers.
///
/// A map's name is its path without the extension; its category is the folder above. The center column shows the
/// world's +x direction, and the first row is up. Such files rarely state their unit in nits: the light that uses a map
/// scales it.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentFolder {
    /// Folder that holds the maps, at most eight folders deep.
    root: AssetPath,
    #[serde(skip)]
    files: FileIndex,
    #[serde(skip)]
    limits: AssetLimits,
}

config!(EnvironmentFolder => dyn AssetSource, "environment_folder", "root = \"${ASSETS}/hdri\"");

impl AssetSource for EnvironmentFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Environment
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        let files = find(&root, log)?;
        self.files.catalog(
            &root,
            files,
            &format!("file with the extension {}", ImageFormats::linked()?.radiance_extensions().join(", ")),
        )
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?.within(self.limits);
        let file = self.files.files(name, || find(&root, log))?;
        let file = file
            .and_then(|files| files.into_iter().next())
            .ok_or_else(|| Error::new(format!("no environment map `{name}`")).in_file(root.folder()))?;
        let mut map = environment::read(&root, &root.locate(&file)?)?;
        name.clone_into(&mut map.name);
        Ok(Asset::from(map))
    }
}

/// All maps by name. If a map exists in several formats, the preferred one is read.
fn find(root: &AssetRoot, log: &dyn Log) -> Result<AssetFiles> {
    let mut assets = AssetFiles::new();
    for (stem, files) in by_stem(root, &ImageFormats::linked()?.radiance_extensions(), log)? {
        add_asset(&mut assets, &stem, &[&files], root, log);
    }
    Ok(assets)
}

syntable_model::register!(EnvironmentFolder);
