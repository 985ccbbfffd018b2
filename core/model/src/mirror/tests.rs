use super::blocks::BLOCK;
use super::downloads::Downloads;
use super::recent::RECENT;
use super::{DatasetFile, Mirror};
use crate::error::Error;
use crate::files::{DatasetFolder, DatasetPath, Reach};
use crate::natural::natural;
use crate::store::{MemStore, StoreFolder, Stored};
use std::collections::BTreeSet;
use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

const URL: &str = "mem://bucket/sets/mine";

/// A mirror of a store in memory, with its downloads in a folder that is deleted at the end.
struct Case {
    store: Arc<MemStore>,
    downloads: Arc<Downloads>,
    folder: PathBuf,
}

impl Case {
    fn new(name: &str, budget: u64) -> Self {
        let folder = std::env::temp_dir().join(format!("syntable-mirror-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        Self { store: Arc::new(MemStore::remote()), downloads: Downloads::new(folder.clone(), budget), folder }
    }

    fn put(&self, at: &str, bytes: Vec<u8>) {
        self.store.insert(DatasetPath::new(at).expect("a path"), bytes);
    }

    fn mirror(&self) -> Arc<Mirror> {
        let store = StoreFolder::from(Arc::clone(&self.store));
        let list = store.files().expect("listed");
        Mirror::of(store, URL, list, Arc::clone(&self.downloads)).expect("made")
    }

    /// Bytes of complete files that are kept.
    fn kept(&self) -> u64 {
        let folders = fs::read_dir(self.folder.join("files")).into_iter().flatten().flatten();
        let files = folders.flat_map(|folder| fs::read_dir(folder.path()).into_iter().flatten().flatten());
        files.map(|file| file.metadata().expect("there").len()).sum()
    }
}

impl Drop for Case {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Bytes without a period that fits a block.
fn noise(length: u64) -> Vec<u8> {
    (0..length).map(|at| (at.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8).collect()
}

#[test]
fn readers_find_the_names_and_the_content_of_a_store() {
    let case = Case::new("names", u64::MAX);
    let files = ["a.json", "png/rgb/0_0.png", "png/rgb/0_1.png", "png/depth/0_0.png", ".syntable/journal.jsonl"];
    for name in files {
        case.put(name, format!("content of {name}").into_bytes());
    }
    let mirror = case.mirror();
    let root = mirror.root().to_owned();
    let names = |folder: &str| -> BTreeSet<String> {
        let entries = fs::read_dir(root.join(folder)).expect("a folder");
        entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect()
    };
    assert!(root.ends_with("mine"), "{root:?}");
    assert_eq!(names(""), BTreeSet::from([".syntable", "a.json", "png"].map(String::from)));
    assert_eq!(names("png/rgb"), BTreeSet::from(["0_0.png", "0_1.png"].map(String::from)));
    for name in files {
        assert_eq!(DatasetFile::read(root.join(name)).expect(name), format!("content of {name}").into_bytes());
    }
    // A dataset names files relative to others, and a user may trust names that lead through `..`.
    assert_eq!(DatasetFile::read(root.join("png/../png/./rgb/0_1.png")).expect("there"), b"content of png/rgb/0_1.png");
    let folder = DatasetFolder::open(&root, Reach::Inside).expect("there");
    let path = folder.inner("png/depth").file("../rgb/0_0.png").expect("inside");
    assert_eq!(DatasetFile::read(path).expect("there"), b"content of png/rgb/0_0.png");
    assert!(folder.file("../lock").is_err(), "nothing leads out of the dataset");
    // Errors name the URL.
    let error = Error::io(root.join("none.png"), &DatasetFile::open(root.join("none.png")).expect_err("missing"));
    assert!(error.to_string().starts_with(&format!("{URL}/none.png: ")), "{error}");
    assert_eq!(Error::new("x").in_file(&root).to_string(), format!("{URL}: x"));
    // The next mirror finds what this one has downloaded.
    let next = case.mirror();
    let store = StoreFolder::from(Arc::clone(&case.store));
    store.remove(&DatasetPath::new("a.json").expect("a path")).expect("removed");
    assert_eq!(DatasetFile::read(next.root().join("a.json")).expect("kept"), b"content of a.json");
    drop(mirror);
    assert!(!root.exists() && Error::new("x").in_file(&root).to_string().starts_with(&*root.to_string_lossy()));
}

#[test]
fn blocks_of_a_large_file_are_read_in_any_order() {
    let case = Case::new("blocks", u64::MAX);
    let bytes = noise(3 * BLOCK + 12_345);
    case.put("shard.tar", bytes.clone());
    let mirror = case.mirror();
    let mut file = DatasetFile::open(mirror.root().join("shard.tar")).expect("opens");
    assert_eq!(file.size().expect("known"), bytes.len() as u64);
    let check = |file: &mut DatasetFile, at: u64, length: usize| {
        let mut read = vec![0; length];
        file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut read)).expect("readable");
        assert!(read == bytes[at as usize..][..length], "{length} bytes at {at}");
    };
    check(&mut file, 3 * BLOCK + 12_000, 345);
    check(&mut file, BLOCK - 10, 20);
    let mut second = file.try_clone().expect("open");
    check(&mut second, 7, 1);
    assert_eq!(file.stream_position().expect("known"), BLOCK + 10, "each has a place of its own");
    assert_eq!(file.seek(SeekFrom::End(0)).expect("known"), bytes.len() as u64);
    assert_eq!(file.read(&mut [0; 10]).expect("readable"), 0);
    // All blocks together are the file, which is then kept.
    let mut whole = Vec::new();
    DatasetFile::open(mirror.root().join("shard.tar")).expect("opens").read_to_end(&mut whole).expect("readable");
    assert!(whole == bytes);
    check(&mut second, 2 * BLOCK, BLOCK as usize);
    assert_eq!(case.kept(), bytes.len() as u64);
}

#[test]
fn few_of_many_large_files_stay_open() {
    let case = Case::new("many", u64::MAX);
    for number in 0..3 * RECENT {
        case.put(&format!("{number}.tar"), noise(BLOCK + 1));
    }
    let mirror = case.mirror();
    for number in 0..3 * RECENT {
        let mut head = [0; 8];
        let mut file = DatasetFile::open(mirror.root().join(format!("{number}.tar"))).expect("opens");
        file.read_exact(&mut head).expect("readable");
        assert_eq!(head[..], noise(8)[..]);
    }
    // The parts of files that are not complete.
    assert_eq!(case.kept(), RECENT as u64 * BLOCK);
    drop(mirror);
    assert_eq!(case.kept(), 0);
}

#[test]
fn odd_names_of_a_store_are_left_out() {
    let case = Case::new("odd", u64::MAX);
    let store = StoreFolder::from(Arc::clone(&case.store));
    case.put("a/b.png", b"image".to_vec());
    let mut list = store.files().expect("listed");
    let path = |text: &str| DatasetPath::new(text).expect("a path");
    // A store may have a file and a folder of one name.
    list.extend(["a", "lock", "a/b.png/c"].map(|name| (path(name), Stored { size: 0, version: None })));
    let mirror = Mirror::of(store, "mem://bucket/lock", list, Arc::clone(&case.downloads)).expect("made");
    assert!(mirror.root().join("a").is_dir() && mirror.root().join("lock").is_file());
    assert!(mirror.root().join("a/b.png").is_dir(), "it is a folder, too");
}

#[test]
fn a_file_that_changed_is_refused() {
    let case = Case::new("changes", u64::MAX);
    case.put("a.json", b"one".to_vec());
    case.put("gone.json", b"one".to_vec());
    let mirror = case.mirror();
    case.put("a.json", b"two".to_vec());
    let store = StoreFolder::from(Arc::clone(&case.store));
    store.remove(&DatasetPath::new("gone.json").expect("a path")).expect("removed");
    for name in ["a.json", "gone.json"] {
        let path = mirror.root().join(name);
        let error = Error::io(&path, &DatasetFile::read(&path).expect_err("refused"));
        assert!(error.to_string().contains(&format!("{name}: the file changed after the store listed it")), "{error}");
        // A run stops: without the file, it would use others.
        assert!(error.is_transient() && mirror.take_outage() == Some(error) && mirror.take_outage().is_none());
    }
    assert_eq!(DatasetFile::read(case.mirror().root().join("a.json")).expect("new"), b"two");
}

#[test]
fn downloads_stay_within_the_budget() {
    let case = Case::new("budget", 3 << 20);
    // Each in a folder of its own, so that no thread downloads files ahead.
    for number in 0..10 {
        case.put(&format!("{number}/a.bin"), noise(1 << 20));
    }
    let mirror = case.mirror();
    for number in 0..10 {
        assert_eq!(DatasetFile::read(mirror.root().join(format!("{number}/a.bin"))).expect("there").len(), 1 << 20);
    }
    assert!(case.kept() <= 3 << 20 && case.kept() > 0, "{} bytes", case.kept());
    // Deleted files are downloaded again.
    for number in 0..10 {
        assert_eq!(DatasetFile::read(mirror.root().join(format!("{number}/a.bin"))).expect("there"), noise(1 << 20));
    }
}

#[test]
fn files_are_ordered_as_readers_number_them() {
    let ordered = [
        "a/0_0.png",
        "a/0_1.png",
        "a/0_10.png",
        "a/2_0.png",
        "a/10_0.png",
        "a/b/1.png",
        "a.json",
        "a0.json",
        "a00.json",
        "a1.json",
        "b/000009.png",
        "b/000010.png",
        "b/11.txt",
    ];
    for (at, one) in ordered.iter().enumerate() {
        for (other_at, other) in ordered.iter().enumerate() {
            assert_eq!(natural(one, other), at.cmp(&other_at), "{one} {other}");
        }
    }
}
