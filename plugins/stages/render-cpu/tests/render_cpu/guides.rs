//! Guides for denoisers.

use super::images::{busy_scene, texture};
use super::support::*;
use std::sync::Arc;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::scene::{Color, Encoding, Light, Material, RectLight, Role, Scalar};

type Guide = Key<Plane<[f32; 3]>>;

/// A mirror that shows a small scene with many details, from below.
fn mirror_scene() -> (Arc<Scene>, View) {
    let silver = Material { metallic: Scalar::constant(1.0), ..Material::plain("silver", [0.9, 0.8, 0.7], 0.0) };
    let red = Material::plain("red", [0.8, 0.1, 0.1], 0.9);
    let green = Material::plain("green", [0.1, 0.7, 0.2], 0.9);
    let scene = scene([
        body(&object("ball", ball(0.1, 24), red), at(-0.2, 0.2, 0.35), Role::Object),
        body(&object("box", cuboid([0.1, 0.05, 0.12]), green), at(0.2, 0.15, 0.3), Role::Object),
        body(&object("mirror", sheet([1.5, 1.5]), silver), at(0.0, 0.0, 0.0), Role::Support),
        body(&object("wall", cuboid([2.0, 0.05, 2.0]), matte(0.4)), at(0.0, 1.6, 0.0), Role::Room),
    ]);
    let panel = RectLight {
        center: Point3::new(0.0, 0.0, 2.0),
        half_u: Vector3::new(0.0, 0.4, 0.0),
        half_v: Vector3::new(0.4, 0.0, 0.0),
        radiance: [40.0; 3],
    };
    (scene, view(48, 36, 40.0, [0.0, -1.2, 0.6], [0.0, 0.2, 0.1], vec![Light::Rect(panel)]))
}

/// Root of the mean squared difference. The outermost pixels do not count: they lack neighbors to differ from.
fn difference(a: &Plane<[f32; 3]>, b: &Plane<[f32; 3]>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for y in 1..a.height() - 1 {
        for x in 1..a.width() - 1 {
            let pixel = (y * a.width() + x) as usize;
            sum += (0..3).map(|c| f64::from(a.data()[pixel][c] - b.data()[pixel][c]).powi(2)).sum::<f64>();
            count += 3;
        }
    }
    (sum / f64::from(count)).sqrt()
}

/// A floor of two colors in checks under a panel, which fills the image.
fn checked_floor() -> (Arc<Scene>, View) {
    let checks = texture(16, 16, Encoding::Srgb, |x, y| {
        if (x / 4 + y / 4) % 2 == 0 { [230, 200, 40, 255] } else { [120, 90, 60, 255] }
    });
    let checked =
        Material { base_color: Color::texture(checks), tile_m: 1.0, ..Material::plain("checked", [1.0; 3], 0.6) };
    let floor = body(&object("floor", sheet([2.0, 2.0]), checked), at(0.0, 0.0, 0.0), Role::Object);
    let panel = RectLight {
        center: Point3::new(0.5, 0.0, 1.5),
        half_u: Vector3::new(0.0, 0.2, 0.0),
        half_v: Vector3::new(0.2, 0.0, 0.0),
        radiance: [40.0; 3],
    };
    (scene([floor]), view(40, 30, 40.0, [0.0, -0.8, 1.0], [0.0, 0.0, 0.0], vec![Light::Rect(panel)]))
}

#[test]
fn they_are_clean_from_one_sample_on() {
    let guides: [(Guide, Guide); 2] = [(DENOISE_ALBEDO, ALBEDO), (DENOISE_NORMAL, NORMAL)];
    for (name, (scene, view), center) in [("busy", busy_scene(), true), ("mirror", mirror_scene(), false)] {
        let wants: Vec<KeyId> = guides.iter().flat_map(|(mean, center)| [mean.id(), center.id()]).collect();
        let true_ones = render(options(512, 1), &scene, &view, &wants);
        let few = render(options(1, 1), &scene, &view, &wants);
        let seven = render(options(7, 1), &scene, &view, &wants);
        let eight = render(options(8, 1), &scene, &view, &wants);
        for (mean, one) in guides {
            let truth = true_ones.get(mean).expect("made");
            let error = |frame: &Products| difference(frame.get(mean).expect("made"), truth);
            // A single ray per pixel, as for labels, is all that one path would have; it does not follow mirrors.
            let alone = difference(few.get(one).expect("made"), truth);
            let told = format!(
                "{name}, {}: {} {} {}, one ray: {alone}",
                mean.name(),
                error(&few),
                error(&seven),
                error(&eight)
            );
            assert!(error(&few) < 1.4 * error(&eight) + 0.002, "as good as eight samples: {told}");
            assert!(error(&seven) < 1.2 * error(&eight) + 0.002, "no worse with more: {told}");
            assert!(!center || error(&few) < 0.45 * alone, "{told}");
        }
    }
}

#[test]
fn a_mirror_has_the_color_of_what_it_shows() {
    let (scene, view) = mirror_scene();
    let frame = render(options(1, 1), &scene, &view, &[DENOISE_ALBEDO.id(), INSTANCE.id()]);
    let (albedo, ids) = (frame.get(DENOISE_ALBEDO).expect("made"), frame.get(INSTANCE).expect("made"));
    let mirror = scene.bodies().iter().find(|body| body.role == Role::Support).expect("there").id;
    let shown: Vec<&[f32; 3]> =
        albedo.data().iter().zip(ids.data()).filter(|(_, id)| **id == mirror).map(|(albedo, _)| albedo).collect();
    // The wall's gray of 0.4, and the colors of the balls, times the color of silver.
    for color in [[0.36, 0.32, 0.28], [0.72, 0.08, 0.07], [0.09, 0.56, 0.14]] {
        let alike = |albedo: &&&[f32; 3]| (0..3).all(|c| (albedo[c] - color[c]).abs() < 0.01);
        assert!(shown.iter().filter(alike).count() > 10, "{color:?} is not to be seen in the mirror");
    }
}

#[test]
fn the_light_does_not_know_of_them() {
    let (scene, view) = busy_scene();
    let alone = render(options(2, 4), &scene, &view, &[RADIANCE.id()]);
    let guided = render(options(2, 4), &scene, &view, &[RADIANCE.id(), DENOISE_ALBEDO.id(), RADIANCE_DEMODULATED.id()]);
    assert!(alone.get(RADIANCE).expect("made") == guided.get(RADIANCE).expect("made"));
}

#[test]
fn demodulated_light_has_no_texture_and_makes_the_image_with_it() {
    let (scene, view) = checked_floor();
    let wants = [RADIANCE.id(), RADIANCE_SPECULAR.id(), RADIANCE_DEMODULATED.id(), DENOISE_ALBEDO.id()];
    let frame = render(options(256, 1), &scene, &view, &wants);
    let of = |key: Guide| frame.get(key).expect("made").data();
    let (mut edges, mut contrast) = (0, [0.0_f64; 2]);
    for pixel in 0..of(RADIANCE).len() {
        let albedo = of(DENOISE_ALBEDO)[pixel];
        // At an edge, uneven light makes the mean of products differ from the product of means.
        let whole: [f32; 3] = std::array::from_fn(|c| {
            of(RADIANCE_DEMODULATED)[pixel][c] * (albedo[c] + DEMODULATION_EPSILON) + of(RADIANCE_SPECULAR)[pixel][c]
        });
        let radiance = of(RADIANCE)[pixel];
        let near =
            whole.iter().zip(radiance).all(|(whole, radiance)| (whole - radiance).abs() < 0.02 * radiance + 0.001);
        assert!(near, "{whole:?}, not {radiance:?}");
        if pixel % 40 > 0 && (albedo[0] - of(DENOISE_ALBEDO)[pixel - 1][0]).abs() > 0.05 {
            let step = |key: Guide| f64::from(of(key)[pixel][0] / of(key)[pixel - 1][0]).ln().abs();
            contrast = [contrast[0] + step(RADIANCE_DEMODULATED), contrast[1] + step(RADIANCE)];
            edges += 1;
        }
    }
    // The remaining contrast is the change of the light itself, and of the epsilon that avoids a division by 0.
    assert!(edges > 50 && contrast[0] < 0.2 * contrast[1], "{edges} edges, contrasts {contrast:?}");
}
