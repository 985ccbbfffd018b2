//! Matches predictions to objects: the assignment with the greatest sum of F.
//!
//! As in the reference, pairs need no minimum F: the result has min(objects, predictions) pairs, even pairs without a
//! common pixel. If several assignments have the same sum, the result is the assignment whose list of pairs, by object,
//! is lexicographically lowest.

use crate::masked_object::MaskedObject;
use syntable_model::product::Mask;

/// Pairs (label, prediction).
pub type MatchedPairs = Vec<(usize, usize)>;

/// An F of 1 as an integer. With integers, equal sums compare as equal.
const UNIT: f64 = (1_u64 << 40) as f64;

/// F of two masks: the harmonic mean of the shares of each mask that lie in both. 0 without a common pixel.
pub fn f_of(a: &Mask, b: &Mask) -> f64 {
    let both = f64::from(a.shared_area(b));
    if both == 0.0 { 0.0 } else { 2.0 * both / (f64::from(a.area()) + f64::from(b.area())) }
}

/// Matches labels and predictions by one of their masks. The pairs are ordered by label.
pub fn by_masks(
    labels: &[MaskedObject],
    predictions: &[MaskedObject],
    of: impl Fn(&MaskedObject) -> &Mask,
) -> MatchedPairs {
    pairs_of(&labels.iter().map(&of).collect::<Vec<_>>(), &predictions.iter().map(&of).collect::<Vec<_>>())
}

/// Matches masks with other masks. The pairs are ordered by the first.
pub fn pairs_of(labels: &[&Mask], predictions: &[&Mask]) -> MatchedPairs {
    let boxes = [labels, predictions].map(|masks| masks.iter().map(|mask| mask.bbox()).collect::<Vec<_>>());
    let score = |i: usize, j: usize| {
        if boxes[0][i].meets(&boxes[1][j]) { f_of(labels[i], predictions[j]) } else { 0.0 }
    };
    let row = |i: usize| (0..predictions.len()).map(|j| score(i, j)).collect();
    assign(&(0..labels.len()).map(row).collect::<Vec<Vec<f64>>>(), predictions.len())
}

/// Pairs (row, column) with the greatest sum of scores in [0, 1], by row.
pub fn assign(scores: &[Vec<f64>], columns: usize) -> Vec<(usize, usize)> {
    let edge = scores.len().max(columns);
    let cost = |row: usize, column: usize| -> i64 {
        let score = scores.get(row).and_then(|of| of.get(column)).copied().unwrap_or(0.0);
        -((score * UNIT).round() as i64)
    };
    let (mut owner, tight) = solve(edge, cost);
    lowest(&mut owner, &tight);
    let mut pairs: Vec<(usize, usize)> =
        (0..columns).map(|column| (owner[column], column)).filter(|(row, _)| *row < scores.len()).collect();
    pairs.sort_unstable();
    pairs
}

/// The Hungarian method on a square matrix of integers. Returns the row of each column and, for each row, the columns
/// that an optimum may use.
fn solve(edge: usize, cost: impl Fn(usize, usize) -> i64) -> (Vec<usize>, Vec<Vec<bool>>) {
    // Column `edge` is the start of each new row.
    let (mut of_rows, mut of_columns) = (vec![0_i64; edge], vec![0_i64; edge + 1]);
    let mut owner: Vec<Option<usize>> = vec![None; edge + 1];
    for row in 0..edge {
        owner[edge] = Some(row);
        let (mut at, mut least, mut from) = (edge, vec![i64::MAX; edge], vec![edge; edge]);
        let mut is_used = vec![false; edge + 1];
        while let Some(current) = owner[at] {
            is_used[at] = true;
            let (mut delta, mut next) = (i64::MAX, at);
            for column in (0..edge).filter(|column| !is_used[*column]) {
                let slack = cost(current, column) - of_rows[current] - of_columns[column];
                if slack < least[column] {
                    (least[column], from[column]) = (slack, at);
                }
                if least[column] < delta {
                    (delta, next) = (least[column], column);
                }
            }
            for column in 0..=edge {
                match (is_used[column], owner[column]) {
                    (true, Some(row)) => {
                        of_rows[row] += delta;
                        of_columns[column] -= delta;
                    }
                    (false, _) if column < edge => least[column] -= delta,
                    _ => {}
                }
            }
            at = next;
        }
        while at != edge {
            owner[at] = owner[from[at]];
            at = from[at];
        }
    }
    let is_tight = |row: usize, column: usize| cost(row, column) == of_rows[row] + of_columns[column];
    let tight = (0..edge).map(|row| (0..edge).map(|column| is_tight(row, column)).collect()).collect();
    (owner.into_iter().take(edge).flatten().collect(), tight)
}

/// Exchanges columns so that each row in turn gets the lowest column that still permits an optimum.
fn lowest(owner: &mut [usize], tight: &[Vec<bool>]) {
    let mut is_fixed = vec![false; owner.len()];
    for row in 0..owner.len() {
        let Some(own) = owner.iter().position(|it| *it == row) else { continue };
        let mut chosen = own;
        for column in (0..own).filter(|column| tight[row][*column] && !is_fixed[*column]) {
            let mut tried = owner.to_vec();
            let displaced = std::mem::replace(&mut tried[column], row);
            let mut is_seen = is_fixed.clone();
            is_seen[column] = true;
            if reseat(displaced, own, &mut tried, tight, &mut is_seen) {
                owner.copy_from_slice(&tried);
                chosen = column;
                break;
            }
        }
        is_fixed[chosen] = true;
    }
}

/// Finds a column for a row that lost its own, along a path that ends at the column `free`.
fn reseat(row: usize, free: usize, owner: &mut [usize], tight: &[Vec<bool>], is_seen: &mut [bool]) -> bool {
    for column in 0..owner.len() {
        if is_seen[column] || !tight[row][column] {
            continue;
        }
        is_seen[column] = true;
        if column == free || reseat(owner[column], free, owner, tight, is_seen) {
            owner[column] = row;
            return true;
        }
    }
    false
}
