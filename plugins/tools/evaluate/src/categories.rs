//! COCO's average precision and recall by category, equal to pycocotools with `useCats = 1`: a prediction is compared
//! only with labels of its category, and at most [`MOST`](crate::coco::MOST) predictions per image and category are
//! used.

use crate::coco::{ComparedObjects, KINDS, KindTally, SCORES, values};
use crate::image::ImagePair;
use crate::measure::Measure;
use std::collections::{BTreeMap, BTreeSet};

/// First word of the scores of all categories, which are means over the categories with labels.
pub const MEAN: &str = "categories";

/// COCO's scores of each category, and their means.
pub struct ByCategory {
    /// Ids, and their words in names of scores.
    categories: Vec<(u32, String)>,
}

impl ByCategory {
    /// The scores of these categories of the ground truth.
    pub fn new<'a>(categories: impl Iterator<Item = (u32, &'a str)>) -> Self {
        let categories: Vec<(u32, String)> = categories.map(|(id, name)| (id, word(name))).collect();
        let mut seen = BTreeSet::from([MEAN.to_owned()]);
        let told_apart = |(id, word): (u32, String)| {
            let mut own = word;
            while !seen.insert(own.clone()) {
                own = format!("{own}_{id}");
            }
            (id, own)
        };
        Self { categories: categories.into_iter().map(told_apart).collect() }
    }

    /// The words of the categories in names of scores: `WORD_amodal_mask_ap`.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.categories.iter().map(|(_, word)| word.as_str())
    }
}

/// Names of a category's average precisions, one per kind of mask.
fn average_precisions(word: &str) -> [String; KINDS.len()] {
    KINDS.map(|kind| format!("{word}_{}_{}", kind.name, SCORES[0]))
}

/// A name in snake case.
fn word(name: &str) -> String {
    let parts = name.split(|letter: char| !letter.is_alphanumeric()).filter(|part| !part.is_empty());
    let parts: Vec<String> = parts.map(str::to_lowercase).collect();
    if parts.is_empty() { "unnamed".to_owned() } else { parts.join("_") }
}

/// Tally of an image by category.
pub struct OfCategories(BTreeMap<u32, [KindTally; KINDS.len()]>);

impl Measure for ByCategory {
    type Tally = OfCategories;

    fn names(&self) -> Vec<String> {
        let means = KINDS.iter().flat_map(|kind| SCORES.map(|score| format!("{MEAN}_{}_{score}", kind.name)));
        means.chain(self.words().flat_map(average_precisions)).collect()
    }

    fn tally(&self, pair: &ImagePair) -> OfCategories {
        let predictions = || pair.predictions.iter().chain(&pair.unlikely);
        let objects = pair.labels.iter().chain(predictions());
        let found = objects.filter_map(|it| it.category).chain(pair.crowds.iter().map(|it| it.category));
        let found: BTreeSet<u32> = found.collect();
        let objects = |category: u32| ComparedObjects {
            labels: pair.labels.iter().filter(|it| it.category == Some(category)).collect(),
            crowds: pair.crowds.iter().filter(|it| it.category == category).collect(),
            ranked: predictions().filter(|it| it.category == Some(category)).collect(),
        };
        OfCategories(found.into_iter().map(|it| (it, KINDS.map(|kind| kind.tally(&objects(it))))).collect())
    }

    fn values(&self, images: &[&OfCategories]) -> Vec<Option<f64>> {
        let mut means = Vec::new();
        let mut each = vec![[None; KINDS.len()]; self.categories.len()];
        for kind in 0..KINDS.len() {
            let mut sums = [(0.0, 0); SCORES.len()];
            // Predictions without scores have no order, and neither do categories without predictions.
            let is_unranked = images.iter().flat_map(|it| it.0.values()).any(|kinds| kinds[kind].is_unranked);
            for (of, (category, _)) in each.iter_mut().zip(&self.categories) {
                let tallies: Vec<&KindTally> =
                    images.iter().filter_map(|it| Some(&it.0.get(category)?[kind])).collect();
                let scores = if is_unranked { [None; SCORES.len()] } else { values(&tallies) };
                of[kind] = scores[0];
                for (sum, score) in sums.iter_mut().zip(scores) {
                    *sum = score.map_or(*sum, |score| (sum.0 + score, sum.1 + 1));
                }
            }
            means.extend(sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))));
        }
        means.into_iter().chain(each.into_iter().flatten()).collect()
    }
}
