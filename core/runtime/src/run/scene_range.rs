//! The scenes of a recipe that a user requests.

use std::ops::Range;
use std::str::FromStr;
use syntable_model::error::Error;

/// Scenes by number: `A..B` without B, `A..`, `..B`, or one number. A recipe closes open ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneRange {
    first: Option<u32>,
    end: Option<u32>,
}

impl FromStr for SceneRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (first, end) = match text.split_once("..") {
            Some((first, end)) => (bound(first)?, bound(end)?),
            None => {
                let scene = number(text)?;
                (Some(scene), Some(scene.saturating_add(1)))
            }
        };
        match (first, end) {
            (Some(low), Some(high)) if low == high => {
                Err(format!("`{text}` is empty, since it excludes its end; write `{low}` for one scene"))
            }
            (Some(low), Some(high)) if low > high => Err(format!("`{text}` is empty; write the smaller first")),
            _ => Ok(Self { first, end }),
        }
    }
}

fn bound(text: &str) -> Result<Option<u32>, String> {
    if text.is_empty() { Ok(None) } else { number(text).map(Some) }
}

fn number(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| format!("`{text}` is not a scene number; write 0 for the first scene, 0..10 for ten"))
}

impl SceneRange {
    /// The scenes of a recipe with `count` scenes.
    ///
    /// # Errors
    /// If the recipe does not have them all.
    pub fn within(self, count: u32) -> Result<Range<u32>, Error> {
        within(Some(&(self.first.unwrap_or(0)..self.end.unwrap_or(count))), count)
    }
}

/// The scenes that a caller requests, or all scenes of a recipe with `count` scenes.
///
/// # Errors
/// If the range is empty, or the recipe does not have them all.
pub(crate) fn within(asked: Option<&Range<u32>>, count: u32) -> Result<Range<u32>, Error> {
    match asked {
        None => Ok(0..count),
        Some(asked) if asked.start < asked.end && asked.end <= count => Ok(asked.clone()),
        Some(Range { start, end }) => {
            let message = format!("`options.scenes` {start}..{end}: the recipe has scenes 0..{count}");
            Err(Error::new(message).of_request())
        }
    }
}

/// Ascending scene numbers as text: `0..3, 7`, where `0..3` excludes 3.
pub(crate) fn ranges(scenes: impl Iterator<Item = u32>) -> String {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for scene in scenes {
        match runs.last_mut() {
            Some(run) if run.end == scene => run.end += 1,
            _ => runs.push(scene..scene + 1),
        }
    }
    let text = |run: &Range<u32>| if run.len() == 1 { run.start.to_string() } else { format!("{run:?}") };
    runs.iter().map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_scenes() {
        let range = |first, end| Ok(SceneRange { first, end });
        assert_eq!("2..5".parse(), range(Some(2), Some(5)));
        assert_eq!("..5".parse(), range(None, Some(5)));
        assert_eq!("7".parse(), range(Some(7), Some(8)));
        for wrong in ["5..5", "a", "-1..2"] {
            assert!(wrong.parse::<SceneRange>().is_err(), "{wrong}");
        }
        let within = |text: &str, count| text.parse::<SceneRange>().expect("a range").within(count);
        assert!(within("1..", 3).is_ok_and(|range| range == (1..3)));
        assert!(within("3..", 3).is_err() && within("..4", 3).is_err());
    }
}
