//! Contents of folders and stores that a test wrote.

use std::collections::BTreeMap;
use std::path::Path;
use syntable_model::store::MemStore;

/// Contents of all files of a store except [`TIMES`], by path.
pub fn files_of_store(store: &MemStore) -> BTreeMap<String, Vec<u8>> {
    let files = store.files().into_iter().filter(|(path, _)| path.as_str() != TIMES);
    files.map(|(path, bytes)| (path.to_string(), bytes.to_vec())).collect()
}

/// Working times of runs: the only file of a dataset that its recipe does not determine.
const TIMES: &str = ".syntable/times.jsonl";

/// Contents of all files below a folder except [`TIMES`], by relative path with `/` between folders.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fn walk(folder: &Path, root: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                walk(&path, root, files);
            } else {
                let name = path.strip_prefix(root).expect("below").to_string_lossy();
                files.insert(name.replace(std::path::MAIN_SEPARATOR, "/"), std::fs::read(&path).expect("readable"));
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(folder, folder, &mut found);
    found.remove(TIMES);
    found
}
