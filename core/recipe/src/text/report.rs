//! All mistakes of a recipe.

use crate::text::diagnostic::{Diagnostic, Severity};
use crate::text::message::Message;
use std::fmt;
use syntable_model::error::Error;

/// All mistakes of a recipe that cannot be run; never empty. Displayed as the command line prints it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// All errors and warnings, in reading order.
    pub diagnostics: Vec<Diagnostic>,
    /// An error that is not of the recipe's text, such as a folder of assets that cannot be read.
    pub other: Option<Box<Error>>,
}

impl Report {
    /// The mistakes one by one, then an error that counts them.
    pub fn messages(&self) -> Vec<Message> {
        let summary = Error::new(format!("{}; nothing was rendered", self.count()));
        self.mistakes().chain([Message::Error(summary)]).collect()
    }

    /// The mistakes one by one.
    pub fn mistakes(&self) -> impl Iterator<Item = Message> {
        let other = self.other.iter().map(|error| Message::Error(Error::clone(error)));
        self.diagnostics.iter().cloned().map(Message::Diagnostic).chain(other)
    }

    /// The diagnostics, in reading order.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.diagnostics.iter()
    }

    /// `2 errors, 1 warning`.
    fn count(&self) -> String {
        let of = |severity| self.diagnostics.iter().filter(|diagnostic| diagnostic.severity == severity).count();
        let say = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        match (of(Severity::Error) + usize::from(self.other.is_some()), of(Severity::Warning)) {
            (errors, 0) => say(errors, "error"),
            (errors, warnings) => format!("{}, {}", say(errors, "error"), say(warnings, "warning")),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.messages().iter().try_for_each(|message| writeln!(f, "{}", message.render(false)))
    }
}

impl std::error::Error for Report {}
