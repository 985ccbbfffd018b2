//! Materials that no ray passes.

use syntable_model::scene::{Alpha, Material};

/// Whether every surface of a material is there, and none is seen through.
pub(super) fn is_opaque(material: &Material) -> bool {
    material.alpha == Alpha::Opaque && material.transmission.is_none()
}
