//! Panics of stages, turned into errors that name the stage and the place.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
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
    let result = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let Located { message, location } = located(payload);
        let place = location.map_or(String::new(), |location| format!(" at {location}"));
        Err(Error::new(format!("panicked{place}: {message}"))
            .help("this is a bug of the stage; please report it with the recipe"))
    });
    result.map_err(|error| error.context(stage))
}

/// While `work` runs, a panic prints nothing by itself: it is reported as an event.
pub fn quiet<T>(work: impl FnOnce() -> T) -> T {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(|info| {
        if let Some(location) = info.location() {
            LOCATION.set(Some(format!("{}:{}", location.file(), location.line())));
        }
    }));
    let result = work();
    std::panic::set_hook(before);
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Pool;
    use syntable_model::context::Workers;

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
