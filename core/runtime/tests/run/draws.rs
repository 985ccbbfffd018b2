//! Random decisions of the runtime: poses that conditions refuse, and alternatives of stages.

use crate::growth::assert_same;
use crate::kit::{registry, run};
use std::collections::BTreeMap;
use std::path::Path;
use syntable_model::geometry::Point3;
use syntable_model::scene::{Light, Scene, View};
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::generate::{GenerateOptions, generate};
use syntable_runtime::run::dataset::journal::JournalEntry;
use syntable_runtime::run::progress::Quiet;

const HEAD: &str = "[dataset]\nscenes = 6\nviews_per_scene = 3\nname = \"draws\"\nmax_attempts = 2\n\
     [render]\nkind = \"sleeper\"\n[write.lines]\ninclude = [\"light\"]\n";

/// A recipe with this step and these further tables.
fn recipe(step: &str, tables: &str) -> String {
    format!("{HEAD}[[place]]\n{step}\n{tables}\n")
}

/// Scene and view of each sample.
fn samples<T>(text: &str, of: impl Fn(&Scene, &View) -> T + Send) -> Vec<T> {
    let loaded = syntable_recipe::load(&registry(), Source::embedded("t", text), &Overrides::of_process(Vec::new()));
    let recipe = loaded.unwrap_or_else(|report| panic!("{report}")).0;
    let cache = DiskCache::new(std::env::temp_dir().join("syntable-draws-tests"));
    let options = GenerateOptions { products: vec!["light".into()], threads: 2, cache, ..GenerateOptions::default() };
    let mut found = Vec::new();
    generate(&recipe, &options, &Quiet, &mut |sample| {
        found.push(of(&sample.scene, &sample.view));
        Ok(())
    })
    .expect("made");
    found
}

fn journal(folder: &Path) -> Vec<JournalEntry> {
    let text = std::fs::read_to_string(folder.join(".syntable/journal.jsonl")).expect("a journal");
    let mut entries: Vec<JournalEntry> = text.lines().map(|line| serde_json::from_str(line).expect("a line")).collect();
    entries.sort_by_key(|entry| entry.scene);
    entries
}

/// Whether a corner of the cube is in the image.
fn sees_cube(scene: &Scene, view: &View) -> bool {
    let cube = &scene.objects()[0];
    let camera_from_body = view.camera.world_from_camera.inverse() * cube.world_from_body;
    let in_image = |corner: Point3<f64>| {
        let p = camera_from_body * corner;
        p.z > 0.0 && view.camera.intrinsics.contains(view.camera.project(&p))
    };
    cube.object.mesh.bounds().corners().into_iter().any(in_image)
}

#[test]
fn refused_poses_are_drawn_again_and_counted() {
    let wander = |conditions: &str| recipe("kind = \"boxes\"", &format!("[views]\nkind = \"wander\"\n{conditions}"));
    let free = samples(&wander(""), sees_cube);
    assert!(free.contains(&true) && free.iter().filter(|sees| !**sees).count() > 6, "{free:?}");
    let text = wander("conditions = {}");
    let bound = samples(&text, sees_cube);
    assert!(bound.len() == 18 && bound.iter().all(|sees| *sees), "{bound:?}");
    let folder = tempfile::tempdir().expect("a folder");
    let [one, three] = [1, 3].map(|threads| {
        let out = folder.path().join(threads.to_string());
        run(&text, &out, threads).expect("made");
        out
    });
    assert_same(&one, &three);
    let entries = journal(&one);
    for entry in &entries {
        let refused: u32 = entry.poses.refused.values().sum();
        assert!(entry.poses.drawn == 3 + refused && entry.poses.unmet.is_empty(), "{entry:?}");
    }
    assert!(entries.iter().any(|entry| !entry.poses.refused.is_empty()));
    let line = std::fs::read_to_string(one.join(".syntable/journal.jsonl")).expect("a journal");
    assert!(line.contains("\"refused\":{\"min_objects\":"), "{line}");
}

#[test]
fn a_view_without_an_accepted_pose_follows_the_stated_policy() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name: &str, views: &str| {
        let out = folder.path().join(name);
        (run(&recipe("kind = \"boxes\"", views), &out, 2), out)
    };
    let two =
        |more: &str| format!("[views]\nkind = \"wander\"\nconditions = {{ min_objects = 2, attempts = 7{more} }}");
    let (outcome, out) = of("error", &two(""));
    assert_eq!(outcome.expect("ends well").failed, 6);
    let errors = journal(&out).remove(0).errors;
    let want = "view 0: no pose meets [views.conditions]; 7 drawn, refused by `min_objects` 7";
    assert!(errors.len() == 2 && errors[0].contains(want), "{errors:?}");
    let (outcome, out) = of("best", &two(", on_failure = \"best\""));
    assert_eq!(outcome.expect("made").images, 18);
    assert!(journal(&out).iter().all(|entry| entry.poses.unmet == [0, 1, 2] && entry.poses.drawn == 21));
    let seen = samples(&recipe("kind = \"boxes\"", &two(", on_failure = \"best\"")), sees_cube);
    assert!(seen.iter().filter(|sees| **sees).count() > 12, "the best of seven poses shows the one cube: {seen:?}");
    // A kind without random numbers has one pose.
    let (outcome, out) = of("fixed", "[views]\nkind = \"hemisphere_shell\"\nconditions = { min_objects = 2 }");
    assert_eq!(outcome.expect("ends well").failed, 6);
    assert!(journal(&out)[0].errors[0].contains("the pose does not meet [views.conditions]; 1 drawn"));
    let (outcome, _) = of("sight", "[views]\nkind = \"wander\"\nconditions = { line_of_sight = true }");
    let error = outcome.expect_err("no target").to_string();
    assert!(error.contains("`line_of_sight` needs a point"), "{error}");
}

#[test]
fn a_scene_or_a_view_takes_one_alternative_and_the_journal_records_it() {
    let bulbs = |once: bool| {
        format!(
            "[[lights]]\nid = \"main\"\none_of = [{{ kind = \"bulb\", nits = 1, once = {once} }}, \
             {{ kind = \"bulb\", nits = 2, weight = 2, once = {once} }}]"
        )
    };
    let step = "id = \"things\"\none_of = [{ kind = \"boxes\" }, { kind = \"pair\", weight = 1.5 }]";
    for once in [true, false] {
        let text = recipe(step, &bulbs(once));
        let nits = |view: &View| match view.lights.as_slice() {
            [Light::Sphere(light)] => light.radiance[0] as u32,
            other => panic!("{other:?}"),
        };
        let found = samples(&text, |scene, view| (scene.id.0, scene.objects().len() as u32, nits(view)));
        let folder = tempfile::tempdir().expect("a folder");
        let [one, three] = [1, 3].map(|threads| {
            let out = folder.path().join(threads.to_string());
            run(&text, &out, threads).expect("made");
            out
        });
        assert_same(&one, &three);
        let mut placed = Vec::new();
        for entry in journal(&one) {
            let views: Vec<&(u32, u32, u32)> = found.iter().filter(|(scene, ..)| *scene == entry.scene).collect();
            let lit: Vec<u32> = views.iter().map(|(.., nits)| nits - 1).collect();
            let lit = if once { lit[..1].to_vec() } else { lit };
            let objects = views[0].1 - 1;
            let want =
                BTreeMap::from([("place.things".to_owned(), vec![objects]), ("lights.main".to_owned(), lit.clone())]);
            assert_eq!(entry.choices, want);
            assert!(!once || views.iter().all(|(.., nits)| nits - 1 == lit[0]));
            placed.push(objects);
        }
        assert!(placed.contains(&0) && placed.contains(&1), "{placed:?}");
        let of_views = |scene: u32| found.iter().filter(move |(other, ..)| *other == scene).map(|(.., nits)| *nits);
        let differ = (0..6).any(|scene| of_views(scene).max() != of_views(scene).min());
        assert_eq!(differ, !once, "{found:?}");
    }
}
