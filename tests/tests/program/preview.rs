//! `syntable preview`: sheets of a recipe, updated after every save, in a file and in the browser.

use crate::support::served::Address;
use crate::support::{fails, ok, root, syntable};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Time limit for a preview on a busy machine.
const PATIENCE: Duration = Duration::from_secs(240);

/// Arguments that make a preview small: two views of the first scene.
const TINY: [&str; 12] = [
    "--scenes",
    "0",
    "--width",
    "48",
    "--samples",
    "1",
    "--set",
    "settle.duration_s=1.0",
    "--set",
    "place.objects.count={ integers = [2, 4] }",
    "--threads",
    "2",
];

fn preview(recipe: &Path, more: &[&str]) -> Command {
    let mut command = syntable();
    command.arg("preview").arg(recipe).args(TINY).args(more);
    command
}

fn image(path: &Path) -> image::RgbImage {
    image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8()
}

/// Whether a part of an image has more than a few colors.
fn shows_something(image: &image::RgbImage, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> bool {
    let pixels = (0..width).flat_map(|i| (0..height).map(move |j| (x + i, y + j)));
    let colors: std::collections::BTreeSet<[u8; 3]> = pixels.map(|(x, y)| image.get_pixel(x, y).0).collect();
    colors.len() > 100
}

#[test]
fn a_sheet_shows_views_side_by_side_and_is_the_same_every_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let quickstart = root().join("recipes/quickstart.toml");
    let [one, two] = ["one.png", "two.png"].map(|name| folder.path().join(name));
    let said = ok(preview(&quickstart, &["--out"]).arg(&one));
    assert_eq!(said.trim(), one.display().to_string());
    // Captions of 15 pixels, gaps of 6.
    let sheet = image(&one);
    assert_eq!(sheet.dimensions(), (3 * 6 + 2 * 48, 2 * 6 + 15 + 36));
    for x in [6, 6 + 48 + 6] {
        assert!(shows_something(&sheet, [x, 21], [48, 36]), "nothing at {x}");
    }
    // The result does not depend on the number of threads.
    let one_thread = TINY.map(|argument| if argument == "2" { "1" } else { argument });
    ok(syntable()
        .arg("preview")
        .arg(&quickstart)
        .args(one_thread)
        .args(["--views", "2", "--seed", "15", "--out"])
        .arg(&two));
    assert!(fs::read(&one).expect("a sheet") == fs::read(&two).expect("a sheet"), "the bytes differ");
    ok(preview(&quickstart, &["--labels", "--views", "1", "--out"]).arg(&two));
    assert_eq!(image(&two).dimensions(), (2 * 6 + 3 * 48 + 2 * 6, 2 * 6 + 15 + 36));
    // The image next to its labels equals the image on the sheet without labels.
    let part = |sheet: &image::RgbImage| image::imageops::crop_imm(sheet, 6, 21, 48, 36).to_image();
    assert_eq!(part(&image(&two)), part(&sheet));
}

#[test]
fn a_sheet_takes_its_place_once_all_of_its_images_are_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let (quickstart, out) = (root().join("recipes/quickstart.toml"), folder.path().join("sheet.png"));
    let make = |views: &str, more: &[&str]| {
        let mut command = preview(&quickstart, more);
        command.args(["--views", views, "--out"]).arg(&out);
        command
    };
    ok(&mut make("3", &[]));
    let whole = fs::read(&out).expect("a sheet");
    ok(&mut make("1", &[]));
    let before = fs::read(&out).expect("a sheet");
    let mut killed = make("3", &["--log-format", "json"]);
    let mut killed = killed.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("starts");
    let lines = BufReader::new(killed.stderr.take().expect("piped")).lines();
    let first = lines.map_while(Result::ok).find(|line| line.contains(r#""event":"image""#));
    killed.kill().expect("killable");
    killed.wait().expect("ends");
    assert!(first.is_some(), "no image was made");
    let there = fs::read(&out).expect("a sheet");
    assert!(there == before || there == whole, "a part of a sheet");
    ok(&mut make("3", &[]));
    assert!(fs::read(&out).expect("a sheet") == whole, "another sheet");
    assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 1);
}

#[test]
fn without_a_file_the_sheet_is_named_after_the_recipe() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = ok(preview(Path::new("builtin:quickstart"), &["--views", "1"]).current_dir(folder.path()));
    assert_eq!(said.trim(), "quickstart.preview.png");
    assert_eq!(image(&folder.path().join("quickstart.preview.png")).dimensions(), (60, 63));
    assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 1);
}

#[test]
fn mistakes_are_told_as_check_tells_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let (recipe, out) = (folder.path().join("my.toml"), folder.path().join("out.png"));
    fs::write(&recipe, with("samples_per_pixel = 8", "sampels_per_pixel = 8")).expect("written");
    let checked = fails(syntable().arg("check").arg(&recipe), 2);
    let said = fails(syntable().arg("preview").arg(&recipe).arg("--out").arg(&out), 2);
    assert!(said.contains("did you mean `samples_per_pixel`"), "{said}");
    assert_eq!(said.trim(), checked.trim());
    assert!(!out.exists());
    // A sheet never replaces the recipe, or a file that is not a sheet.
    let said = fails(syntable().arg("preview").arg(&recipe).arg("--out").arg(&recipe), 2);
    assert!(said.contains("--out would overwrite an input of the command"), "{said}");
    fs::write(&out, "mine").expect("written");
    let said = fails(syntable().arg("preview").arg(&recipe).arg("--out").arg(&out), 2);
    assert!(
        said.contains("exists and is not a preview sheet") && fs::read(&out).is_ok_and(|text| text == b"mine"),
        "{said}"
    );
    let scenes = fails(&mut preview(&root().join("recipes/quickstart.toml"), &["--views", "500"]), 2);
    assert!(scenes.contains("--views"), "{scenes}");
}

#[test]
fn a_sheet_never_takes_the_place_of_an_asset() {
    let folder = tempfile::tempdir().expect("a folder");
    let (recipe, texture) = (folder.path().join("my.toml"), folder.path().join("textures/wood/wood_Color.png"));
    let pool = "[assets.more]\nkind = \"pbr_folder\"\nroot = \"textures\"\n";
    fs::write(&recipe, format!("{}\n{pool}", with("", ""))).expect("written");
    fs::create_dir_all(texture.parent().expect("a folder")).expect("writable");
    image::RgbImage::new(4, 4).save(&texture).expect("written");
    let before = fs::read(&texture).expect("readable");
    let refused = |recipe: &Path, more: &[&str]| {
        let said = fails(preview(recipe, &["--views", "1"]).args(more).arg("--out").arg(&texture), 2);
        assert!(said.contains("the output file exists and is not a preview sheet"), "{said}");
        assert!(fs::read(&texture).expect("readable") == before);
    };
    refused(&recipe, &[]);
    // A recipe with mistakes names no assets, and the sheet would show its mistakes.
    let broken = folder.path().join("broken.toml");
    fs::write(&broken, with("samples_per_pixel = 8", "sampels_per_pixel = 8")).expect("written");
    refused(&broken, &["--watch"]);
    // A sheet replaces an earlier sheet in any folder.
    let sheet = folder.path().join("textures/sheet.png");
    for _ in 0..2 {
        ok(preview(&recipe, &["--views", "1", "--out"]).arg(&sheet));
    }
    // A path that is not writable is a mistake of the command.
    let said = fails(preview(&recipe, &["--views", "1", "--out"]).arg(folder.path().join("none/a.png")), 2);
    assert!(said.contains("none/a.png"), "{said}");
}

#[test]
fn a_scene_that_fails_is_told_in_its_cell() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out.png");
    // The objects would start above the ceiling.
    let mut command =
        preview(&root().join("recipes/quickstart.toml"), &["--set", "place.objects.clearance_m=5.0", "--out"]);
    let said = fails(command.arg(&out), 3);
    assert!(said.contains("the space above `table` ends at 3.00 m") && said.contains("1 scene failed"), "{said}");
    let sheet = image(&out);
    assert_eq!(sheet.dimensions(), (3 * 6 + 2 * 48, 2 * 6 + 15 + 36));
    assert!(sheet.pixels().filter(|pixel| pixel.0 == [255, 150, 130]).count() > 50, "the cells say nothing");
}

/// The quickstart recipe with a part of its text replaced.
fn with(from: &str, to: &str) -> String {
    let recipe = fs::read_to_string(root().join("recipes/quickstart.toml")).expect("readable");
    assert!(recipe.contains(from), "the recipe has no `{from}`");
    recipe.replace(from, to)
}

/// A preview that watches a recipe, with the events that it reports.
struct Watching {
    child: Child,
    events: Receiver<Value>,
    /// The first output, which contains the address of the preview.
    said: String,
    recipe: PathBuf,
    out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Watching {
    fn start(more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let (recipe, out) = (folder.path().join("my.toml"), folder.path().join("out.png"));
        fs::write(&recipe, with("", "")).expect("written");
        let mut command = preview(&recipe, &["--log-format", "json", "--out"]);
        command.arg(&out).args(more).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("starts");
        let mut said = String::new();
        BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut said).expect("it says where it is");
        let errors = BufReader::new(child.stderr.take().expect("a pipe"));
        let (sender, events) = channel();
        std::thread::spawn(move || {
            for line in errors.lines().map_while(Result::ok) {
                let event = serde_json::from_str(&line).unwrap_or_else(|_| Value::String(line));
                if sender.send(event).is_err() {
                    break;
                }
            }
        });
        Self { child, events, said: said.trim().to_owned(), recipe, out, _folder: folder }
    }

    /// Saves the recipe as many editors do: by renaming.
    fn save(&self, text: &str) {
        let part = self.recipe.with_extension("swp");
        fs::write(&part, text).and_then(|()| fs::rename(part, &self.recipe)).expect("written");
    }

    /// Events up to the first event of a kind, which comes last.
    fn until(&self, kind: &str) -> Vec<Value> {
        let (start, mut all) = (Instant::now(), Vec::new());
        while start.elapsed() < PATIENCE {
            match self.events.recv_timeout(Duration::from_millis(200)) {
                Ok(event) => {
                    all.push(event);
                    if all.last().is_some_and(|event| event["event"] == kind) {
                        return all;
                    }
                }
                Err(_) => continue,
            }
        }
        panic!("no event `{kind}`: {all:#?}");
    }

    /// Number of calls of each stage until all images are finished.
    fn made(&self) -> impl Fn(&str) -> u64 + use<> {
        let stages = self.until("stages").pop().expect("the last event");
        self.until("note");
        move |stage: &str| stages["stages"][stage]["calls"].as_u64().unwrap_or(0)
    }

    /// Ends it as a user does, and waits.
    fn end(mut self) -> Option<i32> {
        ok(Command::new("kill").args(["-TERM", &self.child.id().to_string()]));
        self.child.wait().expect("ends").code()
    }
}

#[test]
fn only_what_a_save_changes_is_made_again() {
    let watching = Watching::start(&["--watch"]);
    assert_eq!(watching.said, watching.out.display().to_string());
    let calls = watching.made();
    assert_eq!([calls("settle"), calls("render"), calls("place.objects")], [1, 2, 1]);
    let first = fs::read(&watching.out).expect("a sheet");

    // Another camera views the same scene.
    let radius = with("radius = { of_table = [0.8, 1.36] }", "radius = { of_table = [0.7, 0.8] }");
    watching.save(&radius);
    let calls = watching.made();
    assert_eq!([calls("settle"), calls("place.objects"), calls("render.load"), calls("render")], [0, 0, 0, 2]);
    let second = fs::read(&watching.out).expect("a sheet");
    assert!(first != second, "the edit is not seen");

    // A mistake replaces the images, and the next good save replaces the mistake.
    watching.save(&radius.replace("kind = \"guided\"", "kind = \"guidde\""));
    let message = watching.until("message").pop().expect("a message");
    assert!(message["message"].as_str().is_some_and(|it| it.contains("guidde")), "{message}");
    assert_eq!([&message["line"], &message["level"]], [&Value::from(mistake_line(&radius)), &Value::from("error")]);
    let start = Instant::now();
    while fs::read(&watching.out).expect("a sheet") == second && start.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(20));
    }
    let said = image(&watching.out);
    assert!(said.pixels().any(|pixel| pixel.0 == [255, 150, 130]) && said.width() > 800, "no text in the sheet");

    // An earlier state reappears with the same bytes, without rendering.
    watching.save(&with("", ""));
    let calls = watching.made();
    assert_eq!([calls("settle"), calls("render")], [0, 0]);
    assert!(fs::read(&watching.out).expect("a sheet") == first, "the bytes differ");

    // Changes that affect no image cause no work: the writers, and the number of scenes.
    watching.save(&with("scenes = 2", "scenes = 3").replace("[write.contact_sheet]", "[write.png]"));
    let calls = watching.made();
    assert_eq!([calls("settle"), calls("render")], [0, 0]);

    // Other physics gives another scene.
    watching.save(
        &with("count = { integers = [16, 30] }", "count = { integers = [16, 31] }").replace("seed = 15", "seed = 16"),
    );
    let calls = watching.made();
    assert_eq!([calls("settle"), calls("render")], [1, 2]);
    assert_eq!(watching.end(), Some(0));
}

/// The line of the recipe that names the denoiser.
fn mistake_line(recipe: &str) -> usize {
    recipe.lines().position(|line| line == "kind = \"guided\"").expect("a denoiser") + 1
}

fn state(address: &Address) -> Value {
    serde_json::from_slice(&address.get("state.json", "GET").1).expect("JSON")
}

#[test]
fn the_page_follows_what_is_saved() {
    let watching = Watching::start(&["--serve"]);
    let address = Address::of(&watching.said);
    let (head, page) = address.get("/", "GET");
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("text/html"), "{head}");
    assert!(String::from_utf8_lossy(&page).contains("id=\"grid\""));
    assert!(address.get("/other", "GET").0.starts_with("HTTP/1.1 404"));
    // Requests without the token are refused.
    for path in ["/", "/state.json", "/sheet.png", "/changes"] {
        let path = format!("{}{}", address.own, path.trim_start_matches('/'));
        assert!(address.ask(&path, "GET", "").0.starts_with("HTTP/1.1 403"), "{path}");
    }
    let _ = watching.made();
    let made = state(&address);
    assert_eq!([&made["status"], &made["mistakes"], &made["title"]], ["2 images", "", "quickstart"]);
    let key = made["cells"][1]["shot"]["key"].as_str().expect("a key").to_owned();
    let (head, color) = address.get(&format!("/shot/{key}/color.png"), "GET");
    let color = image::load_from_memory(&color).unwrap_or_else(|error| panic!("{head}: {error}")).to_rgb8();
    // The page and the sheet show the same pixels.
    let sheet = image(&watching.out);
    assert_eq!(color, image::imageops::crop_imm(&sheet, 6 + 48 + 6, 21, 48, 36).to_image());
    let (_, labels) = address.get(&format!("/shot/{key}/labels.json"), "GET");
    let labels: Value = serde_json::from_slice(&labels).expect("JSON");
    let visible = labels["objects"].as_array().expect("a list").iter().filter(|it| it["visible"].is_string()).count();
    assert_eq!(made["cells"][1]["shot"]["objects"], visible);
    for (file, is_there) in [("depth.png", true), ("normal.png", true), ("other.png", false), ("../state.json", false)]
    {
        let (head, _) = address.get(&format!("/shot/{key}/{file}"), "GET");
        assert_eq!(head.starts_with("HTTP/1.1 200"), is_there, "{file}: {head}");
    }
    let (head, png) = address.get("/sheet.png", "GET");
    assert!(head.contains("image/png") && png == fs::read(&watching.out).expect("a sheet"), "{head}");

    let wrong = with("kind = \"guided\"", "kind = \"<guidde>\"");
    watching.save(&wrong);
    let version = made["version"].as_u64().expect("a version");
    // The page waits for a change.
    let (_, news) = address.get(&format!("/changes?after={version}"), "GET");
    assert_eq!(String::from_utf8_lossy(&news), format!("{{\"version\":{}}}", version + 1));
    let checked = fails(syntable().arg("check").arg(&watching.recipe), 2);
    let mistaken = state(&address);
    assert_eq!(mistaken["mistakes"].as_str().map(str::trim), Some(checked.trim()));
    assert_eq!(mistaken["cells"], made["cells"], "the last images are gone");
    let page = String::from_utf8_lossy(&address.get("/", "GET").1).into_owned();
    assert!(page.contains("&lt;guidde&gt;") && !page.contains("<guidde>"), "{page}");

    watching.save(&with("", ""));
    let _ = watching.made();
    let mended = state(&address);
    assert_eq!([&mended["status"], &mended["mistakes"]], ["2 images", ""]);
    assert_eq!(watching.end(), Some(0));
}

#[test]
fn a_browser_shows_a_save_without_being_reloaded() {
    if crate::support::browser::program().is_none() {
        return crate::support::skip("chromium");
    }
    // Small at final quality, too.
    let watching =
        Watching::start(&["--serve", "--set", "camera.resolution=[96, 72]", "--set", "render.samples_per_pixel=2"]);
    let _ = watching.made();
    let address = Address::of(&watching.said);
    let cells = state(&address)["cells"].as_array().expect("views").clone();
    let key = |cell: &Value| cell["shot"]["key"].as_str().expect("a key").to_owned();
    let first: Vec<String> = cells.iter().map(|cell| format!("shot/{}/color.png", key(cell))).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let loaded = folder.path().join("loaded");
    // The page dims the images on a mistake, then shows new ones of another seed, and one at final quality.
    let script = "const by = (id) => document.getElementById(id), wait = async (is) => { for (let i = 0; i < 4000; i++) { \
         if (is()) return; await new Promise((done) => setTimeout(done, 50)); } throw new Error(`not: ${is}`); };
         const images = () => [...document.querySelectorAll('#grid img')].map((it) => it.getAttribute('src'));
         const opacity = () => Number(getComputedStyle(document.querySelector('#grid img')).opacity);
         await wait(() => !by('mistakes').hidden && images().length === 2 && images().every(Boolean) && opacity() < 0.5);
         const mistaken = [images(), by('mistakes').textContent.includes('guidde')];
         document.querySelector('[data-switch=visible]').click();
         await wait(() => document.querySelectorAll('#grid path').length > 2);
         by('seed-next').click();
         await wait(() => by('mistakes').hidden && by('status').textContent === '2 images' && by('seed').value === '16'
             && images().every((it) => it && !mistaken[0].includes(it)) && opacity() === 1);
         document.querySelector('#grid button').click();
         await wait(() => by('large').dataset.final && by('image').src.includes(by('large').dataset.final) && by('image').naturalWidth > 48);
         const large = [by('image').naturalWidth, by('large-status').textContent.startsWith('final quality'), location.hash];
         by('close').click();
         return { mistaken, large, hash: location.hash, open: by('large').open };";
    let mut job = crate::support::browser::job(&watching.said, script);
    job["loaded"] = loaded.display().to_string().into();
    let page = std::thread::spawn(move || crate::support::browser::look(&[job]));
    let start = Instant::now();
    while !loaded.exists() && start.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(20));
    }
    watching.save(&with("kind = \"guided\"", "kind = \"guidde\""));
    while state(&address)["choice"]["seed"] != 16 && start.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(50));
    }
    watching.save(&with("", ""));
    let found = page.join().expect("the page is quiet").expect("a browser").remove(0);
    assert_eq!(found["mistaken"], serde_json::json!([first, true]));
    assert_eq!(found["large"], serde_json::json!([96, true, "#on=visible&seed=16&large=0.0"]));
    assert_eq!([&found["hash"], &found["open"]], [&Value::from("#on=visible&seed=16"), &Value::from(false)]);
    assert_eq!(watching.end(), Some(0));
}
