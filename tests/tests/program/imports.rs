//! Imports inside a crate: files form layers, so that each file can be read after the files below it.

use crate::support::root;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A module, as the names on its path from the crate's root.
type Module = Vec<String>;

/// The files of a crate by module, each as its code without comments and tests.
fn files(folder: &Path, module: &Module, found: &mut BTreeMap<Module, String>) {
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        let stem = path.file_stem().expect("named").to_string_lossy().into_owned();
        let inside = || [module.as_slice(), std::slice::from_ref(&stem)].concat();
        if path.is_dir() && stem != "tests" && stem != "scaffold" {
            files(&path, &inside(), found);
        } else if path.extension().is_some_and(|extension| extension == "rs") && stem != "tests" {
            let module = if ["lib", "mod"].contains(&stem.as_str()) { module.clone() } else { inside() };
            let text = fs::read_to_string(&path).expect("readable");
            let code: Vec<&str> = text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
            let code = code.join("\n");
            found.insert(module, code.split("#[cfg(test)]\nmod ").next().unwrap_or_default().to_owned());
        }
    }
}

/// The paths of a `use` tree: `a::{b, c::{d, e}}` has three.
fn paths_of(tree: &str) -> Vec<String> {
    let tree = tree.trim();
    let Some((before, rest)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let inner = rest.rsplit_once('}').map_or(rest, |(inner, _)| inner);
    let (mut depth, mut start, mut branches) = (0, 0, Vec::new());
    for (at, letter) in inner.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                branches.push(&inner[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    branches.push(&inner[start..]);
    let branches = branches.into_iter().filter(|branch| !branch.trim().is_empty());
    branches.flat_map(paths_of).map(|path| format!("{before}{path}")).collect()
}

/// The paths in code, and whether each one is re-exported.
fn named_paths(code: &str) -> Vec<(String, bool)> {
    let mut found = Vec::new();
    let mut rest = String::new();
    for statement in code.split_inclusive(';') {
        let at = statement.find("use ").filter(|&at| {
            let before = statement[..at].trim_end();
            before.is_empty() || before.ends_with(['\n', '}', '{', ']', ')']) || before.ends_with("pub")
        });
        match at {
            Some(at) if statement[at..].trim_start_matches("use ").starts_with(|c: char| c.is_alphabetic()) => {
                let public = statement[..at].trim_end().ends_with("pub") || statement[..at].trim_end().ends_with(')');
                let tree = statement[at + 4..].trim_end_matches(';');
                found.extend(paths_of(tree).into_iter().map(|path| (path, public)));
                rest.push_str(&statement[..at]);
            }
            _ => rest.push_str(statement),
        }
    }
    // Paths in code, such as `crate::wall::refuse(table)`.
    for start in ["crate::", "super::"] {
        for (at, _) in rest.match_indices(start) {
            let end = rest[at..]
                .find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'))
                .map_or(rest.len(), |n| at + n);
            // `$crate::` in a macro refers to the crate that expands it, and `pub(in crate::run)` does not name code.
            let before = &rest[..at];
            let fresh =
                !before.ends_with(|c: char| c.is_alphanumeric() || "_:$".contains(c)) && !before.ends_with("(in ");
            if fresh {
                found.push((rest[at..end].trim_end_matches(':').to_owned(), false));
            }
        }
    }
    found
}

/// The module that a path refers to from `module`, and the name inside it; none for a path of another crate.
fn target(modules: &BTreeMap<Module, String>, module: &Module, path: &str) -> Option<(Module, String)> {
    let mut names = path.split("::").map(str::trim).peekable();
    let mut current = module.clone();
    match *names.peek()? {
        "crate" => {
            names.next();
            current = Module::new();
        }
        "self" => {
            names.next();
        }
        "super" => {}
        first => {
            // A child module, as in `pub use child::Name`.
            modules.get(&[module.as_slice(), &[first.to_owned()]].concat())?;
        }
    }
    while names.next_if(|name| *name == "super").is_some() {
        current.pop();
    }
    while let Some(name) = names.peek() {
        let inside = [current.as_slice(), &[(*name).to_owned()]].concat();
        if !modules.contains_key(&inside) {
            break;
        }
        current = inside;
        names.next();
    }
    Some((current, names.next().unwrap_or_default().to_owned()))
}

/// Imports between the files of a crate. A name that a module re-exports counts as imported from the file that defines
/// it, and a re-export is not an import.
fn imports(modules: &BTreeMap<Module, String>) -> BTreeMap<&Module, BTreeSet<Module>> {
    let paths: BTreeMap<&Module, Vec<(String, bool)>> =
        modules.iter().map(|(module, code)| (module, named_paths(code))).collect();
    let mut exports: BTreeMap<(Module, String), Module> = BTreeMap::new();
    for (module, paths) in &paths {
        for (path, _) in paths.iter().filter(|(_, public)| *public) {
            if let Some((file, name)) = target(modules, module, path).filter(|(file, _)| file != *module) {
                exports.insert(((*module).clone(), name), file);
            }
        }
    }
    let edges = paths.iter().map(|(module, paths)| {
        let private = paths.iter().filter(|(_, public)| !public);
        let found = private.filter_map(|(path, _)| {
            let (mut file, name) = target(modules, module, path)?;
            for _ in 0..4 {
                match exports.get(&(file.clone(), name.clone())) {
                    Some(source) => file = source.clone(),
                    None => break,
                }
            }
            (file != **module).then_some(file)
        });
        (*module, found.collect())
    });
    edges.collect()
}

/// Files that import each other, directly or through others: one list per cycle.
fn circles(edges: &BTreeMap<&Module, BTreeSet<Module>>) -> BTreeSet<BTreeSet<Module>> {
    let reached = |from: &Module| -> BTreeSet<Module> {
        let (mut seen, mut left) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = left.pop() {
            for next in edges.get(&module).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    left.push(next.clone());
                }
            }
        }
        seen
    };
    let all: BTreeMap<&Module, BTreeSet<Module>> = edges.keys().map(|module| (*module, reached(module))).collect();
    let in_circle = all.iter().filter(|(module, reached)| reached.contains(**module));
    let circle = in_circle.map(|(module, reached)| {
        reached.iter().filter(|other| all.get(other).is_some_and(|back| back.contains(*module))).cloned().collect()
    });
    circle.collect()
}

#[test]
fn files_of_a_crate_do_not_import_each_other_in_circles() {
    let example: BTreeMap<Module, String> = [
        ("", "pub use low::Low;"),
        ("low", "pub struct Low; use crate::high::{self, inner::{A, B}};"),
        ("high", "use super::Low; use std::fmt;"),
        ("alone", "use crate::Low;\nfn f() { crate::high::g() }"),
    ]
    .into_iter()
    .map(|(name, code)| (name.split('/').filter(|part| !part.is_empty()).map(str::to_owned).collect(), code.to_owned()))
    .collect();
    let circle = |names: &[&str]| -> BTreeSet<Module> { names.iter().map(|name| vec![(*name).to_owned()]).collect() };
    assert_eq!(circles(&imports(&example)), BTreeSet::from([circle(&["low", "high"])]));

    let (mut found, mut seen) = (Vec::new(), 0);
    for folder in super::architecture::crate_folders() {
        let mut modules = BTreeMap::new();
        files(&folder.join("src"), &Module::new(), &mut modules);
        seen += modules.len();
        let name = folder.strip_prefix(root()).expect("inside").display();
        let circles = circles(&imports(&modules)).into_iter();
        found.extend(circles.map(|circle| {
            let files: Vec<String> = circle.iter().map(|module| module.join("/")).collect();
            format!("{name}: {}", files.join(", "))
        }));
    }
    assert!(seen > 500, "{seen} files");
    assert!(found.is_empty(), "{} circles of imports:\n{}", found.len(), found.join("\n"));
}
