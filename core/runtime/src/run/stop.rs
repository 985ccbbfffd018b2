//! Early end of work, on request of a library caller or a signal.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// Value of the flag after [`Stop::cancel`]. No signal has this number.
const CANCELLED: usize = 1 << 16;

/// Polling interval of a waiting thread. A signal handler can store a number, but cannot wake a thread.
const LOOK: Duration = Duration::from_millis(50);

/// A handle that ends work early. Clones share it.
///
/// A run that is asked to stop starts no scene, drops unfinished scenes within a moment, and keeps finished ones.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    own: Arc<AtomicUsize>,
    /// Flags that also end this work.
    outer: Vec<Arc<AtomicUsize>>,
}

/// Origin of a request to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// A caller of the library called [`Stop::cancel`].
    Cancelled,
    /// The operating system sent this signal.
    Signal(u8),
}

impl Stop {
    /// Requests the end of the work.
    pub fn cancel(&self) {
        self.own.store(CANCELLED, Ordering::SeqCst);
    }

    /// A handle for a part of the work: this handle ends the part, too, but the part can also end alone.
    pub fn nested(&self) -> Self {
        Self { own: Arc::default(), outer: self.outer.iter().chain([&self.own]).cloned().collect() }
    }

    /// The reason to stop, or `None` while the work may continue.
    pub fn requested(&self) -> Option<StopReason> {
        let reason = |flag: &Arc<AtomicUsize>| match flag.load(Ordering::SeqCst) {
            0 => None,
            CANCELLED => Some(StopReason::Cancelled),
            signal => Some(u8::try_from(signal).map_or(StopReason::Cancelled, StopReason::Signal)),
        };
        self.outer.iter().chain([&self.own]).find_map(reason)
    }

    /// Whether the work must stop.
    pub fn is_requested(&self) -> bool {
        self.requested().is_some()
    }

    /// Blocks until the work must stop.
    pub fn wait(&self) {
        while !self.is_requested() {
            thread::sleep(LOOK);
        }
    }

    /// The shared flag for signal handlers, which store the signal's number in it.
    pub fn flag(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.own)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cancelled => f.write_str("its caller"),
            // Signal numbers of POSIX.
            Self::Signal(2) => f.write_str("SIGINT"),
            Self::Signal(15) => f.write_str("SIGTERM"),
            Self::Signal(other) => write!(f, "signal {other}"),
        }
    }
}
