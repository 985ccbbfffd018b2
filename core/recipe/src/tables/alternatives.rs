//! Facts about the alternatives of stages and the components of mixtures that the loader and the schema share.

use syntable_model::registry::Slot;

/// Key of the alternatives of a stage.
pub(crate) const ONE_OF: &str = "one_of";

/// Section of the components of a mixture.
pub(crate) const MIXTURE: &str = "mixture";

/// The slot whose stages all components of a mixture share.
pub(crate) const SHARED: Slot = Slot::Write;

/// Sections of a recipe that a component does not have, because the mixture has them.
pub(crate) const OF_MIXTURE: [&str; 3] = ["dataset", SHARED.name(), "lock"];

/// Key of the weight of an alternative or a component.
pub(crate) const WEIGHT: &str = "weight";

/// Maximum weight of an alternative, as of a pool.
pub(crate) const MAX_WEIGHT: f64 = 1e9;

/// Whether stages of a slot can have alternatives. The plan chooses the providers of products before any scene, so stages
/// that provide products cannot; cameras and views state facts about all images.
pub(crate) fn has_alternatives(slot: Slot) -> bool {
    matches!(slot, Slot::Place | Slot::Settle | Slot::Lights)
}
