//! The attempts at a scene, and the reaction to an error: the same attempt again, the next attempt, the end of the
//! scene, or the end of the work. Runs, generators and previews make their scenes with this loop.

use crate::run::making::attempt::Tools;
use crate::run::panics::unwound;
use crate::run::progress::{Event, Reporter};
use syntable_model::error::{Error, Result};

/// Maximum number of times that an attempt is repeated after its device failed.
const DEVICE_REPEATS: u32 = 2;

/// Reaction to an error of an attempt at a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recovery {
    /// Repeat the attempt: its device failed, and may be back.
    Repeat,
    /// Make the next attempt, with other random numbers.
    NextAttempt,
    /// Fail the scene: its device does not come back, or its labels contradict each other. Other random numbers would
    /// only hide the faulty stage.
    FailScene,
    /// Stop the work. The error affects all scenes, such as a wrong option or a full disk.
    Stop,
}

impl Recovery {
    /// Reaction to an error of an attempt that was not repeated yet.
    pub fn of(error: &Error) -> Self {
        Self::after(error, 0)
    }

    /// Reaction to an error of an attempt that was repeated `repeats` times.
    fn after(error: &Error, repeats: u32) -> Self {
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

/// The attempts at a scene.
pub struct SceneAttempts<'a> {
    pub tools: Tools<'a>,
    pub reporter: &'a dyn Reporter,
    pub scene: u32,
    /// Number of the first attempt.
    pub first: u32,
    /// Whether a dataset already has the scene. If so, a device that does not come back stops the work, because the
    /// existing scene is still good.
    pub is_present: bool,
}

/// The result of the attempts at a scene.
pub struct Attempts<T> {
    /// Result of the last attempt. `None` if the scene failed.
    pub made: Option<T>,
    /// Number of the last attempt.
    pub number: u32,
    /// Errors of the failed attempts, in order.
    pub errors: Vec<Error>,
}

impl SceneAttempts<'_> {
    /// Calls `attempt` with the number of each attempt until one succeeds, at least once. `quarantine` gets the error
    /// of a scene whose labels contradict each other, and may add to it.
    ///
    /// # Errors
    /// If the work must stop.
    pub fn make<T>(
        &self,
        mut attempt: impl FnMut(u32) -> Result<T>,
        mut quarantine: impl FnMut(Error) -> Result<Error>,
    ) -> Result<Attempts<T>> {
        let (mut number, mut repeats, mut errors) = (self.first, 0, Vec::new());
        loop {
            self.tools.running()?;
            let error = match unwound(|| attempt(number)) {
                Ok(made) => return Ok(Attempts { made: Some(made), number, errors }),
                Err(error) => error,
            };
            // A stop or a refused asset is the cause of other errors.
            self.tools.running()?;
            self.tools.assets.refused()?;
            let recovery = Recovery::after(&error, repeats);
            if recovery == Recovery::Stop || recovery == Recovery::FailScene && error.is_device() && self.is_present {
                return Err(error);
            }
            let error = if error.is_contradiction() { quarantine(error)? } else { error };
            let is_last = match recovery {
                Recovery::Repeat => false,
                Recovery::NextAttempt => number + 1 >= self.tools.recipe.dataset.max_attempts,
                Recovery::FailScene | Recovery::Stop => true,
            };
            let event = Event::Attempt { scene: self.scene, attempt: number, error: error.to_string(), last: is_last };
            self.reporter.event(&event);
            if recovery == Recovery::Repeat {
                repeats += 1;
                continue;
            }
            errors.push(error);
            if is_last {
                return Ok(Attempts { made: None, number, errors });
            }
            (number, repeats) = (number + 1, 0);
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
            (Error::exceeds_device("too large"), 0, Recovery::FailScene),
            (Error::contradiction("masks"), 0, Recovery::FailScene),
            (Error::unlucky("no room for a body"), 0, Recovery::NextAttempt),
            (Error::new("a wrong option"), 0, Recovery::Stop),
            (Error::stopped("by its caller"), 0, Recovery::Stop),
            (Error::io("data", &std::io::Error::other("full")), 0, Recovery::Stop),
        ] {
            assert_eq!(Recovery::after(&error, repeats), wanted, "{error}");
        }
    }
}
