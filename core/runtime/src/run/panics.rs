//! Panics of stages, turned into errors that name the stage and the place.

use std::panic::{AssertUnwindSafe, catch_unwind};
use syntable_model::error::Result;
use syntable_model::panics::carry;
pub use syntable_model::panics::{quiet, unwound};

/// Runs a job on a worker thread; a panic keeps its place while it moves to the thread that waits for the job.
pub fn carried(job: impl FnOnce()) {
    catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|payload| carry(payload));
}

/// Runs a stage. Its errors and panics name it.
pub fn caught<T>(stage: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    unwound(work).map_err(|error| error.context(stage))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Pool;
    use syntable_model::context::Workers;

    #[test]
    fn a_panic_of_a_stage_names_it() {
        let error = quiet(|| caught::<()>("x", || panic!("after"))).expect_err("panics").to_string();
        assert!(error.starts_with("x: panicked at ") && error.contains("panics.rs:"), "{error}");
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
