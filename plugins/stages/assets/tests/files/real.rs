//! Real collections, compared with the figures of their index, which other programs (trimesh, Pillow) computed.

use crate::common::{fact, look, roots, source_of};
use std::path::Path;
use syntable_mesh::size::{self, StatedLengths};
use syntable_model::context::Collected;
use syntable_model::scene::{Alpha, MassOrigin, Object, Topology, Volume};
use syntable_model::stage::AssetSource;

/// Rows of the table below a heading of the index, with trimmed cells, without its header.
fn table(root: &Path, heading: &str) -> Vec<Vec<String>> {
    let index = std::fs::read_to_string(root.join("INDEX.md")).expect("an index");
    let (_, section) = index.split_once(&format!("\n## {heading}\n")).expect("a heading");
    let rows = section.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let cells = |row: &str| row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    let rows: Vec<Vec<String>> = rows.skip(2).map(cells).collect();
    assert!(!rows.is_empty(), "{heading}");
    rows
}

fn numbers(cell: &str) -> Vec<f64> {
    cell.split(',').map(|number| number.trim().parse().expect(cell)).collect()
}

fn load(source: &dyn AssetSource, name: &str) -> (Object, Vec<String>) {
    let log = Collected::default();
    let asset = source.load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    let warnings: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
    for warning in &warnings {
        println!("{warning}");
    }
    (std::sync::Arc::unwrap_or_clone(asset.into_object().expect("an object")), warnings)
}

/// Compares sizes, each within half a step of the index's last digit.
fn check_size(name: &str, object: &Object, want: &[f64], step: f64) {
    let size = object.mesh.bounds().size();
    for (axis, want) in want.iter().enumerate() {
        assert!((size[axis] - want).abs() <= step, "{name}: size {size:?}, index {want} on axis {axis}");
    }
}

/// Compares an object with a row: size, lowest point, triangles, closed, parts, volume.
fn check_row(row: &[String], object: &Object, warnings: &[String]) {
    let name = &row[0];
    check_size(name, object, &numbers(&row[1]), 0.000_51);
    let lowest: f64 = row[2].parse().expect("a number");
    assert!((object.mesh.bounds().min.z - lowest).abs() < 0.000_51, "{name}: lowest {:?}", object.mesh.bounds().min);
    let dropped: usize = warnings
        .iter()
        .filter(|warning| warning.contains("were dropped"))
        .map(|warning| warning.split_whitespace().find_map(|word| word.parse::<usize>().ok()).expect("a count"))
        .sum();
    let triangles = object.mesh.data().triangles.len() + dropped;
    assert_eq!(triangles.to_string(), row[3], "{name}: triangles and dropped ones; {warnings:?}");
    let topology = Topology::of(&object.mesh);
    assert_eq!(topology.is_closed(), row[6] == "yes", "{name}: closed; {topology:?}");
    let parts = row[7].split_once('(').expect("two numbers").1.trim_end_matches(')');
    assert_eq!(topology.significant_parts().to_string(), parts, "{name}: parts");
    let liters: f64 = row[8].parse().expect("a number");
    if topology.is_closed() {
        let volume = topology.solid_volume() * 1e3;
        assert!((volume - liters).abs() < 0.000_51 + 1e-3 * liters, "{name}: volume {volume}, index {liters}");
    }
    assert!(object.mass.kg > 0.0 && object.mass.kg <= 20.0, "{name}");
    assert!(!object.mesh.data().uvs.is_empty(), "{name} has texture coordinates");
    let texture = object.materials[0].base_color.texture.as_ref().expect("a texture");
    assert_eq!(
        format!("{}x{}", texture.texture.width, texture.texture.height),
        row[5].rsplit(' ').next().expect("a size")
    );
}

fn check_collection(root: &Path, kind: &str, folder: &str) {
    let rows = table(root, folder);
    let source = source_of(kind, &root.join(folder), "");
    let catalog = source.catalog(&Collected::default()).expect("a catalog");
    let mut names: Vec<&str> = rows.iter().map(|row| row[0].as_str()).collect();
    names.sort_unstable();
    assert_eq!(catalog.entries.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>(), names);
    for row in &rows {
        let (object, warnings) = load(&*source, &row[0]);
        check_row(row, &object, &warnings);
        assert_eq!(object.license, "CC-BY-4.0");
        size::check(object.mesh.bounds().size().max(), StatedLengths::default()).expect("a size that makes sense");
    }
}

#[test]
fn google_scanned_objects_agree_with_the_index() {
    for root in roots() {
        check_collection(&root, "google_scanned_objects", "gso");
    }
}

#[test]
fn ycb_objects_agree_with_the_index() {
    for root in roots() {
        check_collection(&root, "ycb", "ycb");
        let catalog = source_of("ycb", &root.join("ycb"), "").catalog(&Collected::default()).expect("a catalog");
        assert_eq!(catalog.entries[0].category, "cracker_box");
        let (carton, _) = load(&*source_of("ycb", &root.join("ycb"), ""), "003_cracker_box");
        assert_eq!((carton.mass.kg, carton.mass.origin), (0.411, MassOrigin::Known), "as published");
        // A full box of 72 x 164 x 213 mm has its center in the middle, and m/12 (a² + b²) along the longest side.
        let middle = carton.mesh.bounds().center();
        assert!((carton.mass.center - middle).norm() < 0.004, "{:?} {middle}", carton.mass);
        let wanted = 0.411 / 12.0 * (0.072_f64.powi(2) + 0.164_f64.powi(2));
        assert!((carton.mass.inertia()[(2, 2)] / wanted - 1.0).abs() < 0.15, "{:?}, not {wanted}", carton.mass);
    }
}

#[test]
fn tables_agree_with_the_index() {
    for root in roots() {
        let rows = table(&root, "tables (OBJ)");
        let source = source_of("mesh_folder", &root.join("tables"), "");
        let catalog = source.catalog(&Collected::default()).expect("a catalog");
        let names: Vec<&str> = catalog.entries.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(names, ["aws_CoffeeTable_01", "aws_KitchenTable_01", "table_wide", "wooden_table_02"]);
        for row in &rows {
            let (object, warnings) = load(&*source, &row[0]);
            check_row(row, &object, &warnings);
        }
    }
}

#[test]
fn gltf_files_agree_with_the_index() {
    for root in roots() {
        let rows = table(&root, "tables and objects in glTF");
        for row in &rows {
            let (kind, path) = row[0].split_once('/').expect("a folder");
            let source = source_of("mesh_folder", &root.join(kind), "");
            let name = path.split('/').next().expect("a folder");
            let (object, warnings) = load(&*source, name);
            // The index keeps the scene's axes, y up; ours are z up. It counts before cleaning.
            let [x, y, z] = numbers(&row[1])[..] else { panic!("{row:?}") };
            for (axis, want) in [x, z, y].into_iter().enumerate() {
                let got = object.mesh.bounds().size()[axis];
                assert!((got - want).abs() < 6e-4 * want, "{name}: {got} for {want} on axis {axis}");
            }
            let dropped: usize = warnings
                .iter()
                .filter(|warning| warning.contains("were dropped"))
                .filter_map(|warning| warning.split_whitespace().find_map(|word| word.parse::<usize>().ok()))
                .sum();
            let triangles = object.mesh.data().triangles.len() + dropped;
            assert_eq!(triangles.to_string(), row[2], "{name}: {warnings:?}");
            let extensions: Vec<&str> =
                row[5].split([' ', ',', ';']).filter(|word| word.starts_with("KHR_materials")).collect();
            for extension in extensions {
                assert!(
                    !warnings.iter().any(|warning| warning.contains(extension)),
                    "{name}: {extension} is read: {warnings:?}"
                );
            }
            let images: usize = row[6].parse().expect("a count");
            let textured = object.materials.iter().any(|material| material.base_color.texture.is_some());
            assert_eq!(textured, images > 0, "{name}");
        }
    }
}

#[test]
fn gltf_materials_match_the_file() {
    for root in roots() {
        let source = source_of("mesh_folder", &root.join("gltf"), "");
        let (car, _) = load(&*source, "ToyCar");
        let named = |name: &str| car.materials.iter().find(|material| material.name == name).expect(name);
        let fabric = named("Fabric");
        let normal = fabric.normal.as_ref().expect("a normal map");
        assert_eq!(normal.map.transform.scale, [3.0, 3.0]);
        let color = fabric.base_color.texture.as_ref().expect("a texture");
        assert_eq!((color.transform.scale, fabric.base_color.factor), ([3.0, 3.0], [0.15; 3]));
        assert!(named("ToyCar").emission.texture.is_some());
        assert_eq!((named("Glass").base_color.factor, named("Glass").roughness.factor), ([0.3, 0.8, 0.3], 0.0));
        let glass = named("Glass").transmission.as_ref().expect("glass");
        assert_eq!((glass.fraction.factor, glass.volume), (1.0, None));
        let sheen = fabric.sheen.as_ref().expect("sheen");
        assert_eq!((sheen.color.factor, sheen.roughness.factor), ([1.0, 0.0, 0.0], 0.5));
        let coat = named("ToyCar").clearcoat.as_ref().expect("clearcoat");
        assert_eq!((coat.strength.factor, coat.roughness.factor), (1.0, 0.0));
        assert_eq!(coat.strength.texture.as_ref().map(|(_, channel)| *channel), Some(0));
        let (wicker, _) = load(&*source, "ClearcoatWicker");
        let coat = wicker.materials[0].clearcoat.as_ref().expect("clearcoat");
        assert!(coat.normal.is_some() && coat.roughness.factor == 0.1);
        let (holder, _) = load(&*source, "GlassHurricaneCandleHolder");
        let volumes: Vec<_> =
            holder.materials.iter().filter_map(|material| material.transmission.as_ref()?.volume).collect();
        assert_eq!(volumes, [Volume { attenuation_color: [0.8, 0.95, 1.0], attenuation_distance_m: 0.001 }]);
        let (vase, _) = load(&*source, "GlassVaseFlowers");
        let blended = vase.materials.iter().find(|material| material.name == "GlassAlpha").expect("blended glass");
        assert_eq!(blended.alpha, Alpha::Blend { factor: 0.3 });
        let clear = vase.materials.iter().find_map(|material| material.transmission.as_ref()?.volume).expect("glass");
        assert_eq!(clear.attenuation_distance_m, f32::INFINITY);
        let (spheres, _) = load(&*source, "MetalRoughSpheresNoTextures");
        let second = spheres.materials.iter().find(|material| material.name == "mat_1").expect("a material");
        assert!((second.roughness.factor - 1.0 / 6.0).abs() < 1e-6);
    }
}

#[test]
fn bop_models_agree_with_the_index() {
    for root in roots() {
        let rows = table(&root, "bop");
        let root = root.join("bop");
        let source = source_of("bop_models", &root, "");
        let catalog = source.catalog(&Collected::default()).expect("a catalog");
        let names: Vec<&str> = catalog.entries.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(names, ["lmo/obj_000005", "ycbv/obj_000001", "ycbv/obj_000002"]);
        for row in &rows {
            let name = row[0].trim_start_matches("bop/").replace("/models/", "/").replace(".ply", "");
            let (object, warnings) = load(&*source, &name);
            // The scan of LM-O has a few inverted faces.
            let turned =
                name.starts_with("lmo") && warnings.iter().all(|warning| warning.contains("oriented inconsistently"));
            assert!(warnings.is_empty() || turned, "{name}: {warnings:?}");
            let millimeters: Vec<f64> = numbers(&row[1]).iter().map(|x| x * 1e-3).collect();
            check_size(&name, &object, &millimeters, 0.000_051);
            assert_eq!(object.mesh.data().triangles.len().to_string(), row[2], "{name}");
            assert_eq!(Topology::of(&object.mesh).is_closed(), row[5] == "yes", "{name}");
            assert_eq!(row[4].starts_with("red"), !object.mesh.data().colors.is_empty(), "{name}");
            assert_eq!(row[4].starts_with("texture"), object.materials[0].base_color.texture.is_some(), "{name}");
        }
        let without = source_of("bop_models", &root, "exclude_datasets = [\"ycbv\"]");
        assert_eq!(without.catalog(&Collected::default()).expect("a catalog").entries.len(), 1);
        for (below, want) in [("lmo", "lmo/obj_000005"), ("lmo/models", "lmo/obj_000005")] {
            let source = source_of("bop_models", &root.join(below), "");
            assert_eq!(source.catalog(&Collected::default()).expect(below).entries[0].name, want);
            load(&*source, want);
        }
    }
}

#[test]
fn a_ycb_box_is_the_same_in_bop() {
    for root in roots() {
        // ycbv/obj_000002 was made from 003_cracker_box: millimeters and centered.
        let (ycb, _) = load(&*source_of("ycb", &root.join("ycb"), ""), "003_cracker_box");
        let (bop, _) = load(&*source_of("bop_models", &root.join("bop"), ""), "ycbv/obj_000002");
        let size = ycb.mesh.bounds().size() - bop.mesh.bounds().size();
        assert!(size.norm() < 1e-5, "{size:?}");
        let volumes = [&ycb, &bop].map(|object| Topology::of(&object.mesh).solid_volume());
        assert!((volumes[0] - volumes[1]).abs() < 1e-4 * volumes[0], "{volumes:?}");
    }
}

#[test]
fn material_folders_are_complete() {
    for root in roots() {
        let rows = table(&root, "materials");
        let root = root.join("materials");
        let source = source_of("pbr_folder", &root, "tile_m = 0.5");
        let log = Collected::default();
        assert_eq!(source.catalog(&log).expect("a catalog").entries.len(), rows.len());
        for row in &rows {
            let material = source.load(&row[0], &log).expect(&row[0]).into_material().expect("a material");
            let names = row[2].to_ascii_lowercase();
            let any = |words: &[&str]| words.iter().any(|word| names.contains(word));
            assert!(material.base_color.texture.is_some(), "{row:?}");
            assert!(material.roughness.texture.is_some(), "{row:?}");
            assert_eq!(material.metallic.texture.is_some(), any(&["_met"]), "{row:?}");
            assert_eq!(material.normal.is_some(), any(&["nor_gl", "normalgl", "_nrm"]), "{row:?}");
            assert_eq!(material.tile_m, 0.5);
        }
        assert!(log.warnings().is_empty(), "{:?}", log.warnings());
    }
}

#[test]
fn environment_maps_agree_with_the_index() {
    for root in roots() {
        let rows = table(&root, "hdri");
        let root = root.join("hdri");
        for row in &rows {
            let (found, warnings) = look(&root.join(&row[0]));
            let found = found.expect(&row[0]);
            assert!(warnings.is_empty());
            assert_eq!(fact(&found, "size"), row[1]);
            for (name, cell) in [("mean radiance", &row[2]), ("largest radiance", &row[3])] {
                let [got, want]: [f64; 2] = [fact(&found, name), cell].map(|text| text.parse().expect(text));
                assert!((got - want).abs() <= 2e-3 * want + 1e-3, "{}: {name} {got}, index {want}", row[0]);
            }
        }
        let source = source_of("environment_folder", &root, "");
        let catalog = source.catalog(&Collected::default()).expect("a catalog");
        assert_eq!(catalog.entries.len(), rows.len());
        for entry in catalog.entries {
            let map =
                source.load(&entry.name, &Collected::default()).expect("loads").into_environment().expect("a map");
            assert_eq!(map.width(), 2 * map.height());
            // Indoors by day: the mean radiance of every channel is positive.
            assert!(map.mean().iter().all(|&x| x > 0.0), "{}", entry.name);
        }
    }
}
