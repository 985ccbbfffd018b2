//! Photographs as print: they replace illustrations and nothing else.

use std::path::Path;
use syntable_formats::encode::jpeg;
use syntable_household as _;
use syntable_model::context::Collected;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::Object;

/// A file of a magenta image.
fn magenta() -> Vec<u8> {
    jpeg::encode(&Plane::from_fn(3, 2, |_, _| [255, 0, 255]), 95).expect("an image")
}

const FAMILIES: &str = "families = [\"book\", \"box\", \"magazine\", \"mug\"]\nvariants_per_family = 6\n";

fn source(options: &str) -> Box<dyn AssetSource> {
    source_of("household", options)
}

fn source_of(kind: &str, options: &str) -> Box<dyn AssetSource> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Assets, kind).expect("linked");
    match entry.construct_str(options).unwrap_or_else(|error| panic!("{options}: {error:?}")).stage {
        Stage::Assets(source) => source,
        _ => panic!("{kind} is no asset source"),
    }
}

fn with_photographs(folder: &Path) -> Box<dyn AssetSource> {
    source(&format!("{FAMILIES}photographs = '{}'", folder.display()))
}

fn load(source: &dyn AssetSource, name: &str) -> Object {
    let asset = source.load(name, &Collected::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
    std::sync::Arc::unwrap_or_clone(asset.into_object().expect("an object"))
}

fn texels(object: &Object) -> Vec<u8> {
    object.materials[0].base_color.texture.as_ref().map(|used| used.texture.texels.clone()).unwrap_or_default()
}

#[test]
fn photographs_replace_illustrations_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = [("a.jpg", magenta()), ("b.png", b"damaged".to_vec()), ("notes.txt", b"no photograph".to_vec())];
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).expect("written");
    }
    let (plain, source) = (source(FAMILIES), with_photographs(folder.path()));
    let log = Collected::default();
    let catalog = source.catalog(&log).expect("one photograph is readable");
    let warnings = format!("{:?}", log.warnings());
    assert!(log.warnings().len() == 1 && warnings.contains("b.png") && warnings.contains("skipping"), "{warnings}");
    assert_eq!((source.license(), plain.license()), (None, Some("CC0-1.0")));
    let mut shown = 0;
    for entry in &catalog.entries {
        let [with, without] = [&source, &plain].map(|source| load(&**source, &entry.name));
        assert_eq!(with.mesh.data().positions, without.mesh.data().positions, "{}", entry.name);
        assert_eq!((with.mass.kg, with.friction), (without.mass.kg, without.friction), "{}", entry.name);
        assert_eq!(with.materials.len(), without.materials.len(), "{}", entry.name);
        assert!(with.license.is_empty(), "the license of a photograph is unknown");
        for (a, b) in with.materials.iter().zip(&without.materials).skip(1).filter(|_| with.category != "magazine") {
            assert_eq!(a.digest, b.digest, "{}: not the print", entry.name);
        }
        let magenta = |texels: &[u8]| texels.chunks(4).filter(|t| t[0] > 215 && t[1] < 40 && t[2] > 215).count();
        let [a, b] = [&with, &without].map(texels);
        assert_eq!(a.len(), b.len(), "{}", entry.name);
        // Where no photograph is, the print is the same: most texels of a carton.
        let same = a.chunks(4).zip(b.chunks(4)).filter(|(a, b)| a == b).count();
        match &*with.category {
            "mug" => assert_eq!(same, a.len() / 4, "{}", entry.name),
            "box" => assert!(same > a.len() / 16, "{}: {same} texels are the same", entry.name),
            _ => {}
        }
        shown += usize::from(magenta(&a) > magenta(&b) + 500);
    }
    assert!(shown >= 12, "{shown} of 18 prints show the photograph");
}

#[test]
fn folders_without_photographs_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for path in [folder.path().to_owned(), folder.path().join("missing")] {
        let error = with_photographs(&path).catalog(&Collected::default()).map(|_| ()).expect_err("no photograph");
        let text = format!("{error:?}");
        assert!(text.contains("photographs") && text.contains(&*path.to_string_lossy()), "{text}");
    }
}

#[test]
fn wall_art_shows_photographs() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("a.jpg"), magenta()).expect("written");
    let options = "families = [\"wall_art\"]\nvariants_per_family = 8\n";
    let source = source_of("procedural_interior", &format!("{options}photographs = '{}'", folder.path().display()));
    assert_eq!(source.license(), None);
    let mut shown = 0;
    for entry in source.catalog(&Collected::default()).expect("a catalog").entries {
        let object = load(&*source, &entry.name);
        assert!(object.license.is_empty(), "the license of a photograph is unknown");
        let textures = object.materials.iter().filter_map(|material| material.base_color.texture.as_ref());
        let mut magenta = textures
            .map(|used| used.texture.texels.chunks(4).filter(|t| t[0] > 215 && t[1] < 40 && t[2] > 215).count());
        shown += usize::from(magenta.any(|count| count > 2000));
    }
    assert!(shown >= 4, "{shown} of 8 show the photograph");
}
