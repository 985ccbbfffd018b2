//! Checks of labels against each other: what must hold in every view, however it was made.
//!
//! A run makes them on every view before it is written, `syntable validate` on datasets that are there.

use crate::error::Result;
use crate::product::{KeyId, Products};

/// A statement about the products of a view that can be tested. Registered with [`register_check!`](crate::register_check).
#[derive(Clone, Copy)]
pub struct Check {
    /// Its name, in snake case.
    pub name: &'static str,
    /// What holds in a sound view, in one sentence.
    pub doc: &'static str,
    /// The products that it looks at. It is made where all of them are there.
    pub reads: fn() -> Vec<KeyId>,
    /// Whether there is something in these that it can compare: a dataset that was read may lack a part of a record.
    pub finds_subject: fn(&Products) -> bool,
    /// What does not hold, a sentence each. An error says that a product cannot be read.
    pub faults: fn(&Products) -> Result<Vec<String>>,
}

inventory::collect!(Check);

/// Registers checks.
#[macro_export]
macro_rules! register_check {
    ($($check:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $check }
    )+};
}

impl Check {
    /// [`finds_subject`](Self::finds_subject) of a check that needs nothing but its products.
    pub const ALWAYS: fn(&Products) -> bool = |_| true;

    /// Whether all that it looks at is there.
    pub fn applies(&self, products: &Products) -> bool {
        (self.reads)().iter().all(|key| products.contains(&key.name)) && (self.finds_subject)(products)
    }

    /// What does not hold in a view; nothing where a product is missing.
    pub fn run(&self, products: &Products) -> Result<Vec<String>> {
        if self.applies(products) { (self.faults)(products) } else { Ok(Vec::new()) }
    }
}
