//! Claims of workers on blocks of scenes, so that several workers make one dataset without a master.
//!
//! A claim is a file that must be new, and that its worker writes again and again. If it stays the same for a while, as
//! another worker's own clock measures it, its worker is gone or too slow: the other worker takes the block over, with a
//! file of the next generation, which must be new, too. A claim only spares work. Two workers that make the same scene
//! write the same bytes, and the line of a scene is written once.

use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, LineFiles};
use crate::run::dataset::layout;
use crate::run::dataset::requests;
use crate::run::dataset::vanished::vanished;
use crate::run::stop::Stop;
use parking_lot::{Condvar, Mutex};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::limits::RUN_LIST_BYTES;
use syntable_model::store::{Kind, StoreFolder};

/// How a worker claims scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClaimOptions {
    /// Number of consecutive scenes of a claim; the same for all workers of a dataset. At least 1.
    pub block: u32,
    /// Time without a sign of life after which another worker takes a claim over.
    pub lease: Duration,
}

impl Default for ClaimOptions {
    fn default() -> Self {
        Self { block: 1, lease: Duration::from_secs(60) }
    }
}

/// Signs of life of a worker in the time of a lease.
const SIGNS: u32 = 4;
/// Looks at the claims of other workers in the time of a lease, while no block is free.
const LOOKS: u32 = 20;
/// Longest time between two such looks.
const LOOK: Duration = Duration::from_secs(5);
/// Blocks in a row that others have claimed before a worker lists all claims.
const TAKEN: u32 = 4;
/// Highest generation of a claim. The worker that takes this one over removes the generations of the block, and starts with
/// 0. The claim of a higher one is foreign, and does not count.
const GENERATIONS: u32 = 10_000;

/// The blocks of scenes that a worker and others make.
pub struct Claims {
    shared: Arc<Shared>,
    options: ClaimOptions,
    /// Scenes to make, ascending.
    todo: Vec<u32>,
    blocks: Mutex<Blocks>,
    /// Held while a thread looks at the claims of other workers.
    looks: Mutex<()>,
    renews: Option<JoinHandle<()>>,
}

/// The state that the worker shares with the thread that renews its claims.
struct Shared {
    dataset: StoreFolder,
    worker: String,
    lease: Duration,
    held: Mutex<Held>,
    ends: Condvar,
    /// The recipe of the dataset is gone.
    has_vanished: AtomicBool,
}

/// The claims of this worker: the generations of each block, the own one last.
#[derive(Default)]
struct Held {
    claims: BTreeMap<u32, Vec<u32>>,
    is_over: bool,
}

/// The blocks that are not known to be done.
struct Blocks {
    /// Their numbers.
    left: BTreeSet<u32>,
    /// Blocks to try, the next one last.
    free: Vec<u32>,
    /// Blocks that other workers claim.
    others: BTreeMap<u32, Other>,
    /// Blocks in a row that others had claimed.
    taken: u32,
}

/// A claim of another worker.
struct Other {
    /// The generations of its block, the newest one last.
    generations: Vec<u32>,
    content: Vec<u8>,
    /// When this worker first saw the content.
    since: Instant,
}

impl Claims {
    /// The blocks of some scenes. `worker` is a name that no other worker has; it decides where this worker begins, so
    /// that workers seldom meet.
    pub fn new(dataset: &StoreFolder, worker: &str, options: ClaimOptions, todo: impl Iterator<Item = u32>) -> Self {
        let mut todo: Vec<u32> = todo.collect();
        todo.sort_unstable();
        let left: BTreeSet<u32> = todo.iter().map(|scene| scene / options.block * options.block).collect();
        let mut free: Vec<u32> = left.iter().rev().copied().collect();
        let start = u64::from_str_radix(worker, 16).unwrap_or_default() % (free.len() as u64).max(1);
        free.rotate_left(start as usize);
        let (dataset, worker) = (dataset.clone(), worker.to_owned());
        let lease = options.lease;
        let shared = Arc::new(Shared {
            dataset,
            worker,
            lease,
            held: Mutex::default(),
            ends: Condvar::new(),
            has_vanished: AtomicBool::new(false),
        });
        let blocks = Mutex::new(Blocks { left, free, others: BTreeMap::new(), taken: 0 });
        let renews = {
            let (shared, pause) = (Arc::clone(&shared), lease / SIGNS);
            thread::spawn(move || shared.renew(pause))
        };
        Self { shared, options, todo, blocks, looks: Mutex::default(), renews: Some(renews) }
    }

    /// Claims the next block: its number and its scenes without a line. Waits while other workers have all
    /// blocks, because one of them may be gone. None if all scenes are made, or the work is to stop.
    ///
    /// # Errors
    /// If the dataset vanished, or a file of it cannot be read or written.
    pub fn next(&self, stop: &Stop) -> Result<Option<(u32, Vec<u32>)>> {
        while !stop.is_requested() {
            if self.shared.has_vanished.load(Ordering::Relaxed) {
                return Err(vanished(&self.shared.dataset));
            }
            let mut blocks = self.blocks.lock();
            if blocks.taken >= TAKEN || (blocks.free.is_empty() && !blocks.left.is_empty()) {
                blocks.taken = 0;
                drop(blocks);
                self.look()?;
                blocks = self.blocks.lock();
            }
            if let Some(block) = blocks.free.pop() {
                let older = blocks.others.remove(&block).map_or_else(Vec::new, |other| other.generations);
                if let Some(claimed) = self.claim(&mut blocks, block, older)? {
                    return Ok(Some(claimed));
                }
                continue;
            }
            let is_over = blocks.left.is_empty();
            drop(blocks);
            if is_over {
                return Ok(None);
            }
            thread::sleep((self.options.lease / LOOKS).min(LOOK));
        }
        Ok(None)
    }

    /// Tries to claim a block whose last worker is gone, with the older generations of its claim. Returns its scenes without
    /// a line; none if another worker has it or has made it.
    fn claim(&self, blocks: &mut Blocks, block: u32, mut generations: Vec<u32>) -> Result<Option<(u32, Vec<u32>)>> {
        let dataset = &self.shared.dataset;
        if generations.last().is_some_and(|newest| *newest >= GENERATIONS) {
            self.remove(block, &std::mem::take(&mut generations))?;
        }
        let generation = generations.last().map_or(0, |newest| newest + 1);
        generations.push(generation);
        if !dataset.write_new(&layout::claim(block, generation), self.shared.sign(0).as_bytes())? {
            blocks.taken += 1;
            // It is read when all claims are looked at.
            blocks.others.insert(block, Other { generations, content: Vec::new(), since: Instant::now() });
            return Ok(None);
        }
        blocks.taken = 0;
        self.shared.held.lock().claims.insert(block, generations);
        // Its last worker may have made it since the lines were listed.
        let mut scenes = Vec::new();
        for &scene in self.scenes_of(block) {
            if !Journal::has_file_of(dataset, scene)? {
                scenes.push(scene);
            }
        }
        if scenes.is_empty() {
            blocks.left.remove(&block);
            self.release(block)?;
            return Ok(None);
        }
        Ok(Some((block, scenes)))
    }

    /// The scenes of a block, ascending.
    fn scenes_of(&self, block: u32) -> &[u32] {
        let start = self.todo.partition_point(|scene| *scene < block);
        let length = self.todo[start..].partition_point(|scene| scene - block < self.options.block);
        &self.todo[start..start + length]
    }

    /// Marks a claimed block as done, and gives the claim back.
    pub fn done(&self, block: u32) -> Result<()> {
        self.blocks.lock().left.remove(&block);
        self.release(block)
    }

    fn release(&self, block: u32) -> Result<()> {
        let generations = self.shared.held.lock().claims.remove(&block).unwrap_or_default();
        // The claims of workers that are gone end with it.
        self.remove(block, &generations)
    }

    fn remove(&self, block: u32, generations: &[u32]) -> Result<()> {
        let dataset = &self.shared.dataset;
        generations.iter().try_for_each(|generation| dataset.remove(&layout::claim(block, *generation)))
    }

    /// Looks at all claims and lines: finds blocks that are done, and blocks that are free again. If another thread of this
    /// worker is looking, waits for it instead.
    fn look(&self) -> Result<()> {
        let Some(_looks) = self.looks.try_lock() else {
            drop(self.looks.lock());
            return Ok(());
        };
        let dataset = &self.shared.dataset;
        let mut claims = claims_of(dataset)?;
        // Lines are listed after claims: a worker writes its lines before it gives its claim back.
        let lines = LineFiles::of(dataset)?;
        {
            let mut blocks = self.blocks.lock();
            let held = self.shared.held.lock();
            let is_made = |block: u32| self.scenes_of(block).iter().all(|scene| lines.has(*scene));
            blocks.left.retain(|block| held.claims.contains_key(block) || !is_made(*block));
            claims.retain(|block, _| blocks.left.contains(block) && !held.claims.contains_key(block));
        }
        // Other threads claim blocks and give them back meanwhile.
        let start = Instant::now();
        let newest = claims.iter().filter_map(|(block, generations)| Some(layout::claim(*block, *generations.last()?)));
        let contents = requests::read(dataset, &newest.collect::<Vec<_>>(), &RUN_LIST_BYTES)?;
        let mut claims: BTreeMap<u32, Other> = claims
            .into_iter()
            .zip(contents)
            .map(|((block, generations), content)| {
                (block, Other { generations, content: content.unwrap_or_default(), since: Instant::now() })
            })
            .collect();
        let mut blocks = self.blocks.lock();
        let held = self.shared.held.lock();
        let Blocks { left, free, others, .. } = &mut *blocks;
        let known: BTreeSet<u32> = free.iter().copied().collect();
        let (mut claimed, mut again) = (BTreeSet::new(), Vec::new());
        others.retain(|block, _| left.contains(block));
        for &block in left.iter().filter(|block| !held.claims.contains_key(block)) {
            let seen = others.remove(&block);
            let Some(mut found) = claims.remove(&block) else {
                if !known.contains(&block) {
                    again.push(block);
                }
                continue;
            };
            if let Some(seen) = seen.filter(|seen| seen.is_same(&found)) {
                found.since = seen.since;
            }
            claimed.insert(block);
            if start.saturating_duration_since(found.since) > self.options.lease {
                again.push(block);
            }
            others.insert(block, found);
        }
        free.retain(|block| left.contains(block) && !claimed.contains(block));
        free.append(&mut again);
        Ok(())
    }
}

impl Other {
    /// Whether a claim got no sign of life between two looks.
    fn is_same(&self, other: &Self) -> bool {
        self.generations.last() == other.generations.last() && self.content == other.content
    }
}

impl Drop for Claims {
    fn drop(&mut self) {
        self.shared.held.lock().is_over = true;
        self.shared.ends.notify_all();
        if let Some(renews) = self.renews.take() {
            let _ = renews.join();
        }
        // Other workers need not wait for the end of the leases.
        let blocks: Vec<u32> = self.shared.held.lock().claims.keys().copied().collect();
        blocks.into_iter().for_each(|block| drop(self.release(block)));
    }
}

impl Shared {
    fn sign(&self, number: u64) -> String {
        let Self { worker, lease, .. } = self;
        format!("{{\"worker\":\"{worker}\",\"sign\":{number},\"lease_s\":{}}}\n", lease.as_secs_f64())
    }

    /// Writes signs of life until the work is over, or the dataset has vanished. A sign that cannot be written is missing, as
    /// if the worker were slow.
    fn renew(&self, pause: Duration) {
        for number in 1.. {
            let claims = {
                let mut held = self.held.lock();
                let end = Instant::now() + pause;
                while !held.is_over && !self.ends.wait_until(&mut held, end).timed_out() {}
                if held.is_over {
                    return;
                }
                let own = held.claims.iter().filter_map(|(block, generations)| Some((*block, *generations.last()?)));
                own.collect::<Vec<_>>()
            };
            if self.dataset.has(&layout::recipe()) == Ok(false) {
                self.has_vanished.store(true, Ordering::Relaxed);
                return;
            }
            for (block, generation) in claims {
                // The claim may have been given back meanwhile.
                let held = self.held.lock();
                if held.claims.get(&block).and_then(|generations| generations.last()) == Some(&generation) {
                    let _ = self.dataset.write(&layout::claim(block, generation), self.sign(number).as_bytes());
                }
            }
        }
    }
}

/// Shortest time after which a claim that no worker has renewed says nothing about workers.
const STALE: Duration = Duration::from_secs(180);
/// Longest time of a lease that counts here.
const LONGEST: Duration = Duration::from_secs(24 * 3600);
/// Most bytes of a claim that is read here.
const CLAIM_BYTES: u64 = 1000;

/// The part of a claim that is read here.
#[derive(Deserialize)]
struct Sign {
    lease_s: f64,
}

/// Whether workers have claims on a dataset, by the clocks of this machine and of the store.
pub fn are_renewed(dataset: &StoreFolder) -> Result<bool> {
    for (name, _) in dataset.list(&layout::claims())? {
        if is_renewed(dataset, &format!("{}/{name}", layout::claims()))? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn is_renewed(dataset: &StoreFolder, path: &str) -> Result<bool> {
    let Some(found) = dataset.look(path)? else { return Ok(false) };
    let Some(modified) = found.modified else { return Ok(false) };
    // The clock of the store may be ahead.
    let Ok(age) = SystemTime::now().duration_since(modified) else { return Ok(true) };
    if age < STALE {
        return Ok(true);
    }
    let is_read = age < LONGEST && found.kind == Kind::File && found.size <= CLAIM_BYTES;
    let Some(path) = DatasetPath::new(path).ok().filter(|_| is_read) else { return Ok(false) };
    let sign: Option<Sign> = serde_json::from_slice(&foreign::read(dataset, &path)?).ok();
    let lease = sign.and_then(|sign| Duration::try_from_secs_f64(sign.lease_s).ok());
    Ok(lease.is_some_and(|lease| age < lease))
}

/// The generations of each claim, ascending. Names that no worker writes are left out.
fn claims_of(dataset: &StoreFolder) -> Result<BTreeMap<u32, Vec<u32>>> {
    let (mut claims, folder): (BTreeMap<u32, Vec<u32>>, _) = (BTreeMap::new(), layout::claims());
    for (name, _) in dataset.list(&folder)? {
        let Some(stem) = name.strip_suffix(".json") else { continue };
        let (block, generation) = stem.split_once('-').unwrap_or((stem, "0"));
        let (Ok(block), Ok(generation)) = (block.parse(), generation.parse()) else { continue };
        if generation <= GENERATIONS && layout::claim(block, generation).as_str() == format!("{folder}/{name}") {
            claims.entry(block).or_default().push(generation);
        }
    }
    claims.values_mut().for_each(|generations| generations.sort_unstable());
    Ok(claims)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::locking;
    use std::fs;
    use std::sync::atomic::AtomicU32;
    use std::sync::{OnceLock, Weak};
    use syntable_model::store::{Access, MemStore};
    use syntable_testing::fault_store::{Fault, FaultStore};

    const OPTIONS: ClaimOptions = ClaimOptions { block: 1, lease: Duration::from_millis(40) };

    /// A dataset in memory. Workers stop if it has no recipe.
    fn begun(store: MemStore) -> Arc<MemStore> {
        store.insert(layout::recipe(), b"recipe".to_vec());
        Arc::new(store)
    }

    /// A claim that its worker left.
    fn leave(store: &MemStore, name: &str) {
        let path = layout::claims().join(&DatasetPath::new(name).expect("a path"));
        store.insert(path, b"{\"worker\":\"0\",\"sign\":0}\n".to_vec());
    }

    /// The names of all claims.
    fn names(store: &MemStore) -> Vec<String> {
        let all = store.files().into_keys();
        all.filter_map(|path| Some(path.strip_prefix(".syntable/claims/")?.to_owned())).collect()
    }

    #[test]
    fn foreign_generations_do_not_count() {
        for name in
            ["000000-4294967295.json", "000000-4000000000.json", "000000-10001.json", "0-7.json", "000000-07.json"]
        {
            let store = begun(MemStore::default());
            leave(&store, name);
            let claims = Claims::new(&Arc::clone(&store).into(), "0", OPTIONS, 0..1);
            claims.look().expect("readable");
            assert_eq!(claims.next(&Stop::default()), Ok(Some((0, vec![0]))), "{name}");
            assert!(names(&store).contains(&"000000.json".to_owned()), "{name}");
            claims.done(0).expect("given back");
            assert_eq!(names(&store), [name]);
        }
    }

    #[test]
    fn all_generations_of_a_claim_end_with_it() {
        for (left, taken) in [
            (vec!["000000.json"], "000000-1.json"),
            (vec!["000000-3.json", "000000-17.json"], "000000-18.json"),
            (vec!["000000.json", "000000-10000.json"], "000000.json"),
        ] {
            let store = begun(MemStore::default());
            left.iter().for_each(|name| leave(&store, name));
            let claims = Claims::new(&Arc::clone(&store).into(), "0", OPTIONS, 0..1);
            claims.look().expect("readable");
            assert_eq!(claims.next(&Stop::default()), Ok(Some((0, vec![0]))), "{left:?}");
            assert!(names(&store).contains(&taken.to_owned()), "{left:?}");
            drop(claims);
            assert!(names(&store).is_empty(), "{left:?}");
        }
    }

    /// Clocks may differ, and a worker with a long lease seldom gives a sign of life.
    #[test]
    fn readers_wait_for_workers_with_any_clock_and_lease() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = StoreFolder::from(folder.path());
        dataset.write(&layout::recipe(), b"recipe").expect("writable");
        let path = layout::claim(0, 0).below(folder.path());
        let lease = |lease: u64| ClaimOptions { block: 1, lease: Duration::from_secs(lease) };
        for (options, age, is_renewed) in [
            (lease(60), -3600, true),
            (lease(60), 0, true),
            (lease(60), 170, true),
            (lease(60), 190, false),
            (lease(3600), 3500, true),
            (lease(3600), 3700, false),
            (lease(500_000), 86_500, false),
        ] {
            let claims = Claims::new(&dataset, "0", options, 0..1);
            assert_eq!(claims.next(&Stop::default()), Ok(Some((0, vec![0]))));
            let by = Duration::from_secs(i64::unsigned_abs(age));
            let time = if age < 0 { SystemTime::now() + by } else { SystemTime::now() - by };
            let file = fs::File::options().write(true).open(&path).expect("there");
            file.set_modified(time).expect("writable");
            assert_eq!(are_renewed(&dataset), Ok(is_renewed), "{options:?}, {age} s");
            let hold = locking::try_lock(&dataset, Access::Read).expect("readable");
            assert_eq!(hold.is_none(), is_renewed, "{options:?}, {age} s");
        }
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        for text in ["", "{}", r#"{"lease_s":-1}"#, r#"{"lease_s":1e300}"#, &" ".repeat(2000)] {
            fs::write(&path, text).expect("writable");
            let file = fs::File::options().write(true).open(&path).expect("there");
            file.set_modified(SystemTime::now() - Duration::from_secs(3000)).expect("writable");
            assert_eq!(are_renewed(&dataset), Ok(false), "{text}");
        }
    }

    /// Each call takes 20 ms, as in an object store.
    #[test]
    fn a_look_reads_claims_at_once_and_stops_no_thread() {
        let store = begun(MemStore::remote());
        (0..64).for_each(|block| leave(&store, &format!("{block:06}.json")));
        let looking: Arc<OnceLock<Weak<Claims>>> = Arc::default();
        let (calls, waits): (Arc<AtomicU32>, Arc<AtomicU32>) = Default::default();
        let plan = {
            let (looking, calls, waits) = (Arc::clone(&looking), Arc::clone(&calls), Arc::clone(&waits));
            move |_| {
                let claims = looking.get()?.upgrade()?;
                calls.fetch_add(1, Ordering::SeqCst);
                let has_to_wait = claims.blocks.try_lock().is_none();
                waits.fetch_add(u32::from(has_to_wait), Ordering::SeqCst);
                Some(Fault::Slow(Duration::from_millis(20)))
            }
        };
        let slow = Arc::new(FaultStore::new(Arc::clone(&store), plan));
        let options = ClaimOptions { block: 1, lease: Duration::from_secs(60) };
        let claims = Arc::new(Claims::new(&slow.into(), "0", options, 0..65));
        looking.set(Arc::downgrade(&claims)).expect("once");
        let start = Instant::now();
        claims.look().expect("readable");
        let elapsed = start.elapsed();
        assert_eq!((calls.load(Ordering::SeqCst), waits.load(Ordering::SeqCst)), (2 + 64, 0));
        // One after the other, they take longer.
        assert!(elapsed < Duration::from_millis(64 * 20), "{elapsed:?}");
        assert_eq!(claims.next(&Stop::default()), Ok(Some((64, vec![64]))), "the other blocks are claimed");
    }
}
