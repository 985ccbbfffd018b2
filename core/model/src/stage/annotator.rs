//! Makes products from products.

use super::Site;
use crate::error::Result;
use crate::product::{Frame, KeyId, Scope};

/// Reads products and provides others. A pure function of the site and of what it declares to read.
pub trait Annotator: Send + Sync {
    /// The products that it reads.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, all of one scope.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them in the frame.
    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()>;

    /// How often it runs: the scope of its products.
    fn scope(&self) -> Scope {
        self.provides().first().map_or(Scope::View, |key| key.scope)
    }
}
