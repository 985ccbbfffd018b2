//! Why a recipe cannot be computed.

/// Why a recipe cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanError {
    /// The kind of mistake.
    pub fault: PlanFault,
    /// The table of the stage that reads the product, such as `write.png`.
    pub stage: String,
    /// The option of that stage that names the product, if one does.
    pub option: Option<String>,
    /// The product, as the stage names it.
    pub product: String,
    /// The names of all available products, if this one is unknown.
    pub known: Vec<String>,
    /// The tables of the stages that cannot go together.
    pub involved: Vec<String>,
    /// The message.
    pub message: String,
    /// A help message.
    pub help: String,
}

impl PlanError {
    pub(super) fn involve(&mut self, stages: Vec<String>) {
        self.involved = stages;
    }
}

/// The ways in which a plan fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanFault {
    /// Nothing provides the product.
    Unknown,
    /// Several stages provide or replace the product.
    Ambiguous,
    /// Stages need each other's products.
    Cycle,
    /// A stage reads the product as another type.
    WrongType,
    /// A writer cannot store the product.
    NotStorable,
    /// A stage reads a product that is made later.
    TooEarly,
}
