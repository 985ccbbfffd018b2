//! Files that place several meshes: URDF, COLLADA, and folders whose meshes are one object.

use crate::common::{look, source_of};
use crate::inputs::*;
use std::path::Path;
use syntable_model::context::Collected;
use syntable_model::scene::{Alpha, Object};
use tempfile::TempDir;

fn load_from(root: &Path, name: &str, more: &str) -> (Object, Vec<String>) {
    let log = Collected::default();
    let asset = source_of("mesh_folder", root, more).load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    let object = std::sync::Arc::unwrap_or_clone(asset.into_object().expect("an object"));
    (object, log.warnings().iter().map(ToString::to_string).collect())
}

fn names(root: &Path, more: &str) -> Vec<String> {
    let catalog = source_of("mesh_folder", root, more).catalog(&Collected::default()).expect("a catalog");
    catalog.entries.into_iter().map(|entry| entry.name).collect()
}

/// Smallest and largest corner, millimeters.
fn box_mm(object: &Object) -> [[f64; 3]; 2] {
    let bounds = object.mesh.bounds();
    [bounds.min, bounds.max].map(|p| [p.x, p.y, p.z].map(|x| (x * 1e6).round() / 1e3))
}

/// A link with a visual part.
fn link(name: &str, origin: &str, geometry: &str, more: &str) -> String {
    format!("<link name=\"{name}\"><visual>{origin}<geometry>{geometry}</geometry>{more}</visual></link>\n")
}

#[test]
fn urdf_places_the_shapes_of_its_links() {
    let folder = TempDir::new().expect("temp folder");
    let colors = "<material name=\"red\"><color rgba=\"1 0 0 1\"/></material>";
    // A box on its side; a cylinder on it, along x after the joint turns it; a sphere that sees through.
    let robot = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"it\">{colors}\n{}{}{}\
         <joint name=\"a\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/><origin xyz=\"0 0 0.1\" rpy=\"0 1.5707963267948966 0\"/></joint>\
         <joint name=\"b\" type=\"fixed\"><parent link=\"arm\"/><child link=\"tip\"/><origin xyz=\"-0.1 0 0\"/></joint></robot>",
        link(
            "base",
            "<origin xyz=\"0 0 0.05\" rpy=\"1.5707963267948966 0 0\"/>",
            "<box size=\"0.2 0.1 0.04\"/>",
            "<material name=\"red\"/>"
        ),
        link("arm", "", "<cylinder radius=\"0.02\" length=\"0.1\"/>", ""),
        link("tip", "", "<sphere radius=\"0.03\"/>", "<material name=\"x\"><color rgba=\"0 0 1 0.5\"/></material>"),
    );
    write(folder.path(), "it.urdf", &robot);
    let (object, warnings) = load_from(folder.path(), "it", "");
    assert_eq!(warnings, Vec::<String>::new());
    // The tip is 10 cm along the arm's x, which points down after the turn: 20 cm above the floor.
    assert_eq!(box_mm(&object), [[-100.0, -30.0, 0.0], [100.0, 30.0, 230.0]]);
    let pi = std::f64::consts::PI;
    let volume = 0.2 * 0.1 * 0.04 + pi * 0.02_f64.powi(2) * 0.1 + 4.0 / 3.0 * pi * 0.03_f64.powi(3);
    let found = object.mesh.signed_volume();
    assert!((0.98..1.0).contains(&(found / volume)), "{}", found / volume);
    let colors: Vec<[f32; 3]> = object.materials.iter().map(|material| material.base_color.factor).collect();
    assert_eq!(colors, [[1.0, 0.0, 0.0], [0.6; 3], [0.0, 0.0, 1.0]]);
    assert_eq!(object.materials[2].alpha, Alpha::Blend { factor: 0.5 });

    for (old, new, says) in [
        (
            "</robot>",
            "<joint name=\"c\"><parent link=\"tip\"/><child link=\"base\"/></joint></robot>",
            "no link is the root",
        ),
        ("child link=\"tip\"", "child link=\"arm\"", "joint `b`: the link `arm` has two parents"),
        ("parent link=\"arm\"", "parent link=\"leg\"", "joint `b` names the missing link `leg`"),
        ("0.2 0.1 0.04", "0.2 0.1", "it.urdf:3: link `base`: `size` = `0.2 0.1` is not 3 numbers"),
        ("radius=\"0.02\"", "", "link `arm`: a shape without `radius`"),
        ("<robot name=\"it\">", "<robot name=\"it\"><b>", "it.urdf:6: invalid XML"),
        ("robot", "model", "the document is `<model>`, not `<robot>`"),
        ("visual", "inertial", "no link has a mesh or a shape"),
    ] {
        write(folder.path(), "it.urdf", robot.replace(old, new));
        check(folder.path(), "it.urdf", says, &Reject(says));
    }
    write(folder.path(), "it.urdf", robot.replace("visual", "collision"));
    check(
        folder.path(),
        "it.urdf",
        "collision",
        &Warn("no link has a visual part; the object takes its collision parts"),
    );
}

#[test]
fn the_meshes_of_a_urdf_are_its_parts() {
    let folder = TempDir::new().expect("temp folder");
    let mesh = |file: &str| format!("<mesh filename=\"{file}\" scale=\"0.5 0.5 -0.5\"/>");
    let robot = format!(
        "<robot name=\"it\">{}{}<link name=\"c\"><collision><geometry><mesh filename=\"package://shop/meshes/hull.stl\"/></geometry></collision></link></robot>",
        link("a", "", &mesh("package://shop/meshes/skin.obj"), ""),
        link(
            "b",
            "<origin xyz=\"0.2 0 0\"/>",
            &mesh("../meshes/bare.stl"),
            "<material name=\"g\"><color rgba=\"0 1 0 1\"/></material>"
        ),
    );
    write(folder.path(), "shop/urdf/it.urdf", &robot);
    write(folder.path(), "shop/meshes/skin.obj", obj(1.0));
    write(folder.path(), "shop/meshes/model.mtl", "newmtl skin\nKd 0 0 1\n");
    write(folder.path(), "shop/meshes/bare.stl", stl(true));
    write(folder.path(), "shop/meshes/hull.stl", stl(true));
    write(folder.path(), "shop/meshes/other.obj", obj(1.0));
    assert_eq!(names(folder.path(), ""), ["shop/meshes", "shop/urdf"]);
    let (object, warnings) = load_from(folder.path(), "shop/urdf", "");
    assert_eq!(warnings, Vec::<String>::new());
    // The mirrored boxes keep their outside: 30 x 40 x 50 mm each, upside down.
    assert_eq!(box_mm(&object), [[-15.0, -20.0, -50.0], [215.0, 20.0, 0.0]]);
    assert!((object.mesh.signed_volume() - 2.0 * 0.03 * 0.04 * 0.05).abs() < 1e-9);
    let colors: Vec<[f32; 3]> = object.materials.iter().map(|material| material.base_color.factor).collect();
    assert_eq!(colors, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    assert!(look(&folder.path().join("shop/urdf/it.urdf")).0.is_ok());
    std::fs::remove_file(folder.path().join("shop/meshes/bare.stl")).expect("there");
    let (_, warnings) = load_from(folder.path(), "shop/urdf", "");
    assert!(
        warnings[0].contains("the mesh `../meshes/bare.stl` is missing; its part of the object is left out"),
        "{warnings:?}"
    );
}

#[test]
fn collada_follows_its_nodes_units_and_materials() {
    let folder = TempDir::new().expect("temp folder");
    let positions: Vec<String> = CORNERS.iter().flatten().map(|x| (x * 100.0).to_string()).collect();
    let corners: Vec<String> = QUADS.iter().flatten().enumerate().map(|(i, v)| format!("{v} {}", i % 4)).collect();
    let dae = |up: &str, matrix: &str| {
        format!(
            r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>{up}</up_axis></asset>
<library_images><image id="img"><init_from>file:///home/me/texture.png</init_from></image></library_images>
<library_effects>
<effect id="fx"><profile_COMMON><newparam sid="surf"><surface type="2D"><init_from>img</init_from></surface></newparam>
<newparam sid="samp"><sampler2D><source>surf</source></sampler2D></newparam>
<technique sid="t"><phong><diffuse><texture texture="samp" texcoord="UV"/></diffuse></phong></technique></profile_COMMON></effect>
<effect id="glass"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 0.5 1 1</color></diffuse>
<transparent opaque="A_ONE"><color>1 1 1 1</color></transparent><transparency><float>0.75</float></transparency></lambert></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="m1"><instance_effect url="#fx"/></material><material id="m2"><instance_effect url="#glass"/></material></library_materials>
<library_geometries><geometry id="box"><mesh>
<source id="p"><float_array id="pa" count="24">{positions}</float_array><technique_common><accessor source="#pa" count="8" stride="3"/></technique_common></source>
<source id="t"><float_array id="ta" count="8">0 0 1 0 1 1 0 1</float_array><technique_common><accessor source="#ta" count="4" stride="2"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist material="skin" count="6"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="TEXCOORD" source="#t" offset="1" set="0"/>
<vcount>4 4 4 4 4 4</vcount><p>{corners}</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node id="s"><matrix>{matrix}</matrix><instance_geometry url="#box"><bind_material><technique_common><instance_material symbol="skin" target="#m1"/></technique_common></bind_material></instance_geometry>
<node><translate>20 0 0</translate><rotate>0 0 1 90</rotate><scale>1 1 2</scale><instance_geometry url="#box"><bind_material><technique_common><instance_material symbol="skin" target="#m2"/></technique_common></bind_material></instance_geometry></node>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##,
            positions = positions.join(" "),
            corners = corners.join(" "),
        )
    };
    let unit = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
    write(folder.path(), "it.dae", dae("Z_UP", unit));
    write(folder.path(), "texture.png", png());
    let (object, warnings) = load_from(folder.path(), "it", "");
    assert!(warnings.len() == 1 && warnings[0].contains("reading `texture.png`"), "{warnings:?}");
    // 60 x 80 x 100 mm; the other lies 20 cm aside, turned by a quarter and twice as high.
    assert_eq!(box_mm(&object), [[-30.0, -40.0, 0.0], [240.0, 40.0, 200.0]]);
    assert!((object.mesh.signed_volume() - 3.0 * 0.06 * 0.08 * 0.1).abs() < 1e-9);
    assert_eq!(object.materials[0].base_color.texture.as_ref().expect("a texture").texture.width, 8);
    assert_eq!(object.materials[1].base_color.factor, [0.0, 0.5, 1.0]);
    assert_eq!(object.materials[1].alpha, Alpha::Blend { factor: 0.75 });
    let uvs = &object.mesh.data().uvs;
    assert!(uvs.contains(&[1.0, 1.0]) && uvs.contains(&[0.0, 0.0]));
    // y up: the height is along -y before, so that (x, y, z) becomes (x, -z, y).
    write(folder.path(), "it.dae", dae("Y_UP", unit));
    assert_eq!(box_mm(&load_from(folder.path(), "it", "").0), [[-30.0, -200.0, -40.0], [240.0, 0.0, 40.0]]);
    // A matrix by rows that mirrors and moves; the faces keep their outside.
    write(folder.path(), "it.dae", dae("Z_UP", "-1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1"));
    let (mirrored, _) = load_from(folder.path(), "it", "");
    assert_eq!(box_mm(&mirrored), [[-190.0, -40.0, 0.0], [80.0, 40.0, 200.0]]);
    assert!((mirrored.mesh.signed_volume() - 3.0 * 0.06 * 0.08 * 0.1).abs() < 1e-9);
    let mut utf_16 = vec![0xff, 0xfe];
    utf_16.extend(dae("Z_UP", unit).encode_utf16().flat_map(u16::to_le_bytes));
    for bytes in [utf_16, format!("\u{feff}\n{}", dae("Z_UP", unit)).into_bytes()] {
        write(folder.path(), "it.dae", bytes);
        assert_eq!(load_from(folder.path(), "it", "").0.digest, object.digest);
    }
    for (old, new, says) in [
        ("<vcount>4", "<vcount>9999", "a polygon has corners beyond the list of indices"),
        ("<translate>20", "<translate>twenty", "it.dae:21: `twenty` in `<translate>` is not a number"),
        ("<p>0 0", "<p>99 0", "geometry `box`: vertex index 99 is beyond the positions"),
        ("<p>0 0", "<p>0 -1", "`-1` in `<p>` is not an index"),
        ("<node><translate>", "<node id=\"n\"><instance_node url=\"#n\"/><translate>", "insert each other in a circle"),
        ("<instance_geometry url=\"#box\">", "<instance_geometry url=\"#none\">", "no faces"),
        ("</COLLADA>", "", "invalid XML"),
    ] {
        write(folder.path(), "it.dae", dae("Z_UP", unit).replace(old, new));
        check(folder.path(), "it.dae", says, &Reject(says));
    }
}

#[test]
fn a_folder_may_be_one_object() {
    let folder = TempDir::new().expect("temp folder");
    for (file, scale) in [("cabinet/visual/body.obj", 0.5), ("cabinet/visual/door.obj", 1.5), ("mug/mug.obj", 1.0)] {
        write(folder.path(), file, obj(scale));
        write(
            folder.path(),
            &file.replace(file.rsplit('/').next().expect("a name"), "model.mtl"),
            "newmtl skin\nKd 1 0 0\n",
        );
    }
    write(folder.path(), "cabinet/collision/hull.obj", obj(3.0));
    write(folder.path(), "cabinet/door.stl", stl(true));
    assert_eq!(names(folder.path(), ""), ["cabinet", "cabinet/visual/body", "cabinet/visual/door", "mug"]);
    let more = "one_object_per = \"folder\"";
    assert_eq!(names(folder.path(), more), ["cabinet", "mug"]);
    let (object, _) = load_from(folder.path(), "cabinet", more);
    assert_eq!(box_mm(&object), [[-45.0, -60.0, 0.0], [45.0, 60.0, 150.0]]);
    let solid = 0.06 * 0.08 * 0.1;
    assert!((object.mesh.signed_volume() - solid * (0.5_f64.powi(3) + 1.5_f64.powi(3) + 1.0)).abs() < 1e-9);
    assert_eq!(object.materials.len(), 3);
    // A folder of one mesh is the same object in both ways.
    let digest = |more| load_from(folder.path(), "mug", more).0.digest;
    assert_eq!(digest(more), digest(""));
    // The parts share the limits of one asset.
    let log = Collected::default();
    let mut source = source_of("mesh_folder", folder.path(), more);
    source.limit(syntable_model::stage::AssetLimits { triangles: 30, ..Default::default() });
    let error = source.load("cabinet", &log).expect_err("36 triangles").to_string();
    assert!(error.contains("limit of 30 triangles"), "{error}");
}

#[test]
fn formats_that_are_not_read_name_a_converter() {
    let folder = TempDir::new().expect("temp folder");
    for (file, says) in [
        (
            "it.usdz",
            "files of USD are not read (convert it: `pip install usd2gltf`, then `usd2gltf -i in.usd -o out.glb`",
        ),
        ("it.FBX", "`assimp export in.fbx out.obj`"),
        ("it.blend", "bpy.ops.export_scene.gltf"),
        ("it.xml", "files of MJCF are not read (convert it: `pip install mjcf-urdf-simple-converter`"),
        ("it.sdf", "name the folder of its meshes"),
    ] {
        write(folder.path(), file, "<mujoco model=\"it\"/>");
        check(folder.path(), file, file, &Reject(says));
    }
    write(folder.path(), "other.xml", "<a/>");
    check(folder.path(), "other.xml", "XML", &Reject("no known kind of asset"));
    // A pool names such files that no mesh replaces.
    write(folder.path(), "it.obj", obj(1.0));
    write(folder.path(), "more.fbx", "x");
    let log = Collected::default();
    source_of("mesh_folder", folder.path(), "").catalog(&log).expect("one mesh");
    let said: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
    assert!(
        said.len() == 1 && said[0].contains("more.fbx: files of FBX are not read; the file is no object of the pool"),
        "{said:?}"
    );
}

#[test]
fn folders_of_other_collections_name_their_kind() {
    let folder = TempDir::new().expect("temp folder");
    gso(folder.path(), "gso/a");
    write(folder.path(), "ycb/b/google_16k/textured.obj", obj(1.0));
    write(folder.path(), "bop/set/models/obj_000001.ply", ply_ascii());
    write(folder.path(), "none/x/y.txt", "x");
    for (kind, root, says) in [
        ("ycb", "gso", "`kind = \"google_scanned_objects\"`"),
        ("ycb", "bop", "`kind = \"bop_models\"`"),
        ("google_scanned_objects", "ycb", "`kind = \"ycb\"`"),
        ("google_scanned_objects", "none", "check `root`"),
    ] {
        let error = source_of(kind, &folder.path().join(root), "").catalog(&Collected::default()).expect_err(says);
        assert!(error.to_string().contains(says), "{kind} {root}: {error}");
    }
}
