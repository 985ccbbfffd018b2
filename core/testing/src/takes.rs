//! Scenes with views whose labels are made by counting pixels, and functions that run a writer on them like the
//! program.

use crate::folder;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::{Collected, Serial};
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{DType, OcclusionOrder, PixelCounts, Plane, Tensor};
use syntable_model::reader::{DatasetFormat, OpenDataset, Source};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, Exposure, Intrinsics, MassOrigin, MassProperties, Material, Mesh, MeshData, Moment,
    Motion, Object, Region, Role, SceneId, SettleReport, SourceModel, Support, ViewId,
};
use syntable_model::store::StoreFolder;

/// Width of the images, px.
pub const WIDTH: u32 = 64;
/// Height of the images, px.
pub const HEIGHT: u32 = 48;

/// The registry of all crates that the test links.
pub fn registry() -> Registry {
    Registry::linked().expect("no two of one name")
}

/// Opens a dataset of any format that the test links.
///
/// # Errors
/// The same errors as the program.
pub fn open_dataset(root: &Path, format: Option<&str>) -> Result<(Arc<dyn DatasetFormat>, OpenDataset), Error> {
    registry().open_dataset(&Source::new(root), format)
}

/// The writer with these options, or the reason why they are refused. The test must link the crate that registers the
/// kind.
pub fn writer(kind: &str, options: &str) -> Result<Box<dyn Writer<Scenes>>, String> {
    use syntable_model::registry::ConstructError;
    match registry().find(Slot::Write, kind).expect("a registered kind").construct_str(options) {
        Ok(constructed) => match constructed.stage.of_scenes() {
            Stage::WriteScenes(writer) => Ok(writer),
            _ => unreachable!("the registry keeps slots apart"),
        },
        Err(ConstructError::Form(error)) => Err(error.to_string()),
        Err(ConstructError::Invalid(invalid)) => Err(format!("{}: {}", invalid.key, invalid.message)),
    }
}

/// A scene with its views.
pub struct Take {
    /// The scene.
    pub scene: Scene,
    /// All products of the scene, including the products made from all views.
    pub products: Products,
    /// Each view with its products and the scene's products that are known before the views.
    pub views: Vec<(View, Products)>,
}

/// Content of a view.
#[derive(Clone, Copy)]
pub enum Crowd {
    /// Random blobs, some completely hidden, some at the border.
    Random,
    /// Only the table.
    Nothing,
    /// Objects that the table hides.
    Hidden,
}

/// A dataset without classes.
pub fn dataset(scenes: u32, views: u32) -> DatasetInfo {
    DatasetInfo {
        name: "a \"test\"".into(),
        seed: 5,
        scenes,
        views_per_scene: views,
        recipe: "[dataset]\nname = \"test\"\n".into(),
        program: "syntable 0.1.0".into(),
        classes: Vec::new(),
        own_categories: Vec::new(),
        label_surface: syntable_model::stage::LabelSurface::First,
    }
}

/// A scene with this number of objects, and a view for each crowd.
pub fn take(id: u32, objects: usize, crowds: &[Crowd]) -> Take {
    let scene = scene(id, objects);
    let mut known = Products::new();
    let report = Value::record([("objects", (objects as i64).into()), ("simulated_s", 5.0.into())]);
    known.put(SETTLE_REPORT, report).expect("first");
    let bodies = scene.bodies().iter().map(|body| {
        Value::record([
            ("id", u32::from(body.id.0).into()),
            ("role", if body.role == Role::Object { "object" } else { "support" }.into()),
            ("pool", body.asset.pool.as_str().into()),
            ("name", body.asset.name.as_str().into()),
            ("category", body.object.category.as_str().into()),
            ("materials", vec!["gray"].into()),
            ("world_from_body", pose(&body.world_from_body)),
        ])
    });
    known.put(BODIES, Value::List(bodies.collect())).expect("first");
    let views = (0..).zip(crowds).map(|(number, &crowd)| {
        let view = view(number);
        let stream = Stream::root(9).at(id.into()).at(number.into());
        let products = view_products(&scene, &view, crowd, stream, &known);
        (view, products)
    });
    let views = views.collect();
    Take { scene, products: known, views }
}

fn scene(id: u32, objects: usize) -> Scene {
    let mesh = Mesh::new(MeshData {
        positions: vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        ..Default::default()
    })
    .expect("sound");
    let object = Arc::new(Object {
        name: "tetra".into(),
        category: "solid".into(),
        mass: MassProperties::of_mesh(&mesh, 0.25, MassOrigin::Known),
        mesh: Arc::new(mesh),
        materials: vec![Arc::new(Material::plain("gray", [0.5; 3], 0.5))],
        collision: None,
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        friction: 0.5,
        license: "CC0-1.0".into(),
        digest: Digest::of(b"tetra"),
    });
    let mut builder = SceneBuilder::new(SceneId(id), 0);
    builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.7], [1.0, 0.8])).into();
    let mut handles = Vec::new();
    for (i, role) in [Role::Support].into_iter().chain(vec![Role::Object; objects + 1]).enumerate() {
        let asset = AssetRef { pool: "pool".into(), name: format!("lm/tetra_{i}") };
        let pose = Pose::translation(0.01 * i as f64, 0.0, 0.7);
        handles.push(builder.add(BodyDraft::new(asset, object.clone(), pose, role, Motion::Dynamic)));
    }
    // Removes an object, so that spawn numbers and ids differ.
    builder.remove(handles[1]);
    builder.freeze(SettleReport::default()).expect("a scene")
}

fn view(number: u32) -> View {
    let eye = Point3::new(1.0, 0.1 * f64::from(number), 1.5);
    let intrinsics = Intrinsics {
        width: WIDTH,
        height: HEIGHT,
        fx: 45.7,
        fy: 45.7,
        cx: f64::from(WIDTH) / 2.0,
        cy: f64::from(HEIGHT) / 2.0,
    };
    let world_from_camera = look_at(eye, Point3::new(0.0, 0.0, 0.7), Vector3::z());
    View {
        moment: Moment::START,
        id: ViewId(number),
        camera: Camera::pinhole(intrinsics, world_from_camera),
        exposure: Exposure::Fixed { ev100: 1.0 },
        lights: Vec::new(),
        rig: None,
    }
}

/// Every product of a view. Objects are ellipses. A smaller id is nearer, except in a random stripe with the reverse
/// order. The table is behind the objects, but in front of some.
fn view_products(scene: &Scene, view: &View, crowd: Crowd, mut stream: Stream, known: &Products) -> Products {
    let count = scene.objects().len() as u16;
    let table = InstanceId(count + 1);
    let blobs: Vec<[f64; 4]> = (0..count)
        .map(|_| {
            let [w, h] = [f64::from(WIDTH), f64::from(HEIGHT)];
            [
                stream.uniform(-4.0, w + 4.0),
                stream.uniform(-4.0, h + 4.0),
                stream.uniform(3.0, w / 4.0),
                stream.uniform(3.0, h / 4.0),
            ]
        })
        .collect();
    let stripe = stream.uniform(0.0, f64::from(WIDTH));
    let hits = |x: u32, y: u32| -> Vec<InstanceId> {
        let (u, v) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let inside = |id: &u16| {
            let [cx, cy, rx, ry] = blobs[usize::from(*id) - 1];
            ((u - cx) / rx).powi(2) + ((v - cy) / ry).powi(2) < 1.0
        };
        let mut ids: Vec<InstanceId> = (1..=count).filter(inside).map(InstanceId).collect();
        if (stripe..stripe + 6.0).contains(&u) {
            ids.reverse();
        }
        match crowd {
            Crowd::Random => ids.insert(ids.iter().position(|id| id.0 % 7 == 0).unwrap_or(ids.len()), table),
            Crowd::Nothing => ids = vec![table],
            Crowd::Hidden => ids.insert(0, table),
        }
        if y < 2 { vec![] } else { ids }
    };
    let rays = Plane::from_fn(WIDTH, HEIGHT, hits);
    let mask = |f: &dyn Fn(&[InstanceId]) -> bool| Mask::from_fn(WIDTH, HEIGHT, |x, y| f(rays.at(x, y)));

    let (mut visible, mut amodal) = (BTreeMap::new(), BTreeMap::new());
    for id in (1..=count).map(InstanceId) {
        let covered = mask(&|hits| hits.contains(&id));
        if !covered.is_empty() {
            visible.insert(id, mask(&|hits| hits.first() == Some(&id)));
            amodal.insert(id, covered);
        }
    }
    let ids: Vec<InstanceId> = amodal.keys().copied().collect();
    let occlusion: BTreeMap<InstanceId, Mask> = ids.iter().map(|id| (*id, amodal[id].minus(&visible[id]))).collect();
    let mut order = OcclusionOrder::new(ids.clone());
    for (row, i) in ids.iter().enumerate() {
        for (column, j) in ids.iter().enumerate() {
            if i != j && !visible[i].and(&occlusion[j]).is_empty() {
                order.set(row, column);
            }
        }
    }
    let rate = |id: &InstanceId| f64::from(occlusion[id].area()) / f64::from(amodal[id].area());

    let mut products = known.clone();
    let camera_from_world = view.camera.world_from_camera.inverse();
    let infos = ids.iter().map(|id| {
        let body = scene.body(*id).expect("an object");
        let info = Value::record([
            ("asset", body.asset.to_string().into()),
            ("name", body.asset.name.as_str().into()),
            ("category", body.object.category.as_str().into()),
            ("spawn", body.spawn.into()),
            ("world_from_object", pose(&body.world_from_body)),
            ("camera_from_object", pose(&(camera_from_world * body.world_from_body))),
        ]);
        (*id, info)
    });
    let info: PerInstance<Value> = infos.collect();
    let k = &view.camera.intrinsics;
    let camera = Value::record([
        ("width", k.width.into()),
        ("height", k.height.into()),
        ("K", Value::List(k.matrix().map(Value::from).to_vec())),
        ("world_from_camera", pose(&view.camera.world_from_camera)),
        ("camera_from_world", pose(&camera_from_world)),
    ]);
    let policy = Value::record([
        ("image_frame", "clip".into()),
        ("table_and_room", "occlude".into()),
        ("min_visible_px", 0_i64.into()),
        ("max_occlusion_rate", 1.0.into()),
    ]);
    let put = |products: &mut Products| -> Result<()> {
        products.put(OCCLUSION_RATE, ids.iter().map(|id| (*id, rate(id))).collect())?;
        products.put(VISIBLE_BOX, ids.iter().map(|id| (*id, visible[id].bbox())).collect())?;
        products.put(AMODAL_BOX, ids.iter().map(|id| (*id, amodal[id].bbox())).collect())?;
        products.put(OCCLUSION_ORDER, order.clone())?;
        products.put(OCCLUSION_MASK, PerInstance(occlusion.clone()))?;
        products.put(VISIBLE_MASK, PerInstance(visible.clone()))?;
        products.put(AMODAL_MASK, PerInstance(amodal.clone()))?;
        let shown = |hits: &Vec<InstanceId>| hits.first().filter(|id| **id != table).copied().unwrap_or_default();
        products.put(VISIBLE_IDS, rays.map(shown))?;
        // The image width is a multiple of eight.
        let bytes = ids.iter().flat_map(|id| {
            let bits = rays
                .data()
                .chunks(8)
                .map(|hits| hits.iter().fold(0_u8, |bits, hits| bits << 1 | u8::from(hits.contains(id))));
            bits.collect::<Vec<u8>>()
        });
        let shape = vec![ids.len(), HEIGHT as usize, WIDTH as usize / 8];
        products.put(
            AMODAL_BITS,
            Value::Tensor(Tensor::new(DType::U8, &["instance", "y", "byte"], shape, bytes.collect())),
        )?;
        products.put(CATEGORY_ID, ids.iter().map(|id| (*id, u32::from(id.0 % 3) + 1)).collect())?;
        let counts = |id: &InstanceId| PixelCounts {
            all: amodal[id].area().into(),
            in_frame: amodal[id].area().into(),
            valid: amodal[id].area().into(),
            visible: visible[id].area().into(),
            silhouette: amodal[id].bbox().into(),
        };
        products.put(VISIBILITY, ids.iter().map(|id| Ok((*id, counts(id).record()?))).collect::<Result<_>>()?)?;
        let name = |id: &InstanceId| scene.body(*id).map_or(String::new(), |body| body.asset.name.clone());
        products.put(OBJECT_NAME, ids.iter().map(|id| (*id, name(id))).collect())?;
        products.put(OBJECT_INFO, info.clone())?;
        products.put(CAMERA, camera.clone())?;
        products.put(VISIBLE_OUTLINE, visible.iter().map(|(id, mask)| (*id, outline(mask))).collect())?;
        products.put(AMODAL_OUTLINE, amodal.iter().map(|(id, mask)| (*id, outline(mask))).collect())?;
        products.put(VISIBLE_ROTATED_BOX, visible.iter().map(|(id, mask)| (*id, rotated_box(mask))).collect())?;
        products.put(AMODAL_ROTATED_BOX, amodal.iter().map(|(id, mask)| (*id, rotated_box(mask))).collect())?;
        products.put(LABEL_POLICY, policy.clone())?;
        products.put(EXPOSURE, Value::record([("ev100", 1.0.into()), ("tone", "srgb".into())]))?;
        products.put(DENOISER, Value::record([("name", "none".into())]))?;
        let depth = |hits: &Vec<InstanceId>| hits.first().map_or(f32::INFINITY, |id| 0.4567 + f32::from(id.0) * 0.1234);
        products.put(DEPTH, rays.map(depth))?;
        // A depth camera that measures a millimeter too much, and nothing in some columns.
        let is_hole = |x: u32, depth: f32| x.is_multiple_of(5) || !depth.is_finite();
        let sensed = |x, y| Some(depth(rays.at(x, y))).filter(|depth| !is_hole(x, *depth)).map_or(0.0, |d| d + 0.001);
        products.put(DEPTH_SENSED, Plane::from_fn(WIDTH, HEIGHT, sensed))?;
        products.put(INSTANCE, rays.map(|hits| hits.first().copied().unwrap_or_default()))
    };
    put(&mut products).expect("first");
    products.put(RGB, Plane::from_fn(WIDTH, HEIGHT, |_, _| [0; 3].map(|_| stream.below(256) as u8))).expect("first");
    let normal = |hits: &Vec<InstanceId>| if hits.is_empty() { [0.0; 3] } else { [0.6, 0.0, -0.8_f32] };
    let brightness =
        |hits: &Vec<InstanceId>| hits.iter().map(|id| f32::from(id.0).exp2() - 2.5).fold(1e-20, |sum, x| sum + x);
    products.put(RADIANCE, rays.map(|hits| [brightness(hits), 1.0 / 3.0, 1e9])).expect("first");
    products.put(NORMAL, rays.map(normal)).expect("first");
    products.put(ALBEDO, rays.map(|hits| [hits.len() as f32 / 8.0, 0.5, 2.0])).expect("first");
    products
}

/// A mask as rectangles, one per run of a column. Their union is the mask, and many of them touch.
fn outline(mask: &Mask) -> Value {
    let rectangle = |[x, top, bottom]: [u32; 3]| -> Value {
        let [left, top, right, bottom] = [x, top, x + 1, bottom].map(f64::from);
        [left, top, right, top, right, bottom, left, bottom].into()
    };
    let columns = mask.runs().flat_map(|run| {
        let (first, last) = (run.start / HEIGHT, (run.end - 1) / HEIGHT);
        (first..=last).map(move |x| {
            let top = if x == first { run.start % HEIGHT } else { 0 };
            let bottom = if x == last { (run.end - 1) % HEIGHT + 1 } else { HEIGHT };
            [x, top, bottom]
        })
    });
    let none = Value::List(Vec::new());
    Value::record([("polygons", Value::List(columns.map(rectangle).collect())), ("holes", none)])
}

/// The square around a mask's box, rotated by 45 degrees. It may extend beyond the image.
fn rotated_box(mask: &Mask) -> Value {
    let [x, y, width, height] = <[i32; 4]>::from(mask.bbox()).map(f64::from);
    let (u, v, reach) = (x + width / 2.0, y + height / 2.0, (width + height) / 2.0);
    let corners = [[u, v - reach], [u + reach, v], [u, v + reach], [u - reach, v]];
    Value::record([("center_px", [u, v].into()), ("angle_deg", 45.0.into()), ("corners_px", corners.into())])
}

fn pose(pose: &Pose) -> Value {
    let m = pose.to_homogeneous();
    let bytes = (0..16).flat_map(|i| m[(i / 4, i % 4)].to_le_bytes()).collect();
    Value::Tensor(Tensor::new(DType::F64, &["row", "column"], vec![4, 4], bytes))
}

/// Three scenes with random crowds; one view has no objects, and in another all are hidden.
pub fn takes() -> Vec<Take> {
    use Crowd::{Hidden, Nothing, Random};
    vec![
        take(0, 9, &[Random, Random, Random]),
        take(1, 1, &[Random, Nothing, Hidden]),
        take(2, 70, &[Random, Random, Nothing]),
    ]
}

/// Writes scenes as the program does, in any order.
pub fn write_scenes<'a>(
    root: impl Into<StoreFolder>,
    id: &str,
    writer: &dyn Writer<Scenes>,
    dataset: &DatasetInfo,
    takes: impl IntoIterator<Item = &'a Take>,
) -> Result<()> {
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    let (root, log) = (root.into(), Collected::default());
    for take in takes {
        let cx = DatasetContext::new(dataset, &Serial, &log).scene(&take.scene);
        let mut scene = writer.scene(&cx, Output::new(&root, id, take.scene.id))?;
        for (view, products) in &take.views {
            scene.view(&cx.view(view), &with_categories(dataset, &take.scene, products)?.only(&reads))?;
        }
        scene.close(&cx, &take.products.only(&reads))?;
    }
    Ok(())
}

/// The products of a view, with category ids of the dataset: the id of the object's class if the dataset has that
/// class.
fn with_categories(dataset: &DatasetInfo, scene: &Scene, products: &Products) -> Result<Products> {
    let Ok(before) = products.get(CATEGORY_ID) else { return Ok(products.clone()) };
    let class = |id| scene.body(id).map_or(Ok(1), |body| dataset.category_id(&body.object.category));
    let of_object = |(id, &category): (InstanceId, &u32)| match class(id)? {
        1 if dataset.category(category).is_ok() => Ok((id, category)),
        class => Ok((id, class)),
    };
    let categories = before.iter().map(of_object).collect::<Result<_>>()?;
    let others = products.keys().into_iter().filter(|key| *key != CATEGORY_ID.id());
    let mut all = products.only(&others.collect::<Vec<_>>());
    all.put(CATEGORY_ID, categories)?;
    Ok(all)
}

/// Finishes a run with these finished scenes.
pub fn finish(
    root: impl Into<StoreFolder>,
    id: &str,
    writer: &dyn Writer<Scenes>,
    dataset: &DatasetInfo,
    scenes: &[u32],
) -> Result<()> {
    finish_with(root, id, writer, dataset, scenes, &Products::new())
}

/// Finishes a run with these finished scenes and these products of the dataset.
pub fn finish_with(
    root: impl Into<StoreFolder>,
    id: &str,
    writer: &dyn Writer<Scenes>,
    dataset: &DatasetInfo,
    scenes: &[u32],
    products: &Products,
) -> Result<()> {
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    let log = Collected::default();
    let done = Finish::new(root, id, scenes.iter().map(|&scene| SceneId(scene)).collect());
    writer.finish(&DatasetContext::new(dataset, &Serial, &log), &products.only(&reads), &done)
}

/// Writes a dataset of all takes.
pub fn write_all(root: &Path, id: &str, kind: &str, options: &str) -> Vec<Take> {
    let (writer, takes) = (writer(kind, options).expect("good options"), takes());
    let dataset = dataset(3, 3);
    write_scenes(root, id, &*writer, &dataset, &takes).expect("written");
    finish(root, id, &*writer, &dataset, &[0, 1, 2]).expect("finished");
    takes
}

/// All files of a folder except the program's own, such as shards, by path.
pub fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = folder::files(root);
    files.retain(|name, _| !name.starts_with(".syntable/"));
    files
}
