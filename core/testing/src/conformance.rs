//! Requirements of traits, which every implementation must meet. Each function panics with the reason.

use crate::folder::{files, files_of_store};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::{ViewContext, Workers};
use syntable_model::error::Result;
use syntable_model::keys;
use syntable_model::product::standard::{ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DEPTH, INSTANCE, NORMAL, RADIANCE};
use syntable_model::product::{KeyId, ProductId, Products, Scope, Value};
use syntable_model::registry::{ConstructError, Constructed, Entry, Stage};
use syntable_model::scene::{InstanceId, Scene};
use syntable_model::stage::{Bodies, Output, RenderRequest, Renderer, SceneWriter, Scenes, Window, Writer};
use syntable_model::store::{MemStore, StoreFolder};

/// Checks a kind of stage: its example builds, its options survive writing and reading, unknown keys are refused, and
/// all options are documented. Returns the stage of the example.
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

/// Checks an annotator of images, views or moments, given as a stage; see [`producer`].
///
/// # Panics
/// If the stage is of another kind, or fails the check.
pub fn annotator(stage: &Stage, cx: &ViewContext, products: &Products) -> Products {
    match stage {
        Stage::AnnotateImage(it) => {
            producer(&it.reads(), (Scope::View, &it.provides()), products, |lent| it.annotate(cx, lent))
        }
        Stage::AnnotateView(it) => {
            producer(&it.reads(), (Scope::View, &it.provides()), products, |lent| it.annotate(cx, lent))
        }
        Stage::AnnotateFrame(it) => {
            let cx = cx.of_scene().frame(cx.view.moment);
            producer(&it.reads(), (Scope::Frame, &it.provides()), products, |lent| it.annotate(&cx, lent))
        }
        _ => panic!("no annotator of images, views or moments"),
    }
}

/// Checks a producer of a scope: it makes exactly the products that it declares, reads only the products that it
/// declares, and makes the same products twice. Returns these products.
fn producer(
    reads: &[KeyId],
    (scope, provided): (Scope, &[KeyId]),
    products: &Products,
    annotate: impl Fn(&mut Products) -> Result<()>,
) -> Products {
    assert!(!provided.is_empty(), "it provides nothing");
    assert!(provided.iter().all(|key| key.scope == scope), "it provides products of another scope");
    let lent = products.only(reads);
    let make = || {
        let mut filled = lent.clone();
        annotate(&mut filled).expect("annotates");
        filled.without(&lent)
    };
    let made = make();
    assert_eq!(sorted(made.keys()), sorted(provided.to_vec()), "it makes other products than it declares");
    let values = |products: &Products| provided.iter().map(|key| products.value(key).ok()).collect::<Vec<_>>();
    assert_eq!(values(&made), values(&make()), "it gives different products from the same");
    made
}

/// Checks a renderer: it makes exactly the requested products, alone or together, and the same for any number of
/// threads; a window shows the pixels of the image, and listing all bodies by id gives the whole scene.
pub fn renderer(renderer: &dyn Renderer, scene: &Arc<Scene>, request: &RenderRequest, threads: &[&dyn Workers]) {
    let render = |wants: &[KeyId], workers: &dyn Workers, window: Window, bodies: Bodies| {
        let mut session = renderer.open(0).expect("opens");
        session.load(scene, workers).expect("loads");
        let mut products = Products::new();
        let request = RenderRequest::new(request.view, wants, request.stream.clone(), workers);
        session.render(&request.of(window, bodies), &mut products).expect("renders");
        assert_eq!(sorted(products.keys()), sorted(wants.to_vec()), "it makes other products than wanted");
        wants.iter().map(|key| products.value(key).expect("made")).collect::<Vec<_>>()
    };
    let image = Window::of(&request.view.camera.intrinsics);
    let offers = renderer.offers();
    let all = render(&offers, threads[0], image, Bodies::All);
    for &workers in threads {
        let again = render(&offers, workers, image, Bodies::All);
        assert!(again == all, "images differ with {} threads", workers.threads());
    }
    for (key, value) in offers.iter().zip(&all) {
        let alone = render(&[*key], threads[0], image, Bodies::All);
        assert!(&alone[0] == value, "`{}` differs when it is made alone", key);
    }
    let ids: Vec<InstanceId> = scene.bodies().iter().map(|body| body.id).collect();
    for bodies in [Bodies::Only(&ids), Bodies::Seen(&ids)] {
        assert!(render(&offers, threads[0], image, bodies) == all, "all bodies by name are not the whole scene");
    }
    let window = Window { x: image.width as i32 / 3, y: -3, width: image.width, height: image.height };
    // Products that depend on neighboring pixels may differ at the edges of a window.
    let pixels: Vec<KeyId> = keys![RADIANCE, DEPTH, INSTANCE, COVERAGE, COVERAGE_BEFORE_SUPPORT, NORMAL, ALBEDO]
        .into_iter()
        .filter(|key| offers.contains(key))
        .collect();
    let (part, whole) =
        (render(&pixels, threads[0], window, Bodies::All), render(&pixels, threads[0], image, Bodies::All));
    for ((key, part), whole) in pixels.iter().zip(part).zip(whole) {
        for y in 0..window.height as i32 + window.y {
            for x in 0..image.width as i32 - window.x {
                let (x_image, y_image) = ((x + window.x) as usize, y as usize);
                let (part, whole) =
                    (pixel(&part, x as usize, (y - window.y) as usize), pixel(&whole, x_image, y_image));
                assert!(part == whole, "`{}` differs in a window at ({x_image}, {y_image})", key);
            }
        }
    }
}

/// Bytes of a pixel of an image.
fn pixel(value: &Value, x: usize, y: usize) -> &[u8] {
    let Value::Tensor(tensor) = value else { panic!("no image") };
    let size = tensor.bytes.len() / (tensor.shape[0] * tensor.shape[1]);
    &tensor.bytes[(y * tensor.shape[1] + x) * size..][..size]
}

/// Checks a writer: the same samples give the same files, on disk and in memory, all inside its folder, and it reads
/// only the products that it declares. Returns the files of the scene, by path.
pub fn writer(
    writer: &dyn Writer<Scenes>,
    cx: &ViewContext,
    products: &Products,
    folder: &Path,
) -> Vec<(String, Vec<u8>)> {
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    let lent = products.only(&reads);
    let write = |staging: StoreFolder| -> Result<()> {
        let output = Output::new(staging, "test", cx.scene_id);
        let mut scene: Box<dyn SceneWriter<Scenes>> = writer.scene(&cx.of_scene(), output)?;
        scene.view(cx, &lent)?;
        scene.close(&cx.of_scene(), &lent)
    };
    let store = Arc::new(MemStore::default());
    write(Arc::clone(&store).into()).expect("writes");
    let in_memory: Vec<(String, Vec<u8>)> = files_of_store(&store).into_iter().collect();
    let staging = folder.join("first");
    write((&staging).into()).expect("writes");
    let on_disk = if staging.exists() { files(&staging) } else { BTreeMap::new() };
    let first: Vec<(String, Vec<u8>)> = on_disk.into_iter().collect();
    assert!(first == in_memory, "it writes different files from the same samples");
    first
}

fn sorted(keys: Vec<KeyId>) -> Vec<ProductId> {
    let mut ids: Vec<ProductId> = keys.iter().map(KeyId::product_id).collect();
    ids.sort_unstable();
    ids
}
