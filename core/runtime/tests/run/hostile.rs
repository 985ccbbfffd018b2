//! Hostile datasets: their lists and links name foreign files, which must stay unchanged.

use crate::kit::{options, registry, run, run_with};
use rustix::fs::{FileType, Mode};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use syntable_model::digest::Digest;
use syntable_model::error::Error;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::{MergeOptions, RunOptions, merge, verify};

const RECIPE: &str = "[dataset]\nscenes = 2\nviews_per_scene = 1\nname = \"hostile\"\n\
    [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n\
    [write.lines]\ninclude = [\"light\"]\n";

/// Paths outside a dataset, or that a list must not name.
const BAD: [&str; 14] = [
    "",
    "..",
    "../canary",
    "a/../../canary",
    "lines/../../canary",
    "lines//000000.json",
    "./canary",
    "lines/.",
    "C:\\canary",
    "lines\\..\\..\\canary",
    "lines/\0",
    ".syntable/journal.jsonl",
    ".syntable/lock",
    "recipe.toml/x",
];

/// A dataset next to a foreign file and a foreign folder.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        fs::write(place.at("canary"), "precious").expect("writable");
        fs::create_dir(place.at("others")).expect("writable");
        fs::write(place.at("others/000000.json"), "precious").expect("writable");
        place.remake();
        place
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Makes the dataset again.
    fn remake(&self) {
        let data = self.at("data");
        if fs::symlink_metadata(&data).is_ok() {
            fs::remove_dir_all(&data).expect("removable");
        }
        run(RECIPE, &data, 1).expect("a dataset");
    }

    /// All files and links, except the dataset's lock.
    fn all(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        fn walk(folder: &Path, all: &mut BTreeMap<PathBuf, Vec<u8>>) {
            for entry in fs::read_dir(folder).expect("readable") {
                let path = entry.expect("readable").path();
                let kind = fs::symlink_metadata(&path).expect("there").file_type();
                if kind.is_dir() {
                    walk(&path, all);
                } else if kind.is_symlink() {
                    all.insert(
                        path.clone(),
                        fs::read_link(&path).expect("a link").into_os_string().into_encoded_bytes(),
                    );
                } else if kind.is_file() {
                    all.insert(path.clone(), fs::read(&path).expect("readable"));
                }
            }
        }
        let mut all = BTreeMap::new();
        walk(self.0.path(), &mut all);
        all.retain(|path, _| !path.ends_with("cache") && !path.ends_with(".syntable/lock"));
        all
    }

    /// The error of each verb that would change the dataset or take files from it. No verb may change a file.
    fn refusals(&self, what: &str) -> Vec<Error> {
        let (data, merged) = (self.at("data"), self.at("merged"));
        let grown = format!("{RECIPE}[write.more]\nkind = \"lines\"\ninclude = [\"thought\"]\n");
        let with = |recipe: &str, change: &dyn Fn(&mut RunOptions)| {
            let mut options = options(&data, 1);
            change(&mut options);
            run_with(recipe, options, &Quiet)
        };
        let merge =
            |out: &Path, part: &Path| merge(&registry(), out, &[part.to_owned()], &MergeOptions::new(1), &Quiet);
        let before = self.all();
        let told: Vec<_> = [
            with(RECIPE, &|_| {}),
            with(&grown, &|_| {}),
            with(RECIPE, &|options| options.overwrite = true),
            with(RECIPE, &|options| options.repair = true),
            merge(&merged, &data),
        ]
        .into_iter()
        .map(|done| done.expect_err(what))
        .collect();
        assert!(self.all() == before, "{what}: something was touched");
        assert!(!merged.exists(), "{what}");
        assert!(told.iter().all(Error::is_permanent), "{what}: {told:?}");
        told
    }

    fn is_unharmed(&self) -> bool {
        ["canary", "others/000000.json"].iter().all(|name| fs::read(self.at(name)).is_ok_and(|it| it == b"precious"))
    }
}

/// The first line of the journal.
fn entry_of(data: &Path) -> serde_json::Value {
    let lines = fs::read_to_string(data.join(".syntable/journal.jsonl")).expect("there");
    serde_json::from_str(lines.lines().next().expect("a line")).expect("JSON")
}

/// Changes the manifest of scene 0, and updates its digest in the journal.
fn forge(data: &Path, change: &dyn Fn(&mut serde_json::Value)) {
    let path = data.join(".syntable/scenes/000/000000.json");
    let text = fs::read_to_string(&path).expect("there");
    let mut manifest = serde_json::from_str(&text).expect("JSON");
    change(&mut manifest);
    let forged = manifest.to_string();
    let digest = |text: &str| Digest::of_reader(text.as_bytes()).expect("memory").0.to_string();
    let journal = data.join(".syntable/journal.jsonl");
    let lines = fs::read_to_string(&journal).expect("there").replace(&digest(&text), &digest(&forged));
    assert!(lines.contains(&digest(&forged)));
    fs::write(&journal, lines).expect("writable");
    fs::write(path, forged).expect("writable");
}

#[test]
fn lists_name_files_of_the_dataset_alone() {
    let place = Place::new();
    let data = place.at("data");
    let stamp = serde_json::json!([8, Digest::of_reader(&b"precious"[..]).expect("memory").0.to_string()]);
    let absolute = place.at("canary").to_str().expect("UTF-8").to_owned();
    for (number, bad) in BAD.iter().copied().chain([absolute.as_str()]).enumerate() {
        let of_files = |manifest: &mut serde_json::Value| manifest["files"][bad] = stamp.clone();
        let of_writers = |manifest: &mut serde_json::Value| manifest["writers"]["lines"] = serde_json::json!([bad]);
        let finished = |path: &Path| {
            let mut list: serde_json::Value = serde_json::from_slice(&fs::read(path).expect("there")).expect("JSON");
            of_files(&mut list);
            fs::write(path, list.to_string()).expect("writable");
        };
        let staged = |name: &str| {
            let entry = entry_of(&data);
            let folder = data.join(".syntable/staging").join(name).join(".syntable");
            fs::create_dir_all(&folder).expect("writable");
            let record = serde_json::json!({ "entry": entry, "stale": [bad] }).to_string();
            fs::write(folder.join("staged.json"), record).expect("writable");
        };
        let binned = || {
            let bin = data.join(".syntable/discard");
            fs::create_dir_all(&bin).expect("writable");
            fs::rename(data.join(".syntable/finished.json"), bin.join("finished.json")).expect("movable");
            finished(&bin.join("finished.json"));
        };
        for (list, key, make) in [
            (".syntable/scenes/000/000000.json", "files", &(|| forge(&data, &of_files)) as &dyn Fn()),
            (".syntable/scenes/000/000000.json", "writers", &|| forge(&data, &of_writers)),
            (".syntable/finished.json", "files", &|| finished(&data.join(".syntable/finished.json"))),
            (".syntable/staging/0.ready/.syntable/staged.json", "stale", &|| staged("0.ready")),
            (".syntable/discard/finished.json", "files", &binned),
        ] {
            // Tries some of the lists for each bad path, and all lists for the most important path.
            if !bad.contains("../canary") && number % 5 != list.len() % 5 {
                continue;
            }
            place.remake();
            make();
            let what = format!("{list}: {key}: {bad:?}");
            for error in place.refusals(&what) {
                let text = error.to_string();
                let shown = format!("`{}`", bad.replace('\0', "\\u{0}"));
                let named = [list, &format!("`{key}`"), &shown, "no file was changed"];
                assert!(named.iter().all(|named| text.contains(named)), "{what}: {text}");
            }
            let found = verify(&data, 1).expect("it only looks");
            assert!(
                !found.whole() && found.outside.iter().any(|(path, why)| path == list && why.contains(key)),
                "{what}"
            );
            assert!(place.is_unharmed(), "{what}");
        }
    }
}

/// A dataset with many scenes is too large to check before each run. Each of its lists is checked when it is read.
#[test]
fn lists_of_large_datasets_are_checked_when_they_are_read() {
    let place = Place::new();
    let data = place.at("data");
    // The program counts folders.
    let make_large = || {
        for folder in 1..=20 {
            fs::create_dir_all(data.join(format!(".syntable/scenes/{folder:03}"))).expect("writable");
        }
    };
    let grown = format!("{RECIPE}[write.more]\nkind = \"lines\"\ninclude = [\"thought\"]\n");
    let with = |recipe: &str, change: &dyn Fn(&mut RunOptions)| {
        let mut options = options(&data, 1);
        change(&mut options);
        run_with(recipe, options, &Quiet)
    };
    for bad in [".syntable/lock", "../canary"] {
        let own = |manifest: &mut serde_json::Value| {
            manifest["files"][bad] = manifest["files"].as_object().expect("files")["lines/000000.json"].clone();
        };
        for change in [&(|options: &mut RunOptions| options.overwrite = true) as &dyn Fn(&mut RunOptions), &|_| {}] {
            place.remake();
            make_large();
            forge(&data, &own);
            let done = with(&grown, change);
            let told = done.as_ref().err().map(ToString::to_string).unwrap_or_default();
            // A text with a path outside the dataset is no list, and its scene is made again.
            assert!(bad != ".syntable/lock" || told.contains("is reserved for the program"), "{bad}: {done:?}");
            assert!(place.is_unharmed() && data.join(".syntable/lock").exists(), "{bad}");
        }
    }
    // Own folders and own files that are links.
    for (name, target) in [("scenes/001", "others"), ("settled/001", "others"), ("shards/lines/001", "others")] {
        place.remake();
        make_large();
        let link = data.join(".syntable").join(name);
        let _ = fs::remove_dir_all(&link);
        fs::create_dir_all(link.parent().expect("a folder")).expect("writable");
        symlink(place.at(target), &link).expect("linked");
        for error in place.refusals(name) {
            assert!(error.to_string().contains(name) && error.to_string().contains("link"), "{error}");
        }
    }
    place.remake();
    make_large();
    let manifest = data.join(".syntable/scenes/000/000000.json");
    fs::rename(&manifest, place.at("moved.json")).expect("movable");
    symlink(place.at("moved.json"), &manifest).expect("linked");
    with(&grown, &|_| {}).expect_err("the list is a link");
    assert!(fs::symlink_metadata(&manifest).expect("there").is_symlink() && place.is_unharmed());
}

/// A list must not hide its names from the check behind fields that only the check reads, and a staged scene must not
/// add a file that is reserved for the program.
#[test]
fn no_text_and_no_place_hides_a_list() {
    let place = Place::new();
    let data = place.at("data");
    let stale = serde_json::json!({ "entry": entry_of(&data), "stale": [".syntable/journal.jsonl"], "files": 5 });
    let own = || {
        forge(&data, &|manifest| {
            manifest["stale"] = 5.into();
            manifest["files"][".syntable/lock"] =
                manifest["files"].as_object().expect("files")["lines/000000.json"].clone();
        });
    };
    let ready = |name: &str, text: &str| {
        let path = data.join(".syntable/staging/0.ready/.syntable").join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    };
    for (list, says, make) in [
        (".syntable/scenes/000/000000.json", "`.syntable/lock` is reserved for the program", &own as &dyn Fn()),
        (
            ".syntable/staging/0.ready/.syntable/staged.json",
            "`.syntable/journal.jsonl` is reserved for the program",
            &|| ready("staged.json", &stale.to_string()),
        ),
        (".syntable/staging/0.ready/.syntable/journal.jsonl", "no run stages this file", &|| {
            ready("journal.jsonl", "")
        }),
        (".syntable/staging/0.ready/.syntable/discard/finished.json", "no run stages this file", &|| {
            ready("discard/finished.json", "{}");
        }),
    ] {
        place.remake();
        make();
        for error in place.refusals(list) {
            let text = error.to_string();
            assert!(text.contains(list) && text.contains(says), "{list}: {text}");
        }
        let found = verify(&data, 1).expect("it only looks");
        assert!(found.outside.iter().any(|(path, why)| path == list && why.contains(says)), "{list}: {found:?}");
    }
}

/// Files of writers are never read as lists, whatever their names and content.
#[test]
fn files_of_writers_are_no_lists() {
    let place = Place::new();
    let data = place.at("data");
    let text = r#"{"files":{"../canary":1},"writers":{},"stale":["/etc/passwd"]}"#;
    for path in [
        ".syntable/staging/7.part/scenes/000000.json",
        ".syntable/staging/finish/finished.json",
        ".syntable/quarantine/000007/scenes/000000.json",
        ".syntable/quarantine/000007/staged.json",
    ] {
        let path = data.join(path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    }
    let found = verify(&data, 1).expect("it only looks");
    assert!(found.whole(), "{found:?}");
    run_with(RECIPE, options(&data, 1), &Quiet).expect("the dataset is whole");
    assert!(place.is_unharmed());
}

#[test]
fn the_programs_own_folder_has_no_links_and_no_pipes() {
    let place = Place::new();
    let data = place.at("data");
    let own = |name: &str| data.join(".syntable").join(name);
    let file = |path: PathBuf| {
        let _ = fs::remove_file(&path);
        symlink(place.at("canary"), path).expect("linked");
    };
    let folder = |path: PathBuf| {
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        symlink(place.at("others"), path).expect("linked");
    };
    let pipe = |path: PathBuf| {
        let _ = fs::remove_file(&path);
        // Creates the pipe without another program, because a child process would hold the locks of all datasets that
        // other tests write until it runs `exec`.
        rustix::fs::mknodat(rustix::fs::CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).expect("a pipe");
    };
    for (name, make) in [
        (".syntable/lock", &(|| file(own("lock"))) as &dyn Fn()),
        (".syntable/journal.jsonl", &|| file(own("journal.jsonl"))),
        (".syntable/journal.jsonl.part", &|| file(own("journal.jsonl.part"))),
        (".syntable/finished.json.part", &|| file(own("finished.json.part"))),
        (".syntable/times.jsonl", &|| file(own("times.jsonl"))),
        (".syntable/scenes/000/000000.json.part", &|| file(own("scenes/000/000000.json.part"))),
        ("recipe.toml.part", &|| file(data.join("recipe.toml.part"))),
        ("recipe.toml", &|| file(data.join("recipe.toml"))),
        (".syntable/staging", &|| folder(own("staging"))),
        (".syntable/staging/0.ready/lines", &|| folder(own("staging/0.ready/lines"))),
        (".syntable/quarantine", &|| folder(own("quarantine"))),
        (".syntable/ahead", &|| folder(own("ahead"))),
        (".syntable/discard", &|| folder(own("discard"))),
        (".syntable/scenes", &|| folder(own("scenes"))),
        (".syntable", &|| folder(data.join(".syntable"))),
        (".syntable/lock", &|| pipe(own("lock"))),
        (".syntable/journal.jsonl", &|| pipe(own("journal.jsonl"))),
        (".syntable/finished.json", &|| pipe(own("finished.json"))),
        (".syntable/shards/lines/000/000000.jsonl", &|| pipe(own("shards/lines/000/000000.jsonl"))),
        ("recipe.toml", &|| pipe(data.join("recipe.toml"))),
    ] {
        place.remake();
        make();
        for error in place.refusals(name) {
            let text = error.to_string();
            assert!(text.contains(name) && (text.contains("link") || text.contains("pipe")), "{name}: {text}");
        }
        match verify(&data, 1) {
            Ok(found) => assert!(!found.whole() && found.outside[0].0 == name, "{name}: {found:?}"),
            Err(error) => assert!(error.to_string().contains(name), "{name}: {error}"),
        }
        assert!(place.is_unharmed(), "{name}");
    }
}

#[test]
fn nothing_is_written_or_removed_behind_a_link() {
    let place = Place::new();
    let data = place.at("data");
    // A folder of listed files is a link.
    fs::remove_dir_all(data.join("lines")).expect("removable");
    symlink(place.at("others"), data.join("lines")).expect("linked");
    for error in place.refusals("a folder") {
        let text = error.to_string();
        assert!(text.contains("`lines` is a link") && text.contains("mount"), "{text}");
    }
    let found = verify(&data, 1).expect("it only looks");
    assert_eq!(found.links, [("lines".to_owned(), place.at("others").display().to_string())]);
    assert!(!found.whole() && found.linked.contains(&"lines/000000.json".to_owned()), "{found:?}");
    // A folder that receives files of a staged scene is a link. Every verb first moves such a scene into place.
    place.remake();
    let staged = data.join(".syntable/staging/0.ready");
    fs::create_dir_all(staged.join("more/deep")).expect("writable");
    fs::create_dir_all(staged.join(".syntable")).expect("writable");
    let entry = fs::read_to_string(data.join(".syntable/journal.jsonl")).expect("there");
    let record = format!("{{\"entry\":{},\"stale\":[]}}", entry.lines().next().expect("a line"));
    fs::write(staged.join(".syntable/staged.json"), record).expect("writable");
    fs::write(staged.join("more/000000.json"), "evil").expect("writable");
    symlink(place.at("others"), data.join("more")).expect("linked");
    for error in place.refusals("a staged folder") {
        assert!(error.to_string().contains("`more` is a link"), "{error}");
    }
    // A folder that will receive new files is a link.
    place.remake();
    symlink(place.at("others"), data.join("more")).expect("linked");
    assert!(verify(&data, 1).expect("whole").whole(), "a link of the user's own is none of the dataset's");
    let grown = format!("{RECIPE}[write.more]\nkind = \"lines\"\ninclude = [\"thought\"]\n");
    let error = run(&grown, &data, 1).expect_err("behind a link").to_string();
    assert!(error.contains("`more` is a link") && place.is_unharmed(), "{error}");
    // A listed file is a link: it is not read, and is made again.
    place.remake();
    let file = data.join("lines/000000.json");
    fs::remove_file(&file).expect("removable");
    symlink(place.at("canary"), &file).expect("linked");
    let found = verify(&data, 1).expect("it only looks");
    assert!(!found.whole() && found.linked == ["lines/000000.json"], "{found:?}");
    let part = [data.clone()];
    let error = merge(&registry(), place.at("merged"), &part, &MergeOptions::new(1), &Quiet).expect_err("a link");
    assert!(error.to_string().contains("follows no links in parts"), "{error}");
    run_with(RECIPE, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("repaired");
    assert!(fs::symlink_metadata(&file).expect("there").is_file() && place.is_unharmed());
    assert!(verify(&data, 1).expect("whole").whole());
    // The folder of the dataset may be a link, and its files are deleted through it.
    let named = place.at("named");
    symlink(&data, &named).expect("linked");
    run_with(RECIPE, RunOptions { overwrite: true, ..options(&named, 1) }, &Quiet).expect("made anew");
    assert!(verify(&named, 1).expect("whole").whole() && named.is_symlink());
}

#[test]
fn the_lock_of_a_part_names_no_file_elsewhere() {
    let place = Place::new();
    let data = place.at("data");
    let recipe = fs::read_to_string(data.join("recipe.toml")).expect("there");
    let lock = "\n[lock.catalogs]\n\"../../../others/000000\" = { assets = 0, digest = \"00\" }\n";
    fs::write(data.join("recipe.toml"), recipe + lock).expect("writable");
    fs::write(data.join(".syntable/finished.json"), "{\"files\":{}}").expect("writable");
    let error = merge(&registry(), place.at("merged"), &[data], &MergeOptions::new(1), &Quiet).expect_err("elsewhere");
    assert!(error.to_string().contains("lock.catalogs") && place.is_unharmed(), "{error}");
    assert!(!place.at("merged").exists());
}
