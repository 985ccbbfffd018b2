//! The tree of a scene: placed instances of mesh trees.

use std::sync::Arc;
use syntable_prepare::Bounds;
use syntable_simd::Processor;

use super::{
    build::build,
    mesh::MeshBvh,
    ray::{Affine, IDENTITY, columns, invert},
    wide::{Column, Nodes},
};

/// One placed mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Rows of a 3×4 matrix, translation last: meters to meters.
    pub world_from_object: Affine,
    /// The mesh's tree, shared.
    pub mesh: Arc<MeshBvh>,
    /// The caller's own number: handed back by [`SceneBvh::id`], never interpreted.
    pub id: u32,
}

/// An instance as walks need it.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub object_from_world: [Column; 4],
    /// World box; empty if nothing can be hit.
    pub bounds: Bounds,
    pub mesh: Arc<MeshBvh>,
    id: u32,
}

/// A two-level tree; microseconds to build for tens of instances.
///
/// Distances are in units of the ray's direction: meters for a unit direction. Ranges are closed, `from ≤ t ≤ to`, and
/// a negative `from` counts as 0. Rays with a zero or non-finite direction or origin hit nothing. Results depend only
/// on the instances, not on the CPU or the order of the walk: of hits at equal distance, the earlier instance wins, and
/// within an instance the lower primitive.
#[derive(Clone, Debug)]
pub struct SceneBvh {
    pub(super) nodes: Nodes,
    pub(super) instances: Vec<Placed>,
    /// Largest absolute world coordinate.
    pub(super) reach: f32,
    pub(super) processor: Processor,
}

impl SceneBvh {
    /// Builds the top level over `instances`. Instances with an empty mesh, or with a singular or non-finite transform,
    /// keep their place in the list and are never hit.
    pub fn build(instances: impl IntoIterator<Item = Instance>) -> Self {
        let instances: Vec<Placed> = instances.into_iter().map(place).collect();
        let (numbers, boxes): (Vec<usize>, Vec<Bounds>) = instances
            .iter()
            .enumerate()
            .filter(|(_, placed)| !placed.bounds.is_empty())
            .map(|(number, placed)| (number, placed.bounds))
            .unzip();
        let nodes = build(&boxes, 1, |_, items| numbers[items[0] as usize]);
        let reach = nodes.bounds.reach();
        Self { nodes, instances, reach, processor: Processor::detect() }
    }

    /// The same scene without AVX2; its results are the same, bit for bit.
    pub fn portable(self) -> Self {
        Self { processor: Processor::portable(), ..self }
    }

    /// Number of instances.
    pub fn len(&self) -> usize {
        self.instances.len()
    }

    /// Whether the scene has no instance.
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }

    /// The id of an instance, as set by the caller.
    pub fn id(&self, instance: u32) -> u32 {
        self.instances[instance as usize].id
    }

    /// Checks the top level's invariants.
    ///
    /// # Panics
    /// If one does not hold.
    pub fn validate(&self) {
        let mut reached = 0;
        self.nodes.validate(|instance, bounds| {
            assert_eq!(*bounds, self.instances[instance].bounds);
            reached += 1;
        });
        let wanted = self.instances.iter().filter(|placed| !placed.bounds.is_empty()).count();
        assert_eq!(reached, wanted, "instances in the tree");
    }
}

fn place(instance: Instance) -> Placed {
    let Instance { world_from_object, mesh, id } = instance;
    let outline = mesh.outline();
    let boxes = outline.iter().map(|b| b.transformed(&world_from_object));
    let bounds = boxes.fold(Bounds::EMPTY, |all, b| all.union(&b));
    match invert(&world_from_object) {
        Some(object_from_world) if bounds.lo.iter().chain(&bounds.hi).all(|x| x.is_finite()) => {
            Placed { object_from_world: columns(&object_from_world), bounds, mesh, id }
        }
        _ => Placed { object_from_world: columns(&IDENTITY), bounds: Bounds::EMPTY, mesh, id },
    }
}
