//! Facts about the alternatives of stages that the loader and the schema share.

use syntable_model::registry::Slot;

/// Key of the alternatives of a stage.
pub(crate) const ONE_OF: &str = "one_of";

/// Maximum weight of an alternative, as of a pool.
pub(crate) const MAX_WEIGHT: f64 = 1e9;

/// Whether stages of a slot can have alternatives. The plan chooses the providers of products before any scene, so stages
/// that provide products cannot; cameras and views state facts about all images.
pub(crate) fn has_alternatives(slot: Slot) -> bool {
    matches!(slot, Slot::Place | Slot::Settle | Slot::Lights)
}
