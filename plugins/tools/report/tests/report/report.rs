//! Reports of datasets in memory: names that contain markup, paths that lead out, unreadable images, and reproducible
//! bytes.

use std::collections::BTreeMap;
use syntable_formats::read::{self, ObjectLabels};
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::{DEPTH, OBJECT_NAME, RGB};
use syntable_model::product::{KeyId, Mask, Plane, Products};
use syntable_model::reader::{ImageRef, ImageSource, OpenDataset, Opened, ReadImage, Source};
use syntable_model::registry::Registry;
use syntable_model::scene::{InstanceId, SceneId, ViewId};
use syntable_model::stage::DatasetInfo;
use syntable_report::report::make::{MADE_BY, write};
use syntable_report::report::{DatasetReport, ReportSelection, StatisticsProgress};
use syntable_report::serve::Request;
use syntable_report::stats::{self, StatisticsOptions};
use syntable_report::view::answer;
use syntable_runtime::durable::Draft;
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_runtime::workers::Pool;
use syntable_testing::folder::files;

/// A name that would run as a script if a page did not escape it.
const MARKUP: &str = "<script>alert('1')</script>\"&";
const SIZE: [u32; 2] = [12, 8];

/// Images of two objects: the first hides the left half of the second.
struct MemoryReader {
    info: DatasetInfo,
    images: Vec<ImageRef>,
    /// An image with unreadable color.
    broken: Option<usize>,
    /// Whether a third object is fully hidden.
    has_hidden: bool,
}

impl MemoryReader {
    fn new(images: u32) -> Self {
        let image = |number: u32| ImageRef {
            scene: SceneId(number / 4),
            view: ViewId(number % 4),
            name: format!("{MARKUP}{number}.png"),
            id: None,
        };
        let info = read::Categories::named([MARKUP.to_owned()]).info(MARKUP.into(), MARKUP.into(), &[], String::new());
        Self { info, images: (0..images).map(image).collect(), broken: None, has_hidden: false }
    }

    fn open(self) -> OpenDataset {
        let mut offers = read::KnownMasks::Both.offers();
        offers.extend([RGB.id(), DEPTH.id(), OBJECT_NAME.id()]);
        let opened = || Ok(Opened::new(self.info.clone(), self.images.clone(), offers, self));
        OpenDataset::open("memory", &Source::new("memory"), opened).expect("opens")
    }
}

fn mask(columns: std::ops::Range<u32>) -> Mask {
    Mask::from_fn(SIZE[0], SIZE[1], |x, y| columns.contains(&x) && (2..6).contains(&y))
}

impl ImageSource for MemoryReader {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let labels = |id: u16, visible: Mask, amodal: Mask| ObjectLabels {
            id: InstanceId(id),
            visible,
            amodal: Some(amodal),
            occlusion: None,
            rate: None,
            visible_box: None,
            amodal_box: None,
            category: 2,
        };
        let mut labels = vec![
            labels(1, mask(1..5), mask(1..5)),
            labels(2, mask(5..9), mask(1..9)),
            labels(3, Mask::empty(SIZE[0], SIZE[1]), mask(2..4)),
        ];
        labels.truncate(2 + usize::from(self.has_hidden));
        let mut products = Products::new();
        read::put(&labels, None, wants, &mut products)?;
        if wants.contains(&RGB.id()) {
            if self.broken == Some(image) {
                return Err(Error::new("the file is not there"));
            }
            products.put(RGB, Plane::from_fn(SIZE[0], SIZE[1], |x, y| [image as u8, 20 * x as u8, 30 * y as u8]))?;
        }
        if wants.contains(&DEPTH.id()) {
            products.put(DEPTH, Plane::from_fn(SIZE[0], SIZE[1], |x, _| 1.0 + x as f32))?;
        }
        if wants.contains(&OBJECT_NAME.id()) {
            let names = labels.iter().map(|it| (it.id, MARKUP.to_owned()));
            products.put(OBJECT_NAME, names.collect())?;
        }
        Ok(ReadImage::new(SIZE, products))
    }
}

fn report(memory: MemoryReader, shown: Vec<usize>) -> DatasetReport {
    let (pool, dataset) = (Pool::new(2).expect("threads"), memory.open());
    let counted = match stats::of(
        &dataset,
        &StatisticsOptions::default(),
        &ImageWork { workers: &pool, reporter: &Quiet, stop: &Stop::default() },
    ) {
        Ok(statistics) => StatisticsProgress::Done(Box::new(statistics)),
        Err(error) => StatisticsProgress::Failed(error.to_string()),
    };
    let source = Source::new("nowhere/a <b> dataset");
    let report = DatasetReport::of(&Registry::default(), dataset, "memory", &source, |_| ReportSelection {
        images: shown,
        scenes: None,
    });
    let report = report.unwrap_or_else(|error| panic!("{error}"));
    report.put_statistics(counted);
    report
}

fn written(report: &DatasetReport, threads: usize) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let (pool, out) = (Pool::new(threads).expect("threads"), folder.path().join("out"));
    let draft = Draft::begin(&out).expect("a folder");
    let written = write(report, &draft, &ImageWork { workers: &pool, reporter: &Quiet, stop: &Stop::default() })
        .and_then(|()| draft.publish_listed(MADE_BY));
    written.unwrap_or_else(|error| panic!("{error}"));
    files(&out)
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("text")
}

#[test]
fn names_are_never_markup() {
    let all = written(&report(MemoryReader::new(5), (0..5).collect()), 2);
    let pages: Vec<&String> = all.keys().filter(|path| path.ends_with(".html")).collect();
    assert_eq!(pages.len(), 4, "{pages:?}");
    for (path, bytes) in all.iter().filter(|(path, _)| path.ends_with(".html")) {
        let page = text(bytes);
        assert!(!page.contains("<script>alert"), "{path}");
        // The page contains only scripts of the report.
        for script in page.split("<script").skip(1) {
            assert!(script.starts_with(" src=\"page/"), "{path}: {script:.60}");
        }
        // The policy blocks inline scripts and scripts of other hosts.
        let policy = page.split("http-equiv=\"Content-Security-Policy\" content=\"").nth(1).expect("a policy");
        let policy = policy.split('"').next().unwrap_or_default();
        assert!(policy.starts_with("default-src &#x27;none&#x27;; script-src &#x27;self&#x27; file:;"), "{policy}");
        assert!(!policy.contains("unsafe") && !page.contains(" style=") && !page.contains(" onclick="), "{path}");
        assert!(page.contains("&lt;script&gt;alert"), "{path} does not name the dataset");
    }
}

#[test]
fn the_report_does_not_depend_on_threads_or_time() {
    let once = |threads| written(&report(MemoryReader::new(70), (0..70).collect()), threads);
    let (a, b) = (once(1), once(3));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (path, bytes) in &a {
        assert!(bytes == &b[path], "{path} differs");
    }
    // 70 images are two pages of the gallery.
    assert!(a.contains_key("data/rows/1.js") && !a.contains_key("data/rows/2.js"), "{:?}", a.keys());
}

#[test]
fn what_is_written_is_what_is_served() {
    let shown = vec![0, 2, 5];
    let of_folder = written(&report(MemoryReader::new(8), shown.clone()), 2);
    let served = report(MemoryReader::new(8), shown);
    let page = text(&of_folder["index.html"]);
    // Pages in a folder have its edition in addresses, and are otherwise the same.
    let edition = page.split("style.css?").nth(1).and_then(|rest| rest.split('"').next()).expect("an edition");
    assert!(edition.len() == 12 && edition.bytes().all(|byte| byte.is_ascii_hexdigit()), "{edition}");
    for (path, bytes) in of_folder.iter().filter(|(path, _)| !path.starts_with('.') && *path != "index.html") {
        let file = served.file(path).expect("readable").expect("there");
        match path.ends_with(".html") {
            true => {
                let page = text(bytes).replace(&format!("?{edition}"), "").replace(edition, "");
                assert_eq!(text(&file), page, "{path}");
            }
            false => assert!(file == *bytes, "{path} is served differently"),
        }
    }
    // A change of one image changes the address of every file.
    let other = written(&report(MemoryReader { broken: Some(0), ..MemoryReader::new(8) }, vec![0, 2, 5]), 2);
    assert!(!text(&other["gallery.html"]).contains(edition));
    assert!(page.contains("3 of 8 views are in this report"), "{page}");
}

/// The order, the layers and the rates of a scene that was solved by hand.
#[test]
fn an_image_has_its_masks_and_its_graph() {
    let report = report(MemoryReader::new(1), vec![0]);
    let file = report.file("data/view/000/000000.js").expect("readable").expect("there");
    let json = text(&file).trim_start_matches("syntable.put(\"view/000/000000\", ").trim_end_matches(");\n");
    let view: serde_json::Value = serde_json::from_str(json).expect("JSON");
    assert_eq!(view["graph"]["edges"], serde_json::json!([[1, 2]]));
    assert_eq!(view["graph"]["depth_layers"], serde_json::json!([[1], [2]]));
    assert_eq!(view["depth_m"], serde_json::json!([1.0, 12.0]));
    let object = &view["objects"][1];
    assert_eq!((&object["layer"], object["rate"].as_f64()), (&"bottom".into(), Some(0.5)));
    let hidden = Mask::from_coco(SIZE[0], SIZE[1], object["hidden"].as_str().expect("a mask")).expect("run lengths");
    assert_eq!(hidden, mask(1..5));
    assert_eq!(object["visible_box"], serde_json::json!([5, 2, 4, 4]));
    assert_eq!(view["objects"][0].get("hidden"), None);
}

/// The gallery counts visible objects, like the statistics.
#[test]
fn hidden_objects_are_told_from_those_that_are_seen() {
    let memory = || MemoryReader { has_hidden: true, ..MemoryReader::new(1) };
    let pool = Pool::new(1).expect("threads");
    let counted = stats::of(
        &memory().open(),
        &StatisticsOptions::default(),
        &ImageWork { workers: &pool, reporter: &Quiet, stop: &Stop::default() },
    )
    .expect("counted");
    let report = report(memory(), vec![0]);
    let value = |path: &str, key: &str| -> serde_json::Value {
        let file = report.file(path).expect("readable").expect("there");
        let json = text(&file).trim_start_matches(&format!("syntable.put(\"{key}\", ")).trim_end_matches(");\n");
        serde_json::from_str(json).expect("JSON")
    };
    let rows = value("data/rows/0.js", "rows/0");
    assert_eq!(rows[0]["objects"].as_u64(), counted.totals.visible_instances);
    assert_eq!((rows[0]["objects"].as_u64(), counted.totals.hidden_instances), (Some(2), 1));
    let view = value("data/view/000/000000.js", "view/000/000000");
    let hidden: Vec<bool> =
        view["objects"].as_array().expect("objects").iter().map(|it| it["is_hidden"] == true).collect();
    assert_eq!(hidden, [false, false, true]);
    assert_eq!((view["objects"][2].get("visible"), view["objects"][2]["amodal"].is_string()), (None, true));
}

#[test]
fn no_path_leads_out() {
    let report = report(MemoryReader::new(3), vec![0, 1]);
    let status = |path: &str| answer(&report, &Request { path: path.to_owned(), query: Vec::new() }).status();
    for path in
        ["/", "/index.html", "/data/rows/0.js", "/image/000/000001.jpg", "/depth/000/000000.jpg", "/page/view.js"]
    {
        assert_eq!(status(path), 200, "{path}");
    }
    let wrong = [
        "/../Cargo.toml",
        "/page/../Cargo.toml",
        "/page/base.html",
        "/base.html",
        "/etc/passwd",
        "//etc/passwd",
        "/image/../image/000/000001.jpg",
        "/image/001/000001.jpg",
        "/image/000/1.jpg",
        "/image/000/000002.jpg",
        "/image/000/000001.png",
        "/data/rows/1.js",
        "/data/rows/00.js",
        "/data/rows/99999999999999999999.js",
        "/data/rows/18446744073709551615.js",
        "/data/view/000/-00001.js",
        "/data/scene/000000.js",
    ];
    for path in wrong {
        assert_eq!(status(path), 404, "{path}");
    }
}

#[test]
fn what_cannot_be_read_is_named_and_the_rest_is_shown() {
    let report = report(MemoryReader { broken: Some(1), ..MemoryReader::new(3) }, vec![0, 1, 2]);
    let all = written(&report, 2);
    let unread = report.unread();
    assert!(unread.len() == 1 && unread[0].contains("1.png\": the file is not there"), "{unread:?}");
    assert!(!all.contains_key("image/000/000001.jpg") && all.contains_key("image/000/000002.jpg"));
    let view = text(&all["data/view/000/000001.js"]);
    assert!(view.contains("the file is not there") && view.contains("\"edges\":[[1,2]]"), "{view}");
    let page = text(&all["index.html"]);
    assert!(page.contains("readable") && page.contains("1 of 3 images lack something here"), "{page}");
    let table = page.split("id=\"unread\"").nth(1).and_then(|rest| rest.split("</table>").next()).expect("a table");
    assert!(table.contains("view.html#i=1") && table.contains("the file is not there"), "{table}");
}

#[test]
fn a_dataset_without_an_image_has_no_report() {
    let report =
        DatasetReport::of(&Registry::default(), MemoryReader::new(0).open(), "memory", &Source::new("x"), |_| {
            ReportSelection { images: Vec::new(), scenes: None }
        });
    assert!(report.err().is_some_and(|error| error.to_string().contains("no image")));
}
