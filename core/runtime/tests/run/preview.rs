//! Views without a dataset: their agreement with a run.

use crate::kit::{GLANCE, LIGHT, THOUGHT, fail_next, failures_left, options, registry, run_with};
use std::sync::Mutex;
use syntable_model::error::Error;
use syntable_model::stage::Input;
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Event, Quiet, Reporter, Warnings};
use syntable_runtime::run::stop::Stop;

#[test]
fn a_preview_leaves_out_what_a_run_leaves_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 2\nviews_per_scene = 3\nname = \"careless\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n\
         [write.lines]\ninclude = [\"glance\", \"thought\"]\n";
    let outcome = run_with(recipe, options(folder.path(), 1), &Quiet).expect("the run ends well");
    let told: Vec<String> = outcome.left_out.iter().map(|loss| loss.warning().to_string()).collect();
    assert_eq!(told, ["annotate.careless: 2 of 6 things were overlooked (in 2 images)"]);
    let products = ["glance", "thought"].map(str::to_owned).to_vec();
    let wanted = [Input::of(GLANCE), Input::of(THOUGHT)].to_vec();
    let overrides = Overrides { wanted, ..Overrides::of_process(Vec::new()) };
    let (recipe, _) = syntable_recipe::load(&registry(), Source::embedded("test.toml", recipe), &overrides)
        .unwrap_or_else(|report| panic!("{report}"));
    let mut previewer = Previewer::new(1, DiskCache::new(folder.path().join("../cache"))).expect("threads");
    previewer.set(recipe).expect("sound");
    let (stop, log) = (Stop::default(), Warnings(&Quiet));
    let mut pass =
        previewer.pass(&Wanted { products, width: 4, allow_code: false }, &Quiet, &log, &stop).expect("pools");
    let mut seen = Vec::new();
    for scene in 0..2 {
        pass.scene(scene, &[0, 1, 2], &mut |view, _, _| seen.push((scene, view))).expect("made");
    }
    assert_eq!(seen.len(), 6);
    assert_eq!(pass.end(), outcome.left_out);
}

/// Keeps the failed attempts: their numbers, and whether each was the last.
#[derive(Default)]
struct FailedAttempts(Mutex<Vec<(u32, bool)>>);

impl Reporter for FailedAttempts {
    fn event(&self, event: &Event) {
        if let Event::Attempt { attempt, last, .. } = event {
            self.0.lock().expect("attempts").push((*attempt, *last));
        }
    }
}

#[test]
fn what_the_end_of_a_dataset_leaves_out_counts_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 3\nviews_per_scene = 2\nname = \"careless\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n[annotate.summer]\noverlooks = 2\n\
         [write.lines]\ninclude = [\"total\"]\n";
    for threads in [1, 2] {
        let out = folder.path().join(threads.to_string());
        let outcome = run_with(recipe, options(&out, threads), &Quiet).expect("the run ends well");
        let told: Vec<String> = outcome.left_out.iter().map(|loss| loss.warning().to_string()).collect();
        assert_eq!(told, ["annotate.summer: 2 of 3 scenes were overlooked (in the dataset's files)"]);
    }
}

#[test]
fn a_preview_tries_a_scene_again_as_a_run_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[dataset]\nscenes = 1\nviews_per_scene = 2\nname = \"shaken\"\nmax_attempts = 3\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\ntally = 22\n\
         [write.lines]\ninclude = [\"light\"]\n";
    let overrides = Overrides { wanted: [Input::of(LIGHT)].to_vec(), ..Overrides::of_process(Vec::new()) };
    let (recipe, _) = syntable_recipe::load(&registry(), Source::embedded("test.toml", text), &overrides)
        .unwrap_or_else(|report| panic!("{report}"));
    let mut previewer = Previewer::new(1, DiskCache::new(folder.path().join("../cache"))).expect("threads");
    previewer.set(recipe).expect("sound");
    let wanted = Wanted { products: vec!["light".to_owned()], width: 4, allow_code: false };
    let lost = || Error::device("the device was lost");
    for (error, times, attempts, is_made) in [
        (lost(), 2, vec![(0, false), (0, false)], true),
        (lost(), 9, vec![(0, false), (0, false), (0, true)], false),
        (Error::unlucky("a dark corner"), 2, vec![(0, false), (1, false)], true),
        (Error::unlucky("a dark corner"), 9, vec![(0, false), (1, false), (2, true)], false),
        // The preview continues, so its reporter gets the error that would end a run.
        (Error::new("a wrong option"), 9, vec![(0, true)], false),
    ] {
        let (failed, stop) = (FailedAttempts::default(), Stop::default());
        let log = Warnings(&failed);
        fail_next(22, 0, times, error.clone());
        let mut pass = previewer.pass(&wanted, &failed, &log, &stop).expect("pools");
        let made = pass.scene(0, &[0, 1], &mut |_, _, _| {});
        drop(pass);
        assert_eq!(
            made.map_err(|error| error.message().to_owned()).err(),
            (!is_made).then(|| error.message().to_owned())
        );
        assert_eq!(*failed.0.lock().expect("attempts"), attempts, "{error}");
        assert_eq!(failures_left(22, 0), times - attempts.len() as u32);
    }
}
