//! Waits for a save.
//!
//! Files are polled many times per second. Polling works on every file system, including network folders, follows
//! editors that save by renaming, and needs no package; a recipe has few small files. Only content matters: a save
//! without a change is ignored. A file has changed if two polls in a row find the same new content, and is gone if it
//! stays missing for a while.

use parking_lot::{Condvar, Mutex};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant, SystemTime};
use syntable_model::digest::Digest;
use syntable_runtime::run::stop::Stop;

/// Interval between two polls.
const LOOK: Duration = Duration::from_millis(50);
/// Time until a changed file is polled again; its content must then be the same.
const SETTLED: Duration = Duration::from_millis(15);
/// Time after which a missing file counts as gone: editors that save by renaming remove it for a moment.
const GONE: Duration = Duration::from_millis(500);
/// Maximum delay of file times relative to the clock: file systems use a clock with coarse ticks.
const TICK: Duration = Duration::from_millis(40);
/// Size up to which files are read at every poll, bytes. For larger files, size and modification time are compared
/// first.
const SMALL: u64 = 1 << 20;

/// Files with their last known content.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WatchedFiles(BTreeMap<PathBuf, FileStamp>);

/// Last known state of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FileStamp {
    /// Digest of the content; `None` for an unreadable file.
    content: Option<Digest>,
    /// Size and modification time of a large file.
    stamp: Option<(u64, SystemTime)>,
}

impl WatchedFiles {
    /// Adds a file that was read, with the bytes read.
    pub fn read(&mut self, path: &Path, bytes: &[u8]) {
        // The same digest as when the file is read again.
        let content = Digest::of_reader(bytes).ok().map(|(digest, _)| digest);
        self.0.insert(path.to_owned(), FileStamp { content, stamp: None });
    }

    /// Adds a file that could not be read.
    pub fn expect(&mut self, path: &Path) {
        self.0.entry(path.to_owned()).or_insert(FileStamp { content: None, stamp: None });
    }

    /// Adds a file that was read after `since`, with its current content. A file that was written after `since` counts
    /// as changed, because the content that was read is unknown. Folders are ignored.
    pub fn add(&mut self, path: &Path, since: SystemTime) {
        if !path.is_dir() && !self.0.contains_key(path) {
            let written = path.metadata().and_then(|metadata| metadata.modified());
            let is_late = written.is_ok_and(|at| at + TICK >= since && at <= SystemTime::now());
            let known = if is_late { FileStamp { content: None, stamp: None } } else { look(path, None) };
            self.0.insert(path.to_owned(), known);
        }
    }

    /// Adds the files of an earlier list that are missing here.
    pub fn add_all(&mut self, others: &Self) {
        for (path, known) in &others.0 {
            self.0.entry(path.clone()).or_insert(*known);
        }
    }

    /// Whether a file has changed, according to two polls in a row.
    fn changed(&mut self, gone: &mut BTreeMap<PathBuf, Instant>) -> bool {
        self.0.iter_mut().any(|(path, known)| {
            let now = look(path, Some(known));
            if now.content == known.content {
                gone.remove(path);
                *known = now;
                return false;
            }
            if now.content.is_none() {
                return gone.entry(path.clone()).or_insert_with(Instant::now).elapsed() >= GONE;
            }
            gone.remove(path);
            thread::sleep(SETTLED);
            look(path, None).content == now.content
        })
    }
}

/// Current state of a file. The known digest of a large file remains valid while size and time are unchanged.
fn look(path: &Path, known: Option<&FileStamp>) -> FileStamp {
    let nothing = FileStamp { content: None, stamp: None };
    let Ok(metadata) = path.metadata() else { return nothing };
    if !metadata.is_file() {
        return nothing;
    }
    let large = metadata.len() > SMALL;
    let stamp = metadata.modified().ok().filter(|_| large).map(|time| (metadata.len(), time));
    if let Some(known) = known.filter(|known| known.stamp.is_some() && known.stamp == stamp) {
        return *known;
    }
    let content = File::open(path).and_then(Digest::of_reader).ok().map(|(digest, _)| digest);
    FileStamp { content, stamp }
}

/// Watched files, shared with the work that depends on them.
#[derive(Default)]
pub struct Watch {
    state: Mutex<WatchState>,
    told: Condvar,
}

#[derive(Default)]
struct WatchState {
    files: WatchedFiles,
    has_changed: bool,
    /// Stops work that a change makes obsolete.
    work: Stop,
}

impl Watch {
    /// Announces that work begins on files that are about to be read. Any later change stops this work.
    pub fn begin(&self) -> Stop {
        let mut state = self.state.lock();
        *state = WatchState::default();
        state.work.clone()
    }

    /// Sets the files that the work read.
    pub fn set(&self, files: WatchedFiles) {
        self.state.lock().files = files;
    }

    /// Ends the current work, as a change does.
    pub fn interrupt(&self) {
        let mut state = self.state.lock();
        state.has_changed = true;
        state.work.cancel();
        self.told.notify_all();
    }

    /// Waits for a change, at most for the given time. Returns at once if the program must stop.
    pub fn wait(&self, time: Option<Duration>, stop: &Stop) {
        let mut state = self.state.lock();
        let until = time.map(|time| Instant::now() + time);
        while !state.has_changed && !stop.is_requested() {
            let over = match until {
                Some(until) => self.told.wait_until(&mut state, until).timed_out(),
                None => {
                    self.told.wait(&mut state);
                    false
                }
            };
            if over {
                break;
            }
        }
    }

    /// Polls the files until the program must stop.
    pub fn run(&self, stop: &Stop) {
        let mut gone = BTreeMap::new();
        while !stop.is_requested() {
            thread::sleep(LOOK);
            let mut files = {
                let state = self.state.lock();
                if state.has_changed {
                    continue;
                }
                state.files.clone()
            };
            let before = files.clone();
            let has_changed = files.changed(&mut gone);
            let mut state = self.state.lock();
            // New work may have begun in the meantime.
            if state.files == before {
                state.files = files;
                if has_changed {
                    state.has_changed = true;
                    state.work.cancel();
                    self.told.notify_all();
                }
            }
        }
        let state = self.state.lock();
        state.work.cancel();
        self.told.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Watches a file, and returns whether `act` on it is detected as a change.
    fn changes(act: impl FnOnce(&Path), time: Duration) -> bool {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("recipe.toml");
        fs::write(&path, "a = 1\n").expect("written");
        let (watch, stop) = (Watch::default(), Stop::default());
        thread::scope(|scope| {
            scope.spawn(|| watch.run(&stop));
            let work = watch.begin();
            let mut files = WatchedFiles::default();
            files.read(&path, b"a = 1\n");
            watch.set(files);
            act(&path);
            watch.wait(Some(time), &stop);
            let changed = work.is_requested();
            stop.cancel();
            changed
        })
    }

    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn a_save_is_seen() {
        assert!(changes(|path| fs::write(path, "a = 2\n").expect("written"), LONG));
        // Saves by renaming, as many editors do.
        let by_renaming = |path: &Path| {
            let other = path.with_extension("swp");
            fs::write(&other, "a = 3\n").expect("written");
            fs::rename(other, path).expect("renamed");
        };
        assert!(changes(by_renaming, LONG));
    }

    #[test]
    fn a_save_without_a_change_is_none_and_neither_is_a_moment_without_the_file() {
        let short = Duration::from_millis(300);
        assert!(!changes(|path| fs::write(path, "a = 1\n").expect("written"), short));
        let gone_for_a_moment = |path: &Path| {
            fs::remove_file(path).expect("removed");
            thread::sleep(Duration::from_millis(120));
            fs::write(path, "a = 1\n").expect("written");
        };
        assert!(!changes(gone_for_a_moment, short));
        assert!(changes(|path| fs::remove_file(path).expect("removed"), LONG));
    }

    #[test]
    fn a_change_of_before_the_files_were_known_is_seen() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("recipe.toml");
        fs::write(&path, "old").expect("written");
        let mut files = WatchedFiles::default();
        files.read(&path, b"read before that");
        assert!(files.changed(&mut BTreeMap::new()));
        // A missing file appears.
        let mut files = WatchedFiles::default();
        let other = folder.path().join("other.toml");
        files.expect(&other);
        assert!(!files.changed(&mut BTreeMap::new()));
        fs::write(&other, "new").expect("written");
        assert!(files.changed(&mut BTreeMap::new()));
    }

    #[test]
    fn a_file_that_changed_while_it_was_read_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("points.json");
        let since = SystemTime::now() - Duration::from_secs(1);
        fs::write(&path, "new").expect("written");
        let mut files = WatchedFiles::default();
        files.add(&path, since);
        assert!(files.changed(&mut BTreeMap::new()));
    }

    #[test]
    fn a_file_that_changed_in_the_tick_in_which_it_was_read_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("points.json");
        // With ticks of 10 ms, a file system may date a save after the read to before the read.
        fs::write(&path, "new").expect("written");
        let since = SystemTime::now();
        let file = File::options().write(true).open(&path).expect("there");
        file.set_modified(since - Duration::from_millis(10)).expect("a time");
        let mut files = WatchedFiles::default();
        files.add(&path, since);
        assert!(files.changed(&mut BTreeMap::new()));
    }

    #[test]
    fn large_files_are_read_when_size_or_time_change() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("list.txt");
        fs::write(&path, vec![1; 2 << 20]).expect("written");
        let mut files = WatchedFiles::default();
        // `since` is long after the write, even for a clock with coarse ticks.
        let later = SystemTime::now() + Duration::from_secs(1);
        files.add(&path, later);
        assert!(!files.changed(&mut BTreeMap::new()));
        fs::write(&path, vec![2; 3 << 20]).expect("written");
        assert!(files.changed(&mut BTreeMap::new()));
    }
}
