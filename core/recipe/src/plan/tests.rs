use super::*;
use std::collections::BTreeSet;
use syntable_model::context::{DatasetContext, FrameContext, SceneContext, ViewContext};
use syntable_model::error::Result;
use syntable_model::product::{Framing, KeyId, Scope};
use syntable_model::product::{Key, Lighting, PerInstance, Products, standard};
use syntable_model::stage::{Accepts, RecordedScene, ViewProducts};
use syntable_model::stage::{
    DatasetAnnotator, Denoiser, FrameAnnotator, Input, Replacement, SceneAnnotator, Sensor, ViewAnnotator,
};

const PIXELS: Key<PerInstance<u32>> = Key::view("pixels", "");
const RAW: Key<PerInstance<u32>> = Key::view("pixels_raw", "");
const WRONG_PIXELS: Key<PerInstance<f64>> = Key::view("pixels", "");
const A: Key<PerInstance<u32>> = Key::view("a", "");
const B: Key<PerInstance<u32>> = Key::view("b", "");
const S: Key<PerInstance<u32>> = Key::scene("s", "");
const T: Key<PerInstance<u32>> = Key::scene("t", "");
const F: Key<PerInstance<u32>> = Key::frame("f", "");
const G: Key<PerInstance<u32>> = Key::frame("g", "");
const D: Key<PerInstance<u32>> = Key::dataset("d", "");

/// A stage of any scope that never runs.
struct PlannedOnly(Vec<KeyId>, Vec<KeyId>);

impl ViewAnnotator for PlannedOnly {
    fn reads(&self) -> Vec<KeyId> {
        self.0.clone()
    }
    fn provides(&self) -> Vec<KeyId> {
        self.1.clone()
    }
    fn annotate(&self, _: &ViewContext, _: &mut Products) -> Result<()> {
        Ok(())
    }
}

impl FrameAnnotator for PlannedOnly {
    fn reads(&self) -> Vec<KeyId> {
        self.0.clone()
    }
    fn provides(&self) -> Vec<KeyId> {
        self.1.clone()
    }
    fn annotate(&self, _: &FrameContext, _: &mut Products) -> Result<()> {
        Ok(())
    }
}

impl SceneAnnotator for PlannedOnly {
    fn reads(&self) -> Vec<KeyId> {
        self.0.clone()
    }
    fn provides(&self) -> Vec<KeyId> {
        self.1.clone()
    }
    fn annotate(&self, _: &SceneContext, _: &[ViewProducts], _: &mut Products) -> Result<()> {
        Ok(())
    }
}

impl DatasetAnnotator for PlannedOnly {
    fn reads(&self) -> Vec<KeyId> {
        self.0.clone()
    }
    fn provides(&self) -> Vec<KeyId> {
        self.1.clone()
    }
    fn annotate(
        &self,
        _: &DatasetContext,
        _: &mut dyn Iterator<Item = Result<RecordedScene>>,
        _: &mut Products,
    ) -> Result<()> {
        Ok(())
    }
}

/// Replaces `pixels`.
struct PixelFilter;
impl Sensor for PixelFilter {
    fn reads(&self) -> Vec<KeyId> {
        vec![RAW.id()]
    }
    fn provides(&self) -> Vec<KeyId> {
        vec![PIXELS.id()]
    }
    fn replaces(&self) -> Vec<Replacement> {
        vec![Replacement { product: PIXELS.id(), original: RAW.id(), of_parts: false }]
    }
    fn sense(&self, _: &ViewContext, _: &syntable_model::random::Stream, _: &mut Products) -> Result<()> {
        Ok(())
    }
}

fn stage(id: &str, reads: &[KeyId], provides: &[KeyId]) -> Candidate {
    let fake = Box::new(PlannedOnly(reads.to_vec(), provides.to_vec()));
    let producer = match provides[0].scope {
        Scope::View => Producer::View(fake),
        Scope::Frame => Producer::Frame(fake),
        Scope::Scene => Producer::Scene(fake),
        _ => Producer::Dataset(fake),
    };
    Candidate { stage: format!("annotate.{id}"), producer, implied: None }
}

fn plan(stages: Vec<Candidate>, wants: &[&str]) -> std::result::Result<Plan, Vec<PlanError>> {
    let input = |name: &&str| Input::named(*name);
    resolve(
        Offers::Rendered(vec![PIXELS.id()]),
        stages,
        Vec::new(),
        &[("write.w".into(), wants.iter().map(input).collect())],
    )
}

fn order(plan: &Plan) -> Vec<&str> {
    plan.stages().map(|stage| stage.stage.trim_start_matches("annotate.")).collect()
}

fn refused(stages: Vec<Candidate>, wants: &[&str], fault: PlanFault, message: &str) {
    let errors = plan(stages, wants).err().unwrap_or_else(|| panic!("planned, but wanted: {message}"));
    let found = errors
        .iter()
        .any(|error| error.fault == fault && (error.message.contains(message) || error.help.contains(message)));
    assert!(found, "{errors:?}");
}

#[test]
fn providers_run_before_readers_and_only_if_wanted() {
    let all = || {
        vec![
            stage("second", &[A.id()], &[B.id()]),
            stage("first", &[PIXELS.id()], &[A.id()]),
            stage("scene", &[], &[S.id()]),
        ]
    };
    assert_eq!(order(&plan(all(), &["b"]).expect("planned")), ["first", "second"]);
    assert_eq!(order(&plan(all(), &["b", "s"]).expect("planned")), ["scene", "first", "second"]);
    let idle = plan(all(), &["pixels"]).expect("planned");
    assert!(order(&idle).is_empty() && idle.idle.len() == 3);
}

#[test]
fn scene_annotators_run_before_or_after_the_views() {
    let stages = || {
        vec![
            stage("tracks", &[A.id()], &[S.id()]),
            stage("a", &[PIXELS.id()], &[A.id()]),
            stage("of_tracks", &[S.id()], &[T.id()]),
            stage("all", &[T.id(), A.id()], &[D.id()]),
        ]
    };
    let found = plan(stages(), &["d"]).expect("planned");
    assert_eq!(order(&found), ["a", "tracks", "of_tracks", "all"]);
    assert_eq!((found.before_views.len(), found.after_views.len(), found.per_dataset.len()), (0, 2, 1));
    assert_eq!((found.recorded_of_scene(), found.recorded_of_views()), (vec![T.id()], vec![A.id()]));
    let mut early = stages();
    early.push(stage("early", &[S.id()], &[B.id()]));
    refused(early, &["b"], PlanFault::TooEarly, "after the views");
    refused(
        vec![stage("early", &[D.id()], &[B.id()]), stage("d", &[], &[D.id()])],
        &["b"],
        PlanFault::TooEarly,
        "all scenes",
    );
}

#[test]
fn frame_annotators_run_between_the_scene_and_its_views() {
    let stages = || {
        vec![
            stage("a", &[G.id(), S.id(), PIXELS.id()], &[A.id()]),
            stage("of_frame", &[F.id(), S.id()], &[G.id()]),
            stage("frame", &[], &[F.id()]),
            stage("scene", &[], &[S.id()]),
            stage("of_frames", &[F.id()], &[T.id()]),
            stage("all", &[G.id(), T.id()], &[D.id()]),
        ]
    };
    let found = plan(stages(), &["a", "t", "d", "f"]).expect("planned");
    assert_eq!(order(&found), ["scene", "frame", "of_frame", "a", "of_frames", "all"]);
    let sizes = [&found.before_views, &found.per_frame, &found.per_view, &found.after_views].map(Vec::len);
    assert_eq!(sizes, [1, 2, 1, 1]);
    // A record has the products of a moment with each view at it.
    assert_eq!((found.recorded_of_scene(), found.recorded_of_views()), (vec![T.id()], vec![G.id()]));
    // A scene that lacks `a` needs no annotator after its views.
    assert_eq!(order(&found.part(["a"], false)), ["scene", "frame", "of_frame", "a"]);
    // A moment is over when its views are rendered, and the scene when all are.
    let early = vec![stage("early", &[PIXELS.id()], &[F.id()])];
    refused(early, &["f"], PlanFault::TooEarly, "known only in each view");
    let early = vec![stage("early", &[T.id()], &[G.id()]), stage("frame", &[], &[F.id()]), stages().remove(4)];
    refused(early, &["g"], PlanFault::TooEarly, "after the views");
}

#[test]
fn a_rendered_product_is_wanted_on_several_canvases() {
    let wide = PIXELS.on_canvas(3);
    let stages = vec![stage("a", &[PIXELS.id(), wide.id()], &[A.id()]), stage("b", &[wide.id()], &[B.id()])];
    let found = plan(stages, &["a", "b", "pixels (canvas 5)"]).expect("planned");
    assert_eq!(found.rendered, [PIXELS.id(), wide.id(), PIXELS.on_canvas(5).id()]);
    let by_framing = found.by_framing();
    assert_eq!(by_framing.keys().map(|framing| framing.canvas()).collect::<Vec<_>>(), [1, 3, 5]);
    assert!(by_framing.values().all(|wants| *wants == [PIXELS.id()]), "the renderer is asked for what it offers");
    let known = |name| format!("reads product `{name}`, which nothing provides");
    for wrong in ["pixels (canvas 2)", "pixels (before support)", "pixels (objects alone)", "a (canvas 3)"] {
        refused(vec![stage("a", &[], &[A.id()])], &[wrong], PlanFault::Unknown, &known(wrong));
    }
}

#[test]
fn a_replaced_product_is_the_new_one_for_all_others() {
    let filter = || Candidate {
        stage: "sensor.filter".into(),
        producer: Producer::Sensor(Box::new(PixelFilter)),
        implied: None,
    };
    let found = plan(vec![stage("a", &[PIXELS.id()], &[A.id()]), filter()], &["a", "pixels_raw"]).expect("planned");
    let entries: Vec<String> =
        found.entries.iter().map(|entry| format!("{} by {}", entry.key, entry.provider)).collect();
    assert_eq!(entries, ["pixels_raw by render", "pixels by sensor.filter", "a by annotate.a"]);
    assert_eq!(found.rendered, [PIXELS.id()]);
    assert_eq!(found.replaced.len(), 1);
    // Nothing reads the new product: the original is the rendered product, and the filter is idle.
    let found = plan(vec![filter()], &["pixels_raw"]).expect("planned");
    assert!(found.stages().next().is_none());
    refused(
        vec![filter(), Candidate { stage: "sensor.other".into(), ..filter() }],
        &["pixels"],
        PlanFault::Ambiguous,
        "replaced by several",
    );
}

#[test]
fn gaps_ambiguities_and_cycles_are_refused() {
    refused(vec![], &["pixel"], PlanFault::Unknown, "nothing provides");
    assert_eq!(plan(vec![], &["pixel"]).err().expect("refused")[0].known, ["pixels"]);
    let (x, y) = (|| stage("x", &[], &[A.id()]), || stage("y", &[], &[A.id()]));
    refused(vec![x(), y()], &["a"], PlanFault::Ambiguous, "annotate.x, annotate.y");
    refused(vec![stage("x", &[], &[PIXELS.id()])], &["pixels"], PlanFault::Ambiguous, "annotate.x, render");
    let circle = vec![stage("x", &[B.id()], &[A.id()]), stage("y", &[A.id()], &[B.id()])];
    refused(circle, &["a"], PlanFault::Cycle, "annotate.x → annotate.y → annotate.x");
    refused(vec![stage("x", &[WRONG_PIXELS.id()], &[A.id()])], &["a"], PlanFault::WrongType, "as PerInstance<f64>");
}

#[test]
fn an_ambiguity_is_resolved_by_what_its_help_says() {
    let of = |id: &str| stage(id, &[], &[A.id()]);
    let (x, y, z) = ("[annotate.x]", "[annotate.y]", "[annotate.z]");
    refused(vec![of("x"), of("y")], &["a"], PlanFault::Ambiguous, &format!("remove {x} or {y} from the recipe"));
    let three = format!("keep one of {x}, {y}, {z} in the recipe");
    refused(vec![of("x"), of("y"), of("z")], &["a"], PlanFault::Ambiguous, &three);
    let rendered = stage("x", &[], &[PIXELS.id()]);
    let renderer = format!("remove {x} from the recipe: the renderer makes `pixels`");
    refused(vec![rendered], &["pixels"], PlanFault::Ambiguous, &renderer);
}

#[test]
fn a_writer_refuses_what_it_cannot_store() {
    let input = |accepts| Input { accepts, option: Some("include[0]".into()), ..Input::named("pixels") };
    let check = |accepts| {
        resolve(Offers::Rendered(vec![PIXELS.id()]), vec![], vec![], &[("write.w".into(), vec![input(accepts)])]).err()
    };
    assert!(check(Accepts::Type(PIXELS.id())).is_none());
    for accepts in [Accepts::Type(WRONG_PIXELS.id()), Accepts::when(|_| Err("no".into()))] {
        let errors = check(accepts).expect("refused");
        assert_eq!((errors[0].fault, errors[0].stage.as_str()), (PlanFault::NotStorable, "write.w"));
        assert_eq!(errors[0].option.as_deref(), Some("include[0]"));
    }
}

#[test]
fn stored_products_have_no_other_framing() {
    let wide = PIXELS.on_canvas(3).id();
    let asked = |offers, product: String| {
        let input = Input::named(product);
        resolve(offers, Vec::new(), Vec::new(), &[("write.w".into(), vec![input])])
    };
    let stored = || Offers::Stored(vec![PIXELS.id()]);
    assert_eq!(asked(stored(), "pixels".into()).expect("stored").rendered, [PIXELS.id()]);
    assert_eq!(asked(Offers::Rendered(vec![PIXELS.id()]), wide.to_string()).expect("rendered").rendered, [wide]);
    let errors = asked(stored(), wide.to_string()).err().expect("nothing can render it");
    assert_eq!(errors[0].fault, PlanFault::Unknown);
    assert_eq!(asked(Offers::Stored(vec![wide]), wide.to_string()).expect("stored").rendered, [wide]);
}

#[test]
fn tables_keep_to_a_width_and_cut_nothing() {
    let text = "what the option means, said in more words than fit into a line of the terminal";
    let rows = [["name", "meaning"].map(str::to_owned), ["a_long_name_of_an_option".to_owned(), text.to_owned()]];
    let narrow = super::table_within(&rows, Some(60));
    assert!(narrow.lines().count() > 2 && narrow.lines().all(|line| line.chars().count() <= 60), "{narrow}");
    let words = |table: &str| table.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words(&narrow), words(&super::table(&rows)));
    assert_eq!(super::table_within(&rows, Some(200)), super::table(&rows));
    // A word is never broken.
    assert!(super::table_within(&rows, Some(8)).contains("a_long_name_of_an_option"));
}

const LIGHT_OF_ALL: &str = "radiance (objects alone)";

/// Denoises with one guide.
struct Denoising;
impl Denoiser for Denoising {
    fn reads(&self) -> Vec<KeyId> {
        vec![standard::RADIANCE_NOISY.id(), standard::DENOISE_ALBEDO.id()]
    }
    fn denoise(&self, _: &ViewContext, _: &mut Products) -> Result<()> {
        Ok(())
    }
}

/// Plans what a writer reads of a renderer of light, with a denoiser.
fn lit(wants: &[&str]) -> std::result::Result<Plan, Vec<PlanError>> {
    let input = |name: &&str| Input::named(*name);
    let denoiser =
        Candidate { stage: "denoise".into(), producer: Producer::Denoiser(Box::new(Denoising)), implied: None };
    let offers =
        syntable_model::keys![standard::RADIANCE, standard::DENOISE_ALBEDO, standard::NORMAL, standard::COVERAGE];
    resolve(
        Offers::Rendered(offers),
        vec![denoiser],
        Vec::new(),
        &[("write.w".into(), wants.iter().map(input).collect())],
    )
}

fn names(keys: &[KeyId]) -> Vec<String> {
    let names: BTreeSet<String> = keys.iter().map(|key| key.to_string()).collect();
    names.into_iter().collect()
}

#[test]
fn a_framing_beyond_its_limit_is_named() {
    for (name, help) in [
        ("coverage (subpixels 9)", "`subpixels 9` is out of range: a pixel has 2 to 8"),
        ("coverage (canvas 3, subpixels 1)", "`subpixels 1` is out of range: a pixel has 2 to 8"),
        ("normal (canvas 4)", "`canvas 4` is out of range: a canvas is an odd number from 3 to 9"),
        ("normal (canvas 11, next view)", "`canvas 11` is out of range"),
        ("normal (canvas three)", "a rendered product may have `(canvas 3)`, up to 9, `(subpixels 2)`, up to 8"),
        ("abnormal (canvas 4)", "`syntable list products`"),
        ("denoiser (canvas 3)", "`denoiser` is not a rendered product"),
    ] {
        let errors = lit(&[name]).err().expect("refused");
        assert!(errors.iter().any(|error| error.help.starts_with(help)), "{name}: {errors:?}");
    }
}

#[test]
fn light_on_objects_is_denoised_like_the_image() {
    let found = lit(&[LIGHT_OF_ALL]).expect("planned");
    let alone = Framing::of_objects(Lighting::Alone);
    let of_objects = |plan: &Plan| plan.per_view.iter().flat_map(|stage| stage.of_parts.clone()).collect::<Vec<_>>();
    assert_eq!(of_objects(&found), [alone]);
    let by_framing = found.by_framing();
    assert_eq!(by_framing.keys().collect::<Vec<_>>(), [&Framing::IMAGE, &alone], "the image comes first");
    // The coverage of the image locates the objects.
    assert_eq!(names(&by_framing[&Framing::IMAGE]), ["coverage", "denoise_albedo", "radiance"]);
    assert_eq!(names(&by_framing[&alone]), ["denoise_albedo", "radiance"]);
    let provider = |plan: &Plan, name: &str| {
        plan.entries.iter().find(|entry| entry.key.is(name)).map(|entry| entry.provider.to_string())
    };
    assert_eq!(provider(&found, LIGHT_OF_ALL).as_deref(), Some("denoise"));
    assert_eq!(provider(&found, "radiance_noisy (objects alone)").as_deref(), Some("render"));
    // A part has everything that it is made from, and nothing else.
    let part = lit(&[LIGHT_OF_ALL, "normal (objects in scene)"]).expect("planned").part([LIGHT_OF_ALL], false);
    assert_eq!((part.by_framing(), of_objects(&part)), (by_framing, of_objects(&found)));
    let part = lit(&[LIGHT_OF_ALL, "normal (objects in scene)"]).expect("planned");
    let part = part.part(["normal (objects in scene)"], false);
    assert_eq!(names(&part.rendered), ["coverage", "normal (objects in scene)"]);
    assert!(part.per_view.is_empty());
    // A stage can read the original; labels have no original.
    assert!(lit(&["radiance_noisy (objects in scene)"]).is_ok() && lit(&["normal_noisy (objects alone)"]).is_err());
    assert!(lit(&["coverage (objects alone)"]).is_err());
}
