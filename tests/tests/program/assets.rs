//! Files of assets: `check --asset` on bad and odd inputs, which behave as their names say, and changed files.

use crate::support::{SMALL, assets, fails, ok, root, syntable, text};
use std::path::Path;

#[test]
fn broken_inputs_behave_as_their_names_say() {
    let mut wrong = Vec::new();
    let mut seen = 0;
    let folders: Vec<_> =
        assets().iter().map(|folder| folder.join("broken")).filter(|folder| folder.is_dir()).collect();
    for entry in folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("readable")) {
        let path = entry.expect("readable").path();
        let name = path.file_name().expect("named").to_string_lossy().into_owned();
        let want = match name.split('_').next() {
            // The mesh can do without such a face.
            _ if name == "reject_face_with_two_vertices" => (0, Some(true)),
            Some("reject") => (2, None),
            Some("warn") => (0, Some(true)),
            Some("accept") => (0, Some(false)),
            _ => continue,
        };
        seen += 1;
        let output = syntable().args(["check", "--asset"]).arg(&path).output().expect("starts");
        let said = text(&output);
        let warned = said.contains("warning:");
        let right = output.status.code() == Some(want.0)
            && want.1.is_none_or(|want| want == warned)
            && !said.contains("panicked")
            && (want.0 == 0 || said.lines().any(|line| line.starts_with("error:") && line.contains(&name)));
        if !right {
            wrong.push(format!("{name}: exit {:?}\n{said}", output.status.code()));
        }
    }
    assert_eq!(seen, 99 * folders.len(), "inputs in {folders:?}");
    assert!(wrong.is_empty(), "{} of {seen} are wrong:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn whole_pools_are_checked() {
    let folder = tempfile::tempdir().expect("temp folder");
    let fixtures = assets()[0].join("broken");
    for (from, to) in [
        ("accept_box.glb", "good/box.glb"),
        ("accept_big_endian.ply", "good/box.ply"),
        ("accept_box.glb", "mixed/box.glb"),
        ("reject_garbage.glb", "mixed/garbage.glb"),
        ("reject_truncated.glb", "mixed/truncated.glb"),
    ] {
        let to = folder.path().join(to);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("writable");
        std::fs::copy(fixtures.join(from), to).expect("copied");
    }
    let recipe = folder.path().join("my.toml");
    let text_of = "extends = \"builtin:quickstart\"\n[assets.good]\nkind = \"mesh_folder\"\nroot = \"good\"\n\
        [assets.mixed]\nkind = \"mesh_folder\"\nroot = \"mixed\"\n";
    std::fs::write(&recipe, text_of).expect("writable");
    let check = |more: &str| {
        let output = syntable().arg("check").arg(more).arg(&recipe).output().expect("starts");
        (output.status.code(), text(&output))
    };
    let (code, said) = check("--assets=good");
    assert!(code == Some(0) && said.contains("assets.good: 1 of 1 assets are good"), "{said}");
    assert!(!said.contains("assets.mixed:"), "{said}");
    let (code, said) = check("--assets=mixed");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("assets.mixed: 1 of 3 assets are good\n  bad: garbage\n  bad: truncated\n"), "{said}");
    assert!(said.contains("2 of 3 assets are bad") && said.contains("not a valid GLB"), "{said}");
    let (code, said) = check("--assets=none");
    assert!(code == Some(2) && said.contains("unknown pool `none`"), "{said}");
}

#[test]
fn an_asset_is_described_and_a_missing_one_named() {
    let output = syntable().args(["check", "--asset", "no/such/model.obj"]).output().expect("starts");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output).contains("no/such/model.obj"), "{}", text(&output));
    let output = syntable().args(["check", "--asset", "nothere"]).output().expect("starts");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output).contains("nothere: no such file or folder"), "{}", text(&output));
    let output = syntable().args(["check", "--asset", "README.md"]).output().expect("starts");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output).contains("no known kind of asset") && text(&output).contains("OBJ"), "{}", text(&output));
}

#[test]
fn the_lock_covers_the_materials_of_a_placed_mesh() {
    let folder = tempfile::tempdir().expect("temp folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("writable");
    write(
        "shelf.obj",
        "mtllib shelf.mtl\nusemtl oak\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    );
    let color = |color: &str| write("shelf.mtl", &format!("newmtl oak\nKd {color}\n"));
    color("0.8 0.1 0.1");
    write("beside.txt", "no part of the mesh");
    let quickstart = std::fs::read_to_string(root().join("recipes/quickstart.toml")).expect("there");
    let shelf = "\n[[place]]\nid = \"shelf\"\nkind = \"mesh\"\npath = \"shelf.obj\"\nposition_m = [0, 0, 1.5]\n";
    write("my.toml", &(quickstart + shelf));
    let (recipe, out) = (folder.path().join("my.toml"), folder.path().join("out"));
    let run = |recipe: &Path, out: &Path, scenes: u32| {
        let mut command = syntable();
        command.arg("run").arg(recipe).arg("--out").arg(out).args(SMALL);
        command.args(["--set", &format!("dataset.scenes={scenes}")]);
        command
    };
    ok(&mut run(&recipe, &out, 1));
    // A file that the mesh does not name may change.
    write("beside.txt", "still no part of the mesh");
    ok(&mut run(&recipe, &out, 2));
    color("0.1 0.1 0.8");
    let changed =
        "the file or folder of `place.shelf.path` has changed since the dataset began, or a file that it names";
    let said = fails(&mut run(&recipe, &out, 3), 2);
    assert!(said.contains(changed), "{said}");
    let resolved = folder.path().join("resolved.toml");
    std::fs::copy(out.join("recipe.toml"), &resolved).expect("copied");
    let said = fails(&mut run(&resolved, &folder.path().join("again"), 1), 2);
    assert!(said.contains(changed), "{said}");
    color("0.8 0.1 0.1");
    ok(&mut run(&recipe, &out, 3));
}
