//! Random materials, outdoor floors, and distractors.

use super::*;
use syntable_model::scene::SettleReport;

fn bodies(scene: &SceneBuilder) -> Vec<&BodyDraft> {
    scene.bodies().map(|(_, body)| body).collect()
}

#[test]
fn walls_alike_have_one_material_and_mapping() {
    let options = "material = { floor = \"materials\", walls = \"materials\", ceiling = \"materials\" }";
    let room = placer("room", &format!("{options}\nwalls_alike = true\ntexture_scale = {{ uniform = [0.5, 2] }}"));
    let apart = placer("room", options);
    let mut same_as_floor = 0;
    for seed in 0..80 {
        let (scene, _) = place(&[&*room], seed).expect("placed");
        let overrides: Vec<_> =
            bodies(&scene).iter().map(|body| body.material_override.clone().expect("an override")).collect();
        for wall in &overrides[2..5] {
            assert_eq!(wall.material.digest, overrides[1].material.digest);
            assert_eq!(wall.mapping, overrides[1].mapping);
        }
        same_as_floor += usize::from(overrides[0].material.name == overrides[1].material.name);
        // The pool's materials have tiles of 1 m.
        assert!(overrides.iter().all(|one| (0.5..2.0).contains(&one.material.tile_m)));
        assert!(overrides[0].material.tile_m != overrides[1].material.tile_m);
        // A room whose walls differ has the same floor and ceiling.
        let (other, _) = place(&[&*apart], seed).expect("placed");
        for i in [0, 5] {
            let other = bodies(&other)[i].material_override.clone().expect("an override");
            assert_eq!((&other.material.name, other.mapping), (&overrides[i].material.name, overrides[i].mapping));
            assert_eq!(other.material.tile_m, 1.0);
        }
    }
    // 10 of 80 with a standard deviation of 3.
    assert!(same_as_floor < 25, "{same_as_floor}");
}

#[test]
fn floor_only_leaves_out_walls_and_ceiling() {
    let (scene, _) = place(&[&*placer("room", "floor_only = true\nsize_m = 40")], 1).expect("placed");
    let bodies = bodies(&scene);
    assert_eq!(bodies.len(), 1);
    let bounds = bodies[0].world_bounds();
    assert!((bounds.max - Point3::new(20.1, 20.1, 0.0)).norm() < 1e-5, "{bounds:?}");
}

#[test]
fn a_room_can_be_longer_than_wide() {
    let room = placer("room", "size_m = 4\nlength_m = { uniform = [5, 9] }\nheight_m = 3");
    let mut lengths = std::collections::BTreeSet::new();
    for seed in 0..20 {
        let (scene, _) = place(&[&*room], seed).expect("placed");
        let boxes = bodies(&scene).into_iter().map(BodyDraft::world_bounds).collect::<Vec<_>>();
        let inside = syntable_model::geometry::space_around(&Point3::new(0.3, 0.2, 1.0), boxes.iter().copied());
        let size = inside.size();
        assert!((size.x - 4.0).abs() < 1e-5 && (size.z - 3.0).abs() < 1e-5 && (5.0..9.0).contains(&size.y), "{size}");
        assert!(inside.center().coords.xy().norm() < 1e-5);
        lengths.insert((size.y * 1e6) as u64);
        // The parts fill the shell without gaps and overlaps.
        let filled: f64 = boxes.iter().map(|b| b.size().iter().product::<f64>()).sum();
        let shell = 4.2 * (size.y + 0.2) * 3.2 - 4.0 * size.y * 3.0;
        assert!((filled / shell - 1.0).abs() < 1e-4, "{filled} {shell}");
    }
    assert_eq!(lengths.len(), 20);
}

#[test]
fn some_objects_get_another_material_and_nothing_else_changes() {
    let (table, plain) = (table(), placer("drop_box", "from = [\"small\"]\ncount = 20"));
    let other = placer(
        "drop_box",
        "from = [\"small\"]\ncount = 20\nmaterial = { from = \"materials\", probability = 0.3, texture_scale = 0.5 }",
    );
    let mut replaced = 0;
    for seed in 0..100 {
        let (a, _) = place(&[&*table, &*plain], seed).expect("placed");
        let (b, _) = place(&[&*table, &*other], seed).expect("placed");
        for (a, b) in objects(&a).iter().zip(objects(&b)) {
            assert_eq!(
                (&a.asset, a.world_from_body, a.object.mass.kg),
                (&b.asset, b.world_from_body, b.object.mass.kg)
            );
            assert!(a.material_override.is_none());
            replaced += usize::from(b.material_override.as_ref().is_some_and(|other| other.material.tile_m == 0.5));
        }
    }
    // 600 ± 4 standard deviations of a binomial.
    assert!((518..=682).contains(&replaced), "{replaced} of 2000");
}

#[test]
fn objects_of_a_factor_are_their_assets_at_that_factor() {
    let (table, plain) = (table(), placer("drop_box", "from = [\"small\"]\ncount = 20"));
    let vary = "scale = { uniform = [0.5, 2.0] }\ncolor = { hue_deg = { uniform = [-90, 90] }, brightness = 0.8, probability = 0.5 }";
    let varied = placer("drop_box", &format!("from = [\"small\"]\ncount = 20\n{vary}"));
    assert!(varied.resizes_objects() && !plain.resizes_objects());
    let (mut factors, mut recolored) = (Vec::new(), 0);
    for seed in 0..100 {
        let (a, _) = place(&[&*table, &*plain], seed).expect("placed");
        let (b, _) = place(&[&*table, &*varied], seed).expect("placed");
        assert_apart(&objects(&b));
        for (a, b) in objects(&a).iter().zip(objects(&b)) {
            assert_eq!((&a.asset, a.world_from_body.rotation), (&b.asset, b.world_from_body.rotation));
            let (asset, factor) = b.object.at_own_size();
            assert_eq!((asset.digest, asset.mesh.bounds()), (a.object.digest, a.object.mesh.bounds()));
            let [was, is] = [&a.object, &b.object].map(|object| object.mesh.bounds());
            assert!(
                (was.size() * factor - is.size()).norm() < 1e-6
                    && (was.min.coords * factor - is.min.coords).norm() < 1e-6
            );
            // Assets of 1 kg: the density stays, and so does the inertia of that density, with the fifth power.
            assert!((b.mass.kg / factor.powi(3) - 1.0).abs() < 1e-12);
            assert!((b.mass.inertia() - a.mass.inertia() * factor.powi(5)).norm() < 1e-6);
            assert_ne!(a.object.digest, b.object.digest);
            factors.push(factor);
            recolored += usize::from(b.recolor.is_some_and(|it| it.brightness == 0.8 && it.hue_deg.abs() <= 90.0));
        }
    }
    let mean = factors.iter().sum::<f64>() / factors.len() as f64;
    // Uniform in [0.5, 2): 1.25, with a standard deviation of 1.5 / √12 / √2000.
    assert!((mean - 1.25).abs() < 0.04 && factors.iter().all(|factor| (0.5..2.0).contains(factor)), "{mean}");
    // 1000 ± 4 standard deviations of a binomial.
    assert!((910..=1090).contains(&recolored), "{recolored} of 2000");
    // Distractors have their size limits after the factor: of edges of 50, 80 and 90 mm, at half of their size.
    let clutter = placer("distractors", "from = [\"small\"]\ncount = 9\nsize_m = [0.001, 0.03]\nscale = 0.5");
    let (scene, _) = place(&[&*table, &*clutter], 3).expect("placed");
    let names = scene.bodies().filter(|(_, body)| body.role == Role::Distractor).map(|(_, body)| &*body.asset.name);
    assert_eq!(names.collect::<std::collections::BTreeSet<_>>().into_iter().collect::<Vec<_>>(), ["30x40x50"]);
    assert!(!clutter.resizes_objects(), "no label describes them");
    // 80 mm and more at a hundred times the size; another draw of the scene might fit.
    let huge = placer("drop_box", "from = [\"big\"]\ncount = 1\nscale = 100");
    let error = place(&[&*table, &*huge], 1).expect_err("too large");
    assert!(error.is_unlucky(), "{error}");
    let said = error.to_string();
    assert!(said.contains("big/300x300x300: object extent 30.000 m is outside the allowed range"), "{said}");
    assert!(said.contains("at the scale 100.0000 (narrow the placer's `scale`)"), "{said}");
}

#[test]
fn distractors_lie_on_the_floor_around_the_table() {
    let (room, table) = (placer("room", "size_m = 4\nheight_m = 3"), table());
    let options = "from = [\"small\", \"big\"]\ncount = 30\ndistance_m = [0.2, 0.9]";
    let clutter = placer("distractors", options);
    let (mut lying, mut all) = (0, 0);
    for seed in 0..12 {
        let (scene, _) = place(&[&*room, &*table, &*clutter], seed).expect("placed");
        let bodies = bodies(&scene);
        let distractors: Vec<&BodyDraft> = bodies.iter().copied().filter(|b| b.role == Role::Distractor).collect();
        assert!(distractors.len() > 15, "{}", distractors.len());
        let apart: Vec<&BodyDraft> = bodies.iter().copied().filter(|b| b.role != Role::Room).collect();
        assert_apart(&apart);
        for body in distractors {
            assert_eq!(body.motion, Motion::Fixed);
            // Exact over the vertices: they are the vertices of the box.
            let bounds = body.world_bounds();
            assert!(bounds.min.z.abs() < 1e-6, "{bounds:?}");
            assert!((0..2).all(|k| bounds.min[k] > -2.0 && bounds.max[k] < 2.0), "{bounds:?}");
            let gap = |k: usize, half: f64| (bounds.min[k] - half).max(-half - bounds.max[k]).max(0.0);
            let distance = gap(0, 0.6).hypot(gap(1, 0.4));
            assert!((0.2 - 1e-6..=0.9 + 1e-6).contains(&distance), "{distance}");
            all += 1;
            lying += usize::from((body.world_from_body.rotation * Vector3::z()).z < 0.5);
        }
    }
    let expected = 0.4 * f64::from(all);
    assert!((lying as f64 - expected).abs() < 4.0 * (expected * 0.6).sqrt(), "{lying} of {all}");
    // Sizes: only the smallest assets pass. If no asset passes, the scene has no distractors.
    let names = |options: &str| {
        let clutter = placer("distractors", &format!("{options}\nfrom = [\"small\", \"big\"]\ncount = 9"));
        let (scene, _) = place(&[&*table, &*clutter], 3).expect("placed");
        let distractors = scene.bodies().filter(|(_, body)| body.role == Role::Distractor);
        distractors.map(|(_, body)| body.asset.name.clone()).collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(names("size_m = [0.01, 0.06]").into_iter().collect::<Vec<_>>(), ["30x40x50"]);
    assert!(names("size_m = [0.5, 0.6]").is_empty());
    let alone = place(&[&*clutter], 1).expect_err("no table").to_string();
    assert!(alone.contains("no support"), "{alone}");
}

#[test]
fn distractors_come_after_objects_and_before_the_table() {
    let (room, table) = (placer("room", ""), table());
    let unlabeled = placer("drop_box", "from = [\"small\"]\ncount = 3\nannotated = false");
    let floor = placer("distractors", "from = [\"small\"]\ncount = 4");
    let drop = placer("drop_box", "from = [\"small\"]\ncount = 5");
    let (scene, _) = place(&[&*room, &*table, &*unlabeled, &*floor, &*drop], 2).expect("placed");
    assert_eq!(objects(&scene).iter().map(|body| body.spawn).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    let scene = scene.freeze(SettleReport::default()).expect("frozen");
    assert_eq!((scene.objects().len(), scene.foreground().len(), scene.bodies().len()), (5, 12, 19));
    let roles: Vec<Role> = scene.bodies().iter().map(|body| body.role).collect();
    assert_eq!(roles[5..12], [Role::Distractor; 7]);
    let moving = scene.foreground()[5..].iter().filter(|body| body.motion == Motion::Dynamic).count();
    assert_eq!(moving, 3);
}
