//! Opaque materials.

use syntable_model::scene::{Alpha, Material};

/// Whether a material has neither holes nor transparent parts.
pub(super) fn is_opaque(material: &Material) -> bool {
    material.alpha == Alpha::Opaque && material.transmission.is_none()
}
