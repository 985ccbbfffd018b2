//! The folder of a dataset, on this machine and in memory.

use crate::run::dataset::commit::Staged;
use crate::run::dataset::folder::{Folder, each_file};
use crate::run::dataset::journal::{JournalEntry, SceneOutcome};
use crate::run::dataset::layout::{self, RECORD};
use crate::run::dataset::manifest::{Manifest, Written};
use parking_lot::Mutex;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::scene::SceneId;
use syntable_model::stage::Output;
use syntable_model::store::{MemStore, StoreFolder};

#[test]
fn foreign_folders_are_left_alone() {
    everywhere(|data| {
        data.prepare().expect("writable");
        write(&data, "thesis.tex", "precious");
        let error = Folder::open(&data).err().expect("foreign").to_string();
        assert!(error.contains("no file was changed"), "{error}");
        assert_eq!(data.list("").map(|all| all.len()), Ok(1));
    });
}

#[test]
fn one_run_at_a_time() {
    everywhere(|data| {
        let open = Folder::open(&data).expect("new");
        assert!(Folder::open(&data).err().expect("locked").to_string().contains("another run"));
        assert!(Folder::read(&data).err().expect("locked").to_string().contains("another run"));
        drop(open);
        let readers = [(); 2].map(|()| Folder::read(&data).expect("free again"));
        assert!(Folder::open(&data).err().expect("locked").to_string().contains("another run"));
        drop(readers);
        Folder::open(&data).expect("free again");
    });
}

fn entry(scene: u32) -> JournalEntry {
    let (writers, manifest) = (vec!["png".to_owned()], Digest::of(&[]));
    let outcome = SceneOutcome::Made { views: 1, objects: 1, writers, recorded: Vec::new(), manifest };
    JournalEntry::new(scene, 0, outcome)
}

fn has(folder: &StoreFolder, path: &str) -> bool {
    folder.has(path).expect("readable")
}

fn write(folder: &StoreFolder, path: &str, text: &str) {
    folder.write(&layout::known(path), text.as_bytes()).expect("writable");
}

fn staged(open: &Folder, scene: u32, files: &[(&str, &str)]) -> StoreFolder {
    let staged = open.stage(scene).expect("staged");
    files.iter().for_each(|(path, text)| write(&staged, path, text));
    staged
}

fn commit(open: &Folder, scene: u32, files: &[(&str, &str)]) -> Result<JournalEntry> {
    staged(open, scene, files);
    let journal = Mutex::new(open.journal().expect("there"));
    open.commit(entry(scene), Manifest::default(), Written::new(), &journal)
}

fn text(open: &Folder, path: &str) -> Option<String> {
    let bytes = open.files().read(&layout::known(path)).expect("readable")?;
    Some(String::from_utf8(bytes).expect("text"))
}

#[cfg(unix)]
#[test]
fn scenes_with_the_same_bytes_share_a_file() {
    use std::os::unix::fs::MetadataExt;
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("data");
    let open = || Folder::open(&root).expect("a dataset");
    let make = |open: &Folder, scene: u32, bytes: &[u8]| {
        let staged = open.stage(scene).expect("staged");
        let output = Output::new(staged, "w", SceneId(scene));
        let digest = output.write_shared(bytes).expect("written");
        // Two assets of a scene with the same bytes share one file.
        assert_eq!(output.write_shared(bytes).expect("written"), digest);
        let journal = Mutex::new(open.journal().expect("there"));
        open.commit(entry(scene), Manifest::default(), Written::new(), &journal).expect("committed");
        root.join(format!(".syntable/shards/w/shared/{digest}/{scene:06}"))
    };
    let number = |path: &Path| fs::metadata(path).expect("there").ino();
    let first = open();
    let [zero, one, other] =
        [(0, b"texture"), (1, b"texture"), (2, b"TEXTURE")].map(|(scene, bytes)| make(&first, scene, bytes));
    assert_eq!(number(&zero), number(&one));
    assert_ne!(number(&zero), number(&other));
    assert_eq!(fs::read(&other).expect("there"), b"TEXTURE");
    // A resumed run finds the file of an earlier run.
    drop(first);
    let second = open();
    let three = make(&second, 3, b"texture");
    assert_eq!(number(&zero), number(&three));
    drop(second);
    // A damaged file is not linked, and making its scene again repairs it.
    fs::remove_file(&three).expect("there");
    fs::write(&three, "TEXTURE").expect("writable");
    let third = open();
    let four = make(&third, 4, b"texture");
    assert_eq!((number(&zero), fs::read(&four).expect("there")), (number(&four), b"texture".to_vec()));
    make(&third, 3, b"texture");
    assert_eq!((number(&zero), fs::read(&three).expect("there")), (number(&three), b"texture".to_vec()));
    // Replacing a scene removes nothing from other scenes.
    make(&third, 0, b"another");
    assert!(!zero.exists());
    assert_eq!(fs::read(&one).expect("there"), b"texture");
}

/// Runs a test in a folder of this machine, in memory, and in a store that counts as remote.
fn everywhere(test: impl Fn(StoreFolder)) {
    here(&test);
    test(Arc::new(MemStore::remote()).into());
}

/// Runs a test in stores in which scenes are staged.
fn here(test: impl Fn(StoreFolder)) {
    let folder = tempfile::tempdir().expect("a folder");
    test(folder.path().join("data").into());
    test(Arc::new(MemStore::default()).into());
}

#[test]
fn a_scene_appears_whole_and_is_listed() {
    everywhere(|data| {
        let open = Folder::open(&data).expect("new");
        staged(&open, 3, &[("rgb/3.png", "x")]);
        assert!(!has(&data, "rgb"));
        let made = commit(&open, 3, &[("rgb/3.png", "x"), ("info.txt", "why")]).expect("committed");
        assert_eq!(text(&open, "rgb/3.png").as_deref(), Some("x"));
        assert!(!has(&data, ".syntable/staging/3.ready") && !has(&data, RECORD));
        let journal = open.journal().expect("there");
        assert!(journal.entries().has(&made));
        let (manifest, digest) = Manifest::read(&data, &layout::manifest(3)).expect("readable").expect("there is one");
        assert_eq!(Some(digest), made.manifest());
        let listed: Vec<(&str, u64)> = manifest.files.iter().map(|(path, stamp)| (path.as_str(), stamp.0)).collect();
        assert_eq!(listed, [("info.txt", 3), ("rgb/3.png", 1)]);
    });
}

#[test]
fn a_file_has_one_owner() {
    everywhere(|data| {
        let open = Folder::open(&data).expect("new");
        commit(&open, 3, &[("all.txt", "3")]).expect("committed");
        let error = commit(&open, 4, &[("all.txt", "4"), ("4.txt", "4")]).expect_err("taken");
        assert!(error.is_permanent() && error.to_string().contains("`all.txt` is a file of scene 3"), "{error}");
        assert_eq!((text(&open, "all.txt").as_deref(), text(&open, "4.txt")), (Some("3"), None));
        write(&data, "notes.txt", "mine");
        let error = commit(&open, 4, &[("notes.txt", "4")]).expect_err("taken").to_string();
        assert!(error.contains("does not belong to the dataset"), "{error}");
        assert_eq!(text(&open, "notes.txt").as_deref(), Some("mine"));
        let error = commit(&open, 4, &[("notes.txt/4", "4")]).expect_err("in the way").to_string();
        assert!(error.contains("`notes.txt` exists"), "{error}");
        // The end of a run may replace files of an earlier end, and no other files.
        let mut journal = open.journal().expect("there");
        for (name, content, whose) in [
            ("end.txt", "1", None),
            ("end.txt", "2", None),
            ("all.txt", "0", Some("scene 3")),
            ("other.txt", "1", None),
        ] {
            write(&open.stage_finish().expect("staged"), name, content);
            let done = open.publish_finish("a = 1\n", &mut journal, Some(&Vec::new()), false);
            match whose {
                None => assert_eq!((done, text(&open, name).as_deref()), (Ok(()), Some(content))),
                Some(whose) => assert!(done.expect_err("taken").to_string().contains(whose)),
            }
        }
        assert_eq!((text(&open, "all.txt").as_deref(), text(&open, "end.txt")), (Some("3"), None));
        assert_eq!(text(&open, "recipe.toml").as_deref(), Some("a = 1\n"));
        let error = commit(&open, 5, &[("other.txt", "5")]).expect_err("taken").to_string();
        assert!(error.contains("the end of a run writes"), "{error}");
        // A scene replaces its own files, and files that it no longer has are removed.
        commit(&open, 3, &[("other/3.txt", "3")]).expect("committed");
        assert_eq!((text(&open, "all.txt"), text(&open, "other/3.txt").as_deref()), (None, Some("3")));
    });
}

#[test]
fn a_move_that_was_interrupted_is_finished() {
    here(|data| {
        let open = Folder::open(&data).expect("new");
        commit(&open, 3, &[("old.txt", "z")]).expect("committed");
        staged(&open, 3, &[("rgb/3.png", "x"), ("info.txt", "y")]);
        let record = Staged { entry: entry(3), stale: vec![layout::known("old.txt")] };
        let record = serde_json::to_string(&record).expect("plain");
        let ready = layout::staged("3.ready");
        data.rename(&layout::staged("3.part"), &ready).expect("moved");
        write(&data.inner(&ready), RECORD, &record);
        // The program was killed after it moved one file. Another scene was unfinished, and a third had no record.
        data.rename(&ready.join(&layout::known("info.txt")), &layout::known("info.txt")).expect("moved");
        staged(&open, 4, &[("rgb/4.png", "x")]);
        staged(&open, 5, &[("rgb/5.png", "x")]);
        data.rename(&layout::staged("5.part"), &layout::staged("5.ready")).expect("moved");
        drop(open);
        let open = Folder::open(&data).expect("again");
        open.recover().expect("recovers");
        assert!(has(&data, "rgb/3.png") && has(&data, "info.txt") && !has(&data, &layout::staging()));
        assert!(!has(&data, "old.txt") && !has(&data, "rgb/4.png") && !has(&data, "rgb/5.png"));
        let scenes: Vec<u32> = open.journal().expect("there").entries().scenes().collect();
        assert_eq!(scenes, [3]);
    });
}

#[test]
fn a_deletion_takes_the_dataset_and_nothing_else_however_often_it_is_interrupted() {
    // Interrupts the deletion before the n-th of the moves into the bin, and finally not at all. A store that moves
    // folders file by file may have moved a part of the last folder.
    let moves = 0..=layout::state().len();
    for (moves, in_part) in moves.flat_map(|moves| [(moves, false), (moves, true)]) {
        everywhere(|data| {
            let open = Folder::open(&data).expect("new");
            for scene in [3, 4] {
                let files = [(format!("rgb/{scene}.png"), "x"), (format!("both/{scene}.txt"), "x")];
                commit(&open, scene, &files.each_ref().map(|(path, text)| (path.as_str(), *text))).expect("committed");
            }
            write(&open.stage_finish().expect("staged"), "end.txt", "1");
            let mut journal = open.journal().expect("there");
            open.publish_finish("a = 1\n", &mut journal, Some(&Vec::new()), false).expect("published");
            write(&data, "both/notes.txt", "mine");
            let all = layout::state();
            let binned = |path: &DatasetPath| layout::binned(path.rsplit('/').next().expect("a name"));
            for from in &all[..moves] {
                // The staging folder no longer exists.
                let _ = data.rename(from, &binned(from));
            }
            if let Some(next) = all.get(moves).filter(|_| in_part)
                && let Some((name, _)) = data.list(next).unwrap_or_default().first()
            {
                let name = layout::known(name);
                data.rename(&next.join(&name), &binned(next).join(&name)).expect("moved");
            }
            drop(open);
            // The next run completes a deletion that has begun. Otherwise, deletion must be requested again.
            let is_begun = has(&data, &layout::bin());
            let open = Folder::open(&data).expect("again");
            if !is_begun {
                open.discard().expect("deleted");
            }
            let mut left = Vec::new();
            each_file(&data, "", &mut |path, _| left.push(path.to_owned())).expect("readable");
            assert_eq!(left, ["both/notes.txt"], "after {moves} moves");
            assert!(open.journal().expect("new").entries().is_empty() && !has(&data, &layout::bin()));
        });
    }
}
