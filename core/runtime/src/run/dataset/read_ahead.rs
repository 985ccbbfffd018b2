//! Shards of a writer that threads read and compare with their digests while the writer joins earlier ones.

use crate::run::dataset::scene_files::SceneFiles;
use parking_lot::Mutex;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, JoinHandle};
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::scene::SceneId;
use syntable_model::stage::shard_path;
use syntable_model::store::StoredFile;

/// Number of threads. Each holds at most two shards.
const READERS: usize = 4;

/// Opens the shards of a writer, in memory if they are small. Threads read the shards of later scenes meanwhile.
pub struct ReadAhead {
    files: Arc<SceneFiles>,
    id: String,
    /// The scenes of the writer, ascending.
    scenes: Arc<[SceneId]>,
    ahead: Mutex<Option<Ahead>>,
}

/// The shards that threads read.
struct Ahead {
    /// Position of the next scene.
    next: usize,
    /// The readers. Reader `i % READERS` sends the shard of position `i`.
    readers: Vec<Reader>,
}

/// A thread that reads every [`READERS`]-th shard.
struct Reader {
    shards: Option<Receiver<Result<StoredFile>>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Reader {
    fn drop(&mut self) {
        // Without a receiver the thread ends after the shard that it reads.
        self.shards = None;
        // A panic of the thread was reported when its shard was missing.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl ReadAhead {
    /// The shards of the writer `id` for some scenes, ascending.
    pub fn new(files: &Arc<SceneFiles>, id: &str, scenes: &[SceneId]) -> Self {
        Self { files: files.clone(), id: id.to_owned(), scenes: scenes.into(), ahead: Mutex::default() }
    }

    /// Opens a shard of a scene. Writers that ask for scenes in order wait the least.
    ///
    /// # Errors
    /// As of [`SceneFiles::open`].
    pub fn open(&self, scene: SceneId, path: &DatasetPath) -> Result<StoredFile> {
        self.next_shard(scene, path).unwrap_or_else(|| self.files.open(scene, path))
    }

    /// The shard of the next scene; none if the scene is not the next, or if no thread can read it.
    fn next_shard(&self, scene: SceneId, path: &DatasetPath) -> Option<Result<StoredFile>> {
        let position = self.scenes.binary_search(&scene).ok()?;
        if shard_path(&self.id, scene).ok().as_ref() != Some(path) {
            return None;
        }
        let ahead = self.ahead.lock().take().filter(|ahead| ahead.next == position);
        // A pass over one scene needs no thread, nor does a single look into the middle.
        let is_start = position == 0 && self.scenes.len() > 1;
        let mut ahead = ahead.or_else(|| is_start.then(|| self.start()).flatten())?;
        let shard = ahead.readers[position % READERS].shards.as_ref()?.recv().ok();
        ahead.next += 1;
        *self.ahead.lock() = Some(ahead);
        shard
    }

    /// Starts to read from the first scene on; none if the system starts no thread.
    fn start(&self) -> Option<Ahead> {
        let reader = |first: usize| {
            let (sender, receiver) = sync_channel(1);
            let (files, id, scenes) = (self.files.clone(), self.id.clone(), self.scenes.clone());
            let read = move || {
                for &scene in scenes.iter().skip(first).step_by(READERS) {
                    let opened = shard_path(&id, scene).and_then(|path| files.open(scene, &path));
                    if sender.send(opened).is_err() {
                        break;
                    }
                }
            };
            let thread = thread::Builder::new().name("shards".to_owned()).spawn(read).ok()?;
            Some(Reader { shards: Some(receiver), thread: Some(thread) })
        };
        Some(Ahead { next: 0, readers: (0..READERS).map(reader).collect::<Option<_>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::journal::{Entries, JournalEntry, SceneOutcome};
    use crate::run::dataset::layout;
    use crate::run::dataset::manifest::{Manifest, Stamp};
    use std::io::Read;
    use syntable_model::store::{MemStore, StoreFolder};

    #[test]
    fn shards_come_in_order_in_every_pass_and_the_damaged_one_is_named() {
        let dataset = StoreFolder::from(Arc::new(MemStore::default()));
        // Every other scene has a shard.
        let scenes: Vec<SceneId> = (0..30).step_by(2).map(SceneId).collect();
        let entries: Vec<JournalEntry> = scenes
            .iter()
            .map(|&SceneId(scene)| {
                let path = shard_path("jsonl", SceneId(scene)).expect("a path");
                let mut files = Manifest::default();
                files.files.insert(path.clone(), Stamp::of_text(&format!("shard {scene}")));
                let (text, manifest) = files.text();
                dataset.write(&layout::manifest(scene), text.as_bytes()).expect("writable");
                let content = if scene == 20 { "shard 2?".to_owned() } else { format!("shard {scene}") };
                dataset.write(&path, content.as_bytes()).expect("writable");
                let (writers, recorded) = (vec!["jsonl".to_owned()], Vec::new());
                JournalEntry::new(scene, 0, SceneOutcome::Made { views: 1, objects: 1, writers, recorded, manifest })
            })
            .collect();
        let files = Arc::new(SceneFiles::new(&dataset, &Entries::from_iter(&entries)));
        let shards = ReadAhead::new(&files, "jsonl", &scenes);
        let open = |scene: SceneId| {
            let mut text = String::new();
            let path = shard_path("jsonl", scene).expect("a path");
            shards.open(scene, &path)?.read_to_string(&mut text).expect("in memory");
            Ok(text)
        };
        let is_right = |scene: SceneId, opened: Result<String>| match scene.0 {
            20 => assert!(opened.expect_err("damaged").to_string().contains("000020.jsonl")),
            number => assert_eq!(opened.expect("whole"), format!("shard {number}")),
        };
        // Whole passes, one that ends early, and looks in any order.
        for count in [scenes.len(), 3, scenes.len()] {
            scenes[..count].iter().for_each(|&scene| is_right(scene, open(scene)));
        }
        for scene in [scenes[4], scenes[0], scenes[9], scenes[1], scenes[10], scenes[10]] {
            is_right(scene, open(scene));
        }
        assert!(open(SceneId(3)).is_err());
    }
}
