//! Many requests at once to a store on another machine, which answers each of them late.

use crate::run::dataset::foreign::read_bounded;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::limits::Limit;
use syntable_model::store::StoreFolder;

/// Requests in flight of one caller.
const AT_ONCE: usize = 32;

/// Calls `request` with the numbers below `count`, in any order: from many threads if the store is remote. Returns the
/// results by number, or an error of the lowest number that failed. No further request starts after an error.
pub fn each<T: Send>(
    dataset: &StoreFolder,
    count: usize,
    request: &(dyn Fn(usize) -> Result<T> + Sync),
) -> Result<Vec<T>> {
    let threads = if dataset.is_remote() { AT_ONCE.min(count) } else { 1 };
    if threads < 2 {
        return (0..count).map(request).collect();
    }
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return done;
            }
            let result = request(number);
            if result.is_err() {
                next.store(count, Ordering::Relaxed);
            }
            done.push((number, result));
        }
    };
    let mut all: Vec<(usize, Result<T>)> = thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(|thread| thread.join());
        joined.flat_map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    all.sort_unstable_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, result)| result).collect()
}

/// The bytes of files, none for a missing one. Refuses files larger than the limit.
pub fn read(dataset: &StoreFolder, paths: &[DatasetPath], limit: &Limit) -> Result<Vec<Option<Vec<u8>>>> {
    each(dataset, paths.len(), &|number| read_bounded(dataset, &paths[number], limit))
}
