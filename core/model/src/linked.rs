//! Kinds and formats that crates add to each program that links them.

use crate::inventory;

/// A kind of a slot or a format of datasets that a crate registers, or none in a lean program of unit tests.
///
/// A registered row keeps the code of its kind alive, so that each crate's unit tests would compile all kinds of the crate
/// again. Where the variable `SYNTABLE_LEAN_UNIT_TESTS` is set, as by `.cargo/config.toml` of this repository, a crate
/// registers nothing for its own unit tests. They construct the stages that they test. Integration tests and other
/// programs contain every row.
pub struct Linked<T>(#[doc(hidden)] pub Option<T>);

impl<T> Linked<T>
where
    Self: inventory::Collect,
{
    /// The rows of all linked crates, in no order.
    pub(crate) fn rows() -> impl Iterator<Item = &'static T> {
        inventory::iter::<Self>.into_iter().filter_map(|row| row.0.as_ref())
    }
}

/// Adds a row to the programs that link the crate.
#[doc(hidden)]
#[macro_export]
macro_rules! link {
    ($row:expr) => {
        $crate::inventory::submit! {
            $crate::linked::Linked({
                // Cargo sets the second variable for integration tests, which register stages of their own.
                #[cfg(test)]
                const IS_LEAN: bool =
                    option_env!("SYNTABLE_LEAN_UNIT_TESTS").is_some() && option_env!("CARGO_TARGET_TMPDIR").is_none();
                // Without the variable: Cargo would compile the crate again wherever its value differs.
                #[cfg(not(test))]
                const IS_LEAN: bool = false;
                if IS_LEAN { ::core::option::Option::None } else { ::core::option::Option::Some($row) }
            })
        }
    };
}
