//! Boxes of whole pixels.

/// A box of whole pixels: first column and row, and how many of each. All zeros if empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BBox {
    /// First column.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Columns: last − first + 1.
    pub width: i32,
    /// Rows: last − first + 1.
    pub height: i32,
}

impl BBox {
    /// Whether boxes have a common pixel; one without pixels meets none.
    pub fn meets(&self, other: &Self) -> bool {
        let common =
            |at: i32, long: i32, other: i32, other_long: i32| at.max(other) < (at + long).min(other + other_long);
        common(self.x, self.width, other.x, other.width) && common(self.y, self.height, other.y, other.height)
    }
}

/// Gives the places of each pair of boxes, one of each list, that [meet](BBox::meets), in any order. Sweeps the boxes
/// from left to right, so it compares only boxes with a common column.
pub fn meeting_boxes(ones: &[BBox], others: &[BBox], mut each: impl FnMut(usize, usize)) {
    let lists = [ones, others];
    let of = |list: usize| (0..lists[list].len()).map(move |place| (list, place));
    let mut all: Vec<(usize, usize)> =
        of(0).chain(of(1)).filter(|&(list, place)| lists[list][place].width > 0).collect();
    all.sort_by_key(|&(list, place)| lists[list][place].x);
    // Places of boxes of each list that may reach the column at hand.
    let mut open: [Vec<usize>; 2] = Default::default();
    for (list, place) in all {
        let (own, other) = (&lists[list][place], lists[1 - list]);
        open[1 - list].retain(|&at| i64::from(other[at].x) + i64::from(other[at].width) > i64::from(own.x));
        for &at in &open[1 - list] {
            if own.meets(&other[at]) {
                if list == 0 { each(place, at) } else { each(at, place) }
            }
        }
        open[list].push(place);
    }
}

impl From<[i32; 4]> for BBox {
    fn from([x, y, width, height]: [i32; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<BBox> for [i32; 4] {
    fn from(b: BBox) -> Self {
        [b.x, b.y, b.width, b.height]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_meet_where_they_have_a_common_pixel() {
        let all =
            [[0, 0, 3, 3], [2, 2, 4, 4], [3, 0, 2, 2], [5, 5, 0, 0], [3, 3, 5, 5], [-2, -2, 3, 3]].map(BBox::from);
        let pixels = |b: &BBox| -> std::collections::BTreeSet<[i32; 2]> {
            (b.x..b.x + b.width).flat_map(|x| (b.y..b.y + b.height).map(move |y| [x, y])).collect()
        };
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            assert_eq!(a.meets(b), !pixels(a).is_disjoint(&pixels(b)), "{a:?} {b:?}");
        }
    }

    #[test]
    fn boxes_that_meet_are_found_from_left_to_right() {
        let mut stream = crate::random::Stream::root(2);
        for _ in 0..100 {
            let mut list = || {
                let mut edge = |end| stream.below(end) as i32;
                (0..edge(9)).map(|_| BBox::from([edge(20) - 3, edge(20), edge(6), edge(6)])).collect::<Vec<BBox>>()
            };
            let (ones, others) = (list(), list());
            let mut found = Vec::new();
            meeting_boxes(&ones, &others, |one, other| found.push((one, other)));
            found.sort_unstable();
            let all = (0..ones.len()).flat_map(|one| (0..others.len()).map(move |other| (one, other)));
            assert_eq!(found, all.filter(|&(one, other)| ones[one].meets(&others[other])).collect::<Vec<_>>());
        }
    }
}
