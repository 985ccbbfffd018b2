//! Files and folders that replace others, with a kill or a failure at every call.

use super::disk::faults::{self, InjectedFault};
use super::*;
use std::collections::BTreeSet;

const EIO: i32 = 5;
const ENOSPC: i32 = 28;

/// A folder, in memory if the system has one, because the tests create and delete thousands of files.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).expect("a folder")
}

/// All files below a folder with their texts.
fn texts(folder: &Path) -> BTreeMap<String, String> {
    fn add(folder: &Path, inside: &str, all: &mut BTreeMap<String, String>) {
        for entry in fs::read_dir(folder).expect("readable").flatten() {
            let name = format!("{inside}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                add(&entry.path(), &format!("{name}/"), all);
            } else {
                all.insert(name, String::from_utf8_lossy(&fs::read(entry.path()).expect("readable")).into_owned());
            }
        }
    }
    let mut all = BTreeMap::new();
    add(folder, "", &mut all);
    all
}

fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder).expect("readable").flatten().map(|it| it.file_name().to_string_lossy().into_owned()).collect()
}

/// Writes a folder over an earlier one. Stores each text in a separate file, so that a mixture of two is noticed.
fn make(place: &Path, text: &str) -> Result<()> {
    let draft = Draft::begin(place)?;
    for path in ["index.html".to_owned(), "image/0.jpg".to_owned(), format!("data/{text}.js")] {
        draft.write(&path, text.as_bytes())?;
    }
    draft.publish_listed("syntable test")
}

/// The text of a folder that [`make`] wrote; fails if it is a mixture, or if the list differs from the files.
fn made(place: &Path) -> Option<String> {
    let Standing::Made(listing) = standing(place).expect("readable") else {
        assert!(!place.exists(), "{:?}", texts(place));
        return None;
    };
    let mut found = texts(place);
    found.remove(LISTING).expect("a list");
    let text = found["index.html"].clone();
    let wanted = ["index.html".to_owned(), "image/0.jpg".to_owned(), format!("data/{text}.js")];
    assert_eq!(found, wanted.into_iter().map(|path| (path, text.clone())).collect());
    assert!(listing.others(place).expect("readable").is_empty());
    Some(text)
}

#[test]
fn a_folder_is_the_old_or_the_new_one_whatever_call_is_killed() {
    for (can_exchange, is_there) in [(true, true), (false, true), (true, false)] {
        let mut seen = BTreeSet::new();
        for call in 0.. {
            let home = folder();
            let place = home.path().join("out");
            faults::set_exchanges(can_exchange);
            if is_there {
                make(&place, "one").expect("made");
            }
            let (done, calls) = faults::with(Some((call, InjectedFault::Kill)), || make(&place, "two"));
            let found = made(&place);
            assert!(found.is_some() || !is_there || !can_exchange, "call {call}: the place is empty");
            seen.insert(found);
            // The same command again.
            make(&place, "three").unwrap_or_else(|error| panic!("call {call}: {error}"));
            assert_eq!(made(&place).as_deref(), Some("three"), "call {call}");
            assert_eq!(names(home.path()), ["out".to_owned()].into(), "call {call}");
            if done.is_some() {
                assert!(calls > 20, "{calls} calls");
                break;
            }
        }
        faults::set_exchanges(true);
        assert!(seen.contains(&Some("two".to_owned())), "{seen:?}");
        assert_eq!(seen.contains(&Some("one".to_owned())), is_there, "{seen:?}");
    }
}

#[test]
fn a_call_that_fails_leaves_the_old_folder_or_says_that_the_new_one_is_there() {
    for (can_exchange, code) in [(true, EIO), (false, EIO), (true, ENOSPC)] {
        for call in 0.. {
            let home = folder();
            let place = home.path().join("out");
            faults::set_exchanges(can_exchange);
            make(&place, "one").expect("made");
            let (done, calls) = faults::with(Some((call, InjectedFault::Error(code))), || make(&place, "two"));
            let done = done.expect("nothing kills it");
            let wanted = match &done {
                Ok(()) => "two",
                Err(error) if error.to_string().contains("is written, but") => "two",
                Err(error) => {
                    assert!(error.file().is_some() && !error.is_permanent(), "call {call}: {error}");
                    "one"
                }
            };
            assert_eq!(made(&place).as_deref(), Some(wanted), "call {call}: {done:?}");
            make(&place, "three").unwrap_or_else(|error| panic!("call {call}: {error}"));
            assert_eq!(made(&place).as_deref(), Some("three"), "call {call}");
            assert_eq!(names(home.path()), ["out".to_owned()].into(), "call {call}");
            if call >= calls {
                break;
            }
            assert!(done.is_err(), "call {call} of {calls} fails without a word");
        }
        faults::set_exchanges(true);
    }
}

#[test]
fn a_file_is_the_old_or_the_new_one_whatever_call_is_killed_or_fails() {
    for (fault, can_exchange) in [
        (InjectedFault::Kill, true),
        (InjectedFault::Kill, false),
        (InjectedFault::Error(EIO), true),
        (InjectedFault::Error(EIO), false),
    ] {
        for before in ["one", ""] {
            for call in 0.. {
                let home = folder();
                let path = home.path().join("a.json");
                faults::set_exchanges(can_exchange);
                if !before.is_empty() {
                    write_file(&path, before.as_bytes()).expect("written");
                }
                let (done, calls) = faults::with(Some((call, fault)), || write_file(&path, b"two"));
                let now = fs::read_to_string(&path).unwrap_or_default();
                match &done {
                    None => assert!(now == before || now == "two", "call {call}: {now:?}"),
                    Some(Ok(())) => assert_eq!(now, "two", "call {call} of {calls}"),
                    Some(Err(error)) if error.to_string().contains("is written, but") => assert_eq!(now, "two"),
                    // If the system cannot exchange files, a name that cannot be synced belongs to the new file.
                    Some(Err(error)) if can_exchange || now != "two" => assert_eq!(now, before, "call {call}: {error}"),
                    Some(Err(_)) => {}
                }
                write_file(&path, b"three").unwrap_or_else(|error| panic!("call {call}: {error}"));
                assert_eq!(fs::read(&path).expect("there"), b"three", "call {call}");
                assert_eq!(names(home.path()), ["a.json".to_owned()].into(), "call {call}");
                if call >= calls {
                    assert!(calls > 8 && done.is_some_and(|done| done.is_ok()), "{calls} calls");
                    break;
                }
            }
        }
    }
    faults::set_exchanges(true);
}

#[test]
fn a_file_that_must_be_new_is_whole_or_not_there() {
    for call in 0.. {
        let home = folder();
        let path = home.path().join("recipe.toml");
        let (done, _) = faults::with(Some((call, InjectedFault::Kill)), || create_file(&path, b"one"));
        assert!(["one", ""].contains(&fs::read_to_string(&path).unwrap_or_default().as_str()), "call {call}");
        let was_there = path.exists();
        let again = create_file(&path, b"one");
        assert_eq!(again.is_err(), was_there, "call {call}: {again:?}");
        assert_eq!(fs::read(&path).expect("there"), b"one", "call {call}");
        assert_eq!(names(home.path()), ["recipe.toml".to_owned()].into(), "call {call}");
        if done.is_some() {
            break;
        }
    }
}

#[test]
fn files_that_no_command_made_are_never_deleted() {
    let home = folder();
    let place = home.path().join("out");
    for (path, text, says) in [
        ("notes.txt", "mine", "did not create: notes.txt"),
        ("image/mine.jpg", "mine", "image/mine.jpg"),
        ("index.html", "edited", "index.html (changed)"),
        ("index.html", "eno", "index.html (changed)"),
    ] {
        make(&place, "one").expect("made");
        fs::write(place.join(path), text).expect("writable");
        let error = make(&place, "two").expect_err("it has a file of the user");
        assert!(error.to_string().contains(says) && error.is_permanent(), "{error}");
        assert_eq!(texts(&place)[path], text);
        assert_eq!(texts(&place)["data/one.js"], "one");
        assert_eq!(names(home.path()), ["out".to_owned()].into());
        fs::remove_dir_all(&place).expect("removable");
    }
    // A file that appears after all checks is kept, and named.
    make(&place, "one").expect("made");
    let Standing::Made(listing) = standing(&place).expect("readable") else { panic!("it was made") };
    fs::write(place.join("notes.txt"), "mine").expect("writable");
    let error = listing.delete(&place).expect_err("a file is left").to_string();
    assert!(error.contains("notes.txt") && error.contains("move them away"), "{error}");
    assert_eq!(texts(&place).keys().collect::<Vec<_>>(), [LISTING, "notes.txt"]);
    // It is no error if the user has deleted listed files.
    fs::remove_dir_all(&place).expect("removable");
    make(&place, "one").expect("made");
    fs::remove_dir_all(place.join("image")).expect("removable");
    make(&place, "two").expect("made");
    assert_eq!(made(&place).as_deref(), Some("two"));
}

#[test]
fn a_folder_of_a_stranger_is_not_ours_whatever_it_is_called() {
    let home = folder();
    let place = home.path().join("out");
    fs::create_dir(&place).expect("made");
    fs::write(place.join("thesis.tex"), "precious").expect("writable");
    let own = Stamp::of_bytes(b"precious");
    let of =
        |path: &str| FileListing { made_by: "syntable test".to_owned(), files: [(path.to_owned(), own)].into() }.text();
    for text in [String::new(), "{}".to_owned(), of("../thesis.tex"), of("/etc/passwd")] {
        fs::write(place.join(LISTING), &text).expect("writable");
        assert_eq!(standing(&place), Ok(Standing::Other), "{text}");
        assert!(make(&place, "two").is_err());
    }
    // A list with other files.
    fs::write(place.join(LISTING), of("index.html")).expect("writable");
    assert!(make(&place, "two").expect_err("a stranger's").to_string().contains("thesis.tex"));
    // A list from another command.
    fs::write(place.join(LISTING), of("thesis.tex").replace("syntable test", "syntable other")).expect("writable");
    assert!(make(&place, "two").is_err());
    assert_eq!(texts(&place)["thesis.tex"], "precious");
    // A folder at the path of the work folder.
    let beside = home.path().join("new");
    for mark in [None, Some("something else"), Some(MARK_TEXT)] {
        let part = home.path().join("new.part");
        fs::create_dir_all(&part).expect("made");
        fs::write(part.join("thesis.tex"), "precious").expect("writable");
        mark.into_iter().for_each(|text| fs::write(part.join(MARK), text).expect("writable"));
        let error = make(&beside, "one").expect_err("it is taken").to_string();
        assert!(error.contains("new.part") && error.contains("move it away"), "{error}");
        assert_eq!(texts(&part)["thesis.tex"], "precious");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_comes_at_the_last_moment_is_never_deleted() {
    for (can_exchange, is_file) in [(true, false), (false, false), (true, true), (false, true)] {
        let write = |place: &Path, text: &str| match is_file {
            true => write_file(place, text.as_bytes()),
            false => make(place, text),
        };
        // The last plan has no fault: nothing is killed.
        for call in 0.. {
            let home = folder();
            let place = home.path().join("out");
            faults::set_exchanges(can_exchange);
            write(&place, "one").expect("made");
            let (there, away) = (place.clone(), home.path().join("away"));
            faults::set_meanwhile(move || {
                fs::rename(&there, away).expect("movable");
                fs::create_dir(&there).expect("made");
                fs::write(there.join("thesis.tex"), "precious").expect("writable");
            });
            let (done, calls) = faults::with(Some((call, InjectedFault::Kill)), || write(&place, "two"));
            if faults::take_meanwhile() {
                continue;
            }
            let is_kept = || texts(home.path()).iter().any(|it| it.0.ends_with("thesis.tex") && it.1 == "precious");
            assert!(is_kept(), "call {call}: {:?}", texts(home.path()));
            if let Some(done) = done {
                let error = done.expect_err("something came").to_string();
                assert!(is_file && !can_exchange || error.contains("while the command worked"), "{error}");
                assert_eq!(texts(&place), [("thesis.tex".to_owned(), "precious".to_owned())].into());
                assert_eq!(names(home.path()), ["away".to_owned(), "out".to_owned()].into());
            }
            // The same command never deletes it, either, even if run again.
            for _ in 0..2 {
                let _ = write(&place, "three");
                assert!(is_kept(), "call {call}: {:?}", texts(home.path()));
            }
            if call >= calls {
                break;
            }
        }
        faults::set_exchanges(true);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_comes_before_a_new_one_has_its_name_is_kept() {
    let mut came = 0;
    for call in 0.. {
        let home = folder();
        let path = home.path().join("recipe.toml");
        let there = path.clone();
        faults::set_meanwhile(move || fs::write(there, "mine").expect("writable"));
        let (done, calls) = faults::with(Some((call, InjectedFault::Error(1))), || create_file(&path, b"one"));
        // The action runs if the link fails: the file is then renamed.
        if !faults::take_meanwhile() {
            let error = done.expect("nothing kills it").expect_err("a file came").to_string();
            assert!(error.contains("the path already exists"), "{error}");
            assert_eq!(texts(home.path()), [("recipe.toml".to_owned(), "mine".to_owned())].into());
            came += 1;
        }
        if call >= calls {
            break;
        }
    }
    assert_eq!(came, 1);
}

#[test]
fn two_commands_never_write_one_folder() {
    let home = folder();
    let place = home.path().join("out");
    let draft = Draft::begin(&place).expect("free");
    let error = Draft::begin(&place).err().expect("taken").to_string();
    assert!(error.contains("another command is writing it"), "{error}");
    draft.write("a", b"1").expect("written");
    // Another program creates something at the target meanwhile.
    fs::create_dir(&place).expect("made");
    fs::write(place.join("mine"), "x").expect("writable");
    assert!(draft.publish().is_err());
    assert_eq!(texts(home.path()), [("out/mine".to_owned(), "x".to_owned())].into());
    drop(Draft::begin(&home.path().join("other")).expect("free"));
    assert_eq!(names(home.path()), ["out".to_owned()].into());
}

#[cfg(unix)]
#[test]
fn a_link_to_a_folder_stays() {
    let home = folder();
    let (link, target) = (home.path().join("link"), home.path().join("target"));
    std::os::unix::fs::symlink("target", &link).expect("linked");
    let error = make(&link, "one").expect_err("the target is not there").to_string();
    assert!(error.contains("link to a missing folder"), "{error}");
    fs::create_dir(&target).expect("made");
    for text in ["one", "two"] {
        make(&link, text).expect("made");
        assert!(link.is_symlink() && made(&target).as_deref() == Some(text));
    }
    assert_eq!(names(home.path()), ["link".to_owned(), "target".to_owned()].into());
}

#[test]
fn a_file_takes_the_place_of_another_one_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a.json");
    write_file(&out, b"one").and_then(|()| write_file(&out, b"two")).expect("writable");
    assert_eq!(std::fs::read(&out).expect("readable"), b"two");
    assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 1);
    // A missing folder, and a folder at the path of the file: the request is wrong.
    std::fs::create_dir(folder.path().join("b")).expect("made");
    for path in ["none/a.json", "b"] {
        let error = write_file(&folder.path().join(path), b"x").expect_err("it is no file");
        assert!(error.is_permanent() && error.to_string().contains(path), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 2);
}

#[cfg(unix)]
#[test]
fn links_and_permissions_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let mode = |name: &str| std::fs::metadata(at(name)).expect("there").permissions().mode() & 0o777;
    for target in ["there", "to come"] {
        symlink(at(target), at(&format!("link to {target}"))).expect("linked");
    }
    write_file(&at("there"), b"one").expect("writable");
    std::fs::set_permissions(at("there"), PermissionsExt::from_mode(0o600)).expect("permitted");
    for target in ["there", "to come"] {
        write_file(&at(&format!("link to {target}")), b"two").expect("writable");
        assert!(at(&format!("link to {target}")).is_symlink(), "{target}");
        assert_eq!(std::fs::read(at(target)).expect("readable"), b"two");
    }
    assert_eq!(mode("there"), 0o600);
    std::fs::set_permissions(at("there"), PermissionsExt::from_mode(0o400)).expect("permitted");
    let error = write_file(&at("there"), b"three").expect_err("read-only").to_string();
    assert!(
        error.contains("the file is read-only") && std::fs::read(at("there")).expect("readable") == b"two",
        "{error}"
    );
}
