//! The choice of the page's user: seed, scenes, views.

use crate::serve::Request;
use serde::Serialize;
use std::ops::Range;

/// Maximum number of scenes that the page offers.
const MAX_SCENES: u32 = 24;
/// Largest number of a scene that the page offers.
const MAX_SCENE: u32 = 999_999;
/// Maximum number of views per scene that the page offers.
const MAX_VIEWS: u32 = 12;

/// Scenes, views and seed of the page. Values that are `None` come from the recipe and the command.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// Seed of all randomness.
    pub seed: Option<u64>,
    /// Number of the first scene.
    pub first: Option<u32>,
    /// Number of scenes.
    pub scenes: Option<u32>,
    /// Number of views of each scene.
    pub views: Option<u32>,
    /// Scene and view that are open, at final quality.
    pub large: Option<[u32; 2]>,
}

impl Choice {
    /// Reads the choice from the query of a request. Numbers outside of the page's range become its nearest number.
    pub fn of(request: &Request) -> Self {
        let number = |name: &str| request.query(name)?.parse::<u32>().ok();
        let large = request.query("large").and_then(|text| {
            let (scene, view) = text.split_once('.')?;
            Some([scene.parse().ok()?, view.parse().ok()?])
        });
        Self {
            seed: request.query("seed").and_then(|text| text.parse().ok()),
            first: number("first").map(|first| first.min(MAX_SCENE)),
            scenes: number("scenes").map(|scenes| scenes.clamp(1, MAX_SCENES)),
            views: number("views").map(|views| views.clamp(1, MAX_VIEWS)),
            large,
        }
    }

    /// The chosen scenes; the default completes a choice of one end.
    pub fn scenes(&self, default: &Range<u32>) -> Option<Range<u32>> {
        if self.first.is_none() && self.scenes.is_none() {
            return None;
        }
        let first = self.first.unwrap_or(default.start);
        Some(first..first + self.scenes.unwrap_or(default.len() as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_stay_in_their_range() {
        let of = |pairs: &[(&str, &str)]| {
            let query = pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
            Choice::of(&Request { path: "/choose".to_owned(), query })
        };
        assert_eq!(of(&[("seed", "x"), ("scenes", ""), ("large", "3")]), Choice::default());
        let chosen = of(&[("seed", "18446744073709551615"), ("scenes", "999"), ("views", "0"), ("large", "3.1")]);
        assert_eq!((chosen.seed, chosen.views, chosen.large), (Some(u64::MAX), Some(1), Some([3, 1])));
        assert_eq!(chosen.scenes(&(2..4)), Some(2..2 + MAX_SCENES));
        assert_eq!(of(&[("first", "7")]).scenes(&(0..2)), Some(7..9));
        assert_eq!(Choice::default().scenes(&(0..2)), None);
    }
}
