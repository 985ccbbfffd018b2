//! BOP files of ellipsoids, whose masks, depths and counts follow from their poses alone. They are read back by code
//! that loads them as bop_toolkit does.

use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, OnceLock};
use syntable_formats::encode::tar::TarWriter;
use syntable_interchange as _;
use syntable_model::context::{Collected, Serial};
use syntable_model::geometry::{Point3, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{BitPlane, ObjectModel, ObjectModels, Plane};
use syntable_model::reader::OpenDataset;
use syntable_model::scene::{
    Camera, Exposure, Intrinsics, Mesh, MeshData, Moment, Role, SceneId, SettleReport, SourceModel, ViewId,
};
use syntable_model::store::{MemStore, StoreFolder};
use syntable_testing::folder::files_of_store;
use syntable_testing::scenes::{add_table, body, box_mesh, object};
use syntable_testing::takes::open_dataset;
use syntable_testing::tools::is_there;

const K: Intrinsics = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 62.0, cx: 31.3, cy: 24.9 };
/// Rows above this row have a wall in front of some objects.
const WALL: u32 = 14;
const WALL_M: f64 = 0.8;
/// Rows from this row on show nothing behind the objects.
const SKY: u32 = 40;
const FLOOR_M: f64 = 1.5;

/// An ellipsoid: half axes in whole mm, and its pose.
struct Ellipsoid {
    axes_mm: [u32; 3],
    camera_from_object: Pose,
}

impl Ellipsoid {
    fn draw(stream: &mut Stream) -> Self {
        let axes_mm = [[70, 50, 40], [90, 30, 60], [45, 45, 110]][stream.below(3) as usize];
        let position = [stream.uniform(-0.5, 0.5), stream.uniform(-0.4, 0.4), stream.uniform(0.6, 1.2)];
        let angles = [0; 3].map(|_| stream.uniform(-3.0, 3.0));
        Self { axes_mm, camera_from_object: Pose::new(position.into(), angles.into()) }
    }

    fn asset(&self) -> String {
        let [a, b, c] = self.axes_mm;
        format!("shapes/e_{a}_{b}_{c}")
    }

    /// Its surface, with an additional vertex that no face uses.
    fn mesh(&self) -> Mesh {
        const RINGS: u32 = 48;
        const SEGMENTS: u32 = 96;
        let axes = self.axes_mm.map(|mm| f64::from(mm) / 1000.0);
        let point = |ring: u32, segment: u32| {
            let (theta, phi) = (f64::from(ring) / f64::from(RINGS), 2.0 * f64::from(segment) / f64::from(SEGMENTS));
            let ((s, c), (v, u)) = ((theta * PI).sin_cos(), (phi * PI).sin_cos());
            [axes[0] * s * u, axes[1] * s * v, axes[2] * c].map(|x| x as f32)
        };
        let points = (0..=RINGS).flat_map(|ring| (0..SEGMENTS).map(move |segment| point(ring, segment)));
        let quads = (0..RINGS).flat_map(|ring| (0..SEGMENTS).map(move |segment| (ring, segment)));
        let triangles = quads.flat_map(|(ring, segment)| {
            let at = |ring: u32, segment: u32| 1 + ring * SEGMENTS + segment % SEGMENTS;
            let (a, b, c, d) =
                (at(ring, segment), at(ring + 1, segment), at(ring + 1, segment + 1), at(ring, segment + 1));
            [[a, b, c], [a, c, d]]
        });
        let positions = std::iter::once([9.0; 3]).chain(points).collect();
        Mesh::new(MeshData { positions, triangles: triangles.collect(), ..MeshData::default() }).expect("sound")
    }

    /// Depth of the nearer intersection with the ray through the center of a pixel, m.
    fn depth(&self, x: i64, y: i64) -> Option<f64> {
        let ray = K.unproject(x as f64 + 0.5, y as f64 + 0.5);
        let object_from_camera = self.camera_from_object.inverse();
        let unit = |v: Vector3<f64>| v.component_div(&Vector3::from(self.axes_mm.map(|mm| f64::from(mm) / 1000.0)));
        let (o, d) = (unit(object_from_camera.translation.vector), unit(object_from_camera.rotation * ray));
        let (a, b, c) = (d.dot(&d), o.dot(&d), o.dot(&o) - 1.0);
        let root = b * b - a * c;
        (root > 0.0).then(|| (-b - root.sqrt()) / a)
    }
}

fn camera() -> Camera {
    let eye = Point3::new(1.0, -0.4, 1.5);
    Camera::pinhole(K, look_at(eye, Point3::new(0.0, 0.1, 0.7), Vector3::z()))
}

fn matrix(pose: &Pose) -> Value {
    let m = pose.to_homogeneous();
    std::array::from_fn::<_, 4, _>(|row| std::array::from_fn::<_, 4, _>(|column| m[(row, column)])).into()
}

/// All products that the writer reads for a view. `all` includes objects that the image does not show.
fn products(objects: &[Ellipsoid], stream: &mut Stream, all: bool) -> Products {
    let count = objects.len();
    let wall = InstanceId(count as u16 + 1);
    let mut coverage = BitPlane::new(K.width, K.height, count);
    let (mut depth, mut first) = (Vec::new(), Vec::new());
    for y in 0..K.height {
        for x in 0..K.width {
            let hits = (1..).map(InstanceId).zip(objects);
            let mut hits: Vec<(f64, InstanceId)> =
                hits.filter_map(|(id, object)| Some((object.depth(x.into(), y.into())?, id))).collect();
            hits.iter().for_each(|&(_, id)| coverage.insert(x, y, id));
            if y < WALL {
                hits.push((WALL_M, wall));
            } else if y < SKY {
                hits.push((FLOOR_M, wall));
            }
            let nearest = hits.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
            depth.push(nearest.map_or(f32::INFINITY, |(depth, _)| depth as f32));
            first.push(nearest.map_or(InstanceId::default(), |(_, id)| id));
        }
    }
    let (depth, first) = (Plane::from_vec(K.width, K.height, depth), Plane::from_vec(K.width, K.height, first));
    let mut products = Products::new();
    let (mut amodal, mut visible) = (PerInstance::default(), PerInstance::default());
    let (mut info, mut visibility) = (PerInstance::default(), PerInstance::default());
    for (id, object) in (1..).map(InstanceId).zip(objects) {
        let whole = Mask::from_fn(K.width, K.height, |x, y| coverage.contains(x, y, id));
        let seen = Mask::from_fn(K.width, K.height, |x, y| *first.at(x, y) == id);
        let annotated = !seen.is_empty();
        if annotated || all {
            let valid = whole.pixels().filter(|&pixel| depth.data()[pixel].is_finite()).count();
            visibility.0.insert(id, visibility_of(object, whole.area(), valid, seen.area()));
            let pose = matrix(&object.camera_from_object);
            info.0.insert(id, Value::record([("asset", object.asset().into()), ("camera_from_object", pose)]));
        }
        if annotated {
            amodal.0.insert(id, whole);
            visible.0.insert(id, seen);
        }
    }
    let camera = Value::record([
        ("width", K.width.into()),
        ("height", K.height.into()),
        ("K", K.matrix().into()),
        ("camera_from_world", matrix(&camera().world_from_camera.inverse())),
    ]);
    let put = |products: &mut Products| -> Result<()> {
        products.put(RGB, Plane::from_fn(K.width, K.height, |_, _| [0; 3].map(|_| stream.below(256) as u8)))?;
        products.put(DEPTH, depth)?;
        products.put(INSTANCE, first)?;
        products.put(COVERAGE, coverage)?;
        products.put(AMODAL_MASK, amodal)?;
        products.put(VISIBLE_MASK, visible)?;
        products.put(OBJECT_INFO, info)?;
        products.put(VISIBILITY, visibility)?;
        products.put(OBJECT_MODELS, models_of(objects))?;
        products.put(CAMERA, camera)
    };
    put(&mut products).expect("each once");
    products
}

fn models_of(objects: &[Ellipsoid]) -> ObjectModels {
    let model = |object: &Ellipsoid| ObjectModel {
        mesh: Arc::new(object.mesh()),
        materials: Vec::new(),
        source: SourceModel::default(),
    };
    ObjectModels(objects.iter().map(|object| (object.asset(), model(object))).collect())
}

fn visibility_of(object: &Ellipsoid, in_frame: u32, valid: usize, visible: u32) -> Value {
    let (w, h) = (i64::from(K.width), i64::from(K.height));
    let canvas = (-h..2 * h).flat_map(|y| (-w..2 * w).map(move |x| (x, y)));
    let pixels: Vec<(i64, i64)> = canvas.filter(|&(x, y)| object.depth(x, y).is_some()).collect();
    let range = |of: fn(&(i64, i64)) -> i64| {
        let (low, high) = (pixels.iter().map(of).min(), pixels.iter().map(of).max());
        low.zip(high).map_or((0, 0), |(low, high)| (low, high + 1 - low))
    };
    let ((x, width), (y, height)) = (range(|p| p.0), range(|p| p.1));
    let all = pixels.len() as u64;
    let fraction = if all == 0 { 0.0 } else { f64::from(visible) / all as f64 };
    Value::record([
        ("px_count_all", all.into()),
        ("px_count_in_frame", in_frame.into()),
        ("px_count_valid", (valid as u64).into()),
        ("px_count_visib", visible.into()),
        ("visib_fract", fraction.into()),
        ("silhouette_box", [x, y, width, height].into()),
    ])
}

fn writer(options: &str) -> Box<dyn Writer<Scenes>> {
    syntable_testing::takes::writer("bop", options).unwrap_or_else(|error| panic!("{options}: {error}"))
}

fn dataset() -> DatasetInfo {
    let (name, program) = ("ellipsoids".into(), "syntable 0.1.0".into());
    DatasetInfo { name, program, seed: 5, scenes: 3, views_per_scene: 2, ..syntable_testing::scenes::dataset() }
}

/// A scene whose number is its only property that the writer reads.
fn scene(id: u32) -> Result<Scene> {
    let mut builder = SceneBuilder::new(SceneId(id), 0);
    add_table(&mut builder);
    builder.add(body(object("box", box_mesh([0.1; 3]), [0.5; 3]), [0.0; 3], Role::Object));
    builder.freeze(SettleReport::default())
}

/// Writes the views of a scene.
fn write_scene(root: impl Into<StoreFolder>, writer: &dyn Writer<Scenes>, id: u32, views: &[Products]) -> Result<()> {
    let (dataset, log) = (dataset(), Collected::default());
    let scene = scene(id)?;
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&scene);
    let mut open = writer.scene(&cx, Output::new(root, "bop", scene.id))?;
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    for (number, products) in (0..).zip(views) {
        let exposure = Exposure::Fixed { ev100: 1.0 };
        let view = View {
            id: ViewId(number),
            moment: Moment::START,
            camera: camera(),
            exposure,
            lights: Vec::new(),
            rig: None,
        };
        open.view(&cx.view(&view), &products.only(&reads))?;
    }
    // All views of a scene share its objects; here each view has its own.
    let mut models = ObjectModels::default();
    views.iter().try_for_each(|view| view.get(OBJECT_MODELS).map(|own| models.0.extend(own.0.clone())))?;
    let mut of_scene = Products::new();
    of_scene.put(OBJECT_MODELS, models)?;
    open.close(&cx, &of_scene.only(&reads))
}

fn finish(root: impl Into<StoreFolder>, writer: &dyn Writer<Scenes>, scenes: &[u32]) -> Result<()> {
    let (dataset, log) = (dataset(), Collected::default());
    let done = Finish::new(root, "bop", scenes.iter().map(|&scene| SceneId(scene)).collect());
    writer.finish(&DatasetContext::new(&dataset, &Serial, &log), &Products::new(), &done)
}

/// Three scenes of two views; the first view of the second scene has no objects.
fn write_all(root: impl Into<StoreFolder>, options: &str) {
    let (root, writer, all) = (root.into(), writer(options), options.contains("all"));
    for id in [2, 0, 1] {
        let mut stream = Stream::root(8).at(id.into());
        let mut view = |objects: usize| {
            let objects: Vec<_> = (0..objects).map(|_| Ellipsoid::draw(&mut stream)).collect();
            products(&objects, &mut stream, all)
        };
        let views = [view(if id == 1 { 0 } else { 14 }), view(9)];
        write_scene(&root, &*writer, id, &views).expect("written");
    }
    finish(&root, &*writer, &[0, 1, 2]).expect("finished");
}

const ALL_OPTIONS: &str = "objects = \"all\"\nsplit = \"test\"\ndepth_scale = 0.02\nmodels = \"models_and_eval\"";

#[test]
fn tar_files_have_what_the_folders_have() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), ALL_OPTIONS);
    write_all(folder.path().join("web"), &format!("{ALL_OPTIONS}\nlayout = \"webdataset\""));
    // A scene with images in two tar files.
    let mut stream = Stream::root(9);
    let views: Vec<Products> = (0..3)
        .map(|objects| {
            let objects: Vec<_> = (0..objects).map(|_| Ellipsoid::draw(&mut stream)).collect();
            products(&objects, &mut stream, false)
        })
        .collect();
    let (large, writer) = (folder.path().join("large"), writer("layout = \"webdataset\""));
    for (id, count) in [(4, 998), (7, 5)] {
        let views: Vec<Products> = views.iter().cycle().take(count).cloned().collect();
        write_scene(&large, &*writer, id, &views).expect("written");
    }
    finish(&large, &*writer, &[4, 7]).expect("finished");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_bop_web.py");
    let arguments = [folder.path().to_str().expect("UTF-8")];
    syntable_testing::tools::python_with("webdataset, numpy, pycocotools, PIL", &HERE, &script, &arguments);
}

#[test]
fn poses_masks_depths_and_counts_belong_together() {
    let modules = "numpy, pycocotools, PIL";
    let import = Command::new("python3").args(["-c", &format!("import {modules}")]).output();
    if !is_there(import.is_ok_and(|output| output.status.success()), &format!("python3 with {modules}")) {
        return;
    }
    for (options, split, set, center) in [
        ("", "train_pbr", "annotated", "0"),
        (ALL_OPTIONS, "test", "all", "0"),
        ("pixel_centers = \"half_integers\"", "train_pbr", "annotated", "0.5"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        write_all(folder.path(), options);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_bop.py");
        let output =
            Command::new("python3").arg(script).arg(folder.path().join("bop")).args([split, set, center]).output();
        let output = output.expect("python3 starts");
        let printed = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
        assert!(output.status.success(), "{options}\n{}{}", printed[0], printed[1]);
        eprint!("{}", printed[0]);
    }
}

#[test]
fn the_end_of_a_run_depends_on_the_scenes_alone() {
    for options in ["", ALL_OPTIONS, "layout = \"webdataset\"\nmodels = \"models\""] {
        let (folder, store) = (tempfile::tempdir().expect("a folder"), Arc::new(MemStore::default()));
        write_all(folder.path(), options);
        write_all(Arc::clone(&store), options);
        // An earlier run with two of the scenes, in memory.
        for scenes in [&[0, 2][..], &[0, 1, 2]] {
            finish(Arc::clone(&store), &*writer(options), scenes).expect("finished");
        }
        let names = syntable_testing::folder::files(folder.path());
        assert!(names == files_of_store(&store), "{options}: files differ");
        // All files that the writer announces exist.
        let dataset = dataset();
        let mut told = 0;
        for (scene, view) in [(None, None), (Some(0), None), (Some(0), Some(1))] {
            let (scene, view) = (scene.map(SceneId), view.map(ViewId));
            let of = FileOf { dataset: &dataset, id: "bop", scene, view, products: &[] };
            for path in writer(options).paths(&of).expect("known") {
                assert!(names.contains_key(&path), "{options}: {path}");
                told += 1;
            }
        }
        assert!(told > 6, "{options}");
    }
}

#[test]
fn a_shard_that_is_cut_off_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "models = \"models\"");
    let path = syntable_model::stage::shard_path("bop", SceneId(1)).expect("a name").below(folder.path());
    let bytes = std::fs::read(&path).expect("there");
    for length in [0, 100, bytes.len() / 2, bytes.len() - 1500] {
        std::fs::write(&path, &bytes[..length]).expect("writable");
        let error = finish(folder.path(), &*writer("models = \"models\""), &[0, 1, 2]).expect_err("damaged");
        assert!(format!("{error:#}").contains("the shard of scene 1"), "{length}: {error}");
    }
}

#[test]
fn a_model_that_is_damaged_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "models = \"models\"");
    let shared = folder.path().join(".syntable/shards/bop/shared");
    let of_mesh = std::fs::read_dir(&shared).expect("a folder").next().expect("a mesh").expect("there").path();
    for file in std::fs::read_dir(&of_mesh).expect("a folder") {
        let path = file.expect("there").path();
        let mut bytes = std::fs::read(&path).expect("there");
        bytes[600] = !bytes[600];
        // Removes the file first, because scenes share it through hard links.
        std::fs::remove_file(&path).expect("there");
        std::fs::write(&path, bytes).expect("writable");
    }
    let error = finish(folder.path(), &*writer("models = \"models\""), &[0, 1, 2]).expect_err("damaged");
    let text = error.to_string();
    assert!(text.contains("other bytes than its name says") && text.contains(".syntable/shards/bop/shared"), "{text}");
}

#[test]
fn what_bop_cannot_have_is_refused() {
    let refused = |options: &str, change: &dyn Fn(&mut Products, &Products)| {
        let mut stream = Stream::root(8);
        let objects: Vec<_> = (0..14).map(|_| Ellipsoid::draw(&mut stream)).collect();
        let whole = products(&objects, &mut stream, false);
        let mut changed = whole.clone();
        change(&mut changed, &whole);
        let folder = tempfile::tempdir().expect("a folder");
        let error = write_scene(folder.path(), &*writer(options), 0, &[changed]).expect_err("refused");
        assert!(error.is_permanent());
        error.to_string()
    };
    let without = |products: &mut Products, name: &str| {
        let names: Vec<String> = products.keys().iter().map(|key| key.to_string()).collect();
        let names: Vec<String> = names.into_iter().filter(|other| other != name).collect();
        *products = products.only(&names);
    };
    let error = refused("", &|products, whole| {
        let Value::Record(mut camera) = whole.get(CAMERA).expect("made").clone() else { panic!("a record") };
        camera.push(("distortion_k1_k2_p1_p2_k3".into(), [0.1, 0.0, 0.0, 0.0, 0.0].into()));
        without(products, "camera");
        products.put(CAMERA, Value::Record(camera)).expect("once");
    });
    assert!(error.contains("no cameras with lens distortion"), "{error}");
    // Masks without the parts that the wall hides, and no product that has these parts.
    let error = refused("", &|products, whole| {
        without(products, COVERAGE.name());
        let cut = whole.get(AMODAL_MASK).expect("made").map(|_, mask| {
            let plane = mask.to_plane();
            Mask::from_fn(K.width, K.height, |x, y| y >= WALL && *plane.at(x, y))
        });
        without(products, "amodal_mask");
        products.put(AMODAL_MASK, cut).expect("once");
    });
    assert!(error.contains("where `visibility` counts"), "{error}");
    let error = refused("objects = \"all\"", &|_, _| {});
    assert!(error.contains("`object_info` does not describe all objects"), "{error}");
    let error = refused("", &|products, _| {
        without(products, "camera");
        products.put(CAMERA, Value::record([("width", 3_i64.into())])).expect("once");
    });
    assert!(error.contains("product `camera` does not have what BOP needs: missing field `height`"), "{error}");
}

#[test]
fn pixel_centers_are_read_back() {
    for layout in ["scenewise", "webdataset"] {
        for centers in ["integers", "half_integers"] {
            let folder = tempfile::tempdir().expect("a folder");
            write_all(folder.path(), &format!("layout = {layout:?}\npixel_centers = {centers:?}"));
            let read = opened(folder.path());
            let products = read.read(0, &[CAMERA.id()]).expect("readable").products;
            let camera = serde_json::to_value(products.get(CAMERA).expect("a camera")).expect("JSON");
            let [cx, cy] = [0, 1].map(|row| camera["K"][row][2].as_f64().expect("a number"));
            assert!((cx - K.cx).abs() < 1e-12 && (cy - K.cy).abs() < 1e-12, "{layout} {centers}: {cx} {cy}");
        }
    }
}

/// Opens the dataset of a folder, in the format that it appears to have.
fn opened(root: &Path) -> OpenDataset {
    let (format, reader) = open_dataset(root, None).expect("a dataset");
    assert_eq!(format.name(), "bop");
    reader
}

#[test]
fn tar_files_are_read_as_folders_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let [plain, web] = ["plain", "web"].map(|name| folder.path().join(name));
    write_all(&plain, ALL_OPTIONS);
    write_all(&web, &format!("{ALL_OPTIONS}\nlayout = \"webdataset\""));
    let [plain, read] = [&plain, &web].map(|root| opened(root));
    assert!(read.images == plain.images && read.info == plain.info);
    assert!(read.images.len() == 6 && read.all_faults().is_empty(), "{:?}", read.all_faults());
    let wants = &plain.offers;
    assert_eq!(*wants, read.offers);
    let mut objects = 0;
    for image in 0..read.images.len() {
        let [products, others] = [&read, &plain].map(|it| it.read(image, wants).expect("readable").products);
        for key in wants {
            let [own, other] = [&products, &others].map(|it| it.value(&key.to_string()).expect("a value"));
            assert!(own == other, "{} of {}", key, read.images[image].name);
        }
        objects += products.get(AMODAL_MASK).expect("masks").0.len();
        assert!(read.image_faults(image).is_empty(), "{:?}", read.image_faults(image));
    }
    assert!(objects > 20, "{objects}");
}

#[test]
fn what_is_wrong_with_tar_files_is_found() {
    let written = || {
        let folder = tempfile::tempdir().expect("a folder");
        write_all(folder.path(), "layout = \"webdataset\"");
        folder
    };
    let said = |folder: &tempfile::TempDir| -> Vec<String> {
        let reader = opened(folder.path());
        let wants = &reader.offers;
        let opening = reader.all_faults().iter().map(|it| format!("{} {it}", it.rule));
        let images = (0..reader.images.len()).filter_map(|image| Some(reader.read(image, wants).err()?.to_string()));
        opening.chain(images).collect()
    };
    assert!(said(&written()).is_empty(), "{:?}", said(&written()));
    /// Rewrites the members of the tar file.
    fn rewritten(folder: &tempfile::TempDir, change: impl Fn(&str, Vec<u8>) -> Vec<(String, Vec<u8>)>) {
        let path = folder.path().join("bop/train_pbr_web/shard-000000.tar");
        let (members, _) = syntable_formats::members::members(&path);
        let all = members.iter().map(|it| (it.name.clone(), it.content().expect("read").bytes().to_vec()));
        let changed: Vec<(String, Vec<u8>)> = all.flat_map(|(name, bytes)| change(&name, bytes)).collect();
        let mut archive = TarWriter::new(std::fs::File::create(&path).expect("a file"), "a tar file");
        changed.iter().for_each(|(name, bytes)| archive.add(name, bytes).expect("added"));
        archive.finish().expect("ended");
    }
    type Change = fn(&str, Vec<u8>) -> Vec<(String, Vec<u8>)>;
    let changes: [(Change, &str); 6] = [
        (
            |name, bytes| if name == "000001_000001.gt_info.json" { vec![] } else { vec![(name.into(), bytes)] },
            "the image has no gt_info.json",
        ),
        (
            |name, bytes| {
                let name = if name == "000001_000001.rgb.png" { "000001_000001.rgb.bmp" } else { name };
                vec![(name.into(), bytes)]
            },
            "has no rgb.png",
        ),
        (
            |name, mut bytes| {
                if name == "000002_000001.mask.json" {
                    bytes = br#"{"0": {"size": [48, 64], "counts": [1, 2]}}"#.to_vec();
                }
                vec![(name.into(), bytes)]
            },
            "mask.json",
        ),
        (
            |name, bytes| {
                let name =
                    if name.starts_with("000002_000001") { name.replace("000002_", "000009_") } else { name.into() };
                vec![(name, bytes)]
            },
            "key_to_shard.json has it in the tar file 0, and no tar file has it",
        ),
        (|name, bytes| vec![(name.into(), bytes.clone()), (name.into(), bytes)], "has this member twice"),
        (
            |name, bytes| {
                let bytes = if name == "000000_000001.gt.json" { b"[{\"obj_id\": NaN}]".to_vec() } else { bytes };
                vec![(name.into(), bytes)]
            },
            "NaN",
        ),
    ];
    for (change, expected) in changes {
        let folder = written();
        rewritten(&folder, change);
        let said = said(&folder);
        assert!(said.iter().any(|it| it.contains(expected)), "{expected}: {said:?}");
    }
    let cut = written();
    let path = cut.path().join("bop/train_pbr_web/shard-000000.tar");
    let bytes = std::fs::read(&path).expect("read");
    std::fs::write(&path, &bytes[..bytes.len() / 2]).expect("written");
    let said = said(&cut);
    assert!(said.iter().any(|it| it.contains("the tar file ends within")), "{said:?}");
    assert!(!opened(cut.path()).images.is_empty(), "what is whole is read");
}
