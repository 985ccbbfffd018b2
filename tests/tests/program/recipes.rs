//! Every shipped recipe loads, plans, and passes the checkers that editors use; broken recipes fail there, too.

use crate::support::{assets, ok, root, skip, syntable, text};
use std::path::{Path, PathBuf};
use std::process::Command;
use syntable_testing::tools::skip_slow_tool;

/// All recipes of the checkout from which users start.
fn shipped() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root().join("recipes")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(found.len() >= 4, "{found:?}");
    found.push(root().join("core/cli/src/verbs/scaffold/recipe.toml"));
    found
}

#[test]
fn shipped_recipes_plan() {
    for recipe in shipped() {
        let plan = ok(syntable().arg("plan").arg(&recipe).env("ASSETS", "/assets"));
        assert!(plan.contains("annotate.masks"), "{}\n{plan}", recipe.display());
    }
}

#[test]
fn shipped_recipes_find_real_assets() {
    for assets in assets() {
        for recipe in shipped() {
            let output = syntable().arg("check").arg(&recipe).env("ASSETS", &assets).output().expect("starts");
            let said = text(&output);
            // Assets may have faults, but recipes may not.
            let sound = said.contains("no errors; ") && !said.contains("warning[");
            assert!(output.status.success() && sound, "{}\n{said}", recipe.display());
        }
    }
}

/// Mistakes that an editor shows during typing, each made in the quickstart recipe.
fn broken(folder: &Path) -> Vec<PathBuf> {
    let good = std::fs::read_to_string(root().join("recipes/quickstart.toml")).expect("there");
    let mistakes = [
        ("unknown_key", "samples_per_pixel", "sampels_per_pixel"),
        ("unknown_kind", "kind = \"drop_box\"", "kind = \"dropbox\""),
        ("wrong_type", "scenes = 2", "scenes = \"two\""),
        ("out_of_range", "samples_per_pixel = 8", "samples_per_pixel = 0"),
        ("unknown_section", "[views]", "[viewss]"),
        ("missing_scenes", "scenes = 2", ""),
    ];
    mistakes
        .into_iter()
        .map(|(name, from, to)| {
            assert!(good.contains(from), "the quickstart recipe has no `{from}`");
            let path = folder.join(format!("{name}.toml"));
            std::fs::write(&path, good.replace(from, to)).expect("writable");
            path
        })
        .collect()
}

/// Checks recipes with the command that `run` returns. Valid recipes are checked together, since each command reads the
/// schema again.
fn check_with(tool: &str, run: impl Fn(&[PathBuf]) -> Command) {
    if !Command::new(tool).arg("--version").output().is_ok_and(|output| output.status.success()) {
        // CI installs tombi; taplo takes minutes.
        return if tool == "taplo" { skip_slow_tool(tool) } else { skip(tool) };
    }
    let passes = |recipes: &[PathBuf]| {
        let output = run(recipes).output().expect("starts");
        (output.status.success(), text(&output))
    };
    let (good, said) = passes(&shipped());
    assert!(good, "{tool} refuses a shipped recipe:\n{said}");
    let folder = tempfile::tempdir().expect("a folder");
    for recipe in broken(folder.path()) {
        let (good, _) = passes(std::slice::from_ref(&recipe));
        assert!(!good, "{tool} accepts {}", recipe.display());
        let ours = syntable().arg("check").arg(&recipe).output().expect("starts");
        assert_eq!(ours.status.code(), Some(2), "we accept {}", recipe.display());
    }
}

#[test]
fn taplo_agrees() {
    let schema = format!("file://{}", root().join("schemas/recipe.schema.json").display());
    check_with("taplo", |recipes| {
        let mut taplo = Command::new("taplo");
        taplo.args(["check", "--schema", &schema]).args(recipes);
        taplo
    });
}

#[test]
fn tombi_agrees() {
    let schema = root().join("schemas/recipe.schema.json");
    let folder = tempfile::tempdir().expect("a folder");
    check_with("tombi", |recipes| {
        // The schema named by the recipe's own `#:schema` line is used, wherever the file lies.
        let copies = recipes.iter().enumerate().map(|(number, recipe)| {
            let body = std::fs::read_to_string(recipe).expect("readable");
            let body: Vec<&str> = body.lines().filter(|line| !line.starts_with("#:schema")).collect();
            let copy = folder.path().join(format!("{number}.toml"));
            let text = format!("#:schema {}\n{}\n", schema.display(), body.join("\n"));
            std::fs::write(&copy, text).expect("writable");
            copy
        });
        let mut tombi = Command::new("tombi");
        tombi.args(["lint", "--offline"]).args(copies);
        tombi
    });
}
