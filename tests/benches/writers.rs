//! Images per second that a run annotates and writes if rendering costs nothing: 640 × 480, about 20 objects, RGB,
//! depth and COCO.
//!
//! `cargo bench -p syntable-tests --bench writers [-- THREADS]` (2). Frames of the recipe `quickstart` are rendered
//! first. Then a renderer returns them repeatedly, so that a whole run is measured, with annotators, checks, digests,
//! staging and the journal. The cost of a frame by parts is measured on one thread, as the median of repeats. Pillow is
//! measured for comparison, if Python has it.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use syntable_formats::encode::png::{PngImage, Rounding, depth_units};
use syntable_formats::segmentation::Rle;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::standard::{COVERAGE, DEPTH, INSTANCE, RGB, VISIBLE_MASK};
use syntable_model::product::{BitPlane, Mask, Plane};
use syntable_model::registry::{Entry, Registry};
use syntable_model::scene::{Role, Scene};
use syntable_model::stage::{RenderRequest, RenderSession};
use syntable_program as _;
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::RunOptions;
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_testing::figures::{Figures, Unit};
use syntable_testing::scenes;

/// Number of dropped objects; some leave the table.
const DROPPED: u16 = 32;
/// Number of rendered views, and of views that are kept: the views with the most objects.
const RENDERED: u32 = 8;
const FRAMES: usize = 3;
const SCENES: u32 = 4;
const VIEWS: u32 = 100;

/// Products of a rendered view.
#[derive(Clone)]
struct Frame {
    rgb: Plane<[u8; 3]>,
    depth: Plane<f32>,
    instance: Plane<InstanceId>,
    coverage: BitPlane,
    visible: Vec<Mask>,
    objects: usize,
}

static TAKEN: Mutex<Vec<Frame>> = Mutex::new(Vec::new());

fn taken() -> Vec<Frame> {
    TAKEN.lock().expect("no panic").clone()
}

macro_rules! kind {
    ($(#[$doc:meta])* $name:ident, $stage:path, $kind:literal) => {
        $(#[$doc])*
        #[derive(Debug, Default, Clone, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        struct $name {}
        impl Config for $name {
            type Stage = dyn $stage;
            const KIND: &'static str = $kind;
            const EXAMPLE: &'static str = "";
            fn build(self) -> Result<Box<dyn $stage>, ConfigError> {
                Ok(Box::new(self))
            }
        }
    };
}

kind!(/** Keeps the frames of a run. */ Keep, Writer<Scenes>, "keep");
kind!(/** Gives kept frames again. */ Replay, Renderer, "replay");
kind!(/** As many boxes as there are objects in the frames. */ Boxes, Placer, "bench_boxes");

impl Writer<Scenes> for Keep {
    fn reads(&self) -> Vec<Input> {
        vec![Input::of(RGB), Input::of(DEPTH), Input::of(INSTANCE), Input::of(COVERAGE), Input::of(VISIBLE_MASK)]
    }
    fn scene(&self, _: &SceneContext, _: Output) -> Result<Box<dyn SceneWriter<Scenes>>> {
        Ok(Box::new(self.clone()))
    }
}

impl SceneWriter<Scenes> for Keep {
    fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()> {
        TAKEN.lock().expect("no panic").push(Frame {
            rgb: products.get(RGB)?.clone(),
            depth: products.get(DEPTH)?.clone(),
            instance: products.get(INSTANCE)?.clone(),
            coverage: products.get(COVERAGE)?.clone(),
            objects: cx.scene.objects().len(),
            visible: products.get(VISIBLE_MASK)?.iter().map(|(_, mask)| mask.clone()).collect(),
        });
        Ok(())
    }
    fn close(self: Box<Self>, _: &SceneContext, _: &Products) -> Result<()> {
        Ok(())
    }
}

impl Placer for Boxes {
    fn place(&self, scene: &mut SceneBuilder, _: &Context) -> Result<()> {
        scenes::add_table(scene);
        let cube = scenes::object("cube", scenes::box_mesh([0.01; 3]), [0.5; 3]);
        for i in 0..taken()[0].objects {
            scene.add(scenes::body(cube.clone(), [0.03 * i as f64, 0.0, 0.005], Role::Object));
        }
        Ok(())
    }
}

impl Renderer for Replay {
    fn offers(&self) -> Vec<KeyId> {
        keys![RGB, DEPTH, INSTANCE, COVERAGE]
    }
    fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(Player(taken())))
    }
    fn cost(&self) -> String {
        "nothing".into()
    }
}

struct Player(Vec<Frame>);

impl RenderSession for Player {
    fn load(&mut self, _: &Arc<Scene>, _: &dyn Workers) -> Result<()> {
        Ok(())
    }
    fn render(&mut self, request: &RenderRequest, products: &mut Products) -> Result<()> {
        let frame = &self.0[request.view.id.0 as usize % self.0.len()];
        for key in request.wants {
            match key {
                key if *key == RGB.id() => products.put(RGB, frame.rgb.clone())?,
                key if *key == DEPTH.id() => products.put(DEPTH, frame.depth.clone())?,
                key if *key == INSTANCE.id() => products.put(INSTANCE, frame.instance.clone())?,
                _ => products.put(COVERAGE, frame.coverage.clone())?,
            }
        }
        Ok(())
    }
}

/// The rendered recipe, with many objects.
fn rendered() -> String {
    format!(
        "extends = \"builtin:quickstart\"\nremove = [\"write.syntable\", \"write.contact_sheet\"]\n\
         [dataset]\nname = \"frames\"\nscenes = 1\nviews_per_scene = {RENDERED}\n\
         [write.keep]\n[set]\n\"place.objects.count\" = {DROPPED}\n"
    )
}

/// The measured recipe.
fn measured(writers: &str) -> String {
    format!(
        "[dataset]\nname = \"written\"\nscenes = {SCENES}\nviews_per_scene = {VIEWS}\n\
         [[place]]\nkind = \"bench_boxes\"\n[settle]\nkind = \"none\"\n\
         [camera]\nkind = \"pinhole\"\nresolution = [640, 480]\n[[lights]]\nkind = \"sphere_lights\"\n\
         [render]\nkind = \"replay\"\n{writers}"
    )
}

/// Prints only the errors of failed attempts.
struct Failures;

impl Reporter for Failures {
    fn event(&self, event: &Event) {
        if let Event::Attempt { error, .. } = event {
            eprintln!("{error}");
        }
    }
}

/// Runs a recipe. Returns the seconds.
fn run(recipe: &str, threads: usize, out: &Path) -> f64 {
    let linked = Registry::linked().expect("no clash");
    let own = [Entry::of::<Keep>("bench", "0"), Entry::of::<Replay>("bench", "0"), Entry::of::<Boxes>("bench", "0")];
    let registry = Registry::new(linked.entries().iter().cloned().chain(own)).expect("no clash");
    let (recipe, _) =
        syntable_recipe::load(&registry, Source::embedded("bench.toml", recipe), &Overrides::of_process(Vec::new()))
            .unwrap_or_else(|report| panic!("{report}"));
    let options = RunOptions::new(out, threads, DiskCache::new(out.join("../cache")));
    let start = Instant::now();
    let outcome = syntable_runtime::run::run(&recipe, &options, &Failures).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(outcome.failed, 0, "scenes failed");
    start.elapsed().as_secs_f64()
}

/// Median of the times of a call on all frames, ms.
fn ms<T>(frames: &[Frame], mut call: impl FnMut(&Frame) -> T) -> f64 {
    let mut times: Vec<f64> = Vec::new();
    for _ in 0..15 {
        for frame in frames {
            let start = Instant::now();
            black_box(call(frame));
            times.push(1e3 * start.elapsed().as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn depth_image(frame: &Frame) -> PngImage {
    PngImage::gray16(&frame.depth.map(|&depth| depth_units(depth, 1.0, Rounding::Nearest)))
}

/// Number of the files in a folder, and of their bytes.
fn files(folder: &Path) -> (u64, u64) {
    let (mut number, mut bytes) = (0, 0);
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let metadata = entry.metadata().expect("there");
        let (n, b) = if metadata.is_dir() { files(&entry.path()) } else { (1, metadata.len()) };
        (number, bytes) = (number + n, bytes + b);
    }
    (number, bytes)
}

/// Pillow, levels 1 and 6: ms and bytes for the given PNG files and bytes.
const PILLOW: &str = r#"
import io, sys, time
from PIL import Image
for path in sys.argv[1:]:
    image = Image.open(path)
    image.load()
    for level in (1, 6):
        times = []
        for _ in range(5):
            file = io.BytesIO()
            start = time.perf_counter()
            image.save(file, "png", compress_level=level)
            times.append(time.perf_counter() - start)
        print(f"  {path.rsplit('/')[-1]:<12} Pillow {image.mode}, level {level}: {1e3 * min(times):6.2f} ms, {len(file.getvalue()):7} bytes")
"#;

fn main() {
    let threads = std::env::args().skip(1).find_map(|word| word.parse().ok()).unwrap_or(2);
    let folder = tempfile::tempdir().expect("a folder");
    run(&rendered(), 2, &folder.path().join("frames"));
    {
        let mut frames = TAKEN.lock().expect("no panic");
        frames.sort_by_key(|frame| std::cmp::Reverse(frame.visible.len()));
        frames.truncate(FRAMES);
    }
    let frames = taken();

    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    println!("a whole run of {} images, {threads} threads:", SCENES * VIEWS);
    for (name, writers) in [
        ("COCO with its RGB", "[write.coco]\n"),
        ("depth alone", "[write.png]\ninclude = [\"depth\"]\n"),
        ("COCO with RGB, depth", "[write.coco]\n[write.png]\ninclude = [\"depth\"]\n"),
    ] {
        let out = folder.path().join(name);
        let seconds = run(&measured(writers), threads, &out);
        let images = f64::from(SCENES * VIEWS);
        let (number, bytes) = files(&out);
        figures.keep(name, images / seconds, Unit::PerSecond);
        println!(
            "  {name:<22} {:6.1} images/s, {:6.2} ms an image, {:.1} files and {:.0} kB an image",
            images / seconds,
            1e3 * seconds / images,
            number as f64 / images,
            bytes as f64 / 1e3 / images
        );
    }

    println!("parts, ms an image, one thread:");
    let size = |image: &dyn Fn(&Frame) -> PngImage| {
        let sum: usize = frames.iter().map(|frame| image(frame).encode().expect("encodes").len()).sum();
        sum / frames.len()
    };
    let rgb = |frame: &Frame| PngImage::rgb(&frame.rgb);
    let (rgb_ms, depth_ms) =
        (ms(&frames, |frame| rgb(frame).encode()), ms(&frames, |frame| depth_image(frame).encode()));
    println!("  PNG of RGB             {rgb_ms:6.2}, {} bytes", size(&rgb));
    println!("  PNG of depth           {depth_ms:6.2}, {} bytes", size(&depth_image));
    println!("  depth to millimeters   {:6.2}", ms(&frames, depth_image));
    let encode = |frame: &Frame| frame.visible.iter().map(Rle::encode).map(|rle| rle.counts.len()).sum::<usize>();
    println!(
        "  {:2} masks to RLE       {:6.2}, {} bytes",
        frames[0].visible.len(),
        ms(&frames, encode),
        encode(&frames[0])
    );
    let bytes = rgb(&frames[0]).encode().expect("encodes");
    let mut number = 0;
    let write = |_: &Frame| {
        number += 1;
        std::fs::write(folder.path().join(format!("{number}.bin")), &bytes).expect("written");
    };
    println!("  a file of RGB written  {:6.2}", ms(&frames, write));

    let paths = ["rgb.png", "depth.png"].map(|name| folder.path().join(name));
    std::fs::write(&paths[0], &bytes).expect("written");
    std::fs::write(&paths[1], depth_image(&frames[0]).encode().expect("encodes")).expect("written");
    let pillow = Command::new("python3").args(["-c", PILLOW]).args(&paths).output();
    match pillow {
        Ok(output) if output.status.success() => print!("{}", String::from_utf8_lossy(&output.stdout)),
        _ => println!("  (no Pillow to compare with)"),
    }
}
