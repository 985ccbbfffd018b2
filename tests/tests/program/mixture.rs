//! Mixtures of recipes, in the files of the stock writers.

use crate::interchange::masks;
use crate::support::{assert_same, fails, made, ok, syntable};
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

const SCENES: u32 = 4;

/// The options that a component of the mixture and its recipe alone have.
fn options(id: &str) -> &'static str {
    match id {
        "tables" => "[camera]\nresolution = [64, 48]\n[set]\nplace.objects.count = 4\n",
        _ => {
            "[camera]\nresolution = [80, 60]\n[assets.objects]\nkind = \"household\"\nfamilies = [\"mug\", \"bottle\"]\n\
             [set]\nplace.objects.count = 7\n"
        }
    }
}

/// A recipe for quick images that makes one component's scenes, without its dataset.
fn stages(folder: &Path, id: &str) -> PathBuf {
    let path = folder.join(format!("{id}.toml"));
    let options = options(id);
    let text = format!(
        "extends = \"builtin:quickstart\"\n{options}[settle]\nduration_s = 2.0\n[render]\nsamples_per_pixel = 1\n\
         [denoise]\nkind = \"none\"\n"
    );
    std::fs::write(&path, text).expect("writable");
    path
}

const OF_DATASET: &str = "[dataset]\nname = \"both\"\nseed = 3\nscenes = 4\nviews_per_scene = 2\n";
const WRITERS: &str = "[write.coco]\n[write.syntable]\n[write.bop]\nmodels = \"none\"\n";

/// The recipe of the mixture, and the recipe of each component alone with the mixture's writers.
fn recipes(folder: &Path) -> BTreeMap<&'static str, PathBuf> {
    let mut mixed = OF_DATASET.to_owned();
    let mut all = BTreeMap::new();
    for id in ["heaps", "tables"] {
        stages(folder, id);
        mixed += &format!("[mixture.{id}]\nextends = \"{id}.toml\"\n");
        let removed = "remove = [\"write.syntable\", \"write.contact_sheet\"]";
        let alone = format!("extends = \"{id}.toml\"\n{removed}\n{OF_DATASET}{WRITERS}");
        let path = folder.join(format!("{id}-alone.toml"));
        std::fs::write(&path, alone).expect("writable");
        all.insert(id, path);
    }
    let path = folder.join("mixed.toml");
    std::fs::write(&path, mixed + WRITERS).expect("writable");
    all.insert("mixed", path);
    all
}

fn run(recipe: &Path, out: &Path) -> Command {
    let mut command = syntable();
    command.arg("run").arg(recipe).arg("--out").arg(out);
    command
}

fn json(path: &Path) -> Json {
    serde_json::from_slice(&std::fs::read(path).expect("readable")).expect("JSON")
}

/// The component of each scene, as the journal has it.
fn components(out: &Path) -> BTreeMap<u32, String> {
    let text = std::fs::read_to_string(out.join(".syntable/journal.jsonl")).expect("a journal");
    let entry = |line: &str| {
        let entry: Json = serde_json::from_str(line).expect("a line");
        // The first line has the digests of assets.
        let scene = entry["scene"].as_u64()? as u32;
        Some((scene, entry["component"].as_str().expect("a name").to_owned()))
    };
    text.lines().filter_map(entry).collect()
}

/// Names of the categories of each image's annotations, sorted, and the image's size.
fn categories(out: &Path) -> BTreeMap<String, (Json, Json, Vec<String>)> {
    let coco = json(&out.join("coco/annotations/instances_train.json"));
    let list = |key: &str| coco[key].as_array().cloned().unwrap_or_default();
    let names: BTreeMap<u64, String> = (list("categories").iter())
        .map(|category| (category["id"].as_u64().expect("an id"), category["name"].to_string()))
        .collect();
    assert_eq!(names.values().collect::<BTreeSet<_>>().len(), names.len(), "a category occurs once: {names:?}");
    let annotations = list("annotations");
    let of = |image: &Json| {
        let own = annotations.iter().filter(|it| it["image_id"] == image["id"]);
        let mut own: Vec<String> = own.map(|it| names[&it["category_id"].as_u64().expect("an id")].clone()).collect();
        own.sort();
        let name = image["file_name"].as_str().expect("a name").to_owned();
        (name, (image["width"].clone(), image["height"].clone(), own))
    };
    list("images").iter().map(of).collect()
}

#[test]
fn each_scene_has_the_labels_of_its_component_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipes = recipes(folder.path());
    let out = |id: &str| folder.path().join("out").join(id);
    let said = ok(syntable().arg("check").arg(&recipes["mixed"]));
    assert!(said.contains("no errors") && said.contains("\nmixture.heaps.assets.objects: "), "{said}");
    let said = ok(syntable().arg("plan").arg(&recipes["mixed"]));
    assert!(said.contains("heaps: about 50.0 % of the scenes") && said.contains("tables: about 50.0 %"), "{said}");
    recipes.iter().for_each(|(id, recipe)| drop(made(&mut run(recipe, &out(id)))));
    let components = components(&out("mixed"));
    assert_eq!(components.len(), SCENES as usize);
    assert_eq!(components.values().collect::<BTreeSet<_>>().len(), 2, "{components:?}");
    for format in ["coco", "bop"] {
        let of = |id: &str| masks(&out(id).join(format), format);
        let (mixed, alone) = (of("mixed"), ["heaps", "tables"].map(|id| (id, of(id))));
        let alone = BTreeMap::from(alone);
        assert_eq!(mixed.len(), 2 * SCENES as usize);
        assert!(mixed.values().map(Vec::len).sum::<usize>() > 20);
        for (at, masks) in &mixed {
            assert!(*masks == alone[components[&at.0].as_str()][at], "{format}: {at:?}");
        }
    }
    let (mixed, alone) = (categories(&out("mixed")), ["heaps", "tables"].map(|id| (id, categories(&out(id)))));
    let alone = BTreeMap::from(alone);
    let found = mixed.iter().filter(|(name, image)| {
        let own = alone.iter().filter(|(_, images)| images[*name] == **image).map(|(id, _)| *id).collect::<Vec<_>>();
        assert_eq!(own.len(), 1, "{name} is of one component: {own:?}");
        own == ["heaps"]
    });
    let heaps = components.values().filter(|id| *id == "heaps").count();
    assert_eq!(found.count(), 2 * heaps);
    // The objects of both pools have names of their own.
    let objects: BTreeMap<String, String> = match json(&out("mixed").join("bop/objects.json")) {
        Json::Object(objects) => objects.into_iter().map(|(id, asset)| (id, asset.to_string())).collect(),
        other => panic!("{other}"),
    };
    let of = |pool: &str| objects.values().filter(|asset| asset.contains(pool)).count();
    assert!(of("tables.objects/") > 0 && of("heaps.objects/") > 0, "{objects:?}");
    assert_eq!(of("tables.objects/") + of("heaps.objects/"), objects.len());
    // The resolved recipe makes the same dataset with another number of threads.
    let mut again = run(&out("mixed").join("recipe.toml"), &out("again"));
    made(again.args(["--threads", "1"]));
    assert_same(&out("again"), &out("mixed"));
    ok(syntable().arg("verify").arg(out("mixed")));
}

#[test]
fn mistakes_name_the_file_of_the_component() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipes = recipes(folder.path());
    let path = folder.path().join("heaps.toml");
    let text = std::fs::read_to_string(&path).expect("readable").replace("families", "family");
    std::fs::write(&path, text).expect("writable");
    let said = fails(syntable().arg("check").arg(&recipes["mixed"]), 2);
    assert!(
        said.contains("heaps.toml:") && said.contains("families") && said.contains("the component `heaps`"),
        "{said}"
    );
}
