//! Meshes from files at given poses.

use super::{place, placer, refused, table};
use std::path::Path;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::material::default_material;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::{Model, register_mesh_format};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, MassOrigin, MeshData, Motion, Role};

/// A format of the tests: a line of three edges of a box whose lowest corner is at the origin.
fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    log.warn(&Error::new("read once"));
    let text = String::from_utf8_lossy(&root.read(&path)?).into_owned();
    let edges: Vec<f32> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let [a, b, c] = edges[..] else { return Err(Error::new("no box").in_file(&path)) };
    let corner = |i: usize| [(i & 1) as f32 * a, (i >> 1 & 1) as f32 * b, (i >> 2 & 1) as f32 * c];
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mesh = MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
        ..MeshData::default()
    };
    Ok(Model { mesh, materials: vec![default_material(false)] })
}

register_mesh_format!(MeshFormat::new("box of edges", &["edges"], read));

/// A file of the format, and the option that names it.
fn file(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("shelf.edges");
    std::fs::write(&path, text).expect("written");
    let option = format!("path = {:?}\n", path.to_str().expect("UTF-8"));
    (folder, option)
}

fn body(scene: &SceneBuilder) -> &BodyDraft {
    let found = scene.bodies().find(|(_, body)| body.asset.pool == "mesh");
    found.expect("placed").1
}

/// Where the corner of the file at a position is in the world.
fn corner_at(body: &BodyDraft, corner: [f32; 3]) -> Point3<f64> {
    let positions = &body.object.mesh.data().positions;
    let found = positions.iter().find(|p| (0..3).all(|i| (p[i] - corner[i]).abs() < 1e-6));
    body.world_from_body * Point3::from(found.expect("a corner").map(f64::from))
}

#[test]
fn the_frame_of_the_file_is_at_the_pose() {
    let (_folder, path) = file("400 200 100");
    let at = "units = \"mm\"\nscale = 2.0\nposition_m = [1.0, 2.0, 0.5]\n";
    // Roll turns y to z, then yaw turns x to y: the edges along x, y and z point to y, z and x.
    let euler = placer("mesh", &format!("{path}{at}rotation_deg = [90, 0, 90]"));
    let quaternion = placer("mesh", &format!("{path}{at}quaternion_wxyz = [0.5, 0.5, 0.5, 0.5]"));
    for placer in [euler, quaternion] {
        let (scene, warnings) = place(&[&*placer, &*placer], 3).expect("placed");
        assert_eq!(warnings.len(), 1, "the file is read once: {warnings:?}");
        let body = body(&scene);
        for (corner, offset) in [([0.8, 0.0, 0.0], [0.0, 0.8, 0.0]), ([0.0, 0.4, 0.2], [0.2, 0.0, 0.4])] {
            let want = Point3::new(1.0, 2.0, 0.5) + Vector3::from(offset);
            assert!((corner_at(body, corner) - want).norm() < 1e-6, "{corner:?}: {}", corner_at(body, corner));
        }
        assert_eq!(
            (body.role, body.motion, body.asset.to_string().as_str()),
            (Role::Fixture, Motion::Fixed, "mesh/shelf")
        );
        // 0.8 m × 0.4 m × 0.2 m at 400 kg/m³, more than the largest estimate.
        assert_eq!((body.mass.kg, body.mass.origin), (20.0, MassOrigin::Estimated));
    }
    let small = placer("mesh", &format!("{path}units = \"mm\"\nscale = 0.5\nup = \"y\""));
    let (scene, _) = place(&[&*small], 3).expect("placed");
    // (x, y, z) of a file with y up is (x, −z, y).
    for corner in [[0.2, 0.0, 0.1], [0.0, -0.05, 0.0]] {
        let at = corner_at(body(&scene), corner);
        assert!((at - Point3::from(corner.map(f64::from))).norm() < 1e-6, "{corner:?}: {at}");
    }
    assert!((body(&scene).mass.kg - 400.0 * 0.2 * 0.1 * 0.05).abs() < 1e-6, "{:?}", body(&scene).mass);
}

#[test]
fn positions_count_from_a_support_and_vary() {
    let (_folder, path) = file("0.1 0.1 0.1");
    let on_table =
        placer("mesh", &format!("{path}relative_to = \"table\"\nposition_m = [{{ uniform = [0.1, 0.3] }}, 0, 0]"));
    let mut seen = Vec::new();
    for seed in 0..20 {
        let (scene, _) = place(&[&*table(), &*on_table], seed).expect("placed");
        let at = body(&scene).world_from_body.translation.vector;
        assert!((0.1..0.3).contains(&at.x) && at.y == 0.0 && (at.z - 0.75).abs() < 1e-6, "{at}");
        seen.push(at.x);
    }
    seen.sort_by(f64::total_cmp);
    assert!(seen[0] < 0.15 && seen[19] > 0.25, "{seen:?}");
    assert_eq!(on_table.parts(), Some(vec![PartUse::Needs(Part::Support("table".into()))]));
    assert!(!on_table.places_objects() && on_table.own_objects().is_empty());
}

#[test]
fn supports_are_level_areas_of_the_bounding_box() {
    let (_folder, path) = file("0.8 0.3 1.8");
    let supports = "supports = [{ name = \"board\", height_m = 0.6, clear_height_m = 0.5 }, { name = \"top\" }]";
    let shelf = placer("mesh", &format!("{path}position_m = [1.0, 0.0, 0.1]\nrotation_deg = [0, 0, 90]\n{supports}"));
    let (scene, _) = place(&[&*shelf], 1).expect("placed");
    let found: Vec<_> = scene.supports.iter().collect();
    // The edge along x points to y: the box is at x from 0.7 to 1.0, y from 0 to 0.8.
    for (support, height, top) in [(found[0], 0.7, Some(1.2)), (found[1], 1.9, None)] {
        let ([w, l], center) = (support.surface.size(), support.center());
        assert!((w - 0.3).abs() < 1e-6 && (l - 0.8).abs() < 1e-6, "{support:?}");
        assert!((center - Point3::new(0.85, 0.4, height)).norm() < 1e-6, "{support:?}");
        assert_eq!(support.top().map(|top| (top * 1e4).round()), top.map(|top: f64| (top * 1e4).round()));
    }
    assert_eq!(body(&scene).role, Role::Support);
    let names = ["board", "top"].map(|name| PartUse::Sets(Part::Support(name.into())));
    assert_eq!(shelf.parts(), Some(names.to_vec()));
    let high = placer("mesh", &format!("{path}supports = [{{ name = \"top\", height_m = 1.9 }}]"));
    let error = place(&[&*high], 1).map(|_| ()).expect_err("above the mesh");
    assert!(error.is_permanent() && error.message().contains("which is 1.800 m high"), "{error}");
}

#[test]
fn an_object_has_its_label_and_falls_on_its_support() {
    let (_folder, path) = file("0.1 0.1 0.1");
    let options = "role = \"object\"\ncategory = \"box\"\nobj_id = 7\nname = \"crate\"\nmotion = \"dynamic\"\nmass_kg = 0.3\nfriction = 0.9";
    let object = placer("mesh", &format!("{path}{options}"));
    let (scene, _) = place(&[&*table(), &*object], 1).expect("placed");
    let (handle, body) = scene.bodies().last().expect("placed");
    assert_eq!((body.role, body.motion, body.mass.kg, body.friction), (Role::Object, Motion::Dynamic, 0.3, 0.9));
    assert_eq!((body.object.category.as_str(), body.object.model.obj_id), ("box", Some(7)));
    assert_eq!(scene.drop_zone(handle).map(|zone| zone.support.name.to_string()).as_deref(), Some("table"));
    let own = object.own_objects();
    assert!(object.places_objects() && own.len() == 1 && own[0].obj_id == Some(7), "{own:?}");
    assert_eq!((own[0].name.as_str(), own[0].category.as_str()), ("crate", "box"));
}

#[test]
fn contradictions_and_broken_files_are_refused() {
    let (_folder, path) = file("0.1 0.1");
    for (options, wants) in [
        ("quaternion_wxyz = [1, 1, 0, 0]", "length 1.4142"),
        ("quaternion_wxyz = [1, 0, 0, 0]\nrotation_deg = [0, 0, 1]", "states the rotation already"),
        ("category = \"box\"", "role = \\\"object\\\""),
        ("obj_id = 3\nrole = \"distractor\"", "`obj_id` is for labels"),
        ("supports = [{ name = \"top\" }]\nmotion = \"dynamic\"", "stays where it is"),
        ("position_m = [0, 0, 1001]", "1001"),
        ("rotation_deg = [0, 0]", "rotation_deg"),
    ] {
        let error = refused("mesh", &format!("{path}{options}"));
        assert!(error.contains(wants), "{options}: {error}");
    }
    let error = place(&[&*placer("mesh", &path)], 1).map(|_| ()).expect_err("no box");
    assert!(error.is_permanent() && error.to_string().contains("shelf.edges"), "{error}");
    let (_folder, path) = file("400 200 100");
    let error = place(&[&*placer("mesh", &path)], 1).map(|_| ()).expect_err("400 m long").to_string();
    assert!(error.contains("400.000 m is outside") && error.contains("shelf.edges"), "{error}");
    let error = place(&[&*placer("mesh", "path = \"/no/such/arm.obj\"")], 1).map(|_| ()).expect_err("no file");
    assert!(error.to_string().contains("/no/such"), "{error}");
}
