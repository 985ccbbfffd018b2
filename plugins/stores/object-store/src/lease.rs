//! Locks of object stores: leases.
//!
//! The lock is an object that its owner writes again and again. If it stays the same for a while, its owner is gone, and
//! another program takes it over, on the condition that it is still the same. Each program measures this while with its
//! own clock, so that no two clocks must agree.
//!
//! Programs that share a lock have a lease each, beside the lock. Who takes the lock alone writes it first and then looks for
//! shares; who shares it writes the share first and then looks for the lock: one of two always sees the other.
//!
//! An owner that could not renew its lease writes nothing until it has renewed it, or fails if another program has taken
//! it over.

use crate::bucket::Bucket;
use crate::failure;
use crate::moment::Moment;
use crate::requests::wait_at_most;
use object_store::path::Path as Key;
use object_store::{PutMode, UpdateVersion};
use parking_lot::{Condvar, Mutex};
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};
use syntable_model::files::RESERVED;
use syntable_model::unique::unique;

/// Times of a lease.
#[derive(Debug, Clone, Copy)]
pub struct LeaseTimes {
    /// Time between two renewals.
    pub renewal: Duration,
    /// Time without a renewal after which the lease is free. A few times `renewal`.
    pub lasts: Duration,
}

impl Default for LeaseTimes {
    fn default() -> Self {
        Self { renewal: Duration::from_secs(4), lasts: Duration::from_secs(20) }
    }
}

/// Time between two looks at a lease of another program, as a part of the time that it lasts.
const LOOKS: u32 = 20;
/// Time for which an owner waits for its own renewal before it fails, as a multiple of the time that a lease lasts.
const PATIENCE: u32 = 10;

/// The leases that a store holds.
pub struct Locks {
    pub times: LeaseTimes,
    held: Mutex<Vec<Arc<State>>>,
}

/// State of a lease.
struct State {
    /// URL of the lock, for messages.
    name: PathBuf,
    /// The folder whose files it guards; empty for the bucket.
    folder: String,
    lease: Mutex<Renewed>,
    changed: Condvar,
}

/// The last renewal of a lease.
struct Renewed {
    at: Moment,
    /// Another program has taken the lease over.
    is_lost: bool,
    /// Why the store refused the last renewal.
    refused: Option<Error>,
    /// The owner gives the lease up.
    ends: bool,
}

impl Locks {
    pub fn new(times: LeaseTimes) -> Self {
        Self { times, held: Mutex::default() }
    }

    /// Refuses to write a file after a lease of its dataset was lost. Waits while such a lease may have ended.
    pub fn check(&self, path: &str) -> Result<()> {
        let held = self.held.lock().clone();
        for state in held.into_iter().filter(|state| is_in(path, &state.folder)) {
            let mut lease = state.lease.lock();
            let end = Instant::now() + self.times.lasts * PATIENCE;
            while !lease.is_lost && lease.at.elapsed() > self.times.lasts {
                if let Some(error) = &lease.refused {
                    return Err(error.clone());
                }
                if state.changed.wait_until(&mut lease, end).timed_out() {
                    let error = Error::io(&state.name, &ErrorKind::TimedOut.into());
                    return Err(error.help("the store does not answer: check the network, then run the same command"));
                }
            }
            if lease.is_lost {
                let message = "this program could not renew the lock in time, for example in a suspended machine, and another \
                               program may have taken over the dataset";
                let error = Error::io(&state.name, &io::Error::new(ErrorKind::TimedOut, message));
                return Err(error.help("the same command continues, after another run that has the dataset for itself"));
            }
        }
        Ok(())
    }
}

/// A lease that is held until it is dropped.
pub struct Lease {
    bucket: Arc<Bucket>,
    key: Key,
    owner: u64,
    locks: Arc<Locks>,
    state: Arc<State>,
    renews: Option<JoinHandle<()>>,
}

impl Lease {
    /// Takes a lease; none if another program holds it or shares it. Waits until abandoned leases end.
    pub fn take(bucket: &Arc<Bucket>, key: &Key, locks: &Arc<Locks>) -> object_store::Result<Option<Self>> {
        let Some(taken) = Self::take_one(bucket, key, locks)? else { return Ok(None) };
        // A program that shares from now on finds the lease. Those that shared it before are found here.
        for share in bucket.keys_below(&shares(key))? {
            if !Self::has_ended(bucket, &share, locks.times)? {
                return Ok(None);
            }
        }
        Ok(Some(taken))
    }

    /// Shares a lease; none if another program holds it alone.
    pub fn share(bucket: &Arc<Bucket>, key: &Key, locks: &Arc<Locks>) -> object_store::Result<Option<Self>> {
        let own = Key::from(format!("{}/{:016x}", shares(key), unique()));
        let Some(shared) = Self::take_one(bucket, &own, locks)? else { return Ok(None) };
        let Some((present, version)) = bucket.get(key)? else { return Ok(Some(shared)) };
        let is_free = match watch(bucket, key, &present, locks.times)? {
            Watched::Renewed => false,
            Watched::Gone => true,
            // Its owner may be suspended. It must find that it has lost the lease, so this program takes the lease for a moment.
            Watched::Ended => Self::take_over(bucket, key, version, locks)?.is_some(),
        };
        Ok(is_free.then_some(shared))
    }

    /// Whether no program holds a lease alone. Waits until an abandoned lease ends, and leaves it as it is: a reader may have no
    /// right to write, so a suspended owner that continues writes beside it.
    pub fn is_free(bucket: &Bucket, key: &Key, times: LeaseTimes) -> object_store::Result<bool> {
        let Some((present, _)) = bucket.get(key)? else { return Ok(true) };
        Ok(!matches!(watch(bucket, key, &present, times)?, Watched::Renewed))
    }

    /// Whether a share has ended. Deletes an abandoned one.
    fn has_ended(bucket: &Bucket, share: &Key, times: LeaseTimes) -> object_store::Result<bool> {
        let Some((present, _)) = bucket.get(share)? else { return Ok(true) };
        match watch(bucket, share, &present, times)? {
            Watched::Renewed => return Ok(false),
            Watched::Gone => {}
            Watched::Ended => bucket.delete(share)?,
        }
        Ok(true)
    }

    /// Takes the lease of a key.
    fn take_one(bucket: &Arc<Bucket>, key: &Key, locks: &Arc<Locks>) -> object_store::Result<Option<Self>> {
        loop {
            let Some((present, version)) = bucket.get(key)? else {
                let owner = unique();
                match bucket.put_if(key, text(owner, 0).as_bytes(), PutMode::Create)? {
                    Some(version) => return Ok(Some(Self::held(bucket, key, owner, (version, locks)))),
                    None => continue,
                }
            };
            match watch(bucket, key, &present, locks.times)? {
                Watched::Renewed => return Ok(None),
                Watched::Gone => {}
                Watched::Ended => return Self::take_over(bucket, key, version, locks),
            }
        }
    }

    /// Takes an abandoned lease over, if it is still the same.
    fn take_over(
        bucket: &Arc<Bucket>,
        key: &Key,
        version: UpdateVersion,
        locks: &Arc<Locks>,
    ) -> object_store::Result<Option<Self>> {
        let owner = unique();
        let taken = bucket.put_if(key, text(owner, 0).as_bytes(), PutMode::Update(version))?;
        Ok(taken.map(|version| Self::held(bucket, key, owner, (version, locks))))
    }

    fn held(bucket: &Arc<Bucket>, key: &Key, owner: u64, (version, locks): (UpdateVersion, &Arc<Locks>)) -> Self {
        let lease = Mutex::new(Renewed { at: Moment::now(), is_lost: false, refused: None, ends: false });
        let (name, folder) = (bucket.name_of(key.as_ref()), guarded(key).to_owned());
        let state = Arc::new(State { name, folder, lease, changed: Condvar::new() });
        locks.held.lock().push(Arc::clone(&state));
        let renews = {
            let (bucket, key, state, times) = (Arc::clone(bucket), key.clone(), Arc::clone(&state), locks.times);
            thread::spawn(move || renew(&bucket, &key, owner, version, &state, times))
        };
        let (bucket, key, locks) = (Arc::clone(bucket), key.clone(), Arc::clone(locks));
        Self { bucket, key, owner, locks, state, renews: Some(renews) }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.state.lease.lock().ends = true;
        self.state.changed.notify_all();
        if let Some(renews) = self.renews.take() {
            let _ = renews.join();
        }
        self.locks.held.lock().retain(|state| !Arc::ptr_eq(state, &self.state));
        // A lease that cannot be deleted ends without renewals.
        if let Ok(Some((present, _))) = self.bucket.get(&self.key)
            && present.starts_with(text_of(self.owner).as_bytes())
        {
            let _ = self.bucket.delete(&self.key);
        }
    }
}

/// Renews a lease until it ends.
fn renew(bucket: &Bucket, key: &Key, owner: u64, mut version: UpdateVersion, state: &State, times: LeaseTimes) {
    for number in 1_u64.. {
        {
            let mut lease = state.lease.lock();
            let end = Instant::now() + times.renewal;
            while !lease.ends && !state.changed.wait_until(&mut lease, end).timed_out() {}
            if lease.ends {
                return;
            }
        }
        // The time of the request counts, not of the answer: others see the renewal at the earliest then.
        let at = Moment::now();
        match bucket.renew(key, text(owner, number).as_bytes(), version.clone(), times.renewal) {
            Ok(Some(next)) => {
                version = next;
                let mut lease = state.lease.lock();
                (lease.at, lease.refused) = (at, None);
            }
            Ok(None) => {
                // An earlier renewal whose answer was lost is one of this owner.
                match wait_at_most(times.renewal, bucket.getting(key)) {
                    Some(Ok(Some((present, now)))) if present.starts_with(text_of(owner).as_bytes()) => version = now,
                    Some(Ok(_)) => {
                        state.lease.lock().is_lost = true;
                        state.changed.notify_all();
                        return;
                    }
                    Some(Err(_)) | None => {}
                }
            }
            // The next renewal may succeed.
            Err(failure) => {
                let refused =
                    failure::is_denied(&failure).then(|| failure::error(bucket.name_of(key.as_ref()), &failure));
                state.lease.lock().refused = refused;
            }
        }
        state.changed.notify_all();
    }
}

/// The folder that a lock guards: the dataset whose own folder holds it, or the bucket.
fn guarded(lock: &Key) -> &str {
    let [own, _] = RESERVED;
    lock.as_ref().split_once(&format!("/{own}/")).map_or("", |(dataset, _)| dataset)
}

/// Whether a path is in a folder.
fn is_in(path: &str, folder: &str) -> bool {
    folder.is_empty() || path.strip_prefix(folder).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

fn text_of(owner: u64) -> String {
    format!("{{\"owner\":\"{owner:016x}\",")
}

fn text(owner: u64, number: u64) -> String {
    format!("{}\"renewal\":{number}}}\n", text_of(owner))
}

/// The fate of a lease of another program.
enum Watched {
    /// Its owner renewed it.
    Renewed,
    /// Its owner gave it up.
    Gone,
    /// Its owner is gone.
    Ended,
}

/// The folder of the leases of programs that share a lease.
fn shares(key: &Key) -> Key {
    Key::from(format!("{key}.shares"))
}

fn watch(bucket: &Bucket, key: &Key, present: &[u8], times: LeaseTimes) -> object_store::Result<Watched> {
    let start = Instant::now();
    while start.elapsed() < times.lasts {
        thread::sleep(times.lasts / LOOKS);
        match bucket.get(key)? {
            None => return Ok(Watched::Gone),
            Some((now, _)) if now != present => return Ok(Watched::Renewed),
            Some(_) => {}
        }
    }
    Ok(Watched::Ended)
}
