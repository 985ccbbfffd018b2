//! How bright a light is: in lux on the table, in nits of its surface, or in lumens that it gives off.

use syntable_model::dist::Dist;
use syntable_model::error::Invalid;
use syntable_model::random::Stream;

/// The brightness options of a light, of which one is in use.
#[derive(Clone, Copy)]
pub struct Brightness<'a> {
    /// `illuminance_lx`.
    pub illuminance_lx: Option<&'a Dist>,
    /// `luminance_nits`.
    pub luminance_nits: Option<&'a Dist>,
    /// `luminous_flux_lm`.
    pub luminous_flux_lm: Option<&'a Dist>,
}

impl Brightness<'_> {
    /// Refuses what no lamp has, and brightness given in two ways.
    pub fn check(self) -> Result<(), Invalid> {
        let given = [
            ("illuminance_lx", self.illuminance_lx, 1e7),
            ("luminance_nits", self.luminance_nits, 1e10),
            ("luminous_flux_lm", self.luminous_flux_lm, 1e9),
        ];
        for (key, dist, most) in given {
            dist.map_or(Ok(()), |dist| dist.within(key, 0.0, most))?;
        }
        match given.iter().filter(|(_, dist, _)| dist.is_some()).map(|(key, ..)| *key).collect::<Vec<_>>()[..] {
            [first, .., last] => Err(Invalid::new(last, format!("brightness is given by `{first}` and by `{last}`"))
                .help("keep one of: illuminance_lx, luminance_nits, luminous_flux_lm")),
            _ => Ok(()),
        }
    }

    /// Draws the luminance, nits.
    pub fn draw(
        self,
        stream: &mut Stream,
        from_lux: impl FnOnce(f64) -> f64,
        from_lumens: impl FnOnce(f64) -> f64,
    ) -> f64 {
        match (self.luminance_nits, self.luminous_flux_lm, self.illuminance_lx) {
            (Some(nits), _, _) => nits.draw(stream),
            (None, Some(lumens), _) => from_lumens(lumens.draw(stream)),
            (None, None, Some(lux)) => from_lux(lux.draw(stream)),
            (None, None, None) => 0.0,
        }
    }
}

/// Sets the usual illuminance where no brightness is given. `luminance_nits` takes the place of an illuminance, so that
/// a recipe can set it over one that it extends.
pub fn complete(
    illuminance_lx: &mut Option<Dist>,
    luminance_nits: &Option<Dist>,
    luminous_flux_lm: &Option<Dist>,
    usual: Dist,
) {
    if luminance_nits.is_some() {
        *illuminance_lx = None;
    } else if luminous_flux_lm.is_none() {
        illuminance_lx.get_or_insert(usual);
    }
}

/// Refuses colour temperatures that no light has.
pub fn check_temperature(temperature_k: &Dist) -> Result<(), Invalid> {
    temperature_k.within("temperature_k", 1000.0, 40_000.0)
}
