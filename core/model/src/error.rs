//! One error type for everything that can go wrong while a dataset is made.
//!
//! An error states the failure, its file and place if it has them, and a remedy. Messages are lower case and have no
//! full stop, so that they can be joined.

use crate::shown::shown;
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use syntable_toml_schema::{DisplayPath, Finding};

/// Shorthand for results of this crate and of stages.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Maximum length of a message, and of each help and context, characters. A longer text contains a part of a file.
const MAX_MESSAGE: usize = 4000;

/// Number of the system error for too many links on Linux. On other systems, the number is unlikely to mean something
/// else.
const ELOOP: i32 = 40;

/// A failure, its place, and a remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    message: String,
    file: Option<PathBuf>,
    place: Option<Place>,
    help: Option<String>,
    context: Vec<String>,
    cause: Cause,
}

/// Cause of a failure. It decides whether and how the work is tried again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    /// Every attempt at every scene would fail: the run stops.
    Permanent,
    /// As [`Permanent`](Self::Permanent): sound content of a file, in a variant that this program does not read.
    Unsupported,
    /// Other random numbers may avoid it: the scene is tried again.
    Chance,
    /// The caller asked to stop: the same command continues where the run stopped.
    Stopped,
    /// The file system failed: the run stops, and the same command may succeed later.
    Io(ErrorKind),
    /// A device failed, such as a graphics card. The scene is not the cause, so no attempt with other random numbers
    /// follows.
    Device {
        /// Whether the same attempt may succeed after the device is opened again.
        is_passing: bool,
    },
    /// Labels contradict each other: a stage is wrong, and nothing of the scene is written. No attempt with other random
    /// numbers may hide it.
    Contradiction,
}

/// A place inside a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file, from 1.
    Line(usize),
    /// A byte offset, from 0.
    Byte(u64),
}

impl Error {
    /// An error with a message: lower case, no full stop, naming the wrong value. Every attempt at every scene would
    /// fail with it, so a run stops; see [`unlucky`](Self::unlucky).
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: cut(message.into()),
            file: None,
            place: None,
            help: None,
            context: Vec::new(),
            cause: Cause::Permanent,
        }
    }

    /// Content in a variant of a format that this program does not read, in a file that may be sound. A reader that can
    /// do without the content warns and continues.
    pub fn unsupported(message: impl Into<String>) -> Self {
        Self { cause: Cause::Unsupported, ..Self::new(message) }
    }

    /// Whether the content is in a variant that this program does not read.
    pub fn is_unsupported(&self) -> bool {
        self.cause == Cause::Unsupported
    }

    /// A failed operation of the file system.
    ///
    /// If the failure is an error of this type, as of a file in a mirror, it stays as it is.
    pub fn io(file: impl AsRef<Path>, error: &std::io::Error) -> Self {
        if let Some(own) = error.get_ref().and_then(|inner| inner.downcast_ref::<Self>()) {
            return own.clone().in_file(file);
        }
        // Rust has no stable kind for it: a cycle of links.
        let kind = if error.raw_os_error() == Some(ELOOP) { ErrorKind::InvalidInput } else { error.kind() };
        let text = error.to_string();
        let text = match error.raw_os_error() {
            // The number of the operating system tells users nothing.
            Some(_) => text.to_lowercase().split(" (os error ").next().unwrap_or_default().to_owned(),
            None => text,
        };
        Self { cause: Cause::Io(kind), ..Self::new(text).in_file(file) }
    }

    /// A failure of a device, for example a lost device or one that ran out of memory. The device is opened again, and
    /// the same attempt at the scene is repeated.
    pub fn device(message: impl Into<String>) -> Self {
        Self { cause: Cause::Device { is_passing: true }, ..Self::new(message) }
    }

    /// Work that exceeds a limit of a device: the scene fails at once.
    pub fn exceeds_device(message: impl Into<String>) -> Self {
        Self { cause: Cause::Device { is_passing: false }, ..Self::new(message) }
    }

    /// Labels of a view that contradict each other.
    pub fn contradiction(message: impl Into<String>) -> Self {
        Self { cause: Cause::Contradiction, ..Self::new(message) }
    }

    /// Whether labels contradict each other.
    pub fn is_contradiction(&self) -> bool {
        self.cause == Cause::Contradiction
    }

    /// Whether a device failed or is too small, rather than the content.
    pub fn is_device(&self) -> bool {
        matches!(self.cause, Cause::Device { .. })
    }

    /// Whether a device failed, and the same work may succeed after the device is opened again.
    pub fn is_passing(&self) -> bool {
        matches!(self.cause, Cause::Device { is_passing: true })
    }

    /// Whether the file system failed, rather than the content: the same work may succeed later.
    pub fn is_io(&self) -> bool {
        matches!(self.cause, Cause::Io(_))
    }

    /// Whether the file system failed for a reason other than the file: a device, a network, permissions, or the limits
    /// of the process. A missing file, an impossible name, and content that ends early are faults of the file.
    pub fn is_transient(&self) -> bool {
        use ErrorKind::*;
        let of_file = |kind| {
            matches!(
                kind,
                NotFound
                    | NotADirectory
                    | IsADirectory
                    | InvalidInput
                    | InvalidData
                    | InvalidFilename
                    | UnexpectedEof
                    | Unsupported
            )
        };
        matches!(self.cause, Cause::Io(kind) if !of_file(kind))
    }

    /// The kind of a failed operation of the file system.
    pub fn io_kind(&self) -> Option<ErrorKind> {
        if let Cause::Io(kind) = self.cause { Some(kind) } else { None }
    }

    /// An error caused by random numbers, such as no place for a body. Other random numbers may avoid it, so the scene
    /// is tried again. Code that draws random numbers marks its errors so; errors from [`new`](Self::new) are
    /// permanent.
    pub fn unlucky(message: impl Into<String>) -> Self {
        Self { cause: Cause::Chance, ..Self::new(message) }
    }

    /// Marks a permanent error as caused by random numbers, for the code that drew them. Other errors, such as failures
    /// of the file system and of devices, stay unchanged.
    pub fn by_chance(mut self) -> Self {
        if self.is_permanent() {
            self.cause = Cause::Chance;
        }
        self
    }

    /// Work that ended because the caller asked for it.
    pub fn stopped(message: impl Into<String>) -> Self {
        Self { cause: Cause::Stopped, ..Self::new(message) }
    }

    /// Whether other random numbers may avoid it.
    pub fn is_unlucky(&self) -> bool {
        self.cause == Cause::Chance
    }

    /// Whether every attempt at every scene would meet this error.
    pub fn is_permanent(&self) -> bool {
        matches!(self.cause, Cause::Permanent | Cause::Unsupported)
    }

    /// Marks the error as a fault of the command, whatever its cause was: the same command fails again.
    pub fn of_request(mut self) -> Self {
        self.cause = Cause::Permanent;
        self
    }

    /// Names the file, unless a deeper layer has named one.
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.file.get_or_insert_with(|| shown(file.as_ref()));
        self
    }

    /// Names the line, from 1.
    pub fn at_line(mut self, line: usize) -> Self {
        self.place = Some(Place::Line(line));
        self
    }

    /// Names the byte offset, from 0.
    pub fn at_byte(mut self, byte: u64) -> Self {
        self.place = Some(Place::Byte(byte));
        self
    }

    /// Attaches a help message.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(cut(help.into()));
        self
    }

    /// Adds the operation in progress, outermost last: `object \`mug\``, `scene 3`.
    pub fn context(mut self, doing: impl Into<String>) -> Self {
        self.context.push(cut(doing.into()));
        self
    }

    /// Adds the consequence to the message.
    pub fn with_consequence(mut self, consequence: &str) -> Self {
        self.message = cut(format!("{}; {consequence}", self.message));
        self
    }

    /// Adds the number of occurrences to the message.
    pub(crate) fn said(mut self, times: usize) -> Self {
        self.message = format!("{} ({times} times)", self.message);
        self
    }

    /// The bare message.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The file at fault, if any.
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// The place in that file, if known.
    pub fn place(&self) -> Option<Place> {
        self.place
    }

    /// The help message, if any.
    pub fn help_text(&self) -> Option<&str> {
        self.help.as_deref()
    }
}

/// Cuts a text at [`MAX_MESSAGE`], so that an error can be printed whatever a file holds.
fn cut(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(MAX_MESSAGE) {
        text.truncate(end);
        text.push('…');
        text.shrink_to_fit();
    }
    text
}

impl Error {
    /// The contexts, the file and the message, without the help message.
    pub fn without_help(&self) -> String {
        Self { help: None, ..self.clone() }.to_string()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for context in self.context.iter().rev() {
            write!(f, "{context}: ")?;
        }
        if let Some(file) = &self.file {
            write!(f, "{}", file.display())?;
            match self.place {
                Some(Place::Line(line)) => write!(f, ":{line}: ")?,
                Some(Place::Byte(byte)) => write!(f, " at byte {byte}: ")?,
                None => write!(f, ": ")?,
            }
        }
        write!(f, "{}", self.message)?;
        match &self.help {
            Some(help) => write!(f, " ({help})"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {}

/// A value of a recipe that a stage refuses, found by [`Config::build`](crate::registry::Config::build).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// Path of the key inside the stage's own table, such as `count` or `material.floor`; empty for the table.
    pub key: String,
    /// The problem, with the value at fault.
    pub message: String,
    /// A help message.
    pub help: Option<String>,
}

impl ConfigError {
    /// Refuses the value under `key`.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into(), help: None }
    }

    /// Attaches a help message.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl From<Finding> for ConfigError {
    fn from(finding: Finding) -> Self {
        let help = finding.help();
        Self { key: DisplayPath(&finding.path).to_string(), message: finding.message, help }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_that_fails_says_nothing_about_a_file() {
        let of = |code: i32| Error::io("a.obj", &std::io::Error::from_raw_os_error(code));
        // EINTR, EIO, EAGAIN, ENOMEM, EACCES, ENFILE, EMFILE, ENOSPC, ETIMEDOUT, ESTALE.
        for code in [4, 5, 11, 12, 13, 23, 24, 28, 110, 116] {
            assert!(of(code).is_transient() && of(code).is_io(), "{code}");
        }
        // ENOENT, ENOTDIR, EISDIR, EINVAL, ENAMETOOLONG, ELOOP.
        for code in [2, 20, 21, 22, 36, 40] {
            assert!(!of(code).is_transient() && of(code).is_io(), "{code}");
        }
        assert!(!Error::new("no faces").is_transient());
    }

    #[test]
    fn a_device_is_at_fault_whatever_says_so() {
        let (lost, small) = (Error::device("lost"), Error::exceeds_device("too large"));
        for error in [&lost, &small] {
            let error = error.clone().help("h").context("render").by_chance();
            assert!(error.is_device() && !error.is_permanent() && !error.is_io() && !error.is_transient(), "{error:?}");
            assert!(error.of_request().is_permanent());
        }
        assert!(lost.is_passing() && !small.is_passing());
        assert!(!Error::new("no faces").is_device());
    }

    #[test]
    fn no_error_prints_a_whole_file() {
        let token = "ä".repeat(1 << 20);
        let error = Error::new(format!("`{token}` is no number")).help(token.clone()).context(token);
        assert!(error.to_string().chars().count() < 3 * MAX_MESSAGE + 20);
        assert!(error.message().starts_with("`ää") && error.message().ends_with('…'));
        assert_eq!(Error::new("short").message(), "short");
    }

    #[test]
    fn reads_from_the_outside_in() {
        let error = Error::new("index 9 but only 4 vertices")
            .at_line(7)
            .in_file("a/model.obj")
            .help("export it again")
            .context("object `a`")
            .context("scene 3");
        assert_eq!(
            error.to_string(),
            "scene 3: object `a`: a/model.obj:7: index 9 but only 4 vertices (export it again)"
        );
    }
}
