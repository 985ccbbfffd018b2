//! Room, table and drop box on hand-made pools.

mod carriers;
mod furnishings;
mod listed;
mod mesh;
mod randomization;

use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::context::{Assets, Collected, NoCache, Serial};
use syntable_model::digest::Digest;
use syntable_model::geometry::{Aabb, Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{
    Asset, AssetRef, BodyDraft, CatalogEntry, MassOrigin, MassProperties, Material, Mesh, MeshData, Motion, Object,
    Role, SourceModel, TextureMapping,
};
use syntable_placement as _;

fn placer(kind: &str, options: &str) -> Box<dyn Placer> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Place, kind).expect(kind);
    match entry.construct_str(options).unwrap_or_else(|error| panic!("{options}: {error:?}")).stage {
        Stage::Place(placer) => placer,
        _ => panic!("{kind} is no placer"),
    }
}

fn refused(kind: &str, options: &str) -> String {
    let registry = Registry::linked().expect("no clash");
    let error = registry.find(Slot::Place, kind).expect(kind).construct_str(options).map(|_| ()).expect_err(options);
    format!("{error:?}")
}

/// Boxes named by their edges in millimeters, off center, and materials named by number.
struct TestPools(BTreeMap<&'static str, Vec<CatalogEntry>>);

impl TestPools {
    fn new() -> Self {
        let entries = |names: &[&str]| names.iter().map(|name| CatalogEntry::new(*name, "box")).collect();
        Self(BTreeMap::from([
            ("small", entries(&["30x40x50", "60x20x90", "80x80x80", "bad"])),
            ("big", entries(&["300x300x300"])),
            ("tables", entries(&["1200x800x750"])),
            ("slim", entries(&["60x20x90"])),
            ("open", entries(&["open"])),
            ("boards", entries(&["boards"])),
            ("tub4", entries(&["tub4"])),
            ("tub10", entries(&["tub10"])),
            ("discs", entries(&["disc"])),
            ("cones", entries(&["cone"])),
            ("materials", entries(&["0", "1", "2", "3", "4", "5", "6", "7"])),
        ]))
    }
}

impl Assets for TestPools {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.0.get(pool).map(Vec::as_slice).ok_or_else(|| Error::new(format!("no pool {pool}")))
    }
    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        if asset.pool == "materials" {
            return Ok(Material::plain(&asset.name, [0.5; 3], 0.5).into());
        }
        let mesh = Mesh::new(test_mesh(&asset.name)?)?;
        Ok(Asset::from(Object {
            name: asset.name.clone(),
            category: "box".into(),
            mass: MassProperties::of_mesh(&mesh, 1.0, MassOrigin::Known),
            mesh: Arc::new(mesh),
            materials: vec![Arc::new(Material::plain("gray", [0.5; 3], 0.5))],
            collision: None,
            keypoints: Vec::new(),
            support_areas: Vec::new(),
            restitution: None,
            model: SourceModel::default(),
            friction: 0.5,
            license: String::new(),
            digest: Digest::of(asset.name.as_bytes()),
        }))
    }
}

/// The mesh of an asset: a box by its edges, or a shape by its name.
fn test_mesh(name: &str) -> Result<MeshData> {
    let boxes =
        |boxes: &[[[f32; 3]; 2]]| boxes.iter().fold(MeshData::default(), |all, [low, high]| join(all, *low, *high));
    Ok(match name {
        "open" => boxes(&[
            [[0.0, 0.0, 0.0], [0.4, 0.3, 0.01]],
            [[0.0, 0.0, 0.01], [0.01, 0.3, 0.15]],
            [[0.39, 0.0, 0.01], [0.4, 0.3, 0.15]],
            [[0.01, 0.0, 0.01], [0.39, 0.01, 0.15]],
            [[0.01, 0.29, 0.01], [0.39, 0.3, 0.15]],
        ]),
        "tub4" => tub(0.004),
        "tub10" => tub(0.01),
        "boards" => boxes(&[0.0, 0.3, 0.6].map(|z| [[0.0, 0.0, z], [0.6, 0.25, z + 0.02]])),
        "disc" => cone([0.5, 0.5], 0.75),
        "cone" => cone([0.04, 0.0], 0.1),
        _ => {
            let edges: Vec<f32> =
                name.split('x').filter_map(|edge| edge.parse().ok()).map(|mm: f32| mm / 1e3).collect();
            let [a, b, c] = edges[..] else { return Err(Error::new("a bad asset")) };
            // The origin is off the center, at (0.1, 0.2, 0.3) of the box.
            join(MeshData::default(), [-0.1 * a, -0.2 * b, -0.3 * c], [0.9 * a, 0.8 * b, 0.7 * c])
        }
    })
}

/// A mesh and a box.
fn join(mut mesh: MeshData, low: [f32; 3], high: [f32; 3]) -> MeshData {
    let first = mesh.positions.len() as u32;
    let corner = |i: usize| std::array::from_fn(|axis| if i >> axis & 1 == 1 { high[axis] } else { low[axis] });
    mesh.positions.extend((0..8).map(corner));
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let corners = |q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(|i| i + first));
    mesh.triangles.extend(quads.iter().flat_map(corners));
    mesh
}

/// A box of 400 mm by 300 mm by 150 mm, open above, in one closed surface: walls and floor have a thickness.
fn tub(thick: f32) -> MeshData {
    let ring = |inset: f32, z: f32| {
        let [x, y] = [0.2 - inset, 0.15 - inset];
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]
    };
    let rings = [ring(0.0, 0.0), ring(0.0, 0.15), ring(thick, 0.15), ring(thick, thick)];
    let around = |level: u32| {
        (0..4).flat_map(move |i| {
            let [a, b] = [4 * level + i, 4 * level + (i + 1) % 4];
            [[a, b, b + 4], [a, b + 4, a + 4]]
        })
    };
    let ends = [[0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]];
    let triangles = ends.into_iter().chain((0..3).flat_map(around)).collect();
    MeshData { positions: rings.concat(), triangles, ..MeshData::default() }
}

/// A cone or a disc: two circles of 64 corners, at the bottom and at a height.
fn cone(radii: [f32; 2], height: f32) -> MeshData {
    let corner = |i: u32, radius: f32, z: f32| {
        let (sin, cos) = (f64::from(i) / 32.0 * std::f64::consts::PI).sin_cos();
        [radius * cos as f32, radius * sin as f32, z]
    };
    let mut positions: Vec<[f32; 3]> =
        (0..64).flat_map(|i| [corner(i, radii[0], 0.0), corner(i, radii[1], height)]).collect();
    positions.extend([[0.0, 0.0, 0.0], [0.0, 0.0, height]]);
    let around = |i: u32| {
        let [a, b, c, d] = [2 * i, 2 * ((i + 1) % 64), 2 * ((i + 1) % 64) + 1, 2 * i + 1];
        [[a, b, c], [a, c, d], [128, b, a], [129, d, c]]
    };
    let is_flat = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Point3::from(positions[i as usize].map(f64::from)));
        (b - a).cross(&(c - a)).norm() < 1e-12
    };
    let triangles = (0..64).flat_map(around).filter(|t| !is_flat(t)).collect();
    MeshData { positions, triangles, ..MeshData::default() }
}

fn place(placers: &[&dyn Placer], seed: u64) -> Result<(SceneBuilder, Vec<Error>)> {
    let pools = TestPools::new();
    let log = Collected::default();
    let mut scene = SceneBuilder::default();
    for (i, placer) in (0..).zip(placers) {
        let stream = Stream::root(seed).at(i);
        let context = Context { stream, assets: &pools, cache: &NoCache, workers: &Serial, log: &log };
        placer.place(&mut scene, &context)?;
    }
    Ok((scene, log.warnings()))
}

fn table() -> Box<dyn Placer> {
    placer("table", "from = [\"tables\"]")
}

fn objects(scene: &SceneBuilder) -> Vec<&BodyDraft> {
    scene.bodies().map(|(_, body)| body).filter(|body| body.role == Role::Object).collect()
}

fn center(body: &BodyDraft) -> Point3<f64> {
    body.world_from_body * body.object.mesh.bounds().center()
}

#[test]
fn a_room_encloses_the_table_and_every_part_draws_its_own_material() {
    let options = "material = { floor = \"materials\", walls = \"materials\" }\nsize_m = { uniform = [6, 15] }";
    let room = placer("room", options);
    let mut combinations = std::collections::BTreeSet::new();
    for seed in 0..40 {
        let (scene, _) = place(&[&*room], seed).expect("placed");
        let bodies: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
        assert_eq!(bodies.len(), 6);
        let mut names = Vec::new();
        for body in &bodies {
            assert_eq!((body.role, body.motion), (Role::Room, Motion::Fixed));
            assert!(body.object.mesh.signed_volume() > 0.0);
            match (&body.material_override, body.asset.name.as_str()) {
                (None, "ceiling") => {}
                (Some(replacement), name) if name != "ceiling" => {
                    names.push(replacement.material.name.clone());
                    let TextureMapping::Box { rotation, offset } = replacement.mapping else { panic!("{name}") };
                    assert!((0.0..std::f32::consts::TAU).contains(&rotation));
                    assert!(offset.iter().all(|x| (0.0..1.0).contains(x)));
                }
                (replacement, name) => panic!("{name}: {replacement:?}"),
            }
        }
        combinations.insert(names[1..].to_vec());
        assert!((bodies[0].world_bounds().max.z).abs() < 1e-9, "the floor's surface is at z = 0");
        // The inner box is free of all parts, and every ray from its center meets one.
        let size = bodies[1].world_bounds().min.x * 2.0;
        assert!((6.0..15.0).contains(&size), "{size}");
        let inner =
            Aabb { min: Point3::new(-size / 2.0, -size / 2.0, 0.0), max: Point3::new(size / 2.0, size / 2.0, 15.0) };
        let shared = |a: &Aabb, b: &Aabb| {
            let size = a.max.inf(&b.max) - a.min.sup(&b.min);
            size.iter().product::<f64>() * f64::from(size.iter().all(|x| *x > 0.0))
        };
        let mut covered = 0.0;
        for (i, body) in bodies.iter().enumerate() {
            let bounds = body.world_bounds();
            assert!(shared(&bounds, &inner) < 1e-4, "{}", body.asset);
            covered += bounds.size().iter().product::<f64>();
            for other in &bodies[i + 1..] {
                assert!(shared(&bounds, &other.world_bounds()) < 1e-4, "{} and {}", body.asset, other.asset);
            }
        }
        // Parts without overlap that fill the hull between inner and outer box leave no gap.
        let hull = (size + 0.2) * (size + 0.2) * 15.2 - size * size * 15.0;
        assert!((covered / hull - 1.0).abs() < 1e-4, "{covered} {hull}");
    }
    assert!(combinations.len() > 35, "walls of different scenes differ: {combinations:?}");
    assert!(combinations.iter().any(|walls| walls[0] != walls[1] && walls[1] != walls[2]), "walls of one scene differ");
}

#[test]
fn a_table_stands_on_the_floor_in_the_center() {
    let (scene, _) = place(&[&*table()], 1).expect("placed");
    let top = scene.support(None).expect("a tabletop").surface;
    assert!((top.center().coords - Vector3::new(0.0, 0.0, 0.75)).norm() < 1e-6, "{top:?}");
    assert!((top.size()[0] - 1.2).abs() < 1e-6 && (top.size()[1] - 0.8).abs() < 1e-6, "{top:?}");
    let (_, body) = scene.bodies().next().expect("a body");
    assert_eq!((body.role, body.motion, body.material_override.is_none()), (Role::Support, Motion::Fixed, true));
    let bounds = body.world_bounds();
    assert!((bounds.min.coords - Vector3::new(-0.6, -0.4, 0.0)).norm() < 1e-6, "{bounds:?}");
    // Turned by 30°: the tabletop is the box around it.
    let rotated = placer("table", "from = [\"tables\"]\nyaw_deg = 30");
    let (scene, _) = place(&[&*rotated], 1).expect("placed");
    let [w, l] = scene.support(None).expect("a tabletop").surface.size();
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    assert!((w - (1.2 * cos + 0.8 * sin)).abs() < 1e-6 && (l - (1.2 * sin + 0.8 * cos)).abs() < 1e-6, "{w} {l}");
    let error = place(&[&*table(), &*table()], 1).expect_err("two tables").to_string();
    assert!(error.contains("would stand in"), "{error}");
}

#[test]
fn a_table_that_is_larger_than_the_room_is_refused() {
    // The table is 1.2 m × 0.8 m, and 0.75 m high; on the diagonal it needs 1.414 m both ways.
    let of = |table: &str| placer("table", &format!("from = [\"tables\"]\n{table}"));
    for (room, table, through) in [
        ("size_m = 1.21\nlength_m = 1.0", "", None),
        ("size_m = 1.2\nlength_m = 1.0", "", None),
        ("size_m = 1.19\nlength_m = 1.0", "", Some("wall_east")),
        ("size_m = 1.0\nlength_m = 1.21", "", Some("wall_east")),
        ("size_m = 1.0\nlength_m = 1.21", "yaw_deg = 90", None),
        ("size_m = 1.42", "yaw_deg = 45", None),
        ("size_m = 1.41", "yaw_deg = 45", Some("wall_east")),
        ("size_m = 3.0\nheight_m = 1.0", "longer_side_m = 1.5", None),
        ("size_m = 3.0\nheight_m = 1.0", "longer_side_m = 1.7", Some("ceiling")),
        ("size_m = 1.0\nfloor_only = true", "", None),
    ] {
        let (room, table) = (placer("room", room), of(table));
        for order in [[&*room, &*table], [&*table, &*room]] {
            let said = place(&order, 3).err().map(|error| error.to_string());
            assert_eq!(said.is_some(), through.is_some(), "{said:?}");
            if let (Some(said), Some(through)) = (said, through) {
                assert!(said.contains("1200x800x750") && said.contains(through) && said.contains("size_m"), "{said}");
            }
        }
    }
}

#[test]
fn a_table_gets_a_material_as_often_as_asked() {
    let some = placer("table", "from = [\"tables\"]\nmaterial = \"materials\"\nmaterial_probability = 0.25");
    let drawn = (0..2000)
        .filter(|&seed| {
            let (scene, _) = place(&[&*some], seed).expect("placed");
            scene.bodies().next().expect("a body").1.material_override.is_some()
        })
        .count();
    // 500 ± 4 standard deviations of a binomial.
    assert!((423..=577).contains(&drawn), "{drawn} of 2000");
}

#[test]
fn objects_start_in_the_box_and_counts_cover_the_range() {
    let (table, drop) = (table(), placer("drop_box", "from = [\"small\"]\noverlap_free = false"));
    let mut counts = BTreeMap::new();
    let (mut low, mut high) = (Vector3::repeat(9.0), Vector3::repeat(-9.0));
    for seed in 0..800 {
        let (scene, warnings) = place(&[&*table, &*drop], seed).expect("placed");
        assert!(warnings.is_empty());
        let objects = objects(&scene);
        *counts.entry(objects.len()).or_insert(0) += 1;
        for (k, body) in objects.iter().enumerate() {
            assert_eq!((body.spawn, body.motion), (k as u32, Motion::Dynamic));
            low = low.inf(&center(body).coords);
            high = high.sup(&center(body).coords);
        }
    }
    assert_eq!(counts.keys().copied().collect::<Vec<_>>(), (1..=40).collect::<Vec<_>>());
    // χ² with 39 degrees of freedom: 86 is the 2e-5 tail.
    let chi2: f64 = counts.values().map(|&n| f64::from(n - 20).powi(2) / 20.0).sum();
    assert!(chi2 < 86.0, "{counts:?}");
    assert!((low - Vector3::new(-0.6, -0.4, 0.95)).norm() < 0.01 && low.x >= -0.6 && low.z >= 0.95, "{low}");
    assert!((high - Vector3::new(0.6, 0.4, 1.75)).norm() < 0.01 && high.y <= 0.4 && high.z <= 1.75, "{high}");
}

/// No corner and no point of the edges of one box lies in another.
fn assert_apart(bodies: &[&BodyDraft]) {
    let inside = |body: &BodyDraft, p: &Point3<f64>| {
        let q = body.world_from_body.inverse_transform_point(p);
        let b = body.object.mesh.bounds();
        (0..3).all(|k| b.min[k] < q[k] && q[k] < b.max[k])
    };
    for a in bodies {
        let corners = a.object.mesh.bounds().corners().map(|p| a.world_from_body * p);
        for b in bodies.iter().filter(|b| !std::ptr::eq(**b, *a)) {
            for i in 0..8_usize {
                for axis in 0..3 {
                    let (p, q) = (corners[i], corners[i ^ 1 << axis]);
                    for t in 0..=10 {
                        let point = p + (q - p) * f64::from(t) / 10.0;
                        assert!(!inside(b, &point), "{} {} and {} {}", a.asset, a.spawn, b.asset, b.spawn);
                    }
                }
            }
        }
    }
}

#[test]
fn no_two_objects_overlap_at_the_start() {
    let table = table();
    for (pool, most) in [("small", 1.2), ("big", 9.0)] {
        let drop = placer("drop_box", &format!("from = [\"{pool}\"]\ncount = 40"));
        for seed in 0..6 {
            let (scene, _) = place(&[&*table, &*drop], seed).expect("placed");
            assert_eq!(objects(&scene).len(), 40);
            let bodies: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
            assert_apart(&bodies);
            for body in objects(&scene) {
                // Small objects stay in the box; big ones do not fit, and the box grows only upwards.
                let p = center(body);
                assert!(p.x.abs() <= 0.6 && p.y.abs() <= 0.4 && p.z >= 0.95 && p.z <= 0.75 + most, "{pool}: {p}");
            }
        }
    }
    // Even if no two objects fit side by side, all find a place.
    let narrow = placer("drop_box", "from = [\"big\"]\ncount = 12\nwidth_factor = 0\nheight_m = 0\nmax_tries = 1");
    let (scene, _) = place(&[&*table, &*narrow], 1).expect("placed");
    assert_eq!(objects(&scene).len(), 12);
    assert_apart(&scene.bodies().map(|(_, body)| body).collect::<Vec<_>>());
}

#[test]
fn objects_start_below_the_ceiling() {
    let top = |body: &BodyDraft| body.world_bounds().max.z;
    let scene = |height: f64, options: &str, seed: u64| {
        let room = placer("room", &format!("size_m = 6\nheight_m = {height}"));
        let drop = placer("drop_box", &format!("from = [\"small\"]\n{options}"));
        place(&[&*room, &*table(), &*drop], seed).map(|(scene, _)| scene)
    };
    // Under a high ceiling, the box has its stated height; under a low one, it ends at the ceiling.
    for (height, most) in [(15.0, 1.85), (1.3, 1.3)] {
        let tops = (0..20).flat_map(|seed| {
            objects(&scene(height, "count = 20", seed).expect("placed")).into_iter().map(top).collect::<Vec<_>>()
        });
        let highest = tops.fold(0.0, f64::max);
        assert!(highest <= most && highest > most - 0.1, "{highest} under {height}");
    }
    let crowded = scene(1.3, "count = 400\nwidth_factor = 0.2", 1).expect_err("too many").to_string();
    assert!(crowded.contains("in the space above the support") && crowded.contains("lower `count`"), "{crowded}");
    let none = scene(1.0, "clearance_m = 0.5", 1).expect_err("above it").to_string();
    assert!(none.contains("starts 1.25 m above the floor, and the space above `table` ends at 1.00 m"), "{none}");
}

#[test]
fn a_drop_box_hands_on_what_physics_needs() {
    let options = "from = [\"small\"]\ncount = 30\nwidth_factor = 0.5\nfriction = { uniform = [0.2, 0.9] }\n\
                   restitution = { choice = [0.1, 0.4] }\nfixed = true";
    let (scene, _) = place(&[&*table(), &*placer("drop_box", options)], 3).expect("placed");
    let bodies = objects(&scene);
    let dropped = scene.bodies().filter(|(_, body)| body.role == Role::Object);
    for zone in dropped.map(|(handle, _)| scene.drop_zone(handle).expect("a support")) {
        let [x, y] = zone.area.size();
        assert!(&*zone.support.name == "table" && (x - 0.6).abs() < 1e-6 && (y - 0.4).abs() < 1e-6, "{zone:?}");
    }
    assert!(bodies.iter().all(|body| body.motion == Motion::Fixed));
    assert!(bodies.iter().all(|body| (0.2..0.9).contains(&body.friction)));
    assert!(bodies.iter().map(|body| body.friction.to_bits()).collect::<std::collections::BTreeSet<_>>().len() == 30);
    let bouncy = bodies.iter().filter(|body| body.restitution == Some(0.4)).count();
    assert!((4..26).contains(&bouncy) && bodies.iter().all(|body| body.restitution.is_some()), "{bouncy}");
    let (plain, _) = place(&[&*table(), &*placer("drop_box", "from = [\"small\"]")], 3).expect("placed");
    let own = |body: &&BodyDraft| body.friction == 0.5 && body.restitution.is_none() && body.motion == Motion::Dynamic;
    assert!(objects(&plain).iter().all(own));
}

#[test]
fn a_table_can_be_scaled() {
    let sized = placer("table", "from = [\"tables\"]\nlonger_side_m = { uniform = [0.6, 2.4] }");
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    for seed in 0..200 {
        let (scene, _) = place(&[&*sized], seed).expect("placed");
        let tabletop = scene.support(None).expect("a tabletop").surface;
        let (_, body) = scene.bodies().next().expect("a table");
        let size = body.world_bounds().size();
        // 1200 × 800 × 750 mm, in all directions alike, and it stands on the floor.
        assert!(
            (size.x - tabletop.size()[0]).abs() < 1e-6
                && (tabletop.size()[1] / tabletop.size()[0] - 2.0 / 3.0).abs() < 1e-6
        );
        assert!((tabletop.height() / tabletop.size()[0] - 0.75 / 1.2).abs() < 1e-6);
        assert!(body.world_bounds().min.z.abs() < 1e-6);
        (low, high) = (low.min(tabletop.size()[0]), high.max(tabletop.size()[0]));
    }
    assert!((0.6..0.65).contains(&low) && (2.35..2.4).contains(&high), "{low} {high}");
}

#[test]
fn an_object_depends_on_others_only_by_overlap() {
    let table = table();
    let scene = |options: &str| {
        let options = format!("{options}\nwidth_factor = 0.5");
        place(&[&*table, &*placer("drop_box", &options)], 5).expect("placed").0
    };
    let free = scene("from = [\"small\"]\ncount = 30");
    let more_tries = scene("from = [\"small\"]\ncount = 30\nmax_tries = 7");
    let loose = scene("from = [\"small\"]\ncount = 30\noverlap_free = false");
    let longer = scene("from = [\"small\"]\ncount = 40");
    let mut moved = 0;
    for (k, body) in objects(&free).iter().enumerate() {
        for other in [&more_tries, &loose, &longer].map(|scene| objects(scene)[k]) {
            assert_eq!(body.asset, other.asset);
            assert_eq!(body.world_from_body.rotation, other.world_from_body.rotation);
        }
        assert_eq!(body.world_from_body, objects(&longer)[k].world_from_body);
        moved += usize::from(body.world_from_body != objects(&loose)[k].world_from_body);
    }
    assert!((1..20).contains(&moved), "{moved} of 30 were moved to be free");
}

/// Image of the body's z axis of every object of some scenes.
fn axes(rotation: &str) -> Vec<Vector3<f64>> {
    let (table, options) =
        (table(), format!("from = [\"small\"]\ncount = 40\noverlap_free = false\nrotation = \"{rotation}\""));
    let drop = placer("drop_box", &options);
    (0..250)
        .flat_map(|seed| {
            let (scene, _) = place(&[&*table, &*drop], seed).expect("placed");
            objects(&scene).iter().map(|body| body.world_from_body.rotation * Vector3::z()).collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn rotations_follow_their_law() {
    let mean_square_z = |axes: &[Vector3<f64>]| axes.iter().map(|a| a.z * a.z).sum::<f64>() / axes.len() as f64;
    // Uniform on the sphere: E z² = 1/3, variance 4/45. Euler angles: z = cos roll · cos pitch, E z² = 1/4.
    let so3 = mean_square_z(&axes("uniform_so3"));
    assert!((so3 - 1.0 / 3.0).abs() < 4.0 * (4.0_f64 / 45.0 / 1e4).sqrt(), "{so3}");
    let euler = mean_square_z(&axes("uniform_euler"));
    assert!((euler - 0.25).abs() < 0.012, "{euler}");
    assert!(axes("uniform_yaw").iter().all(|axis| (axis.z - 1.0).abs() < 1e-12));
    // Roll about x first, then pitch about y, then yaw about z.
    let q = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1);
    let [x, y, z] = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let by_hand = UnitQuaternion::from_axis_angle(&z, 0.1)
        * UnitQuaternion::from_axis_angle(&y, 0.2)
        * UnitQuaternion::from_axis_angle(&x, 0.3);
    assert!(q.angle_to(&by_hand) < 1e-12);
}

#[test]
fn drawing_without_replacement_takes_each_once() {
    let table = table();
    let drop = placer("drop_box", "from = [\"small\", \"big\"]\ncount = 4\nwith_replacement = false");
    for seed in 0..20 {
        let (scene, warnings) = place(&[&*table, &*drop], seed).expect("placed");
        let mut names: Vec<String> = objects(&scene).iter().map(|body| body.asset.name.clone()).collect();
        names.sort();
        assert_eq!(names, ["300x300x300", "30x40x50", "60x20x90", "80x80x80"], "one asset is bad and passed over");
        assert!(warnings.is_empty());
    }
    let all = placer("drop_box", "from = [\"small\"]\ncount = 4\nwith_replacement = false");
    let (scene, warnings) = place(&[&*table, &*all], 1).expect("placed");
    assert_eq!((objects(&scene).len(), warnings.len()), (3, 1), "{warnings:?}");
    let many = placer("drop_box", "from = [\"small\"]\nwith_replacement = false");
    let error = place(&[&*table, &*many], 1).expect_err("too many").to_string();
    assert!(error.contains("`count` can become 40, but its pools have 4 assets"), "{error}");
}

#[test]
fn same_stream_same_scene() {
    let poses = |seed: u64| {
        let drop = placer("drop_box", "from = [\"small\"]");
        let (scene, _) = place(&[&*table(), &*drop], seed).expect("placed");
        scene.bodies().map(|(_, body)| (body.asset.clone(), body.world_from_body)).collect::<Vec<_>>()
    };
    assert_eq!(poses(3), poses(3));
    assert_ne!(poses(3), poses(4));
}

#[test]
fn options_are_checked() {
    for (kind, options, want) in [
        ("table", "", "from"),
        ("table", "from = []", "`from` must not be empty"),
        ("table", "from = [\"tables\"]\nmaterial_probability = 1.5", "`material_probability` cannot be 1.5"),
        ("drop_box", "from = []", "`from` must not be empty"),
        ("drop_box", "from = [\"small\"]\ncount = 0", "can become 0"),
        ("drop_box", "from = [\"small\"]\nrotation = \"uniform\"", "uniform_so3"),
        ("drop_box", "from = [\"small\"]\nclearance_m = -1", "`clearance_m` cannot be -1"),
        ("room", "size_m = { uniform = [0, 4] }", "can become 0"),
        ("room", "texture_scale = 0", "`texture_scale` cannot be 0"),
        ("table", "from = [\"tables\"]\nlonger_side_m = { uniform = [0, 2] }", "can become 0"),
        ("drop_box", "from = [\"small\"]\nfriction = -1", "`friction` cannot be -1"),
        ("drop_box", "from = [\"small\"]\nrestitution = { uniform = [0, 2] }", "can become 2"),
        (
            "drop_box",
            "from = [\"small\"]\nmaterial = { from = \"materials\", probability = 2 }",
            "`material.probability` cannot be 2",
        ),
        ("drop_box", "from = [\"small\"]\nscale = { normal = { mean = 1, std = 0.5 } }", "`scale` can become -1"),
        ("distractors", "from = [\"small\"]\nscale = 0", "`scale` cannot be 0"),
        ("drop_box", "from = [\"small\"]\ncolor = { hue = 3 }", "hue_deg"),
        (
            "table",
            "from = [\"tables\"]\ncolor = { brightness = { uniform = [-1, 1] } }",
            "`color.brightness` can become -1",
        ),
        ("distractors", "from = []", "`from` must not be empty"),
        ("distractors", "from = [\"small\"]\ndistance_m = [2, 1]", "write the smaller bound first"),
        ("distractors", "from = [\"small\"]\nlying_probability = 2", "`lying_probability` cannot be 2"),
        ("room", "material = { roof = \"materials\" }", "roof"),
        ("room", "floor_only = true\nopen_top = true", "no ceiling to leave out"),
        ("room", "all_alike = true\nmaterial = { floor = \"materials\" }", "`material.floor` has no effect"),
        ("room", "size_m = { uniform = [1, 3] }\nsupport = {}", "larger than the smallest floor of 1 m"),
        ("room", "size_m = 2\nlength_m = 1.4\nsupport = {}", "support.size_m[1]"),
        ("ground", "size_m = 20\nsupport = { size_m = [1, 21] }", "larger than the smallest floor of 20 m"),
        ("arrange", "from = [\"small\"]\npose = { upright = -1 }", "the weight -1 is not within 0 and 1000000000"),
        ("furnishings", "from = [\"big\"]\nyaw_deg = 200", "`yaw_deg` cannot be 200"),
    ] {
        let error = refused(kind, options);
        assert!(error.contains(want), "{options}: {error}");
    }
    let registry = Registry::linked().expect("no clash");
    for entry in registry.of_slot(Slot::Place) {
        let built = entry.construct_str(entry.example).unwrap_or_else(|error| panic!("{}: {error:?}", entry.kind));
        let text = built.options.to_string();
        assert!(entry.construct_str(&text).is_ok(), "{text}");
    }
    let alone = placer("drop_box", "from = [\"small\"]");
    let error = place(&[&*alone], 1).expect_err("no table").to_string();
    assert!(error.contains("no support"), "{error}");
}

#[test]
fn a_ground_is_a_level_floor_that_shows_the_environment() {
    let ground = placer("ground", "size_m = 300\nprojection_height_m = 2.5");
    let (scene, warnings) = place(&[&*ground, &*table()], 3).expect("placed");
    assert!(warnings.is_empty() && scene.has_floor(scene.support(None).expect("a tabletop")));
    for two in [[&*ground, &*placer("room", "")], [&*placer("room", ""), &*ground]] {
        let error = place(&two, 3).expect_err("two floors");
        assert!(error.is_permanent() && error.to_string().contains("already has a floor"), "{error}");
    }
    let floor = scene.bodies().map(|(_, body)| body).find(|body| body.role == Role::Room).expect("a floor");
    assert_eq!((floor.asset.to_string().as_str(), floor.motion), ("room/floor", Motion::Fixed));
    let bounds = floor.world_bounds();
    assert!(bounds.max.z.abs() < 1e-6 && bounds.min.x < -149.9 && bounds.max.y > 149.9, "{bounds:?}");
    // Closed, of small triangles in the middle.
    let mesh = &floor.object.mesh;
    let volume = 300.2 * 300.2 * 0.1;
    assert!((mesh.signed_volume() / volume - 1.0).abs() < 1e-3, "{}", mesh.signed_volume());
    let data = mesh.data();
    for triangle in &data.triangles {
        let corners = triangle.map(|i| Point3::from(data.positions[i as usize].map(f64::from)));
        let nearest = corners.iter().map(|p| p.coords.norm()).fold(f64::INFINITY, f64::min);
        for axis in 0..3 {
            let [low, high] = [f64::min, f64::max].map(|pick| corners.map(|p| p[axis]).into_iter().reduce(pick));
            assert!(high.expect("three") - low.expect("three") <= 2.0 * nearest.max(1.5), "{corners:?}");
        }
    }
    let material = &floor.object.materials[0];
    assert_eq!(material.projection_height_m, Some(2.5));
    assert_ne!(material.digest, Material { projection_height_m: None, ..(**material).clone() }.with_digest().digest);
    for (options, want) in [("size_m = 0.5", "size_m"), ("projection_height_m = 0", "projection_height_m")] {
        let error = refused("ground", options);
        assert!(error.contains(want), "{error}");
    }
}
