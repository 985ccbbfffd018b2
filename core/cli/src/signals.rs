//! Signals that end a verb.

use crate::console::Console;
use crate::exit::Exit;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::Duration;
use syntable_model::error::Error;
use syntable_runtime::run::progress::Event;
use syntable_runtime::run::stop::{Stop, StopReason};

/// Time for an orderly end. Then the process ends as after a second signal, since a library that reads meshes or
/// denoises images cannot be interrupted.
const GRACE: Duration = Duration::from_millis(1500);

/// Work or a service that a signal ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Work. The text names the part that remains, as in "finished scenes are kept". The exit code is 128 plus the
    /// number of the signal.
    Work(&'static str),
    /// A service, which has no other end. The exit code is 0.
    Service,
}

/// A stop handle that SIGINT and SIGTERM trigger. The first signal prints a line at once, and the process ends within
/// two seconds. A second signal ends the process at once, with exit code 128 plus its number.
///
/// # Errors
/// If the operating system refuses the handlers.
pub fn on_signals(console: &Console, ends: Ends) -> Result<Stop, Exit> {
    let stop = handled().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))?;
    let (asked, reporter) = (stop.clone(), console.shared_reporter());
    thread::spawn(move || {
        asked.wait();
        let Some(StopReason::Signal(signal)) = asked.requested() else { return };
        if let Ends::Work(kept) = ends {
            let message = format!("stopping: {kept}; a second Ctrl-C ends the program at once");
            reporter.event(&Event::Note { message });
        }
        thread::sleep(GRACE);
        low_level::exit(match ends {
            Ends::Work(_) => 128 + i32::from(signal),
            Ends::Service => 0,
        });
    });
    Ok(stop)
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
