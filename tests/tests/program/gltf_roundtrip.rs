//! Exports a scene as glTF and imports it as an asset: rendered from the file's camera, the image must be the same.

use crate::support::{ok, syntable};
use serde_json::Value as Json;
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::Collected;
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::{RADIANCE, RADIANCE_VARIANCE};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, Exposure, Intrinsics, Moment, Motion, Region, Role, SettleReport, Support, ViewId,
};
use syntable_testing::workers::Threads;

const SIZE: [u32; 2] = [96, 72];

/// One scene with a room, a table, objects with printed textures, and spherical and rectangular lights. No glass,
/// because the noise of its caustics would dominate the comparison.
const RECIPE: &str = r#"
[dataset]
name = "round trip"
seed = 11
scenes = 1
views_per_scene = 1

[assets.objects]
kind = "household"
families = ["book", "box", "mug", "banana", "can", "plate", "sponge"]

[assets.tables]
kind = "procedural_tables"

[assets.materials]
kind = "procedural_materials"
families = ["wood", "fabric", "tiles", "plaster"]
texture_px = 128

[[place]]
kind = "room"
size_m = 4.0
height_m = 2.6
material = { floor = "materials", walls = "materials", ceiling = "materials" }

[[place]]
kind = "table"
from = ["tables"]
material = "materials"

[[place]]
kind = "drop_box"
from = ["objects"]
count = 7

[settle]
kind = "rapier"
duration_s = 1.0
on_violation = "keep"

[camera]
kind = "pinhole"

[views]
kind = "hemisphere_shell"

[[lights]]
kind = "sphere_lights"

[[lights]]
kind = "ceiling_light"

[render]
kind = "cpu_path"

[write.gltf]

[write.npy]
include = ["radiance", "radiance_variance", "instance"]
"#;

/// The JSON of a binary glTF file.
fn json_of(path: &Path) -> Json {
    let bytes = std::fs::read(path).expect("a file");
    let size = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    serde_json::from_slice(&bytes[20..20 + size]).expect("JSON")
}

/// Elements of a NumPy file with `N` bytes each.
fn elements<const N: usize>(path: &Path) -> Vec<[u8; N]> {
    let bytes = std::fs::read(path).expect("a file");
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[10 + header..].as_chunks().0.to_vec()
}

fn floats(path: &Path) -> Vec<f64> {
    elements(path).into_iter().map(|bytes| f64::from(f32::from_le_bytes(bytes))).collect()
}

/// The view of the file's first camera, in the frame of the file's root: z up.
fn view_of(json: &Json) -> View {
    let node = json["nodes"].as_array().expect("nodes").iter().find(|node| node["name"] == "view 0").expect("a camera");
    let numbers = |value: &Json| -> Vec<f64> {
        value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    let camera = &json["cameras"][node["camera"].as_u64().expect("an index") as usize];
    let (perspective, [width, height]) = (&camera["perspective"], SIZE);
    let tan = (perspective["yfov"].as_f64().expect("an angle") / 2.0).tan();
    let fy = f64::from(height) / (2.0 * tan);
    let fx = f64::from(width) / (2.0 * tan * perspective["aspectRatio"].as_f64().expect("a ratio"));
    let intrinsics = Intrinsics { width, height, fx, fy, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 };
    let mut turn = UnitQuaternion::identity();
    turn.as_mut_unchecked().coords.copy_from_slice(&numbers(&node["rotation"]));
    // glTF's cameras look along -z with y up.
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let at = Translation3::from(Vector3::from_row_slice(&numbers(&node["translation"])));
    View {
        moment: Moment::START,
        id: ViewId(0),
        camera: Camera::pinhole(intrinsics, Pose::from_parts(at, turn * half_turn)),
        exposure: Exposure::Fixed { ev100: 7.0 },
        lights: Vec::new(),
        rig: None,
    }
}

/// Renders the file as one body, from its own camera and lit only by its emissive bodies.
fn render(folder: &Path, samples: u32) -> (Vec<f64>, Vec<f64>) {
    use syntable_program as _;
    let registry = Registry::linked().expect("no clash");
    let stage = |slot, kind: &str, options: &str| match registry.find(slot, kind).expect(kind).construct_str(options) {
        Ok(constructed) => constructed.stage,
        Err(error) => panic!("{kind}: {error:?}"),
    };
    let Stage::Assets(source) =
        stage(Slot::Assets, "mesh_folder", &format!("root = {:?}", folder.display().to_string()))
    else {
        panic!("a source")
    };
    let log = Collected::default();
    let object = source.load("000000", &log).expect("loads").into_object().expect("an object");
    // The reader must know everything in the file.
    let complaints: Vec<String> =
        log.warnings().iter().map(ToString::to_string).filter(|warning| warning.contains("are ignored")).collect();
    assert!(complaints.is_empty(), "{complaints:?}");

    let mut builder = SceneBuilder::default();
    builder.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0; 2])).into();
    let asset = AssetRef { pool: "files".into(), name: "000000".into() };
    builder.add(BodyDraft::new(asset, object, Pose::identity(), Role::Object, Motion::Fixed));
    let scene = Arc::new(builder.freeze(SettleReport::default()).expect("a scene"));
    let Stage::Render(renderer) = stage(Slot::Render, "cpu_path", &format!("samples_per_pixel = {samples}")) else {
        panic!("a renderer")
    };
    let mut session = renderer.open(0).expect("opens");
    session.load(&scene, &Threads(2)).expect("loads");
    let view = view_of(&json_of(&folder.join("000000.glb")));
    let wants = keys![RADIANCE, RADIANCE_VARIANCE];
    let request = RenderRequest::new(&view, &wants, Stream::root(5), &Threads(2));
    let mut products = Products::new();
    session.render(&request, &mut products).expect("renders");
    let radiance = products.get(RADIANCE).expect("made").data().as_flattened().iter().map(|&x| f64::from(x)).collect();
    let variance = products.get(RADIANCE_VARIANCE).expect("made").data().iter().map(|&x| f64::from(x)).collect();
    (radiance, variance)
}

#[test]
fn a_scene_that_comes_back_looks_the_same() {
    const SAMPLES: u32 = 192;
    let folder = tempfile::tempdir().expect("a folder");
    let (recipe, out) = (folder.path().join("recipe.toml"), folder.path().join("out"));
    std::fs::write(&recipe, RECIPE).expect("writable");
    let mut command = syntable();
    command.arg("run").arg(&recipe).arg("--out").arg(&out);
    for set in [format!("camera.resolution=[{}, {}]", SIZE[0], SIZE[1]), format!("render.samples_per_pixel={SAMPLES}")]
    {
        command.args(["--set", &set]);
    }
    ok(&mut command);
    let of = |product: &str| floats(&out.join(format!("npy/{product}/000000_0000.npy")));
    let (here, here_variance) = (of("radiance"), of("radiance_variance"));
    let instances: Vec<u16> =
        elements(&out.join("npy/instance/000000_0000.npy")).into_iter().map(u16::from_le_bytes).collect();
    let (there, there_variance) = render(&out.join("gltf"), SAMPLES);
    assert_eq!(here.len(), there.len());

    // Regions: every sufficiently large body, and the image in twelve parts.
    let [width, height] = SIZE.map(|side| side as usize);
    let body = |id: u16| (0..width * height).filter(|&i| instances[i] == id).collect::<Vec<_>>();
    let mut regions: Vec<(String, Vec<usize>)> =
        (0..=instances.iter().copied().max().unwrap_or(0)).map(|id| (format!("body {id}"), body(id))).collect();
    for cell in 0..12 {
        let inside = |i: &usize| (i % width) * 4 / width + 4 * ((i / width) * 3 / height) == cell;
        regions.push((format!("cell {cell}"), (0..width * height).filter(inside).collect()));
    }
    let mut compared = 0;
    for (name, pixels) in regions.iter().filter(|(_, pixels)| pixels.len() >= 60) {
        let mean = |radiance: &[f64], channel: usize| {
            pixels.iter().map(|&i| radiance[3 * i + channel]).sum::<f64>() / pixels.len() as f64
        };
        let error = |variance: &[f64]| pixels.iter().map(|&i| variance[i]).sum::<f64>() / (pixels.len() as f64).powi(2);
        let sigma = (error(&here_variance) + error(&there_variance)).sqrt();
        let luminance =
            |radiance: &[f64]| 0.2126 * mean(radiance, 0) + 0.7152 * mean(radiance, 1) + 0.0722 * mean(radiance, 2);
        let (a, b) = (luminance(&here), luminance(&there));
        println!(
            "{name}: {} px, {a:.2} and {b:.2} nits, {:+.2} %, sigma {:.2} %",
            pixels.len(),
            100.0 * (b / a - 1.0),
            100.0 * sigma / a
        );
        // Tolerance for noise, and half a percent for 8-bit images, lights with corners, and edges of objects.
        assert!((a - b).abs() < 4.0 * sigma + 0.005 * a, "{name}: {a} and {b} nits, sigma {sigma}");
        for channel in 0..3 {
            let (x, y) = (mean(&here, channel) / a, mean(&there, channel) / b);
            assert!((x - y).abs() < 0.03, "{name}: channel {channel} is {x} and {y} of the luminance");
        }
        compared += 1;
    }
    assert!(compared >= 15, "{compared} regions");
    let center =
        Point3::from(view_of(&json_of(&out.join("gltf/000000.glb"))).camera.world_from_camera.translation.vector);
    assert!(center.z > 0.0, "z is up");
}
