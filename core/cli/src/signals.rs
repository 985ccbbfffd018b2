//! Signals that end a verb.

use crate::exit::Exit;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use syntable_model::error::Error;
use syntable_runtime::run::stop::{Stop, StopReason};

/// A stop handle that SIGINT and SIGTERM trigger. A second signal ends the process at once, with exit code 128 plus its
/// number.
///
/// # Errors
/// If the operating system refuses the handlers.
pub fn on_signals() -> Result<Stop, Exit> {
    handled().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))
}

fn handled() -> io::Result<Stop> {
    let stop = Stop::default();
    let again = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Actions run in the order of their registration.
        flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&again))?;
        flag::register_usize(signal, stop.flag(), signal as usize)?;
        flag::register(signal, Arc::clone(&again))?;
    }
    Ok(stop)
}

/// The exit of a verb that ended early: because of a signal, a user error, or an error that the same command may
/// overcome.
pub fn ended(stop: &Stop, error: Error) -> Exit {
    match stop.requested() {
        Some(StopReason::Signal(signal)) => Exit { code: 128_u8.saturating_add(signal), ..Exit::stopped(error) },
        _ => Exit::stopped(error),
    }
}
