//! The large files that were opened last.

use super::blocks::Blocks;
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::sync::Arc;

/// The large files that were opened last. Each has an open file, and often a connection.
#[derive(Default)]
pub struct Recent(Mutex<VecDeque<Arc<Mutex<Blocks>>>>);

/// Number of them.
pub const RECENT: usize = if cfg!(test) { 3 } else { 64 };

impl Recent {
    /// Keeps a file open, and drops the one that was opened first.
    pub fn add(&self, blocks: &Arc<Mutex<Blocks>>) {
        let dropped = {
            let mut recent = self.0.lock();
            recent.retain(|other| !Arc::ptr_eq(other, blocks));
            recent.push_back(Arc::clone(blocks));
            if recent.len() > RECENT { recent.pop_front() } else { None }
        };
        // Outside the lock: it deletes a file.
        drop(dropped);
    }
}
