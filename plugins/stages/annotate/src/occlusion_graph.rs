//! The graph of occlusions between objects.

use syntable_model::prelude::*;
use syntable_model::product::Graph;
use syntable_model::product::standard::{OCCLUSION_GRAPH, OCCLUSION_LAYER, OCCLUSION_ORDER};

/// The occlusion order as a directed graph (SynTable, "Occlusion Order Accuracy"; OODG): nodes are the annotated
/// objects of the view, and an edge leads from an occluder to its occludee.
///
/// `occlusion_layer` is `top` for an object that no object occludes, `bottom` for an occluded object that occludes no
/// other, and `intermediate` otherwise. `occlusion_graph` has the `edges`, [occluder, occludee] by id; the weakly
/// connected `components`, including single objects; the `cycles`, sets of objects that occlude each other, directly or
/// through other objects of the set; and `depth_layers`, all objects from front to back: each object is in the first
/// layer behind all of its occluders outside its own cycle. Ids ascend in every list.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionGraph {}

config!(OcclusionGraph => dyn ImageAnnotator, "occlusion_graph");

impl ImageAnnotator for OcclusionGraph {
    fn reads(&self) -> Vec<KeyId> {
        keys![OCCLUSION_ORDER]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OCCLUSION_GRAPH, OCCLUSION_LAYER]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let order = products.get(OCCLUSION_ORDER)?;
        let graph = Graph::new(order);
        let ids = order.ids();
        let layers = (0..).zip(ids).map(|(node, &id)| (id, graph.layer(node).name())).collect();
        let named = |nodes: &Vec<usize>| nodes.iter().map(|&node| ids[node].0).collect::<Vec<u16>>();
        let all = |sets: Vec<Vec<usize>>| sets.iter().map(named).collect::<Vec<_>>();
        let record = Value::of(&GraphView {
            edges: graph.edges().map(|(i, j)| [ids[i].0, ids[j].0]).collect(),
            components: all(graph.components()),
            cycles: all(graph.cycles()),
            depth_layers: all(graph.depth_layers()),
        })?;
        products.put(OCCLUSION_LAYER, layers)?;
        products.put(OCCLUSION_GRAPH, record)
    }
}

/// The product `occlusion_graph`.
#[derive(Serialize)]
struct GraphView {
    edges: Vec<[u16; 2]>,
    components: Vec<Vec<u16>>,
    cycles: Vec<Vec<u16>>,
    depth_layers: Vec<Vec<u16>>,
}

register!(OcclusionGraph);
