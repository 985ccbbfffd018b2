//! The occlusion order of a view as a directed graph.

use super::OcclusionOrder;

/// Where an object is in the graph, by its edges alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Nothing occludes it.
    Top,
    /// It occludes and is occluded.
    Intermediate,
    /// It is occluded and occludes nothing.
    Bottom,
}

impl Layer {
    /// Its name in the output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Top => "top",
            Self::Intermediate => "intermediate",
            Self::Bottom => "bottom",
        }
    }
}

/// A directed graph. All methods take time in proportion to the numbers of nodes and edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    /// The nodes to which edges of each node lead, ascending.
    behind: Vec<Vec<u16>>,
    /// The nodes from which edges lead to each node, ascending.
    front: Vec<Vec<u16>>,
    /// The strongly connected component of each node, from front to back.
    strong: Vec<usize>,
}

/// The edges in the opposite direction, ascending. Edges lead from each node to nodes of a list.
pub fn reversed(behind: &[Vec<u16>]) -> Vec<Vec<u16>> {
    let mut front = vec![Vec::new(); behind.len()];
    for (node, others) in (0..=u16::MAX).zip(behind) {
        others.iter().for_each(|other| front[usize::from(*other)].push(node));
    }
    front
}

/// The number of each node's strongly connected component. Two nodes are in one component if a path leads from each of
/// them to the other. An edge never leads to a component with a lower number. `behind` has the nodes to which edges of
/// each node lead, and `front` the same edges [in the opposite direction](reversed) (Kosaraju's algorithm).
pub fn strong_components(behind: &[Vec<u16>], front: &[Vec<u16>]) -> Vec<usize> {
    let nodes = behind.len();
    // Nodes in the order in which the depth-first search leaves them.
    let mut left = Vec::with_capacity(nodes);
    let mut is_found = vec![false; nodes];
    for start in 0..nodes {
        let mut path = Vec::new();
        if !std::mem::replace(&mut is_found[start], true) {
            path.push((start, behind[start].iter()));
        }
        while let Some((node, others)) = path.last_mut() {
            match others.map(|other| usize::from(*other)).find(|other| !is_found[*other]) {
                Some(other) => {
                    is_found[other] = true;
                    path.push((other, behind[other].iter()));
                }
                None => {
                    left.push(*node);
                    path.pop();
                }
            }
        }
    }
    let (mut of, mut count) = (vec![usize::MAX; nodes], 0);
    for &start in left.iter().rev() {
        if of[start] != usize::MAX {
            continue;
        }
        of[start] = count;
        let mut open = vec![start];
        while let Some(node) = open.pop() {
            for other in front[node].iter().map(|other| usize::from(*other)) {
                if of[other] == usize::MAX {
                    of[other] = count;
                    open.push(other);
                }
            }
        }
        count += 1;
    }
    of
}

impl Graph {
    /// The graph of an occlusion order: node `i` is the instance of row `i`.
    pub fn new(order: &OcclusionOrder) -> Self {
        let behind: Vec<Vec<u16>> =
            (0..order.ids().len()).map(|node| order.behind(node).map(|other| other as u16).collect()).collect();
        let front = reversed(&behind);
        let strong = strong_components(&behind, &front);
        Self { behind, front, strong }
    }

    /// Whether node `i` occludes node `j`.
    pub fn has_edge(&self, i: usize, j: usize) -> bool {
        self.behind[i].binary_search(&(j as u16)).is_ok()
    }

    /// Pairs of occluder and occludee, row by row.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> {
        self.behind.iter().enumerate().flat_map(|(i, behind)| behind.iter().map(move |j| (i, usize::from(*j))))
    }

    /// The layer of a node.
    pub fn layer(&self, node: usize) -> Layer {
        match (self.front[node].is_empty(), self.behind[node].is_empty()) {
            (true, _) => Layer::Top,
            (false, false) => Layer::Intermediate,
            (false, true) => Layer::Bottom,
        }
    }

    /// Weakly connected components, each with ascending nodes, by their first nodes.
    pub fn components(&self) -> Vec<Vec<usize>> {
        let both = self.behind.iter().zip(&self.front).map(|(behind, front)| [&behind[..], front].concat());
        let both: Vec<Vec<u16>> = both.collect();
        grouped(&strong_components(&both, &both))
    }

    /// Strongly connected components of two nodes or more, each with ascending nodes, by their first nodes.
    pub fn cycles(&self) -> Vec<Vec<usize>> {
        grouped(&self.strong).into_iter().filter(|nodes| nodes.len() > 1).collect()
    }

    /// The nodes from front to back. A node is in the layer of the number of edges of the longest path that leads to it,
    /// cycles counting as one node.
    pub fn depth_layers(&self) -> Vec<Vec<usize>> {
        let mut members = grouped(&self.strong);
        members.sort_by_key(|nodes| self.strong[nodes[0]]);
        // Edges lead from components that come before.
        let mut layer: Vec<usize> = vec![0; members.len()];
        for (component, nodes) in members.iter().enumerate() {
            let own = layer[component];
            for other in nodes.iter().flat_map(|node| &self.behind[*node]) {
                let behind = self.strong[usize::from(*other)];
                if behind != component {
                    layer[behind] = layer[behind].max(own + 1);
                }
            }
        }
        let mut layers = vec![Vec::new(); layer.iter().max().map_or(0, |last| last + 1)];
        self.strong.iter().enumerate().for_each(|(node, component)| layers[layer[*component]].push(node));
        layers
    }
}

/// The nodes of each group, by their first nodes.
fn grouped(group: &[usize]) -> Vec<Vec<usize>> {
    let mut place: Vec<Option<usize>> = vec![None; group.iter().max().map_or(0, |last| last + 1)];
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (node, &of) in group.iter().enumerate() {
        let place = *place[of].get_or_insert(groups.len());
        if place == groups.len() {
            groups.push(Vec::new());
        }
        groups[place].push(node);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::InstanceId;
    use Layer::{Bottom, Intermediate, Top};
    use proptest::prelude::*;

    fn graph(nodes: u16, edges: &[(usize, usize)]) -> Graph {
        let mut order = OcclusionOrder::new((1..=nodes).map(InstanceId).collect());
        edges.iter().for_each(|&(i, j)| order.set(i, j));
        Graph::new(&order)
    }

    #[test]
    fn graphs_on_paper() {
        // A chain with a shortcut, a pair, and a single node; a ring of three with a tail; two nodes that occlude each
        // other.
        let sorted = graph(6, &[(0, 1), (1, 2), (0, 2), (3, 4)]);
        let ring = graph(5, &[(0, 1), (1, 2), (2, 0), (2, 3)]);
        let pair = graph(3, &[(0, 1), (1, 0)]);
        let layers = |graph: &Graph| (0..graph.behind.len()).map(|node| graph.layer(node)).collect::<Vec<_>>();
        assert_eq!(layers(&sorted), [Top, Intermediate, Bottom, Top, Bottom, Top]);
        assert_eq!(layers(&ring), [Intermediate, Intermediate, Intermediate, Bottom, Top]);
        assert_eq!(layers(&pair), [Intermediate, Intermediate, Top]);
        assert_eq!(sorted.components(), [vec![0, 1, 2], vec![3, 4], vec![5]]);
        assert_eq!(ring.components(), [vec![0, 1, 2, 3], vec![4]]);
        assert_eq!(pair.components(), [vec![0, 1], vec![2]]);
        assert!(sorted.cycles().is_empty());
        assert_eq!((ring.cycles(), pair.cycles()), (vec![vec![0, 1, 2]], vec![vec![0, 1]]));
        assert_eq!(sorted.depth_layers(), [vec![0, 3, 5], vec![1, 4], vec![2]]);
        assert_eq!(ring.depth_layers(), [vec![0, 1, 2, 4], vec![3]]);
        assert_eq!(pair.depth_layers(), [vec![0, 1, 2]]);
        assert!(graph(0, &[]).depth_layers().is_empty());
    }

    /// A chain with all shortcuts and one edge back.
    #[test]
    fn large_graphs_are_taken_apart_in_time() {
        let nodes = 1_500;
        let edges = |i: u16| (0..i).map(move |j| (usize::from(j), usize::from(i)));
        let graph = graph(nodes, &(0..nodes).flat_map(edges).chain([(900, 700)]).collect::<Vec<_>>());
        assert_eq!(graph.cycles(), [(700..=900).collect::<Vec<_>>()]);
        assert_eq!((graph.depth_layers().len(), graph.components().len()), (1_300, 1));
    }

    proptest! {
        /// Compares with a search through the edges.
        #[test]
        fn random_graphs_are_taken_apart_as_searches_do(
            (nodes, edges) in (1_u16..9).prop_flat_map(|n| {
                let edge = (0..usize::from(n), 0..usize::from(n)).prop_filter("no loops", |(i, j)| i != j);
                let edges = if n == 1 { Just(Vec::new()).boxed() } else { prop::collection::vec(edge, 0..14).boxed() };
                (Just(n), edges)
            })
        ) {
            let graph = graph(nodes, &edges);
            let n = usize::from(nodes);
            let reached = |from: usize, both_ways: bool| {
                let (mut seen, mut open) = (vec![false; n], vec![from]);
                while let Some(node) = open.pop() {
                    for &(i, j) in &edges {
                        let next = if i == node { Some(j) } else { (both_ways && j == node).then_some(i) };
                        if let Some(next) = next.filter(|&next| !seen[next]) {
                            seen[next] = true;
                            open.push(next);
                        }
                    }
                }
                seen
            };
            let with: Vec<Vec<usize>> = graph.components();
            for component in &with {
                let seen = reached(component[0], true);
                prop_assert!((0..n).all(|node| component.contains(&node) == (node == component[0] || seen[node])));
            }
            prop_assert_eq!(with.iter().map(Vec::len).sum::<usize>(), n);
            let forward: Vec<Vec<bool>> = (0..n).map(|node| reached(node, false)).collect();
            let together = |i: usize, j: usize| forward[i][j] && forward[j][i];
            let cycles = graph.cycles();
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                let in_one = cycles.iter().any(|cycle| cycle.contains(&i) && cycle.contains(&j));
                prop_assert_eq!(in_one, together(i, j));
            }
            // Every node comes after its occluders, and one of them is in the layer before.
            let layers = graph.depth_layers();
            let layer = |node: usize| layers.iter().position(|layer| layer.contains(&node)).expect("all are there");
            let family = |node: usize| (0..n).filter(|&other| other == node || together(other, node)).collect::<Vec<_>>();
            for &(i, j) in edges.iter().filter(|&&(i, j)| !together(i, j)) {
                prop_assert!(layer(i) < layer(j));
            }
            for node in (0..n).filter(|&node| layer(node) > 0) {
                let members = family(node);
                let holds = edges.iter().any(|&(i, j)| {
                    members.contains(&j) && !members.contains(&i) && layer(i) + 1 == layer(node)
                });
                prop_assert!(holds, "{node} is too far behind in {layers:?}");
            }
        }
    }
}
