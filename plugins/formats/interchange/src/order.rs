//! Occlusion order of objects.

use crate::labels::ShownLabel;
use std::cell::OnceCell;
use std::collections::BTreeSet;
use syntable_formats::read::{occludes, order_by};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, OCCLUSION_ORDER};
use syntable_model::product::{OcclusionOrder, reversed, strong_components};

/// The products that [`ObjectOrder`] reads. Without depth, ids decide the order.
pub fn inputs() -> [Input; 2] {
    [Input::of(OCCLUSION_ORDER), Input::of(DEPTH).optional()]
}

/// Depth of the visible part of an object, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisibleDepth {
    /// Depth of the nearest pixel; infinite without visible pixels.
    pub nearest: f32,
    /// Depth of the farthest pixel.
    pub farthest: f32,
    /// Mean depth of all pixels.
    pub mean: f64,
}

impl VisibleDepth {
    /// Depth of an object without visible pixels.
    const UNKNOWN: Self = Self { nearest: f32::INFINITY, farthest: f32::NEG_INFINITY, mean: f64::INFINITY };

    /// The depth at the pixels of a mask that have a depth.
    fn of(depth: &Plane<f32>, visible: &Mask) -> Self {
        let depths = || visible.pixels().map(|pixel| depth.data()[pixel]).filter(|depth| depth.is_finite());
        let sum: f64 = depths().map(f64::from).sum();
        let count = depths().count();
        Self {
            nearest: depths().fold(f32::INFINITY, f32::min),
            farthest: depths().fold(f32::NEG_INFINITY, f32::max),
            mean: if count == 0 { f64::INFINITY } else { sum / count as f64 },
        }
    }
}

/// The occlusion order of some objects of a view, by index.
pub struct ObjectOrder {
    /// The objects that each object occludes, ascending.
    behind: Vec<Vec<u16>>,
    /// The objects that occlude each object, ascending.
    front: Vec<Vec<u16>>,
    /// Depths of the objects.
    pub depths: Vec<VisibleDepth>,
    /// The strongly connected component of each object, from front to back, computed at its first use.
    circles: OnceCell<Vec<usize>>,
}

impl ObjectOrder {
    fn new(behind: Vec<Vec<u16>>, depths: Vec<VisibleDepth>) -> Self {
        Self { front: reversed(&behind), behind, depths, circles: OnceCell::new() }
    }

    /// The order of the objects with these labels.
    pub fn of(products: &Products, labels: &[ShownLabel]) -> Result<Self> {
        let (order, depth) = (products.get(OCCLUSION_ORDER)?, products.optional(DEPTH)?);
        let rows = labels.iter().map(|label| row(order, label.id)).collect::<Result<Vec<usize>>>()?;
        let mut objects = vec![None; order.ids().len()];
        (0..=u16::MAX).zip(&rows).for_each(|(object, row)| objects[*row] = Some(object));
        // Labels are in the order of their ids, as rows are.
        let behind = rows.iter().map(|row| order.behind(*row).filter_map(|other| objects[other]).collect());
        let behind = behind.collect();
        let depths = labels
            .iter()
            .map(|label| depth.map_or(VisibleDepth::UNKNOWN, |depth| VisibleDepth::of(depth, label.visible)))
            .collect();
        Ok(Self::new(behind, depths))
    }

    /// The order of objects by their visible and hidden masks, without depths.
    pub fn of_masks(masks: &[[&Mask; 2]]) -> Self {
        let objects = (0..).map(InstanceId).zip(masks).map(|(id, [seen, hidden])| (id, *seen, Some(*hidden)));
        let order = order_by(&objects.collect::<Vec<_>>(), occludes);
        let behind = (0..masks.len()).map(|i| order.behind(i).map(|j| j as u16).collect()).collect();
        Self::new(behind, vec![VisibleDepth::UNKNOWN; masks.len()])
    }

    /// Whether object `i` occludes object `j`, and `j` does not occlude `i`, directly or through others.
    pub fn is_in_front(&self, i: usize, j: usize) -> bool {
        self.occludes(i, j) && self.circles()[i] != self.circles()[j]
    }

    /// The strongly connected component of each object. The objects of a component occlude each other, directly or
    /// through others.
    fn circles(&self) -> &[usize] {
        self.circles.get_or_init(|| strong_components(&self.behind, &self.front))
    }

    /// Number of objects in the longest chain of occluders in front of each object; none if a cycle in front of the
    /// object makes this number ambiguous.
    pub fn certain_layers(&self) -> Vec<Option<usize>> {
        let circles = self.circles();
        let mut sizes = vec![0; circles.len()];
        circles.iter().for_each(|&circle| sizes[circle] += 1);
        let mut sorted: Vec<usize> = (0..circles.len()).collect();
        sorted.sort_by_key(|&node| circles[node]);
        let mut layers: Vec<Option<usize>> = sizes.iter().map(|_| Some(0)).collect();
        // Occluders precede the objects that they occlude, except within a cycle.
        for &i in &sorted {
            if sizes[circles[i]] > 1 {
                layers[i] = None;
            }
            for j in self.behind(i).filter(|&j| circles[j] != circles[i]) {
                layers[j] = layers[i].zip(layers[j]).map(|(front, layer)| layer.max(front + 1));
            }
        }
        layers
    }

    /// Whether object `i` hides a part of object `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.behind[i].binary_search(&(j as u16)).is_ok()
    }

    /// The objects that object `i` occludes, ascending.
    pub fn behind(&self, i: usize) -> impl Iterator<Item = usize> {
        self.behind[i].iter().map(|j| usize::from(*j))
    }

    /// The objects from front to back: each object follows all its occluders. Whenever several objects have no
    /// remaining occluder, the nearest comes first. Where objects occlude each other, directly or in a cycle, the
    /// object with the nearest visible pixel comes first.
    pub fn front_to_back(&self) -> Vec<usize> {
        let count = self.depths.len();
        let mut sorted = Vec::with_capacity(count);
        let mut is_left = vec![true; count];
        // Number of occluders of each object that are not sorted.
        let mut occluders: Vec<usize> =
            (0..count).map(|j| self.front[j].iter().filter(|i| usize::from(**i) != j).count()).collect();
        // Objects without occluders from the nearest on; of equally near ones, the first.
        let place = |node: usize| (ranked(self.depths[node].nearest), node);
        let mut free: BTreeSet<(i32, usize)> = (0..count).filter(|j| occluders[*j] == 0).map(place).collect();
        while sorted.len() < count {
            let nearest = || self.foremost(&is_left).into_iter().map(place).min();
            let Some((_, next)) = free.pop_first().or_else(nearest) else { break };
            is_left[next] = false;
            for j in self.behind(next).filter(|j| is_left[*j]) {
                occluders[j] -= 1;
                free.extend((occluders[j] == 0).then(|| place(j)));
            }
            sorted.push(next);
        }
        sorted
    }

    /// The objects of the cycles among some objects that no object outside the cycle occludes.
    fn foremost(&self, is_left: &[bool]) -> Vec<usize> {
        let among = |edges: &[Vec<u16>]| -> Vec<Vec<u16>> {
            let others = |others: &Vec<u16>| others.iter().copied().filter(|j| is_left[usize::from(*j)]).collect();
            edges.iter().zip(is_left).map(|(of, is_left)| if *is_left { others(of) } else { Vec::new() }).collect()
        };
        let behind = among(&self.behind);
        let circles = strong_components(&behind, &among(&self.front));
        let mut is_occluded = vec![false; circles.len()];
        for (i, others) in behind.iter().enumerate() {
            for circle in others.iter().map(|j| circles[usize::from(*j)]) {
                is_occluded[circle] |= circle != circles[i];
            }
        }
        (0..circles.len()).filter(|&node| is_left[node] && !is_occluded[circles[node]]).collect()
    }

    /// The number of objects in the longest chain of occluders in front of each object, 0 if nothing occludes it.
    /// `sorted` are the objects [from front to back](Self::front_to_back); an occluder that comes later does not count.
    pub fn layers(&self, sorted: &[usize]) -> Vec<usize> {
        let mut layers = vec![0; self.depths.len()];
        let places = places(sorted);
        for &j in sorted {
            let front = self.front[j].iter().map(|i| usize::from(*i)).filter(|&i| places[i] < places[j]);
            layers[j] = front.map(|i| layers[i] + 1).max().unwrap_or(0);
        }
        layers
    }
}

/// The place of each object in a list of all objects.
pub fn places(sorted: &[usize]) -> Vec<usize> {
    let mut places = vec![0; sorted.len()];
    sorted.iter().enumerate().for_each(|(place, object)| places[*object] = place);
    places
}

/// A number in the order of floats by [`f32::total_cmp`].
fn ranked(depth: f32) -> i32 {
    let bits = depth.to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

fn row(order: &OcclusionOrder, id: InstanceId) -> Result<usize> {
    order.ids().binary_search(&id).map_err(|_| {
        Error::new(format!("instance {id} is in `amodal_mask` but not in `{}`", OCCLUSION_ORDER.name()))
            .help("all label products must come from one annotator, or from annotators that agree")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(edges: &[(usize, usize)], nearest: &[f32]) -> ObjectOrder {
        let mut behind = vec![Vec::new(); nearest.len()];
        edges.iter().for_each(|&(i, j)| behind[i].push(j as u16));
        behind.iter_mut().for_each(|behind| behind.sort_unstable());
        let depth = |&nearest: &f32| VisibleDepth { nearest, farthest: nearest, mean: nearest.into() };
        ObjectOrder::new(behind, nearest.iter().map(depth).collect())
    }

    #[test]
    fn occluders_come_first_then_what_is_nearer() {
        // 2 hides 0 though it is farther; 1 is unrelated.
        let chain = order(&[(2, 0), (0, 3)], &[1.0, 1.5, 3.0, 0.5]);
        assert_eq!(chain.front_to_back(), [1, 2, 0, 3]);
        assert_eq!(chain.layers(&chain.front_to_back()), [1, 0, 0, 2]);
        assert!(order(&[], &[]).front_to_back().is_empty());
        // 0 has no visible pixel, and equal depths keep the order of the ids.
        assert_eq!(order(&[], &[f32::INFINITY, 2.0, 2.0]).front_to_back(), [1, 2, 0]);
    }

    #[test]
    fn what_circles_leave_open_is_not_certain() {
        // 0 is in front of the cycle 1, 2, which is in front of 3; 0 is also in front of 4.
        let of = order(&[(0, 1), (1, 2), (2, 1), (2, 3), (0, 4)], &[f32::INFINITY; 5]);
        assert_eq!(of.certain_layers(), [Some(0), None, None, None, Some(1)]);
        let in_front = |i, j| of.is_in_front(i, j);
        assert_eq!([in_front(0, 1), in_front(1, 2), in_front(2, 3), in_front(1, 0)], [true, false, true, false]);
    }

    #[test]
    fn the_order_of_masks_is_who_hides_whom() {
        let mask = |from: u32, to: u32| Mask::from_fn(10, 1, |x, _| (from..to).contains(&x));
        // 0 covers the end of 1, which touches 2.
        let [near, far, beside, none] = [mask(4, 8), mask(2, 4), mask(0, 2), mask(0, 0)];
        let of = ObjectOrder::of_masks(&[[&near, &none], [&far, &mask(4, 6)], [&beside, &none]]);
        assert_eq!(of.behind, [vec![1], Vec::new(), Vec::new()]);
        assert_eq!(of.certain_layers(), [Some(0), Some(1), Some(0)]);
    }

    /// Compares with a search from each object, and with the definition of the order applied step by step.
    #[test]
    fn random_orders_match_a_search() {
        let mut stream = Stream::root(31);
        for round in 0..300 {
            let n = 1 + round % 8;
            let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j);
            let edges: Vec<(usize, usize)> = pairs.filter(|_| stream.uniform(0.0, 1.0) < 0.25).collect();
            let nearest: Vec<f32> = (0..n).map(|_| stream.uniform(0.0, 3.0) as f32).collect();
            let of = order(&edges, &nearest);
            // All objects that occlude `node`, directly or through other objects of `nodes`.
            let before = |nodes: &[usize], node: usize| {
                let (mut found, mut open) = (Vec::new(), vec![node]);
                while let Some(j) = open.pop() {
                    let new = nodes.iter().copied().filter(|&i| edges.contains(&(i, j)) && !found.contains(&i));
                    let new: Vec<usize> = new.collect();
                    found.extend(&new);
                    open.extend(new);
                }
                found
            };
            let all: Vec<usize> = (0..n).collect();
            for (i, j) in all.iter().flat_map(|&i| all.iter().map(move |&j| (i, j))) {
                let is_in_front = edges.contains(&(i, j)) && !before(&all, i).contains(&j);
                assert_eq!(of.is_in_front(i, j), is_in_front, "{i} {j}: {edges:?}");
            }
            let longest = |node: usize| {
                let ancestors = before(&all, node);
                let is_open = ancestors.iter().chain([&node]).any(|&i| before(&all, i).contains(&i));
                // Each round finds chains that are longer by one.
                let mut chain = vec![0; n];
                (0..n).for_each(|_| edges.iter().for_each(|&(i, j)| chain[j] = chain[j].max(chain[i] + 1).min(n)));
                (!is_open).then_some(chain[node])
            };
            assert_eq!(of.certain_layers(), all.iter().map(|&node| longest(node)).collect::<Vec<_>>(), "{edges:?}");
            let (mut rest, mut sorted) = (all.clone(), Vec::new());
            while !rest.is_empty() {
                let is_foremost = |&j: &usize| before(&rest, j).iter().all(|&i| before(&rest, i).contains(&j));
                let free = rest.iter().copied().filter(|&j| before(&rest, j).is_empty()).collect::<Vec<_>>();
                let open = if free.is_empty() { rest.iter().copied().filter(is_foremost).collect() } else { free };
                let next = open.into_iter().min_by(|&i, &j| nearest[i].total_cmp(&nearest[j])).expect("one");
                rest.retain(|&node| node != next);
                sorted.push(next);
            }
            assert_eq!(of.front_to_back(), sorted, "{edges:?} {nearest:?}");
        }
    }

    #[test]
    fn circles_are_cut_in_front_of_the_nearest_object() {
        // A ring 0, 1, 2 in front of 3, which is the nearest object but is not in a cycle.
        let ring = order(&[(0, 1), (1, 2), (2, 0), (0, 3)], &[3.0, 2.0, 4.0, 1.0]);
        assert_eq!(ring.front_to_back(), [1, 2, 0, 3]);
        assert_eq!(ring.layers(&ring.front_to_back()), [2, 0, 1, 3]);
        // Two pairs of objects that occlude each other; one pair is in front of the other.
        let pairs = order(&[(0, 1), (1, 0), (2, 3), (3, 2), (3, 0)], &[1.0, 2.0, 5.0, 4.0]);
        assert_eq!(pairs.front_to_back(), [3, 2, 0, 1]);
    }
}
