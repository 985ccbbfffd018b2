//! Views without a dataset: what they have in common with a run.

use crate::kit::{GLANCE, THOUGHT, options, registry, run_with};
use syntable_model::stage::Input;
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Quiet, Warnings};
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
    let mut pass = previewer.pass(&Wanted { products, width: 4 }, &Quiet, &log, &stop).expect("pools");
    let mut seen = Vec::new();
    for scene in 0..2 {
        pass.scene(scene, &[0, 1, 2], &mut |view, _| seen.push((scene, view))).expect("made");
    }
    assert_eq!(seen.len(), 6);
    assert_eq!(pass.end(), outcome.left_out);
}
