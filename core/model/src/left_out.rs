//! Items that stages leave out of images, because a format or a product cannot hold them.

use std::borrow::Cow;
use std::fmt;

/// Why writers leave out objects without pixels.
const WITHOUT_PIXELS: &str = "objects are left out: their masks cover no pixel of the image";

/// Items that a stage left out of an image: how many of how many, and why.
///
/// Stages pass it to [`Log::left_out`](crate::context::Log::left_out); a count of 0 reports nothing. Verbs sum it over
/// the images that lost items, print it on standard error and end with exit code 3.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The items and the reason, as a message has them after the numbers: `objects lost all their pixels: …`.
    pub what: Cow<'static, str>,
    /// Number of items that were left out of the image.
    pub count: u64,
    /// Number of all such items in the image.
    pub of: u64,
    /// How the user can avoid it.
    pub help: Option<Cow<'static, str>>,
}

impl LeftOut {
    /// `count` of `of` items.
    pub fn new(count: usize, of: usize, what: impl Into<Cow<'static, str>>) -> Self {
        Self { what: what.into(), count: count as u64, of: of as u64, help: None }
    }

    /// Sums entries with the same text, in the order in which they come first. Sums of 0 are dropped.
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

    /// Objects that a writer leaves out because none of their masks has a pixel. [`Self::is_without_pixels`] recognizes
    /// the sum.
    pub fn without_pixels(count: usize, of: usize) -> Self {
        Self::new(count, of, WITHOUT_PIXELS)
    }

    /// Whether the text came from [`Self::without_pixels`].
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
