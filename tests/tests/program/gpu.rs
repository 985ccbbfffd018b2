//! Whole recipes on a graphics card, or on Mesa's lavapipe instead, compared with the CPU renderer: cameras with lens
//! and distortion, all kinds of lights, floors that show their environment, scanned and procedural materials.

use crate::support::{SMALL, fails, ok, root, skip, syntable};
use std::path::{Path, PathBuf};

/// Features of the shipped recipes that the gallery lacks.
const GROUND: &str = r#"
extends = "builtin:open-sky"

[dataset]
scenes = 1
views_per_scene = 1

[[place]]
kind = "ground"

[[place]]
kind = "table"
from = ["tables"]

[[place]]
kind = "drop_box"
id = "objects"
from = ["objects"]
count = 6
"#;

/// Elements of a NumPy file with `N` bytes each.
fn numbers<const N: usize>(path: &Path) -> Vec<[u8; N]> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[10 + header..].as_chunks().0.to_vec()
}

fn luminance(path: &Path) -> Vec<f64> {
    let numbers: Vec<f64> = numbers(path).into_iter().map(|x| f64::from(f32::from_le_bytes(x))).collect();
    numbers.chunks(3).map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]).collect()
}

fn run(recipe: &Path, out: &Path, kind: &str, denoiser: &str, include: &[&str]) {
    let mut command = syntable();
    command.arg("run").arg(recipe).arg("--out").arg(out).args(["--views", "1"]);
    for set in [
        "dataset.scenes=1",
        "camera.resolution=[80, 60]",
        "render.samples_per_pixel=8",
        &format!("denoise.kind=\"{denoiser}\""),
        &format!("write={{ npy = {{ include = {include:?} }} }}"),
        &format!("render.kind=\"{kind}\""),
    ] {
        command.args(["--set", set]);
    }
    ok(&mut command);
}

/// Whether an adapter exists. Prints its name.
fn has_adapter() -> bool {
    let doctor = ok(syntable().arg("doctor"));
    let line = doctor.lines().find(|line| line.trim().starts_with("gpu_path")).expect("the stock program has it");
    println!("{}", line.trim());
    !line.contains("no graphics adapter")
}

#[test]
fn recipes_look_as_on_the_processor() {
    if !has_adapter() {
        return skip("a graphics adapter, such as mesa-vulkan-drivers,");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let ground = folder.path().join("ground.toml");
    std::fs::write(&ground, GROUND).expect("writable");
    let gallery =
        ["camera/pinhole.distortion", "camera/pinhole.lens", "lights/environment", "lights/sun", "assets/mesh_folder"];
    let gallery = gallery.map(|name| root().join(format!("book/gallery/{name}.toml")));
    let shipped = ["window-room", "clutter"].map(|name| root().join(format!("recipes/{name}.toml")));
    for recipe in gallery.iter().chain(&shipped).chain([&ground]) {
        let name = recipe.file_stem().expect("named").to_string_lossy().into_owned();
        let outs: [PathBuf; 2] = ["cpu_path", "gpu_path"].map(|kind| {
            let out = folder.path().join(format!("{name}.{kind}"));
            run(recipe, &out, kind, "none", &["radiance", "instance", "albedo"]);
            out
        });
        let of = |product: &str| outs.each_ref().map(|out| out.join(format!("npy/{product}/000000_0000.npy")));
        let [a, b] = of("instance").map(|path| numbers::<2>(&path));
        let other = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        let [a, b] = of("albedo").map(|path| luminance(&path));
        let albedo = a.iter().zip(&b).filter(|(a, b)| (**a - **b).abs() > 2e-3).count();
        let [a, b] = of("radiance").map(|path| luminance(&path));
        let ratio = b.iter().sum::<f64>() / a.iter().sum::<f64>();
        let far = a.iter().zip(&b).filter(|(a, b)| (**a - **b).abs() > 2e-3 * **a).count();
        println!("{name}: {other} instances, {albedo} albedos and {far} radiances of {} differ; {ratio:.5}", a.len());
        assert!(other <= 1 && albedo * 200 <= a.len() && far * 20 <= a.len(), "{name}: {other} {albedo} {far}");
        assert!((ratio - 1.0).abs() < 5e-3, "{name}: ratio of means {ratio}");
    }
}

#[test]
fn images_are_denoised_where_they_are_rendered() {
    if !has_adapter() {
        return skip("a graphics adapter, such as mesa-vulkan-drivers,");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = root().join("recipes/window-room.toml");
    let radiance = |name: &str, kind: &str, include: &[&str]| {
        let out = folder.path().join(name);
        run(&recipe, &out, kind, "guided", include);
        luminance(&out.join("npy/radiance/000000_0000.npy"))
    };
    let on_card = radiance("card", "gpu_path", &["radiance"]);
    // Additional products of the image do not matter, nor does missing depth.
    let with_guides =
        radiance("guides", "gpu_path", &["radiance", "radiance_noisy", "denoise_normal", "depth", "radiance_variance"]);
    assert_eq!(on_card, with_guides);
    let noisy = luminance(&folder.path().join("guides/npy/radiance_noisy/000000_0000.npy"));
    let changed = on_card.iter().zip(&noisy).filter(|(a, b)| (**a - **b).abs() > 0.02 * **b).count();
    assert!(changed * 2 > noisy.len(), "{changed} pixels were denoised");
    let on_processor = radiance("processor", "cpu_path", &["radiance"]);
    let far = on_card.iter().zip(&on_processor).filter(|(a, b)| (**a - **b).abs() > 0.02 * **b).count();
    let ratio = on_card.iter().sum::<f64>() / on_processor.iter().sum::<f64>();
    println!("{far} radiances of {} differ by more than 2 %; {ratio:.5}", on_card.len());
    assert!(far * 50 <= on_card.len() && (ratio - 1.0).abs() < 2e-3, "{far}, {ratio}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_without_an_adapter_stops_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = syntable();
    command
        .args(["run", "builtin:quickstart", "--set", "render.kind=\"gpu_path\"", "--out"])
        .arg(folder.path().join("out"));
    // A Vulkan loader that finds no driver.
    command.env("VK_DRIVER_FILES", "/nowhere.json").env("VK_ICD_FILENAMES", "/nowhere.json");
    let text = fails(&mut command, 2);
    assert!(text.contains("no graphics adapter") && text.contains("cpu_path"), "{text}");
    assert!(!folder.path().join("out").exists(), "nothing was begun");
}

/// A small run without a card, with settings, and the dataset's recipe.
#[cfg(target_os = "linux")]
fn without_card(out: &Path, set: &[&str], library: Option<&str>) -> (std::process::Command, PathBuf) {
    let mut command = syntable();
    command.args(["run", "builtin:quickstart", "--scenes", "0"]).args(SMALL).arg("--out").arg(out);
    for set in set {
        command.args(["--set", set]);
    }
    command.env("VK_DRIVER_FILES", "/nowhere.json").env("VK_ICD_FILENAMES", "/nowhere.json");
    match library {
        Some(library) => command.env("OIDN_LIBRARY", library),
        None => command.env_remove("OIDN_LIBRARY"),
    };
    (command, out.join("recipe.toml"))
}

#[test]
#[cfg(target_os = "linux")]
fn what_auto_chose_is_named_by_the_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let [auto, named] = [("auto", "auto"), ("named", "cpu_path")].map(|(name, kind)| {
        let (mut command, recipe) =
            without_card(&folder.path().join(name), &[&format!("render.kind=\"{kind}\"")], None);
        let said = crate::support::text(&command.output().expect("it starts"));
        assert_eq!(said.contains("[render] `auto` is `cpu_path` here: no graphics adapter"), kind == "auto", "{said}");
        std::fs::read_to_string(recipe).unwrap_or_else(|error| panic!("{error}: {said}"))
    });
    assert_eq!(auto, named);
    let denoise = ["denoise.kind=\"auto\""];
    let (mut command, recipe) = without_card(&folder.path().join("found"), &denoise, None);
    ok(&mut command);
    let recipe: toml::Table = std::fs::read_to_string(recipe).expect("there").parse().expect("TOML");
    let kind = recipe["denoise"]["kind"].as_str().expect("named");
    assert!(["guided", "oidn"].contains(&kind), "{kind}");
    // A library that the user named explicitly is not replaced.
    let (mut command, recipe) = without_card(&folder.path().join("lost"), &denoise, Some("/nowhere/library.so"));
    let said = fails(&mut command, 2);
    assert!(said.contains("`auto`: /nowhere/library.so") && said.contains("OIDN_LIBRARY"), "{said}");
    assert!(!recipe.exists(), "something was begun");
}
