//! Support: which body carries which.

use super::contact::Contact;
use super::force::{Force, Forces, Moving};
use super::solid::Solid;
use serde::Serialize;

/// A force carries a body if its upward part is at least this fraction of the body's weight.
const MIN_SHARE: f64 = 0.01;

/// A body that accelerates more is not at rest, m/s².
const MOVING_M_S2: f64 = 0.5;

/// Support in a scene, by indices of solids.
pub struct SupportRelation {
    /// Supporter, supported, and the upward force, N.
    edges: Vec<(usize, usize, f64)>,
    /// Whether a path of edges leads from the solid of a row to the solid of a column.
    path: Vec<bool>,
    solids: usize,
}

/// The product `support_graph`.
#[derive(Serialize)]
pub struct SupportGraphView {
    edges: Vec<EdgeView>,
    roots: Vec<u16>,
    cycles: Vec<Vec<u16>>,
    floating: Vec<u16>,
    moving: Vec<MovingView>,
}

/// An edge of the product `support_graph`.
#[derive(Serialize)]
struct EdgeView {
    supporter: u16,
    supported: u16,
    force_n: f64,
    share: f64,
}

/// A body that would start to move.
#[derive(Serialize)]
struct MovingView {
    id: u16,
    acceleration_m_s2: f64,
}

/// The product `removal_order`.
#[derive(Serialize)]
pub struct RemovalView {
    order: Vec<u16>,
    forced: Vec<ForcedView>,
}

/// A body that is removed while it carries others.
#[derive(Serialize)]
struct ForcedView {
    id: u16,
    carries: Vec<u16>,
}

impl SupportRelation {
    /// By the forces between solids.
    pub fn new(solids: &[Solid], moving: &[Option<Moving>], contacts: &[Contact], forces: &Forces) -> Self {
        let edge = |(contact, forces): (&Contact, &Vec<Force>)| {
            let up = forces.iter().sum::<Force>().z;
            let [first, second] = contact.solids;
            let (supporter, supported) = if up >= 0.0 { (first, second) } else { (second, first) };
            let weight = moving[supported].as_ref()?.weight_n();
            (up.abs() >= MIN_SHARE * weight).then_some((supporter, supported, up.abs()))
        };
        let mut edges: Vec<(usize, usize, f64)> = contacts.iter().zip(&forces.of_points).filter_map(edge).collect();
        edges.sort_by_key(|&(supporter, supported, _)| (solids[supporter].id, solids[supported].id));
        let n = solids.len();
        let mut path = vec![false; n * n];
        edges.iter().for_each(|&(supporter, supported, _)| path[supporter * n + supported] = true);
        // Warshall's closure: paths with inner nodes up to `via`.
        for via in 0..n {
            for from in (0..n).filter(|&from| from != via) {
                if path[from * n + via] {
                    (0..n).for_each(|to| path[from * n + to] |= path[via * n + to]);
                }
            }
        }
        Self { edges, path, solids: n }
    }

    /// Whether one solid carries another, directly or through others.
    pub fn carries(&self, supporter: usize, supported: usize) -> bool {
        self.path[supporter * self.solids + supported]
    }

    /// The graph with ids.
    pub fn graph(&self, solids: &[Solid], moving: &[Option<Moving>], forces: &Forces) -> SupportGraphView {
        let id = |index: usize| solids[index].id.0;
        let is_fixed = |index: &usize| moving[*index].is_none();
        let mut roots: Vec<u16> = self.edges.iter().map(|edge| edge.0).filter(is_fixed).map(id).collect();
        roots.sort_unstable();
        roots.dedup();
        let can_move = || (0..self.solids).filter(|&index| moving[index].is_some());
        let is_carried = |body: usize| self.edges.iter().any(|edge| edge.1 == body);
        let share =
            |supported: usize, force: f64| moving[supported].as_ref().map_or(0.0, |body| force / body.weight_n());
        SupportGraphView {
            edges: (self.edges.iter())
                .map(|&(supporter, supported, force_n)| EdgeView {
                    supporter: id(supporter),
                    supported: id(supported),
                    force_n,
                    share: share(supported, force_n),
                })
                .collect(),
            roots,
            cycles: self.cycles().iter().map(|cycle| cycle.iter().map(|&index| id(index)).collect()).collect(),
            floating: can_move().filter(|&body| !is_carried(body)).map(id).collect(),
            moving: can_move()
                .map(|body| MovingView { id: id(body), acceleration_m_s2: forces.accelerations[body] })
                .filter(|body| body.acceleration_m_s2 > MOVING_M_S2)
                .collect(),
        }
    }

    /// Sets of solids that carry each other, each ascending, by their first.
    fn cycles(&self) -> Vec<Vec<usize>> {
        let together = |i: usize, j: usize| i == j || self.carries(i, j) && self.carries(j, i);
        let is_first = |i: &usize| !(0..*i).any(|j| together(j, *i));
        let all = |i: usize| (i..self.solids).filter(|&j| together(i, j)).collect::<Vec<_>>();
        (0..self.solids).filter(is_first).map(all).filter(|cycle| cycle.len() > 1).collect()
    }

    /// A safe order of removal of all objects and distractors.
    pub fn removal_order(&self, solids: &[Solid]) -> RemovalView {
        let mut left: Vec<usize> = (0..solids.len()).filter(|&index| solids[index].is_foreground).collect();
        // The higher first, then the lower id.
        left.sort_by(|&a, &b| solids[b].height_m.total_cmp(&solids[a].height_m).then(solids[a].id.cmp(&solids[b].id)));
        let (mut order, mut forced) = (Vec::new(), Vec::new());
        while !left.is_empty() {
            let carried = |body: usize| -> Vec<u16> {
                let mut carried: Vec<u16> = (self.edges.iter())
                    .filter(|edge| edge.0 == body && left.contains(&edge.1))
                    .map(|edge| solids[edge.1].id.0)
                    .collect();
                carried.sort_unstable();
                carried
            };
            let (place, carries) = (0..left.len())
                .map(|place| (place, carried(left[place])))
                .min_by_key(|(place, carries)| (carries.len(), *place))
                .unwrap_or_default();
            let id = solids[left.remove(place)].id.0;
            order.push(id);
            if !carries.is_empty() {
                forced.push(ForcedView { id, carries });
            }
        }
        RemovalView { order, forced }
    }
}
