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

/// A directed graph as a matrix. All methods take time in proportion to the square of the number of nodes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    nodes: usize,
    /// Whether an edge leads from the node of the row to the node of the column.
    edge: Vec<bool>,
    /// The strongly connected component of each node, from front to back.
    strong: Vec<usize>,
}

/// The number of each node's strongly connected component. Two nodes are in one component if a path leads from each of
/// them to the other. An edge never leads to a component with a lower number. Each edge is queried at most twice
/// (Kosaraju's algorithm).
pub fn strong_components(nodes: usize, has_edge: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    // Nodes in the order in which the depth-first search leaves them.
    let mut left = Vec::with_capacity(nodes);
    let mut is_found = vec![false; nodes];
    for start in 0..nodes {
        let mut path = Vec::new();
        if !std::mem::replace(&mut is_found[start], true) {
            path.push((start, 0));
        }
        while let Some((node, next)) = path.last_mut() {
            let behind = (*next..nodes).find(|&other| !is_found[other] && has_edge(*node, other));
            *next = behind.map_or(nodes, |other| other + 1);
            match behind {
                Some(other) => {
                    is_found[other] = true;
                    path.push((other, 0));
                }
                None => left.extend(path.pop().map(|(node, _)| node)),
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
            for (other, component) in of.iter_mut().enumerate() {
                if *component == usize::MAX && has_edge(other, node) {
                    *component = count;
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
        let (nodes, edge) = (order.ids().len(), order.matrix().to_vec());
        let strong = strong_components(nodes, |i, j| edge[i * nodes + j]);
        Self { nodes, edge, strong }
    }

    /// Whether node `i` occludes node `j`.
    pub fn has_edge(&self, i: usize, j: usize) -> bool {
        self.edge[i * self.nodes + j]
    }

    /// Pairs of occluder and occludee, row by row.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.nodes).flat_map(move |i| (0..self.nodes).filter(move |&j| self.has_edge(i, j)).map(move |j| (i, j)))
    }

    /// The layer of a node.
    pub fn layer(&self, node: usize) -> Layer {
        let is_occluded = (0..self.nodes).any(|i| self.has_edge(i, node));
        let occludes = (0..self.nodes).any(|j| self.has_edge(node, j));
        match (is_occluded, occludes) {
            (false, _) => Layer::Top,
            (true, true) => Layer::Intermediate,
            (true, false) => Layer::Bottom,
        }
    }

    /// Weakly connected components, each with ascending nodes, by their first nodes.
    pub fn components(&self) -> Vec<Vec<usize>> {
        grouped(&strong_components(self.nodes, |i, j| self.has_edge(i, j) || self.has_edge(j, i)))
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
            for &node in nodes {
                for behind in (0..self.nodes).filter(|&other| self.has_edge(node, other)) {
                    let behind = self.strong[behind];
                    if behind != component {
                        layer[behind] = layer[behind].max(own + 1);
                    }
                }
            }
        }
        let mut layers = vec![Vec::new(); layer.iter().max().map_or(0, |last| last + 1)];
        (0..self.nodes).for_each(|node| layers[layer[self.strong[node]]].push(node));
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
        let layers = |graph: &Graph| (0..graph.nodes).map(|node| graph.layer(node)).collect::<Vec<_>>();
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

    /// Time grows with the square of the nodes: a chain with all shortcuts and one edge back.
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
