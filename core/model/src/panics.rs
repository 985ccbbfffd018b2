//! Panics turned into errors: of stages, and of the libraries that read foreign files. Work that was asked to stop also
//! unwinds ([`stop`]), and becomes an error of its own kind.
//!
//! Only unwinding can be caught. Overflows of the stack and failed allocations end the process; [`limits`](crate::limits)
//! prevent those.

use crate::error::{Error, Result};
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! {
    /// File and line of the last quiet panic of this thread.
    static LOCATION: RefCell<Option<String>> = const { RefCell::new(None) };
    /// Number of guards that this thread is inside of.
    static GUARDS: Cell<usize> = const { Cell::new(0) };
}

/// Number of runs of this process that report panics themselves.
static QUIET: AtomicUsize = AtomicUsize::new(0);

/// Payload of work that ends because it was asked to stop.
#[derive(Debug)]
struct Stopped(String);

/// Unwinds to the caller of the stage: [`unwound`] returns an error that the work was stopped, with this reason. No panic
/// is reported.
pub fn stop(reason: String) -> ! {
    resume_unwind(Box::new(Stopped(reason)))
}

/// The text of a panic, and its place in the source.
#[derive(Debug)]
pub struct Panicked {
    /// Its message.
    pub message: String,
    /// File and line, if it was quiet.
    pub location: Option<String>,
}

impl Panicked {
    /// Reads a payload from [`catch_unwind`]: the panic of this thread, or a panic that another thread passed on.
    pub fn of(payload: Box<dyn Any + Send>) -> Self {
        match payload.downcast::<Self>() {
            Ok(panicked) => *panicked,
            Err(payload) => {
                let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
                let message = text.or_else(|| payload.downcast_ref::<String>().cloned());
                Self { message: message.unwrap_or_else(|| "no message".to_owned()), location: LOCATION.take() }
            }
        }
    }

    /// The place of the panic, without the folder in which Cargo keeps libraries.
    fn place(&self) -> String {
        let Some(location) = &self.location else { return String::new() };
        let of_library = location.split_once("/registry/src/").and_then(|(_, rest)| rest.split_once('/'));
        format!(" at {}", of_library.map_or(location.as_str(), |(_, place)| place))
    }
}

/// Passes a payload on to another thread: a panic keeps its place, and a stop stays one.
pub fn carry(payload: Box<dyn Any + Send>) -> ! {
    if payload.is::<Stopped>() { resume_unwind(payload) } else { resume_unwind(Box::new(Panicked::of(payload))) }
}

/// Runs something that may panic; a panic becomes an error.
pub fn unwound<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let payload = match payload.downcast::<Stopped>() {
            Ok(stopped) => return Err(Error::stopped(stopped.0)),
            Err(payload) => payload,
        };
        let panicked = Panicked::of(payload);
        Err(Error::unlucky(format!("panicked{}: {}", panicked.place(), panicked.message))
            .help("this is a bug of the program or of a plugin; please report it with the recipe and the file"))
    })
}

/// Runs a reader of foreign data, such as a library that decodes images. A panic prints nothing and becomes an error
/// that names the file. `reader` names the part that failed, such as "the reader of parquet".
pub fn guarded<T>(reader: &str, file: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    struct Inside;
    impl Drop for Inside {
        fn drop(&mut self) {
            GUARDS.set(GUARDS.get() - 1);
        }
    }
    hook();
    GUARDS.set(GUARDS.get() + 1);
    let _inside = Inside;
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        if payload.is::<Stopped>() {
            resume_unwind(payload);
        }
        let panicked = Panicked::of(payload);
        let what = format!("{reader} failed on it: panicked{}: {}", panicked.place(), panicked.message);
        Err(Error::new(what)
            .in_file(file)
            .help("the file is damaged or unusual, and this is a bug of the reader: write the file again, and report the bug with it"))
    })
}

/// While `work` runs, panics are reported as events instead of printed. Runs may overlap.
pub fn quiet<T>(work: impl FnOnce() -> T) -> T {
    struct Counted;
    impl Drop for Counted {
        fn drop(&mut self) {
            QUIET.fetch_sub(1, Ordering::SeqCst);
        }
    }
    hook();
    QUIET.fetch_add(1, Ordering::SeqCst);
    let _counted = Counted;
    work()
}

/// Installs a hook that silences panics which are reported elsewhere, and records their places.
fn hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if QUIET.load(Ordering::SeqCst) == 0 && GUARDS.get() == 0 {
                before(info);
            } else if let Some(location) = info.location() {
                LOCATION.set(Some(format!("{}:{}", location.file(), location.line())));
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_overlap_and_a_panic_ends_one() {
        let inner = || quiet(|| catch_unwind(|| quiet(|| panic!("inside"))).is_err());
        assert!(quiet(inner));
        let place = quiet(|| unwound::<()>(|| panic!("after"))).expect_err("panics").to_string();
        assert!(place.contains("panics.rs:"), "{place}");
    }

    #[test]
    fn a_stop_passes_guards_and_is_no_panic() {
        let stopped = || guarded::<()>("the reader of x", Path::new("y"), || stop("stopped by its caller".to_owned()));
        let error = unwound(stopped).expect_err("stopped");
        assert_eq!(error, Error::stopped("stopped by its caller"));
        assert_eq!(GUARDS.get(), 0);
    }

    #[test]
    fn a_guard_names_reader_file_and_place() {
        let line = line!() + 1;
        let error = guarded::<()>("the reader of x", Path::new("a/b.x"), || panic!("index {}", 3)).expect_err("panics");
        let text = error.to_string();
        assert!(text.starts_with("a/b.x: the reader of x failed on it: panicked at "), "{text}");
        assert!(text.contains(&format!("panics.rs:{line}: index 3")), "{text}");
        assert_eq!(GUARDS.get(), 0);
        assert_eq!(guarded("the reader of x", Path::new("y"), || Ok(7)), Ok(7));
    }
}
