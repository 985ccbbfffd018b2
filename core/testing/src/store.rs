//! The behavior that all stores share.

use std::io::{Read, Seek, SeekFrom, Write};
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, Kind, MemStore, StoreFolder};

/// Checks that a store behaves as [`Store`](syntable_model::store::Store) says. `new` gives a folder without files, in a
/// store of its own.
///
/// # Panics
/// If it behaves otherwise.
pub fn check_store(new: impl Fn() -> StoreFolder) {
    files_are_created_once_replaced_whole_and_grow(&new());
    one_of_many_writers_makes_a_new_file(&new());
    files_and_folders_are_moved_and_removed(&new());
    bytes_are_shared_or_copied(&new());
    many_read_or_one_writes(&new());
    folders_come_and_go(&new());
}

/// A worker removes the last file of a folder while a second worker writes the next.
fn folders_come_and_go(store: &StoreFolder) {
    let work = |worker: u32| {
        let own = path(&format!("claims/{worker}"));
        for _ in 0..200 {
            assert_eq!(store.write_new(&own, b"x"), Ok(true));
            store.write(&own, b"y").and_then(|()| store.remove(&own)).expect("there");
        }
    };
    std::thread::scope(|threads| (0..4).for_each(|worker| drop(threads.spawn(move || work(worker)))));
    assert_eq!(store.list("claims"), Ok(vec![]));
}

/// Whether a path cannot be a file and a folder at once.
fn has_folders(store: &StoreFolder) -> bool {
    !store.is_remote()
}

fn path(path: &str) -> DatasetPath {
    DatasetPath::new(path).expect("a path")
}

fn create(store: &StoreFolder, at: &str, text: &str) {
    let mut file = store.create(&path(at)).expect("writable").expect("new");
    file.write_all(text.as_bytes()).and_then(|()| file.flush()).expect("written");
}

fn text(store: &StoreFolder, at: &str) -> Option<String> {
    let bytes = store.read(&path(at)).expect("readable");
    bytes.map(|bytes| String::from_utf8(bytes).expect("text"))
}

/// All files with their content, by walking the folders.
fn all(store: &StoreFolder) -> Vec<(String, String)> {
    fn walk(store: &StoreFolder, folder: &str, found: &mut Vec<(String, String)>) {
        for (name, kind) in store.list(folder).expect("readable") {
            let at = if folder.is_empty() { name } else { format!("{folder}/{name}") };
            assert_eq!(store.look(&at).expect("readable").map(|found| found.kind), Some(kind), "{at}");
            match kind {
                Kind::Folder => walk(store, &at, found),
                _ => found.push((at.clone(), text(store, &at).expect("there"))),
            }
        }
    }
    let mut found = Vec::new();
    walk(store, "", &mut found);
    found.sort();
    found
}

fn pairs(all: &[(&str, &str)]) -> Vec<(String, String)> {
    all.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

fn files_are_created_once_replaced_whole_and_grow(store: &StoreFolder) {
    store.prepare().expect("writable");
    assert_eq!((store.list(""), store.list("no/such")), (Ok(vec![]), Ok(vec![])));
    assert!(store.look("a").is_ok_and(|found| found.is_none()) && text(store, "a").is_none());
    create(store, "a/b.txt", "first");
    assert!(store.create(&path("a/b.txt")).expect("readable").is_none(), "it exists");
    assert!(store.create(&path("a")).expect("readable").is_none(), "it is a folder");
    if has_folders(store) {
        store.create(&path("a/b.txt/c")).map(|file| file.is_some()).expect_err("below a file");
    }
    store.sync(&path("a/b.txt")).expect("there");
    store.sync(&path("a/c.txt")).expect_err("not there");
    store.write(&path("a/b.txt"), b"second").expect("replaced");
    store.write(&path("new/c.txt"), b"new").expect("written");
    // A file that cannot be filled leaves an existing file unchanged, and no other file behind.
    for at in ["a/b.txt", "none.txt"] {
        let error = store.put(&path(at), &mut |file| {
            file.write_all(b"half").expect("written");
            Err(Error::new("no more"))
        });
        assert_eq!(error.expect_err("it fails").message(), "no more");
    }
    store.append(&path("log"), b"").expect("created");
    store.append(&path("log"), b"one\n").and_then(|()| store.append(&path("log"), b"two\n")).expect("longer");
    assert_eq!(all(store), pairs(&[("a/b.txt", "second"), ("log", "one\ntwo\n"), ("new/c.txt", "new")]));
    let mut opened = store.open(&path("log")).expect("readable").expect("there");
    opened.seek(SeekFrom::Start(5)).expect("within");
    let mut rest = String::new();
    opened.read_to_string(&mut rest).expect("text");
    assert_eq!((opened.size, rest.as_str()), (8, "wo\n"));
    if has_folders(store) {
        let error = store.write(&path("a"), b"x").expect_err("it is a folder").to_string();
        assert!(error.contains(&store.name_of("a").display().to_string()), "{error}");
    }
}

fn one_of_many_writers_makes_a_new_file(store: &StoreFolder) {
    store.prepare().expect("writable");
    let write = |writer: usize| store.write_new(&path("a/lease"), format!("{writer}").repeat(1 << 16).as_bytes());
    let won: Vec<usize> = std::thread::scope(|threads| {
        let writers: Vec<_> = (0..8).map(|writer| (writer, threads.spawn(move || write(writer)))).collect();
        let ended = writers.into_iter().map(|(writer, thread)| (writer, thread.join().expect("no panic")));
        ended.filter(|(_, done)| *done == Ok(true)).map(|(writer, _)| writer).collect()
    });
    assert_eq!(won.len(), 1, "{won:?}");
    assert_eq!(all(store), [("a/lease".to_owned(), won[0].to_string().repeat(1 << 16))]);
    if has_folders(store) {
        assert_eq!(store.write_new(&path("a"), b"x"), Ok(false), "it is a folder");
        store.write_new(&path("a/lease/b"), b"x").expect_err("below a file");
    }
}

fn files_and_folders_are_moved_and_removed(store: &StoreFolder) {
    for (at, text) in [("s/x/1", "1"), ("s/x/2", "2"), ("s/y", "y"), ("s2", "s2"), ("t/1", "old")] {
        create(store, at, text);
    }
    store.rename(&path("s/x/1"), &path("t/1")).expect("replaced");
    store.rename(&path("s"), &path("u/v")).expect("a whole folder");
    store.rename(&path("no"), &path("w")).expect_err("not there");
    assert_eq!(all(store), pairs(&[("s2", "s2"), ("t/1", "1"), ("u/v/x/2", "2"), ("u/v/y", "y")]));
    // A folder that is empty then is removed, too. A folder with the name of the file to remove stays.
    store.remove(&path("t/1")).expect("removed");
    store.remove(&path("u/v/x")).expect("a folder stays");
    store.remove(&path("no/such")).expect("nothing to do");
    assert!(store.look("t").is_ok_and(|found| found.is_none()));
    assert_eq!(all(store), pairs(&[("s2", "s2"), ("u/v/x/2", "2"), ("u/v/y", "y")]));
    store.remove_all(&path("u/v")).expect("removed");
    store.remove_all(&path("s2")).expect("removed");
    store.remove_all(&path("s2")).expect("nothing to do");
    assert_eq!(all(store), pairs(&[]));
}

fn bytes_are_shared_or_copied(store: &StoreFolder) {
    let elsewhere = StoreFolder::from(Arc::new(MemStore::default()));
    create(&elsewhere, "far", "far");
    create(store, "a/one", "one");
    create(store, "three", "three");
    // A file that has the bytes already is replaced as any other.
    for to in ["b/two", "three", "three"] {
        if !store.share(store, &path("a/one"), &path(to)).expect("shared, or not") {
            assert!(store.is_remote(), "stores of this machine share");
            store.write(&path(to), b"one").expect("written");
        }
    }
    store.remove(&path("a/one")).expect("removed");
    assert_eq!(all(store), pairs(&[("b/two", "one"), ("three", "one")]));
    store.copy(&elsewhere, &path("far"), &path("c/near")).expect("copied");
    store.copy(&elsewhere, &path("no"), &path("c/no")).expect_err("not there");
    assert_eq!(text(store, "c/near").as_deref(), Some("far"));
}

fn many_read_or_one_writes(store: &StoreFolder) {
    let at = path("own/lock");
    let lock = |access| store.lock(&at, access).expect("lockable");
    assert!(lock(Access::Read).is_some(), "there is no lock yet");
    let writes = lock(Access::Write).expect("free");
    assert!(lock(Access::Write).is_none() && lock(Access::Read).is_none());
    drop(writes);
    let reads = [lock(Access::Read), lock(Access::Read)].map(|hold| hold.expect("free"));
    // Readers of a remote store leave no trace in it.
    assert_eq!(lock(Access::Write).is_none(), !store.is_remote());
    drop(reads);
    assert!(lock(Access::Write).is_some());
    let shares = [lock(Access::Share), lock(Access::Share)].map(|hold| hold.expect("free"));
    assert!(lock(Access::Write).is_none());
    drop(shares);
    let writes = lock(Access::Write).expect("free");
    assert!(lock(Access::Share).is_none());
    drop(writes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_and_folders_are_stores() {
        check_store(|| Arc::new(MemStore::default()).into());
        check_store(|| StoreFolder::from(Arc::new(MemStore::default())).inner(&path("a/b")));
        let folder = tempfile::tempdir().expect("a folder");
        let number = std::cell::Cell::new(0);
        let next = || {
            number.set(number.get() + 1);
            folder.path().join(number.get().to_string())
        };
        check_store(|| next().join("new").into());
        check_store(|| StoreFolder::from(&next()).inner(&path("in/side")));
    }
}
