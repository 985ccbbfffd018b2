//! Parquet tables, read back by pyarrow, pandas and Hugging Face `datasets`.

use std::path::Path;
use std::sync::OnceLock;
use syntable_model::context::{Collected, Serial};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::registry::{Registry, Slot};
use syntable_model::scene::{SceneId, ViewId};
use syntable_parquet as _;
use syntable_testing::takes::{Crowd, Take, dataset, files, take, takes, write_scenes, writer};
use syntable_testing::{conformance, tools};

const FLAG: Key<PerInstance<bool>> = Key::view("flag", "A truth value per instance; some have none.");
const WIDE: Key<PerInstance<i64>> = Key::view("wide", "A large integer per instance.");
const NOTE: Key<Value> = Key::view("note", "Anything at all, of a view.");
const LATE: Key<Value> = Key::scene("late", "A number of the scene that is known after the views.");

const INCLUDE: &str = "include = [\"object_info\", \"category_id\", \"object_name\", \"visible_box\", \"occlusion_rate\", \
                       \"visible_mask\", \"amodal_mask\", \"amodal_outline\", \"visibility\", \"camera\", \"label_policy\", \
                       \"flag\", \"wide\", \"note\", \"settle_report\", \"late\"]";

/// The scenes of all writers' tests, with additional products and a scene without visible objects.
fn scenes() -> Vec<Take> {
    let mut scenes = takes();
    scenes.push(take(3, 4, &[Crowd::Nothing]));
    for (number, scene) in (0..).zip(&mut scenes) {
        for (view, products) in &mut scene.views {
            let ids: Vec<InstanceId> = products.get(OCCLUSION_RATE).expect("made").0.keys().copied().collect();
            let flags = ids.iter().filter(|id| id.0 % 3 > 0).map(|id| (*id, id.0 % 2 == 0)).collect();
            let wide = ids.iter().map(|id| (*id, i64::MIN + i64::from(id.0))).collect();
            let note = if view.id.0 == 1 { Value::Null } else { vec![f64::from(view.id.0), f64::NAN].into() };
            products
                .put(FLAG, flags)
                .and_then(|()| products.put(WIDE, wide))
                .and_then(|()| products.put(NOTE, note))
                .expect("first");
            if view.id.0 == 1 {
                distort(products);
            }
        }
        scene.products.put(LATE, Value::record([("number", Value::Int(number))])).expect("first");
    }
    scenes
}

/// Adds lens distortion to the camera of a view.
fn distort(products: &mut Products) {
    let Value::Record(mut fields) = products.get(CAMERA).expect("made").clone() else { panic!("no record") };
    fields.push(("distortion_k1_k2_p1_p2_k3".to_owned(), vec![0.1, -0.05, 0.001, 0.0, 0.25].into()));
    *products = products.clone().without(&products.only(&[CAMERA.name()]));
    products.put(CAMERA, Value::Record(fields)).expect("taken out");
}

fn info() -> DatasetInfo {
    DatasetInfo { classes: vec!["böwl".into(), "mug".into()], ..dataset(4, 3) }
}

fn write(root: &Path, options: &str) -> Vec<Take> {
    let (writer, scenes) = (writer("parquet", options).expect("good options"), scenes());
    write_scenes(root, "table", &*writer, &info(), &scenes).expect("written");
    scenes
}

/// Writes the expected products as a line of JSON per view, and the samples of each image.
fn write_truth(root: &Path, scenes: &[Take]) {
    let mut lines = String::new();
    let known = info().classes.len() as u32 + 1;
    for scene in scenes {
        for (view, products) in &scene.views {
            let mut all = serde_json::Map::new();
            for products in [products, &scene.products] {
                for key in products.keys() {
                    if !matches!(key.form(), syntable_model::product::Form::Image { .. }) {
                        let value = products.value(&key.to_string()).expect("made");
                        all.insert(key.to_string(), serde_json::to_value(value).expect("JSON"));
                    }
                }
            }
            // Number of categories of the dataset, which the writer also receives.
            all.insert("categories".into(), known.into());
            let line = serde_json::json!({ "scene": scene.scene.id.0, "view": view.id.0, "products": all });
            lines += &format!("{line}\n");
            let samples: Vec<u8> = products.get(RGB).expect("made").data().iter().flatten().copied().collect();
            std::fs::write(root.join(format!("{}_{}.rgb", scene.scene.id.0, view.id.0)), samples).expect("writable");
        }
    }
    std::fs::write(root.join("truth.jsonl"), lines).expect("writable");
}

fn check(options: &str, arguments: &[&str], modules: &str, here: &OnceLock<bool>) {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = write(folder.path(), options);
    write_truth(folder.path(), &scenes);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_parquet.py");
    let root = folder.path().to_str().expect("UTF-8");
    tools::python_with(modules, here, &script, &[&[root], arguments].concat());
}

const PYARROW: &str = "pyarrow, numpy, pycocotools, PIL";

#[test]
fn pyarrow_reads_a_row_per_instance() {
    static HERE: OnceLock<bool> = OnceLock::new();
    check(INCLUDE, &["instances", "files"], PYARROW, &HERE);
    check(&format!("{INCLUDE}\nimages = \"none\""), &["instances", "none"], PYARROW, &HERE);
}

#[test]
fn pyarrow_reads_a_row_per_view() {
    static HERE: OnceLock<bool> = OnceLock::new();
    for images in ["files", "embedded"] {
        check(&format!("{INCLUDE}\nrows = \"views\"\nimages = {images:?}"), &["views", images], PYARROW, &HERE);
    }
}

#[test]
fn pandas_filters_instances() {
    static HERE: OnceLock<bool> = OnceLock::new();
    check(INCLUDE, &["pandas"], "pandas, pyarrow", &HERE);
}

#[test]
fn hugging_face_decodes_images() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let modules = "datasets, numpy, pycocotools, PIL";
    check(&format!("{INCLUDE}\nrows = \"views\"\nimages = \"embedded\""), &["datasets", "views"], modules, &HERE);
    check(INCLUDE, &["datasets", "instances"], modules, &HERE);
}

#[test]
fn the_kind_passes_the_checks_of_all_writers() {
    let registry = Registry::linked().expect("kinds are unique");
    conformance::entry(registry.find(Slot::Write, "parquet").expect("a kind"));
    let (takes, log) = (takes(), Collected::default());
    // Objects have categories of two classes.
    let dataset = DatasetInfo { classes: ["a", "b"].map(str::to_owned).to_vec(), ..dataset(3, 3) };
    let folder = tempfile::tempdir().expect("a folder");
    let (view, products) = &takes[0].views[1];
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&takes[0].scene);
    let writer = writer("parquet", "").expect("defaults");
    assert!(!conformance::writer(&*writer, &cx.view(view), products, folder.path()).is_empty());
}

#[test]
fn files_depend_on_the_products_alone_and_are_told_before() {
    for options in [INCLUDE.to_owned(), format!("{INCLUDE}\nrows = \"views\"\nimages = \"embedded\"")] {
        let [one, two] = [0, 1].map(|_| tempfile::tempdir().expect("a folder"));
        let scenes = write(one.path(), &options);
        let written = files(one.path());
        // File times have a resolution of one second.
        std::thread::sleep(std::time::Duration::from_millis(1100));
        write(two.path(), &options);
        assert!(written == files(two.path()), "the bytes differ");
        let (writer, dataset) = (writer("parquet", &options).expect("good options"), info());
        let of = |scene: SceneId, view: Option<ViewId>| {
            let of = FileOf { dataset: &dataset, id: "table", scene: Some(scene), view, products: &[] };
            writer.paths(&of).expect("paths")
        };
        let told = scenes.iter().flat_map(|take| {
            let views = take.views.iter().flat_map(|(view, _)| of(take.scene.id, Some(view.id)));
            views.chain(of(take.scene.id, None)).collect::<Vec<_>>()
        });
        let mut told: Vec<String> = told.collect();
        told.sort();
        assert_eq!(told, written.into_keys().collect::<Vec<_>>());
    }
}

#[test]
fn what_a_table_cannot_have_is_refused() {
    let own = "has the name of a field of this writer";
    for (options, says) in [
        ("images = \"embedded\"", "images: a table of instances would have each image many times"),
        ("include = [\"camera\", \"camera\"]", "include[1]: `include` names `camera` twice"),
        ("include = [\"view\"]", own),
        ("include = [\"asset\"]", own),
        ("include = [\"image_file\"]", own),
    ] {
        let refused = writer("parquet", options).err().unwrap_or_default();
        assert!(refused.contains(says), "{options}: {refused}");
    }
    for (product, says) in [("depth", "npz or png"), ("occlusion_order", "write it with npz"), ("amodal_bits", "npz")] {
        let options = format!("include = [{product:?}]\nimages = \"none\"");
        let input = writer("parquet", &options).expect("good options").reads().pop().expect("one");
        let key = takes()[0].views[0].1.key(product).expect("made");
        let refused = input.accepts.check(&key).expect_err("refused");
        assert!(refused.contains(says), "{product}: {refused}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let write = |include: &str, scenes: &[Take]| {
        let writer = writer("parquet", &format!("include = [{include}]\nimages = \"none\"")).expect("good options");
        let error = write_scenes(folder.path(), "table", &*writer, &info(), scenes).expect_err("refused");
        assert!(error.is_permanent(), "{error}");
        error.to_string()
    };
    assert!(write("\"camera\"", &takes()).contains("without a product per instance"));
    const AREA: Key<PerInstance<i64>> = Key::view("visible_mask_area", "What the writer makes of the mask.");
    let mut scenes = takes();
    scenes[0].views.iter_mut().for_each(|(_, products)| products.put(AREA, PerInstance::default()).expect("first"));
    let error = write("\"visible_mask\", \"visible_mask_area\"", &scenes[..1]);
    assert!(error.contains("two products have a column `visible_mask_area`"), "{error}");
}
