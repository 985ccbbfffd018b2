//! Ends work early, at the wish of a library caller or of a signal.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// Stored when a caller cancels: no number of a signal.
const CANCELLED: usize = 1 << 16;

/// How often a waiting thread looks. Handlers of signals can store a number, and wake nobody.
const LOOK: Duration = Duration::from_millis(50);

/// A handle that ends work early. Clones share it.
///
/// A run that is asked to stop begins no scene, drops the scenes in the making, and keeps all that is done.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    own: Arc<AtomicUsize>,
    /// Flags that end this one, too.
    outer: Vec<Arc<AtomicUsize>>,
}

/// Who asked for the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// A caller of the library, by [`Stop::cancel`].
    Cancelled,
    /// A signal of the operating system.
    Signal(u8),
}

impl Stop {
    /// Asks for the end.
    pub fn cancel(&self) {
        self.own.store(CANCELLED, Ordering::SeqCst);
    }

    /// A handle for a part of the work: this one ends it, too, and the part can end alone.
    pub fn nested(&self) -> Self {
        Self { own: Arc::default(), outer: self.outer.iter().chain([&self.own]).cloned().collect() }
    }

    /// Why the work shall end; none while it shall go on.
    pub fn requested(&self) -> Option<StopReason> {
        let reason = |flag: &Arc<AtomicUsize>| match flag.load(Ordering::SeqCst) {
            0 => None,
            CANCELLED => Some(StopReason::Cancelled),
            signal => Some(u8::try_from(signal).map_or(StopReason::Cancelled, StopReason::Signal)),
        };
        self.outer.iter().chain([&self.own]).find_map(reason)
    }

    /// Whether the work shall end.
    pub fn is_requested(&self) -> bool {
        self.requested().is_some()
    }

    /// Waits until the work shall end.
    pub fn wait(&self) {
        while !self.is_requested() {
            thread::sleep(LOOK);
        }
    }

    /// The shared flag, for handlers of signals, which store the signal's number in it.
    pub fn flag(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.own)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cancelled => f.write_str("its caller"),
            // The numbers of POSIX.
            Self::Signal(2) => f.write_str("SIGINT"),
            Self::Signal(15) => f.write_str("SIGTERM"),
            Self::Signal(other) => write!(f, "signal {other}"),
        }
    }
}
