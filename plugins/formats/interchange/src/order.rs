//! Occlusion order of objects.

use crate::labels::ShownLabel;
use std::cell::OnceCell;
use syntable_formats::read::{occludes, order_by};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, OCCLUSION_ORDER};
use syntable_model::product::{OcclusionOrder, strong_components};

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
    occludes: Vec<Vec<bool>>,
    /// Depths of the objects.
    pub depths: Vec<VisibleDepth>,
    /// The strongly connected component of each object, from front to back, computed at its first use.
    circles: OnceCell<Vec<usize>>,
}

impl ObjectOrder {
    fn new(occludes: Vec<Vec<bool>>, depths: Vec<VisibleDepth>) -> Self {
        Self { occludes, depths, circles: OnceCell::new() }
    }

    /// The order of the objects with these labels.
    pub fn of(products: &Products, labels: &[ShownLabel]) -> Result<Self> {
        let (order, depth) = (products.get(OCCLUSION_ORDER)?, products.optional(DEPTH)?);
        let rows = labels.iter().map(|label| row(order, label.id)).collect::<Result<Vec<usize>>>()?;
        let occludes = rows.iter().map(|&i| rows.iter().map(|&j| order.occludes(i, j)).collect()).collect();
        let depths = labels
            .iter()
            .map(|label| depth.map_or(VisibleDepth::UNKNOWN, |depth| VisibleDepth::of(depth, label.visible)))
            .collect();
        Ok(Self::new(occludes, depths))
    }

    /// The order of objects by their visible and hidden masks, without depths.
    pub fn of_masks(masks: &[[&Mask; 2]]) -> Self {
        let objects = (0..).map(InstanceId).zip(masks).map(|(id, [seen, hidden])| (id, *seen, Some(*hidden)));
        let order = order_by(&objects.collect::<Vec<_>>(), occludes);
        let all = 0..masks.len();
        let occludes = all.clone().map(|i| all.clone().map(|j| order.occludes(i, j)).collect()).collect();
        Self::new(occludes, vec![VisibleDepth::UNKNOWN; masks.len()])
    }

    /// Whether object `i` occludes object `j`, and `j` does not occlude `i`, directly or through others.
    pub fn is_in_front(&self, i: usize, j: usize) -> bool {
        self.occludes(i, j) && self.circles()[i] != self.circles()[j]
    }

    /// The strongly connected component of each object. The objects of a component occlude each other, directly or
    /// through others.
    fn circles(&self) -> &[usize] {
        self.circles.get_or_init(|| strong_components(self.depths.len(), |i, j| self.occludes(i, j)))
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
            for j in (0..circles.len()).filter(|&j| self.occludes(i, j) && circles[j] != circles[i]) {
                layers[j] = layers[i].zip(layers[j]).map(|(front, layer)| layer.max(front + 1));
            }
        }
        layers
    }

    /// Whether object `i` hides a part of object `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.occludes[i][j]
    }

    /// The objects from front to back: each object follows all its occluders. Whenever several objects have no
    /// remaining occluder, the nearest comes first. Where objects occlude each other, directly or in a cycle, the
    /// object with the nearest visible pixel comes first.
    pub fn front_to_back(&self) -> Vec<usize> {
        let mut rest: Vec<usize> = (0..self.depths.len()).collect();
        let mut sorted = Vec::with_capacity(rest.len());
        let hides = |i: usize, j: usize| i != j && self.occludes(i, j);
        // Number of occluders of each object that are still in `rest`.
        let mut occluders: Vec<usize> = rest.iter().map(|&j| rest.iter().filter(|&&i| hides(i, j)).count()).collect();
        while !rest.is_empty() {
            let nearest = |nodes: Vec<usize>| {
                nodes.into_iter().min_by(|&i, &j| self.depths[i].nearest.total_cmp(&self.depths[j].nearest))
            };
            let free = rest.iter().copied().filter(|&j| occluders[j] == 0).collect();
            let Some(next) = nearest(free).or_else(|| nearest(self.foremost(&rest))) else { break };
            rest.retain(|&node| node != next);
            rest.iter().filter(|&&j| hides(next, j)).for_each(|&j| occluders[j] -= 1);
            sorted.push(next);
        }
        sorted
    }

    /// The objects of the cycles in `nodes` that no object outside the cycle occludes.
    fn foremost(&self, nodes: &[usize]) -> Vec<usize> {
        let circles = strong_components(nodes.len(), |i, j| self.occludes(nodes[i], nodes[j]));
        let mut is_occluded = vec![false; nodes.len()];
        for (i, &front) in nodes.iter().enumerate() {
            for (j, &behind) in nodes.iter().enumerate() {
                is_occluded[circles[j]] |= circles[i] != circles[j] && self.occludes(front, behind);
            }
        }
        nodes.iter().zip(circles).filter(|(_, circle)| !is_occluded[*circle]).map(|(node, _)| *node).collect()
    }

    /// The number of objects in the longest chain of occluders in front of each object, 0 if nothing occludes it.
    /// `sorted` are the objects [from front to back](Self::front_to_back); an occluder that comes later does not count.
    pub fn layers(&self, sorted: &[usize]) -> Vec<usize> {
        let mut layers = vec![0; self.depths.len()];
        for (at, &j) in sorted.iter().enumerate() {
            let before = sorted[..at].iter().filter(|&&i| self.occludes(i, j)).map(|&i| layers[i] + 1);
            layers[j] = before.max().unwrap_or(0);
        }
        layers
    }
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
        let mut occludes = vec![vec![false; nearest.len()]; nearest.len()];
        edges.iter().for_each(|&(i, j)| occludes[i][j] = true);
        let depth = |&nearest: &f32| VisibleDepth { nearest, farthest: nearest, mean: nearest.into() };
        ObjectOrder::new(occludes, nearest.iter().map(depth).collect())
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
        assert_eq!(of.occludes, [[false, true, false], [false; 3], [false; 3]]);
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
