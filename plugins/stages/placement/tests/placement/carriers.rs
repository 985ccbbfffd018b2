//! Bodies that carry objects, and objects that are put down on them.

use super::*;
use std::f64::consts::PI;
use syntable_model::scene::Support;

/// Corners of a body's bounding box, seen from above, in order.
fn rectangle(body: &BodyDraft) -> [[f64; 2]; 4] {
    let bounds = body.object.mesh.bounds();
    let corner = |x: f64, y: f64| {
        let p = body.world_from_body * Point3::new(x, y, bounds.center().z);
        [p.x, p.y]
    };
    let ([x0, y0], [x1, y1]) = ([bounds.min.x, bounds.min.y], [bounds.max.x, bounds.max.y]);
    [corner(x0, y0), corner(x1, y0), corner(x1, y1), corner(x0, y1)]
}

/// Distance of a point from a rectangle with its corners in order; 0 inside.
fn distance(p: [f64; 2], corners: &[[f64; 2]; 4]) -> f64 {
    let to_segment = |a: [f64; 2], b: [f64; 2]| {
        let (ab, ap) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let t = ((ap[0] * ab[0] + ap[1] * ab[1]) / (ab[0] * ab[0] + ab[1] * ab[1])).clamp(0.0, 1.0);
        (ap[0] - t * ab[0]).hypot(ap[1] - t * ab[1])
    };
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    };
    let is_inside = (0..4).all(|i| side(i) >= 0.0) || (0..4).all(|i| side(i) <= 0.0);
    let nearest = (0..4).map(|i| to_segment(corners[i], corners[(i + 1) % 4])).fold(f64::INFINITY, f64::min);
    if is_inside { 0.0 } else { nearest }
}

/// Smallest distance of two bodies, seen from above.
fn apart(a: &BodyDraft, b: &BodyDraft) -> f64 {
    let (a, b) = (rectangle(a), rectangle(b));
    let one = |a: &[[f64; 2]; 4], b: &[[f64; 2]; 4]| a.iter().map(|p| distance(*p, b)).fold(f64::INFINITY, f64::min);
    one(&a, &b).min(one(&b, &a))
}

fn low(body: &BodyDraft) -> f64 {
    body.world_bounds().min.z
}

/// Height of a body of one box, meters.
fn height(body: &BodyDraft) -> f64 {
    let bounds = body.world_bounds();
    bounds.max.z - bounds.min.z
}

fn named<'s>(scene: &'s SceneBuilder, name: &str) -> &'s Support {
    scene.support(Some(&name.into())).expect("there")
}

#[test]
fn scattered_objects_are_on_the_table_and_apart() {
    let options = "from = [\"small\"]\ncount = 14\npose = \"as_modeled\"\ngap_m = 0.02";
    let arrange = placer("arrange", options);
    let mut yaws = Vec::new();
    for seed in 0..20 {
        let (scene, _) = place(&[&*table(), &*arrange], seed).expect("placed");
        let objects = objects(&scene);
        assert_eq!(objects.len(), 14, "the table has space");
        for (i, body) in objects.iter().enumerate() {
            assert!((low(body) - 0.751).abs() < 1e-5, "1 mm above the table: {}", low(body));
            assert!(rectangle(body).iter().all(|p| p[0].abs() <= 0.6 + 1e-6 && p[1].abs() <= 0.4 + 1e-6));
            // As modeled: the box's z is up.
            assert!((body.world_from_body.rotation * Vector3::z() - Vector3::z()).norm() < 1e-9);
            assert!(objects[..i].iter().all(|other| apart(body, other) >= 0.02 - 1e-6), "seed {seed}");
            let x = body.world_from_body.rotation * Vector3::x();
            yaws.push(x.y.atan2(x.x));
        }
    }
    let quadrants = [0, 1, 2, 3].map(|k| yaws.iter().filter(|yaw| ((**yaw + PI) / (PI / 2.0)) as i32 == k).count());
    assert!(quadrants.iter().all(|count| *count > 40), "any turn: {quadrants:?}");
}

#[test]
fn boxes_rest_on_their_sides_by_solid_angles_and_stand_if_asked() {
    // A box of 60 mm by 20 mm by 90 mm.
    let [a, b, c] = [0.06_f64, 0.02, 0.09];
    let share = |x: f64, y: f64, z: f64| {
        let corner = (x * x + y * y + z * z).sqrt() * z;
        2.0 * 4.0 * (x * y / corner).atan() / (4.0 * PI)
    };
    let want = [(b, share(a, c, b)), (a, share(b, c, a)), (c, share(a, b, c))];
    let count = |pose: &str| {
        let arrange = placer("arrange", &format!("from = [\"slim\"]\ncount = 40\ngap_m = 0.005\npose = {pose}"));
        let mut counts = [0; 3];
        let mut all = 0;
        for seed in 0..30 {
            let (scene, _) = place(&[&*table(), &*arrange], seed).expect("placed");
            for body in objects(&scene) {
                let side = want.iter().position(|(edge, _)| (height(body) - edge).abs() < 1e-5).expect("on a side");
                counts[side] += 1;
                all += 1;
            }
        }
        counts.map(|count| f64::from(count) / f64::from(all))
    };
    let found = count("\"stable_pose\"");
    for ((edge, share), found) in want.iter().zip(found) {
        assert!((found - share).abs() < 0.03, "{edge} m up: {found}, not {share}");
    }
    assert_eq!(count("\"upright\""), [0.0, 0.0, 1.0]);
    let mixed = count("{ upright = 3, stable_pose = 1 }");
    assert!((mixed[2] - (0.75 + 0.25 * want[2].1)).abs() < 0.04, "{mixed:?}");
}

#[test]
fn rows_begin_at_the_front_left_corner_and_hold_copies() {
    let options =
        "from = [\"small\"]\ncount = 30\npose = \"as_modeled\"\nlayout = { rows = { per_row = 5 } }\ngap_m = 0.03";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 3).expect("placed");
    let objects = objects(&scene);
    assert_eq!(objects.len(), 30);
    let mut left = -0.6;
    for row in objects.chunks(5) {
        let mut front = -0.4;
        for body in row {
            assert_eq!(body.asset, row[0].asset, "copies");
            let (bounds, corners) = (body.object.mesh.bounds().size(), rectangle(body));
            let [x, y] = [0, 1].map(|k| corners.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min));
            assert!((x - left).abs() < 1e-4 && (y - front).abs() < 1e-4, "{x} {y}, not {left} {front}");
            front += bounds.y + 0.03;
        }
        left += row[0].object.mesh.bounds().size().x + 0.03;
    }
    // Stacks count with all of their objects, and no object is lost at the end of a row.
    let options = "from = [\"slim\"]\ncount = 31\npose = \"as_modeled\"\nlayout = { rows = { per_row = 2 } }\nstack = 3\nyaw_deg = 0";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 3).expect("placed");
    assert_eq!(super::objects(&scene).len(), 31);
    // A place that stays empty uses up no object.
    let options =
        "from = [\"slim\"]\ncount = 4\npose = \"as_modeled\"\nlayout = { rows = { per_row = 1, occupied = 0.5 } }";
    let placed =
        |seed| super::objects(&place(&[&*table(), &*placer("arrange", options)], seed).expect("placed").0).len();
    let counts: Vec<usize> = (0..20).map(placed).collect();
    assert!(counts.iter().sum::<usize>() >= 78, "at least 17 rows each: {counts:?}");
    // Without a number per row, a row is as long as the table.
    let options = "from = [\"slim\"]\ncount = 200\npose = \"as_modeled\"\nlayout = { rows = {} }\ngap_m = 0";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 3).expect("placed");
    // 1.2 m by 0.8 m, in places of 60 mm by 20 mm.
    assert_eq!(super::objects(&scene).len(), 200);
    let columns: std::collections::BTreeSet<i64> =
        super::objects(&scene).iter().map(|body| (center(body).x * 1e4).round() as i64).collect();
    assert_eq!(columns.len(), 5, "40 in a row");
}

#[test]
fn a_grid_has_objects_in_the_middles_of_its_cells() {
    let options = "from = [\"small\"]\ncount = 100\npose = \"upright\"\nlayout = { grid = { columns = 4, rows = 3, occupied = 1 } }";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 5).expect("placed");
    let found: Vec<[i64; 2]> =
        objects(&scene).iter().map(|body| [center(body).x, center(body).y].map(|x| (x * 1e4).round() as i64)).collect();
    let want = |number: i64| [-4500 + 3000 * (number % 4), (-8000 + 8000 * (number / 4)) / 3];
    assert_eq!(found.len(), 12);
    for (number, place) in (0..).zip(&found) {
        assert!((0..2).all(|k| (place[k] - want(number)[k]).abs() <= 1), "{place:?}, not {:?}", want(number));
    }
    let half = options.replace("occupied = 1", "occupied = 0.5");
    let counts: usize = (0..20)
        .map(|seed| objects(&place(&[&*table(), &*placer("arrange", &half)], seed).expect("placed").0).len())
        .sum();
    assert!((80..160).contains(&counts), "about half of 240: {counts}");
}

#[test]
fn stacks_stand_on_flat_tops() {
    let options = "from = [\"small\"]\ncount = 12\npose = \"as_modeled\"\nstack = 3\nyaw_deg = 0";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 1).expect("placed");
    let objects = objects(&scene);
    assert_eq!(objects.len(), 12, "each object counts");
    for stack in objects.chunks(3) {
        for (level, body) in stack.iter().enumerate() {
            assert_eq!(body.asset, stack[0].asset);
            let want = 0.751 + level as f64 * (height(stack[0]) + 0.001);
            assert!((low(body) - want).abs() < 1e-5, "{} at level {level}, not {want}", low(body));
            assert!((center(body) - center(stack[0])).xy().norm() < 1e-5);
        }
    }
    // Nothing stands on a cone.
    let cones = "from = [\"cones\"]\ncount = 6\npose = \"as_modeled\"\nstack = 2";
    let (scene, _) = place(&[&*table(), &*placer("arrange", cones)], 1).expect("placed");
    assert!(super::objects(&scene).iter().all(|body| (low(body) - 0.751).abs() < 1e-5));
    // Mixed stacks: the center of mass of each object is above the top of the one below.
    let mixed = "from = [\"small\"]\ncount = 24\npose = \"as_modeled\"\nstack = 2\nalike = false";
    let (scene, _) = place(&[&*table(), &*placer("arrange", mixed)], 2).expect("placed");
    let objects = super::objects(&scene);
    let upper: Vec<usize> = (0..objects.len()).filter(|i| low(objects[*i]) > 0.76).collect();
    assert!(upper.len() > 4, "{}", upper.len());
    assert!(upper.iter().any(|i| objects[*i].asset != objects[*i - 1].asset));
    for i in upper {
        let (mass, below) = (center(objects[i]), rectangle(objects[i - 1]));
        assert!(distance([mass.x, mass.y], &below) == 0.0);
        assert!((low(objects[i]) - objects[i - 1].world_bounds().max.z - 0.001).abs() < 1e-5);
    }
}

#[test]
fn objects_keep_to_a_round_table_and_off_what_is_on_it() {
    let round = placer("table", "from = [\"discs\"]");
    let tray =
        placer("support", "from = [\"open\"]\nname = \"tray\"\non = \"table\"\nposition_m = [0.1, 0.05]\nyaw_deg = 30");
    let around = placer("arrange", "from = [\"small\"]\ncount = 16\nsupport = \"table\"");
    let inside = placer("arrange", "from = [\"small\"]\ncount = 4\nsupport = \"tray\"");
    for seed in 0..10 {
        let (scene, _) = place(&[&*round, &*tray, &*around, &*inside], seed).expect("placed");
        let tray = scene.bodies().map(|(_, body)| body).find(|body| body.asset.pool == "open").expect("a tray");
        let (outline, surface) = (rectangle(tray), named(&scene, "tray").surface);
        let (on_table, in_tray): (Vec<_>, Vec<_>) =
            super::objects(&scene).into_iter().partition(|body| low(body) < 0.752);
        assert!(on_table.len() > 8 && in_tray.len() > 1, "{} and {}", on_table.len(), in_tray.len());
        for body in on_table {
            // The disc has 64 corners at a radius of 0.5 m.
            assert!(rectangle(body).iter().all(|p| p[0].hypot(p[1]) < 0.515), "beyond the edge");
            assert!(rectangle(body).iter().all(|p| distance(*p, &outline) >= 0.01 - 1e-4), "in the way of the tray");
        }
        for body in in_tray {
            assert!((low(body) - surface.height() - 0.001).abs() < 1e-5);
            for p in rectangle(body) {
                let along = surface.along(&Point3::new(p[0], p[1], surface.height()));
                assert!((0..2).all(|edge| along[edge].abs() < surface.edges()[edge] / 2.0), "between the walls");
            }
        }
    }
}

#[test]
fn areas_of_meshes_are_found() {
    // Open boxes of 400 mm by 300 mm by 150 mm with walls and a floor of 10 mm.
    let (scene, _) = place(&[&*placer("support", "from = [\"open\"]\nname = \"bin\"")], 0).expect("placed");
    let bin = named(&scene, "bin");
    let [length, width] = bin.surface.edges();
    assert!((length - 0.38).abs() < 0.01 && (width - 0.28).abs() < 0.01, "{length} {width}");
    assert!(length <= 0.38 + 1e-6 && width <= 0.28 + 1e-6, "no wall is inside");
    assert!((bin.height() - 0.01).abs() < 1e-4 && bin.surface.center().xy().coords.norm() < 0.005, "{bin:?}");
    assert!((bin.walls.expect("walls").height_m - 0.14).abs() < 1e-4 && bin.clear_height_m.is_none());
    // In one surface, with a floor of 4 mm and of 10 mm: the area is the floor, not its underside.
    for (pool, thick) in [("tub4", 0.004), ("tub10", 0.01)] {
        let options = format!("from = [\"{pool}\"]\nname = \"bin\"");
        let (scene, _) = place(&[&*placer("support", &options)], 0).expect("placed");
        let bin = named(&scene, "bin");
        assert!((bin.height() - thick).abs() < 1e-5, "{bin:?}");
        let [length, width] = bin.surface.edges();
        assert!((length - 0.4 + 2.0 * thick).abs() < 0.01 && (width - 0.3 + 2.0 * thick).abs() < 0.01, "{bin:?}");
        assert!((bin.walls.expect("walls").height_m - 0.15 + thick).abs() < 1e-5, "{bin:?}");
    }
    // Three boards of 600 mm by 250 mm, 20 mm thick, 300 mm apart.
    let (scene, _) =
        place(&[&*placer("support", "from = [\"boards\"]\nname = \"shelf\"\ncount = 1")], 0).expect("placed");
    let shelf: Vec<&Support> = scene.supports.iter().collect();
    assert_eq!(shelf.iter().map(|board| &*board.name).collect::<Vec<_>>(), ["shelf/1", "shelf/2", "shelf/3"]);
    for (number, board) in shelf.iter().enumerate() {
        assert!((board.height() - (0.02 + 0.3 * number as f64)).abs() < 1e-4, "{board:?}");
        let clear = board.clear_height_m;
        assert!(if number < 2 { (clear.expect("a board above") - 0.28).abs() < 1e-4 } else { clear.is_none() });
        assert!(board.walls.is_none());
    }
    let error = place(&[&*placer("support", "from = [\"cones\"]\nname = \"bin\"")], 0).map(|_| ()).expect_err("a cone");
    assert!(error.to_string().contains("no part of it is level"), "{error}");
}

#[test]
fn several_bins_are_apart_on_their_table_and_numbered() {
    let options =
        "from = [\"open\"]\nname = \"bins\"\ncount = 3\non = \"table\"\nscale = 0.6\nyaw_deg = { uniform = [0, 360] }";
    for seed in 0..20 {
        let (scene, _) = place(&[&*table(), &*placer("support", options)], seed).expect("placed");
        let bins: Vec<&BodyDraft> =
            scene.bodies().map(|(_, body)| body).filter(|body| body.asset.pool == "open").collect();
        assert_eq!(bins.len(), 3);
        for (i, bin) in bins.iter().enumerate() {
            assert!((low(bin) - 0.75).abs() < 1e-6);
            assert!(
                rectangle(bin).iter().all(|p| p[0].abs() <= 0.6 + 1e-6 && p[1].abs() <= 0.4 + 1e-6),
                "on the table"
            );
            assert!(bins[..i].iter().all(|other| apart(bin, other) > 0.004));
            let support = named(&scene, &format!("bins/{}", i + 1));
            assert!((support.surface.center() - Point3::new(center(bin).x, center(bin).y, 0.756)).norm() < 0.004);
        }
        assert_eq!(scene.supports.group(Some(&"bins".into())).expect("there").len(), 3);
    }
    // On the floor, the first is in the middle.
    let floor = placer("support", "from = [\"open\"]\nname = \"bins\"\ncount = 4");
    let (scene, _) = place(&[&*floor], 4).expect("placed");
    let bins: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
    assert!(center(bins[0]).xy().coords.norm() < 1e-9 && bins.iter().all(|bin| low(bin).abs() < 1e-9));
    assert!((0..4).all(|i| (0..i).all(|k| apart(bins[i], bins[k]) > 0.004)));
}

#[test]
fn a_body_on_a_board_fits_below_the_next_one_and_in_the_room() {
    let shelf = placer("support", "from = [\"boards\"]\nname = \"shelf\"");
    let bin =
        |scale: f64| placer("support", &format!("from = [\"open\"]\nname = \"bin\"\non = \"shelf\"\nscale = {scale}"));
    let (scene, _) = place(&[&*shelf, &*bin(0.8)], 1).expect("placed");
    let (bin_support, board) = (named(&scene, "bin"), named(&scene, "shelf/1"));
    assert!((bin_support.top().expect("the next board") - board.top().expect("the next board")).abs() < 1e-9);
    // 0.3 m high, the bin does not fit below a board at 0.28 m.
    let wide = placer("support", "from = [\"boards\"]\nname = \"shelf\"\nscale = 2");
    let tall = placer("support", "from = [\"big\"]\nname = \"block\"\non = \"shelf\"\nscale = 1.9");
    assert!(place(&[&*wide, &*tall], 1).is_err());
    // 0.62 m high, the shelf does not fit into a lower room.
    let room = |height: f64| placer("room", &format!("size_m = 4\nheight_m = {height}"));
    for (height, scale, fits) in [(1.3, 2.0, true), (1.2, 2.0, false), (1.2, 1.9, true)] {
        let shelf = placer("support", &format!("from = [\"boards\"]\nname = \"shelf\"\nscale = {scale}"));
        let placed = place(&[&*room(height), &*shelf], 1);
        assert_eq!(placed.as_ref().map(|_| ()).map_err(Error::is_unlucky), if fits { Ok(()) } else { Err(true) });
    }
    // Objects are dropped between the boards, too.
    let drop =
        placer("drop_box", "from = [\"small\"]\nsupport = \"shelf\"\ncount = 12\nclearance_m = 0.02\nheight_m = 0.2");
    let (scene, _) = place(&[&*shelf, &*drop], 3).expect("placed");
    for (handle, body) in scene.bodies().filter(|(_, body)| body.role == Role::Object) {
        let (support, bounds) = (scene.drop_zone(handle).expect("a zone").support, body.world_bounds());
        assert!(bounds.min.z > support.height(), "above its board");
        assert!(support.top().is_none_or(|top| bounds.max.z < top), "below the next board");
    }
    // Six long shelves stay inside a room of 5 m, or the scene is drawn again.
    let room = placer("room", "size_m = 5");
    let many = placer("support", "from = [\"boards\"]\nname = \"shelves\"\ncount = 6");
    let (scene, _) = place(&[&*room, &*many], 5).expect("placed");
    for (_, body) in scene.bodies().filter(|(_, body)| body.role == Role::Support) {
        assert!(rectangle(body).iter().flatten().all(|x| x.abs() < 2.5), "inside the walls");
    }
}

#[test]
fn a_body_inside_another_is_between_its_walls() {
    let outer = placer("support", "from = [\"open\"]\nname = \"outer\"");
    let inner = placer("support", "from = [\"open\"]\nname = \"inner\"\non = \"outer\"\nscale = 0.3\ncount = 2");
    let (scene, _) = place(&[&*outer, &*inner], 1).expect("placed");
    let surface = named(&scene, "outer").surface;
    let bodies: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
    assert_eq!(bodies.len(), 3);
    for body in &bodies[1..] {
        assert!((low(body) - surface.height()).abs() < 1e-6);
        let inside = |p: &[f64; 2]| surface.column_contains(&Point3::new(p[0], p[1], surface.height()));
        assert!(rectangle(body).iter().all(inside));
    }
    assert!(apart(bodies[1], bodies[2]) > 0.004);
}

#[test]
fn objects_start_between_the_walls_and_have_a_level() {
    let bins = placer("support", "from = [\"open\"]\nname = \"bins\"\ncount = 2\non = \"table\"");
    let drop =
        placer("drop_box", "from = [\"small\"]\nsupport = \"bins\"\ncount = 30\nfill_level = 0.5\nclearance_m = 0.05");
    let (scene, _) = place(&[&*table(), &*bins, &*drop], 2).expect("placed");
    let mut counts = BTreeMap::new();
    for (handle, body) in scene.bodies().filter(|(_, body)| body.role == Role::Object) {
        let zone = scene.drop_zone(handle).expect("a zone");
        *counts.entry(zone.support.name.to_string()).or_insert(0) += 1;
        assert!((zone.full_at_m.expect("a level") - 0.5 * zone.support.walls.expect("walls").height_m).abs() < 1e-9);
        for corner in body.object.mesh.bounds().corners() {
            let along = zone.area.along(&(body.world_from_body * corner));
            assert!((0..2).all(|edge| along[edge].abs() <= zone.area.edges()[edge] / 2.0 + 1e-6));
        }
    }
    assert!(counts["bins/1"] > 5 && counts["bins/2"] > 5, "{counts:?}");
    let flat = placer("drop_box", "from = [\"small\"]\nfill_level = 0.5");
    let error = place(&[&*table(), &*flat], 2).map(|_| ()).expect_err("no walls");
    assert!(error.to_string().contains("`table` has none"), "{error}");
}

#[test]
fn densities_decide_masses() {
    let options = "from = [\"small\"]\ncount = 10\ndensity_kg_m3 = 500\nfriction = 0.3\nrestitution = 0.2";
    let (scene, _) = place(&[&*table(), &*placer("arrange", options)], 2).expect("placed");
    for body in objects(&scene) {
        let volume: f64 = body.object.mesh.bounds().size().iter().product();
        assert!((body.mass.kg / (500.0 * volume) - 1.0).abs() < 1e-4, "{}", body.mass.kg);
        assert_eq!((body.friction, body.restitution), (0.3, Some(0.2)));
    }
}

#[test]
fn options_of_carriers_and_arrangements_are_checked() {
    let arrange = |options: &str| refused("arrange", &format!("from = \"small\"\n{options}"));
    assert!(arrange("with_replacement = false\nstack = 2").contains("need `with_replacement = true`"));
    assert!(arrange("pose = { upright = 0 }").contains("no pose has a weight above 0"));
    assert!(arrange("stack = 0").contains("stack") && arrange("gap_m = -1").contains("gap_m"));
    assert!(arrange("layout = { grid = { columns = 0 } }").contains("layout.grid.columns"));
    assert!(arrange("density_kg_m3 = 0").contains("density_kg_m3"));
    let support = |options: &str| refused("support", &format!("from = \"open\"\nname = \"bin\"\n{options}"));
    assert!(support("count = 0").contains("count") && support("position_m = [0, 1000]").contains("position_m[1]"));
    assert!(refused("drop_box", "from = \"small\"\nfill_level = 0.5\nfixed = true").contains("fill nothing"));
}
