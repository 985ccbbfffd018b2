//! Work on every image of a dataset that is read.

use crate::run::progress::{Event, Reporter};
use parking_lot::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use syntable_model::context::Workers;
use syntable_model::error::Result;

/// How often the number of images that are done is told.
const PATIENCE: Duration = Duration::from_secs(1);

/// Images per thread whose results are held until all of them are there.
const AHEAD: usize = 64;

/// Does work on images in parallel, and takes the results in the order of the images, some dozens at a time: so what `take` adds
/// up depends on no thread, and memory does not grow with the dataset. `done` says what was done to them, such as `scored`.
///
/// # Errors
/// That of the first image that has one.
pub fn each<T: Send>(
    (workers, reporter): (&dyn Workers, &dyn Reporter),
    done: &str,
    images: usize,
    work: &(dyn Fn(usize) -> Result<T> + Sync),
    take: &mut dyn FnMut(usize, T),
) -> Result<()> {
    let (count, told) = (AtomicUsize::new(0), Mutex::new(Instant::now()));
    let batch = AHEAD * workers.threads().max(1);
    for first in (0..images).step_by(batch) {
        let results: Vec<Mutex<Option<Result<T>>>> =
            (first..images.min(first + batch)).map(|_| Mutex::new(None)).collect();
        workers.run(results.len(), &|place| {
            *results[place].lock() = Some(work(first + place));
            let count = count.fetch_add(1, Ordering::Relaxed) + 1;
            let mut told = told.lock();
            if told.elapsed() > PATIENCE {
                *told = Instant::now();
                reporter.event(&Event::Working { step: format!("{done} {count} of {images} images") });
            }
        });
        for (image, result) in (first..).zip(results) {
            if let Some(result) = result.into_inner() {
                take(image, result?);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::progress::Quiet;
    use crate::workers::Pool;
    use syntable_model::error::Error;

    #[test]
    fn results_come_in_order_and_the_first_error_ends_it() {
        for threads in [1, 3] {
            let pool = Pool::new(threads).expect("threads");
            let mut taken = Vec::new();
            let square = |image: usize| Ok(image * image);
            each((&pool, &Quiet), "squared", 500, &square, &mut |image, it| taken.push((image, it))).expect("squares");
            assert_eq!(taken, (0..500).map(|image| (image, image * image)).collect::<Vec<_>>());
            let mut last = None;
            let fails = |image: usize| if image % 150 == 149 { Err(Error::new(image.to_string())) } else { Ok(()) };
            let error = each((&pool, &Quiet), "tried", 500, &fails, &mut |image, ()| last = Some(image));
            assert_eq!((error.expect_err("it fails").to_string(), last), ("149".to_owned(), Some(148)));
        }
    }
}
