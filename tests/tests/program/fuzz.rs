//! Replays the stored inputs of fuzzing: passes every input in `tests/fuzz/corpus` to the function of its target.
//! `.ci/fuzz` searches for new inputs, also with overflow checks.

#[path = "../../fuzz/src/targets.rs"]
mod targets;

use crate::support::{files, root};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[test]
fn stored_inputs_are_read_or_refused() {
    let corpus = root().join("tests/fuzz/corpus");
    let mut failed = Vec::new();
    for (name, target) in targets::TARGETS {
        let inputs = files(&corpus.join(name));
        assert!(!inputs.is_empty(), "no input of {name}");
        for (input, bytes) in inputs {
            if catch_unwind(AssertUnwindSafe(|| target(&bytes))).is_err() {
                failed.push(format!("{name}/{input}"));
            }
        }
    }
    let _ = std::fs::remove_dir_all(targets::folder());
    assert_eq!(failed, Vec::<String>::new());
}

#[test]
fn every_target_has_a_binary_and_a_corpus() {
    let names: Vec<&str> = targets::TARGETS.iter().map(|(name, _)| *name).collect();
    let manifest = std::fs::read_to_string(root().join("tests/fuzz/Cargo.toml")).expect("a manifest");
    let manifest: toml::Table = manifest.parse().expect("TOML");
    let binaries = manifest["bin"].as_array().expect("binaries");
    assert_eq!(binaries.iter().filter_map(|binary| binary["name"].as_str()).collect::<Vec<_>>(), names);
    for name in &names {
        let source = root().join(format!("tests/fuzz/fuzz_targets/{name}.rs"));
        let source = std::fs::read_to_string(source).expect("a source");
        assert!(source.contains(&format!("targets::{name}(input)")), "{name}: {source}");
    }
    let folders: BTreeSet<String> = std::fs::read_dir(root().join("tests/fuzz/corpus"))
        .expect("readable")
        .map(|entry| entry.expect("readable"))
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().into_string().expect("a name"))
        .collect();
    assert_eq!(folders, names.iter().map(|name| (*name).to_owned()).collect());
}
