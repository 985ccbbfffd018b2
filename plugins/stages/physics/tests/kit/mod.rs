//! Shapes and scenes for the tests and the bench.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use syntable_model::context::{Cache, Collected, Context, NoCache, Serial};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::geometry::{Aabb, Pose, Translation3, UnitQuaternion, Vector3};
use syntable_model::random::Stream;
use syntable_model::registry::{Config, Entry, Stage};
use syntable_model::scene::*;
use syntable_model::stage::Settler;
use syntable_testing::assets::NoAssets;

// ---- Meshes ------------------------------------------------------------------------------------

/// A box with its center at `center`.
pub fn cuboid(center: [f32; 3], size: [f32; 3]) -> MeshData {
    let positions = (0..8)
        .map(|i| std::array::from_fn(|axis| center[axis] + size[axis] * if i >> axis & 1 == 0 { -0.5 } else { 0.5 }))
        .collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    MeshData { positions, triangles, ..Default::default() }
}

/// An open box of outer size, its walls and its floor of one thickness: one closed surface, its floor's underside at z
/// = 0.
pub fn tray([x, y, z]: [f32; 3], thick: f32) -> MeshData {
    let ring = |inset: f32, z: f32| {
        let [x, y] = [x, y].map(|size| size / 2.0 - inset);
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]
    };
    let rings = [ring(0.0, 0.0), ring(0.0, z), ring(thick, z), ring(thick, thick)];
    let mut triangles = vec![[0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]];
    for level in 0..3_u32 {
        for i in 0..4_u32 {
            let [a, b] = [4 * level + i, 4 * level + (i + 1) % 4];
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
    MeshData { positions: rings.concat(), triangles, ..Default::default() }
}

/// Joins meshes into one.
pub fn join(meshes: impl IntoIterator<Item = MeshData>) -> MeshData {
    let mut all = MeshData::default();
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

/// A grid of points that is periodic in both directions.
fn wrapped(rows: usize, columns: usize, point: impl Fn(f32, f32) -> [f32; 3]) -> MeshData {
    let positions = (0..rows * columns)
        .map(|i| point((i / columns) as f32 / rows as f32, (i % columns) as f32 / columns as f32))
        .collect();
    let at = |r: usize, c: usize| ((r % rows) * columns + c % columns) as u32;
    let triangles = (0..rows * columns)
        .map(|i| (i / columns, i % columns))
        .flat_map(|(r, c)| {
            let [a, b, c, d] = [at(r, c), at(r, c + 1), at(r + 1, c + 1), at(r + 1, c)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    MeshData { positions, triangles, ..Default::default() }
}

/// A closed profile (radius, height) revolved around the z axis.
fn revolved(profile: &[[f32; 2]], columns: usize) -> MeshData {
    let rows = profile.len();
    wrapped(rows, columns, |row, turn| {
        let [r, z] = profile[(row * rows as f32).round() as usize % rows];
        [r * (turn * TAU).cos(), r * (turn * TAU).sin(), z]
    })
}

pub fn sphere(radius: f32) -> MeshData {
    let rows = 32;
    let profile: Vec<[f32; 2]> = (0..=rows)
        .map(|i| PI * i as f32 / rows as f32)
        .map(|angle| [(radius * angle.sin()).max(0.0), -radius * angle.cos()])
        .collect();
    revolved(&profile, 48)
}

/// Six hollow and jagged shapes of about 900 to 2000 triangles and 5 to 15 cm.
pub fn shape_kit() -> Vec<(&'static str, MeshData)> {
    let torus = wrapped(24, 36, |v, u| {
        let (r, u) = (0.05 + 0.015 * (v * TAU).cos(), u * TAU);
        [r * u.cos(), r * u.sin(), 0.015 * (v * TAU).sin()]
    });
    let arc = |radius: f32, rows: i32| {
        (0..=rows).map(move |i| {
            let angle = PI / 2.0 * i as f32 / rows as f32;
            [radius * angle.sin(), 0.07 - radius * angle.cos()]
        })
    };
    let bowl: Vec<[f32; 2]> = arc(0.07, 9).chain(arc(0.065, 9).collect::<Vec<_>>().into_iter().rev()).collect();
    let wall = [[0.0, 0.0], [0.02, 0.0], [0.04, 0.0], [0.04, 0.03], [0.04, 0.06], [0.04, 0.09], [0.036, 0.09]];
    let cavity = [[0.036, 0.06], [0.036, 0.03], [0.036, 0.005], [0.02, 0.005], [0.0, 0.005]];
    let handle = wrapped(16, 12, |u, v| {
        let r = 0.028 + 0.005 * (v * TAU).cos();
        [0.045 + r * (u * TAU).cos(), 0.005 * (v * TAU).sin(), 0.045 + r * (u * TAU).sin()]
    });
    let outside_only = {
        let keep = |t: &[u32; 3]| t.iter().all(|&i| handle.positions[i as usize][0] > 0.037);
        MeshData { triangles: handle.triangles.iter().copied().filter(keep).collect(), ..handle.clone() }
    };
    let mug = join([revolved(&[&wall[..], &cavity[..]].concat(), 40), outside_only]);
    let ball = sphere(1.0);
    let blob = MeshData {
        positions: ball
            .positions
            .iter()
            .map(|&[x, y, z]| {
                let r = 0.035 * (1.0 + 0.35 * (3.0 * x + 1.0).sin() * (2.0 * y).cos() + 0.25 * (4.0 * z).sin());
                [1.3 * r * x, r * y, 0.8 * r * z]
            })
            .collect(),
        triangles: ball.triangles.clone(),
        ..Default::default()
    };
    let bone: Vec<[f32; 2]> = (0..=28)
        .map(|i| i as f32 / 28.0)
        .map(|t| [(0.009 + 0.016 * (2.0 * t - 1.0).powi(4)) * (PI * t).sin().max(0.0).powf(0.25), 0.14 * t])
        .collect();
    let star = wrapped(6, 80, |layer, turn| {
        let (z, inset) = [(-0.01, 0.0), (-0.01, 0.5), (-0.01, 1.0), (0.01, 1.0), (0.01, 0.5), (0.01, 0.0)]
            [(layer * 6.0).round() as usize % 6];
        let r = inset * (0.04 + 0.022 * (5.0 * turn * TAU).cos());
        [r * (turn * TAU).cos(), r * (turn * TAU).sin(), z]
    });
    vec![
        ("torus", torus),
        ("bowl", revolved(&bowl, 48)),
        ("mug", mug),
        ("blob", blob),
        ("bone", revolved(&bone, 24)),
        ("star", star),
    ]
}

// ---- Assets ------------------------------------------------------------------------------------

/// An object with a friction coefficient of one half.
pub fn object(name: &str, data: MeshData, mass_kg: f64) -> Arc<Object> {
    let corners: Vec<f32> = data.triangles.iter().flatten().flat_map(|&i| data.positions[i as usize]).collect();
    let mesh = Mesh::new(data).expect("a sound mesh");
    Arc::new(Object {
        name: name.into(),
        category: name.into(),
        mass: MassProperties::of_mesh(&mesh, mass_kg, MassOrigin::Known),
        mesh: Arc::new(mesh),
        materials: vec![Arc::new(Material::plain("gray", [0.5; 3], 0.5))],
        collision: None,
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        friction: 0.5,
        license: String::new(),
        digest: Hasher::new("test object").floats(corners.into_iter()).finish(),
    })
}

/// The shape kit as objects of 0.15 kg.
pub fn kit_objects() -> Vec<Arc<Object>> {
    shape_kit().into_iter().map(|(name, data)| object(name, data, 0.15)).collect()
}

/// Folders of scanned assets: the small one of the checkout, and where it exists a larger one, named by
/// `SYNTABLE_ASSETS` or in `shared/assets` beside the checkout.
pub fn assets() -> Vec<PathBuf> {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let larger = match std::env::var_os("SYNTABLE_ASSETS") {
        Some(folder) => PathBuf::from(folder),
        None => crate_folder.join("../../../../shared/assets"),
    };
    let mut folders = vec![crate_folder.join("../../../tests/fixtures/assets")];
    folders.extend(Some(larger).filter(|folder| folder.is_dir()));
    folders
}

/// Positions and fan-triangulated faces of an OBJ file.
pub fn read_obj(path: &Path) -> MeshData {
    let text = std::fs::read_to_string(path).expect("an OBJ file");
    let mut data = MeshData::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut next = || words.next().and_then(|word| word.parse().ok()).expect("a coordinate");
                data.positions.push([next(), next(), next()]);
            }
            Some("f") => {
                let first = |word: &str| word.split('/').next().and_then(|number| number.parse::<u32>().ok());
                let corners: Vec<u32> = words.map(|word| first(word).expect("an index") - 1).collect();
                data.triangles.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
            }
            _ => {}
        }
    }
    data
}

/// Google Scanned Objects and YCB objects that fit on a table, sorted by name, at half the density of water.
pub fn real_objects(root: &Path) -> Vec<Arc<Object>> {
    let mut found = Vec::new();
    for (pool, file) in [("gso", "meshes/model.obj"), ("ycb", "google_16k/textured.obj")] {
        let entries = std::fs::read_dir(root.join(pool)).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        folders.sort();
        for folder in folders {
            let path = folder.join(file);
            if path.is_file() {
                let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let data = read_obj(&path);
                let volume = Mesh::new(data.clone()).expect("a sound mesh").signed_volume().abs();
                found.push(object(&name, data, (500.0 * volume).clamp(0.03, 2.0)));
            }
        }
    }
    found.retain(|object| object.mesh.bounds().size().max() < 0.4);
    found
}

// ---- Scenes ------------------------------------------------------------------------------------

pub const TABLE_HEIGHT: f64 = 0.75;

pub fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity())
}

pub fn draft(object: &Arc<Object>, pose: Pose, role: Role, motion: Motion) -> BodyDraft {
    BodyDraft::new(AssetRef { pool: "kit".into(), name: object.name.clone() }, object.clone(), pose, role, motion)
}

pub fn dynamic(object: &Arc<Object>, pose: Pose) -> BodyDraft {
    draft(object, pose, Role::Object, Motion::Dynamic)
}

/// A floor, and a table of four legs and a board of 4 cm, 1.2 m by 0.8 m.
pub fn table_scene() -> SceneBuilder {
    let top = TABLE_HEIGHT as f32;
    let legs = [[-0.55, -0.35], [0.55, -0.35], [-0.55, 0.35], [0.55, 0.35]]
        .map(|[x, y]| cuboid([x, y, (top - 0.04) / 2.0], [0.05, 0.05, top - 0.04]));
    let board = cuboid([0.0, 0.0, top - 0.02], [1.2, 0.8, 0.04]);
    let table = object("table", join([board].into_iter().chain(legs)), 20.0);
    let floor = object("floor", cuboid([0.0; 3], [4.0, 4.0, 0.0]), 1.0);
    let mut scene = SceneBuilder::default();
    scene.add(draft(&floor, at(0.0, 0.0, 0.0), Role::Room, Motion::Fixed));
    scene.add(draft(&table, at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, TABLE_HEIGHT], [1.2, 0.8])).into();
    scene
}

/// Adds objects in random poses over the table, clear of each other: over the central 60 % of the top, 0.2 to 1 m above
/// it, or higher if that space is full.
pub fn drop_objects(scene: &mut SceneBuilder, objects: &[Arc<Object>], count: usize, seed: u64) {
    let mut stream = Stream::root(seed).child("objects");
    let mut taken: Vec<Aabb> = Vec::new();
    for _ in 0..count {
        let object = stream.pick(objects).expect("objects").clone();
        let mut highest = 1.0;
        loop {
            let center = object.mesh.bounds().center();
            let place = Vector3::new(
                stream.uniform(-0.36, 0.36),
                stream.uniform(-0.24, 0.24),
                TABLE_HEIGHT + stream.uniform(0.2, highest),
            );
            let rotation = stream.rotation();
            let pose = Pose::from_parts((place - rotation * center.coords).into(), rotation);
            let body = dynamic(&object, pose);
            let bounds = body.world_bounds();
            let apart = |other: &Aabb| (0..3).any(|i| bounds.min[i] > other.max[i] || bounds.max[i] < other.min[i]);
            if taken.iter().all(apart) {
                taken.push(bounds);
                scene.add(body);
                break;
            }
            highest += 0.02;
        }
    }
}

// ---- Running -----------------------------------------------------------------------------------

pub fn settler(options: &str) -> Box<dyn Settler> {
    build::<syntable_physics::Rapier>(options)
}

pub fn no_physics() -> Box<dyn Settler> {
    build::<syntable_physics::NoPhysics>("")
}

fn build<C: Config>(options: &str) -> Box<dyn Settler> {
    match Entry::of::<C>("syntable-physics", "0").construct_str(options).map(|built| built.stage) {
        Ok(Stage::Settle(settler)) => settler,
        Ok(_) => panic!("not a settler"),
        Err(error) => panic!("{options}: {error:?}"),
    }
}

/// A cache in memory that counts its hits.
#[derive(Default)]
pub struct MemoryCache {
    pub entries: Mutex<BTreeMap<(String, Digest), Vec<u8>>>,
    pub hits: Mutex<usize>,
}

impl Cache for MemoryCache {
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>> {
        let found = self.entries.lock().expect("a lock").get(&(purpose.to_owned(), key)).cloned();
        *self.hits.lock().expect("a lock") += usize::from(found.is_some());
        found
    }
    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]) {
        self.entries.lock().expect("a lock").insert((purpose.to_owned(), key), bytes.to_owned());
    }
}

pub fn settle_with(settler: &dyn Settler, scene: &mut SceneBuilder, cache: &dyn Cache) -> Result<SettleReport> {
    let log = Collected::default();
    let context = Context { stream: Stream::root(1), assets: &NoAssets, cache, workers: &Serial, log: &log };
    settler.settle(scene, &context)
}

pub fn settle(options: &str, scene: &mut SceneBuilder) -> SettleReport {
    settle_with(&*settler(options), scene, &NoCache).expect("settles")
}

/// Poses of the remaining objects, by spawn number, as bits.
pub fn pose_bits(scene: &SceneBuilder) -> Vec<(u32, Vec<u64>)> {
    objects(scene)
        .map(|body| {
            let pose = &body.world_from_body;
            let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
            (body.spawn, numbers.map(|x| x.to_bits()).collect())
        })
        .collect()
}

pub fn objects(scene: &SceneBuilder) -> impl Iterator<Item = &BodyDraft> {
    scene.bodies().map(|(_, body)| body).filter(|body| body.role == Role::Object && body.motion == Motion::Dynamic)
}

/// Lowest and highest vertex of a body, world z, meters.
pub fn z_range(body: &BodyDraft) -> (f64, f64) {
    (0..body.object.mesh.data().triangles.len())
        .flat_map(|t| body.object.mesh.corners(t))
        .map(|p| (body.world_from_body * p).z)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)))
}
