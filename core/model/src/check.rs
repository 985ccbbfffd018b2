//! Checks of labels against each other: statements that hold in every view, whatever its origin.
//!
//! A run checks every view before it writes the view. `syntable validate` checks existing datasets.

use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::scene::InstanceId;
use std::fmt;

/// A statement about the products of a view that can be tested. Crates register a [`Check`]; a program may add a check with state of
/// its own ([`Registry::with_checks`](crate::registry::Registry::with_checks)).
pub trait LabelCheck: Send + Sync {
    /// Its name, in snake case. [`intern`](crate::intern::intern) makes one at run time.
    fn name(&self) -> &'static str;
    /// The statement that holds in a sound view, in one sentence.
    fn doc(&self) -> &str;
    /// The products that it compares. The check runs if all of them are present.
    fn reads(&self) -> Vec<KeyId>;
    /// Whether the products have something to compare: a dataset that was read may lack a part of a record.
    fn finds_subject(&self, products: &Products) -> bool {
        let _ = products;
        true
    }
    /// Faults of a view, one sentence each.
    ///
    /// # Errors
    /// If a product cannot be read.
    fn faults(&self, products: &Products) -> Result<Vec<LabelFault>>;
}

impl dyn LabelCheck + '_ {
    /// Whether all products that it reads are present and have something to compare.
    pub fn applies(&self, products: &Products) -> bool {
        self.reads().iter().all(|key| products.contains(key)) && self.finds_subject(products)
    }

    /// Faults of a view; none if a product is missing or nothing can be compared.
    ///
    /// # Errors
    /// If a product cannot be read.
    pub fn run(&self, products: &Products) -> Result<Vec<LabelFault>> {
        if self.applies(products) { self.faults(products) } else { Ok(Vec::new()) }
    }
}

/// A fault that a check finds in a view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelFault {
    /// The faulty object; none for the view as a whole. A dataset that is read may have another name for the object, such as
    /// the id of its annotation.
    pub instance: Option<InstanceId>,
    /// The fault, in one sentence.
    pub message: String,
}

impl LabelFault {
    /// A fault of a view.
    pub fn new(message: impl Into<String>) -> Self {
        Self { instance: None, message: message.into() }
    }

    /// A fault of an object.
    pub fn of(instance: InstanceId, message: impl Into<String>) -> Self {
        Self { instance: Some(instance), message: message.into() }
    }
}

/// The object and the message.
impl fmt::Display for LabelFault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.instance {
            Some(id) => write!(f, "instance {id}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

/// A check of a crate, without state. Registered with [`register_check!`](crate::register_check).
#[derive(Clone, Copy)]
pub struct Check {
    /// Its name, in snake case.
    pub name: &'static str,
    /// The statement that holds in a sound view, in one sentence.
    pub doc: &'static str,
    /// The products that it compares. The check runs if all of them are present.
    pub reads: fn() -> Vec<KeyId>,
    /// Whether the products have something to compare: a dataset that was read may lack a part of a record.
    pub finds_subject: fn(&Products) -> bool,
    /// Faults of a view, one sentence each. An error means that a product cannot be read.
    pub faults: fn(&Products) -> Result<Vec<LabelFault>>,
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
    /// [`finds_subject`](Self::finds_subject) of a check that needs only its products.
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

    fn faults(&self, products: &Products) -> Result<Vec<LabelFault>> {
        (self.faults)(products)
    }
}
