//! The glTF writer: the scene that another library reads equals the written scene.

use gltf::mesh::util::ReadIndices;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;
use syntable_model::context::{Collected, Serial};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::*;
use syntable_testing::takes::{dataset, files, writer};
use syntable_write as _;

type Matrix = [[f64; 4]; 4];

fn texture(width: u32, height: u32, encoding: Encoding, texel: impl Fn(u32, u32) -> [u8; 4]) -> Arc<Texture> {
    let texels: Vec<u8> = (0..width * height).flat_map(|i| texel(i % width, i / width)).collect();
    let digest = Hasher::new("test").number(encoding as u8 as f64).bytes(&texels).finish();
    Arc::new(Texture { width, height, texels, encoding, wrap: [Wrap::Repeat, Wrap::Clamp], digest })
}

/// A box of 20 × 30 × 40 cm with shared corners, texture coordinates, colors and two material slots: the top is the
/// second.
fn crate_mesh() -> Mesh {
    let corner = |i: usize| [(i & 1) as f32 * 0.2, (i >> 1 & 1) as f32 * 0.3, (i >> 2 & 1) as f32 * 0.4];
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh::new(MeshData {
        positions: (0..8).map(corner).collect(),
        uvs: (0..8).map(|i| [corner(i)[0] * 5.0, corner(i)[2] * 2.5]).collect(),
        colors: (0..8).map(|i| [1.0, i as f32 / 8.0, 0.0]).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        slots: (0..12).map(|t| u16::from(t / 2 == 1)).collect(),
        ..Default::default()
    })
    .expect("sound")
}

fn object(name: &str, mesh: Arc<Mesh>, materials: Vec<Material>) -> Arc<Object> {
    Arc::new(Object {
        name: name.into(),
        category: "crate".into(),
        mass: MassProperties::of_mesh(&mesh, 1.0, MassOrigin::Known),
        mesh,
        materials: materials.into_iter().map(Arc::new).collect(),
        collision: None,
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        friction: 0.5,
        license: "CC0-1.0".into(),
        digest: Digest::of(name.as_bytes()),
    })
}

/// A material with every layer; its textures use other channels than glTF.
fn rich() -> Material {
    let color = texture(4, 2, Encoding::Srgb, |x, y| [x as u8 * 60, y as u8 * 100, 9, 255 - x as u8]);
    let rough = texture(2, 2, Encoding::Linear, |x, y| [(x + 2 * y) as u8 * 40, 0, 0, 255]);
    let metal = texture(4, 4, Encoding::Linear, |x, _| [0, 0, x as u8 * 50, 255]);
    let transform = UvTransform { scale: [2.0, 3.0], rotation: 0.5, offset: [0.25, -0.5] };
    let mut material = Material::plain("rich", [0.8, 0.7, 0.6], 0.5);
    material.base_color.texture = Some(TextureRef { texture: color.clone(), transform });
    material.roughness.texture = Some((rough.clone().into(), 0));
    material.metallic = Scalar { factor: 0.75, texture: Some((metal.clone().into(), 2)) };
    material.normal = Some(NormalMap { map: metal.clone().into(), strength: 0.5 });
    material.emission = Color { factor: [300.0, 150.0, 0.0], texture: Some(color.into()) };
    material.ior = 1.4;
    material.alpha = Alpha::Blend { factor: 0.5 };
    material.clearcoat = Some(Clearcoat {
        strength: Scalar { factor: 0.9, texture: Some((metal.clone().into(), 2)) },
        roughness: Scalar { factor: 0.1, texture: None },
        normal: Some(NormalMap { map: metal.into(), strength: 1.0 }),
    });
    material.sheen = Some(Sheen { color: Color::constant([0.25, 0.5, 1.0]), roughness: Scalar::texture(rough, 0) });
    material.transmission = Some(Transmission {
        fraction: Scalar::constant(0.875),
        volume: Some(Volume { attenuation_color: [0.5, 0.25, 1.0], attenuation_distance_m: 0.02 }),
    });
    material.license = "CC-BY-4.0".into();
    material.with_digest()
}

fn pose(turn: [f64; 3], at: [f64; 3]) -> Pose {
    Pose::from_parts(at.into(), UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]))
}

fn scene() -> Scene {
    let mesh = Arc::new(crate_mesh());
    let shared = object("crate", mesh.clone(), vec![Material::plain("plain", [0.2; 3], 0.4), rich()]);
    let mut builder = SceneBuilder::new(SceneId(3), 0);
    builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.7], [1.0, 0.8])).into();
    let mut add = |object: &Arc<Object>, world_from_body, role, surface| {
        let asset = AssetRef { pool: "pool".into(), name: object.name.clone() };
        let draft = BodyDraft::new(asset, object.clone(), world_from_body, role, Motion::Fixed);
        builder.add(draft.with_material_override(surface))
    };
    let lid = add(&shared, pose([0.3, -0.7, 2.0], [0.1, 0.2, 0.9]), Role::Object, None);
    add(&shared, pose([1.0, 0.0, 0.0], [-0.3, 0.1, 0.8]), Role::Object, None);
    let wood = Arc::new(Material { tile_m: 0.5, ..rich() }.with_digest());
    let boxed = TextureMapping::Box { rotation: FRAC_PI_2 as f32, offset: [0.125, 0.0] };
    let base = add(
        &shared,
        pose([0.0; 3], [0.0, 0.0, 0.3]),
        Role::Support,
        Some(MaterialOverride { material: wood.clone(), mapping: boxed }),
    );
    let moved = TextureMapping::Uv(UvTransform { scale: [2.0, 4.0], rotation: 0.0, offset: [0.5, 0.0] });
    add(&shared, pose([0.0; 3], [0.0; 3]), Role::Room, Some(MaterialOverride { material: wood, mapping: moved }));
    // Links of a mechanism are exported as bodies at their current poses.
    let hinge = Joint {
        parent: 0,
        kind: JointKind::Revolute,
        parent_from_joint: Pose::identity(),
        axis: Vector3::x(),
        limits: Some([0.0, 2.0]),
        position: 0.5,
    };
    let link = |name: &str, body, joint| Link { name: name.into(), body, joint };
    let links = vec![link("base", base, None), link("lid", lid, Some(hinge))];
    builder.articulations.push(Articulation { name: "box".into(), links });
    let scene = builder.freeze(SettleReport::default()).expect("a scene");
    // Objects get the first ids, regardless of the order of the links.
    let bodies: Vec<u16> = scene.articulations[0].links.iter().map(|link| link.body.0).collect();
    assert_eq!(bodies, [3, 1]);
    scene
}

#[test]
fn articulations_that_are_no_trees_are_refused() {
    type Change<'c> = &'c dyn Fn(&mut Vec<Link<BodyHandle>>);
    let mesh = Arc::new(crate_mesh());
    let shared = object("crate", mesh, vec![Material::plain("plain", [0.2; 3], 0.4), rich()]);
    let frozen = |change: Change| {
        let mut builder = SceneBuilder::default();
        let body = |builder: &mut SceneBuilder| {
            let asset = AssetRef { pool: "pool".into(), name: "crate".into() };
            builder.add(BodyDraft::new(asset, shared.clone(), Pose::identity(), Role::Object, Motion::Fixed))
        };
        let joint = |parent| Joint {
            parent,
            kind: JointKind::Prismatic,
            parent_from_joint: Pose::identity(),
            axis: Vector3::z(),
            limits: None,
            position: 0.0,
        };
        let names = ["base", "drawer", "handle"];
        let joints = [None, Some(joint(0)), Some(joint(1))];
        let mut links: Vec<Link<BodyHandle>> = (names.into_iter().zip(joints))
            .map(|(name, joint)| Link { name: name.into(), body: body(&mut builder), joint })
            .collect();
        change(&mut links);
        builder.articulations.push(Articulation { name: "cabinet".into(), links });
        builder.freeze(SettleReport::default()).map_err(|error| error.to_string())
    };
    assert!(frozen(&|_| {}).is_ok());
    let joint = |link: &mut Link<BodyHandle>, change: &dyn Fn(&mut Joint)| link.joint.iter_mut().for_each(change);
    let changes: [(&str, Change); 6] = [
        ("`drawer` has no joint", &|links| links[1].joint = None),
        ("`drawer` comes before its parent", &|links| joint(&mut links[1], &|joint| joint.parent = 2)),
        ("two links have the name `base`", &|links| links[2].name = "base".into()),
        ("the joint of its link `handle`", &|links| joint(&mut links[2], &|joint| joint.axis *= 2.0)),
        ("the joint of its link `drawer`", &|links| joint(&mut links[1], &|joint| joint.limits = Some([0.1, 0.2]))),
        ("no link", &|links| links.clear()),
    ];
    for (says, change) in changes {
        let error = frozen(change).expect_err(says);
        assert!(error.contains(says) && error.contains("cabinet"), "{error}");
    }
}

fn view(number: u32) -> View {
    let intrinsics = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 510.0, cx: 322.0, cy: 235.0 };
    let eye = Point3::new(1.0, 0.5 + f64::from(number), 1.5);
    let mut camera = Camera::pinhole(intrinsics, look_at(eye, Point3::new(0.0, 0.0, 0.7), Vector3::z()));
    camera.distortion = Some(Distortion::brown_conrady([-0.1, 0.01, 0.0], [0.001, 0.0]));
    let (half_u, half_v) = (Vector3::new(0.4, 0.3, 0.0), Vector3::new(0.15, -0.2, 0.0));
    let map = Arc::new(EnvironmentMap::constant([100.0; 3]));
    let towards = Vector3::new(1.0, 2.0, 2.0) / 3.0;
    View {
        moment: Moment::START,
        id: ViewId(number),
        camera,
        exposure: Exposure::Fixed { ev100: 7.0 },
        rig: None,
        lights: vec![
            Light::Sphere(SphereLight {
                center: Point3::new(0.5, -1.0, 3.0),
                radius: 0.2,
                radiance: [500.0, 400.0, 300.0],
            }),
            Light::Rect(RectLight { center: Point3::new(0.0, 0.0, 2.5), half_u, half_v, radiance: [1000.0; 3] }),
            Light::Disk(DiskLight {
                center: Point3::new(1.0, 0.0, 2.5),
                normal: -Vector3::z(),
                radius: 0.1,
                radiance: [2e3; 3],
            }),
            Light::Directional(DirectionalLight { towards, half_angle: 0.00465, irradiance: [9e4, 8e4, 7e4] }),
            Light::Environment(EnvironmentLight { map, scale: [2.0; 3], rotation: 1.0 }),
        ],
    }
}

/// Writes the scene with two views. Returns the files by path.
fn write(options: &str) -> BTreeMap<String, Vec<u8>> {
    write_scene(&scene(), options)
}

fn write_scene(scene: &Scene, options: &str) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let (writer, dataset) = (writer("gltf", options).expect("good options"), dataset(4, 2));
    let views = [view(0), view(1)];
    let log = Collected::default();
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(scene);
    let mut scene_writer = writer.scene(&cx, Output::new(folder.path(), "gltf", scene.id)).expect("starts");
    for view in &views {
        scene_writer.view(&cx.view(view), &Products::new()).expect("a view");
    }
    scene_writer.close(&cx, &Products::new()).expect("closes");
    files(folder.path())
}

/// Opens a file with another library. Also returns its JSON.
fn open(bytes: &[u8]) -> (gltf::Gltf, Json) {
    let size = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let json = serde_json::from_slice(&bytes[20..20 + size]).expect("JSON");
    (gltf::Gltf::from_slice(bytes).expect("valid"), json)
}

fn one(options: &str) -> (gltf::Gltf, Json) {
    open(&write(options)["gltf/000003.glb"])
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    // Matrices are lists of columns, as in glTF.
    std::array::from_fn(|c| std::array::from_fn(|r| (0..4).map(|k| a[k][r] * b[c][k]).sum()))
}

fn transform(m: Matrix, p: [f32; 3]) -> Point3<f64> {
    let p = [f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), 1.0];
    let [x, y, z, _]: [f64; 4] = std::array::from_fn(|r| (0..4).map(|k| m[k][r] * p[k]).sum());
    Point3::new(x, y, z)
}

/// Transforms of all nodes in the file's world, by name.
fn world(document: &gltf::Document) -> BTreeMap<String, (Matrix, usize)> {
    fn walk(node: gltf::Node<'_>, parent: Matrix, found: &mut BTreeMap<String, (Matrix, usize)>) {
        let own = node.transform().matrix().map(|column| column.map(f64::from));
        let here = product(parent, own);
        found.insert(node.name().expect("named").to_owned(), (here, node.index()));
        node.children().for_each(|child| walk(child, here, found));
    }
    let identity = std::array::from_fn(|c| std::array::from_fn(|r| f64::from(u8::from(c == r))));
    let mut found = BTreeMap::new();
    document.default_scene().expect("a scene").nodes().for_each(|node| walk(node, identity, &mut found));
    found
}

/// Converts y up to z up.
fn z_up(p: Point3<f64>) -> Point3<f64> {
    Point3::new(p.x, -p.z, p.y)
}

struct MeshPart {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    material: usize,
}

fn parts(file: &gltf::Gltf, mesh: usize) -> Vec<MeshPart> {
    let blob = file.blob.as_deref().expect("a binary chunk");
    let mesh = file.meshes().nth(mesh).expect("a mesh");
    mesh.primitives()
        .map(|primitive| {
            let reader = primitive.reader(|_| Some(blob));
            let indices: Vec<u32> = match reader.read_indices().expect("indices") {
                ReadIndices::U16(indices) => indices.map(u32::from).collect(),
                other => other.into_u32().collect(),
            };
            MeshPart {
                positions: reader.read_positions().expect("positions").collect(),
                uvs: reader.read_tex_coords(0).map(|uvs| uvs.into_f32().collect()).unwrap_or_default(),
                colors: reader.read_colors(0).map(|colors| colors.into_rgb_f32().collect()).unwrap_or_default(),
                triangles: indices.as_chunks().0.to_vec(),
                material: primitive.material().index().expect("a material"),
            }
        })
        .collect()
}

#[test]
fn bodies_have_their_poses() {
    let (file, json) = one("");
    let (scene, nodes) = (scene(), world(&file.document));
    for body in scene.bodies() {
        let name = format!("{} pool/crate", body.id);
        let (matrix, node) = nodes[&name];
        assert_eq!(json["nodes"][node]["extras"]["instance_id"], json!(body.id.0));
        let mesh = json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
        let mut triangles = Vec::new();
        for part in parts(&file, mesh) {
            let at = |i: u32| transform(matrix, part.positions[i as usize]);
            triangles.extend(part.triangles.iter().map(|t| t.map(at)));
        }
        let data = body.object.mesh.data();
        assert_eq!(triangles.len(), data.triangles.len());
        // Triangles are sorted by slot; ours of slot 0 come first.
        let mut order: Vec<usize> = (0..12).collect();
        if body.material_override.is_none() {
            order.sort_by_key(|&t| data.slots[t]);
        }
        for (&t, got) in order.iter().zip(&triangles) {
            for (want, got) in body.object.mesh.corners(t).into_iter().zip(got) {
                let want = body.world_from_body * want;
                assert!((z_up(*got) - want).norm() < 1e-6, "{name}, triangle {t}: {got} {want}");
            }
        }
    }
    // The file contains the exact numbers of the pose.
    let (_, node) = nodes["1 pool/crate"];
    let want: [f64; 3] = scene.bodies()[0].world_from_body.translation.vector.into();
    assert_eq!(json["nodes"][node]["translation"], json!(want));
    assert_eq!(json["asset"]["copyright"], json!("CC-BY-4.0, CC0-1.0"));
}

#[test]
fn meshes_and_images_are_written_once() {
    let (file, json) = one("lights = \"none\"");
    let mesh = |i: usize| json["nodes"][i]["mesh"].as_u64().expect("a mesh");
    assert_eq!(mesh(1), mesh(2));
    assert_eq!(file.meshes().count(), 3);
    // Two slots have one material each; an override covers both.
    let used: Vec<Vec<usize>> = (0..3).map(|i| parts(&file, i).iter().map(|part| part.material).collect()).collect();
    assert_eq!(used, [vec![0, 1], vec![2], vec![2]]);
    // Color; packed roughness and metalness; metalness as normals; metalness as clearcoat; roughness as sheen.
    assert_eq!(file.images().count(), 5);
    assert_eq!(json["samplers"], json!([{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 33071 }]));
    for view in json["bufferViews"].as_array().expect("views") {
        assert_eq!(view["byteOffset"].as_u64().expect("a number") % 4, 0);
    }
    assert_eq!(file.blob.as_ref().expect("a chunk").len() % 4, 0);
}

fn decode(file: &gltf::Gltf, texture: &Json, json: &Json) -> (u32, u32, Vec<u8>, usize) {
    let source = json["textures"][texture["index"].as_u64().expect("an index") as usize]["source"].clone();
    let view = &json["bufferViews"][json["images"][source.as_u64().expect("an index") as usize]["bufferView"]
        .as_u64()
        .expect("an index") as usize];
    let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().expect("a number") as usize);
    let bytes = &file.blob.as_ref().expect("a chunk")[start..start + length];
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG file");
    let mut texels = vec![0; reader.output_buffer_size().expect("small")];
    let info = reader.next_frame(&mut texels).expect("decodes");
    (info.width, info.height, texels, info.color_type.samples())
}

#[test]
fn materials_match_the_scene() {
    let (file, json) = one("");
    let number = |value: &Json| value.as_f64().expect("a number");
    let plain = &json["materials"][0];
    assert_eq!(plain["doubleSided"], json!(true));
    assert!(plain.get("extensions").is_none() && plain.get("alphaMode").is_none());
    assert_eq!(plain["pbrMetallicRoughness"]["roughnessFactor"], json!(0.4));
    let rich = &json["materials"][1];
    let pbr = &rich["pbrMetallicRoughness"];
    assert_eq!(pbr["baseColorFactor"], json!([0.8, 0.7, 0.6, 0.5]));
    assert_eq!((&rich["alphaMode"], &pbr["metallicFactor"]), (&json!("BLEND"), &json!(0.75)));
    let transform = &pbr["baseColorTexture"]["extensions"]["KHR_texture_transform"];
    assert_eq!((&transform["scale"], &transform["rotation"]), (&json!([2.0, 3.0]), &json!(0.5)));
    // Nits are the factor times the strength.
    let extensions = &rich["extensions"];
    assert_eq!(extensions["KHR_materials_emissive_strength"]["emissiveStrength"], json!(300.0));
    assert_eq!(rich["emissiveFactor"], json!([1.0, 0.5, 0.0]));
    assert_eq!(extensions["KHR_materials_ior"]["ior"], json!(1.4));
    assert_eq!(rich["normalTexture"]["scale"], json!(0.5));
    let coat = &extensions["KHR_materials_clearcoat"];
    assert_eq!((number(&coat["clearcoatFactor"]), number(&coat["clearcoatRoughnessFactor"])), (0.9, 0.1));
    let sheen = &extensions["KHR_materials_sheen"];
    assert_eq!((&sheen["sheenColorFactor"], &sheen["sheenRoughnessFactor"]), (&json!([0.25, 0.5, 1.0]), &json!(1.0)));
    assert_eq!(extensions["KHR_materials_transmission"], json!({ "transmissionFactor": 0.875 }));
    let volume = &extensions["KHR_materials_volume"];
    assert!(number(&volume["thicknessFactor"]) > 0.0);
    assert_eq!((&volume["attenuationColor"], &volume["attenuationDistance"]), (&json!([0.5, 0.25, 1.0]), &json!(0.02)));
    for used in json["materials"].as_array().expect("materials") {
        for name in used["extensions"].as_object().into_iter().flatten().map(|(name, _)| name) {
            assert!(json["extensionsUsed"].as_array().expect("a list").contains(&json!(name)), "{name}");
        }
    }

    // Images: roughness (2 × 2, red) in green, metalness (4 × 4, blue) in blue.
    let (width, height, texels, samples) = decode(&file, &pbr["metallicRoughnessTexture"], &json);
    assert_eq!((width, height, samples), (4, 4, 3));
    for (i, texel) in texels.chunks(3).enumerate() {
        let (x, y) = (i % 4, i / 4);
        assert_eq!(texel, [255, (x / 2 + 2 * (y / 2)) as u8 * 40, x as u8 * 50], "{x} {y}");
    }
    let (.., texels, samples) = decode(&file, &pbr["baseColorTexture"], &json);
    assert_eq!((samples, &texels[..8]), (4, &[0, 0, 9, 255, 60, 0, 9, 254][..]));
    let (.., texels, samples) = decode(&file, &coat["clearcoatTexture"], &json);
    assert_eq!((samples, texels[3]), (3, 50));
    let (.., texels, samples) = decode(&file, &sheen["sheenRoughnessTexture"], &json);
    assert_eq!((samples, texels[3], texels[7]), (4, 0, 40));
}

#[test]
fn sizes_and_changed_colors_are_baked() {
    let recolor = Recolor { hue_deg: 100.0, saturation: 1.2, brightness: 0.7 };
    let mesh = Arc::new(crate_mesh());
    let plain_mesh = Arc::new(Mesh::new(MeshData { colors: Vec::new(), ..crate_mesh().into_data() }).expect("sound"));
    let plain = || Material::plain("plain", [0.9, 0.4, 0.2], 0.4);
    let other = || Material::plain("other", [0.3, 0.8, 1.0], 0.4);
    let textured = object("textured", plain_mesh, vec![plain(), rich()]);
    let colored = object("colored", mesh.clone(), vec![plain()]);
    let two_factors = object("two_factors", mesh.clone(), vec![plain(), other()]);
    let mixed = object("mixed", mesh, vec![plain(), rich()]);
    let mut builder = SceneBuilder::new(SceneId(3), 0);
    builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.7], [1.0, 0.8])).into();
    for object in [Arc::new(textured.resized(1.5).expect("sound")), colored, two_factors, mixed] {
        let asset = AssetRef { pool: "pool".into(), name: object.name.clone() };
        let draft = BodyDraft::new(asset, object, Pose::identity(), Role::Object, Motion::Fixed);
        builder.add(draft.with_recolor(Some(recolor)));
    }
    let scene = builder.freeze(SettleReport::default()).expect("a scene");
    let (file, json) = open(&write_scene(&scene, "lights = \"none\"")["gltf/000003.glb"]);
    let is_near = |got: &[f32], want: [f32; 3], by: f32| (0..3).all(|c| (got[c] - want[c]).abs() < by);
    let factor = |material: usize| -> Vec<f32> {
        let factor = json["materials"][material]["pbrMetallicRoughness"]["baseColorFactor"].as_array().expect("a list");
        factor.iter().map(|x| x.as_f64().expect("a number") as f32).collect()
    };
    let matrix = recolor.matrix();
    assert!(is_near(&factor(0), matrix.apply([0.9, 0.4, 0.2]), 1e-6), "{:?}", factor(0));
    assert_eq!(factor(1), [1.0, 1.0, 1.0, 0.5]);
    let pbr = &json["materials"][1]["pbrMetallicRoughness"];
    let (.., texels, _) = decode(&file, &pbr["baseColorTexture"], &json);
    let linear = |code: u8| syntable_model::color::srgb_to_linear(f32::from(code) / 255.0);
    for (i, texel) in texels.chunks(4).enumerate() {
        let own = [(i % 4) as u8 * 60, (i / 4) as u8 * 100, 9].map(linear);
        let want = matrix.apply([0.8 * own[0], 0.7 * own[1], 0.6 * own[2]]);
        let got = [texel[0], texel[1], texel[2]].map(linear);
        assert!(is_near(&got, want, 6e-3) && texel[3] == 255 - (i % 4) as u8, "{i}: {got:?}, not {want:?}");
    }
    // With vertex colors, a viewer shows the factor times the color: the change of the renderer's product, face by face. The green of
    // a corner tells its number.
    let number = |p: [f32; 3]| (0..3).filter(|&axis| p[axis] > 0.1).map(|axis| 1 << axis).sum::<u8>();
    let (orange, blue) = ([0.9, 0.4, 0.2], [0.3, 0.8, 1.0]);
    for (node, factors) in [(2, &[Some(orange); 2][..]), (3, &[Some(orange), Some(blue)]), (4, &[Some(orange), None])] {
        let found = parts(&file, json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize);
        assert_eq!(found.iter().map(|part| part.triangles.len()).sum::<usize>(), 12);
        for part in &found {
            // The second slot is the top, on the corners from 4 on.
            let is_top = part.triangles.len() == 2;
            for &i in part.triangles.as_flattened() {
                let i = i as usize;
                let own = [1.0, f32::from(number(part.positions[i])) / 8.0, 0.0];
                let shown: Vec<f32> = (0..3).map(|c| factor(part.material)[c] * part.colors[i][c]).collect();
                let want = match factors[if is_top { 1 } else { 0 }] {
                    Some(factor) => matrix.apply([0, 1, 2].map(|c: usize| factor[c] * own[c])),
                    // The texture has the change.
                    None => own,
                };
                assert!(is_near(&shown, want, 1e-6), "node {node}, vertex {i}: {shown:?}, not {want:?}");
            }
        }
    }
    // Emission keeps its colors. The mesh is as large as the object, and the node says so.
    assert_ne!(json["materials"][1]["emissiveTexture"]["index"], pbr["baseColorTexture"]["index"]);
    let highest = parts(&file, 0).iter().flat_map(|part| part.positions.clone()).fold(0.0, |high, p| p[2].max(high));
    assert!((highest - 0.6).abs() < 1e-6, "{highest}");
    let extras = &json["nodes"][1]["extras"];
    assert_eq!(extras["scale"], json!(1.5));
    assert_eq!(extras["recolor"], json!({ "hue_deg": 100.0, "saturation": 1.2, "brightness": 0.7 }));
}

#[test]
fn textures_over_whole_bodies_become_coordinates() {
    let (file, json) = one("lights = \"none\"");
    let mesh = |node: usize| json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
    // Box-mapped with tiles of half a meter, rotated by 90°, shifted by an eighth: the same as in the renderer, face by
    // face.
    let part = &parts(&file, mesh(3))[0];
    let mut seen = 0;
    for triangle in &part.triangles {
        let [a, b, c] = triangle.map(|i| Vector3::from(part.positions[i as usize].map(f64::from)));
        let n = (b - a).cross(&(c - a));
        for &i in triangle {
            let [x, y, z] = part.positions[i as usize].map(f64::from);
            let [s, t] = match n.abs().imax() {
                0 => [y * n.x.signum(), z],
                1 => [-x * n.y.signum(), z],
                _ => [x * n.z.signum(), y],
            };
            let want = [-t / 0.5 + 0.125, s / 0.5];
            let [u, v] = part.uvs[i as usize].map(f64::from);
            assert!((u - want[0]).abs() < 1e-5 && (1.0 - v - want[1]).abs() < 1e-5, "{n}: {u} {v} {want:?}");
            seen += 1;
        }
    }
    // Flat faces with a normal map have their own vertices.
    assert_eq!((seen, part.positions.len()), (36, 36));
    // Mapped by the mesh's own coordinates, scaled and shifted.
    let part = &parts(&file, mesh(4))[0];
    for (uv, p) in part.uvs.iter().zip(&part.positions) {
        // u is five times x, v two and a half times z.
        let want = [p[0] * 5.0 * 2.0 + 0.5, 1.0 - p[2] * 2.5 * 4.0];
        assert!((uv[0] - want[0]).abs() < 1e-5 && (uv[1] - want[1]).abs() < 1e-5, "{uv:?} {want:?}");
    }
}

#[test]
fn cameras_have_pose_and_field_of_view() {
    let (file, json) = one("");
    let nodes = world(&file.document);
    assert_eq!(file.cameras().count(), 2);
    for number in [0, 1] {
        let camera = view(number).camera;
        let (matrix, node) = nodes[&format!("view {number}")];
        let axis = |c: usize| Vector3::from([matrix[c][0], matrix[c][1], matrix[c][2]]);
        let z_up = |v: Vector3<f64>| Vector3::new(v.x, -v.z, v.y);
        let pose = camera.world_from_camera;
        assert!((z_up(-axis(2)) - pose * Vector3::z()).norm() < 1e-6, "looks forward");
        assert!((z_up(axis(1)) + pose * Vector3::y()).norm() < 1e-6, "up is not down");
        assert!((z_up(axis(3)) - pose.translation.vector).norm() < 1e-6);
        let index = json["nodes"][node]["camera"].as_u64().expect("a camera") as usize;
        let (perspective, extras) = (&json["cameras"][index]["perspective"], &json["cameras"][index]["extras"]);
        let yfov = perspective["yfov"].as_f64().expect("an angle");
        // A point at the upper edge of a centered image.
        assert!(((yfov / 2.0).tan() - 240.0 / 510.0).abs() < 1e-12);
        let aspect = perspective["aspectRatio"].as_f64().expect("a ratio");
        assert!((aspect * (yfov / 2.0).tan() - 320.0 / 500.0).abs() < 1e-12);
        assert_eq!(extras["K"], json!([[500.0, 0.0, 322.0], [0.0, 510.0, 235.0], [0.0, 0.0, 1.0]]));
        assert_eq!(extras["distortion"]["radial"], json!([-0.1, 0.01, 0.0]));
    }
}

#[test]
fn emissive_geometry_has_the_power_and_direction_of_its_light() {
    let (file, json) = one("");
    let nodes = world(&file.document);
    let lit = |name: &str| {
        let (matrix, node) = nodes[name];
        let mesh = json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
        let mut fronts = parts(&file, mesh);
        let front = fronts.remove(0);
        let at = |i: u32| z_up(transform(matrix, front.positions[i as usize]));
        let triangles: Vec<_> = front.triangles.iter().map(|t| t.map(at)).collect();
        let area: Vector3<f64> = triangles.iter().map(|[a, b, c]| (b - a).cross(&(c - a)) / 2.0).sum();
        let total: f64 = triangles.iter().map(|[a, b, c]| (b - a).cross(&(c - a)).norm() / 2.0).sum();
        let material = &json["materials"][front.material];
        let strength = &material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
        let factor = material["emissiveFactor"].as_array().expect("a color").clone();
        let radiance: Vec<f64> =
            factor.iter().map(|x| x.as_f64().expect("x") * strength.as_f64().expect("a strength")).collect();
        (area, total, radiance, material["doubleSided"].clone(), fronts.len())
    };
    let (_, total, radiance, ..) = lit("light 0 (sphere)");
    assert!((total / (4.0 * PI * 0.04) - 1.0).abs() < 1e-5, "{total}");
    assert!((radiance[0] - 500.0).abs() < 1e-4 && (radiance[2] - 300.0).abs() < 1e-4, "{radiance:?}");
    // Half edges of 0.5 m and 0.25 m; u × v points down.
    let (area, _, radiance, two_sided, backs) = lit("light 1 (rectangle)");
    assert!((area - Vector3::new(0.0, 0.0, -0.5)).norm() < 1e-6, "{area}");
    assert_eq!((radiance, two_sided, backs), (vec![1000.0; 3], json!(false), 1));
    let (area, ..) = lit("light 2 (disk)");
    assert!((area + Vector3::z() * PI * 0.01).norm() < 1e-6, "{area}");
    // The sun has no geometry.
    let (matrix, node) = nodes["light 3 (sun)"];
    let towards = z_up(Point3::from([matrix[2][0], matrix[2][1], matrix[2][2]]));
    assert!((towards.coords - Vector3::new(1.0, 2.0, 2.0) / 3.0).norm() < 1e-6);
    assert!(json["nodes"][node]["extensions"]["KHR_lights_punctual"].is_object());
    let sun = &json["extensions"]["KHR_lights_punctual"]["lights"][0];
    assert_eq!((&sun["type"], &sun["intensity"]), (&json!("directional"), &json!(9e4)));
    let around = &json["scenes"][0]["extras"]["environments"][0];
    assert_eq!((&around["file"], &around["rotation_rad"]), (&json!("000003_environment.hdr"), &json!(1.0)));
}

#[test]
fn point_lights_have_candela() {
    let (_, json) = one("lights = \"punctual\"");
    let lights = json["extensions"]["KHR_lights_punctual"]["lights"].as_array().expect("lights");
    let of =
        |i: usize| (lights[i]["type"].as_str().expect("a type"), lights[i]["intensity"].as_f64().expect("a number"));
    let kinds: Vec<&str> = (0..4).map(|i| of(i).0).collect();
    assert_eq!(kinds, ["point", "spot", "spot", "directional"]);
    // 500 nits over a disk of 0.2 m; 1000 nits over half a square meter.
    assert!((of(0).1 - 500.0 * PI * 0.04).abs() < 1e-9 && (of(1).1 - 500.0).abs() < 1e-9);
    let (_, dark) = one("lights = \"none\"");
    assert!(dark.get("extensions").is_none());
}

/// The script next to the files has the values that Blender's importer lacks: units, the size of the sun, the sky.
#[test]
fn the_script_for_blender_has_the_numbers_of_the_lights() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in write("") {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        std::fs::write(path, bytes).expect("writable");
    }
    syntable_testing::takes::finish(
        folder.path(),
        "gltf",
        &*writer("gltf", "").expect("good options"),
        &dataset(4, 2),
        &[3],
    )
    .expect("done");
    let script = folder.path().join("gltf/import_in_blender.py");
    let mut python = std::process::Command::new("python3");
    let Ok(output) = python.arg(&script).arg("--show").arg(folder.path().join("gltf/000003.glb")).output() else {
        return syntable_testing::tools::skip("python3");
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    // In this mode, the importer uses lux and candela directly instead of dividing them by 683 lm/W.
    assert_eq!(json["lighting_mode"], json!("COMPAT"));
    let sun = &json["suns"]["light 3 (sun)"];
    let number = |value: &Json| value.as_f64().expect("a number");
    for (i, irradiance) in [9e4, 8e4, 7e4].into_iter().enumerate() {
        let got = number(&sun["strength"]) * number(&sun["color"][i]);
        assert!((got / irradiance - 1.0).abs() < 1e-6, "{got} lx, not {irradiance}");
    }
    assert!((number(&sun["angle"]) - 0.0093).abs() < 1e-12, "the angular diameter is twice 0.00465");
    assert_eq!(json["suns"].as_object().map(|suns| suns.len()), Some(1));
    let sky = &json["skies"][0];
    assert_eq!(
        sky["file"].as_str().map(std::path::Path::new),
        Some(&*folder.path().join("gltf/000003_environment.hdr"))
    );
    assert!(folder.path().join("gltf/000003_environment.hdr").is_file());
    // The map is rotated by +1 rad, and is already in nits.
    assert_eq!((number(&sky["lookup_rotation_z"]), number(&sky["strength"])), (-1.0, 1.0));
    let (camera, k) = (&json["cameras"]["view 1"], view(0).camera.intrinsics);
    assert_eq!((&camera["view"], &camera["size"]), (&json!(1), &json!([k.width, k.height])));
    // Blender builds the image from its vertical field of view, stretches pixels, and shifts it in units of the image
    // height.
    let pair = |key: &str| [number(&camera[key][0]), number(&camera[key][1])];
    let ([wide, high], [right, up]) = (pair("pixel_aspect"), pair("shift"));
    let [width, height] = [k.width, k.height].map(f64::from);
    let there = [k.fy * high / wide, width / 2.0 - right * height * high / wide, height / 2.0 + up * height];
    for (here, there) in [k.fx, k.cx, k.cy].into_iter().zip(there) {
        assert!((here / there - 1.0).abs() < 1e-12, "{here} px became {there} px: {camera}");
    }
    assert!(wide >= 1.0 && high >= 1.0, "Blender takes no pixels of less than one: {camera}");
}

#[test]
fn files_per_scene_or_view_and_the_same_twice() {
    for (options, names) in
        [("", vec!["gltf/000003"]), ("per = \"view\"", vec!["gltf/000003_0000", "gltf/000003_0001"])]
    {
        let first = write(options);
        let wanted = names.iter().flat_map(|name| [format!("{name}.glb"), format!("{name}_environment.hdr")]);
        assert_eq!(first.keys().cloned().collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
        assert!(first == write(options), "{options}: files differ");
        for (_, bytes) in first.iter().filter(|(name, _)| name.ends_with(".glb")) {
            let (file, json) = open(bytes);
            assert_eq!(file.cameras().count(), if names.len() == 1 { 2 } else { 1 });
            assert_eq!(bytes.len() as u64 % 4, 0);
            assert_eq!(json["buffers"][0]["byteLength"].as_u64(), file.blob.map(|blob| blob.len() as u64));
        }
        // Exports the files for other programs, such as Khronos' validator.
        if let Some(folder) = std::env::var_os("SYNTABLE_TEST_OUTPUT") {
            for (name, bytes) in first {
                let path = std::path::Path::new(&folder).join(name.replace('/', "_"));
                std::fs::write(path, bytes).expect("writable");
            }
        }
    }
}
