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

/// A directed graph of some dozens of nodes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    nodes: usize,
    /// Whether an edge leads from the node of a row to that of a column.
    edge: Vec<bool>,
    /// Whether a path does.
    path: Vec<bool>,
}

impl Graph {
    /// The graph of an occlusion order: node `i` is the instance of row `i`.
    pub fn new(order: &OcclusionOrder) -> Self {
        let (nodes, edge) = (order.ids().len(), order.matrix().to_vec());
        // Warshall's closure: paths whose inner nodes are at most `via`.
        let mut path = edge.clone();
        for via in 0..nodes {
            for from in 0..nodes {
                if path[from * nodes + via] {
                    (0..nodes).for_each(|to| path[from * nodes + to] |= path[via * nodes + to]);
                }
            }
        }
        Self { nodes, edge, path }
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
        let mut of: Vec<usize> = (0..self.nodes).collect();
        for (i, j) in self.edges() {
            let (kept, gone) = (of[i].min(of[j]), of[i].max(of[j]));
            of.iter_mut().filter(|component| **component == gone).for_each(|component| *component = kept);
        }
        grouped(&of)
    }

    /// Strongly connected components of two nodes or more, each with ascending nodes, by their first nodes.
    pub fn cycles(&self) -> Vec<Vec<usize>> {
        grouped(&self.cycle_of()).into_iter().filter(|nodes| nodes.len() > 1).collect()
    }

    /// The nodes from front to back. A node is in the layer of the number of edges of the longest path that leads to it,
    /// cycles counting as one node.
    pub fn depth_layers(&self) -> Vec<Vec<usize>> {
        let cycle = self.cycle_of();
        let leads = |i: usize, j: usize| cycle[i] != cycle[j] && self.path[i * self.nodes + j];
        // Whoever is before another has fewer predecessors.
        let mut order: Vec<usize> = (0..self.nodes).collect();
        order.sort_by_key(|&node| (0..self.nodes).filter(|&i| leads(i, node)).count());
        let mut layer = vec![0; self.nodes];
        for node in order {
            let before = (0..self.nodes).filter(|&i| leads(i, node)).map(|i| layer[i] + 1);
            layer[node] = before.max().unwrap_or(0);
        }
        let layers = layer.iter().max().map_or(0, |last| last + 1);
        (0..layers).map(|number| (0..self.nodes).filter(|&node| layer[node] == number).collect()).collect()
    }

    /// The first node of the strongly connected component of each node.
    fn cycle_of(&self) -> Vec<usize> {
        let both = |i: usize, j: usize| self.path[i * self.nodes + j] && self.path[j * self.nodes + i];
        (0..self.nodes).map(|node| (0..node).find(|&other| both(other, node)).unwrap_or(node)).collect()
    }
}

/// The nodes of each group, which is named by its first node.
fn grouped(group: &[usize]) -> Vec<Vec<usize>> {
    let first = (0..group.len()).filter(|&node| group[node] == node);
    first.map(|first| (first..group.len()).filter(|&node| group[node] == first).collect()).collect()
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
        // A chain with a shortcut, a pair, and one by itself; a ring of three with a tail; two that occlude each other.
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

    proptest! {
        /// Against walks of a search through the edges.
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
            // Everybody comes after its occluders, and has one in the layer before.
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
