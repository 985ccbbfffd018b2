//! Links in the folder of a store.

use super::*;

fn path(path: &str) -> DatasetPath {
    DatasetPath::new(path).expect("a path")
}

#[cfg(unix)]
#[test]
fn nothing_behind_a_link_is_moved_or_removed() {
    let above = std::env::temp_dir().join(format!("syntable-links-{}", std::process::id()));
    let (root, other) = (above.join("data"), above.join("other"));
    for folder in [&root, &other] {
        std::fs::create_dir_all(folder).expect("writable");
    }
    std::fs::write(other.join("mine"), "mine").expect("writable");
    std::os::unix::fs::symlink("../other", root.join("link")).expect("linked");
    std::os::unix::fs::symlink("../other/mine", root.join("file")).expect("linked");
    let store = StoreFolder::from(&root);
    let found = store.look("link").expect("readable").expect("there");
    assert_eq!((found.kind, found.leads_to.as_deref()), (Kind::Link, Some("../other")));
    store.write(&path("new"), b"new").expect("writable");
    for error in [
        store.rename(&path("new"), &path("link/mine")).expect_err("behind a link"),
        store.remove(&path("link/mine")).expect_err("behind a link"),
    ] {
        assert!(error.to_string().contains("`link` is a link"), "{error}");
    }
    store.append(&path("file"), b"more").expect_err("a link");
    // Links themselves are replaced and removed.
    store.rename(&path("new"), &path("file")).expect("replaced");
    store.remove_all(&path("link")).expect("removed");
    assert_eq!(store.list(""), Ok(vec![("file".to_owned(), Kind::File)]));
    assert_eq!(store.read(&path("file")), Ok(Some(b"new".to_vec())));
    assert_eq!(std::fs::read_to_string(other.join("mine")).expect("there"), "mine");
    std::fs::remove_dir_all(above).expect("removable");
}
