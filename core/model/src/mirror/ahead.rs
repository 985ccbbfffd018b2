//! Downloads of the files that follow: a reader opens the files of a folder in their order, and waits for each.

use super::listed::Listed;
use parking_lot::Mutex;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Files of a folder that are downloaded ahead of the file that was opened.
const FILES: usize = 64;
/// Downloads at once.
const THREADS: usize = 16;

/// Downloads files before they are opened.
pub struct Ahead {
    listed: Arc<Listed>,
    plan: Arc<Mutex<Plan>>,
}

/// The next downloads.
#[derive(Default)]
struct Plan {
    /// By folder, the number of the file that was opened last, and the end of the files that were planned.
    last: BTreeMap<String, (usize, usize)>,
    next: VecDeque<usize>,
    threads: usize,
}

impl Ahead {
    pub fn new(listed: Arc<Listed>) -> Self {
        Self { listed, plan: Arc::default() }
    }

    /// Starts to download the files that probably follow a file that is opened.
    pub fn follow(&self, number: usize) {
        for _ in 0..self.plan(number) {
            let (listed, plan) = (Arc::clone(&self.listed), Arc::clone(&self.plan));
            let download = move || {
                while let Some(number) = next(&plan) {
                    // The reader of the file reports errors.
                    let _ = listed.open(number);
                }
            };
            if std::thread::Builder::new().name("ahead".to_owned()).spawn(download).is_err() {
                self.plan.lock().threads -= 1;
            }
        }
    }

    /// Plans the files after a file, if its folder is read in order. Returns the number of threads to start.
    fn plan(&self, number: usize) -> usize {
        let files = &self.listed.files;
        let folder = folder_of(&files[number].path);
        let mut plan = self.plan.lock();
        let Some((last, planned)) = plan.last.insert(folder.to_owned(), (number, number + 1)) else { return 0 };
        // Several threads open files out of order.
        if number.abs_diff(last) > FILES {
            return 0;
        }
        let (from, end) = (planned.max(number + 1), (number + 1 + FILES).min(files.len()));
        let following = (from..end).take_while(|next| folder_of(&files[*next].path) == folder);
        plan.next.extend(following.filter(|next| !self.listed.is_ready(*next)));
        plan.last.insert(folder.to_owned(), (number, end.max(planned)));
        let new = plan.next.len().min(THREADS).saturating_sub(plan.threads);
        plan.threads += new;
        new
    }
}

fn next(plan: &Mutex<Plan>) -> Option<usize> {
    let mut plan = plan.lock();
    let next = plan.next.pop_front();
    if next.is_none() {
        plan.threads -= 1;
    }
    next
}

fn folder_of(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}
