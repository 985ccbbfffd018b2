//! Ending a run from outside, by a signal or a library caller.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Asks a run to end: no scene is begun any more, those in the making are dropped, and what is done stays.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicUsize>);

impl Stop {
    /// Asks when the process gets SIGINT or SIGTERM. A second signal ends the process at once, with 128 plus its number.
    pub fn on_signals() -> std::io::Result<Self> {
        let stop = Self::default();
        let again = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // Actions run in the order of their registration.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&again))?;
            flag::register_usize(signal, Arc::clone(&stop.0), signal as usize)?;
            flag::register(signal, Arc::clone(&again))?;
        }
        Ok(stop)
    }

    /// Asks for the end, as the signal of that number does.
    pub fn request(&self, signal: u8) {
        self.0.store(usize::from(signal), Ordering::SeqCst);
    }

    /// The signal that asked, if one did.
    pub fn requested(&self) -> Option<u8> {
        u8::try_from(self.0.load(Ordering::SeqCst)).ok().filter(|&signal| signal > 0)
    }
}

/// Name of a signal, or its number.
pub fn name_of(signal: u8) -> String {
    match i32::from(signal) {
        SIGINT => "SIGINT".to_owned(),
        SIGTERM => "SIGTERM".to_owned(),
        other => format!("signal {other}"),
    }
}
