//! `mesh_folder`: any folder of meshes.

use super::collision::object_folders;
use super::folder::{AssetFiles, FileIndex, add_asset, by_stem, category, leave_out_collision_meshes, warn_of_foreign};
use super::keypoints::with_keypoints;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_mesh::foreign;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::scan::root_name;
use syntable_mesh::{ObjectInfo, Up};
use syntable_model::context::Collected;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};
use syntable_model::stage::AssetLimits;

/// Meshes anywhere below a folder: OBJ with MTL, glTF, GLB, PLY, STL, COLLADA, URDF and all formats that plugins register,
/// in meters. The pool's `units` converts other units.
///
/// An asset's name is its path without the extension, or the name of its folder if the folder has no other mesh; its
/// category is the folder above. If a mesh exists in several formats, the format with the most information is read:
/// URDF, then glTF, OBJ, COLLADA, PLY, STL. The meshes that a URDF file names are its parts, and no objects of their own.
///
/// Collision meshes, which simulators keep next to a model, are skipped with a warning that counts them: meshes in a
/// folder `collision`, meshes whose name without a word such as `col`, `hull` or `convex` is the name of another mesh,
/// and meshes with a word such as `vhacd` in their name.
///
/// A file `<mesh>.keypoints.json` beside a mesh names points of it: `{"keypoints": [{"name": "rim", "point": [0, 0, 0.1]}]}`,
/// in the frame and unit of the mesh as it is read, z up. So it is for every kind of source that reads objects from files.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFolder {
    /// Folder that holds the meshes, at most eight folders deep. Meshes may use images from anywhere below it.
    root: AssetPath,
    /// Which axis points up in formats that do not state it, such as OBJ, PLY and STL. glTF is y up by its standard.
    #[serde(default)]
    up: Up,
    /// Whether every mesh file is an object, or all files of a folder are one.
    #[serde(default)]
    one_object_per: ObjectUnit,
    /// Treatment of collision meshes.
    #[serde(default)]
    collision_meshes: CollisionMeshes,
    #[serde(skip)]
    files: FileIndex,
    #[serde(skip)]
    limits: AssetLimits,
}

/// The files of one object.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectUnit {
    /// A mesh file.
    #[default]
    File,
    /// A folder: its mesh files are parts of one rigid body, in their common frame. Files in folders such as `visual` and
    /// `meshes` belong to the folder above.
    Folder,
}

/// Treatment of meshes that are collision meshes according to their names.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CollisionMeshes {
    /// They are left out.
    #[default]
    Exclude,
    /// They are objects like others.
    Include,
}

config!(MeshFolder => dyn AssetSource, "mesh_folder", "root = \"${ASSETS}/gltf\"\nup = \"z\"");

impl AssetSource for MeshFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn states_units(&self) -> bool {
        false
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        let formats = MeshFormats::linked()?;
        self.files.catalog(
            &root,
            self.find(&root, &formats, log)?,
            &format!("file of the formats {}", formats.names("or")),
        )
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?.within(self.limits);
        let formats = MeshFormats::linked()?;
        let files = self.files.files(name, || self.find(&root, &formats, log))?.unwrap_or_default();
        let [file, others @ ..] = files.as_slice() else {
            return Err(Error::new(format!("no mesh `{name}`")).in_file(root.folder()));
        };
        let mut model = formats.read_upright(&root, file, self.up, log)?;
        for other in others {
            let part = formats.read_upright(&root, other, self.up, log)?;
            model = model.with(part, root.budget()).map_err(|error| error.in_file(root.folder().join(other)))?;
        }
        let category = category(name, root.folder());
        let info = ObjectInfo { name: name.to_owned(), category, license: String::new() };
        let (object, _) = model.into_object(info, &root.folder().join(file), log)?;
        with_keypoints(object, &root, file).map(Asset::from)
    }
}

impl MeshFolder {
    fn find(&self, root: &AssetRoot, formats: &MeshFormats, log: &dyn Log) -> Result<AssetFiles> {
        find(root, formats, self.one_object_per, self.collision_meshes, log)
    }
}

/// All meshes by name.
fn find(
    root: &AssetRoot,
    formats: &MeshFormats,
    unit: ObjectUnit,
    collision: CollisionMeshes,
    log: &dyn Log,
) -> Result<AssetFiles> {
    let mut meshes = by_stem(root, &formats.extensions(), log)?;
    leave_out_parts(&mut meshes, root, formats);
    // The first walk reported unsearched folders and names.
    let others = by_stem(root, &foreign::extensions(&formats.extensions()), &Collected::default())?;
    warn_of_foreign(&meshes, &others, formats, root, log);
    if collision == CollisionMeshes::Exclude {
        leave_out_collision_meshes(&mut meshes, &others, root, log)?;
    }
    let mut assets = AssetFiles::new();
    if unit == ObjectUnit::Folder {
        let mut objects: BTreeMap<PathBuf, Vec<&[PathBuf]>> = BTreeMap::new();
        for (folder, files) in object_folders(meshes.keys().map(PathBuf::as_path)).into_iter().zip(meshes.values()) {
            objects.entry(folder).or_default().push(files);
        }
        for (folder, parts) in &objects {
            let own = if *folder == Path::new("") { root_name(root.folder()).into() } else { folder.clone() };
            add_asset(&mut assets, &own, parts, root, log);
        }
        return Ok(assets);
    }
    let mut in_folder: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for stem in meshes.keys() {
        *in_folder.entry(stem.parent().unwrap_or(Path::new("")).to_owned()).or_default() += 1;
    }
    let short = |stem: &Path| match stem.parent() {
        Some(folder) if folder != Path::new("") && in_folder.get(folder) == Some(&1) => folder.to_owned(),
        _ => stem.to_owned(),
    };
    let mut names: Vec<PathBuf> = meshes.keys().map(|stem| short(stem)).collect();
    // If a short name is also the name of another mesh, both keep their whole path, which may in turn be the short name
    // of a third.
    loop {
        let mut uses: BTreeMap<&Path, usize> = BTreeMap::new();
        for name in &names {
            *uses.entry(name).or_default() += 1;
        }
        let shared: Vec<bool> = names.iter().map(|name| uses[name.as_path()] > 1).collect();
        if !shared.contains(&true) {
            break;
        }
        for ((name, stem), _) in names.iter_mut().zip(meshes.keys()).zip(shared).filter(|(_, shared)| *shared) {
            name.clone_from(stem);
        }
    }
    for (name, files) in names.iter().zip(meshes.values()) {
        add_asset(&mut assets, name, &[files], root, log);
    }
    Ok(assets)
}

/// Removes the meshes that other files are made of.
fn leave_out_parts(meshes: &mut BTreeMap<PathBuf, Vec<PathBuf>>, root: &AssetRoot, formats: &MeshFormats) {
    let parts = |file: &PathBuf| formats.of_file(file).map_or(Vec::new(), |format| (format.parts)(root, file));
    let parts: BTreeSet<PathBuf> = meshes.values().flatten().flat_map(parts).collect();
    meshes.retain(|_, files| {
        files.retain(|file| !parts.contains(file));
        !files.is_empty()
    });
}

syntable_model::register!(MeshFolder);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    #[test]
    fn names_are_short_and_unique() {
        let folder = tempfile::tempdir().expect("temp folder");
        for path in [
            "mug.obj",
            "mug/model.obj",
            "cup/a.obj",
            "cup/b.glb",
            "cup/b.stl",
            "x/y/z.ply",
            "x/notes.txt",
            "bowl/bowl.gltf",
            "duck/model.obj",
            "duck/model_collision_0.obj",
            "duck/Model-VHACD.obj",
            "duck/model_col2.stl",
            "jar/visual/jar.obj",
            "jar/collision/part.obj",
            "cola_can.obj",
            "collie.obj",
            "nest.obj",
            "nest/egg.obj",
            "nest/egg/yolk.obj",
        ] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
            std::fs::write(path, "x").expect("file");
        }
        let (root, log) = (AssetRoot::open(folder.path()).expect("opens"), Collected::default());
        let formats = MeshFormats::linked().expect("no clash");
        let found = find(&root, &formats, ObjectUnit::File, CollisionMeshes::Exclude, &log).expect("scans");
        let got: Vec<(&str, &str)> =
            found.iter().map(|(name, files)| (name.as_str(), files[0].to_str().expect("UTF-8"))).collect();
        let want = [
            ("bowl", "bowl/bowl.gltf"),
            ("cola_can", "cola_can.obj"),
            ("collie", "collie.obj"),
            ("cup/a", "cup/a.obj"),
            ("cup/b", "cup/b.glb"),
            ("duck", "duck/model.obj"),
            ("jar/visual", "jar/visual/jar.obj"),
            ("mug", "mug.obj"),
            ("mug/model", "mug/model.obj"),
            // `nest` is the short name of two meshes, and the path of one of them is the short name of a third.
            ("nest", "nest.obj"),
            ("nest/egg", "nest/egg.obj"),
            ("nest/egg/yolk", "nest/egg/yolk.obj"),
            ("x/y", "x/y/z.ply"),
        ];
        assert_eq!(got, want);
        let warnings: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        let said = "skipped 4 collision meshes: 3 next to a mesh of the same name without `col2`, `collision`, `vhacd`; \
                    1 in folders named `collision`";
        assert!(warnings[0].contains(said), "{warnings:?}");
        let named = "(`duck/Model-VHACD.obj`: next to a mesh without `vhacd`, `duck/model_col2.stl`: next to a mesh without \
                     `col2`, `duck/model_collision_0.obj`: next to a mesh without `collision`, `jar/collision/part.obj`: folder \
                     `collision`)";
        assert!(warnings[0].contains(named), "{warnings:?}");
        let all = find(&root, &formats, ObjectUnit::File, CollisionMeshes::Include, &log).expect("scans");
        assert!(all.contains_key("duck/Model-VHACD") && all.contains_key("jar/collision"), "{:?}", all.keys());
    }

    #[test]
    fn meshes_that_may_be_objects_are_named() {
        let folder = tempfile::tempdir().expect("temp folder");
        std::fs::create_dir_all(folder.path().join("brand/collision")).expect("folder");
        for file in ["mug.obj", "large_hadron_collider.obj", "brand/collision/game_box.obj"] {
            std::fs::write(folder.path().join(file), "x").expect("file");
        }
        for part in 0..9 {
            std::fs::write(folder.path().join(format!("mug_hull_{part}.obj")), "x").expect("file");
        }
        let (root, log) = (AssetRoot::open(folder.path()).expect("opens"), Collected::default());
        let formats = MeshFormats::linked().expect("no clash");
        assert_eq!(find(&root, &formats, ObjectUnit::File, CollisionMeshes::Exclude, &log).expect("scans").len(), 1);
        let warnings: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings[0].contains("`mug_hull_5.obj`: next to a mesh without `hull`, …)"), "{warnings:?}");
        let said = "skipped 2 meshes because of a word in the name, without a rendered mesh next to it; objects may be missing: \
                    `brand/collision/game_box.obj`: folder `collision`, `large_hadron_collider.obj`: word `collider`";
        assert!(warnings[1].contains(said), "{warnings:?}");
        assert!(warnings[1].contains("collision_meshes = \"include\""), "{warnings:?}");
    }

    #[test]
    fn a_pool_of_nothing_but_collision_meshes_says_so() {
        let folder = tempfile::tempdir().expect("temp folder");
        std::fs::create_dir(folder.path().join("coacd")).expect("folder");
        std::fs::write(folder.path().join("coacd/piece_0.obj"), "x").expect("file");
        let (root, log) = (AssetRoot::open(folder.path()).expect("opens"), Collected::default());
        let formats = MeshFormats::linked().expect("no clash");
        let error = find(&root, &formats, ObjectUnit::File, CollisionMeshes::Exclude, &log)
            .expect_err("nothing is left")
            .to_string();
        assert!(error.contains("only collision meshes: 1 in folders named `coacd`"), "{error}");
        assert!(error.contains("collision_meshes = \"include\""), "{error}");
        assert_eq!(find(&root, &formats, ObjectUnit::File, CollisionMeshes::Include, &log).expect("scans").len(), 1);
        // The rendered mesh is in an unsupported format.
        for file in ["mug.fbx", "mug_coll.obj"] {
            std::fs::write(folder.path().join(file), "x").expect("file");
        }
        let error = find(&root, &formats, ObjectUnit::File, CollisionMeshes::Exclude, &log)
            .expect_err("nothing is left")
            .to_string();
        assert!(error.contains("1 next to a mesh of the same name without `coll`"), "{error}");
    }
}
