//! Alternatives of a stage.

use syntable_model::random::Stream;

/// A stage, or several alternatives. A scene or a view takes one of the alternatives, drawn by weight.
pub struct OneOf<T: ?Sized>(Vec<(f64, Box<T>)>);

/// The stage that a scene or a view takes.
pub struct Chosen<'s, T: ?Sized> {
    /// The stage.
    pub stage: &'s T,
    /// Its random numbers.
    pub stream: Stream,
    /// Its index among the alternatives; none if the stage has none.
    pub alternative: Option<u32>,
}

impl<T> OneOf<T> {
    /// The stage or its alternatives, by value.
    pub(crate) fn into_all(self) -> impl Iterator<Item = T> {
        self.0.into_iter().map(|(_, stage)| *stage)
    }
}

impl<T: ?Sized> OneOf<T> {
    /// A stage without alternatives.
    pub fn only(stage: Box<T>) -> Self {
        Self(vec![(1.0, stage)])
    }

    /// Alternatives with their weights: at least one, and at least one weight is above zero.
    pub(crate) fn weighted(alternatives: Vec<(f64, Box<T>)>) -> Self {
        Self(alternatives)
    }

    /// The stage or its alternatives.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        self.0.iter().map(|(_, stage)| &**stage)
    }

    /// The stage or its alternatives, each with its weight.
    pub fn weights(&self) -> impl Iterator<Item = (f64, &T)> {
        self.0.iter().map(|(weight, stage)| (*weight, &**stage))
    }

    /// The first alternative, or the only stage.
    pub fn first(&self) -> &T {
        &self.0[0].1
    }

    /// The stage or its alternatives, mutable.
    pub(crate) fn all_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.0.iter_mut().map(|(_, stage)| &mut **stage)
    }

    /// Draws an alternative from the random numbers of the stage. A stage without alternatives gets these numbers unchanged.
    pub fn draw(&self, stream: Stream) -> Chosen<'_, T> {
        if let [(_, only)] = self.0.as_slice() {
            return Chosen { stage: &**only, stream, alternative: None };
        }
        let weights = self.0.iter().map(|(weight, _)| *weight);
        let index = stream.child("one_of").pick_by_weight(weights).unwrap_or_default();
        let stream = stream.child("alternative").at(index as u64);
        Chosen { stage: &*self.0[index].1, stream, alternative: Some(index as u32) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alternatives_occur_by_weight_and_have_random_numbers_of_their_own() {
        let stages = OneOf::<str>::weighted(vec![(1.0, "a".into()), (0.0, "never".into()), (3.0, "b".into())]);
        let mut counts = [0_u32; 3];
        for scene in 0..4000 {
            let stream = Stream::root(5).at(scene);
            let chosen = stages.draw(stream.clone());
            let index = chosen.alternative.expect("several");
            assert_eq!(chosen.stage, ["a", "never", "b"][index as usize]);
            assert_ne!(chosen.stream, stream);
            counts[index as usize] += 1;
        }
        // Five standard deviations of a binomial distribution: 5·√(4000·¼·¾) = 137.
        assert!(counts[0].abs_diff(1000) < 137 && counts[1] == 0, "{counts:?}");
        let only = OneOf::<str>::only("a".into());
        let chosen = only.draw(Stream::root(5));
        assert_eq!((chosen.stage, chosen.stream, chosen.alternative), ("a", Stream::root(5), None));
    }
}
