//! The kind `rapier`: its options become a settler.

use crate::options::Rapier;
use crate::settle::Settle;
use syntable_model::prelude::*;

impl Config for Rapier {
    type Stage = dyn Settler;
    const KIND: &'static str = "rapier";
    const EXAMPLE: &'static str = "\
duration_s = 5.0
remove = \"off_tabletop\"
on_violation = \"respawn\"
max_penetration_m = 0.005
max_speed_m_s = 0.01";
    const RENAMED: &'static [(&'static str, &'static str)] =
        &[("max_drops", "max_respawns"), ("max_spin_rad_s", "max_angular_speed_rad_s")];

    fn build(self) -> Result<Box<dyn Settler>, ConfigError> {
        if self.time_step_s > self.duration_s {
            let Self { time_step_s, duration_s, .. } = self;
            return Err(ConfigError::new(
                "time_step_s",
                format!("{time_step_s:?} is longer than `duration_s = {duration_s:?}`"),
            ));
        }
        Ok(Box::new(Settle::new(self)))
    }
}

syntable_model::register!(Rapier);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::registry::{ConstructError, Entry};

    const ENTRY: Entry = Entry::of::<Rapier>("syntable-physics", "0");

    #[test]
    fn the_example_and_the_released_variant_build() {
        for text in [
            "",
            Rapier::EXAMPLE,
            "collision = \"convex_hull\"\nmass = { kg = 1.0 }\non_violation = \"keep\"\ntime_step_s = 0.016666666666666666",
        ] {
            let built = ENTRY.construct_str(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
            // Serialized options parse to the same options.
            let again = ENTRY.construct_str(&built.options.to_string()).expect("reads back");
            assert_eq!(built.options, again.options);
        }
    }

    #[test]
    fn invalid_options_are_refused_by_key() {
        for (text, key) in [
            ("mass = { kg = 0 }", "mass.kg"),
            ("mass = \"heavy\"", "mass"),
            ("durration_s = 1", "durration_s"),
            ("duration_s = 0.01\ntime_step_s = 0.02", "time_step_s"),
        ] {
            match ENTRY.construct_str(text) {
                Err(ConstructError::Invalid(invalid)) => assert_eq!(invalid.key, key),
                other => panic!("{text} gave {:?}", other.map(|built| built.options)),
            }
        }
    }
}
