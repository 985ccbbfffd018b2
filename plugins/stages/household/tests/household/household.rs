//! Procedural objects and tables: valid meshes, correct collision parts, real sizes and masses.

use std::collections::{BTreeMap, BTreeSet};
use syntable_household as _;
use syntable_model::context::Collected;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{Asset, MassDistribution, MassOrigin, MassProperties, Object};

fn source(kind: &str, options: &str) -> Box<dyn AssetSource> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Assets, kind).expect(kind);
    match entry.construct_str(options).unwrap_or_else(|error| panic!("{options}: {error:?}")).stage {
        Stage::Assets(source) => source,
        _ => panic!("{kind} is no asset source"),
    }
}

fn load(source: &dyn AssetSource, name: &str) -> Object {
    let log = Collected::default();
    let asset = source.load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(log.warnings().is_empty(), "{name}: {:?}", log.warnings());
    assert!(matches!(asset, Asset::Object(_)));
    std::sync::Arc::unwrap_or_clone(asset.into_object().expect("checked"))
}

fn all(kind: &str, options: &str) -> Vec<Object> {
    let source = source(kind, options);
    let catalog = source.catalog(&Collected::default()).expect("a catalog");
    catalog.entries.iter().map(|entry| load(&*source, &entry.name)).collect()
}

/// Distance from a point to the hull of some points: Wolfe's method in its simplest form (Gilbert with the nearest
/// point of the best segment, then of the best triangle), enough for half a tenth of a millimeter.
fn distance_to_hull(hull: &[[f32; 3]], p: Point3<f64>) -> f64 {
    let points: Vec<Vector3<f64>> = hull.iter().map(|q| Vector3::from(q.map(f64::from)) - p.coords).collect();
    let mut simplex: Vec<Vector3<f64>> = vec![points[0]];
    let mut nearest = points[0];
    for _ in 0..200 {
        if nearest.norm() < 1e-7 {
            return 0.0;
        }
        let support = points.iter().min_by(|a, b| a.dot(&nearest).total_cmp(&b.dot(&nearest))).expect("points");
        if nearest.norm_squared() - support.dot(&nearest) < 1e-6 * nearest.norm() {
            return nearest.norm();
        }
        simplex.push(*support);
        (nearest, simplex) = nearest_of_simplex(&simplex);
    }
    nearest.norm()
}

/// The point of a simplex of at most four corners nearest to the origin, and the corners of the face that holds it.
fn nearest_of_simplex(corners: &[Vector3<f64>]) -> (Vector3<f64>, Vec<Vector3<f64>>) {
    let mut best = (f64::INFINITY, Vector3::zeros(), Vec::new());
    for subset in 1_u32..1 << corners.len() {
        let face: Vec<Vector3<f64>> = (0..corners.len()).filter(|i| subset >> i & 1 == 1).map(|i| corners[i]).collect();
        // The foot of the perpendicular on the face's plane: weights from the normal equations.
        let edges: Vec<Vector3<f64>> = face[1..].iter().map(|c| c - face[0]).collect();
        let n = edges.len();
        let gram = nalgebra::DMatrix::from_fn(n, n, |i, k| edges[i].dot(&edges[k]));
        let right = nalgebra::DVector::from_fn(n, |i, _| -edges[i].dot(&face[0]));
        let Some(weights) = (if n == 0 { Some(right) } else { gram.lu().solve(&right) }) else { continue };
        if weights.iter().any(|w| *w < -1e-12) || weights.sum() > 1.0 + 1e-12 {
            continue;
        }
        let foot = edges.iter().zip(weights.iter()).fold(face[0], |p, (edge, w)| p + edge * *w);
        if foot.norm() < best.0 - 1e-15 {
            best = (foot.norm(), foot, face);
        }
    }
    (best.1, best.2)
}

fn assert_sound(object: &Object) {
    let name = &object.name;
    let data = object.mesh.data();
    // Closed: by position, every directed edge has its partner.
    let key = |index: u32| data.positions[index as usize].map(f32::to_bits);
    let mut edges: BTreeMap<_, i32> = BTreeMap::new();
    for triangle in &data.triangles {
        for i in 0..3 {
            let (a, b) = (key(triangle[i]), key(triangle[(i + 1) % 3]));
            assert_ne!(a, b, "{name}: an edge without length");
            *edges.entry((a, b)).or_default() += 1;
            *edges.entry((b, a)).or_default() -= 1;
        }
    }
    assert!(edges.values().all(|count| *count == 0), "{name}: open edges");
    assert!(object.mesh.signed_volume() > 0.0, "{name}: faces point inwards");
    // The faces and their normals agree.
    for (t, triangle) in data.triangles.iter().enumerate() {
        let [a, b, c] = object.mesh.corners(t);
        let face = (b - a).cross(&(c - a));
        for &index in triangle {
            let normal = Vector3::from(data.normals[index as usize].map(f64::from));
            assert!((normal.norm() - 1.0).abs() < 1e-5, "{name}: normal {normal:?}");
            assert!(
                face.norm() < 1e-12 || face.normalize().dot(&normal) > 0.4,
                "{name}: triangle {t} against its normals"
            );
        }
    }
    assert_eq!(data.uvs.len(), data.positions.len());
    assert!(data.uvs.iter().flatten().all(|x| x.is_finite() && x.abs() < 1e3), "{name}: texture coordinates");
    let slots = (0..data.triangles.len()).map(|t| object.mesh.slot(t)).collect::<BTreeSet<_>>();
    assert!(slots.iter().all(|&slot| slot < object.materials.len()), "{name}: slots {slots:?}");
    let center = object.mesh.bounds().center();
    assert!(center.coords.norm() < 1e-6, "{name}: center {center}");
    assert!(object.mass.kg.is_finite() && object.friction > 0.0 && !object.license.is_empty());
}

fn assert_covered(object: &Object, tolerance: f64, max_parts: usize) {
    let parts = object.collision.as_ref().expect("exact parts");
    assert!(parts.len() <= max_parts, "{}: {} parts", object.name, parts.len());
    let bounds: Vec<_> = parts
        .iter()
        .map(|part| {
            let flat: [Vec<f32>; 3] = std::array::from_fn(|k| part.iter().map(|p| p[k]).collect());
            flat.map(|xs| {
                let low = xs.iter().copied().fold(f32::INFINITY, f32::min);
                let high = xs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                [f64::from(low) - tolerance, f64::from(high) + tolerance]
            })
        })
        .collect();
    for position in object.mesh.data().positions.iter().step_by(7) {
        let p = Point3::from(position.map(f64::from));
        let covered = parts
            .iter()
            .zip(&bounds)
            .filter(|(_, b)| (0..3).all(|k| b[k][0] <= p[k] && p[k] <= b[k][1]))
            .any(|(part, _)| distance_to_hull(part, p) <= tolerance);
        assert!(covered, "{}: {p} is outside of all parts", object.name);
    }
}

/// A family; longest and shortest edge of its bounding boxes, meters; mass, kilograms.
type Limits = (&'static str, [f64; 2], [f64; 2], [f64; 2]);

const LIMITS: [Limits; 32] = [
    ("apple", [0.05, 0.1], [0.05, 0.1], [0.08, 0.3]),
    ("bag", [0.2, 0.6], [0.04, 0.2], [0.015, 0.12]),
    ("ball", [0.03, 0.14], [0.03, 0.14], [0.002, 0.2]),
    ("banana", [0.12, 0.22], [0.02, 0.04], [0.06, 0.25]),
    ("block", [0.025, 0.14], [0.008, 0.05], [0.005, 0.2]),
    ("book", [0.14, 0.32], [0.01, 0.05], [0.1, 2.5]),
    ("bottle", [0.14, 0.3], [0.05, 0.09], [0.03, 1.5]),
    ("bowl", [0.11, 0.2], [0.03, 0.09], [0.1, 0.9]),
    ("box", [0.06, 0.32], [0.02, 0.12], [0.01, 2.0]),
    ("can", [0.07, 0.17], [0.03, 0.11], [0.1, 0.9]),
    ("carton", [0.14, 0.34], [0.055, 0.105], [0.02, 1.1]),
    ("cup", [0.06, 0.16], [0.06, 0.1], [0.015, 0.6]),
    ("fork", [0.15, 0.22], [0.005, 0.025], [0.015, 0.07]),
    ("glass", [0.075, 0.22], [0.055, 0.11], [0.03, 0.4]),
    ("hammer", [0.23, 0.35], [0.02, 0.035], [0.25, 0.9]),
    ("jar", [0.06, 0.16], [0.05, 0.1], [0.2, 1.4]),
    ("knife", [0.17, 0.24], [0.003, 0.008], [0.025, 0.1]),
    ("magazine", [0.2, 0.34], [0.002, 0.035], [0.05, 0.6]),
    ("marker", [0.11, 0.15], [0.011, 0.02], [0.007, 0.04]),
    ("mug", [0.09, 0.15], [0.07, 0.12], [0.15, 0.5]),
    ("open_box", [0.2, 0.75], [0.08, 0.45], [0.04, 0.8]),
    ("pan", [0.28, 0.47], [0.03, 0.09], [0.3, 1.6]),
    ("plate", [0.16, 0.29], [0.014, 0.035], [0.2, 1.1]),
    ("pouch", [0.09, 0.32], [0.02, 0.1], [0.02, 1.6]),
    ("remote", [0.12, 0.22], [0.014, 0.025], [0.04, 0.2]),
    ("screwdriver", [0.14, 0.27], [0.02, 0.036], [0.03, 0.2]),
    ("sponge", [0.08, 0.12], [0.02, 0.045], [0.008, 0.06]),
    ("spoon", [0.13, 0.22], [0.007, 0.03], [0.015, 0.08]),
    ("tape", [0.06, 0.12], [0.01, 0.06], [0.01, 0.4]),
    ("towel", [0.13, 0.36], [0.012, 0.14], [0.005, 0.5]),
    ("tube", [0.11, 0.22], [0.02, 0.045], [0.02, 0.25]),
    ("wrench", [0.11, 0.22], [0.004, 0.008], [0.03, 0.25]),
];

#[test]
fn household_objects_are_sound_and_real() {
    let objects = all("household", "variants_per_family = 12");
    assert_eq!(objects.len(), 32 * 12);
    for object in &objects {
        assert_sound(object);
        let triangles = object.mesh.data().triangles.len();
        assert!((200..=4000).contains(&triangles), "{}: {triangles} triangles", object.name);
        let (_, longest, shortest, mass) =
            LIMITS.iter().find(|limits| limits.0 == object.category).expect("limits of every family");
        let size = object.mesh.bounds().size();
        let check = |what: &str, value: f64, [low, high]: [f64; 2]| {
            assert!((low..=high).contains(&value), "{}: {what} {value} is not in {low} to {high}", object.name);
        };
        check("longest edge", size.max(), *longest);
        check("shortest edge", size.min(), *shortest);
        check("mass", object.mass.kg, *mass);
        // Nothing is lighter than foam or heavier than steel.
        let density = object.mass.kg / object.mesh.signed_volume();
        assert!((20.0..8000.0).contains(&density), "{}: {density} kg/m³", object.name);
    }
}

/// Volume and center of the closed surfaces of some material slots.
fn solid_of_slots(object: &Object, slots: std::ops::Range<usize>) -> (f64, Vector3<f64>) {
    let (mut volume, mut first) = (0.0, Vector3::zeros());
    for t in (0..object.mesh.data().triangles.len()).filter(|&t| slots.contains(&object.mesh.slot(t))) {
        let [a, b, c] = object.mesh.corners(t).map(|p| p.coords);
        let part = a.dot(&b.cross(&c)) / 6.0;
        volume += part;
        first += (a + b + c) * (part / 4.0);
    }
    (volume, first / volume)
}

#[test]
fn the_parts_of_an_object_have_their_own_densities() {
    // The handle's and the head's slots, and the densities of the two.
    for (family, handle, head, densities) in [
        ("hammer", 0..1, 1..2, [680.0, 0.85 * 7850.0]),
        ("screwdriver", 0..1, 1..2, [1150.0, 7850.0]),
        ("pan", 2..3, 0..2, [1050.0, 0.55 * 7850.0]),
    ] {
        for object in all("household", &format!("families = [\"{family}\"]\nvariants_per_family = 6")) {
            let parts = [solid_of_slots(&object, handle.clone()), solid_of_slots(&object, head.clone())];
            let masses = [parts[0].0 * densities[0], parts[1].0 * densities[1]];
            let center = (parts[0].1 * masses[0] + parts[1].1 * masses[1]) / (masses[0] + masses[1]);
            let mass = &object.mass;
            assert!((mass.kg / (masses[0] + masses[1]) - 1.0).abs() < 1e-4, "{}: {mass:?}", object.name);
            assert!((mass.center.coords - center).norm() < 1e-5, "{}: {mass:?}, not {center:?}", object.name);
            assert_eq!((mass.origin, mass.distribution), (MassOrigin::Known, MassDistribution::Parts));
            if family == "hammer" {
                // At one density over the overlapping collision parts it was 65 mm off.
                let box_center = object.mesh.bounds().center();
                assert!((mass.center.x - box_center.x) > 0.06, "{}: the head is at +x: {mass:?}", object.name);
            }
        }
    }
}

#[test]
fn inertia_matches_the_enclosed_volume() {
    for object in all("household", "variants_per_family = 3") {
        if object.mass.distribution != MassDistribution::Volume {
            continue;
        }
        let found = MassProperties::of_mesh(&object.mesh, object.mass.kg, MassOrigin::Known);
        let size = found.inertia().norm();
        assert!((found.center - object.mass.center).norm() < 1e-5, "{}: {found:?}, {:?}", object.name, object.mass);
        assert!((found.inertia() - object.mass.inertia()).norm() < 1e-3 * size, "{}", object.name);
    }
}

#[test]
fn collision_parts_cover_the_mesh() {
    for object in all("household", "variants_per_family = 2") {
        assert_covered(&object, 0.003, 40);
    }
    for object in all("procedural_tables", "variants_per_design = 2") {
        assert_covered(&object, 0.004, 40);
    }
}

#[test]
fn hollows_stay_hollow() {
    for object in all(
        "household",
        "families = [\"mug\", \"cup\", \"bowl\", \"pan\", \"tape\", \"plate\", \"glass\"]\nvariants_per_family = 6",
    ) {
        let size = object.mesh.bounds().size();
        let parts = object.collision.as_ref().expect("exact parts");
        // The center of the vessel: of the body, not of the box, which handles stretch to +x.
        let body = match object.category.as_str() {
            "mug" | "pan" => object.mesh.bounds().min.x + size.y / 2.0,
            _ => 0.0,
        };
        let floor = match object.category.as_str() {
            "plate" => 0.55,
            "pan" => 0.25,
            // The stem of a wine glass.
            "glass" => 0.56,
            _ => 0.15,
        };
        for height in [floor, 0.6, 0.8, 0.97] {
            for (dx, dy) in [(0.0, 0.0), (0.15, 0.1), (-0.1, 0.17)] {
                let z = object.mesh.bounds().min.z + height * size.z;
                let p = Point3::new(body + dx * size.y, dy * size.y, z);
                for part in parts.iter() {
                    assert!(distance_to_hull(part, p) > 1e-4, "{}: {p} inside of a part", object.name);
                }
            }
        }
    }
    for object in all("household", "families = [\"bag\", \"open_box\"]\nvariants_per_family = 6") {
        let parts = object.collision.as_ref().expect("exact parts");
        // Half way up a bag, and up the walls of a box; the cords and the flaps lie higher.
        let low = object.mesh.bounds().min.z;
        for (dx, dy, height) in [(0.0, 0.0, 0.05), (0.02, 0.01, 0.05), (-0.03, -0.01, 0.03)] {
            let p = Point3::new(dx, dy, low + height);
            let free = parts.iter().map(|part| distance_to_hull(part, p)).fold(f64::INFINITY, f64::min);
            assert!(free > 1e-3, "{}: {p} inside of a part", object.name);
        }
    }
    // The gap between a mug's body and its handle is free, too.
    for object in all("household", "families = [\"mug\"]\nvariants_per_family = 6") {
        let size = object.mesh.bounds().size();
        let p = Point3::new(object.mesh.bounds().min.x + size.y + 0.45 * (size.x - size.y), 0.0, 0.0);
        for part in object.collision.as_ref().expect("exact parts").iter() {
            assert!(distance_to_hull(part, p) > 1e-3, "{}: {p} inside of a part", object.name);
        }
    }
}

#[test]
fn tables_are_sound_and_real() {
    let tables = all("procedural_tables", "");
    assert_eq!(tables.len(), 6 * 8);
    for table in &tables {
        assert_sound(table);
        let size = table.mesh.bounds().size();
        assert!((0.7..=1.85).contains(&size.x) && (0.7..=1.3).contains(&size.y), "{}: {size:?}", table.name);
        assert!((0.35..=0.8).contains(&size.z), "{}: {size:?}", table.name);
        assert!((10.0..800.0).contains(&table.mass.kg), "{}: {} kg", table.name, table.mass.kg);
        // The top is level and the highest part: every point of the inner rectangle has a face of the top straight
        // above it.
        let top = table.mesh.bounds().max.z;
        for (x, y) in [(0.0, 0.0), (0.3, 0.3), (-0.3, 0.3), (0.3, -0.3), (-0.34, -0.34)] {
            let p = [x * size.x, y * size.y];
            let highest = (0..table.mesh.data().triangles.len())
                .filter_map(|t| height_above(table.mesh.corners(t), p))
                .fold(f64::NEG_INFINITY, f64::max);
            assert!((highest - top).abs() < 1e-4, "{}: {highest} under {p:?}, the top is at {top}", table.name);
        }
    }
}

/// Height of a triangle above a place in x and y.
fn height_above([a, b, c]: [Point3<f64>; 3], p: [f64; 2]) -> Option<f64> {
    let turn = |q: &Point3<f64>, r: &Point3<f64>| (r.x - q.x) * (p[1] - q.y) - (r.y - q.y) * (p[0] - q.x);
    let weights = [turn(&b, &c), turn(&c, &a), turn(&a, &b)];
    let sum: f64 = weights.iter().sum();
    let inside = weights.iter().all(|w| *w >= 0.0) || weights.iter().all(|w| *w <= 0.0);
    (inside && sum.abs() > 1e-14).then(|| (weights[0] * a.z + weights[1] * b.z + weights[2] * c.z) / sum)
}

/// Heights of the upward faces over a point, and of all others, in the frame of the object.
fn heights_at(object: &Object, p: [f64; 2]) -> [Vec<f64>; 2] {
    let mut heights = [Vec::new(), Vec::new()];
    for triangle in 0..object.mesh.data().triangles.len() {
        let corners = object.mesh.corners(triangle);
        let [a, b, c] = corners;
        if let Some(z) = height_above(corners, p) {
            heights[usize::from((b - a).cross(&(c - a)).z <= 0.0)].push(z);
        }
    }
    heights
}

#[test]
fn containers_and_furniture_are_free_above_their_areas() {
    let containers = all("procedural_containers", "variants_per_family = 5");
    let furniture = all("procedural_furniture", "variants_per_family = 5");
    for object in containers.iter().chain(&furniture) {
        assert_sound(object);
        assert_covered(object, 0.002, 120);
        let name = &object.name;
        let is_open = ["bin", "crate", "tote", "tray", "conveyor", "drawer"].contains(&&*object.category);
        assert_eq!(object.support_areas.len() == 1, is_open, "{name}");
        let parts = object.collision.as_ref().expect("exact parts");
        for (number, area) in object.support_areas.iter().enumerate() {
            let (surface, [length, width]) = (area.surface, area.surface.edges());
            let clear = area.clear_height_m.unwrap_or(f64::INFINITY);
            let is_top = number + 1 == object.support_areas.len();
            assert_eq!(area.clear_height_m.is_none(), is_open || (object.category == "rack" && is_top), "{name}");
            let mut carried = 0;
            for step in 0..144 {
                let at = [(step % 12, length), (step / 12, width)]
                    .map(|(i, edge)| (f64::from(i) + 0.5) / 12.0 * (edge - 0.004) - 0.5 * (edge - 0.004));
                let p = surface.point(at);
                let [up, down] = heights_at(object, [p.x, p.y]);
                carried += usize::from(up.iter().any(|z| (z - p.z).abs() < 1e-3));
                let above = up.iter().chain(&down).copied().filter(|z| *z > p.z + 0.002).fold(f64::INFINITY, f64::min);
                assert!(above >= p.z + clear - 1e-6, "{name}: a face {} m above {number}", above - p.z);
                // No collision part is in the free space either.
                let walls = area.walls.map_or(0.1, |walls| walls.height_m);
                for height in [0.004, 0.5 * walls.min(clear)] {
                    let free = p + Vector3::z() * height;
                    assert!(parts.iter().all(|part| distance_to_hull(part, free) > 1e-4), "{name}: {free} is filled");
                }
            }
            // Crates have gaps between their slats.
            assert!(carried >= if object.category == "crate" { 86 } else { 144 }, "{name}: {carried}");
            let Some(walls) = area.walls else { continue };
            for (edge, sign) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
                let side = object.mesh.data().positions.iter().map(|p| Point3::from(p.map(f64::from)));
                let beyond = side.filter(|p| sign * surface.along(p)[edge] > surface.edges()[edge] / 2.0 - 1e-4);
                let rim = beyond.map(|p| p.z - surface.height()).fold(f64::NEG_INFINITY, f64::max);
                assert!(rim > walls.height_m - 0.002, "{name}: a wall of {rim} m, not {} m", walls.height_m);
            }
        }
    }
}

#[test]
fn options_set_the_inside_of_containers() {
    let options =
        "families = [\"bin\"]\nlength_m = 0.4\nwidth_m = 0.3\nheight_m = 0.15\ndraft_deg = 5\nwall_m = 0.004\nribs = 2";
    for object in all("procedural_containers", options) {
        let [area] = &object.support_areas[..] else { panic!("one area") };
        let walls = area.walls.expect("walls");
        assert_eq!((area.surface.edges(), walls.height_m), ([0.4, 0.3], 0.15));
        assert!((walls.draft_m - 0.15 * 5.0_f64.to_radians().tan()).abs() < 1e-9);
        let bounds = object.mesh.bounds();
        assert!((area.surface.height() - bounds.min.z - 0.004).abs() < 1e-6, "the floor is as thick as the walls");
        let double = std::sync::Arc::new(object).resized(2.0).expect("sound");
        let [area] = &double.support_areas[..] else { panic!("one area") };
        assert_eq!((area.surface.edges(), area.walls.expect("walls").height_m), ([0.8, 0.6], 0.3));
    }
    let shelves = all(
        "procedural_furniture",
        "families = [\"shelf\", \"rack\"]\nboards = 4\nclear_height_m = 0.3\nwidth_m = 0.8",
    );
    for object in shelves {
        assert_eq!(object.support_areas.len(), 4, "{}", object.name);
        assert_eq!(object.support_areas[0].surface.edges()[0], 0.8);
        let clear: Vec<Option<f64>> = object.support_areas.iter().map(|area| area.clear_height_m).collect();
        let top = (object.category == "shelf").then_some(0.3);
        assert_eq!(clear, [Some(0.3), Some(0.3), Some(0.3), top], "{}", object.name);
    }
}

#[test]
fn containers_have_all_sizes_that_their_options_allow() {
    for corner in 0..8 {
        let pick = |bit: usize, low: f64, high: f64| if corner >> bit & 1 == 1 { high } else { low };
        let (height, wall, rim) = (pick(0, 0.01, 2.0), pick(1, 0.001, 0.05), pick(2, 0.0, 0.2));
        let options = format!(
            "variants_per_family = 1\nheight_m = {height}\nwall_m = {wall}\nrim_m = {rim}\nribs = 2\ndraft_deg = 45\nlength_m = 0.05\nwidth_m = 3"
        );
        for object in all("procedural_containers", &options) {
            let [area] = &object.support_areas[..] else { panic!("one area") };
            assert_eq!(area.walls.expect("walls").height_m, height, "{}: {options}", object.name);
            assert!(object.mesh.signed_volume() > 0.0);
        }
    }
}

#[test]
fn a_variant_depends_on_seed_family_and_number_alone() {
    let names = ["mug_0001", "box_0000", "wrench_0002", "hammer_0001"];
    let whole = source("household", "");
    let part = source("household", "families = [\"mug\", \"box\", \"wrench\", \"hammer\"]\nvariants_per_family = 3");
    let other = source("household", "seed = 1");
    let forwards: Vec<_> = names.iter().map(|name| load(&*whole, name).digest).collect();
    let backwards: Vec<_> = names.iter().rev().map(|name| load(&*part, name).digest).collect();
    assert_eq!(forwards, backwards.into_iter().rev().collect::<Vec<_>>());
    for (name, digest) in names.iter().zip(&forwards) {
        assert_ne!(load(&*other, name).digest, *digest, "{name} does not depend on the seed");
    }
}

#[test]
fn variants_differ() {
    for kind in ["household", "procedural_tables"] {
        let options = if kind == "household" { "variants_per_family = 8" } else { "" };
        let objects = all(kind, options);
        let digests: BTreeSet<_> = objects.iter().map(|object| object.digest).collect();
        assert_eq!(digests.len(), objects.len());
        // Not only colors differ: sizes differ within every family.
        for pair in objects.windows(2).filter(|pair| pair[0].category == pair[1].category) {
            let (a, b) = (pair[0].mesh.bounds().size(), pair[1].mesh.bounds().size());
            assert!((a - b).norm() > 1e-5, "{} and {}", pair[0].name, pair[1].name);
        }
    }
}

#[test]
fn textures_are_shared() {
    let tapes = all("household", "families = [\"tape\"]\nvariants_per_family = 40");
    let texture =
        |object: &Object| object.materials[1].base_color.texture.as_ref().map(|t| std::sync::Arc::as_ptr(&t.texture));
    let kinds: BTreeSet<_> = tapes.iter().map(texture).collect();
    assert!((2..=6).contains(&kinds.len()), "{} textures of cardboard for 40 rolls", kinds.len());
}

#[test]
fn prints_are_fine_but_small() {
    let families =
        "families = [\"bag\", \"book\", \"box\", \"can\", \"carton\", \"jar\", \"magazine\", \"open_box\", \"pouch\"]";
    let mut foils = 0;
    for object in all("household", &format!("{families}\nvariants_per_family = 8")) {
        let textures: BTreeMap<_, usize> = object
            .materials
            .iter()
            .flat_map(|material| material.textures().map(|used| (used.texture.digest, used.texture.texels.len())))
            .collect();
        let bytes: usize = textures.values().sum();
        assert!(bytes < 4_300_000, "{}: {bytes} bytes of textures", object.name);
        let print = &object.materials[0];
        let color = &print.base_color.texture.as_ref().expect("a print").texture;
        assert!(color.width.max(color.height) >= 300, "{}: {} x {}", object.name, color.width, color.height);
        // Roughness varies with the ink, and relief is more than a plane.
        let (roughness, channel) = print.roughness.texture.as_ref().expect("a texture");
        let values: BTreeSet<u8> =
            roughness.texture.texels.iter().skip(usize::from(*channel)).step_by(4).copied().collect();
        assert!(values.len() > 8, "{}: {} values of roughness", object.name, values.len());
        let relief = &print.normal.as_ref().expect("relief").map.texture;
        assert!(relief.texels.chunks(4).any(|texel| texel[0].abs_diff(128) > 8), "{} is flat", object.name);
        if let Some((foil, channel)) = &print.metallic.texture {
            foils += 1;
            let metal = foil.texture.texels.iter().skip(usize::from(*channel)).step_by(4).filter(|x| **x > 200).count();
            assert!(metal > 20, "{}: {metal} texels of foil", object.name);
        }
    }
    assert!(foils >= 8, "{foils}: drink cans, dark designs and foil are metallic");
}

#[test]
fn names_and_options_are_checked() {
    let source = source("household", "families = [\"mug\"]\nvariants_per_family = 3");
    let catalog = source.catalog(&Collected::default()).expect("a catalog");
    let names: Vec<&str> = catalog.entries.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["mug_0000", "mug_0001", "mug_0002"]);
    for name in ["mug_0003", "mug_1", "bowl_0000", "mug", "mug_-001", "mug_99999999999"] {
        let error = source.load(name, &Collected::default()).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains("0002"), "{error}");
    }
    let registry = Registry::linked().expect("no clash");
    for (kind, options, want) in [
        ("household", "families = []", "must not be empty"),
        ("household", "families = [\"mug\", \"mug\"]", "listed twice"),
        ("household", "families = [\"mgu\"]", "mgu"),
        ("procedural_interior", "families = [\"lamp\", \"lamp\"]", "listed twice"),
        ("procedural_tables", "designs = []", "must not be empty"),
        ("procedural_materials", "families = [\"wood\", \"wood\"]", "listed twice"),
    ] {
        let error =
            registry.find(Slot::Assets, kind).expect(kind).construct_str(options).map(|_| ()).expect_err(options);
        assert!(format!("{error:?}").contains(want), "{options}: {error:?}");
    }
    for kind in ["household", "procedural_interior", "procedural_tables", "procedural_materials"] {
        let entry = registry.find(Slot::Assets, kind).expect(kind);
        assert!(entry.construct_str(entry.example).is_ok(), "{}", entry.example);
    }
}

#[test]
fn glass_is_clear_and_crockery_is_glazed() {
    for object in all("household", "families = [\"glass\"]\nvariants_per_family = 12") {
        for material in &object.materials {
            let transmission = material.transmission.as_ref().expect("clear");
            let volume = transmission.volume.expect("filled");
            assert!((1.4..1.6).contains(&material.ior) && transmission.fraction.factor == 1.0, "{}", object.name);
            assert!(volume.attenuation_color.iter().all(|x| (0.0..=1.0).contains(x)), "{volume:?}");
        }
    }
    let bottles = all("household", "families = [\"bottle\"]\nvariants_per_family = 60");
    let clear = bottles.iter().filter(|bottle| bottle.materials[1].transmission.is_some()).count();
    // 18 of 60 with a standard deviation of 3.5.
    assert!((6..=32).contains(&clear), "{clear}");
    assert!(bottles.iter().all(|bottle| bottle.materials[0].transmission.is_none()), "a label is opaque");
    for plate in all("household", "families = [\"plate\"]\nvariants_per_family = 12") {
        for material in &plate.materials {
            let coat = material.clearcoat.as_ref().expect("glazed");
            assert!(coat.roughness.factor < 0.3 && material.roughness.factor > 0.3, "{}", plate.name);
        }
    }
}

/// Longest and shortest height of a family of furnishings, meters.
const HEIGHTS: [(&str, [f64; 2]); 31] = [
    ("armchair", [0.6, 1.2]),
    ("bed", [0.7, 1.3]),
    ("blind", [0.8, 1.8]),
    ("cable", [0.02, 0.2]),
    ("cardboard_boxes", [0.17, 1.9]),
    ("chair", [0.42, 1.35]),
    ("clock", [0.2, 0.5]),
    ("coat_rack", [0.1, 1.4]),
    ("cupboard", [0.5, 2.3]),
    ("curtain", [1.0, 2.6]),
    ("cushion", [0.08, 0.65]),
    ("desk", [0.85, 1.6]),
    ("door", [2.0, 2.3]),
    ("keyboard", [0.018, 0.05]),
    ("lamp", [0.8, 2.0]),
    ("laptop", [0.18, 0.3]),
    ("loudspeaker", [0.2, 1.2]),
    ("mirror", [0.38, 1.7]),
    ("notice_board", [0.4, 1.1]),
    ("plant", [0.3, 2.1]),
    ("radiator", [0.4, 1.0]),
    ("rug", [0.004, 0.03]),
    ("screen", [0.3, 1.0]),
    ("shoes", [0.06, 0.2]),
    ("socket", [0.07, 0.32]),
    ("sofa", [0.6, 1.2]),
    ("suitcase", [0.4, 1.3]),
    ("wall_art", [0.2, 1.6]),
    ("waste_bin", [0.24, 0.6]),
    ("whiteboard", [0.45, 1.3]),
    ("window", [0.9, 1.7]),
];

#[test]
fn furnishings_are_sound_and_real() {
    let objects = all("procedural_interior", "variants_per_family = 5");
    assert_eq!(objects.len(), HEIGHTS.len() * 5);
    for object in &objects {
        assert_sound(object);
        assert_covered(object, 0.006, 400);
        let (name, size) = (&object.name, object.mesh.bounds().size());
        let triangles = object.mesh.data().triangles.len();
        assert!((100..=25_000).contains(&triangles), "{name}: {triangles} triangles");
        let (_, [low, high]) = HEIGHTS.iter().find(|(family, _)| *family == object.category).expect("every family");
        assert!((*low..=*high).contains(&size.z), "{name}: {} m tall", size.z);
        assert!((0.02..=2.6).contains(&size.max()), "{name}: {size:?}");
        for material in &object.materials {
            assert!(material.emission.factor.iter().all(|nits| (0.0..=8000.0).contains(nits)), "{name}");
        }
        for area in &object.support_areas {
            let surface = area.surface;
            let bounds = object.mesh.bounds();
            assert!((bounds.min.z..=bounds.max.z + 1e-6).contains(&surface.height()), "{name}: {surface:?}");
            let half = [0, 1].map(|k| 0.5 * surface.edges()[k]);
            assert!(half[0] <= 0.5 * size.x + 1e-6 && half[1] <= 0.5 * size.y + 1e-6, "{name}: {surface:?}");
        }
    }
    // About half of all lamps and screens are lit.
    let lit = |family: &str| {
        let objects = all("procedural_interior", &format!("families = [\"{family}\"]\nvariants_per_family = 24"));
        let is_lit = |object: &&Object| object.materials.iter().any(|material| material.emission.factor[0] > 50.0);
        objects.iter().filter(is_lit).count()
    };
    for family in ["lamp", "laptop", "screen"] {
        assert!((5..=19).contains(&lit(family)), "{} of 24 are lit: {family}", lit(family));
    }
}

#[test]
fn a_furnishing_depends_on_seed_family_and_number_alone() {
    let names = ["plant_0001", "cupboard_0000", "wall_art_0002"];
    let whole = source("procedural_interior", "");
    let part =
        source("procedural_interior", "families = [\"wall_art\", \"plant\", \"cupboard\"]\nvariants_per_family = 3");
    let other = source("procedural_interior", "seed = 1");
    let forwards: Vec<_> = names.iter().map(|name| load(&*whole, name).digest).collect();
    let backwards: Vec<_> = names.iter().rev().map(|name| load(&*part, name).digest).collect();
    assert_eq!(forwards, backwards.into_iter().rev().collect::<Vec<_>>());
    for (name, digest) in names.iter().zip(&forwards) {
        assert_ne!(load(&*other, name).digest, *digest, "{name} does not depend on the seed");
    }
    let digests: BTreeSet<_> = all("procedural_interior", "").iter().map(|object| object.digest).collect();
    assert_eq!(digests.len(), HEIGHTS.len() * 8, "variants differ");
}
