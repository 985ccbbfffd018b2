//! Ends of verbs.

use std::path::Path;
use syntable_model::error::Error;
use syntable_recipe::message::Message;
use syntable_runtime::left_out::LeftOutReport;

/// End of a verb with an exit code other than 0.
pub struct Exit {
    /// The exit code of the process.
    pub code: u8,
    /// Messages to print.
    pub messages: Vec<Message>,
}

impl Exit {
    /// The recipe, an option or an asset is wrong, and the verb made nothing.
    pub fn wrong(error: Error) -> Self {
        Self { code: 2, messages: vec![Message::Error(error)] }
    }

    /// Work stopped early, and finished work is kept. A permanent error is an error of the request, as in
    /// [`wrong`](Self::wrong).
    pub fn stopped(error: Error) -> Self {
        let code = if error.is_permanent() { 2 } else { 1 };
        Self { code, messages: vec![Message::Error(error)] }
    }

    /// Exit code 1 for a result that cannot be printed. A closed pipe is not an error.
    pub(crate) fn if_not_printed(error: &std::io::Error) -> Result<(), Self> {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Ok(()),
            _ => Err(Self::stopped(Error::io("standard output", error))),
        }
    }

    /// Exit code 3 with the data that a verb omitted from its result. `file` and `help` tell the reader where to look.
    ///
    /// # Errors
    /// If the verb omitted anything.
    pub fn if_left_out(left_out: LeftOutReport, file: &Path, help: &str) -> Result<(), Self> {
        match left_out.messages(file, help) {
            messages if messages.is_empty() => Ok(()),
            messages => Err(Self { code: 3, messages }),
        }
    }
}
