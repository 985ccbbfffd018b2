//! What follows an error of an attempt at a scene: the one place that decides it.

use syntable_model::error::Error;

/// How often an attempt is repeated whose device failed.
pub const DEVICE_REPEATS: u32 = 2;

/// What follows an error of an attempt at a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recovery {
    /// The same attempt again: its device failed, and may be back.
    Repeat,
    /// The next attempt, with other random numbers.
    NextAttempt,
    /// The scene fails: its device stays away, or its labels contradict each other, and other random numbers would only hide a
    /// stage that is wrong.
    FailScene,
    /// The work stops: the error is the same for all scenes, such as a wrong option or a full disk.
    Stop,
}

impl Recovery {
    /// What follows `error` in an attempt that was repeated `repeats` times before.
    pub fn of(error: &Error, repeats: u32) -> Self {
        if error.is_passing() && repeats < DEVICE_REPEATS {
            Self::Repeat
        } else if error.is_unlucky() {
            Self::NextAttempt
        } else if error.is_device() || error.is_contradiction() {
            Self::FailScene
        } else {
            Self::Stop
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cause_has_its_own_end() {
        let device = || Error::device("lost");
        for (error, repeats, wanted) in [
            (device(), 0, Recovery::Repeat),
            (device(), DEVICE_REPEATS, Recovery::FailScene),
            (Error::contradiction("masks"), 0, Recovery::FailScene),
            (Error::unlucky("no room for a body"), 0, Recovery::NextAttempt),
            (Error::new("a wrong option"), 0, Recovery::Stop),
            (Error::stopped("by its caller"), 0, Recovery::Stop),
            (Error::io("data", &std::io::Error::other("full")), 0, Recovery::Stop),
        ] {
            assert_eq!(Recovery::of(&error, repeats), wanted, "{error}");
        }
    }
}
