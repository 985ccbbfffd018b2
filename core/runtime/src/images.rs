//! Work on every image of a dataset from files.

use crate::run::progress::{Event, Reporter};
use crate::run::stop::Stop;
use parking_lot::Mutex;
use std::time::{Duration, Instant};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};

/// The threads, the listener and the stop handle of work on images.
#[derive(Clone, Copy)]
pub struct ImageWork<'a> {
    /// Threads that do the work.
    pub workers: &'a dyn Workers,
    /// Receives progress.
    pub reporter: &'a dyn Reporter,
    /// Ends the work early on request.
    pub stop: &'a Stop,
}

/// Minimum interval between progress events.
const PATIENCE: Duration = Duration::from_secs(1);

/// Maximum number of results per thread that wait for earlier images.
const AHEAD: usize = 64;

/// Counts images, and reports the count about once per second.
pub struct ImageProgress<'a> {
    reporter: &'a dyn Reporter,
    done: &'a str,
    images: usize,
    /// Number of images so far, and the time of the last report.
    state: Mutex<(usize, Instant)>,
}

impl<'a> ImageProgress<'a> {
    /// The start of work on a number of images. `done` is the participle for events, such as `scored`.
    pub fn new(reporter: &'a dyn Reporter, done: &'a str, images: usize) -> Self {
        Self { reporter, done, images, state: Mutex::new((0, Instant::now())) }
    }

    /// Counts an image.
    pub fn one_more(&self) {
        let mut state = self.state.lock();
        state.0 += 1;
        if state.1.elapsed() > PATIENCE {
            state.1 = Instant::now();
            let step = format!("{} {} of {} images", self.done, state.0, self.images);
            self.reporter.event(&Event::Working { step });
        }
    }
}

/// Processes images in parallel and passes the results to `take` in the order of the images, in chunks of bounded size.
/// The sums of `take` therefore do not depend on threads, and memory does not grow with the dataset. `done` is the
/// participle for progress events, such as `scored`.
///
/// # Errors
/// The error of the first image that fails, or an error if the work was stopped.
pub fn each<T: Send>(
    ImageWork { workers, reporter, stop }: &ImageWork,
    done: &str,
    images: usize,
    image: &(dyn Fn(usize) -> Result<T> + Sync),
    take: &mut dyn FnMut(usize, T),
) -> Result<()> {
    let progress = ImageProgress::new(*reporter, done, images);
    let batch = AHEAD * workers.threads().max(1);
    for first in (0..images).step_by(batch) {
        if stop.is_requested() {
            break;
        }
        let results: Vec<Mutex<Option<Result<T>>>> =
            (first..images.min(first + batch)).map(|_| Mutex::new(None)).collect();
        workers.run(results.len(), &|place| {
            if stop.is_requested() {
                return;
            }
            *results[place].lock() = Some(image(first + place));
            progress.one_more();
        });
        for (place, result) in (first..).zip(results) {
            match result.into_inner() {
                Some(result) => take(place, result?),
                // Results after an unprocessed image are incomplete.
                None => break,
            }
        }
    }
    match stop.requested() {
        Some(reason) => Err(Error::stopped(format!("stopped by {reason}"))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::progress::Quiet;
    use crate::workers::Pool;

    #[test]
    fn results_come_in_order_and_the_first_error_ends_it() {
        for threads in [1, 3] {
            let (pool, stop) = (Pool::new(threads).expect("threads"), Stop::default());
            let work = ImageWork { workers: &pool, reporter: &Quiet, stop: &stop };
            let mut taken = Vec::new();
            let square = |image: usize| Ok(image * image);
            each(&work, "squared", 500, &square, &mut |image, it| taken.push((image, it))).expect("squares");
            assert_eq!(taken, (0..500).map(|image| (image, image * image)).collect::<Vec<_>>());
            let mut last = None;
            let fails = |image: usize| if image % 150 == 149 { Err(Error::new(image.to_string())) } else { Ok(()) };
            let error = each(&work, "tried", 500, &fails, &mut |image, ()| last = Some(image));
            assert_eq!((error.expect_err("it fails").to_string(), last), ("149".to_owned(), Some(148)));
            let stops = |image: usize| {
                if image == 70 {
                    stop.cancel();
                }
                Ok(())
            };
            let error = each(&work, "tried", 500, &stops, &mut |_, ()| {}).expect_err("it was asked to stop");
            assert_eq!(error.to_string(), "stopped by its caller");
        }
    }
}
