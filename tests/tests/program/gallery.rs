//! The images of the reference: one image for every kind with a visible result. This test compares the folder of
//! recipes, the folder of images and the registry.
//! `UPDATE=1 cargo test --release --package syntable-tests --test program gallery` renders the images; `UPDATE=lights`
//! renders only the images whose names contain the word.
//!
//! `SYNTABLE_OIDN` names the library of Open Image Denoise; without it, the image of this library stays unchanged.

use crate::support::{files, gallery, ok, skip, syntable};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{DynamicImage, GenericImage, RgbImage};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use syntable_model::digest::Digest;
use syntable_model::registry::{Registry, Slot};
use syntable_program as _;

/// Files that several recipes of the gallery use.
const SHARED: [&str; 2] = ["base.toml", "recorded.jsonl"];

/// Maximum size of an image file, bytes.
const LARGEST: usize = 40_000;

/// Maximum total size of the images, bytes.
const LARGEST_SUM: usize = 1_500_000;

/// Slot and name of every kind that needs an image.
fn kinds() -> Vec<(Slot, &'static str)> {
    let registry = Registry::linked().expect("no clash");
    gallery::SLOTS
        .into_iter()
        .flat_map(|slot| registry.of_slot(slot).map(move |entry| (slot, entry.kind)).collect::<Vec<_>>())
        .collect()
}

/// Recipes whose images make up the image of a kind. A denoised image has the noisy image to its left.
fn tiles(slot: Slot, kind: &str) -> Vec<PathBuf> {
    let before = (slot == Slot::Denoise && kind != "none").then(|| gallery::recipes(slot, "none"));
    before.into_iter().flatten().chain(gallery::recipes(slot, kind)).collect()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Whether a recipe uses Open Image Denoise.
fn needs_oidn(recipe: &Path) -> bool {
    read(recipe).contains("${OIDN_LIBRARY}")
}

/// A command of the program, with the library if it is available.
fn command(verb: &str, recipe: &Path) -> Command {
    let mut command = syntable();
    command.arg(verb).arg(recipe);
    let library = std::env::var_os("SYNTABLE_OIDN").filter(|_| needs_oidn(recipe));
    command.env("OIDN_LIBRARY", library.unwrap_or_else(|| "/libOpenImageDenoise.so".into()));
    if verb == "run" && recipe.ends_with("denoise/auto.toml") {
        // The result must not depend on the machine that renders the image.
        command.args(["--set", "denoise.kind=\"guided\""]);
    }
    command
}

/// Digest of the content of recipes and of the recipes that they extend; comments do not count.
fn digest(recipes: &[PathBuf]) -> String {
    let mut content = Vec::new();
    let mut waiting: Vec<PathBuf> = recipes.to_vec();
    while let Some(recipe) = waiting.pop() {
        let table: toml::Table = read(&recipe).parse().unwrap_or_else(|error| panic!("{}: {error}", recipe.display()));
        content.extend(serde_json::to_vec(&table).expect("plain data"));
        let base = table.get("extends").and_then(toml::Value::as_str);
        waiting.extend(base.map(|base| recipe.parent().expect("in a folder").join(base)));
    }
    format!("recipes {}", Digest::of(&content))
}

#[test]
fn every_kind_has_an_image() {
    let registry = Registry::linked().expect("no clash");
    let update = std::env::var("UPDATE").ok();
    let mut sum = 0;
    let mut faults = Vec::new();
    for (slot, kind) in kinds() {
        let name = gallery::image_name(slot, kind);
        let recipes = gallery::recipes(slot, kind);
        let entry = registry.find(slot, kind).expect("registered");
        let own = recipes.first().map(|recipe| gallery::excerpt(&read(recipe), entry)).unwrap_or_default();
        if !own.contains(kind) {
            faults.push(format!("book/gallery/{slot}/{kind}.toml is missing or does not use the kind"));
            continue;
        }
        if update.as_ref().is_some_and(|word| word == "1" || name.contains(word.as_str())) {
            render(slot, kind);
        }
        let Ok(bytes) = fs::read(gallery::image_folder().join(&name)) else {
            faults.push(format!("{name} is missing"));
            continue;
        };
        sum += bytes.len();
        faults.extend(faults_of(&bytes, &digest(&tiles(slot, kind))).map(|fault| format!("{name} {fault}")));
    }
    if sum > LARGEST_SUM {
        faults.push(format!("all images together have {sum} bytes, more than {LARGEST_SUM}"));
    }
    assert!(
        faults.is_empty(),
        "{}\nUPDATE=1 cargo test --release --package syntable-tests --test program gallery renders the images",
        faults.join("\n")
    );
}

/// The fault of an image, if any.
fn faults_of(bytes: &[u8], digest: &str) -> Option<String> {
    let image = match image::load_from_memory(bytes) {
        Ok(image) => image.to_luma8(),
        Err(error) => return Some(format!("cannot be read: {error}")),
    };
    let mean =
        image.pixels().map(|pixel| f64::from(pixel.0[0])).sum::<f64>() / f64::from(image.width() * image.height());
    if !bytes.windows(digest.len()).any(|window| window == digest.as_bytes()) {
        return Some("was rendered from other recipes".to_owned());
    }
    if bytes.len() > LARGEST {
        return Some(format!("has {} bytes, more than {LARGEST}", bytes.len()));
    }
    (!(40.0..=215.0).contains(&mean))
        .then(|| format!("has a mean gray value of {mean:.0}: it is too dark or too bright"))
}

#[test]
fn every_file_belongs_to_a_kind() {
    let kinds = kinds();
    let has_kind = |slot: &str, kind: &str| kinds.iter().any(|(s, k)| s.to_string() == slot && *k == kind);
    let mut orphans = Vec::new();
    for path in gallery::below(&gallery::recipe_folder()) {
        let slot = path.file_name().expect("named").to_string_lossy().into_owned();
        if path.is_dir() {
            let foreign = |recipe: &PathBuf| !gallery::kind_of(recipe).is_some_and(|kind| has_kind(&slot, &kind));
            orphans.extend(gallery::below(&path).into_iter().filter(foreign));
        } else if !SHARED.contains(&slot.as_str()) {
            orphans.push(path);
        }
    }
    let images: Vec<String> = kinds.iter().map(|(slot, kind)| gallery::image_name(*slot, kind)).collect();
    let foreign = |path: &PathBuf| !images.iter().any(|image| path.ends_with(image));
    orphans.extend(gallery::below(&gallery::image_folder()).into_iter().filter(foreign));
    assert!(orphans.is_empty(), "no kind has these files: {orphans:?}");
}

#[test]
fn recipes_of_the_gallery_have_no_mistake() {
    let mut recipes = vec![gallery::recipe_folder().join("base.toml")];
    recipes
        .extend(gallery::SLOTS.into_iter().flat_map(|s| gallery::below(&gallery::recipe_folder().join(s.to_string()))));
    for recipe in recipes {
        // `check` loads the library; `plan` finds every mistake of the recipe without it.
        let verb = if needs_oidn(&recipe) && std::env::var_os("SYNTABLE_OIDN").is_none() { "plan" } else { "check" };
        let output = command(verb, &recipe).output().expect("the program starts");
        let said = crate::support::text(&output);
        let sound = output.status.success() && !["warning", "error:", "error["].iter().any(|word| said.contains(word));
        assert!(sound, "{}\n{said}", recipe.display());
    }
}

/// Renders the recipes of a kind and writes the image.
fn render(slot: Slot, kind: &str) {
    let recipes = tiles(slot, kind);
    if recipes.iter().any(|recipe| needs_oidn(recipe)) && std::env::var_os("SYNTABLE_OIDN").is_none() {
        return skip("SYNTABLE_OIDN");
    }
    let mut found = Vec::new();
    for recipe in &recipes {
        let folder = tempfile::tempdir().expect("a folder");
        ok(command("run", recipe).arg("--out").arg(folder.path().join("data")));
        let written = files(&folder.path().join("data"));
        let images = written.iter().filter(|(name, _)| name.starts_with("png/"));
        found.extend(
            images.map(|(name, bytes)| image::load_from_memory(bytes).unwrap_or_else(|e| panic!("{name}: {e}"))),
        );
    }
    let sheet = sheet(&colored(found));
    let bytes = (50..=90).rev().step_by(4).map(|quality| jpeg(&sheet, quality, &digest(&recipes)));
    let bytes = bytes.reduce(|best, next| if best.len() <= LARGEST { best } else { next }).expect("qualities");
    fs::create_dir_all(gallery::image_folder()).expect("writable");
    fs::write(gallery::image_folder().join(gallery::image_name(slot, kind)), bytes).expect("writable");
}

/// A JPEG file with a comment.
fn jpeg(image: &RgbImage, quality: u8, comment: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(image).expect("8-bit RGB");
    // After the first two bytes of the file: marker, length including itself, text.
    let length = u16::try_from(comment.len() + 2).expect("short").to_be_bytes();
    let segment = [&[0xff, 0xfe], &length[..], comment.as_bytes()].concat();
    bytes.splice(2..2, segment);
    bytes
}

/// Arranges images in rows of up to three, or of two for four images. More than three images are scaled down.
fn sheet(images: &[RgbImage]) -> RgbImage {
    let columns = if images.len() == 4 { 2 } else { images.len().min(3) };
    let (width, height) = images.first().expect("the recipe writes images").dimensions();
    let (width, height) = if images.len() > 3 { (width * 3 / 4, height * 3 / 4) } else { (width, height) };
    let rows = images.len().div_ceil(columns);
    let at = |n: usize, size: u32| u32::try_from(n).expect("few") * size;
    let mut sheet = RgbImage::new(at(columns, width), at(rows, height));
    for (n, image) in images.iter().enumerate() {
        let image = imageops::resize(image, width, height, FilterType::Triangle);
        sheet.copy_from(&image, at(n % columns, width), at(n / columns, height)).expect("all have the same size");
    }
    sheet
}

/// Images in 8-bit RGB. 16-bit images are depths: all share one color scale, near is red, far is blue, missing depth is
/// black.
fn colored(images: Vec<DynamicImage>) -> Vec<RgbImage> {
    let is_depth = |image: &&DynamicImage| matches!(image, DynamicImage::ImageLuma16(_));
    let depths = images.iter().filter(is_depth).flat_map(|image| image.to_luma16().into_raw());
    let inverse: Vec<f64> = depths.filter(|depth| *depth > 0).map(|depth| 1.0 / f64::from(depth)).collect();
    let (far, near) = (inverse.iter().copied().fold(f64::MAX, f64::min), inverse.iter().copied().fold(0.0, f64::max));
    let color = |depth: u16| match depth {
        0 => [0; 3],
        depth => turbo((1.0 / f64::from(depth) - far) / (near - far)),
    };
    let each = images.into_iter().map(|image| match image {
        DynamicImage::ImageLuma16(depth) => {
            let (width, height) = depth.dimensions();
            RgbImage::from_fn(width, height, |x, y| image::Rgb(color(depth.get_pixel(x, y).0[0])))
        }
        other => other.to_rgb8(),
    });
    each.collect()
}

/// The color map Turbo (Mikhailov, 2019), from its polynomial, for 0 to 1.
fn turbo(x: f64) -> [u8; 3] {
    const COEFFICIENTS: [[f64; 6]; 3] = [
        [0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
        [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
        [0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
    ];
    COEFFICIENTS.map(|c| (255.0 * c.iter().rev().fold(0.0, |sum, c| sum * x + c)).clamp(0.0, 255.0).round() as u8)
}
