//! `syntable report` and `syntable view`, tested in a browser.

use crate::support::browser::{address, job, look};
use crate::support::served::Address;
use crate::support::{fails, files, ok, root, syntable};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::OnceLock;

/// Waits in a page until an expression is true.
const WAIT: &str = "const wait = async (is) => { for (let i = 0; i < 400; i++) { if (is()) return; \
     await new Promise((done) => setTimeout(done, 50)); } throw new Error(`not: ${is}`); };";

/// A dataset of two scenes with two views each, and glTF files. Tests only read it.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<PathBuf> = OnceLock::new();
    DATASET.get_or_init(|| {
        let folder = root().join("target/test-report");
        let _ = fs::remove_dir_all(&folder);
        let data = folder.join("data");
        let sets = [
            "dataset.scenes=2",
            "dataset.views_per_scene=2",
            "camera.resolution=[160,120]",
            "render.samples_per_pixel=1",
            "write.gltf.per=\"scene\"",
        ];
        let mut run = syntable();
        run.args(["run", "recipes/quickstart.toml", "--out"]).arg(&data);
        ok(run.args(sets.iter().flat_map(|set| ["--set", set])));
        data
    })
}

/// The report of the dataset.
fn report() -> &'static Path {
    static REPORT: OnceLock<PathBuf> = OnceLock::new();
    REPORT.get_or_init(|| {
        let said = ok(syntable().arg("report").arg(dataset()));
        assert!(said.contains("4 of 4 images") && said.contains("2 scenes in 3-D"), "{said}");
        dataset().with_file_name("data-report")
    })
}

fn page(name: &str) -> String {
    address(&report().join(name))
}

#[test]
fn the_report_lies_beside_the_dataset_and_is_the_same_again() {
    let (before, first) = (files(dataset()), files(report()));
    let verified = ok(syntable().arg("verify").arg(dataset()));
    assert!(!verified.contains("report"), "{verified}");
    let again = report().with_file_name("again");
    let _ = fs::remove_dir_all(&again);
    ok(syntable().arg("report").arg(dataset()).arg("--out").arg(&again).args(["--threads", "1"]));
    let second = files(&again);
    assert!(first.keys().eq(second.keys()) && first.iter().all(|(path, bytes)| second[path] == *bytes));
    assert!(before == files(dataset()), "the dataset has changed");
    // A report is replaced only on request, and other folders never are.
    let said = fails(syntable().arg("report").arg(dataset()).arg("--out").arg(&again), 2);
    assert!(said.contains("the folder has a report") && said.contains("--overwrite"), "{said}");
    ok(syntable().arg("report").arg(dataset()).arg("--out").arg(&again).args(["--overwrite", "--images", "1"]));
    assert!(again.join("image/000/000000.jpg").is_file() && !again.join("image/000/000001.jpg").exists());
    let said = fails(syntable().arg("report").arg(dataset()).arg("--out").arg(dataset()).arg("--overwrite"), 2);
    assert!(said.contains("which a new report would replace") && before == files(dataset()), "{said}");
}

#[test]
fn the_overview_says_what_the_run_says() {
    let text = fs::read_to_string(report().join("index.html")).expect("a page");
    for part in
        ["quickstart", "cpu_path, 1 samples per pixel", "160 × 120 px", "CC0-1.0", "write.syntable", "household"]
    {
        assert!(text.contains(part), "{part} is not in the overview");
    }
    // Materials are in no label; their license comes from the kind of their source.
    assert!(!text.contains("<summary>not recorded"), "an embedded asset has no license");
    let script = format!(
        "{WAIT} await wait(() => document.querySelectorAll('.plot').length > 4);
         return [...document.querySelectorAll('.cells > div')].map((it) => [it.querySelector('dt').textContent, it.querySelector('dd').textContent]);"
    );
    let Some(found) = look(&[job(&page("index.html"), &script)]) else { return };
    let said =
        |name: &str| found[0].as_array().expect("cells").iter().find(|it| it[0] == name).expect("a cell")[1].clone();
    assert_eq!((said("Images"), said("Scenes")), (json!("4"), json!("2")));
    let rows = ok(syntable().args(["stats", "--json", "--labels-only"]).arg(dataset()));
    let stats: Value = serde_json::from_str(&rows).expect("JSON");
    let instances = stats.pointer("/datasets/0/totals/visible_instances").expect("a count");
    assert_eq!(said("Visible instances"), json!(instances.to_string()), "{stats:#}");
}

#[test]
fn a_click_changes_the_overlay_and_leads_from_graph_to_mask_and_back() {
    let gallery = format!(
        "{WAIT} await wait(() => document.querySelectorAll('#grid a').length === 4);
         const paths = () => document.querySelectorAll('#grid path').length, before = paths();
         document.querySelector('[data-switch=visible]').click();
         await wait(() => paths() > 0);
         document.querySelector('#grid a').focus();
         document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{ key: 'ArrowRight', bubbles: true }}));
         return [before, location.hash, document.activeElement.dataset.place];"
    );
    let view = format!(
        "{WAIT} const by = (id) => document.getElementById(id);
         await wait(() => by('frame').dataset.ready === '0');
         const before = by('labels').querySelectorAll('.fill').length;
         document.querySelector('[data-switch=amodal]').click();
         const amodal = by('labels').querySelectorAll('.fill.amodal').length;
         const node = by('graph').querySelector('.node'), id = node.dataset.id;
         node.dispatchEvent(new MouseEvent('click', {{ bubbles: true }}));
         const chosen = by('labels').querySelector('.chosen')?.getAttribute('d');
         const own = by('labels').querySelector(`.hit[data-id='${{id}}']`)?.getAttribute('d');
         const other = [...by('labels').querySelectorAll('.hit')].find((it) => it.dataset.id !== id);
         other.dispatchEvent(new MouseEvent('click', {{ bubbles: true }}));
         const pressed = [...by('graph').querySelectorAll('[aria-pressed=true]')].map((it) => it.dataset.id);
         document.querySelector('[name=base][value=depth]').click();
         await wait(() => by('image').complete && by('image').naturalWidth === 160);
         const objects = by('objects').rows.length, nodes = by('graph').querySelectorAll('.node').length;
         return {{ before, amodal, chosen: [...by('labels').querySelectorAll('.chosen')].length > 0 && chosen.length > 0,
             own, id, other: other.dataset.id, pressed, source: by('image').getAttribute('src'), objects, nodes,
             legend: by('legend').hidden }};"
    );
    let Some(found) = look(&[job(&page("gallery.html"), &gallery), job(&page("view.html"), &view)]) else { return };
    assert_eq!(found[0], json!([0, "#on=visible", "1"]));
    let seen = &found[1];
    assert_eq!(seen["before"], 0);
    assert_eq!((&seen["amodal"], &seen["nodes"]), (&seen["objects"], &seen["objects"]), "{seen}");
    assert!(seen["objects"].as_u64() > Some(5) && seen["chosen"] == true, "{seen}");
    assert_eq!(seen["pressed"], json!([seen["other"]]), "{seen}");
    assert!(seen["source"].as_str().is_some_and(|it| it.starts_with("depth/000/000000.jpg?")), "{seen}");
    assert_eq!(seen["legend"], false);
}

/// The images that the gallery selects, compared with a search of the annotation file.
#[test]
fn conditions_and_order_select_what_a_search_of_the_records_selects() {
    let all = annotations(dataset());
    let images = all["images"].as_array().expect("a list");
    let of = |image: &Value| -> Vec<Value> {
        let own = all["annotations"].as_array().expect("a list").iter();
        own.filter(|it| it["image_id"] == image["id"]).cloned().collect()
    };
    let number = |object: &Value, key: &str| object[key].as_f64().expect("a number");
    let places = |meets: &dyn Fn(&[Value]) -> bool| -> Vec<usize> {
        (0..images.len()).filter(|place| meets(&of(&images[*place]))).collect()
    };
    let sorted = |value: &dyn Fn(&[Value]) -> f64, descending: bool| {
        let mut places: Vec<(f64, usize)> =
            (0..images.len()).map(|place| (value(&of(&images[place])), place)).collect();
        places.sort_by(|a, b| if descending { b.0.total_cmp(&a.0) } else { a.0.total_cmp(&b.0) }.then(a.1.cmp(&b.1)));
        places.into_iter().map(|(_, place)| place).collect::<Vec<_>>()
    };
    let most = |objects: &[Value]| objects.iter().map(|it| number(it, "occluded_rate")).fold(0.0, f64::max);
    let smallest = |objects: &[Value]| objects.iter().map(|it| number(it, "area")).fold(f64::INFINITY, f64::min);
    // The name of an object of the first image that not all images have.
    let name = |object: &Value| object["object_name"].as_str().expect("a name").to_owned();
    let rare = of(&images[0])
        .iter()
        .map(name)
        .find(|it| !places(&|all| all.iter().all(|other| name(other) != *it)).is_empty());
    let rare = rare.expect("a name");
    let median = sorted(&most, true)[1];
    let rate = (100.0 * most(&of(&images[median]))).floor();
    let count = of(&images[0]).len();
    let cases = [
        (format!("q={rare}"), places(&|all| all.iter().any(|it| name(it) == rare))),
        (format!("hidden={rate}-"), places(&|all| 100.0 * most(all) >= rate)),
        // One object must meet both conditions.
        (
            format!("hidden={rate}-&size=-60"),
            places(&|all| {
                all.iter().any(|it| 100.0 * number(it, "occluded_rate") >= rate && number(it, "area") <= 60.0)
            }),
        ),
        (format!("objects={count}-{count}"), places(&|all| all.len() == count)),
        ("sort=occlusion".to_owned(), sorted(&most, true)),
        ("sort=smallest&up=1".to_owned(), sorted(&smallest, false)),
        ("objects=1000-".to_owned(), Vec::new()),
    ];
    let script = format!(
        "{WAIT} const grid = document.getElementById('grid'); await wait(() => grid.dataset.all !== undefined);
         return [...grid.querySelectorAll('a')].map((it) => Number(it.dataset.place));"
    );
    let mut jobs: Vec<Value> =
        cases.iter().map(|(state, _)| job(&page(&format!("gallery.html#{state}")), &script)).collect();
    // The typed text becomes part of the address, and of the links to images.
    jobs.push(job(
        &page("gallery.html"),
        &format!(
            "{WAIT} const grid = document.getElementById('grid'); await wait(() => grid.dataset.all === '4');
             const field = document.querySelector('[name=q]');
             field.value = '{rare}';
             field.dispatchEvent(new Event('input', {{ bubbles: true }}));
             await wait(() => location.hash !== '' && document.getElementById('which').textContent.includes('of 4'));
             const link = grid.querySelector('a');
             link.addEventListener('click', (event) => event.preventDefault());
             link.click();
             return [location.hash, link.getAttribute('href').split('#')[1].includes('q={rare}')];"
        ),
    ));
    let Some(mut found) = look(&jobs) else { return };
    let typed = found.pop().expect("the last job");
    assert_eq!(typed, json!([format!("#q={rare}"), true]));
    for ((state, places), found) in cases.iter().zip(found) {
        assert_eq!(found, json!(places), "{state}");
    }
}

#[test]
fn keys_work_at_once_and_masks_are_downloaded_as_they_are() {
    let press = "const press = (key, more = {}) => document.body.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true, ...more }));";
    let gallery = format!(
        "{WAIT} {press} await wait(() => document.querySelectorAll('#grid a').length === 4);
         const at = () => document.activeElement.dataset.place ?? null, seen = [at()];
         for (const key of ['ArrowRight', 'End', 'Home', 'PageDown', 'Escape']) {{ press(key); seen.push(at()); }}
         return seen;"
    );
    let view = format!(
        "{WAIT} {press} const by = (id) => document.getElementById(id);
         const at = async (place) => {{ await wait(() => by('frame').dataset.ready === place); return place; }};
         const seen = [await at('0')];
         for (const [key, place] of [['ArrowRight', '1'], ['End', '3'], ['ArrowLeft', '2'], ['Home', '0'], ['PageDown', '3'], ['PageUp', '0']]) {{
             press(key);
             seen.push(await at(place));
         }}
         // Zoom keeps the point below the pointer, and labels lie on the image.
         const box = () => by('image').getBoundingClientRect(), frame = by('frame').getBoundingClientRect();
         const before = (frame.left + 40 - box().left) / box().width;
         by('frame').dispatchEvent(new WheelEvent('wheel', {{ deltaY: -600, clientX: frame.left + 40, clientY: frame.top + 30, bubbles: true, cancelable: true }}));
         const after = (frame.left + 40 - box().left) / box().width, labels = by('labels').getBoundingClientRect();
         const zoomed = [box().width / frame.width > 2, Math.abs(before - after) < 0.01, Math.abs(labels.width - box().width) < 1];
         by('frame').dispatchEvent(new MouseEvent('dblclick', {{ bubbles: true, cancelable: true }}));
         zoomed.push(Math.abs(box().width - frame.width) < 1);
         let blob = null, name = null;
         URL.createObjectURL = (it) => {{ blob = it; return '#'; }};
         HTMLAnchorElement.prototype.click = function () {{ name = this.download; }};
         const saved = async (act) => {{
             blob = null;
             act();
             await wait(() => blob !== null);
             const bytes = new Uint8Array(await blob.arrayBuffer());
             return [name, btoa(String.fromCharCode(...bytes))];
         }};
         const button = by('objects').rows[1].querySelector('button');
         button.click();
         const id = Number(by('objects').rows[1].dataset.id);
         const visible = await saved(() => by('save-visible').click()), amodal = await saved(() => by('save-amodal').click());
         press('Escape');
         // Without a highlight, a key takes the object below the pointer.
         by('labels').querySelector(`.hit[data-id='${{id}}']`).dispatchEvent(new PointerEvent('pointerenter'));
         const pointed = await saved(() => press('M', {{ shiftKey: true }}));
         return {{ seen, zoomed, id, visible, amodal, pointed }};"
    );
    let Some(found) = look(&[job(&page("gallery.html"), &gallery), job(&page("view.html"), &view)]) else { return };
    assert_eq!(found[0], json!([null, "0", "3", "0", "3", null]));
    let seen = &found[1];
    assert_eq!(seen["seen"], json!(["0", "1", "3", "2", "0", "3", "0"]));
    assert_eq!(seen["zoomed"], json!([true, true, true, true]));
    let all = annotations(dataset());
    let own = |it: &&Value| it["image_id"] == all["images"][0]["id"] && it["instance_id"] == seen["id"];
    let object = all["annotations"].as_array().expect("a list").iter().find(own).expect("the object");
    for (saved, key, name) in [
        ("visible", "visible_mask", "visible"),
        ("amodal", "segmentation", "amodal"),
        ("pointed", "segmentation", "amodal"),
    ] {
        let text = object[key]["counts"].as_str().expect("run lengths");
        let mask = syntable_model::product::Mask::from_coco(160, 120, text).expect("a mask").to_plane();
        assert!(
            seen[saved][0].as_str().is_some_and(|it| it.ends_with(&format!("_{}_{name}.png", seen["id"]))),
            "{seen}"
        );
        let bytes = base64_bytes(seen[saved][1].as_str().expect("a file"));
        let image = image::load_from_memory(&bytes).expect("PNG");
        assert_eq!(image.color(), image::ColorType::L8);
        let image = image.to_luma8();
        assert_eq!(image.dimensions(), (160, 120));
        assert!(
            image.enumerate_pixels().all(|(x, y, pixel)| pixel.0[0] == if *mask.at(x, y) { 255 } else { 0 }),
            "{saved}"
        );
    }
}

/// Bytes of a text in base64 (RFC 4648).
fn base64_bytes(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let values = text.bytes().filter_map(|letter| LETTERS.iter().position(|other| *other == letter));
    let (mut bytes, mut held, mut bits) = (Vec::new(), 0_u32, 0);
    for value in values {
        (held, bits) = (held << 6 | value as u32, bits + 6);
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    bytes
}

/// The browser's outlines, filled again, compared with the areas of the masks.
#[test]
fn outlines_go_around_the_pixels_of_masks() {
    let script = format!(
        "{WAIT} const image = await syntable.view(0), [width, height] = image.size;
         const canvas = new OffscreenCanvas(width, height), cx = canvas.getContext('2d', {{ willReadFrequently: true }}), found = [];
         for (const object of image.objects) for (const kind of ['visible', 'amodal']) {{
             const counts = syntable.runs(object[kind]);
             const area = counts.filter((_, at) => at % 2).reduce((sum, count) => sum + count, 0);
             cx.clearRect(0, 0, width, height);
             cx.fill(new Path2D(syntable.outline(object[kind], image.size)), 'evenodd');
             const pixels = cx.getImageData(0, 0, width, height).data;
             let filled = 0;
             for (let at = 3; at < pixels.length; at += 4) if (pixels[at] > 127) filled++;
             found.push([area, filled, counts.reduce((sum, count) => sum + count, 0)]);
         }}
         return found;"
    );
    let Some(found) = look(&[job(&page("view.html"), &script)]) else { return };
    let masks = found[0].as_array().expect("masks");
    assert!(masks.len() > 10);
    for mask in masks {
        assert!(mask[0] == mask[1] && mask[0].as_u64() > Some(0) && mask[2] == 160 * 120, "{mask}");
    }
}

#[test]
fn a_scene_is_drawn_in_space_and_turns() {
    let script = format!(
        "{WAIT} const canvas = document.getElementById('canvas');
         await wait(() => canvas.dataset.ready === '1' && Number(canvas.dataset.painted) > 0);
         const colors = async () => {{
             const image = await createImageBitmap(await new Promise((done) => requestAnimationFrame(() => canvas.toBlob(done))));
             const cx = new OffscreenCanvas(64, 64).getContext('2d');
             cx.drawImage(image, 0, 0, 64, 64);
             return new Set(new Uint32Array(cx.getImageData(0, 0, 64, 64).data.buffer)).size;
         }};
         const painted = Number(canvas.dataset.painted);
         canvas.focus();
         canvas.dispatchEvent(new KeyboardEvent('keydown', {{ key: 'ArrowLeft', bubbles: true, cancelable: true }}));
         const many = await colors();
         await wait(() => Number(canvas.dataset.painted) > painted);
         return {{ many, error: canvas.getContext('webgl2').getError() }};"
    );
    let Some(found) = look(&[job(&page("scene.html#scene=1"), &script)]) else { return };
    assert_eq!(found[0]["error"], 0);
    assert!(found[0]["many"].as_u64() > Some(100), "{}", found[0]);
}

#[test]
fn every_page_is_quiet_and_fits_narrow_screens() {
    let script = format!(
        "{WAIT} await new Promise((done) => setTimeout(done, 400));
         const named = [...document.querySelectorAll('button, input, select, a, canvas')].filter((it) => !(it.hidden
             || it.closest('[hidden]') || it.textContent.trim() || it.getAttribute('aria-label') || it.closest('label')));
         return [document.documentElement.scrollWidth <= innerWidth, named.map((it) => it.outerHTML)];"
    );
    let pages = ["index.html", "gallery.html", "view.html", "scene.html"];
    let jobs: Vec<Value> = pages
        .iter()
        .flat_map(|name| [[1280, 900], [380, 800]].map(|size| (name, size)))
        .map(|(name, size)| json!({ "url": page(name), "script": script, "size": size, "dark": size[0] < 500 }))
        .collect();
    let Some(found) = look(&jobs) else { return };
    for (job, found) in jobs.iter().zip(found) {
        assert_eq!(found, json!([true, []]), "{} {}", job["url"], job["size"]);
    }
}

/// Datasets of other programs have pages, too, which state the missing data.
#[test]
fn a_foreign_dataset_has_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let [coco, out] = ["coco", "pages"].map(|name| folder.path().join(name));
    ok(&mut crate::support::convert(dataset(), "coco", &coco));
    let said = ok(syntable().arg("report").arg(&coco).arg("--out").arg(&out));
    assert!(said.contains("read as coco"), "{said}");
    let space = fs::read_to_string(out.join("scene.html")).expect("a page");
    assert!(space.contains("[write.gltf]"), "{space}");
    let script = format!(
        "{WAIT} await wait(() => document.getElementById('frame').dataset.ready === '0');
         return [document.getElementById('objects').rows.length, document.querySelector('[name=base][value=depth]').disabled];"
    );
    let Some(found) = look(&[job(&address(&out.join("view.html")), &script)]) else { return };
    assert!(found[0][0].as_u64() > Some(5) && found[0][1] == true, "{}", found[0]);
}

/// The folder of the writer `syntable`, or of the dataset.
fn annotations(data: &Path) -> Value {
    let folders = [data.to_owned(), data.join("syntable")];
    let file = folders.iter().map(|it| it.join("annotation_final.json")).find(|it| it.is_file()).expect("a file");
    serde_json::from_str(&fs::read_to_string(file).expect("readable")).expect("JSON")
}

/// Scores of predictions. The second image has no predictions, and the third has a prediction without an object.
fn scores(folder: &Path) -> PathBuf {
    let all = annotations(dataset());
    let images = all["images"].as_array().expect("a list");
    let found = all["annotations"].as_array().expect("a list").iter();
    let of = |it: &Value| {
        json!({ "image_id": it["image_id"], "score": 0.9, "segmentation": it["visible_mask"],
            "amodal_segmentation": it["segmentation"] })
    };
    let mut found: Vec<Value> = found.filter(|it| it["image_id"] != images[1]["id"]).map(of).collect();
    let corner = syntable_model::product::Mask::from_fn(160, 120, |x, y| x < 9 && y < 7).to_coco();
    let corner = json!({ "size": [120, 160], "counts": corner });
    found.push(json!({ "image_id": images[2]["id"], "score": 0.6, "segmentation": corner }));
    let [pred, scores] = ["results.json", "scores.json"].map(|name| folder.join(name));
    fs::write(&pred, Value::from(found).to_string()).expect("writable");
    ok(syntable().arg("eval").arg("--gt").arg(dataset()).arg("--pred").arg(&pred).arg("--save").arg(&scores));
    scores
}

#[test]
fn the_worst_images_are_shown_with_their_predictions() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scores, out) = (scores(folder.path()), folder.path().join("pages"));
    ok(syntable().arg("report").arg(dataset()).arg("--out").arg(&out).arg("--scores").arg(&scores));
    let overview = format!(
        "{WAIT} const section = [...document.querySelectorAll('h3')].find((it) => it.id === 'worst').parentElement;
         const cards = [...document.querySelector('#worst').nextElementSibling.nextElementSibling.querySelectorAll('a')];
         const cells = [...document.querySelectorAll('table.scores')][0].querySelectorAll('tbody tr').length;
         return [cards.map((it) => [it.getAttribute('href'), it.querySelector('.says span:last-child').textContent]).slice(0, 2), cells, section.tagName];"
    );
    let view = format!(
        "{WAIT} const by = (id) => document.getElementById(id), count = (what) => by('labels').querySelectorAll(what).length;
         await wait(() => by('frame').dataset.ready !== undefined);
         const before = count('.fill.predicted'), red = count('.fill.predicted[fill=\"#ff4136\"]');
         document.querySelector('[data-switch=predicted_amodal]').click();
         const both = count('.fill.predicted');
         document.querySelector('[data-switch=visible]').click();
         document.querySelector('[data-switch=predicted]').click();
         document.querySelector('[data-switch=predicted_amodal]').click();
         by('predictions').querySelector('button').click();
         return {{ before, red, both, after: count('.fill.predicted'), labels: count('.fill.visible'), chosen: count('.chosen') > 0,
             rows: by('predictions').rows.length, objects: by('objects').rows.length, says: by('predicted-says').textContent,
             scores: by('image-scores').children.length }};"
    );
    let page = |name: &str| address(&out.join(name));
    let jobs = [
        job(&page("index.html"), &overview),
        job(&page("view.html#i=2&on=predicted"), &view),
        job(
            &page("view.html#i=1&on=predicted"),
            &view.replace("by('predictions').querySelector('button').click();", ""),
        ),
    ];
    // With few images, the images with the worst scores come first; they are also served.
    let few = folder.path().join("few");
    ok(syntable().arg("report").arg(dataset()).args(["--images", "2", "--out"]).arg(&few).arg("--scores").arg(&scores));
    let name = |image: usize| annotations(dataset())["images"][image]["file_name"].as_str().expect("a name").to_owned();
    let rows = fs::read_to_string(few.join("data/rows/0.js")).expect("rows");
    // The second image has no prediction, so it is the worst one.
    assert!(rows.contains(&name(1)) && rows.matches("\"faults\"").count() == 2, "{rows}");
    let served = serve(&["--scores", &scores.display().to_string()]);
    let file = served.get("/data/view/000/000002.js", "GET");
    assert!(file.contains("\"predicted\":{") && file.contains("\"object\":null"), "{file}");
    // Scores inside the report that would be replaced are not lost.
    let inside = few.join("scores.json");
    fs::copy(&scores, &inside).expect("copied");
    let mut again = syntable();
    again.arg("report").arg(dataset()).arg("--overwrite").arg("--out").arg(&few).arg("--scores").arg(&inside);
    let said = fails(&mut again, 2);
    assert!(said.contains("which a new report would replace") && inside.is_file(), "{said}");
    // A user's file in a report prevents its replacement.
    let mut other = syntable();
    let said = fails(other.arg("report").arg(dataset()).arg("--overwrite").arg("--out").arg(&few), 2);
    assert!(said.contains("did not create: scores.json") && inside.is_file(), "{said}");
    fs::remove_file(&inside).expect("there");
    // Scores of another dataset, and a file without scores.
    let other = fs::read_to_string(&scores).expect("readable").replace("\"name\":\"", "\"name\":\"other-");
    let more = fs::read_to_string(&scores).expect("readable").replacen("\"images\":", "\"images\":1", 1);
    let edited = fs::read_to_string(&scores).expect("readable").replacen("\"visible\":\"", "\"visible\":\"~", 1);
    let wrong = folder.path().join("wrong.json");
    for (text, says) in [
        (other.as_str(), "is not in the dataset"),
        (more.as_str(), "images, but the dataset has"),
        (edited.as_str(), "`visible` of prediction 1, 160 × 120 pixels"),
        ("[1]", "it is no file of scores"),
    ] {
        fs::write(&wrong, text).expect("writable");
        let said = fails(
            syntable()
                .arg("report")
                .arg(dataset())
                .arg("--out")
                .arg(&few)
                .arg("--overwrite")
                .arg("--scores")
                .arg(&wrong),
            2,
        );
        assert!(said.contains(says) && said.contains("wrong.json"), "{said}");
    }
    assert!(few.join("index.html").is_file());
    // The remaining checks need a browser.
    let Some(found) = look(&jobs) else { return };
    assert_eq!(found[0][0][0], json!(["view.html#i=1&on=predicted", "0.0"]), "{}", found[0]);
    assert_eq!((&found[0][0][1][0], &found[0][1]), (&json!("view.html#i=2&on=predicted"), &json!(3)), "{}", found[0]);
    let seen = &found[1];
    let number = |name: &str| seen[name].as_u64().expect("a number");
    assert_eq!((number("red"), number("after"), seen["chosen"].as_bool()), (1, 0, Some(true)), "{seen}");
    assert!(number("before") == number("rows") && number("both") == 2 * number("rows"), "{seen}");
    assert!(number("rows") == number("labels") + 1 && number("rows") > 5 && number("scores") > 20, "{seen}");
    assert_eq!(seen["says"], "No visible object is missed. 1 of no object, drawn red.");
    let missed = &found[2];
    assert_eq!((&missed["before"], &missed["rows"]), (&json!(0), &json!(0)), "{missed}");
    assert!(missed["says"].as_str().is_some_and(|it| it.starts_with("Missed: 1, ")), "{missed}");
}

/// Damaged lines of the journal and missing images are reported; the remaining data is shown.
#[test]
fn a_damaged_dataset_is_shown_as_far_as_it_goes() {
    let folder = tempfile::tempdir().expect("a folder");
    let [data, out] = ["data", "pages"].map(|name| folder.path().join(name));
    ok(std::process::Command::new("cp").arg("-r").arg(dataset()).arg(&data));
    let journal = data.join(".syntable/journal.jsonl");
    let text = fs::read_to_string(&journal).expect("a journal");
    fs::write(&journal, text.replacen("{\"scene\"", "{{\"scene\"", 1)).expect("writable");
    let name = annotations(&data)["images"][0]["file_name"].as_str().expect("a name").to_owned();
    let image = files(&data).into_keys().find(|path| path.ends_with(&name)).expect("an image");
    fs::remove_file(data.join(image)).expect("there");
    // Links that lead out of the folder, and named pipes, are not read.
    for name in ["000000.glb", "000001.glb"] {
        let (inside, outside) = (data.join("gltf").join(name), folder.path().join(name));
        fs::rename(&inside, &outside).expect("there");
        std::os::unix::fs::symlink(&outside, &inside).expect("linked");
    }
    let times = data.join(".syntable/times.jsonl");
    fs::remove_file(&times).expect("there");
    ok(std::process::Command::new("mkfifo").arg(&times));
    let output = syntable().arg("report").arg(&data).arg("--out").arg(&out).output().expect("starts");
    let (said, told) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(3), "{said}{told}");
    assert!(said.contains("3 of 4 images with labels, 0 scenes in 3-D"), "{said}");
    let page = fs::read_to_string(out.join("index.html")).expect("a page");
    let shown = page.replace("&#x2F;", "/");
    for text in [told.as_ref(), shown.as_str()] {
        for part in [
            name.as_str(),
            "line 2 is not a journal line",
            "times.jsonl: it is not a file",
            ".glb: a link leads outside the folder",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    assert!(page.contains("Images that cannot be read") && page.contains("What else cannot be read"), "{page}");
    let script = format!(
        "{WAIT} await wait(() => document.querySelectorAll('#grid a, .grid a').length >= 4);
         return [document.querySelectorAll('.frame.bare').length, document.querySelectorAll('.frame img').length];"
    );
    let Some(found) = look(&[job(&address(&out.join("gallery.html")), &script)]) else { return };
    assert_eq!(found[0], json!([1, 3]));
}

/// A server that ends with the test.
struct Served(Child, Address);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serve(more: &[&str]) -> Served {
    let mut child =
        syntable().arg("view").arg(dataset()).args(more).stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("an address");
    Served(child, Address::of(line.trim()))
}

impl Served {
    /// The whole answer.
    fn get(&self, path: &str, method: &str) -> String {
        let (head, body) = self.1.get(path, method);
        format!("{head}\r\n\r\n{}", String::from_utf8_lossy(&body))
    }
}

#[test]
fn view_serves_the_same_pages_and_nothing_else() {
    let before = files(dataset());
    let served = serve(&[]);
    // No page is served without the token.
    let own = served.1.own.as_str();
    for path in ["/".to_owned(), own.to_owned(), format!("{own}data/rows/0.js"), format!("{own}changes?after=0")] {
        let (head, body) = served.1.ask(&path, "GET", "Cookie: token=0\r\n");
        let body = String::from_utf8_lossy(&body);
        assert!(head.starts_with("HTTP/1.1 403") && body.contains("whole address"), "{path}: {head}");
    }
    let status = |target: &str, method: &str| served.get(target, method)[9..12].to_owned();
    for target in ["/", "/gallery.html", "/data/rows/0.js", "/image/000/000003.jpg", "/data/scene/000001.js"] {
        assert_eq!(status(target, "GET"), "200", "{target}");
    }
    for target in
        ["/../recipe.toml", "/%2e%2e/recipe.toml", "/..%2frecipe.toml", "/page/..%5c..%5crecipe.toml", "/recipe.toml"]
    {
        assert!(["400", "404"].contains(&status(target, "GET").as_str()), "{target}");
    }
    assert_eq!((status("/", "POST"), status("/", "PUT")), ("405".to_owned(), "405".to_owned()));
    let script = format!(
        "{WAIT} await wait(() => document.getElementById('frame').dataset.ready === '2' && document.getElementById('image').complete);
         return [document.getElementById('image').naturalWidth, document.getElementById('objects').rows.length > 5,
             location.search, document.cookie];"
    );
    let seen = look(&[job(&format!("{}#i=2&on=visible", served.1.page("view.html")), &script)]);
    assert!(seen.is_none_or(|seen| seen[0] == json!([160, true, "", ""])));
    assert!(before == files(dataset()), "viewing has written something");
    // The server ends on a signal.
    for signal in ["-INT", "-TERM"] {
        let mut served = serve(&[]);
        ok(std::process::Command::new("kill").args([signal, &served.0.id().to_string()]));
        assert_eq!(served.0.wait().expect("it ends").code(), Some(0), "{signal}");
    }
}
