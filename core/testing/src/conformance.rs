//! What every implementation of a trait must satisfy. Each function panics with the reason.

use std::path::Path;
use std::sync::Arc;
use syntable_model::product::{Frame, KeyId};
use syntable_model::registry::{ConstructError, Constructed, Entry};
use syntable_model::scene::Scene;
use syntable_model::stage::{Annotator, Output, RenderRequest, Renderer, SceneWriter, Site, Writer};
use syntable_model::{context::Workers, random::Stream};

/// A kind of stage: its example builds, its options survive writing and reading, unknown keys are refused, and
/// everything is documented. Gives the stage of the example.
pub fn entry(entry: &Entry) -> Constructed {
    let at = format!("{}.{}", entry.slot, entry.kind);
    let construct = |text: &str| -> Result<Constructed, String> {
        entry.construct_str(text).map_err(|error| match error {
            ConstructError::Form(error) => error.to_string(),
            ConstructError::Invalid(invalid) => format!("{}: {}", invalid.key, invalid.message),
        })
    };
    let constructed = construct(entry.example).unwrap_or_else(|error| panic!("the example of {at}: {error}"));
    let text = toml::to_string(&constructed.options).expect("options are plain data");
    let again = construct(&text).unwrap_or_else(|error| panic!("{at} cannot read what it wrote: {error}\n{text}"));
    assert_eq!(again.options, constructed.options, "{at} changes when it is written and read");
    let unknown = format!("no_such_option = 1\n{}", entry.example);
    assert!(construct(&unknown).is_err(), "{at} accepts unknown keys");

    let schema = entry.schema(&mut schemars::generate::SchemaSettings::draft07().into_generator());
    assert!(schema.get("description").is_some(), "{at} has no description");
    let options = schema.get("properties").and_then(|value| value.as_object()).cloned().unwrap_or_default();
    for (name, option) in &options {
        let documented = option.get("description").is_some() || option.get("$ref").is_some();
        assert!(documented, "option `{name}` of {at} has no description");
    }
    constructed
}

/// An annotator: it provides what it declares, reads nothing else than it declares, and gives the same twice.
pub fn annotator(annotator: &dyn Annotator, site: &Site, make_frame: impl Fn() -> Frame) {
    let provided = annotator.provides();
    assert!(!provided.is_empty(), "it provides nothing");
    let scope = annotator.scope();
    assert!(provided.iter().all(|key| key.scope == scope), "its products have different scopes");
    let make = || {
        let mut frame = make_frame();
        frame.guard(&annotator.reads());
        annotator.annotate(site, &mut frame).expect("annotates");
        frame.unguard();
        provided.iter().map(|key| frame.value(key.name).expect("provided")).collect::<Vec<_>>()
    };
    assert_eq!(make(), make(), "it gives different products from the same");
}

/// A renderer: it makes exactly what is wanted, alone or together, the same for any number of threads.
pub fn renderer(renderer: &dyn Renderer, scene: &Arc<Scene>, request: &RenderRequest, threads: &[&dyn Workers]) {
    let render = |wants: &[KeyId], workers: &dyn Workers| {
        let mut session = renderer.open(0).expect("opens");
        session.load(scene, workers).expect("loads");
        let mut frame = Frame::new();
        let stream: Stream = request.stream.clone();
        session.render(&RenderRequest { view: request.view, wants, stream, workers }, &mut frame).expect("renders");
        let made: Vec<&str> = frame.keys().iter().map(|key| key.name).collect();
        let mut wanted: Vec<&str> = wants.iter().map(|key| key.name).collect();
        wanted.sort_unstable();
        assert_eq!(made, wanted, "it makes other products than wanted");
        wants.iter().map(|key| frame.value(key.name).expect("made")).collect::<Vec<_>>()
    };
    let offers = renderer.offers();
    let all = render(&offers, threads[0]);
    for &workers in threads {
        assert!(render(&offers, workers) == all, "pictures differ with {} threads", workers.threads());
    }
    for (key, value) in offers.iter().zip(&all) {
        assert!(&render(&[*key], threads[0])[0] == value, "`{}` differs when it is made alone", key.name);
    }
}

/// A writer: the same samples give the same files, all inside its folder. Gives the files of the scene, by path.
pub fn writer(writer: &dyn Writer, site: &Site, frame: &Frame, folder: &Path) -> Vec<(String, Vec<u8>)> {
    let write = |name: &str| {
        let staging = folder.join(name);
        let output = Output::new(&staging, "test", site.scene.id);
        let scene_site = Site { view: None, ..*site };
        let mut scene: Box<dyn SceneWriter> = writer.scene(&scene_site, output).expect("starts a scene");
        scene.view(site, frame).expect("writes a view");
        scene.close().expect("closes");
        let mut files = Vec::new();
        collect(&staging, &staging, &mut files);
        files.sort();
        files
    };
    let (first, second) = (write("first"), write("second"));
    assert!(first == second, "it writes different files from the same samples");
    first
}

fn collect(folder: &Path, root: &Path, files: &mut Vec<(String, Vec<u8>)>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            collect(&path, root, files);
        } else {
            let name = path.strip_prefix(root).expect("below").to_string_lossy().into_owned();
            files.push((name, std::fs::read(&path).expect("readable")));
        }
    }
}
