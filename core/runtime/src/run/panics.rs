//! Panics of stages, turned into errors that name the stage and the place.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};
use syntable_model::error::{Error, Result};

thread_local! {
    /// File and line of the last panic of this thread.
    static LOCATION: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// A panic on its way from a worker thread to the stage that spread the work.
struct Located {
    message: String,
    location: Option<String>,
}

fn located(payload: Box<dyn Any + Send>) -> Located {
    match payload.downcast::<Located>() {
        Ok(located) => *located,
        Err(payload) => {
            let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let message = text.or_else(|| payload.downcast_ref::<String>().cloned());
            Located { message: message.unwrap_or_else(|| "no message".to_owned()), location: LOCATION.take() }
        }
    }
}

/// Runs a job on a worker thread; a panic keeps its place while it moves to the thread that waits for the job.
pub fn carried(job: impl FnOnce()) {
    if let Err(payload) = catch_unwind(AssertUnwindSafe(job)) {
        resume_unwind(Box::new(located(payload)));
    }
}

/// Runs a stage. Its errors and panics name it.
pub fn caught<T>(stage: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    unwound(work).map_err(|error| error.context(stage))
}

/// Runs something that may panic; a panic becomes an error.
pub fn unwound<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let Located { message, location } = located(payload);
        let place = location.map_or(String::new(), |location| format!(" at {location}"));
        Err(Error::new(format!("panicked{place}: {message}"))
            .help("this is a bug of the program or of a plugin; please report it with the recipe and the file"))
    })
}

/// Number of runs of this process that report panics themselves.
static QUIET: AtomicUsize = AtomicUsize::new(0);

/// While `work` runs, a panic prints nothing by itself: it is reported as an event. Runs may overlap.
pub fn quiet<T>(work: impl FnOnce() -> T) -> T {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if QUIET.load(Ordering::SeqCst) == 0 {
                before(info);
            } else if let Some(location) = info.location() {
                LOCATION.set(Some(format!("{}:{}", location.file(), location.line())));
            }
        }));
    });
    struct Counted;
    impl Drop for Counted {
        fn drop(&mut self) {
            QUIET.fetch_sub(1, Ordering::SeqCst);
        }
    }
    QUIET.fetch_add(1, Ordering::SeqCst);
    let _counted = Counted;
    work()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Pool;
    use syntable_model::context::Workers;

    #[test]
    fn runs_overlap_and_a_panic_ends_one() {
        let inner = || quiet(|| catch_unwind(|| quiet(|| panic!("inside"))).is_err());
        assert!(quiet(inner));
        let place = quiet(|| caught::<()>("x", || panic!("after"))).expect_err("panics").to_string();
        assert!(place.contains("panics.rs:"), "{place}");
    }

    #[test]
    fn a_panic_on_a_worker_thread_keeps_its_place() {
        let pool = Pool::new(2).expect("threads");
        let line = line!() + 3;
        let error = quiet(|| {
            caught("annotate.x", || {
                pool.run(4, &|index| assert!(index != 3, "index {index}"));
                Ok(())
            })
        });
        let text = error.expect_err("panics").to_string();
        assert!(
            text.starts_with("annotate.x: panicked at ") && text.contains(&format!("panics.rs:{line}: index 3")),
            "{text}"
        );
    }
}
