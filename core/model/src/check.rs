//! Checks of labels against each other: what must hold in every view, however it was made.
//!
//! A run makes them on every view before it is written, `syntable validate` on datasets that are there.

use crate::error::Result;
use crate::product::{KeyId, Products};

/// A statement about the products of a view that can be tested. Crates register a [`Check`]; a program may add a check with state of
/// its own ([`Registry::with_checks`](crate::registry::Registry::with_checks)).
pub trait LabelCheck: Send + Sync {
    /// Its name, in snake case. [`intern`](crate::intern::intern) makes one at run time.
    fn name(&self) -> &'static str;
    /// What holds in a sound view, in one sentence.
    fn doc(&self) -> &str;
    /// The products that it looks at. It is made where all of them are there.
    fn reads(&self) -> Vec<KeyId>;
    /// Whether the products have something to compare: a dataset that was read may lack a part of a record.
    fn finds_subject(&self, products: &Products) -> bool {
        let _ = products;
        true
    }
    /// What does not hold, a sentence each.
    ///
    /// # Errors
    /// If a product cannot be read.
    fn faults(&self, products: &Products) -> Result<Vec<String>>;
}

impl dyn LabelCheck + '_ {
    /// Whether all that it looks at is there.
    pub fn applies(&self, products: &Products) -> bool {
        self.reads().iter().all(|key| products.contains(key)) && self.finds_subject(products)
    }

    /// What does not hold in a view; nothing where a product is missing.
    ///
    /// # Errors
    /// If a product cannot be read.
    pub fn run(&self, products: &Products) -> Result<Vec<String>> {
        if self.applies(products) { self.faults(products) } else { Ok(Vec::new()) }
    }
}

/// A check of a crate, without state. Registered with [`register_check!`](crate::register_check).
#[derive(Clone, Copy)]
pub struct Check {
    /// Its name, in snake case.
    pub name: &'static str,
    /// What holds in a sound view, in one sentence.
    pub doc: &'static str,
    /// The products that it looks at. It is made where all of them are there.
    pub reads: fn() -> Vec<KeyId>,
    /// Whether the products have something to compare: a dataset that was read may lack a part of a record.
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
}

impl LabelCheck for Check {
    fn name(&self) -> &'static str {
        self.name
    }

    fn doc(&self) -> &str {
        self.doc
    }

    fn reads(&self) -> Vec<KeyId> {
        (self.reads)()
    }

    fn finds_subject(&self, products: &Products) -> bool {
        (self.finds_subject)(products)
    }

    fn faults(&self, products: &Products) -> Result<Vec<String>> {
        (self.faults)(products)
    }
}
