//! Formats that hold meshes but that no linked crate may read, with the command that converts a file.

use crate::scan::extension;
use std::io::Read;
use std::path::Path;
use syntable_model::error::Error;
use syntable_model::mirror::DatasetFile;

/// A format: extensions of its files, its name, and the remedy.
type ForeignFormat = (&'static [&'static str], &'static str, &'static str);

const ASSIMP: &str = "convert it: `assimp export in.3ds out.obj`, or import it into Blender and export it as glTF";
const EDITOR: &str = "import it into Blender or MeshLab, and export it as glTF or PLY";
/// The extension that MJCF shares with other formats.
const XML: &str = "xml";
/// The element that MJCF begins with, and the number of bytes to look for it in.
const MUJOCO: (&[u8], u64) = (b"<mujoco", 4096);

const FORMATS: [ForeignFormat; 12] = [
    (
        &["usd", "usda", "usdc", "usdz"],
        "USD",
        "convert it: `pip install usd2gltf`, then `usd2gltf -i in.usd -o out.glb`",
    ),
    (&["fbx"], "FBX", "convert it: `assimp export in.fbx out.obj`, or import it into Blender and export it as glTF"),
    (
        &["blend"],
        "Blender",
        "convert it: `blender in.blend --background --python-expr \"import bpy; bpy.ops.export_scene.gltf(filepath='out.glb')\"`",
    ),
    (
        &["mjcf", XML],
        "MJCF",
        "convert it: `pip install mjcf-urdf-simple-converter`, then \
         `python -c \"import mjcf_urdf_simple_converter as m; m.convert('in.xml', 'out.urdf')\"`",
    ),
    (&["sdf", "xacro"], "SDF and xacro", "name the folder of its meshes as the `root` of a `mesh_folder`"),
    (&["dae"], "COLLADA", ASSIMP),
    (&["3ds", "ac", "amf", "lwo", "off", "x", "3mf"], "3DS, AMF, 3MF, OFF and similar", ASSIMP),
    (&["wrl", "x3d"], "VRML", EDITOR),
    (&["drc"], "bare Draco", "convert it: `draco_decoder -i in.drc -o out.ply`"),
    (&["msh", "vtk", "vtu"], "Gmsh and VTK", "convert it: `pip install meshio`, then `meshio convert in.msh out.ply`"),
    (&["step", "stp", "iges", "igs"], "CAD", "open it in FreeCAD, and export it as STL or glTF"),
    (&["ctm", "b3d", "ms3d", "md2", "md5mesh"], "old game engines", ASSIMP),
];

fn of_file(file: &Path, read: &[&str]) -> Option<&'static ForeignFormat> {
    let extension = extension(file);
    if read.contains(&extension.as_str()) || (extension == XML && !is_mjcf(file)) {
        return None;
    }
    FORMATS.iter().find(|(extensions, ..)| extensions.contains(&extension.as_str()))
}

fn is_mjcf(file: &Path) -> bool {
    let (element, length) = MUJOCO;
    let mut head = Vec::new();
    let read = DatasetFile::open(file).and_then(|file| file.take(length).read_to_end(&mut head));
    read.is_ok() && head.windows(element.len()).any(|window| window == element)
}

/// Extensions of meshes in formats to convert, without extensions that other files have, too. Linked crates `read` files with
/// some extensions.
pub fn extensions(read: &[&str]) -> Vec<&'static str> {
    let all = FORMATS.iter().flat_map(|(extensions, ..)| *extensions).copied();
    all.filter(|extension| *extension != XML && !read.contains(extension)).collect()
}

/// The error for a file of a format to convert, with the command that does it; `None` for any other file. Linked crates
/// `read` files with some extensions.
pub fn refusal(file: &Path, read: &[&str]) -> Option<Error> {
    let (_, name, remedy) = of_file(file, read)?;
    Some(Error::unsupported(format!("files of {name} are not read")).in_file(file).help(*remedy))
}
