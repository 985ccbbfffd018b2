//! What stages leave out of images because a format or a product cannot hold it.

use std::borrow::Cow;
use std::fmt;

/// Why writers leave out objects without pixels.
const WITHOUT_PIXELS: &str = "objects are left out: their masks cover no pixel of the image";

/// What a stage left out of an image: how many of how many, and why.
///
/// Stages hand it to [`Log::left_out`](crate::context::Log::left_out); a count of 0 says nothing. Verbs add it up over the images
/// that lost something, name it on standard error and end with exit code 3.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// What it happened to, and why, after the numbers: `objects lost all their pixels: …`.
    pub what: Cow<'static, str>,
    /// How many of them in the image.
    pub count: u64,
    /// Number of all in the image that it could have happened to.
    pub of: u64,
    /// What the user can do.
    pub help: Option<Cow<'static, str>>,
}

impl LeftOut {
    /// `count` of `of` things.
    pub fn new(count: usize, of: usize, what: impl Into<Cow<'static, str>>) -> Self {
        Self { what: what.into(), count: count as u64, of: of as u64, help: None }
    }

    /// Adds up those that say the same, in the order in which they come first; those that say nothing are gone.
    pub fn sum(all: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut sums: Vec<Self> = Vec::new();
        for left_out in all {
            match sums.iter_mut().find(|sum| sum.what == left_out.what) {
                Some(sum) => (sum.count, sum.of) = (sum.count + left_out.count, sum.of + left_out.of),
                None => sums.push(left_out),
            }
        }
        sums.retain(|sum| sum.count > 0);
        sums
    }

    /// Objects that a writer leaves out since no mask of theirs has a pixel. [`Self::is_without_pixels`] recognizes the sum.
    pub fn without_pixels(count: usize, of: usize) -> Self {
        Self::new(count, of, WITHOUT_PIXELS)
    }

    /// Whether these words are those of [`Self::without_pixels`].
    pub fn is_without_pixels(what: &str) -> bool {
        what == WITHOUT_PIXELS
    }

    /// The same with a remedy.
    pub fn help(self, help: impl Into<Cow<'static, str>>) -> Self {
        Self { help: Some(help.into()), ..self }
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} {}", self.count, self.of, self.what)
    }
}
