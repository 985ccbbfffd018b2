//! Claims of workers on blocks of scenes, so that several workers make one dataset without a master.
//!
//! A claim is a file that must be new, and that its worker writes again and again. If it stays the same for a while, as
//! another worker's own clock measures it, its worker is gone or too slow: the other worker takes the block over, with a
//! file of the next generation, which must be new, too. A claim only spares work. Two workers that make the same scene
//! write the same bytes, and the line of a scene is written once.

use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, LineFiles};
use crate::run::dataset::layout;
use crate::run::dataset::vanished::vanished;
use crate::run::stop::Stop;
use parking_lot::{Condvar, Mutex};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

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

/// The blocks of scenes that a worker and others make.
pub struct Claims {
    shared: Arc<Shared>,
    options: ClaimOptions,
    /// Scenes to make, ascending.
    todo: Vec<u32>,
    blocks: Mutex<Blocks>,
    renews: Option<JoinHandle<()>>,
}

/// The state that the worker shares with the thread that renews its claims.
struct Shared {
    dataset: StoreFolder,
    worker: String,
    held: Mutex<Held>,
    ends: Condvar,
    /// The recipe of the dataset is gone.
    has_vanished: AtomicBool,
}

/// The claims of this worker: the generation of each block.
#[derive(Default)]
struct Held {
    claims: BTreeMap<u32, u32>,
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
    generation: u32,
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
        let shared = Arc::new(Shared {
            dataset,
            worker,
            held: Mutex::default(),
            ends: Condvar::new(),
            has_vanished: AtomicBool::new(false),
        });
        let blocks = Mutex::new(Blocks { left, free, others: BTreeMap::new(), taken: 0 });
        let renews = {
            let (shared, pause) = (Arc::clone(&shared), options.lease / SIGNS);
            thread::spawn(move || shared.renew(pause))
        };
        Self { shared, options, todo, blocks, renews: Some(renews) }
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
                self.look(&mut blocks)?;
            }
            if let Some(block) = blocks.free.pop() {
                let generation = blocks.others.remove(&block).map_or(0, |other| other.generation + 1);
                if let Some(claimed) = self.claim(&mut blocks, block, generation)? {
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

    /// Tries to claim a block. Returns its scenes without a line; none if another worker has it or has made it.
    fn claim(&self, blocks: &mut Blocks, block: u32, generation: u32) -> Result<Option<(u32, Vec<u32>)>> {
        let dataset = &self.shared.dataset;
        if !dataset.write_new(&layout::claim(block, generation), self.shared.sign(0).as_bytes())? {
            blocks.taken += 1;
            // It is read when all claims are looked at.
            blocks.others.insert(block, Other { generation, content: Vec::new(), since: Instant::now() });
            return Ok(None);
        }
        blocks.taken = 0;
        self.shared.held.lock().claims.insert(block, generation);
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
        let Some(generation) = self.shared.held.lock().claims.remove(&block) else { return Ok(()) };
        // The claims of workers that are gone end with it.
        (0..=generation).try_for_each(|generation| self.shared.dataset.remove(&layout::claim(block, generation)))
    }

    /// Looks at all claims and lines: finds blocks that are done, and blocks that are free again.
    fn look(&self, blocks: &mut Blocks) -> Result<()> {
        let dataset = &self.shared.dataset;
        let claims = claims_of(dataset)?;
        // Lines are listed after claims: a worker writes its lines before it gives its claim back.
        let lines = LineFiles::of(dataset)?;
        let held = self.shared.held.lock().claims.clone();
        blocks
            .left
            .retain(|block| held.contains_key(block) || !self.scenes_of(*block).iter().all(|scene| lines.has(*scene)));
        let Blocks { left, free, others, .. } = blocks;
        let known: BTreeSet<u32> = free.iter().copied().collect();
        let (mut claimed, mut again) = (BTreeSet::new(), Vec::new());
        others.retain(|block, _| left.contains(block));
        for &block in left.iter().filter(|block| !held.contains_key(block)) {
            let Some(&generation) = claims.get(&block) else {
                others.remove(&block);
                if !known.contains(&block) {
                    again.push(block);
                }
                continue;
            };
            let content = foreign::read(dataset, &layout::claim(block, generation))?;
            let seen =
                others.entry(block).or_insert_with(|| Other { generation, content: Vec::new(), since: Instant::now() });
            if seen.generation != generation || seen.content != content {
                *seen = Other { generation, content, since: Instant::now() };
            }
            claimed.insert(block);
            if seen.since.elapsed() > self.options.lease {
                again.push(block);
            }
        }
        free.retain(|block| left.contains(block) && !claimed.contains(block));
        free.append(&mut again);
        Ok(())
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
        format!("{{\"worker\":\"{}\",\"sign\":{number}}}\n", self.worker)
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
                held.claims.clone()
            };
            if self.dataset.has(&layout::recipe()) == Ok(false) {
                self.has_vanished.store(true, Ordering::Relaxed);
                return;
            }
            for (block, generation) in claims {
                // The claim may have been given back meanwhile.
                let held = self.held.lock();
                if held.claims.get(&block) == Some(&generation) {
                    let _ = self.dataset.write(&layout::claim(block, generation), self.sign(number).as_bytes());
                }
            }
        }
    }
}

/// Time after which a claim that no worker has renewed says nothing about workers. The time of a lease is not known here.
const STALE: Duration = Duration::from_secs(180);

/// Whether workers have claims on a dataset, by the clocks of this machine and of the store.
pub fn are_renewed(dataset: &StoreFolder) -> Result<bool> {
    for (name, _) in dataset.list(&layout::claims())? {
        let found = dataset.look(&format!("{}/{name}", layout::claims()))?;
        let age = found.and_then(|found| SystemTime::now().duration_since(found.modified?).ok());
        if age.is_some_and(|age| age < STALE) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The newest generation of each claim.
fn claims_of(dataset: &StoreFolder) -> Result<BTreeMap<u32, u32>> {
    let mut claims = BTreeMap::new();
    for (name, _) in dataset.list(&layout::claims())? {
        let Some(name) = name.strip_suffix(".json") else { continue };
        let (block, generation) = name.split_once('-').unwrap_or((name, "0"));
        let (Ok(block), Ok(generation)) = (block.parse(), generation.parse::<u32>()) else { continue };
        let newest: &mut u32 = claims.entry(block).or_insert(generation);
        *newest = (*newest).max(generation);
    }
    Ok(claims)
}
