//! An area of the floor that carries objects.

use syntable_model::prelude::*;
use syntable_model::scene::{Region, Support};

/// An area of the floor around the center of the room as a support.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FloorSupport {
    /// Name among the scene's supports, for the option `support` of other stages.
    #[schemars(length(min = 1))]
    name: String,
    /// Extents along world x and y, meters.
    #[schemars(inner(range(min = 0.01, max = 1000.0)))]
    size_m: [f64; 2],
}

impl Default for FloorSupport {
    fn default() -> Self {
        Self { name: "floor".to_owned(), size_m: [1.5, 1.5] }
    }
}

impl FloorSupport {
    /// Checks that the area is on the smallest floor that can be drawn, whose size along x and y is in meters.
    pub fn check(&self, floor: [f64; 2]) -> Result<(), ConfigError> {
        match (0..2).find(|&axis| self.size_m[axis] > floor[axis]) {
            None => Ok(()),
            Some(axis) => {
                let message = format!(
                    "the support of {} m is larger than the smallest floor of {} m",
                    self.size_m[axis], floor[axis]
                );
                let help = "give the support a smaller `size_m`, or the floor a larger one";
                Err(ConfigError::new(format!("support.size_m[{axis}]"), message).help(help))
            }
        }
    }

    /// Makes the area a support of the scene.
    pub fn add_to(&self, scene: &mut SceneBuilder) -> Result<()> {
        scene.supports.add(Support::new(self.name.as_str(), Region::rectangle([0.0; 3], self.size_m)))
    }
}

/// The parts that a placer of a floor sets.
pub fn floor_parts(support: Option<&FloorSupport>) -> Vec<PartUse> {
    let support = support.map(|support| PartUse::Sets(Part::Support(support.name.clone())));
    [PartUse::Sets(Part::Floor)].into_iter().chain(support).collect()
}
