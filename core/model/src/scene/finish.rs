//! A change of how a body reflects light.

use serde::Serialize;

/// A finish that all materials of a body get, over their own values and textures. Colors and normal maps stay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Finish {
    /// Perceptual roughness, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f64>,
    /// Reflectance of dielectrics at normal incidence, as a fraction of 8 %, 0 to 1: 0.5 reflects 4 %. This is the `Specular` of
    /// Blender's Principled BSDF. Materials that transmit light keep their index of refraction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<f64>,
    /// 0 for dielectrics, 1 for metals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f64>,
}

/// Reflectance at normal incidence of a specular of 1.
const MAX_REFLECTANCE: f64 = 0.08;

impl Finish {
    /// Index of refraction that gives the reflectance `R = 0.08 · specular`: `(1 + √R) / (1 − √R)`, from Fresnel's equations at normal
    /// incidence.
    pub fn ior(&self) -> Option<f64> {
        let root = (MAX_REFLECTANCE * self.specular?).sqrt();
        Some((1.0 + root) / (1.0 - root))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_index_reflects_what_the_specular_states() {
        for (specular, reflectance) in [(0.0, 0.0), (0.5, 0.04), (1.0, 0.08)] {
            let n = Finish { specular: Some(specular), ..Finish::default() }.ior().expect("stated");
            assert!((((n - 1.0) / (n + 1.0)).powi(2) - reflectance).abs() < 1e-12, "{specular}");
        }
        assert_eq!(Finish::default().ior(), None);
    }
}
