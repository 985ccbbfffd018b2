//! Time that passes while the machine sleeps, too. [`Instant`](std::time::Instant) may stand still then.

use std::time::Duration;

/// A moment of the past, by a clock of this machine.
#[derive(Debug, Clone, Copy)]
pub struct Moment(Clock);

impl Moment {
    pub fn now() -> Self {
        Self(Clock::now())
    }

    /// Time since the moment.
    pub fn elapsed(self) -> Duration {
        self.0.until(Clock::now())
    }
}

#[cfg(any(target_os = "linux", target_os = "android"))]
use boot_time::Clock;
#[cfg(not(any(target_os = "linux", target_os = "android")))]
use two_clocks::Clock;

/// The time since the machine was started.
#[cfg(any(target_os = "linux", target_os = "android"))]
mod boot_time {
    use rustix::time::{ClockId, Timespec, clock_gettime};
    use std::time::Duration;

    #[derive(Debug, Clone, Copy)]
    pub struct Clock(Duration);

    impl Clock {
        pub fn now() -> Self {
            let Timespec { tv_sec: seconds, tv_nsec: nanoseconds } = clock_gettime(ClockId::Boottime);
            // Neither is negative.
            Self(Duration::new(seconds.unsigned_abs(), nanoseconds.unsigned_abs() as u32))
        }

        pub fn until(self, now: Self) -> Duration {
            now.0.saturating_sub(self.0)
        }
    }
}

/// Other systems count sleep in the time of day alone, which may be set back. The larger distance counts: a lease that seems
/// older than it is waits for its renewal.
#[cfg(any(test, not(any(target_os = "linux", target_os = "android"))))]
mod two_clocks {
    use std::time::{Duration, Instant, SystemTime};

    #[derive(Debug, Clone, Copy)]
    pub struct Clock {
        pub awake: Instant,
        pub day: SystemTime,
    }

    impl Clock {
        pub fn now() -> Self {
            Self { awake: Instant::now(), day: SystemTime::now() }
        }

        pub fn until(self, now: Self) -> Duration {
            let day = now.day.duration_since(self.day).unwrap_or_default();
            day.max(now.awake.saturating_duration_since(self.awake))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Moment;
    use super::two_clocks::Clock;
    use std::thread;
    use std::time::{Duration, Instant};

    #[test]
    fn a_moment_passes() {
        let (start, moment) = (Instant::now(), Moment::now());
        thread::sleep(Duration::from_millis(30));
        let elapsed = moment.elapsed();
        assert!(elapsed >= Duration::from_millis(29) && elapsed <= start.elapsed() + Duration::from_millis(5));
    }

    /// The moments of a clock: seconds awake, and the time of day.
    #[test]
    fn the_larger_of_two_distances_counts() {
        let start = Clock::now();
        let after = |awake: u64, day: i64| {
            let by = Duration::from_secs(day.unsigned_abs());
            let day = if day < 0 { start.day - by } else { start.day + by };
            start.until(Clock { awake: start.awake + Duration::from_secs(awake), day }).as_secs()
        };
        let asleep = after(2, 3600);
        let set_back = after(5, -3600);
        assert_eq!((asleep, set_back, after(3, 3), after(0, 0)), (3600, 5, 3, 0));
    }
}
