//! HDF5 files, read back by h5py.

use half::f16;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use syntable_hdf5 as _;
use syntable_model::context::{Collected, Serial};
use syntable_model::geometry::{Point3, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{Plane, Product};
use syntable_model::scene::{Camera, Distortion, Exposure, Intrinsics, Moment, Role, SceneId, SettleReport, ViewId};
use syntable_testing::scenes::{add_table, body, box_mesh, object};
use syntable_testing::tools::is_there;

/// Normals of this width take more than one megabyte, which is the size of a chunk.
const K: Intrinsics = Intrinsics { width: 520, height: 301, fx: 400.0, fy: 410.0, cx: 255.25, cy: 160.5 };

const HALF: Key<Plane<[f16; 2]>> = Key::view("half", "Two half floats per pixel.");
const FLAG: Key<Plane<bool>> = Key::view("flag", "A truth value per pixel.");
const WIDE: Key<Plane<i64>> = Key::view("wide", "A large integer per pixel.");
const NOTE: Key<Value> = Key::view("note", "A text.");

fn writer(options: &str) -> Result<Box<dyn Writer<Scenes>>, String> {
    syntable_testing::takes::writer("hdf5", options)
}

/// A scene with one object. Its number is its only property that the writer reads.
fn scene() -> Scene {
    let mut builder = SceneBuilder::new(SceneId(4), 0);
    add_table(&mut builder);
    builder.add(body(object("box", box_mesh([0.1; 3]), [0.5; 3]), [0.0; 3], Role::Object));
    builder.freeze(SettleReport::default()).expect("a scene")
}

fn camera() -> Camera {
    let pose = look_at(Point3::new(1.0, -0.4, 1.5), Point3::origin(), Vector3::z());
    let distortion = Distortion::brown_conrady([-0.2, 0.05, 0.0], [0.001, -0.002]);
    Camera { distortion: Some(distortion), ..Camera::pinhole(K, pose) }
}

fn products() -> Products {
    let mut stream = Stream::root(6);
    let mut products = Products::new();
    let stated = serde_json::json!({
        "width": K.width,
        "height": K.height,
        "K": K.matrix(),
        "distortion_k1_k2_p1_p2_k3": [-0.2, 0.05, 0.001, -0.002, 0.0],
    });
    products.put(CAMERA, Value::of(&stated).expect("plain data")).expect("first");
    // A mug, an asset without a class, the table, and an object without visible pixels.
    let body = |id: u32, role: &str, name: &str, category: &str| {
        Value::record([
            ("id", id.into()),
            ("role", role.into()),
            ("pool", "pöol".into()),
            ("name", name.into()),
            ("category", category.into()),
        ])
    };
    let bodies = vec![
        body(1, "object", "mug_1", "mug"),
        body(2, "object", "thing", "gadget"),
        body(3, "object", "hidden", "mug"),
        body(300, "support", "table", "mug"),
    ];
    let id = |x: u32, y: u32| [0, 1, 2, 300][((x / 40 + y / 30) % 4) as usize];
    let put = |products: &mut Products| -> Result<()> {
        products.put(BODIES, Value::List(bodies))?;
        products.put(INSTANCE, Plane::from_fn(K.width, K.height, |x, y| InstanceId(id(x, y))))?;
        products.put(RGB, Plane::from_fn(K.width, K.height, |_, _| [0; 3].map(|_| stream.below(256) as u8)))?;
        let depth = |x, y| if id(x, y) == 0 { f32::INFINITY } else { stream.uniform(0.5, 2.0) as f32 };
        products.put(DEPTH, Plane::from_fn(K.width, K.height, depth))?;
        let normal = |x, y| if id(x, y) == 0 { [0.0; 3] } else { [0.6, x as f32 / 1000.0, -0.8] };
        products.put(NORMAL, Plane::from_fn(K.width, K.height, normal))?;
        let half = |x, y| [f16::from_f32(x as f32 / 3.0), f16::from_f32(-(y as f32))];
        products.put(HALF, Plane::from_fn(K.width, K.height, half))?;
        products.put(FLAG, Plane::from_fn(K.width, K.height, |x, y| x > y))?;
        products.put(WIDE, Plane::from_fn(K.width, K.height, |x, y| i64::MIN + i64::from(x * y)))?;
        products.put(NOTE, "späte Tasse".into())?;
        let masks = [1, 2].map(|n| (InstanceId(n), Mask::from_fn(K.width, K.height, |x, y| id(x, y) == n)));
        products.put(VISIBLE_MASK, masks.into_iter().collect())?;
        products.put(AMODAL_MASK, PerInstance::default())?;
        products.put(OCCLUSION_RATE, [(InstanceId(1), 0.25), (InstanceId(2), 1.0 / 3.0)].into_iter().collect())?;
        let info = |n: u16| (InstanceId(n), Value::record([("name", format!("mug_{n}").into())]));
        products.put(OBJECT_INFO, [1, 2].map(info).into_iter().collect())
    };
    put(&mut products).expect("each once");
    products
}

const INCLUDE: &str = "include = [\"half\", \"flag\", \"wide\", \"note\", \"visible_mask\", \"amodal_mask\", \
                       \"occlusion_rate\", \"object_info\"]";

/// Writes one view and returns the files.
fn write(root: &Path, options: &str) -> BTreeMap<String, Vec<u8>> {
    let writer = writer(options).expect("good options");
    let dataset = DatasetInfo {
        name: "test".into(),
        seed: 5,
        scenes: 5,
        views_per_scene: 3,
        recipe: String::new(),
        program: "syntable 0.1.0".into(),
        classes: vec!["bowl".into(), "mug".into()],
        own_categories: Vec::new(),
        label_surface: syntable_model::stage::LabelSurface::First,
    };
    let (log, scene, products) = (Collected::default(), scene(), products());
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&scene);
    let mut open = writer.scene(&cx, Output::new(root, "h5", scene.id)).expect("opens");
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    let view = View {
        id: ViewId(2),
        moment: Moment::START,
        camera: camera(),
        exposure: Exposure::Fixed { ev100: 1.0 },
        lights: Vec::new(),
        rig: None,
    };
    open.view(&cx.view(&view), &products.only(&reads)).expect("written");
    open.close(&cx, &Products::new()).expect("closed");
    let files = syntable_testing::folder::files(root);
    let of = FileOf { dataset: &dataset, id: "h5", scene: Some(scene.id), view: Some(view.id), products: &[] };
    assert_eq!(writer.paths(&of).expect("known"), files.keys().cloned().collect::<Vec<_>>());
    files
}

#[test]
fn h5py_reads_the_values() {
    let import = Command::new("python3").args(["-c", "import h5py, numpy"]).output();
    if !is_there(import.is_ok_and(|output| output.status.success()), "python3 with h5py, numpy") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), INCLUDE);
    // The values themselves: little-endian arrays, and rays of the camera.
    let products = products();
    for key in products.keys() {
        let value = products.value(&key.to_string()).expect("made");
        if let Value::Tensor(tensor) = value {
            std::fs::write(folder.path().join(format!("{}.raw", key)), tensor.bytes).expect("writable");
        }
    }
    let ray = |x: u32, y: u32| camera().unproject(f64::from(x) + 0.5, f64::from(y) + 0.5).expect("seen").norm();
    let rays = Plane::from_fn(K.width, K.height, ray);
    let Value::Tensor(rays) = rays.encode() else { panic!("a plane is a tensor") };
    std::fs::write(folder.path().join("rays.raw"), rays.bytes).expect("writable");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_hdf5.py");
    let output = Command::new("python3").arg(script).arg(folder.path()).output().expect("python3 starts");
    let printed = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success(), "{}{}", printed[0], printed[1]);
    eprint!("{}", printed[0]);
}

#[test]
fn files_depend_on_the_products_alone() {
    let [one, two] = [0, 1].map(|_| tempfile::tempdir().expect("a folder"));
    let first = write(one.path(), INCLUDE);
    // File times have a resolution of one second.
    std::thread::sleep(std::time::Duration::from_millis(1100));
    assert!(first == write(two.path(), INCLUDE), "the bytes differ");
}

#[test]
fn what_is_chosen_is_read_and_nothing_else() {
    let reads = |options: &str| -> Vec<String> {
        // Each entry of the lists declares its inputs.
        let mut all: Vec<String> = Vec::new();
        for input in writer(options).expect("good options").reads() {
            if !all.contains(&input.product) {
                all.push(input.product);
            }
        }
        all
    };
    assert_eq!(reads("datasets = [\"distance\", \"depth\"]"), ["depth", "camera"]);
    assert_eq!(reads("datasets = []\ninclude = [\"flag\"]"), ["flag"]);
    assert_eq!(reads(""), ["rgb", "depth", "camera", "normal", "instance", "bodies"]);
    for (options, want) in [
        ("datasets = []", "datasets: nothing to write"),
        ("datasets = [\"depth\", \"depth\"]", "datasets[1]: `datasets` names `depth` twice"),
        ("include = [\"flag\", \"flag\"]", "include[1]: `include` names `flag` twice"),
        ("include = [\"depth\"]", "include[0]: a product named `depth` has the name of a field of this writer"),
    ] {
        assert_eq!(writer(options).err().expect("refused"), want);
    }
    let input = writer("include = [\"bodies\"]").expect("good options").reads().pop().expect("one");
    assert!(input.accepts.check(&BODIES.id()).expect_err("refused").contains("one view"));
}
