//! Photographs behind rendered objects, compared with closed forms.

use crate::common::{json, refusal, sense, sensor, view};
use syntable_model::context::Serial;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, EXPOSURE, OPACITY, RADIANCE, RGB};
use syntable_model::product::{Lighting, ScenePart};
use syntable_model::scene::Exposure;
use syntable_sensor::rgb_camera::{Developer, Development};

const SIZE: [u32; 2] = [16, 12];
const FIXED: Exposure = Exposure::Fixed { ev100: 5.0 };

/// Light of the parts of a scene.
struct Parts {
    foreground: [f32; 3],
    opacity: f32,
    shadowed: [f32; 3],
    empty: [f32; 3],
}

fn products(parts: impl Fn(u32, u32) -> Parts) -> Products {
    let mut products = Products::new();
    let [width, height] = SIZE;
    let furniture = |lighting| RADIANCE.of_part(ScenePart::Furniture(lighting));
    let mut put = |key: Key<Plane<[f32; 3]>>, of: &dyn Fn(Parts) -> [f32; 3]| {
        products.put(key, Plane::from_fn(width, height, |x, y| of(parts(x, y)))).expect("first");
    };
    put(RADIANCE, &|it| std::array::from_fn(|c| it.foreground[c] + (1.0 - it.opacity) * it.shadowed[c]));
    put(furniture(Lighting::InScene), &|it| it.shadowed);
    put(furniture(Lighting::Alone), &|it| it.empty);
    put(ALBEDO, &|_| [0.5; 3]);
    products
        .put(OPACITY.of_part(ScenePart::Foreground), Plane::from_fn(width, height, |x, y| parts(x, y).opacity))
        .expect("first");
    products
}

/// A photograph in which every pixel differs from its neighbors.
fn photograph([width, height]: [u32; 2]) -> image::RgbImage {
    image::RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([40 + 9 * x as u8, 30 + 11 * y as u8, 200 - 7 * (x + y) as u8])
    })
}

fn folder_of(photographs: &[(&str, image::RgbImage)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, photograph) in photographs {
        photograph.save(folder.path().join(name)).expect("written");
    }
    folder
}

fn options(folder: &tempfile::TempDir, more: &str) -> String {
    format!("plate = {{ photographs = {:?}{more} }}", folder.path())
}

#[test]
fn a_photograph_passes_unchanged_where_objects_change_nothing() {
    let folder = folder_of(&[("a.png", photograph(SIZE))]);
    let light = |x: u32, y: u32| [10.0 + x as f32, 14.0, 9.0 + y as f32];
    for (tone, balance) in [("filmic", "none"), ("srgb", "auto"), ("linear", "gray_world")] {
        let parts = |x, y| Parts { foreground: [0.0; 3], opacity: 0.0, shadowed: light(x, y), empty: light(x, y) };
        let options = format!("tone = \"{tone}\"\nwhite_balance = \"{balance}\"\n{}", options(&folder, ""));
        for exposure in [FIXED, Exposure::Auto { compensation_ev: 0.5 }] {
            let view = view(SIZE, 20.0, exposure);
            let made = sense(&*sensor("rgb_camera", &options), &view, products(parts), 3, &Serial);
            let image = made.get(RGB).expect("made");
            assert_eq!(image.data().as_flattened(), photograph(SIZE).as_raw().as_slice(), "{tone}");
            assert_eq!(json(&made, "exposure")["plate"]["photograph"], "a.png");
        }
    }
}

#[test]
fn light_that_is_no_number_stays_in_its_pixel() {
    let folder = folder_of(&[("a.png", photograph(SIZE))]);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let parts = |light: f32| {
        move |x: u32, y: u32| {
            let is_bad = (x, y) == (8, 6);
            let foreground = if is_bad { [light; 3] } else { [0.0; 3] };
            Parts { foreground, opacity: if is_bad { 0.5 } else { 0.0 }, shadowed: [10.0; 3], empty: [10.0; 3] }
        }
    };
    let view = view(SIZE, 20.0, FIXED);
    let options = format!("blur = {{ sigma_px = 0.5 }}\n{}", options(&folder, ""));
    let image = |light| {
        let made = sense(&*sensor("rgb_camera", &options), &view, products(parts(light)), 3, &Serial);
        made.get(RGB).expect("made").clone()
    };
    let want = image(0.0);
    for light in bad {
        let got = image(light);
        let unlike = want.data().iter().zip(got.data()).filter(|(a, b)| a != b).count();
        // The blur reaches two pixels.
        assert!(unlike <= 25, "{light}: {unlike} pixels differ");
    }
}

/// Radiance of a plate: its codes as linear light, of a white of the exposure.
fn linear(white: f64, pixel: [u8; 3]) -> [f32; 3] {
    pixel.map(|code| (white * f64::from(code) / 255.0) as f32)
}

#[test]
fn stand_ins_catch_shadows_and_objects_cover_the_photograph() {
    let folder = folder_of(&[("a.png", photograph(SIZE))]);
    let front = [70.0, 20.0, 5.0];
    // From left to right: objects, their edges, shadows with a colored reflection, and nothing.
    let parts = |x: u32, _: u32| {
        let (opacity, ratio) = match x {
            0..4 => (1.0, [0.5; 3]),
            4..8 => (0.25, [0.5; 3]),
            8..12 => (0.0, [0.4, 0.5, 1.2]),
            _ => (0.0, [1.0; 3]),
        };
        let empty = [12.0, 16.0, 20.0];
        let shadowed = std::array::from_fn(|c| empty[c] * ratio[c]);
        Parts { foreground: front.map(|v: f32| v * opacity), opacity, shadowed, empty }
    };
    let view = view(SIZE, 20.0, FIXED);
    let rgb_camera = sensor("rgb_camera", &format!("tone = \"linear\"\n{}", options(&folder, "")));
    let made = sense(&*rgb_camera, &view, products(parts), 3, &Serial);
    let developer = Development::recorded(made.get(EXPOSURE).expect("made")).expect("by this sensor").developer();
    let white = json(&made, "exposure")["white_nits"].as_f64().expect("a number");
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let (it, plate) = (parts(x, y), linear(white, photograph(SIZE).get_pixel(x, y).0));
            let light: [f32; 3] = std::array::from_fn(|c| {
                front[c] * it.opacity + (1.0 - it.opacity) * plate[c] * it.shadowed[c] / it.empty[c]
            });
            let (want, got) = (developer.code(light), made.get(RGB).expect("made").at(x, y));
            assert!((0..3).all(|c| want[c].abs_diff(got[c]) <= 1), "({x}, {y}): {got:?}, not {want:?}");
        }
    }
}

#[test]
fn a_photograph_replaces_the_sky_behind_all_bodies() {
    let folder = folder_of(&[("a.png", photograph(SIZE))]);
    let (body, sky) = ([30.0, 8.0, 3.0], [900.0, 700.0, 800.0]);
    let opacity = |x: u32| [1.0, 0.75, 0.25, 0.0][(x / 4) as usize];
    let mut products = Products::new();
    let [width, height] = SIZE;
    let whole = Plane::from_fn(width, height, |x, _| {
        std::array::from_fn(|c| body[c] * opacity(x) + sky[c] * (1.0 - opacity(x)))
    });
    products.put(RADIANCE, whole).expect("first");
    products.put(OPACITY, Plane::from_fn(width, height, |x, _| opacity(x))).expect("first");
    products.put(RADIANCE.of_part(ScenePart::Background), Plane::from_fn(width, height, |_, _| sky)).expect("first");
    let camera = sensor("rgb_camera", &format!("tone = \"linear\"\n{}", options(&folder, ", behind = \"bodies\"")));
    let made = sense(&*camera, &view(SIZE, 20.0, FIXED), products, 3, &Serial);
    let white = json(&made, "exposure")["white_nits"].as_f64().expect("a number");
    let developer = Developer::new(syntable_sensor::rgb_camera::Tone::Linear, white, [1.0; 3]);
    for y in 0..height {
        for x in 0..width {
            let plate = linear(white, photograph(SIZE).get_pixel(x, y).0);
            let light = std::array::from_fn(|c| body[c] * opacity(x) + (1.0 - opacity(x)) * plate[c]);
            let (want, got) = (developer.code(light), made.get(RGB).expect("made").at(x, y));
            assert!((0..3).all(|c| want[c].abs_diff(got[c]) <= 1), "({x}, {y}): {got:?}, not {want:?}");
        }
    }
}

fn nothing_but_sky(_: u32, _: u32) -> Parts {
    Parts { foreground: [0.0; 3], opacity: 0.0, shadowed: [10.0; 3], empty: [10.0; 3] }
}

#[test]
fn photographs_fill_the_image_and_belong_to_their_views() {
    // Twice as large, with margins left and right that do not fit.
    let wide = image::RgbImage::from_fn(44, 24, |x, _| match x {
        0..6 | 38..44 => image::Rgb([255, 0, 0]),
        _ => image::Rgb([20, 90, 160]),
    });
    let plain = |code: u8| image::RgbImage::from_pixel(SIZE[0], SIZE[1], image::Rgb([code; 3]));
    let folder = folder_of(&[("b.jpg", plain(60)), ("a.png", wide), ("c.PNG", plain(200))]);
    std::fs::write(folder.path().join("readme.txt"), "no photograph").expect("written");
    let camera = sensor("rgb_camera", &options(&folder, ", order = \"by_view\""));
    let mut view = view(SIZE, 20.0, FIXED);
    let mut middle = |number: u32| {
        view.id.0 = number;
        let made = sense(&*camera, &view, products(nothing_but_sky), 3, &Serial);
        let image = made.get(RGB).expect("made");
        let all_alike = image.data().iter().all(|pixel| (0..3).all(|c| pixel[c].abs_diff(image.at(8, 6)[c]) <= 1));
        assert!(all_alike, "view {number}");
        image.at(8, 6)[0]
    };
    let shown = [middle(0), middle(1), middle(2)];
    assert!(shown[0] == 20 && shown[1].abs_diff(60) <= 1 && shown[2] == 200, "{shown:?}");
    // At random, every view draws its own.
    let camera = sensor("rgb_camera", &options(&folder, ""));
    let drawn: std::collections::BTreeSet<String> = (0..20)
        .map(|seed| json(&sense(&*camera, &view, products(nothing_but_sky), seed, &Serial), "exposure"))
        .map(|exposure| exposure["plate"]["photograph"].to_string())
        .collect();
    assert_eq!(drawn.len(), 3, "{drawn:?}");
}

#[test]
fn missing_photographs_are_named() {
    let folder = folder_of(&[]);
    let found = |options: &str| sensor("rgb_camera", options).found(3).err().map(|error| error.to_string());
    let message = found(&options(&folder, "")).expect("no photograph");
    assert!(message.contains("the folder has no photograph"), "{message}");
    assert!(found("plate = { photographs = \"/nowhere/at/all\" }").is_some_and(|it| it.contains("/nowhere/at/all")));
    assert!(found("plate = {}").is_none());
    let folder = folder_of(&[("1.png", photograph(SIZE)), ("2.png", photograph(SIZE))]);
    assert!(found(&options(&folder, "")).is_none());
    let message = found(&options(&folder, ", order = \"by_view\"")).expect("too few");
    assert!(message.contains("view 2 has no photograph: the folder has 2"), "{message}");
    let message = refusal("rgb_camera", "plate = { order = \"by_view\" }");
    assert!(message.contains("`plate.photographs` is not set"), "{message}");
    let message = refusal("rgb_camera", "plate = { photograph = \"a\" }");
    assert!(message.contains("`photograph`"), "{message}");
}
